// Reading the samples of leaves without OpenVDB's own loop, which is serial and takes memory for each.
#include <openvdb/io/Archive.h>
#include <openvdb/openvdb.h>

#include "cloudvdb/cpp/chunks.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <stdexcept>

#include <fcntl.h>
#include <unistd.h>

namespace cloudvdb {

namespace {

const char *const kWrongSize = "the tree is damaged (a chunk of the wrong size)";
const char *const kChanged = "the file changed while it was read";
constexpr std::int64_t kSize = sizeof(std::int64_t);

// A stream over bytes in memory, which throws at the end of them.
class Bytes : private std::streambuf, public std::istream {
  public:
    Bytes() : std::istream(static_cast<std::streambuf *>(this)) { exceptions(std::ios::failbit | std::ios::badbit); }
    void set(char *from, std::size_t n) {
        clear();
        setg(from, from, from + n);
    }
};

} // namespace

Chunks::Chunks(const std::string &path) : file_(open(path.c_str(), O_RDONLY | O_CLOEXEC)) {
    if (file_ < 0) throw std::runtime_error("the file cannot be opened");
}
Chunks::~Chunks() { close(file_); }

void Chunks::find(GuardedStream &is, const GridEntry &grid, openvdb::FloatTree &tree) {
    compression_ = grid.compression, half_ = grid.tree_half;
    const bool masked = compression_ & openvdb::io::COMPRESS_ACTIVE_MASK, blosc = compression_ & openvdb::io::COMPRESS_BLOSC;
    const bool packed = blosc || (compression_ & openvdb::io::COMPRESS_ZIP);
    const std::int64_t width = half_ ? 2 : 4;
    std::vector<char> skipped;
    for (auto leaf = tree.beginLeaf(); leaf; ++leaf) {
        Leaf::NodeMaskType mask;
        mask.load(is);
        if (mask != leaf->getValueMask()) throw std::runtime_error("the tree is damaged (a leaf with two masks)");
        const int kind = is.number<std::int8_t>();
        if (kind < 0 || kind > openvdb::io::NO_MASK_AND_ALL_VALS) throw std::runtime_error("the tree is damaged (a node of an unknown kind)");
        using namespace openvdb::io;
        if (kind == NO_MASK_AND_ONE_INACTIVE_VAL || kind == MASK_AND_ONE_INACTIVE_VAL) is.number<float>();
        if (kind == MASK_AND_TWO_INACTIVE_VALS) is.number<std::uint64_t>();
        if (kind >= MASK_AND_NO_INACTIVE_VALS && kind <= MASK_AND_TWO_INACTIVE_VALS) mask.load(is);
        const bool whole = !masked || kind == NO_MASK_AND_ALL_VALS;
        const std::int64_t count = whole ? Leaf::SIZE : leaf->onVoxelCount(), plain = count * width;
        const std::int64_t at = is.tellg();
        std::int64_t bytes = packed && half_ && count == 0 ? 0 : plain; // of no half float at all OpenVDB stores not even a size
        const bool sized = packed && (count > 0 || !half_);
        if (sized) {
            const auto size = is.number<std::int64_t>(); // of compressed bytes, or minus that of plain bytes
            if (size > is.buffer().left()) throw std::runtime_error("the file ends too early, it was probably truncated");
            // What does not get smaller is stored plain, so that no chunk is larger by much.
            if (size <= 0 ? size != -plain : size > 2 * plain + 4096) throw std::runtime_error(kWrongSize);
            bytes = std::max(size, -size);
        }
        skipped.resize(std::size_t(bytes));
        is.read(skipped.data(), bytes); // cheaper than a seek, which drops the stream's buffer
        bytes += sized ? kSize : 0;
        chunks_.push_back({at, std::uint32_t(bytes), whole});
    }
}

void Chunks::read(std::size_t i, const Leaf &leaf, float *to) const {
    thread_local std::vector<char> bytes;
    thread_local Bytes is;
    const Chunk &chunk = chunks_.at(i);
    bytes.resize(chunk.bytes);
    for (std::size_t got = 0; got < chunk.bytes;) {
        const ssize_t n = pread(file_, bytes.data() + got, chunk.bytes - got, off_t(chunk.at) + off_t(got));
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0) throw std::runtime_error(kChanged);
        got += std::size_t(n);
    }
    const openvdb::Index count = chunk.whole ? Leaf::SIZE : openvdb::Index(leaf.onVoxelCount());
    if (compression_ & (openvdb::io::COMPRESS_BLOSC | openvdb::io::COMPRESS_ZIP) && chunk.bytes > 0) {
        std::int64_t size = 0;
        std::memcpy(&size, bytes.data(), sizeof size);
        const std::int64_t plain = std::int64_t(count) * (half_ ? 2 : 4);
        if (std::max(size, -size) + kSize != chunk.bytes || (size <= 0 && size != -plain)) throw std::runtime_error(kChanged);
        std::uint32_t own_size = 0; // which blosc believes
        if (size >= 16) std::memcpy(&own_size, bytes.data() + kSize + 12, sizeof own_size);
        const bool blosc = compression_ & openvdb::io::COMPRESS_BLOSC;
        if (blosc && size > 0 && own_size != std::uint64_t(size)) throw std::runtime_error(kWrongSize);
    }
    is.set(bytes.data(), chunk.bytes);
    float samples[Leaf::SIZE];
    if (half_) {
        openvdb::math::half halves[Leaf::SIZE];
        if (count > 0) openvdb::io::readData<openvdb::math::half>(is, halves, count, compression_);
        std::copy(halves, halves + count, samples);
    } else {
        openvdb::io::readData<float>(is, samples, count, compression_);
    }
    if (count == Leaf::SIZE && leaf.isDense()) {
        std::copy(samples, samples + count, to);
        return;
    }
    std::fill_n(to, std::size_t(Leaf::SIZE), 0.0f);
    const float *next = samples;
    for (auto value = leaf.getValueMask().beginOn(); value; ++value) to[value.pos()] = chunk.whole ? samples[value.pos()] : *next++;
}

} // namespace cloudvdb
