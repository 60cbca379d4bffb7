// From a closed mesh to signed distances, by OpenVDB's own tool.
#include <openvdb/openvdb.h>
#include <openvdb/tools/MeshToVolume.h>

#include "cloudvdb/cpp/bricks.h"
#include "cloudvdb/src/vdb/ffi.rs.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <vector>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

namespace cloudvdb {

namespace {

using Leaf = openvdb::FloatTree::LeafNodeType;
// Of these types the tool is compiled within the library: of others it takes minutes here.
using Mesh = openvdb::tools::QuadAndTriangleDataAdapter<openvdb::Vec3s, openvdb::Vec3I>;

// Measures the band of a leaf again, to the triangles nearest its samples and their neighbours. OpenVDB's own tool leaves some
// samples about two voxels from the surface with the distance to a part of a triangle that is not the nearest.
void measure(Leaf &leaf, const Mesh &mesh, openvdb::tree::ValueAccessor<const openvdb::Int32Tree> &nearest) {
    constexpr int kSide = Leaf::DIM + 2;
    std::array<openvdb::Int32, kSide * kSide * kSide> around;
    const openvdb::Coord corner = leaf.origin().offsetBy(-1);
    for (int i = 0; i < int(around.size()); ++i) {
        const openvdb::Coord at = corner + openvdb::Coord(i / (kSide * kSide), i / kSide % kSide, i % kSide);
        if (!nearest.probeValue(at, around[std::size_t(i)])) around[std::size_t(i)] = -1;
    }
    float *samples = leaf.buffer().data();
    std::array<openvdb::Int32, 27> seen;
    for (auto value = leaf.cbeginValueOn(); value; ++value) {
        const openvdb::Coord at = value.getCoord(), in = at - corner;
        const openvdb::Vec3d p = at.asVec3d();
        double least = double(samples[value.pos()]) * samples[value.pos()];
        auto end = seen.begin();
        for (int n = 0; n < 27; ++n) {
            const int x = in.x() + n / 9 - 1, y = in.y() + n / 3 % 3 - 1, z = in.z() + n % 3 - 1;
            const openvdb::Int32 triangle = around[std::size_t((x * kSide + y) * kSide + z)];
            if (triangle < 0 || std::find(seen.begin(), end, triangle) != end) continue;
            *end++ = triangle;
            openvdb::Vec3d a, b, c, uvw;
            mesh.getIndexSpacePoint(std::size_t(triangle), 0, a);
            mesh.getIndexSpacePoint(std::size_t(triangle), 1, b);
            mesh.getIndexSpacePoint(std::size_t(triangle), 2, c);
            least = std::min(least, (p - openvdb::math::closestPointOnTriangleToPoint(a, c, b, p, uvw)).lengthSqr());
        }
        samples[value.pos()] = std::copysign(float(std::sqrt(least)), samples[value.pos()]);
    }
}

} // namespace

std::unique_ptr<Bricks> mesh_depth(rust::Slice<const double> points, rust::Slice<const std::uint32_t> triangles, float exterior,
                                   float interior, std::uint64_t max_voxels) {
    initialize();
    const std::size_t vertices = points.size() / 3;
    std::vector<openvdb::Vec3s> corners(vertices);
    for (std::size_t i = 0; i < vertices; ++i) {
        corners[i] = {float(points[3 * i]), float(points[3 * i + 1]), float(points[3 * i + 2])};
    }
    std::vector<openvdb::Vec3I> faces(triangles.size() / 3);
    for (std::size_t i = 0; i < faces.size(); ++i) {
        faces[i] = {triangles[3 * i], triangles[3 * i + 1], triangles[3 * i + 2]};
        for (int k = 0; k < 3; ++k) {
            if (faces[i][k] >= vertices) throw std::invalid_argument("a triangle names a vertex that is not there");
        }
    }
    const Mesh mesh(corners, faces);
    openvdb::Int32Grid nearest;
    // Where bands end, samples near edges and corners may be missed: kMargin voxels farther, those that count are there.
    constexpr float kMargin = 2.0f;
    // Renormalising smooths bumps where surfaces cross, and moves distances everywhere else: here they are distances.
    openvdb::util::NullInterrupter uninterrupted;
    const auto grid = openvdb::tools::meshToVolume<openvdb::FloatGrid>(uninterrupted, mesh, openvdb::math::Transform(), exterior + kMargin,
                                                                       interior + kMargin, openvdb::tools::DISABLE_RENORMALIZATION, &nearest);
    auto inside = std::make_unique<Bricks::Inside>();
    inside->max_voxels = max_voxels;
    inside->tree = grid->treePtr();
    auto tile = inside->tree->cbeginValueAll();
    tile.setMaxDepth(openvdb::FloatTree::ValueAllCIter::LEAF_DEPTH - 1);
    for (; tile; ++tile) { // what the surface encloses beyond the band
        if (*tile < 0.0f) inside->add_tile(tile.getBoundingBox(), std::min(-*tile, interior));
    }
    std::vector<Leaf *> leaves;
    inside->tree->getNodes(leaves);
    const auto depth = [&](float distance) { return std::min(std::max(-distance, -exterior), interior); };
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, leaves.size(), 64), [&](const tbb::blocked_range<std::size_t> &range) {
        openvdb::tree::ValueAccessor<const openvdb::Int32Tree> accessor(nearest.constTree());
        for (std::size_t i = range.begin(); i < range.end(); ++i) {
            measure(*leaves[i], mesh, accessor);
            bool holds = false;
            float *samples = leaves[i]->buffer().data();
            for (std::size_t voxel = 0; voxel < Leaf::SIZE; ++voxel) {
                samples[voxel] = depth(samples[voxel]);
                holds |= samples[voxel] > -exterior;
            }
            if (holds) {
                leaves[i]->setValuesOn();
            } else {
                leaves[i] = nullptr;
            }
        }
    });
    for (Leaf *leaf : leaves) {
        if (leaf) inside->add(*leaf);
    }
    inside->sort();
    return std::make_unique<Bricks>(std::move(inside));
}

} // namespace cloudvdb
