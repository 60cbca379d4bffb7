//! Which share of each voxel a ball covers.
//!
//! Exact along z, the interval of a line inside the ball, by k x k lines a voxel across it: so it changes without jumps as the
//! ball grows, and what a ball holds can be met exactly.

use crate::scene::density::{BRICK_SIDE, BRICK_VOXELS};
use crate::scene::{BrickGrid, Shape};
use crate::voxelise::{add, overlap};
use glam::{DAffine3, DMat3, DVec3, IVec3};
use std::f64::consts::PI;

/// What is smaller than this share of a voxel slips between any number of lines: it goes where its bounds are.
const CRUMB: f64 = 1.0 / 3.0;

/// How a lattice lies in the world. In its space, voxel (i, j, k) fills [i, i + 1] x [j, j + 1] x [k, k + 1].
#[derive(Debug, Clone)]
pub(super) struct Lattice {
    pub from_world: DAffine3,
    world: DMat3,
    /// Half the bounds of a ball of 1 m, in voxels; and its smallest half extent.
    half: DVec3,
    smallest: f64,
    /// How far a corner of a brick can be from its centre, m.
    reach: f64,
}

/// How much of a brick is covered.
pub(super) enum Cover {
    Nothing,
    All,
    /// The shares that were written.
    Part,
}

impl Lattice {
    pub fn new(bricks: &BrickGrid) -> Self {
        let world = bricks.world_from_index.matrix3;
        let from_world = DAffine3::from_translation(DVec3::splat(0.5)) * bricks.world_from_index.inverse();
        let rows = from_world.matrix3.transpose();
        let one = Shape::Ellipsoid { world_from_unit: DAffine3::from_mat3(from_world.matrix3) };
        Lattice {
            from_world,
            world,
            half: DVec3::new(rows.x_axis.length(), rows.y_axis.length(), rows.z_axis.length()),
            smallest: one.smallest_half_extent(),
            reach: 0.5 * f64::from(BRICK_SIDE) * (world.x_axis.length() + world.y_axis.length() + world.z_axis.length()),
        }
    }

    /// Half the bounds of a ball of radius `d` metres, in voxels.
    pub fn half(&self, d: f64) -> DVec3 {
        self.half * d
    }

    /// A ball of radius `d` metres about a point of this space.
    pub fn ball(&self, centre: DVec3, d: f64) -> LatticeBall {
        let half = self.half(d);
        let crumb = 2.0 * half.max_element() < CRUMB;
        LatticeBall {
            to_unit: self.world * d.recip(),
            centre,
            half,
            reach: self.reach / d,
            // At least 16 lines across the smallest half extent, and 4 a voxel: what a ball holds is right to a few parts in ten
            // thousand, and a voxel to one in ten.
            lines: (16.0 / (self.smallest * d)).ceil().clamp(4.0, 96.0) as i32,
            even: crumb.then(|| 4.0 / 3.0 * PI * d.powi(3) / self.world.determinant().abs() / (8.0 * half.element_product())),
        }
    }
}

/// A ball among voxels.
#[derive(Debug, Clone)]
pub(super) struct LatticeBall {
    to_unit: DMat3,
    centre: DVec3,
    half: DVec3,
    reach: f64,
    /// Lines a voxel along x and y.
    lines: i32,
    /// The share of its bounds that a crumb fills evenly.
    even: Option<f64>,
}

impl LatticeBall {
    /// The origins of the first and the last brick that its bounds meet, in bricks.
    pub fn bricks(&self) -> (IVec3, IVec3) {
        let side = f64::from(BRICK_SIDE);
        (((self.centre - self.half) / side).floor().as_ivec3(), ((self.centre + self.half) / side).floor().as_ivec3())
    }

    /// Writes the share of each voxel of a brick that it covers, where these differ.
    pub fn cover(&self, origin: [i32; 3], shares: &mut [f64; BRICK_VOXELS]) -> Cover {
        // Everything from the brick's corner on.
        let base = IVec3::from_array(origin).as_dvec3();
        let middle = self.centre - base;
        let distance = (self.to_unit * (0.5 * f64::from(BRICK_SIDE) - middle)).length();
        if distance >= 1.0 + self.reach {
            return Cover::Nothing;
        }
        if distance + self.reach <= 1.0 {
            return Cover::All;
        }
        shares.fill(0.0);
        let (low, high) = (middle - self.half, middle + self.half);
        if let Some(even) = self.even {
            for (i, share) in shares.iter_mut().enumerate() {
                let at = [i >> 6, i >> 3 & 7, i & 7];
                *share = even * (0..3).map(|a| overlap(at[a] as f64, low[a], high[a])).product::<f64>();
            }
            return Cover::Part;
        }
        let k = f64::from(self.lines);
        let weight = 1.0 / (k * k);
        let axis = self.to_unit.z_axis;
        let a = axis.length_squared();
        // How far a corner of a column of 8 voxels can be from its centre, as shares of the radius.
        let reach = 0.5 * (self.to_unit.x_axis.length() + self.to_unit.y_axis.length() + f64::from(BRICK_SIDE) * a.sqrt());
        let voxels = |a: usize| low[a].max(0.0) as usize..(high[a].ceil().clamp(0.0, f64::from(BRICK_SIDE)) as usize);
        // A small ball meets few lines of a voxel: those outside its bounds are passed over.
        let lines = |voxel: usize, a: usize| {
            let line = |v: f64| ((v - voxel as f64) * k).clamp(0.0, k) as i32;
            line(low[a])..(line(high[a]) + 1).min(self.lines)
        };
        for x in voxels(0) {
            for y in voxels(1) {
                let column = &mut shares[x << 6 | y << 3..][..8];
                let centre = DVec3::new(x as f64 + 0.5, y as f64 + 0.5, 0.5 * f64::from(BRICK_SIDE)) - middle;
                let distance = (self.to_unit * centre).length();
                if distance >= 1.0 + reach {
                    continue;
                }
                if distance + reach <= 1.0 {
                    column.fill(1.0);
                    continue;
                }
                for i in lines(x, 0) {
                    for j in lines(y, 1) {
                        let p = DVec3::new(x as f64 + (f64::from(i) + 0.5) / k, y as f64 + (f64::from(j) + 0.5) / k, 0.0);
                        let from = self.to_unit * (p - middle);
                        let nearest = -from.dot(axis) / a;
                        let v = (from + axis * nearest).length();
                        let square = (1.0 + v) * (1.0 - v) / a;
                        if square > 0.0 {
                            add(column, weight, nearest - square.sqrt(), nearest + square.sqrt());
                        }
                    }
                }
            }
        }
        Cover::Part
    }
}
