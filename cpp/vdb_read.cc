// Reading: the container (header, metadata, descriptors) is parsed here with every size checked against the file;
// transforms and trees are OpenVDB's, read through a stream that throws where OpenVDB would not notice.
#include <openvdb/io/Archive.h>
#include <openvdb/openvdb.h>

#include "cloudvdb/cpp/bricks.h"
#include "cloudvdb/cpp/guarded_stream.h"
#include "cloudvdb/cpp/vdb_bridge.h"
#include "cloudvdb/src/vdb/ffi.rs.h"

#include <algorithm>
#include <map>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#ifdef __GLIBC__
#include <malloc.h>
#endif

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

namespace cloudvdb {

namespace {

using Tree = openvdb::FloatTree;
using Leaf = Tree::LeafNodeType;
constexpr std::size_t kVoxels = Leaf::SIZE;
const std::string kFloatTree = "Tree_float_5_4_3";
const std::string kHalfSuffix = "_HalfFloat";

rust::String lossy(const std::string &text) { return rust::String::lossy(text.data(), text.size()); }
std::string file_name(rust::Slice<const std::uint8_t> path) { return std::string(path.begin(), path.end()); }

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
    explicit Container(GuardedStream &is) : marks_(std::make_shared<openvdb::io::StreamMetadata>()) {
        readHeader(is);
        if (fileVersion() < openvdb::OPENVDB_FILE_VERSION_NODE_MASK_COMPRESSION || fileVersion() > openvdb::OPENVDB_FILE_VERSION) {
            throw std::runtime_error("its format version is " + std::to_string(fileVersion()) + ", only 222 (OpenVDB 2, 2013) to " +
                                     std::to_string(openvdb::OPENVDB_FILE_VERSION) + " can be read");
        }
        openvdb::io::setStreamMetadataPtr(is, marks_, /*transfer=*/false);
        openvdb::io::setVersion(is, libraryVersion(), fileVersion());
        openvdb::io::setDataCompression(is, compression());
    }
    bool indexed() const { return inputHasGridOffsets(); }

  private:
    openvdb::io::StreamMetadata::Ptr marks_;
};

template <typename T> T as(const std::string &bytes) {
    T value{};
    if (bytes.size() != sizeof value) throw std::runtime_error("the metadata is damaged (a value of the wrong size)");
    std::memcpy(&value, bytes.data(), sizeof value);
    return value;
}

// What OpenVDB prints for a small value of another type (vectors, matrices).
std::string printed(const std::string &type, const std::string &bytes) {
    if (bytes.size() > 128 || !openvdb::Metadata::isRegisteredType(type)) return type + ", " + std::to_string(bytes.size()) + " bytes";
    const auto value = openvdb::Metadata::createMetadata(type);
    const auto size = std::uint32_t(bytes.size());
    std::istringstream is(std::string(reinterpret_cast<const char *>(&size), sizeof size) + bytes);
    is.exceptions(std::ios::failbit | std::ios::badbit);
    value->read(is);
    return value->str();
}

rust::Vec<MetaEntry> read_metadata(GuardedStream &is) {
    rust::Vec<MetaEntry> entries;
    for (auto left = is.number<std::uint32_t>(); left > 0; --left) {
        MetaEntry entry{lossy(is.text()), MetaKind::Int, {}, 0, 0.0};
        const std::string type = is.text(), bytes = is.text();
        if (type == "__delayedload") continue;
        if (type == "string") {
            entry.kind = MetaKind::Text, entry.text = lossy(bytes);
        } else if (type == "bool") {
            entry.whole = as<std::uint8_t>(bytes) != 0;
        } else if (type == "int32") {
            entry.whole = as<std::int32_t>(bytes);
        } else if (type == "int64") {
            entry.whole = as<std::int64_t>(bytes);
        } else if (type == "float") {
            entry.kind = MetaKind::Float, entry.real = double(as<float>(bytes));
        } else if (type == "double") {
            entry.kind = MetaKind::Float, entry.real = as<double>(bytes);
        } else {
            entry.kind = MetaKind::Text, entry.text = lossy(printed(type, bytes));
        }
        entries.push_back(std::move(entry));
    }
    return entries;
}

// Reads the transform into `grid`. False, with the stream left anywhere, where the map is not affine.
bool read_transform(GuardedStream &is, GridEntry &grid) {
    static const std::set<std::string> affine = {"AffineMap",         "ScaleMap",       "UniformScaleMap",
                                                 "ScaleTranslateMap", "TranslationMap", "UniformScaleTranslateMap",
                                                 "UnitaryMap"};
    const auto start = is.tellg();
    if (affine.count(is.text()) == 0) return false;
    is.seekg(start);
    openvdb::math::Transform transform;
    transform.read(is);
    const openvdb::Mat4d m = transform.baseMap()->getAffineMap()->getMat4();
    for (int i = 0; i < 12; ++i) grid.matrix[std::size_t(i)] = m(i / 3, i % 3);
    return grid.linear = true;
}

// A tree that is never freed unless it was read to the end: OpenVDB 10's nodes cannot be destroyed half-read
// (their child pointers are set after their masks), so a damaged file costs some memory instead of a crash.
std::unique_ptr<Tree> read_tree(GuardedStream &is, const GridEntry &grid) {
    is.seekg(grid.tree_at);
    openvdb::io::setDataCompression(is, grid.compression);
    const auto has = [&](std::uint32_t flag) { return (grid.compression & flag) != 0; };
    const bool blosc = has(openvdb::io::COMPRESS_BLOSC);
    if (blosc || has(openvdb::io::COMPRESS_ZIP)) {
        is.buffer().expect_chunks(grid.tree_half ? 2 : 4, has(openvdb::io::COMPRESS_ACTIVE_MASK), blosc);
    }
    openvdb::io::setGridBackgroundValuePtr(is, nullptr);
    auto *tree = new Tree(0.0f);
    tree->readTopology(is, grid.tree_half);
    tree->readBuffers(is, grid.tree_half);
    return std::unique_ptr<Tree>(tree);
}

// Free memory goes back to the system: leaves are many small pieces, which the C library would keep for more of their kind.
void give_back() {
#ifdef __GLIBC__
    malloc_trim(0);
#endif
}

GridEntry read_entry(GuardedStream &is, bool indexed, std::string &parent) {
    GridEntry grid{};
    const std::string unique_name = is.text();
    std::string type = is.text();
    parent = is.text();
    const std::size_t cut = type.size() - std::min(type.size(), kHalfSuffix.size());
    grid.half = grid.tree_half = type.compare(cut, std::string::npos, kHalfSuffix) == 0;
    if (grid.half) type.resize(cut);
    grid.unique_name = lossy(unique_name), grid.type_name = lossy(type);
    const auto grid_at = is.number<std::int64_t>();
    is.number<std::int64_t>(); // where the buffers begin
    const auto end_at = is.number<std::int64_t>();
    if (indexed) {
        if (grid_at < is.tellg() || end_at < grid_at) throw std::runtime_error("the file is damaged (its index of grids points backwards)");
        is.seekg(grid_at);
    }
    grid.compression = is.number<std::uint32_t>();
    grid.metadata = read_metadata(is);
    const bool linear = read_transform(is, grid);
    grid.tree_at = linear ? std::int64_t(is.tellg()) : -1;
    if (indexed) {
        is.seekg(end_at);
    } else if (parent.empty()) { // no index: the next grid is found by reading this one
        if (!linear || type != kFloatTree) throw std::runtime_error("the file has no index and cannot be read past a grid of type " + type);
        read_tree(is, grid);
    }
    return grid;
}

} // namespace

Found scan(rust::Slice<const std::uint8_t> path) {
    return reading([&] {
        GuardedStream is(file_name(path));
        const Container container(is);
        Found found{read_metadata(is), {}};
        std::map<std::string, std::size_t> by_name;
        std::vector<std::string> parents;
        for (auto left = is.number<std::int32_t>(); left > 0; --left) {
            found.grids.push_back(read_entry(is, container.indexed(), parents.emplace_back()));
            by_name.emplace(std::string(found.grids.back().unique_name), found.grids.size() - 1);
        }
        for (std::size_t i = 0; i < parents.size(); ++i) { // instances share another grid's tree
            if (parents[i].empty()) continue;
            GridEntry &grid = found.grids[i];
            const auto parent = by_name.find(parents[i]);
            grid.tree_at = -1;
            if (parent == by_name.end() || !parents[parent->second].empty()) continue;
            const GridEntry &shared = found.grids[parent->second];
            if (shared.type_name != grid.type_name) continue;
            grid.tree_at = shared.tree_at, grid.tree_half = shared.tree_half, grid.compression = shared.compression;
        }
        return found;
    });
}

Bricks::Bricks(std::unique_ptr<Inside> inside) : inside_(std::move(inside)) {}
Bricks::~Bricks() {
    inside_.reset();
    give_back();
}
std::size_t Bricks::count() const { return inside_->sources.size(); }

std::unique_ptr<Bricks> load(rust::Slice<const std::uint8_t> path, const GridEntry &grid, std::uint64_t max_voxels) {
    return reading([&] {
        if (grid.type_name != kFloatTree) throw std::runtime_error("not a FloatGrid of the usual shape but " + std::string(grid.type_name));
        if (grid.tree_at < 0) throw std::runtime_error("the grid refers to a tree that is not in the file");
        GuardedStream is(file_name(path));
        const Container container(is);
        auto inside = std::make_unique<Bricks::Inside>();
        inside->tree = read_tree(is, grid);
        inside->tree->evalActiveVoxelBoundingBox(inside->active);
        inside->max_voxels = max_voxels;
        auto tile = inside->tree->cbeginValueOn();
        tile.setMaxDepth(Tree::ValueOnCIter::LEAF_DEPTH - 1);
        for (; tile; ++tile) {
            if (*tile != 0.0f) inside->add_tile(tile.getBoundingBox(), *tile);
        }
        for (auto leaf = inside->tree->beginLeaf(); leaf; ++leaf) {
            bool empty = true;
            for (auto value = leaf->cbeginValueOn(); value && empty; ++value) empty = *value == 0.0f;
            if (!empty) inside->add(*leaf);
        }
        inside->sort();
        return std::make_unique<Bricks>(std::move(inside));
    });
}

rust::Vec<std::int32_t> Bricks::active() const {
    rust::Vec<std::int32_t> ends;
    if (inside_->active.empty()) return ends;
    for (const openvdb::Coord &end : {inside_->active.min(), inside_->active.max()}) {
        for (int axis = 0; axis < 3; ++axis) ends.push_back(end[axis]);
    }
    return ends;
}

void Bricks::take(std::size_t first, rust::Slice<std::int32_t> origins, rust::Slice<float> values) {
    auto &sources = inside_->sources;
    const std::size_t count = origins.size() / 3;
    if (origins.size() != count * 3 || values.size() != count * kVoxels || first > sources.size() || count > sources.size() - first) {
        throw std::invalid_argument("bricks and samples do not match");
    }
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, 64), [&](const tbb::blocked_range<std::size_t> &range) {
        for (std::size_t i = range.begin(); i < range.end(); ++i) {
            auto &source = sources[first + i];
            for (std::size_t axis = 0; axis < 3; ++axis) origins[3 * i + axis] = source.origin[int(axis)];
            float *to = values.data() + i * kVoxels;
            std::fill_n(to, kVoxels, source.tile);
            if (!source.leaf) continue;
            for (auto value = source.leaf->cbeginValueOn(); value; ++value) to[value.pos()] = *value;
            Leaf::Buffer none(openvdb::PartialCreate(), 0.0f);
            source.leaf->swap(none);
        }
    });
    give_back();
}

std::uint64_t count_active(rust::Slice<const std::uint8_t> path, const GridEntry &grid) {
    return reading([&]() -> std::uint64_t {
        if (grid.type_name != kFloatTree || grid.tree_at < 0) return 0;
        GuardedStream is(file_name(path));
        const Container container(is);
        return read_tree(is, grid)->activeVoxelCount();
    });
}

} // namespace cloudvdb
