// The inside of `Bricks`: a tree, and where each brick that leaves it comes from.
// Names OpenVDB's types and includes none of its headers: whoever includes this has included openvdb/openvdb.h before.
#pragma once

#include "cloudvdb/cpp/vdb_bridge.h"

#include <algorithm>
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

namespace cloudvdb {

class Chunks;

struct Bricks::Inside {
    using Tree = openvdb::FloatTree;
    using Leaf = Tree::LeafNodeType;
    struct Source {
        openvdb::Coord origin;
        Leaf *leaf; // or none, for a piece of a tile of this value
        float tile;
        std::size_t number; // of the leaf, in the order of the tree
    };
    std::shared_ptr<Tree> tree;
    std::shared_ptr<const Chunks> chunks; // what the leaves hold, where it is not in them
    openvdb::CoordBBox active;
    std::vector<Source> sources;
    std::uint64_t max_voxels = 0;

    void add(Leaf &leaf, std::size_t number = 0) {
        account(1);
        sources.push_back({leaf.origin(), &leaf, 0.0f, number});
    }
    void add_tile(const openvdb::CoordBBox &box, float value) {
        const auto side = std::uint64_t(std::int64_t(box.max().x()) - box.min().x() + 1) / Leaf::DIM; // tiles are cubes
        account(side * side * side);
        for (std::uint64_t i = 0; i < side * side * side; ++i) {
            const auto along = [&](std::uint64_t n) { return std::int32_t(n % side * Leaf::DIM); };
            sources.push_back({box.min() + openvdb::Coord(along(i / (side * side)), along(i / side), along(i)), nullptr, value, 0});
        }
    }
    /// Bricks in their order, each place once.
    void sort() {
        std::sort(sources.begin(), sources.end(), [](const auto &a, const auto &b) { return a.origin < b.origin; });
        const auto twice = std::adjacent_find(sources.begin(), sources.end(), [](const auto &a, const auto &b) { return a.origin == b.origin; });
        if (twice != sources.end()) throw std::runtime_error("the tree is damaged (two nodes in one place)");
    }

  private:
    void account(std::uint64_t more) {
        bricks_ += more;
        if (bricks_ > max_voxels / Leaf::SIZE) {
            throw std::runtime_error("the grid expands to more than " + std::to_string(max_voxels) +
                                     " voxels, most of them in tiles of one value; it is damaged, or too coarse a tile for a cloud");
        }
    }
    std::uint64_t bricks_ = 0;
};

} // namespace cloudvdb
