//! Regions to voxels: partial coverage at boundaries, so that the integral of the grid is the regions' optical mass.
//!
//! Each voxel gets the share of it that a region covers: exact along z (the interval of a line inside the shape), by
//! k x k lines a voxel across it. Overlaps add.

use crate::error::Result;
use crate::geom::Bounds;
use crate::progress::Progress;
use crate::scene::density::{BRICK_SIDE, BRICK_VOXELS};
use crate::scene::{BrickGrid, Region};
use glam::{DAffine3, DMat3, DVec3, IVec3};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};

pub use cover::{Cover, add, overlap};
pub use size::{fitting, voxel_size};

/// A brick's smallest index and its samples.
type Brick = ([i32; 3], Box<[f32; BRICK_VOXELS]>);

/// Bricks that are filled between two looks at whether to stop; what they take beside the grid itself stays small.
const WAVE: usize = 4096;

/// Which axis points up in the written grid.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Up {
    /// Blender's.
    #[default]
    Z,
    /// Houdini's, Unreal's, USD's.
    Y,
}

/// A lattice of voxels along the world's axes: voxel (i, j, k) fills the box from `anchor + step * (i, j, k)`, one step wide.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lattice {
    /// Where voxel (0, 0, 0) begins, m.
    pub anchor: DVec3,
    /// The sides of a voxel, m.
    pub step: DVec3,
}

impl Lattice {
    /// A lattice of cubes that begins at a whole brick at or before `bounds`, so that indices stay small wherever the scene is.
    pub fn near(bounds: Bounds, voxel_size: f64) -> Self {
        let brick = voxel_size * f64::from(BRICK_SIDE);
        let anchor = if bounds.is_empty() { DVec3::ZERO } else { (bounds.min / brick).floor() * brick };
        Lattice { anchor, step: DVec3::splat(voxel_size) }
    }

    /// A point of the world in units of voxels.
    pub fn index(&self, p: DVec3) -> DVec3 {
        (p - self.anchor) / self.step
    }

    /// From the samples' indices, which are the voxels' centres, to the world.
    pub fn world_from_index(&self) -> DAffine3 {
        DAffine3 { matrix3: DMat3::from_diagonal(self.step), translation: self.anchor + 0.5 * self.step }
    }

    /// The origins of the bricks that a box of voxels meets, and that `keep` does not leave out.
    pub fn bricks(&self, voxels: Bounds, mut keep: impl FnMut(IVec3) -> bool, mut visit: impl FnMut([i32; 3])) {
        let side = f64::from(BRICK_SIDE);
        let (from, to) = ((voxels.min / side).floor().as_ivec3(), (voxels.max / side).floor().as_ivec3());
        for x in from.x..=to.x {
            for y in from.y..=to.y {
                for z in from.z..=to.z {
                    let origin = IVec3::new(x, y, z) * BRICK_SIDE;
                    if keep(origin) {
                        visit(origin.to_array());
                    }
                }
            }
        }
    }

    /// Fills bricks on all cores, and keeps those that hold anything, in the order of their origins whatever thread filled them.
    ///
    /// `touched` says which item meets which brick; `fill` adds the items of one brick, in increasing order, to its samples
    /// (z fastest, as [`BrickGrid`] has them).
    ///
    /// # Errors
    /// [`crate::Error::Interrupted`].
    pub fn fill(
        &self,
        mut touched: Vec<([i32; 3], u32)>,
        fill: impl Fn(IVec3, &mut dyn Iterator<Item = u32>, &mut [f64; BRICK_VOXELS]) + Sync,
        progress: &dyn Progress,
    ) -> Result<BrickGrid> {
        touched.par_sort_unstable();
        let groups: Vec<Range<usize>> = touched
            .chunk_by(|a, b| a.0 == b.0)
            .scan(0, |at, group| {
                *at += group.len();
                Some(*at - group.len()..*at)
            })
            .collect();
        progress.begin("voxels", groups.len() as u64);
        let done = AtomicU64::new(0);
        let mut grid = BrickGrid { world_from_index: self.world_from_index(), origins: Vec::new(), values: Vec::new() };
        for wave in groups.chunks(WAVE) {
            let one = |group: &Range<usize>| {
                let count = done.fetch_add(1, Ordering::Relaxed);
                if count.is_multiple_of(256) {
                    progress.at(count);
                }
                if progress.cancelled() {
                    return None;
                }
                let group = &touched[group.clone()];
                let mut sum = [0.0f64; BRICK_VOXELS];
                fill(IVec3::from_array(group[0].0), &mut group.iter().map(|t| t.1), &mut sum);
                sum.iter().any(|&v| v > 0.0).then(|| (group[0].0, Box::new(sum.map(|v| v as f32))))
            };
            let filled: Vec<Option<Brick>> = wave.par_iter().map(one).collect();
            progress.check()?;
            for (origin, values) in filled.into_iter().flatten() {
                grid.origins.push(origin);
                grid.values.extend_from_slice(&values[..]);
            }
        }
        Ok(grid)
    }
}

/// The regions' extinction in units of `density_scale` per metre, in voxels of `voxel_size` metres.
///
/// # Errors
/// [`crate::Error::Interrupted`].
pub fn voxelise(regions: &[Region], voxel_size: f64, density_scale: f64, up: Up, progress: &dyn Progress) -> Result<BrickGrid> {
    let shapes: Vec<Cover> = regions.iter().map(|r| Cover::new(&r.shape, up)).collect();
    let bounds = shapes.iter().fold(Bounds::EMPTY, |b, s| b.union(s.bounds));
    let lattice = Lattice::near(bounds, voxel_size);
    let shapes: Vec<Cover> = shapes.into_iter().map(|s| s.into_index(&lattice)).collect();
    let mut touched: Vec<([i32; 3], u32)> = Vec::new();
    for (i, shape) in shapes.iter().enumerate() {
        progress.check()?;
        lattice.bricks(shape.bounds, |origin| shape.meets(origin), |origin| touched.push((origin, i as u32)));
    }
    let cover = |origin: IVec3, items: &mut dyn Iterator<Item = u32>, sum: &mut [f64; BRICK_VOXELS]| {
        for i in items {
            shapes[i as usize].cover(origin, regions[i as usize].medium.sigma_t() / density_scale, sum);
        }
    };
    lattice.fill(touched, cover, progress)
}

mod cover;
mod size;
#[cfg(test)]
mod tests;
