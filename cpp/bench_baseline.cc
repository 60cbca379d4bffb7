// What OpenVDB itself takes from C++; compiled for benches/vdb_read.rs and benches/vdb_write.rs only.
#include <openvdb/io/File.h>
#include <openvdb/openvdb.h>
#include <openvdb/tools/Dense.h>

#include <cstdint>
#include <cstdio>
#include <exception>

/// Writes `side`^3 samples (z fastest) to `path` as OpenVDB's users do: copyFromDense, io::File. Returns 0, or 1 if that failed.
extern "C" int cloudvdb_bench_baseline(const char *path, const float *samples, std::int32_t side, bool half) try {
    openvdb::initialize();
    const openvdb::CoordBBox box(openvdb::Coord(0), openvdb::Coord(side - 1));
    const openvdb::tools::Dense<const float, openvdb::tools::LayoutZYX> dense(box, samples);
    auto grid = openvdb::FloatGrid::create(0.0f);
    openvdb::tools::copyFromDense(dense, *grid, 0.0f);
    grid->setTransform(openvdb::math::Transform::createLinearTransform(0.1));
    grid->setName("density");
    grid->setGridClass(openvdb::GRID_FOG_VOLUME);
    grid->setSaveFloatAsHalf(half);
    openvdb::io::File file(path);
    file.setCompression(openvdb::io::COMPRESS_BLOSC | openvdb::io::COMPRESS_ACTIVE_MASK);
    file.write({grid});
    return 0;
} catch (const std::exception &error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
}

/// Reads every grid of `path`, samples and all. Returns 0, or 1 if that failed.
extern "C" int cloudvdb_bench_read(const char *path) try {
    openvdb::initialize();
    openvdb::io::File file(path);
    file.open(/*delayLoad=*/false);
    return file.getGrids()->empty() ? 1 : 0;
} catch (const std::exception &error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
}
