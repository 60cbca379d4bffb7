// Where the samples of a float grid's leaves are in their file: read one by one, and on several threads.
// Names OpenVDB's types and includes none of its headers: whoever includes this has included openvdb/io/Archive.h before.
#pragma once

#include "cloudvdb/cpp/vdb_container.h"

#include <cstdint>
#include <string>
#include <vector>

namespace cloudvdb {

class Chunks {
  public:
    using Leaf = openvdb::FloatTree::LeafNodeType;

    /// Nothing yet.
    explicit Chunks(const std::string &path);
    ~Chunks();
    Chunks(const Chunks &) = delete;
    Chunks &operator=(const Chunks &) = delete;

    /// Finds the chunks of a tree's leaves, of which `is` has read the topology and nothing else; every size is checked.
    void find(GuardedStream &is, const GridEntry &grid, openvdb::FloatTree &tree);
    /// The active samples of leaf `i` in the order of the tree, and zeros. Threads may call it at the same time.
    void read(std::size_t i, const Leaf &leaf, float *to) const;

  private:
    struct Chunk {
        std::int64_t at;     // where it begins in the file, with its size
        std::uint32_t bytes; // with its size
        bool whole;          // inactive samples are in it too
    };
    int file_;
    std::vector<Chunk> chunks_;
    std::uint32_t compression_ = 0;
    bool half_ = false;
};

} // namespace cloudvdb
