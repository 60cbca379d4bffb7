// Writing: bricks of samples become trees, trees become a file.
#include <openvdb/io/Archive.h>
#include <openvdb/openvdb.h>
#include <openvdb/tools/Prune.h>

#include "cloudvdb/cpp/draft.h"
#include "cloudvdb/src/vdb/ffi.rs.h"

#include <cerrno>
#include <cstring>
#include <fstream>
#include <mutex>
#include <stdexcept>
#include <string>
#include <vector>

#include <tbb/global_control.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

namespace cloudvdb {

namespace {

using Leaf = openvdb::FloatTree::LeafNodeType;
constexpr std::size_t kVoxels = Leaf::SIZE;
static_assert(kVoxels == 512, "a brick is a leaf");

void insert(openvdb::MetaMap &map, const MetaEntry &entry) {
    const std::string key(entry.key);
    switch (entry.kind) {
    case MetaKind::Text: map.insertMeta(key, openvdb::StringMetadata(std::string(entry.text))); break;
    case MetaKind::Int: map.insertMeta(key, openvdb::Int64Metadata(entry.whole)); break;
    default: map.insertMeta(key, openvdb::DoubleMetadata(entry.real)); break;
    }
}

// What becomes of a brick: nothing (all zero), a tile (one value), or a leaf of its own.
struct Node {
    std::unique_ptr<Leaf> leaf;
    float tile = 0.0f;
};

Node make_node(const openvdb::Coord &origin, const float *values) {
    Node node;
    bool uniform = true;
    for (std::size_t i = 1; i < kVoxels; ++i) uniform &= values[i] == values[0];
    if (uniform) {
        node.tile = values[0];
        return node;
    }
    node.leaf = std::make_unique<Leaf>(openvdb::PartialCreate(), origin, 0.0f, false);
    node.leaf->allocate();
    float *samples = node.leaf->buffer().data();
    Leaf::NodeMaskType mask;
    for (std::size_t word = 0; word < kVoxels / 64; ++word) {
        std::uint64_t bits = 0;
        for (std::size_t bit = 0; bit < 64; ++bit) {
            const float value = values[word * 64 + bit];
            samples[word * 64 + bit] = value == 0.0f ? 0.0f : value; // -0 is inactive too, and inactive values are +0
            bits |= std::uint64_t(value != 0.0f) << bit;
        }
        mask.getWord<std::uint64_t>(openvdb::Index(word)) = bits;
    }
    node.leaf->setValueMask(mask);
    return node;
}

openvdb::FloatTree::Ptr make_tree(rust::Slice<const std::int32_t> origins, rust::Slice<const float> values) {
    const std::size_t count = origins.size() / 3;
    if (origins.size() != count * 3 || values.size() != count * kVoxels) throw std::invalid_argument("bricks and samples do not match");
    const auto origin = [&](std::size_t i) { return openvdb::Coord(origins[3 * i], origins[3 * i + 1], origins[3 * i + 2]); };
    std::vector<Node> nodes(count);
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, 64), [&](const tbb::blocked_range<std::size_t> &range) {
        for (std::size_t i = range.begin(); i < range.end(); ++i) nodes[i] = make_node(origin(i), values.data() + i * kVoxels);
    });
    auto tree = std::make_shared<openvdb::FloatTree>(0.0f);
    openvdb::tree::ValueAccessor<openvdb::FloatTree> accessor(*tree);
    for (std::size_t i = 0; i < count; ++i) {
        if (nodes[i].leaf) {
            accessor.addLeaf(nodes[i].leaf.release());
        } else if (nodes[i].tile != 0.0f) {
            accessor.addTile(1, origin(i), nodes[i].tile, true);
        }
    }
    accessor.clear();
    openvdb::tools::pruneTiles(*tree, 0.0f);
    return tree;
}

// An archive with an index of its grids (as io::File writes it) into a stream of ours, so that no failure goes unseen.
class IndexedArchive : public openvdb::io::Archive {
  public:
    void write_to(std::ostream &os, const openvdb::GridCPtrVec &grids, const openvdb::MetaMap &metadata) const {
        Archive::write(os, grids, /*seekable=*/true, metadata);
    }
};

} // namespace

void initialize() {
    static std::once_flag once;
    std::call_once(once, [] { openvdb::initialize(); });
}

Draft::Draft() : inside_(std::make_unique<Inside>()) {}
Draft::~Draft() = default;

void limit_threads(std::size_t threads) {
    static std::unique_ptr<tbb::global_control> limit;
    limit = std::make_unique<tbb::global_control>(tbb::global_control::max_allowed_parallelism, threads);
}

std::unique_ptr<Draft> new_draft() {
    initialize();
    return std::make_unique<Draft>();
}

void Draft::add(rust::Str name, bool half, rust::Slice<const double> world_from_index, rust::Slice<const std::int32_t> origins,
                rust::Slice<const float> values, rust::Slice<const MetaEntry> metadata) {
    auto grid = openvdb::FloatGrid::create(make_tree(origins, values));
    for (const MetaEntry &entry : metadata) insert(*grid, entry);
    // Picks the simplest map that says the same.
    grid->setTransform(openvdb::math::Transform::createLinearTransform(matrix(world_from_index)));
    grid->setName(std::string(name));
    grid->setGridClass(openvdb::GRID_FOG_VOLUME);
    grid->setSaveFloatAsHalf(half);
    inside_->grids.push_back(grid);
}

std::int32_t Draft::save(rust::Slice<const std::uint8_t> path, rust::Slice<const MetaEntry> metadata) const {
    openvdb::MetaMap map;
    for (const MetaEntry &entry : metadata) insert(map, entry);
    IndexedArchive archive;
    archive.setCompression(openvdb::io::COMPRESS_BLOSC | openvdb::io::COMPRESS_ACTIVE_MASK);
    std::vector<char> buffer(1 << 20);
    std::ofstream os;
    os.rdbuf()->pubsetbuf(buffer.data(), std::streamsize(buffer.size()));
    errno = 0;
    const auto failure = [] { return std::int32_t(errno != 0 ? errno : EIO); };
    os.open(std::string(path.begin(), path.end()), std::ios::out | std::ios::binary | std::ios::trunc);
    if (!os) return failure();
    os.exceptions(std::ios::failbit | std::ios::badbit);
    try {
        errno = 0;
        archive.write_to(os, inside_->grids, map);
        errno = 0;
        os.close(); // flushes, and throws if that fails
    } catch (const std::ios_base::failure &) {
        const std::int32_t code = failure();
        os.exceptions(std::ios::goodbit);
        return code;
    }
    return 0;
}

} // namespace cloudvdb
