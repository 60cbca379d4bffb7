//! Voxelising 1,000 metaballs with five octaves of detail: seconds, memory, and whether time follows active voxels or the box.
//!
//! `cargo bench --bench sculpt`. Asked: under 10 s and 200 MB at 512^3, about 5 % active, on two cores.
#![allow(missing_docs, clippy::unwrap_used)]

use cloudvdb::progress::Silent;
use cloudvdb::rng::{Rng, Stage};
use cloudvdb::scene::{BrickGrid, VoxelGrid};
use cloudvdb::sculpt::{Detail, Element, ElementKind, Genus, Metaballs, Part, Sculpture, Solid};
use glam::{DAffine3, DVec3};
use std::sync::Arc;
use std::time::Instant;

/// Balls at random places of a cube of this side, m; each shows to 57 % of its radius.
fn family(count: usize, side: f64) -> Sculpture {
    let mut rng = Rng::new(1, Stage::Photons, 0);
    let mut at = || (DVec3::new(rng.uniform(), rng.uniform(), rng.uniform()) * side, 0.55 + 0.5 * rng.uniform());
    let ball = |(p, r): (DVec3, f64)| Element::new(ElementKind::Ball, DAffine3::from_translation(p), r, 2.0, DVec3::ONE);
    let elements = (0..count).map(|_| ball(at())).collect();
    let solid = Solid::Metaballs(Arc::new(Metaballs { threshold: 0.6, elements }));
    let detail = Detail { genus: Genus::Congestus, strength: 1.0, size: 0.4, octaves: 5, seed: 0 };
    Sculpture { parts: vec![Part::new(solid)], detail: Some(detail), tile: None }
}

fn no_meshes(_: &cloudvdb::scene::Mesh, _: &cloudvdb::voxelise::Lattice, _: f64, _: f64) -> cloudvdb::Result<BrickGrid> {
    unreachable!()
}

fn voxels(sculpture: &Sculpture, size: f64) -> (VoxelGrid, f64) {
    let begun = Instant::now();
    let grid = sculpture.voxels(size, &no_meshes, &Silent).unwrap();
    (grid, begun.elapsed().as_secs_f64())
}

/// The most memory that this process had, MB.
fn peak() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find(|l| l.starts_with("VmHWM")).unwrap_or_default();
    line.split_whitespace().nth(1).and_then(|kb| kb.parse::<f64>().ok()).unwrap_or(f64::NAN) / 1024.0
}

fn main() {
    eprintln!("{:>8} {:>8} {:>12} {:>8} {:>8} {:>16} {:>8}", "balls", "box", "active", "share", "s", "us a voxel", "MB");
    // The same balls in boxes of eight times the volume, and an eighth of the balls in the first box.
    for (count, side, cells) in [(1000usize, 21.0, 512.0), (1000, 42.0, 1024.0), (125, 21.0, 512.0), (1000, 21.0, 256.0)] {
        let sculpture = family(count, side);
        let mut runs: Vec<(f64, u64)> = (0..3)
            .map(|_| {
                let (grid, seconds) = voxels(&sculpture, side / cells);
                (seconds, grid.bricks.active_voxels())
            })
            .collect();
        runs.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (seconds, active) = runs[1];
        let share = 100.0 * active as f64 / (cells * cells * cells);
        eprintln!(
            "{count:>8} {cells:>7}^3 {active:>12} {share:>7.2}% {seconds:>8.2} {:>16.2} {:>8.0}",
            1e6 * seconds / active as f64,
            peak()
        );
    }
}
