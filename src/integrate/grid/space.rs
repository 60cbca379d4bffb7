//! Where light is gathered: voxels as fine as a mean free path, and how much of each the medium fills.

use super::field::Request;
use super::fit::Fill;
use super::frame::Frame;
use crate::geom::Bounds;
use crate::media::Media;
use crate::scene::density::{BRICK_SIDE, BRICK_VOXELS};
use crate::scene::{Region, Shape};
use glam::{IVec3, Vec3};
use rayon::prelude::*;

/// A voxel is so many mean free paths wide, at extinctions that are usual for the scene.
const FINE: f64 = 0.65;
/// At least so many voxels along the longest side, and at most so many along it.
const SIDE: f64 = 32.0;
const MOST_SIDE: f64 = 2048.0;
/// Points along each side of a voxel that say how much of it the medium fills.
const POINTS: i32 = 3;

/// Voxels, and what is in them.
#[derive(Debug)]
pub(super) struct Space {
    pub frame: Frame,
    /// How much medium each voxel holds.
    pub fill: Vec<Fill>,
    /// The mean extinction that light meets, 1/m.
    pub usual: f64,
}

impl Space {
    /// Voxels around all regions, as fine as what they hold asks for and memory allows.
    pub fn new(request: &Request) -> Self {
        let regions = &request.scene.regions;
        let bounds = regions.iter().fold(Bounds::EMPTY, |b, r| b.union(r.shape.bounds()));
        let longest = bounds.size().max_element();
        let size = |extinction: f64| (request.coarser * FINE / extinction).clamp(longest / MOST_SIDE, longest / SIDE);
        // No more bricks than memory holds even before it is known which are seen.
        let volume: f64 = regions.iter().map(|r| room(&r.shape)).sum::<f64>().min(bounds.size().element_product());
        let least = (volume / (8.0 * request.voxels as f64)).cbrt();
        let mut step = size(mean_extinction(regions)).max(least);
        let smallest = regions.iter().map(|r| detail(&r.shape)).fold(f64::INFINITY, f64::min);
        let mut refined = false;
        loop {
            let frame = Frame::new(regions, request.origin, bounds, step, request.seen);
            if frame.voxels() > request.voxels {
                step *= (frame.voxels() as f64 / request.voxels as f64).sqrt().clamp(1.05, 2.0);
                refined = true;
                continue;
            }
            let corners: Vec<Vec<f32>> = (0..frame.bricks.len()).into_par_iter().map(|b| corners(&frame, b, request.media)).collect();
            let usual = usual(&corners).unwrap_or(FINE / step);
            let finer = size(usual).max(least);
            if finer < 0.85 * step && !refined {
                // Where regions overlap, extinction adds.
                step = finer;
                refined = true;
                continue;
            }
            let fill = filled(&frame, &corners, request.media, smallest < 2.0 * step);
            return Space { frame, fill, usual };
        }
    }
}

/// How small what a shape holds may be: a grid's clouds are some voxels thick, m.
fn detail(shape: &Shape) -> f64 {
    match shape {
        Shape::Grid(grid) => 4.0 * grid.bricks.world_from_index.matrix3.determinant().abs().cbrt(),
        _ => shape.smallest_half_extent(),
    }
}

/// The volume of what a shape may fill, m^3.
fn room(shape: &Shape) -> f64 {
    match shape {
        Shape::Grid(grid) => grid.bricks.world_from_index.matrix3.determinant().abs() * (grid.bricks.origins.len() * BRICK_VOXELS) as f64,
        _ => shape.bounds().size().element_product(),
    }
}

/// The mean extinction that light meets, 1/m, as if regions met no others.
pub(super) fn mean_extinction(regions: &[Region]) -> f64 {
    let (sum, mass) = regions.iter().map(dense).fold((0.0, 0.0), |s, d| (s.0 + d.0 * d.1, s.1 + d.1));
    if mass > 0.0 { sum / mass } else { 0.0 }
}

/// The mean extinction that light meets in a region, 1/m, and its optical mass, m^2.
fn dense(region: &Region) -> (f64, f64) {
    let sigma_t = region.medium.sigma_t();
    match &region.shape {
        Shape::Grid(grid) => {
            let sum =
                |power: i32| grid.bricks.values.par_chunks(4096).map(move |c| c.iter().map(|&v| f64::from(v).powi(power)).sum::<f64>());
            let (one, two): (Vec<f64>, Vec<f64>) = (sum(1).collect(), sum(2).collect());
            let (one, two) = (one.iter().sum::<f64>(), two.iter().sum::<f64>());
            let voxel = grid.bricks.world_from_index.matrix3.determinant().abs();
            (if one > 0.0 { sigma_t * two / one } else { 0.0 }, sigma_t * one * voxel)
        }
        shape => (sigma_t, sigma_t * shape.bounds().size().element_product()),
    }
}

/// The mean extinction that light meets, 1/m, from that at the voxels' corners.
fn usual(corners: &[Vec<f32>]) -> Option<f64> {
    let (sum, squares) = corners.iter().flatten().fold((0.0f64, 0.0f64), |s, &d| (s.0 + f64::from(d), s.1 + f64::from(d).powi(2)));
    (sum > 0.0).then(|| squares / sum)
}

/// Nodes of a brick's voxels along each side.
const NODES: usize = BRICK_SIDE as usize + 1;

/// The extinction at the corners of a brick's voxels, x slowest.
fn corners(frame: &Frame, brick: usize, media: &Media) -> Vec<f32> {
    let corner = frame.corner(brick);
    let node = |i: usize| {
        let at = IVec3::new((i / NODES / NODES) as i32, (i / NODES % NODES) as i32, (i % NODES) as i32);
        media.extinction(corner + at.as_vec3() * frame.step) as f32
    };
    (0..NODES.pow(3)).map(node).collect()
}

/// Those of one voxel.
fn around(nodes: &[f32], voxel: usize) -> [f32; 8] {
    let first = ((voxel >> 6) * NODES + (voxel >> 3 & 7)) * NODES + (voxel & 7);
    [0, 1, 2, 3, 4, 5, 6, 7].map(|i| nodes[first + ((i >> 2) * NODES + (i >> 1 & 1)) * NODES + (i & 1)])
}

/// How much of each voxel holds medium: all or nothing where its corners agree, unless regions are so `small` that they fit
/// between; else by the points within.
fn filled(frame: &Frame, corners: &[Vec<f32>], media: &Media, small: bool) -> Vec<Fill> {
    let mut out = vec![Fill { share: 0.0, middle: Vec3::ZERO }; frame.voxels()];
    out.par_chunks_exact_mut(BRICK_VOXELS).zip(corners).enumerate().for_each(|(brick, (out, nodes))| {
        for (v, out) in out.iter_mut().enumerate() {
            let met = around(nodes, v).iter().filter(|&&sigma| sigma > 0.0).count();
            if met == 8 {
                out.share = 1.0;
            } else if met > 0 || small {
                let first = frame.corner(brick) + Vec3::new((v >> 6) as f32, (v >> 3 & 7) as f32, (v & 7) as f32) * frame.step;
                *out = part(first, frame.step, media);
            }
        }
    });
    out
}

/// How much of the voxel that begins at `first` holds medium.
fn part(first: Vec3, step: f32, media: &Media) -> Fill {
    let (mut share, mut sum) = (0.0, Vec3::ZERO);
    for i in 0..POINTS.pow(3) {
        let at = IVec3::new(i / POINTS / POINTS, i / POINTS % POINTS, i % POINTS);
        let at = (at.as_vec3() + 0.5) / POINTS as f32;
        if media.extinction(first + at * step) > 0.0 {
            share += 1.0;
            sum += at - 0.5;
        }
    }
    if share > 0.0 { Fill { share: share / POINTS.pow(3) as f32, middle: sum / share } } else { Fill { share, middle: sum } }
}
