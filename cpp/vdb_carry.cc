// Grids that are written as they were read.
#include <openvdb/io/Archive.h>
#include <openvdb/math/Maps.h>
#include <openvdb/openvdb.h>

#include "cloudvdb/cpp/draft.h"
#include "cloudvdb/cpp/vdb_container.h"

#include <memory>
#include <stdexcept>
#include <string>

namespace cloudvdb {

namespace {

using openvdb::math::Transform;

Transform::Ptr turned(const Transform &transform, const openvdb::Mat4d &turn) {
    if (transform.isLinear()) return Transform::createLinearTransform(transform.baseMap()->getAffineMap()->getMat4() * turn);
    const auto frustum = transform.constMap<openvdb::math::NonlinearFrustumMap>();
    if (!frustum) throw std::runtime_error("its transform is of an unknown kind");
    const auto second = std::make_shared<openvdb::math::AffineMap>(frustum->secondMap().getMat4() * turn);
    return std::make_shared<Transform>(openvdb::math::MapBase::Ptr(std::make_shared<openvdb::math::NonlinearFrustumMap>(
        frustum->getBBox(), frustum->getTaper(), frustum->getDepth(), second)));
}

} // namespace

void Draft::carry(rust::Slice<const std::uint8_t> path, const GridEntry &entry, rust::Slice<const double> turn) {
    reading([&] {
        GuardedStream is(file_name(path));
        const Container container(is);
        is.seekg(entry.metadata_at);
        const auto grid = openvdb::GridBase::createGrid(std::string(entry.type_name));
        for (const RawMeta &raw : read_raw_metadata(is)) {
            if (const auto value = understood(raw)) {
                grid->insertMeta(raw.key, *value);
            } else {
                openvdb::UnknownMetadata bytes(raw.type);
                bytes.setValue(openvdb::UnknownMetadata::ByteVec(raw.bytes.begin(), raw.bytes.end()));
                grid->insertMeta(raw.key, bytes);
            }
        }
        const auto transform = read_transform(is);
        if (!transform) throw std::runtime_error("its transform is of an unknown kind");
        grid->setTransform(turn.empty() ? transform : turned(*transform, matrix(turn)));
        auto &tree = inside_->carried[{file_name(path), entry.tree_at}];
        if (!tree) tree = read_tree(is, entry)->baseTreePtr();
        grid->setTree(tree);
        const std::string unique(entry.unique_name), name = unique.substr(0, unique.find('\x1e')); // that and a number make it so
        if (grid->getName() != name) grid->setName(name);
        if (grid->saveFloatAsHalf() != entry.half) grid->setSaveFloatAsHalf(entry.half);
        inside_->grids.push_back(grid);
    });
}

} // namespace cloudvdb
