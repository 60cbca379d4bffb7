// The inside of `Draft`: grids that wait to be written.
// Names OpenVDB's types and includes none of its headers: whoever includes this has included openvdb/openvdb.h before.
#pragma once

#include "cloudvdb/cpp/vdb_bridge.h"

#include <cstdint>
#include <map>
#include <stdexcept>
#include <utility>

namespace cloudvdb {

struct Draft::Inside {
    openvdb::GridCPtrVec grids;
    // Trees of files, by name and place: instances share them.
    std::map<std::pair<std::string, std::int64_t>, openvdb::TreeBase::Ptr> carried;
};

// OpenVDB multiplies row vectors from the left, so the columns that come in are the rows here.
inline openvdb::Mat4d matrix(rust::Slice<const double> m) {
    if (m.size() != 12) throw std::invalid_argument("a transform has 12 numbers");
    return openvdb::Mat4d(m[0], m[1], m[2], 0.0, m[3], m[4], m[5], 0.0, m[6], m[7], m[8], 0.0, m[9], m[10], m[11], 1.0);
}

} // namespace cloudvdb
