// The boundary between Rust and OpenVDB, as src/vdb/ffi.rs declares it. Includes no OpenVDB header, on purpose.
#pragma once

#include <cstddef>
#include <cstdint>
#include <exception>
#include <memory>
#include <new>

#include "rust/cxx.h"

namespace rust {
namespace behavior {
/// Turns every C++ exception into a Rust `Err`, also those that are no std::exception.
template <typename Try, typename Fail>
static void trycatch(Try &&attempt, Fail &&fail) noexcept try {
    attempt();
} catch (const std::bad_alloc &) {
    fail("there is not enough memory. Free some, raise its limit (ulimit -v), or take fewer voxels");
} catch (const std::exception &error) {
    fail(error.what());
} catch (...) {
    fail("an exception of an unknown type");
}
} // namespace behavior
} // namespace rust

namespace cloudvdb {

struct MetaEntry;
struct GridEntry;
struct Found;
struct Exam;

/// Grids that wait to be written.
class Draft {
  public:
    Draft();
    ~Draft();
    void add(rust::Str name, bool half, rust::Slice<const double> world_from_index, rust::Slice<const std::int32_t> origins,
             rust::Slice<const float> values, rust::Slice<const MetaEntry> metadata);
    void carry(rust::Slice<const std::uint8_t> path, const GridEntry &grid, rust::Slice<const double> turn);
    std::int32_t save(rust::Slice<const std::uint8_t> path, rust::Slice<const MetaEntry> metadata) const;

  private:
    struct Inside;
    std::unique_ptr<Inside> inside_;
};

/// The samples of a FloatGrid that was read or made, by bricks of 8 x 8 x 8.
class Bricks {
  public:
    struct Inside;
    explicit Bricks(std::unique_ptr<Inside> inside);
    ~Bricks();
    std::size_t count() const;
    rust::Vec<std::int32_t> active() const;
    float background() const;
    void take(std::size_t first, rust::Slice<std::int32_t> origins, rust::Slice<float> values);

  private:
    std::unique_ptr<Inside> inside_;
};

std::unique_ptr<Draft> new_draft();

// Keeps OpenVDB's own threads to so many, from now on.
void limit_threads(std::size_t threads);
// Calls `last` when the process aborts; where that comes back, the process ends with exit code 1.
void on_abort(rust::Fn<void()> last);
Found scan(rust::Slice<const std::uint8_t> path);
std::unique_ptr<Bricks> load(rust::Slice<const std::uint8_t> path, const GridEntry &grid, std::uint64_t max_voxels);
std::uint64_t count_active(rust::Slice<const std::uint8_t> path, const GridEntry &grid);

/// Looks at every value of a grid.
Exam examine(rust::Slice<const std::uint8_t> path, const GridEntry &grid);

/// How deep each sample lies under the surface of a closed mesh, in voxels, negative outside; positions are in index space.
std::unique_ptr<Bricks> mesh_depth(rust::Slice<const double> points, rust::Slice<const std::uint32_t> triangles, float exterior,
                                   float interior, std::uint64_t max_voxels);

/// Runs openvdb::initialize once.
void initialize();

} // namespace cloudvdb
