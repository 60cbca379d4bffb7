// The parts that every reader of VDB files needs.
#include <openvdb/io/Archive.h>
#include <openvdb/openvdb.h>

#include "cloudvdb/cpp/vdb_container.h"

#include <algorithm>
#include <cstring>
#include <iterator>
#include <memory>
#include <set>
#include <sstream>

namespace cloudvdb {

namespace {

// How wide a value is in memory, in a chunk, and in a chunk of half floats.
struct Width {
    const char *type;
    std::size_t value, stored, halved;
};
constexpr Width kWidths[] = {
    {"Tree_bool_5_4_3", 1, 1, 1},    {"Tree_mask_5_4_3", 1, 1, 1},    {"Tree_int32_5_4_3", 4, 4, 4},
    {"Tree_int64_5_4_3", 8, 8, 8},   {"Tree_float_5_4_3", 4, 4, 2},   {"Tree_double_5_4_3", 8, 8, 2},
    {"Tree_vec3i_5_4_3", 12, 12, 12}, {"Tree_vec3s_5_4_3", 12, 12, 6}, {"Tree_vec3d_5_4_3", 24, 24, 6},
};

const Width *width_of(const std::string &tree_type) {
    const auto found = std::find_if(std::begin(kWidths), std::end(kWidths), [&](const Width &w) { return tree_type == w.type; });
    return found == std::end(kWidths) ? nullptr : found;
}

bool is_affine(const std::string &map) {
    static const std::set<std::string> known = {"AffineMap",         "ScaleMap",       "UniformScaleMap",
                                                "ScaleTranslateMap", "TranslationMap", "UniformScaleTranslateMap",
                                                "UnitaryMap"};
    return known.count(map) > 0;
}

// OpenVDB counts from the root's first entry to know where an iterator is, so that a pass over n entries takes n^2 steps; and
// each entry spans 4096 voxels: a tree that needs more is no cloud.
constexpr std::uint64_t kMostRootEntries = 1 << 13;

// Refuses a root with too many entries, before a byte of memory is taken for one; the stream stays where it is. The background is
// written whole, among half floats too.
void check_root(GuardedStream &is, std::size_t background) {
    const auto start = is.tellg();
    is.bytes(sizeof(std::int32_t) + background);
    const std::uint64_t tiles = is.number<std::uint32_t>(), children = is.number<std::uint32_t>();
    if (tiles + children > kMostRootEntries) {
        throw std::runtime_error("the root of the tree has " + std::to_string(tiles + children) + " entries of 4096^3 voxels, more than " +
                                 std::to_string(kMostRootEntries) + "; it is damaged, or no cloud");
    }
    is.seekg(start);
}

// Leaves of truth values say themselves where they are: each must be where its parents have it.
template <typename Grid> void check_places(const openvdb::GridBase::Ptr &grid) {
    const auto &tree = openvdb::gridPtrCast<Grid>(grid)->tree();
    for (auto leaf = tree.cbeginLeaf(); leaf; ++leaf) {
        if (tree.probeConstLeaf(leaf->origin()) != leaf.getLeaf()) throw std::runtime_error("the tree is damaged (a leaf out of its place)");
    }
}

} // namespace

Container::Container(GuardedStream &is) : marks_(std::make_shared<openvdb::io::StreamMetadata>()) {
    readHeader(is);
    if (fileVersion() < openvdb::OPENVDB_FILE_VERSION_NODE_MASK_COMPRESSION || fileVersion() > openvdb::OPENVDB_FILE_VERSION) {
        throw std::runtime_error("its format version is " + std::to_string(fileVersion()) + ", only 222 (OpenVDB 2, 2013) to " +
                                 std::to_string(openvdb::OPENVDB_FILE_VERSION) + " can be read");
    }
    openvdb::io::setStreamMetadataPtr(is, marks_, /*transfer=*/false);
    openvdb::io::setVersion(is, libraryVersion(), fileVersion());
    openvdb::io::setDataCompression(is, compression());
}

std::vector<RawMeta> read_raw_metadata(GuardedStream &is) {
    std::vector<RawMeta> all;
    for (auto left = is.number<std::uint32_t>(); left > 0; --left) {
        RawMeta raw;
        raw.key = is.text(), raw.type = is.text(), raw.bytes = is.text();
        if (raw.type != "__delayedload") all.push_back(std::move(raw)); // that holds offsets of this very file
    }
    return all;
}

openvdb::Metadata::Ptr understood(const RawMeta &raw) {
    if (!openvdb::Metadata::isRegisteredType(raw.type)) return nullptr;
    auto value = openvdb::Metadata::createMetadata(raw.type);
    if (raw.type != "string" && value->size() != raw.bytes.size()) return nullptr;
    const auto size = std::uint32_t(raw.bytes.size());
    std::istringstream is(std::string(reinterpret_cast<const char *>(&size), sizeof size) + raw.bytes);
    is.exceptions(std::ios::failbit | std::ios::badbit);
    value->read(is);
    return value;
}

openvdb::math::Transform::Ptr read_transform(GuardedStream &is) {
    const auto start = is.tellg();
    const std::string kind = is.text();
    if (kind == "NonlinearFrustumMap") { // a box, two numbers, and an affine map
        is.bytes(8 * sizeof(double));
        if (!is_affine(is.text())) return nullptr;
    } else if (!is_affine(kind)) {
        return nullptr;
    }
    is.seekg(start);
    auto transform = std::make_shared<openvdb::math::Transform>();
    transform->read(is);
    return transform;
}

bool is_checkable(const std::string &tree_type) { return width_of(tree_type) != nullptr; }

openvdb::GridBase::Ptr read_tree(GuardedStream &is, const GridEntry &entry, bool leaves) {
    const std::string type(entry.type_name);
    const Width *width = width_of(type);
    if (!width) throw std::runtime_error("trees of the type " + type + " cannot be read");
    if (entry.tree_at < 0) throw std::runtime_error("the grid refers to a tree that is not in the file");
    is.seekg(entry.tree_at);
    openvdb::io::setDataCompression(is, entry.compression);
    const auto has = [&](std::uint32_t flag) { return (entry.compression & flag) != 0; };
    const bool blosc = has(openvdb::io::COMPRESS_BLOSC);
    is.buffer().expect_none();
    check_root(is, width->value);
    if (blosc || has(openvdb::io::COMPRESS_ZIP)) {
        const std::size_t stored = entry.tree_half ? width->halved : width->stored;
        is.buffer().expect_chunks(width->value, stored, has(openvdb::io::COMPRESS_ACTIVE_MASK), blosc);
    }
    openvdb::io::setGridBackgroundValuePtr(is, nullptr);
    auto unfreed = std::make_unique<openvdb::GridBase::Ptr>(openvdb::GridBase::createGrid(type));
    auto *const kept = unfreed.release();
    openvdb::TreeBase &tree = (*kept)->baseTree();
    tree.readTopology(is, entry.tree_half);
    if (leaves) tree.readBuffers(is, entry.tree_half);
    is.buffer().expect_none();
    unfreed.reset(kept);
    if (!leaves) return *unfreed;
    if (type == openvdb::BoolTree::treeType()) check_places<openvdb::BoolGrid>(*unfreed);
    if (type == openvdb::MaskTree::treeType()) check_places<openvdb::MaskGrid>(*unfreed);
    return *unfreed;
}

} // namespace cloudvdb
