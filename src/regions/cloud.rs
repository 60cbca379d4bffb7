//! The duality of voxel grids: balls of the grid's own medium, and the grid that they are together.

use super::body::Body;
use super::cover::{Cover, Lattice, LatticeBall};
use super::search::Ball;
use crate::photon::Model;
use crate::scene::density::{BRICK_SIDE, BRICK_VOXELS};
use crate::scene::{BrickGrid, VoxelGrid};
use glam::{DVec3, IVec3};
use rayon::prelude::*;
use smallvec::{SmallVec, smallvec};

/// A grid of densities, to be analysed.
pub(super) struct Cloud<'a> {
    grid: &'a VoxelGrid,
    lattice: Lattice,
    /// The sum of each brick's samples.
    sums: Vec<f64>,
    /// The diagonal of the bounds, m.
    diagonal: f64,
}

impl<'a> Cloud<'a> {
    pub fn new(grid: &'a VoxelGrid) -> Self {
        let sum = |brick: usize| grid.bricks.brick(brick).iter().map(|&v| f64::from(v)).sum();
        Cloud {
            grid,
            lattice: Lattice::new(&grid.bricks),
            sums: (0..grid.bricks.origins.len()).map(sum).collect(),
            diagonal: grid.support().size().length(),
        }
    }

    /// The grid's samples times the number of balls around them: a voxel at a ball's surface counts by the share that is
    /// covered. On the grid's own lattice, with the same bounds, and repeated where the grid is.
    pub fn within(&self, balls: &[Ball]) -> VoxelGrid {
        let bricks = &self.grid.bricks;
        let images: Vec<LatticeBall> = balls.iter().flat_map(|ball| self.lattice_balls(ball.centre, ball.radius)).collect();
        let mut touched: Vec<(u32, u32)> = Vec::new();
        for (ball, number) in images.iter().zip(0..) {
            self.met(ball, |brick| touched.push((brick as u32, number)));
        }
        touched.sort_unstable();
        let groups: Vec<&[(u32, u32)]> = touched.chunk_by(|a, b| a.0 == b.0).collect();
        let filled: Vec<Option<Vec<f32>>> = groups
            .par_iter()
            .map(|group| {
                let brick = group[0].0 as usize;
                let (mut count, mut shares) = ([0.0f64; BRICK_VOXELS], [0.0; BRICK_VOXELS]);
                for &(_, image) in *group {
                    match images[image as usize].cover(bricks.origins[brick], &mut shares) {
                        Cover::Nothing => {}
                        Cover::All => count.iter_mut().for_each(|c| *c += 1.0),
                        Cover::Part => count.iter_mut().zip(&shares).for_each(|(c, share)| *c += share),
                    }
                }
                let values: Vec<f32> = bricks.brick(brick).iter().zip(count).map(|(&v, count)| (f64::from(v) * count) as f32).collect();
                values.iter().any(|&v| v > 0.0).then_some(values)
            })
            .collect();
        let mut made = BrickGrid { world_from_index: bricks.world_from_index, origins: Vec::new(), values: Vec::new() };
        for (group, values) in groups.iter().zip(filled) {
            if let Some(values) = values {
                made.origins.push(bricks.origins[group[0].0 as usize]);
                made.values.extend(values);
            }
        }
        VoxelGrid::new(made, self.grid.min, self.grid.max, self.grid.periodic)
    }

    /// How often a ball is to be moved along the first two axes for all its images that meet the tile: from, to.
    fn tiles(&self, centre: DVec3, d: f64) -> [(i32, i32); 2] {
        if !self.grid.periodic {
            return [(0, 0); 2];
        }
        let (centre, half) = (self.lattice.from_world.transform_point3(centre), self.lattice.half(d));
        std::array::from_fn(|a| {
            let (low, high) = (f64::from(self.grid.min[a]), f64::from(self.grid.max[a]) + 1.0);
            let period = high - low;
            (((low - centre[a] - half[a]) / period).ceil() as i32, ((high - centre[a] + half[a]) / period).floor() as i32)
        })
    }

    /// The shifts of all images of a ball that meet the tile, in voxels.
    fn shifts(&self, centre: DVec3, d: f64) -> impl Iterator<Item = DVec3> + use<> {
        let [(x0, x1), (y0, y1)] = self.tiles(centre, d);
        let period = |a: usize| f64::from(self.grid.max[a] - self.grid.min[a] + 1);
        let (width, depth) = (period(0), period(1));
        (x0..=x1).flat_map(move |x| (y0..=y1).map(move |y| DVec3::new(f64::from(x) * width, f64::from(y) * depth, 0.0)))
    }

    fn lattice_balls(&self, centre: DVec3, d: f64) -> impl Iterator<Item = LatticeBall> {
        let at = self.lattice.from_world.transform_point3(centre);
        self.shifts(centre, d).map(move |shift| self.lattice.ball(at + shift, d))
    }

    /// Calls `visit` with the number of each brick of the grid that a ball's bounds meet.
    fn met(&self, ball: &LatticeBall, mut visit: impl FnMut(usize)) {
        let origins = &self.grid.bricks.origins;
        let (from, to) = ball.bricks();
        let (low, high) = (IVec3::from_array(self.grid.min) >> 3, IVec3::from_array(self.grid.max) >> 3);
        let (from, to) = (from.max(low), to.min(high));
        for x in from.x..=to.x {
            for y in from.y..=to.y {
                // Bricks of a column follow one another.
                let first = (IVec3::new(x, y, from.z) * BRICK_SIDE).to_array();
                let last = (IVec3::new(x, y, to.z) * BRICK_SIDE).to_array();
                let start = origins.partition_point(|o| *o < first);
                origins[start..].iter().take_while(|o| **o <= last).zip(start..).for_each(|(_, brick)| visit(brick));
            }
        }
    }
}

impl Body for Cloud<'_> {
    fn density(&self, p: DVec3) -> f64 {
        self.grid.density(p)
    }

    /// Half of what is thick of the grid, [`VoxelGrid::breadth`]: in its fringe, where free paths are long, a ball could
    /// otherwise be the whole of it. The thesis says nothing; but a ball that is wider than the grid holds all of it.
    fn largest(&self, model: Model, _: f64) -> f64 {
        match model {
            Model::Physical => 0.5 * self.grid.breadth(),
            Model::Hura2006 => self.diagonal,
        }
    }

    fn volume(&self, centre: DVec3, d: f64, enough: f64) -> f64 {
        let (mut sum, mut shares) = (0.0, [0.0; BRICK_VOXELS]);
        let voxel = self.grid.bricks.voxel_volume();
        for ball in self.lattice_balls(centre, d) {
            self.met(&ball, |brick| {
                if sum * voxel > enough {
                    return;
                }
                sum += match ball.cover(self.grid.bricks.origins[brick], &mut shares) {
                    Cover::Nothing => 0.0,
                    Cover::All => self.sums[brick],
                    Cover::Part => self.grid.bricks.brick(brick).iter().zip(&shares).map(|(&v, share)| f64::from(v) * share).sum(),
                }
            });
        }
        sum * voxel
    }

    /// By bisection, from below: where the number of lines changes with the radius, a trace of the volume may be left.
    fn shrunk(&self, centre: DVec3, d: f64, volume: f64) -> (f64, f64) {
        let (mut low, mut high, mut held) = (0.0, d, 0.0);
        // Until the budget that is left is rounding.
        while held < volume * (1.0 - 1e-10) && high - low > 1e-15 * d {
            let middle = 0.5 * (low + high);
            match self.volume(centre, middle, volume) {
                inside if inside <= volume => (low, held) = (middle, inside),
                _ => high = middle,
            }
        }
        (low, held)
    }

    fn images(&self, centre: DVec3, d: f64) -> SmallVec<[DVec3; 4]> {
        if !self.grid.periodic {
            return smallvec![DVec3::ZERO];
        }
        self.shifts(centre, d).map(|shift| self.grid.bricks.world_from_index.transform_vector3(shift)).collect()
    }
}
