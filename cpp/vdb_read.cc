// Reading: what a file holds, and the bricks of its float grids.
#include <openvdb/io/Archive.h>
#include <openvdb/openvdb.h>

#include "cloudvdb/cpp/bricks.h"
#include "cloudvdb/cpp/chunks.h"
#include "cloudvdb/cpp/vdb_container.h"

#include <algorithm>
#include <map>
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
const std::string kHalfSuffix = "_HalfFloat";

rust::String lossy(const std::string &text) { return rust::String::lossy(text.data(), text.size()); }

template <typename T> T as(const std::string &bytes) {
    T value{};
    if (bytes.size() != sizeof value) throw std::runtime_error("the metadata is damaged (a value of the wrong size)");
    std::memcpy(&value, bytes.data(), sizeof value);
    return value;
}

// What OpenVDB prints for a small value of another type (vectors, matrices).
std::string printed(const RawMeta &raw) {
    const auto value = raw.bytes.size() <= 128 ? understood(raw) : nullptr;
    return value ? value->str() : raw.type + ", " + std::to_string(raw.bytes.size()) + " bytes";
}

rust::Vec<MetaEntry> read_metadata(GuardedStream &is) {
    rust::Vec<MetaEntry> entries;
    for (const RawMeta &raw : read_raw_metadata(is)) {
        MetaEntry entry{lossy(raw.key), MetaKind::Int, {}, 0, 0.0};
        if (raw.type == "string") {
            entry.kind = MetaKind::Text, entry.text = lossy(raw.bytes);
        } else if (raw.type == "bool") {
            entry.whole = as<std::uint8_t>(raw.bytes) != 0;
        } else if (raw.type == "int32") {
            entry.whole = as<std::int32_t>(raw.bytes);
        } else if (raw.type == "int64") {
            entry.whole = as<std::int64_t>(raw.bytes);
        } else if (raw.type == "float") {
            entry.kind = MetaKind::Float, entry.real = double(as<float>(raw.bytes));
        } else if (raw.type == "double") {
            entry.kind = MetaKind::Float, entry.real = as<double>(raw.bytes);
        } else {
            entry.kind = MetaKind::Text, entry.text = lossy(printed(raw));
        }
        entries.push_back(std::move(entry));
    }
    return entries;
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
    const auto begin = std::int64_t(is.tellg());
    grid.compression = is.number<std::uint32_t>();
    grid.metadata_at = std::int64_t(is.tellg());
    grid.metadata = read_metadata(is);
    const auto transform = read_transform(is);
    grid.linear = transform && transform->isLinear();
    if (grid.linear) {
        const openvdb::Mat4d m = transform->baseMap()->getAffineMap()->getMat4();
        for (int i = 0; i < 12; ++i) grid.matrix[std::size_t(i)] = m(i / 3, i % 3);
    }
    grid.checkable = is_checkable(type);
    grid.tree_at = transform ? std::int64_t(is.tellg()) : -1;
    if (indexed) {
        is.seekg(end_at);
    } else if (parent.empty()) { // no index: the next grid is found by reading this one
        if (!transform || !grid.checkable) throw std::runtime_error("the file has no index and cannot be read past a grid of type " + type);
        read_tree(is, grid);
    }
    grid.bytes = std::int64_t(is.tellg()) - begin;
    return grid;
}

} // namespace

Found scan(rust::Slice<const std::uint8_t> path) {
    return reading([&] {
        GuardedStream is(file_name(path));
        const Container container(is);
        Found found{read_metadata(is), {}, container.fileVersion(), {container.libraryVersion().first, container.libraryVersion().second}};
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
            if (shared.type_name != grid.type_name || shared.tree_at < 0) continue;
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
float Bricks::background() const { return inside_->tree->background(); }

std::unique_ptr<Bricks> load(rust::Slice<const std::uint8_t> path, const GridEntry &grid, std::uint64_t max_voxels) {
    return reading([&] {
        if (grid.type_name != kFloatTree) throw std::runtime_error("not a FloatGrid of the usual shape but " + std::string(grid.type_name));
        GuardedStream is(file_name(path));
        const Container container(is);
        auto inside = std::make_unique<Bricks::Inside>();
        inside->tree = openvdb::gridPtrCast<openvdb::FloatGrid>(read_tree(is, grid, /*leaves=*/false))->treePtr();
        const auto chunks = std::make_shared<Chunks>(file_name(path));
        chunks->find(is, grid, *inside->tree);
        inside->chunks = chunks;
        inside->tree->evalActiveVoxelBoundingBox(inside->active);
        inside->max_voxels = max_voxels;
        auto tile = inside->tree->cbeginValueOn();
        tile.setMaxDepth(Tree::ValueOnCIter::LEAF_DEPTH - 1);
        for (; tile; ++tile) {
            if (*tile != 0.0f) inside->add_tile(tile.getBoundingBox(), *tile);
        }
        std::size_t number = 0;
        for (auto leaf = inside->tree->beginLeaf(); leaf; ++leaf, ++number) {
            if (!leaf->isEmpty()) inside->add(*leaf, number);
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
    const auto copy = [&](const tbb::blocked_range<std::size_t> &range) {
        for (std::size_t i = range.begin(); i < range.end(); ++i) {
            auto &source = sources[first + i];
            for (std::size_t axis = 0; axis < 3; ++axis) origins[3 * i + axis] = source.origin[int(axis)];
            float *to = values.data() + i * kVoxels;
            if (source.leaf && inside_->chunks) {
                inside_->chunks->read(source.number, *source.leaf, to);
                continue;
            }
            std::fill_n(to, kVoxels, source.tile);
            if (!source.leaf) continue;
            for (auto value = source.leaf->cbeginValueOn(); value; ++value) to[value.pos()] = *value;
            Leaf::Buffer none(openvdb::PartialCreate(), 0.0f);
            source.leaf->swap(none);
        }
    };
    reading([&] { tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, 64), copy); });
    if (!inside_->chunks) give_back();
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
