// What is common to all that reads VDB files: the container (header, metadata, transforms) parsed with every size checked
// against the file, and trees, which are OpenVDB's, read through a stream that throws where OpenVDB would not notice.
// Names OpenVDB's types and includes none of its headers: whoever includes this has included openvdb/io/Archive.h before.
#pragma once

#include "cloudvdb/cpp/guarded_stream.h"
#include "cloudvdb/cpp/vdb_bridge.h"
#include "cloudvdb/src/vdb/ffi.rs.h"

#include <cstddef>
#include <map>
#include <new>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace cloudvdb {

inline const std::string kFloatTree = "Tree_float_5_4_3";

inline std::string file_name(rust::Slice<const std::uint8_t> path) { return std::string(path.begin(), path.end()); }

// Runs a function that reads, and says in plain words what a short read means.
template <typename F> auto reading(F f) -> decltype(f()) {
    initialize();
    try {
        return f();
    } catch (const std::ios_base::failure &) {
        throw std::runtime_error("the file ends too early or is damaged, it was probably truncated");
    } catch (const std::bad_alloc &) {
        throw std::runtime_error("the file asks for more memory than there is, it is probably damaged");
    }
}

// The header, and the marks on the stream that OpenVDB's reading functions look for.
class Container : public openvdb::io::Archive {
  public:
    explicit Container(GuardedStream &is);
    bool indexed() const { return inputHasGridOffsets(); }

  private:
    openvdb::io::StreamMetadata::Ptr marks_;
};

// A value of metadata as it is stored.
struct RawMeta {
    std::string key, type, bytes;
};
std::vector<RawMeta> read_raw_metadata(GuardedStream &is);
// The value where OpenVDB knows its type and it has the size of that type, else none.
openvdb::Metadata::Ptr understood(const RawMeta &raw);

// The transform; or none, with the stream left anywhere, where it is of a kind that cannot be read.
openvdb::math::Transform::Ptr read_transform(GuardedStream &is);

// Whether trees of this type have the usual shape and values of a fixed size, so that their chunks can be checked.
bool is_checkable(const std::string &tree_type);
// The tree, in a grid that has nothing else, which is never freed unless it was read to the end: OpenVDB 10's nodes cannot be
// destroyed half-read (their child pointers are set after their masks), so a damaged file costs some memory instead of a crash.
// Without `leaves` what they hold is left to read.
openvdb::GridBase::Ptr read_tree(GuardedStream &is, const GridEntry &grid, bool leaves = true);

} // namespace cloudvdb
