//! Importing a VDB of about 100 MB, hash and all, against OpenVDB's own reader in C++ with no delayed loading. Prints the ratio
//! of medians taken in turn (target: at most 1.5) and the peak of memory.
//!
//! `cargo bench --features bench-baseline --bench vdb_read`
#![allow(unsafe_code)]

use std::ffi::{CString, c_char, c_int};
use std::hint::black_box;
use std::path::Path;
use std::time::{Duration, Instant};

use cloudvdb::import::{ImportOptions, load};
use cloudvdb::progress::Silent;
use cloudvdb::scene::BrickGrid;
use cloudvdb::vdb::{GridOut, write};
use glam::{DAffine3, DVec3, IVec3};

const ROUNDS: usize = 7;

unsafe extern "C" {
    fn cloudvdb_bench_read(path: *const c_char) -> c_int;
}

/// A whole number's worth of noise in 0..1.
fn noise(p: IVec3) -> f64 {
    let hash = (p.x.wrapping_mul(73_856_093) ^ p.y.wrapping_mul(19_349_663) ^ p.z.wrapping_mul(83_492_791)) as u32;
    f64::from((hash.wrapping_mul(2_654_435_761) ^ hash >> 13) >> 8) / f64::from(1 << 24)
}

/// A lumpy ball of `bricks` bricks across, rough in every voxel, ragged where it ends.
fn cloud(bricks: i32) -> BrickGrid {
    let mut grid = BrickGrid { world_from_index: DAffine3::from_scale(DVec3::splat(0.1)), origins: vec![], values: vec![] };
    let centre = DVec3::splat(f64::from(bricks) * 4.0);
    for i in 0..bricks.pow(3) {
        let origin = IVec3::new(i / bricks / bricks, i / bricks % bricks, i % bricks) * 8;
        let sample = |v: i32| {
            let p = origin + IVec3::new(v >> 6, v >> 3 & 7, v & 7);
            let lump = (p.as_dvec3() * 0.13).map(f64::sin).element_product();
            let depth = 1.0 - p.as_dvec3().distance(centre) / centre.x + 0.15 * lump;
            if depth < 0.1 * noise(p / 2) { 0.0 } else { (depth * (0.7 + 0.3 * noise(p))) as f32 }
        };
        let values: Vec<f32> = (0..512).map(sample).collect();
        if values.iter().any(|&v| v != 0.0) {
            grid.origins.push(origin.to_array());
            grid.values.extend(values);
        }
    }
    grid
}

fn ours(path: &Path) {
    black_box(load(path, &ImportOptions::default(), &Silent).expect("a VDB"));
}

fn baseline(path: &Path) {
    let path = CString::new(path.as_os_str().as_encoded_bytes()).expect("a path");
    // SAFETY: `path` ends in a zero byte and outlives the call.
    let code = unsafe { cloudvdb_bench_read(path.as_ptr()) };
    assert_eq!(code, 0);
}

/// How long a call takes, and the most memory that the process held meanwhile beyond what it holds before, in MB.
fn measured(f: impl FnOnce()) -> (Duration, f64) {
    let now = |key: &str| {
        let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
        let line = status.lines().find(|line| line.starts_with(key)).unwrap_or_default();
        line.split_whitespace().nth(1).and_then(|kilobytes| kilobytes.parse::<f64>().ok()).unwrap_or(f64::NAN) / 1e3
    };
    // Sets the peak back to what is held.
    let _ = std::fs::write("/proc/self/clear_refs", "5");
    let before = now("VmRSS:");
    let start = Instant::now();
    f();
    (start.elapsed(), now("VmHWM:") - before)
}

fn main() {
    let dir = tempfile::tempdir().expect("a temporary directory");
    let path = dir.path().join("cloud.vdb");
    for (kind, half, bricks) in [("half", true, 60), ("float", false, 49)] {
        write(&path, &[GridOut { name: "density", bricks: &cloud(bricks), half, metadata: &[] }], &[]).expect("a grid written");
        let mut all: Vec<_> = (0..ROUNDS).map(|_| (measured(|| ours(&path)), measured(|| baseline(&path)))).collect();
        all.sort_by_key(|(ours, _)| ours.0);
        let ours = all[ROUNDS / 2].0;
        all.sort_by_key(|(_, baseline)| baseline.0);
        let theirs = all[ROUNDS / 2].1;
        println!(
            "{kind}, {:.0} MB: cloudvdb {:.3} s (peak {:.0} MB), OpenVDB from C++ {:.3} s (peak {:.0} MB), ratio {:.2}",
            path.metadata().map_or(0, |m| m.len()) as f64 / 1e6,
            ours.0.as_secs_f64(),
            ours.1,
            theirs.0.as_secs_f64(),
            theirs.1,
            ours.0.as_secs_f64() / theirs.0.as_secs_f64()
        );
    }
}
