// What a grid holds, value by value: for `cloudvdb doctor`.
#include <openvdb/io/Archive.h>
#include <openvdb/openvdb.h>

#include "cloudvdb/cpp/vdb_container.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <deque>
#include <limits>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <unordered_map>

namespace cloudvdb {

namespace {

constexpr int kSide = 8; // of a leaf
// The most leaves that tiles may count for, and the most bundles of columns held at once (200 MB).
constexpr std::uint64_t kMostSteps = 1 << 24;
constexpr std::size_t kMostBundles = 1 << 18;

// A value as a density: of a vector the mean, as Cycles takes it.
template <typename T> double scalar(const T &value) {
    if constexpr (openvdb::VecTraits<T>::IsVec) {
        return (double(value[0]) + double(value[1]) + double(value[2])) / 3.0;
    } else {
        return double(value);
    }
}

// 8 x 8 columns of voxels along an axis: their sums, and where they begin and end.
struct Bundle {
    std::array<float, kSide * kSide> sum{};
    std::array<std::int32_t, kSide * kSide> first, last;
    Bundle() {
        first.fill(std::numeric_limits<std::int32_t>::max());
        last.fill(std::numeric_limits<std::int32_t>::min());
    }
    void add(int column, float more, std::int32_t from, std::int32_t to) {
        const auto i = std::size_t(column);
        sum[i] += more;
        first[i] = std::min(first[i], from), last[i] = std::max(last[i], to);
    }
};

// All columns along an axis that meet a value above 0.
class Columns {
  public:
    explicit Columns(int axis) : axis_(axis), u_((axis + 1) % 3), v_((axis + 2) % 3) {}

    /// The bundle over a leaf's place, or none where there are too many.
    Bundle *over(const openvdb::Coord &origin) {
        const auto key = std::uint64_t(std::uint32_t(origin[u_])) << 32 | std::uint32_t(origin[v_]);
        const auto found = places_.find(key);
        if (found != places_.end()) return &bundles_[found->second];
        if (bundles_.size() == kMostBundles) return nullptr;
        places_.emplace(key, bundles_.size());
        return &bundles_.emplace_back();
    }

    bool add(const openvdb::Coord &origin, const std::array<float, 512> &values) {
        Bundle *const bundle = over(origin);
        if (!bundle) return false;
        for (int i = 0; i < 512; ++i) {
            if (!(values[std::size_t(i)] > 0.0f)) continue;
            const int at[3] = {i >> 6, i >> 3 & 7, i & 7};
            const std::int32_t place = origin[axis_] + at[axis_];
            bundle->add(at[u_] << 3 | at[v_], values[std::size_t(i)], place, place);
        }
        return true;
    }

    bool add(const openvdb::CoordBBox &tile, float value) {
        const std::int64_t side = std::int64_t(tile.max()[axis_]) - tile.min()[axis_] + 1;
        for (std::int64_t u = 0; u < side; u += kSide) {
            for (std::int64_t v = 0; v < side; v += kSide) {
                openvdb::Coord at = tile.min();
                at[u_] += std::int32_t(u), at[v_] += std::int32_t(v);
                Bundle *const bundle = over(at);
                if (!bundle) return false;
                for (int i = 0; i < kSide * kSide; ++i) bundle->add(i, value * float(side), tile.min()[axis_], tile.max()[axis_]);
            }
        }
        return true;
    }

    void judge(Exam &exam) const {
        std::int64_t low = std::numeric_limits<std::int64_t>::max(), high = std::numeric_limits<std::int64_t>::min();
        each([&](float sum, std::int64_t first, std::int64_t last) {
            exam.column[std::size_t(axis_)] = std::max(exam.column[std::size_t(axis_)], double(sum));
            low = std::min(low, first), high = std::max(high, last);
        });
        const double slack = std::max(1.0, 0.02 * double(high - low + 1));
        std::uint64_t all = 0, lower = 0, upper = 0;
        each([&](float, std::int64_t first, std::int64_t last) {
            ++all, lower += double(first - low) < slack, upper += double(high - last) < slack;
        });
        if (all == 0) return;
        exam.flat[std::size_t(2 * axis_)] = double(lower) / double(all);
        exam.flat[std::size_t(2 * axis_ + 1)] = double(upper) / double(all);
    }

  private:
    template <typename F> void each(F f) const {
        for (const Bundle &bundle : bundles_) {
            for (std::size_t i = 0; i < bundle.sum.size(); ++i) {
                if (bundle.sum[i] > 0.0f) f(bundle.sum[i], bundle.first[i], bundle.last[i]);
            }
        }
    }

    int axis_, u_, v_;
    std::deque<Bundle> bundles_; // where they are, they stay
    std::unordered_map<std::uint64_t, std::size_t> places_;
};

// Counts and extremes of values.
class Values {
  public:
    explicit Values(Exam &exam, double background) : exam_(exam) { exam_.background = background; }

    void active(double value, double times) {
        if (std::isnan(value)) {
            exam_.nan += std::uint64_t(times);
        } else if (std::isinf(value)) {
            exam_.infinite += std::uint64_t(times);
        } else {
            if (value < 0.0) exam_.negative += std::uint64_t(times);
            exam_.lowest = std::min(exam_.lowest, value), exam_.highest = std::max(exam_.highest, value);
            sum_ += value * times, counted_ += times;
        }
    }
    void inactive(double value, double times) {
        // Zero and the background are what an inactive voxel holds; NaN differs from both.
        if (value != 0.0 && value != exam_.background) exam_.inactive += std::uint64_t(times);
    }
    void finish() {
        if (counted_ == 0.0) exam_.lowest = exam_.highest = 0.0;
        exam_.mean = counted_ > 0.0 ? sum_ / counted_ : 0.0;
    }

  private:
    Exam &exam_;
    double sum_ = 0.0, counted_ = 0.0;
};

// The side of a tile's cube, in voxels.
double side_of(const openvdb::CoordBBox &box) { return double(std::int64_t(box.max().x()) - box.min().x() + 1); }

float positive(double value) { return std::isfinite(value) && value > 0.0 ? float(value) : 0.0f; }

template <typename Tree> bool fill(const Tree &tree, Columns &columns) {
    auto tile = tree.cbeginValueOn();
    tile.setMaxDepth(Tree::ValueOnCIter::LEAF_DEPTH - 1);
    for (; tile; ++tile) {
        const float value = positive(scalar(tile.getValue()));
        if (value > 0.0f && !columns.add(tile.getBoundingBox(), value)) return false;
    }
    std::array<float, 512> values;
    for (auto leaf = tree.cbeginLeaf(); leaf; ++leaf) {
        float most = 0.0f;
        for (openvdb::Index i = 0; i < 512; ++i) {
            values[i] = leaf->isValueOn(i) ? positive(scalar(leaf->getValue(i))) : 0.0f;
            most = std::max(most, values[i]);
        }
        if (most > 0.0f && !columns.add(leaf->origin(), values)) return false;
    }
    return true;
}

template <typename Tree> void look(const Tree &tree, Exam &exam) {
    Values values(exam, scalar(tree.background()));
    double steps = 0.0;
    auto tile = tree.cbeginValueAll();
    tile.setMaxDepth(Tree::ValueAllCIter::LEAF_DEPTH - 1);
    for (; tile; ++tile) {
        const double side = side_of(tile.getBoundingBox()), voxels = side * side * side;
        if (!tile.isValueOn()) {
            values.inactive(scalar(tile.getValue()), voxels);
            continue;
        }
        ++exam.tiles;
        steps += side * side / (kSide * kSide);
        values.active(scalar(tile.getValue()), voxels);
    }
    for (auto leaf = tree.cbeginLeaf(); leaf; ++leaf) {
        for (openvdb::Index i = 0; i < 512; ++i) {
            const double value = scalar(leaf->getValue(i));
            leaf->isValueOn(i) ? values.active(value, 1.0) : values.inactive(value, 1.0);
        }
    }
    values.finish();
    exam.measured = steps <= double(kMostSteps);
    for (int axis = 0; axis < 3 && exam.measured; ++axis) {
        Columns columns(axis);
        exam.measured = fill(tree, columns);
        if (exam.measured) columns.judge(exam);
    }
}

// Calls `f` with the tree as what it is.
template <typename... Grids, typename F> void with_tree(const openvdb::GridBase::Ptr &grid, F f) {
    ((grid->isType<Grids>() ? f(openvdb::gridPtrCast<Grids>(grid)->tree()) : void()), ...);
}

} // namespace

Exam examine(rust::Slice<const std::uint8_t> path, const GridEntry &entry) {
    return reading([&] {
        GuardedStream is(file_name(path));
        const Container container(is);
        const auto grid = read_tree(is, entry);
        const openvdb::TreeBase &tree = grid->baseTree();
        Exam exam{};
        exam.lowest = std::numeric_limits<double>::infinity(), exam.highest = -exam.lowest;
        exam.active_voxels = tree.activeVoxelCount(), exam.leaves = tree.leafCount(), exam.memory = tree.memUsage();
        openvdb::CoordBBox box;
        if (tree.evalActiveVoxelBoundingBox(box)) {
            for (const openvdb::Coord &end : {box.min(), box.max()}) {
                for (int axis = 0; axis < 3; ++axis) exam.active.push_back(end[axis]);
            }
        }
        using namespace openvdb;
        with_tree<BoolGrid, MaskGrid, Int32Grid, Int64Grid, FloatGrid, DoubleGrid, Vec3IGrid, Vec3SGrid, Vec3DGrid>(
            grid, [&](const auto &typed) { look(typed, exam); });
        return exam;
    });
}

} // namespace cloudvdb
