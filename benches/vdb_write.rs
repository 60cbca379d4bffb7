//! Writing a fog volume of 256^3 samples, against OpenVDB used from C++ for the same grid. Prints the ratio (target: below 1.5).
//!
//! `cargo bench --features bench-baseline --bench vdb_write`; the baseline starts from a dense array, ours from its bricks.
#![allow(unsafe_code)]

use std::ffi::{CString, c_char, c_int};
use std::hint::black_box;
use std::path::Path;
use std::time::{Duration, Instant};

use cloudvdb::scene::BrickGrid;
use cloudvdb::vdb::{GridOut, write};
use criterion::{Criterion, criterion_group, criterion_main};
use glam::{DAffine3, DVec3};

const SIDE: i32 = 256;

unsafe extern "C" {
    fn cloudvdb_bench_baseline(path: *const c_char, samples: *const f32, side: i32, half: bool) -> c_int;
}

/// A ball that touches the box's faces, rough as a cloud is, so that blosc has work to do; zero outside.
fn sample(x: i32, y: i32, z: i32) -> f32 {
    let r = DVec3::new(f64::from(x), f64::from(y), f64::from(z)).distance(DVec3::splat(127.5)) / 127.5;
    let hash = (x.wrapping_mul(73_856_093) ^ y.wrapping_mul(19_349_663) ^ z.wrapping_mul(83_492_791)) as u32;
    let noise = f64::from(hash.wrapping_mul(2_654_435_761) >> 8) / f64::from(1 << 24);
    ((1.0 - r).max(0.0) * (0.8 + 0.2 * noise)) as f32
}

fn dense() -> Vec<f32> {
    let mut samples = Vec::with_capacity((SIDE * SIDE * SIDE) as usize);
    for x in 0..SIDE {
        for y in 0..SIDE {
            samples.extend((0..SIDE).map(|z| sample(x, y, z)));
        }
    }
    samples
}

fn bricks(samples: &[f32]) -> BrickGrid {
    let mut grid = BrickGrid { world_from_index: DAffine3::from_scale(DVec3::splat(0.1)), origins: vec![], values: vec![] };
    let steps = || (0..SIDE).step_by(8);
    for (x, y, z) in steps().flat_map(|x| steps().flat_map(move |y| steps().map(move |z| (x, y, z)))) {
        let row = |i: i32| (((x + i / 8) * SIDE + y + i % 8) * SIDE + z) as usize;
        let values: Vec<f32> = (0..64).flat_map(|i| samples[row(i)..row(i) + 8].to_vec()).collect();
        if values.iter().any(|&v| v != 0.0) {
            grid.origins.push([x, y, z]);
            grid.values.extend(values);
        }
    }
    grid
}

fn ours(path: &Path, grid: &BrickGrid, half: bool) {
    let bricks = black_box(grid);
    write(path, &[GridOut { name: "density", bricks, half, metadata: &[] }], &[]).expect("a grid written");
}

fn baseline(path: &Path, samples: &[f32], half: bool) {
    let path = CString::new(path.as_os_str().as_encoded_bytes()).expect("a path");
    // SAFETY: `path` ends in a zero byte, `samples` holds SIDE^3 samples, and both outlive the call.
    let code = unsafe { cloudvdb_bench_baseline(path.as_ptr(), black_box(samples).as_ptr(), SIDE, half) };
    assert_eq!(code, 0);
}

/// The median seconds of both, taken in turn so that what else the machine does falls on both.
fn medians(mut a: impl FnMut(), mut b: impl FnMut()) -> (Duration, Duration) {
    let time = |f: &mut dyn FnMut()| {
        let start = Instant::now();
        f();
        start.elapsed()
    };
    let (mut first, mut second): (Vec<_>, Vec<_>) = (0..7).map(|_| (time(&mut a), time(&mut b))).unzip();
    first.sort();
    second.sort();
    (first[3], second[3])
}

fn vdb_write(criterion: &mut Criterion) {
    let dir = tempfile::tempdir().expect("a temporary directory");
    let (mine, theirs) = (dir.path().join("ours.vdb"), dir.path().join("baseline.vdb"));
    let samples = dense();
    let grid = bricks(&samples);
    let mut group = criterion.benchmark_group("write a fog volume of 256^3");
    group.sample_size(10);
    for half in [true, false] {
        let kind = if half { "half" } else { "float" };
        group.bench_function(format!("cloudvdb, {kind}"), |b| b.iter(|| ours(&mine, &grid, half)));
        group.bench_function(format!("OpenVDB from C++, {kind}"), |b| b.iter(|| baseline(&theirs, &samples, half)));
        let (a, b) = medians(|| ours(&mine, &grid, half), || baseline(&theirs, &samples, half));
        let size = |path: &Path| path.metadata().map_or(0, |m| m.len());
        println!(
            "{kind}: cloudvdb {:.3} s, OpenVDB from C++ {:.3} s, ratio {:.2}; {} and {} bytes",
            a.as_secs_f64(),
            b.as_secs_f64(),
            a.as_secs_f64() / b.as_secs_f64(),
            size(&mine),
            size(&theirs)
        );
    }
    group.finish();
}

criterion_group!(benches, vdb_write);
criterion_main!(benches);
