//! Sparse bricks of voxels where the regions are.

use crate::bvh::Box3;
use crate::geom::{Bounds, Ray};
use crate::scene::density::{BRICK_SIDE, BRICK_VOXELS};
use crate::scene::{Region, Shape};
use crate::voxelise::{Cover, Lattice, Up};
use glam::{DVec3, IVec3, Vec3};
use rayon::prelude::*;
use std::collections::BTreeSet;

const NONE: u32 = u32::MAX;

/// Bricks of 8^3 voxels, relative to the scene's origin.
#[derive(Debug)]
pub(super) struct Frame {
    /// Where voxel (0, 0, 0) begins, m.
    corner: Vec3,
    /// The side of a voxel, m.
    pub step: f32,
    /// Bricks along each axis.
    size: IVec3,
    /// The number of each brick, or NONE.
    table: Vec<u32>,
    /// Where each brick is, in bricks.
    pub bricks: Vec<IVec3>,
}

impl Frame {
    /// The bricks that regions meet, in voxels of `step` metres; of those, the ones that `seen` (with the brick's box) does not leave out.
    pub fn new(regions: &[Region], origin: DVec3, bounds: Bounds, step: f64, seen: impl Fn(Box3) -> bool + Sync) -> Self {
        let lattice = Lattice::near(bounds, step);
        let mut met = BTreeSet::new();
        let mut mark = |voxels: Bounds, keep: &dyn Fn(IVec3) -> bool| {
            lattice.bricks(voxels, keep, |origin| {
                met.insert(origin.map(|o| o / BRICK_SIDE));
            });
        };
        for region in regions {
            if let Shape::Grid(grid) = &region.shape {
                for (brick, &first) in grid.bricks.origins.iter().enumerate() {
                    if grid.bricks.brick(brick).iter().any(|&v| v != 0.0) {
                        let corner = |i: i32| {
                            let bit = |b: i32| if i >> b & 1 == 1 { f64::from(BRICK_SIDE) } else { -1.0 };
                            let index = IVec3::from_array(first).as_dvec3() + DVec3::new(bit(0), bit(1), bit(2));
                            lattice.index(grid.bricks.world_from_index.transform_point3(index))
                        };
                        mark((0..8).fold(Bounds::EMPTY, |b, i| b.include(corner(i))), &|_| true);
                    }
                }
            } else {
                let cover = Cover::new(&region.shape, Up::Z).into_index(&lattice);
                mark(cover.bounds, &|origin| cover.meets(origin));
            }
        }
        let side = f64::from(BRICK_SIDE) * step;
        let place = |b: IVec3| {
            Box3::around(Bounds { min: lattice.anchor + b.as_dvec3() * side, max: lattice.anchor + (b + 1).as_dvec3() * side }, origin)
        };
        let all: Vec<[i32; 3]> = met.into_iter().collect();
        let all: Vec<[i32; 3]> = all.into_par_iter().filter(|&b| seen(place(IVec3::from_array(b)))).collect();
        let low = all.iter().fold(IVec3::MAX, |m, &b| m.min(IVec3::from_array(b)));
        let high = all.iter().fold(IVec3::MIN, |m, &b| m.max(IVec3::from_array(b)));
        let size = if all.is_empty() { IVec3::ZERO } else { high - low + 1 };
        let bricks: Vec<IVec3> = all.iter().map(|&b| IVec3::from_array(b) - low).collect();
        let mut table = vec![NONE; (size.x * size.y * size.z) as usize];
        for (number, b) in (0..).zip(&bricks) {
            table[((b.x * size.y + b.y) * size.z + b.z) as usize] = number;
        }
        let first = if all.is_empty() { IVec3::ZERO } else { low * BRICK_SIDE };
        let corner = (lattice.anchor + first.as_dvec3() * step - origin).as_vec3();
        Frame { corner, step: step as f32, size, table, bricks }
    }

    /// Bricks along each axis.
    pub fn size(&self) -> IVec3 {
        self.size
    }

    /// How many voxels there are.
    pub fn voxels(&self) -> usize {
        self.bricks.len() * BRICK_VOXELS
    }

    /// The number of a brick, where there is one.
    #[inline]
    pub fn brick(&self, b: IVec3) -> Option<usize> {
        if b.cmplt(IVec3::ZERO).any() || b.cmpge(self.size).any() {
            return None;
        }
        let number = self.table[((b.x * self.size.y + b.y) * self.size.z + b.z) as usize];
        (number != NONE).then_some(number as usize)
    }

    /// The number of a voxel, where there is one.
    #[inline]
    fn voxel(&self, v: IVec3) -> Option<usize> {
        let within = v & 7;
        Some(self.brick(v >> 3)? * BRICK_VOXELS + (within.x << 6 | within.y << 3 | within.z) as usize)
    }

    /// Where a brick begins, relative to the scene's origin, m.
    pub fn corner(&self, brick: usize) -> Vec3 {
        self.corner + (self.bricks[brick] * BRICK_SIDE).as_vec3() * self.step
    }

    /// Visits points of a ray's first `reach` metres, `spacing` voxels apart, the first `offset` of that from the start or from where the
    /// ray comes in; and the voxels that they are in.
    #[inline]
    pub fn along(&self, ray: &Ray, reach: f32, (spacing, offset): (f32, f32), mut visit: impl FnMut(Vec3, usize)) {
        let inverse = self.step.recip();
        let (origin, direction) = ((ray.origin - self.corner) * inverse, ray.direction);
        let end = (self.size * BRICK_SIDE).as_vec3();
        let (a, b) = (-origin / direction, (end - origin) / direction);
        // Written so that a direction without an axis, which makes NaN on a face, is held by the others.
        let (near, far) = (a.min(b), a.max(b));
        let from = near.max_element().max(0.0);
        let to = far.min_element().min(reach * inverse);
        let mut t = from + offset * spacing;
        while t < to {
            let at = origin + direction * t;
            // Truncation is the floor here: rounding alone can bring a point below zero.
            if let Some(voxel) = self.voxel(at.as_ivec3()) {
                visit(self.corner + at * self.step, voxel);
            }
            t += spacing;
        }
    }

    /// How far from its origin a ray leaves the bricks' bounds, m.
    pub fn leaves(&self, ray: &Ray) -> f32 {
        let end = (self.size * BRICK_SIDE).as_vec3() * self.step;
        let origin = ray.origin - self.corner;
        (-origin / ray.direction).max((end - origin) / ray.direction).min_element().max(0.0)
    }

    /// Visits the voxels whose centres are around a point, with their trilinear weights.
    #[inline]
    pub fn around(&self, p: Vec3, visit: impl FnMut(usize, f32)) {
        self.among((p - self.corner) / self.step - 0.5, visit);
    }

    /// The same of a point that is `offset` voxels from a voxel's centre.
    #[inline]
    pub fn beside(&self, voxel: usize, offset: Vec3, visit: impl FnMut(usize, f32)) {
        let within = IVec3::new(voxel as i32 >> 6 & 7, voxel as i32 >> 3 & 7, voxel as i32 & 7);
        self.among((self.bricks[voxel / BRICK_VOXELS] * BRICK_SIDE + within).as_vec3() + offset, visit);
    }

    /// The same of a point in voxels from the first one's centre.
    #[inline]
    fn among(&self, at: Vec3, mut visit: impl FnMut(usize, f32)) {
        let cell = at.floor();
        let (f, cell) = (at - cell, cell.as_ivec3());
        for i in 0..8 {
            let bit = IVec3::new(i >> 2 & 1, i >> 1 & 1, i & 1);
            let weight = Vec3::select(bit.cmpeq(IVec3::ONE), f, 1.0 - f).element_product();
            if let Some(voxel) = self.voxel(cell + bit) {
                visit(voxel, weight);
            }
        }
    }
}
