//! Rays through the tree, block by block, by steps that provably advance.

use super::Grid;
use crate::geom::Ray;
use glam::{IVec3, Vec3};
use std::ops::ControlFlow;

/// A level ray in an empty gap of a repeated grid never leaves: after so many tiles it is let go.
const MOST_TILES: u32 = 1 << 20;

/// A stretch of a ray within one block.
pub(super) struct Segment {
    /// The ray's origin, in index space and within this tile.
    pub origin: Vec3,
    pub direction: Vec3,
    /// Distances along the ray from `origin`, m.
    pub from: f32,
    pub to: f32,
    /// To be added to them: from the ray's own origin to `origin`.
    pub before: f32,
    /// The largest sample that can be met.
    pub majorant: f32,
    /// The block's cells: from `low`, below `high`.
    pub low: IVec3,
    pub high: IVec3,
}

impl Grid {
    /// Where the ray's line is within the box of the grid's voxels, or within its layer where it is repeated.
    pub(in crate::media) fn voxel_box(&self, ray: &Ray) -> (f32, f32) {
        let (o, d) = (self.index_from_local * ray.origin + self.offset, self.index_from_local * ray.direction);
        // Rays see a sample more on each side than there is, but for repeated axes; voxels end half-way.
        let half = Vec3::splat(0.5);
        let (low, high) = (self.low.as_vec3() + half, self.high.as_vec3() - half);
        let (mut enter, mut exit) = (f32::NEG_INFINITY, f32::INFINITY);
        for axis in (if self.periodic { 2 } else { 0 })..3 {
            let (a, b) = ((low[axis] - o[axis]) / d[axis], (high[axis] - o[axis]) / d[axis]);
            if d[axis] == 0.0 {
                if o[axis] <= low[axis] || o[axis] >= high[axis] {
                    return (f32::NAN, f32::NAN);
                }
                continue;
            }
            (enter, exit) = (enter.max(a.min(b)), exit.min(a.max(b)));
        }
        (enter, exit)
    }

    /// Visits the stretches of the ray within blocks whose majorant is not 0 (within their cells, on a fine walk), in order.
    #[inline]
    pub(super) fn walk<const FINE: bool>(&self, ray: &Ray, t_max: f32, mut visit: impl FnMut(Segment) -> ControlFlow<()>) {
        let direction = self.index_from_local * ray.direction;
        let mut origin = self.index_from_local * ray.origin + self.offset;
        // What is no ray meets nothing: comparisons would pass over a NaN, and a flight that stands still would never end.
        if !(origin + direction).is_finite() || direction == Vec3::ZERO {
            return;
        }
        let inverse = Vec3::from_array(direction.to_array().map(|d| if d.abs() < 1e-30 { 1e30f32.copysign(d) } else { 1.0 / d }));
        let forward = inverse.cmpgt(Vec3::ZERO);
        // The stretch in which density can be above 0; without end along repeated axes.
        let (near, far) = ((self.low.as_vec3() - origin) * inverse, (self.high.as_vec3() - origin) * inverse);
        let (mut enter, mut leave) = (0.0f32, t_max);
        for axis in (if self.periodic { 2 } else { 0 })..3 {
            enter = enter.max(near[axis].min(far[axis]));
            leave = leave.min(near[axis].max(far[axis]));
        }
        if enter >= leave {
            return;
        }
        let (mut before, mut t, mut tiles) = (0.0f32, enter, 0u32);
        let (tile_low, tile) = (self.low.as_vec3(), (self.high - self.low).as_vec3());
        if self.periodic {
            // To the tile in which the ray enters.
            let p = origin + direction * t;
            for axis in 0..2 {
                origin[axis] -= ((p[axis] - tile_low[axis]) / tile[axis]).floor() * tile[axis];
            }
        }
        let mut cell = (origin + direction * t).floor().as_ivec3().clamp(self.low, self.high - 1);
        loop {
            let (bits, majorant) = self.block(cell);
            let bits = if FINE && majorant > 0.0 { 0 } else { bits };
            let low = ((cell >> bits) << bits).max(self.low);
            let high = (((cell >> bits) + 1) << bits).min(self.high);
            let ends = (Vec3::select(forward, high.as_vec3(), low.as_vec3()) - origin) * inverse;
            let axis = if ends.x <= ends.y && ends.x <= ends.z { 0 } else { 1 + usize::from(ends.z < ends.y) };
            let to = ends[axis].min(leave);
            if majorant > 0.0 && to > t {
                let segment = Segment { origin, direction, from: t, to, before, majorant, low, high };
                if visit(segment).is_break() {
                    return;
                }
            }
            if ends[axis] >= leave {
                return;
            }
            // Onward by whole cells: never back, whatever rounding does to the distance.
            t = t.max(ends[axis]);
            let p = (origin + direction * t).as_ivec3();
            let (ahead, behind) = (p.clamp(cell, high - 1), p.clamp(low, cell));
            for other in 0..3 {
                cell[other] = if forward.test(other) { ahead[other] } else { behind[other] };
            }
            cell[axis] = if forward.test(axis) { high[axis] } else { low[axis] - 1 };
            if cell[axis] < self.low[axis] || cell[axis] >= self.high[axis] {
                if !self.periodic || axis == 2 || tiles == MOST_TILES {
                    return;
                }
                // The next tile: distances are counted anew, so that they stay small.
                tiles += 1;
                let start = origin + direction * t;
                (before, leave, t) = (before + t, leave - t, 0.0);
                origin = start;
                if forward.test(axis) {
                    (cell[axis], origin[axis]) = (self.low[axis], tile_low[axis]);
                } else {
                    (cell[axis], origin[axis]) = (self.high[axis] - 1, tile_low[axis] + tile[axis]);
                }
            }
        }
    }
}
