// A file stream that lets OpenVDB 10 read files which nobody checked.
//
// OpenVDB tests neither the state of its stream (after a short read it carries on with memory that was never written)
// nor the size of a chunk stored without compression (it reads as many bytes as the file says into a buffer of fixed size,
// and compares afterwards). So this stream throws at the first short read, and follows the few reads that lead up to
// a chunk (mask, kind of inactive values, size) to refuse a wrong size before a byte of it is copied. Blosc believes the size
// in a chunk's own header, so that is compared too.
#pragma once

#include <cstdint>
#include <cstring>
#include <fstream>
#include <istream>
#include <stdexcept>
#include <string>

namespace cloudvdb {

class GuardedBuffer : public std::streambuf {
  public:
    explicit GuardedBuffer(const std::string &path) {
        if (!file_.open(path, std::ios::in | std::ios::binary)) throw std::runtime_error("the file cannot be opened");
        size_ = std::streamoff(file_.pubseekoff(0, std::ios::end, std::ios::in));
        if (size_ < 0 || file_.pubseekpos(0, std::ios::in) < 0) throw std::runtime_error("the file cannot be read by position");
    }

    std::int64_t size() const { return size_; }
    std::int64_t left() const { return size_ - at_; }

    /// From here on chunks of a tree follow. Values are `value_bytes` wide in memory and `stored_bytes` in a chunk (less for half
    /// floats), and stored for active voxels only if `masked`.
    void expect_chunks(std::size_t value_bytes, std::size_t stored_bytes, bool masked, bool blosc) {
        stage_ = Stage::Elsewhere;
        value_bytes_ = std::streamsize(value_bytes), stored_bytes_ = std::int64_t(stored_bytes), masked_ = masked, blosc_ = blosc;
        guarding_ = true;
    }
    /// From here on there are no chunks.
    void expect_none() { guarding_ = false; }

  protected:
    std::streamsize xsgetn(char *to, std::streamsize n) override {
        if (n < 0 || n > left()) return 0; // the caller sees the end of the file
        const std::streamsize got = file_.sgetn(to, n);
        at_ += got;
        if (guarding_ && got == n) follow(to, n);
        return got;
    }
    int_type underflow() override { return file_.sgetc(); }
    int_type uflow() override {
        const int_type c = file_.sbumpc();
        if (c != traits_type::eof()) ++at_;
        return c;
    }
    pos_type seekoff(off_type off, std::ios::seekdir way, std::ios::openmode mode) override {
        const std::int64_t base = way == std::ios::beg ? 0 : way == std::ios::cur ? at_ : size_;
        if (way == std::ios::cur && off == 0) return pos_type(at_);
        if (off < -base || off > size_ - base) return pos_type(off_type(-1));
        return seekpos(pos_type(base + off), mode);
    }
    pos_type seekpos(pos_type to, std::ios::openmode) override {
        if (off_type(to) < 0 || off_type(to) > size_) return pos_type(off_type(-1));
        const pos_type reached = file_.pubseekpos(to, std::ios::in);
        if (reached >= 0) at_ = off_type(reached);
        return reached;
    }

  private:
    // Reads before a chunk: [child mask] value mask, 1 byte of kind, 0 to 2 inactive values, [selection mask], 8 bytes of size.
    enum class Stage { Elsewhere, Mask, Inactive, Selection, Size, Chunk };

    void follow(const char *bytes, std::streamsize n) {
        switch (stage_) {
        case Stage::Inactive:
            expect(n == value_bytes_);
            --inactive_;
            return next();
        case Stage::Selection:
            expect(n * 8 == slots_);
            selects_ = false;
            return next();
        case Stage::Size: {
            expect(n == 8);
            std::int64_t size = 0;
            std::memcpy(&size, bytes, 8);
            check(size);
            packed_ = size > 0;
            stage_ = size == 0 ? Stage::Elsewhere : Stage::Chunk;
            return;
        }
        case Stage::Chunk: {
            stage_ = Stage::Elsewhere;
            std::uint32_t own_size = 0;
            if (n >= 16) std::memcpy(&own_size, bytes + 12, 4);
            if (packed_ && blosc_ && own_size != std::uint64_t(n)) throw std::runtime_error(kWrongSize);
            return;
        }
        default: break;
        }
        if (n == 64 || n == 512 || n == 4096) { // of a leaf, and of the two levels of nodes above
            stage_ = Stage::Mask;
            slots_ = std::int64_t(n) * 8, active_ = 0;
            for (std::streamsize i = 0; i < n; ++i) active_ += __builtin_popcount(static_cast<unsigned char>(bytes[i]));
        } else if (n == 1 && stage_ == Stage::Mask) {
            kind_ = bytes[0];
            if (kind_ < 0 || kind_ > 6) throw std::runtime_error("the tree is damaged (a node of an unknown kind)");
            inactive_ = kind_ == 5 ? 2 : kind_ == 2 || kind_ == 4 ? 1 : 0;
            selects_ = kind_ >= 3 && kind_ <= 5;
            next();
        } else {
            stage_ = Stage::Elsewhere; // the mask of a bool leaf, which has no chunk; and what is no node
        }
    }

    // What follows the kind of a node; no size at all follows where OpenVDB has no half float to read.
    void next() {
        const bool none = room() == 0 && stored_bytes_ != value_bytes_;
        stage_ = inactive_ > 0 ? Stage::Inactive : selects_ ? Stage::Selection : none ? Stage::Elsewhere : Stage::Size;
    }

    std::int64_t room() const { return (masked_ && kind_ != 6 ? active_ : slots_) * stored_bytes_; }

    // A positive size is that of compressed bytes, a negative one that of plain bytes.
    void check(std::int64_t size) const {
        if (size > left()) throw std::runtime_error("the file ends too early, it was probably truncated");
        if (size <= 0 && size != -room()) throw std::runtime_error(kWrongSize);
    }

    static void expect(bool as_known) {
        if (!as_known) throw std::runtime_error("OpenVDB reads its trees in another way than is known here");
    }

    static constexpr const char *kWrongSize = "the tree is damaged (a chunk of the wrong size)";

    std::filebuf file_;
    std::int64_t size_ = 0, at_ = 0;
    bool guarding_ = false, masked_ = true, blosc_ = true, packed_ = false, selects_ = false;
    std::streamsize value_bytes_ = 4;
    Stage stage_ = Stage::Elsewhere;
    int kind_ = 0, inactive_ = 0;
    std::int64_t stored_bytes_ = 4, slots_ = 0, active_ = 0;
};

/// The stream over such a buffer; every read that falls short throws.
class GuardedStream : private GuardedBuffer, public std::istream {
  public:
    explicit GuardedStream(const std::string &path) : GuardedBuffer(path), std::istream(static_cast<GuardedBuffer *>(this)) {
        exceptions(std::ios::failbit | std::ios::badbit);
    }
    GuardedBuffer &buffer() { return *this; }

    template <typename T> T number() {
        T value{};
        read(reinterpret_cast<char *>(&value), sizeof value);
        return value;
    }
    /// So many bytes, which the file must hold before memory is taken for them.
    std::string bytes(std::uint64_t n) {
        if (n > std::uint64_t(buffer().left())) throw std::runtime_error("the file ends too early, it was probably truncated");
        std::string text(n, '\0');
        if (n > 0) read(&text[0], std::streamsize(n));
        return text;
    }
    std::string text() { return bytes(number<std::uint32_t>()); }
};

} // namespace cloudvdb
