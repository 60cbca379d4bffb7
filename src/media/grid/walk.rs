//! Rays through the tree, block by block, by steps that provably advance.

use super::{BLOCK, BLOCKS, Grid, NODE, NONE};
use crate::geom::Ray;
use glam::{IVec3, Vec3, Vec3A};
use std::ops::ControlFlow;

/// A level ray in an empty gap of a repeated grid never leaves: after so many tiles it is let go.
const MOST_TILES: u32 = 1 << 20;

/// What makes whole numbers of coordinates from 0 to 2^22: above it, single precision has no bits for less than a half.
const WHOLE: f32 = 12_582_912.0;

/// A stretch of a ray within one block, or within one of its cells.
pub(super) struct Segment {
    /// The ray's origin, in index space and within this tile.
    pub origin: Vec3A,
    pub direction: Vec3A,
    /// One over `direction`.
    inverse: Vec3A,
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

impl Segment {
    /// Visits the stretches within cells, in order: a cell on each time, and never back.
    #[inline]
    pub(super) fn cells(&self, visit: &mut impl FnMut(Segment) -> ControlFlow<()>) -> ControlFlow<()> {
        let (origin, inverse) = (self.origin.to_array(), self.inverse.to_array());
        let stride = inverse.map(|i| if i > 0.0 { 1 } else { -1 });
        let ahead = stride.map(|s: i32| s.max(0));
        let mut t = self.from;
        let mut cell = cell_at(self.origin + self.direction * t, self.low, self.high).to_array();
        let end = |cell: &[i32; 3], axis: usize| ((cell[axis] + ahead[axis]) as f32 - origin[axis]) * inverse[axis];
        let mut ends = [0, 1, 2].map(|axis| end(&cell, axis));
        loop {
            let axis = nearest(&ends);
            let to = if ends[axis] < self.to { ends[axis] } else { self.to };
            if to > t {
                let low = IVec3::from_array(cell);
                visit(Segment { from: t, to, low, high: low + 1, ..*self })?;
                t = to;
            }
            cell[axis] += stride[axis];
            if ends[axis] >= self.to || cell[axis] < self.low[axis] || cell[axis] >= self.high[axis] {
                return ControlFlow::Continue(());
            }
            ends[axis] = end(&cell, axis);
        }
    }
}

/// The cell of a point, held to those from `low` and below `high`. A point between two may be in either.
#[inline]
pub(super) fn cell_at(p: Vec3A, low: IVec3, high: IVec3) -> IVec3 {
    let whole = (p - 0.5 + WHOLE).to_array().map(|x| (x.to_bits() as i32).wrapping_sub(WHOLE.to_bits() as i32));
    IVec3::from_array(whole).clamp(low, high - 1)
}

/// The axis of the least.
#[inline]
fn nearest(ends: &[f32; 3]) -> usize {
    let (axis, end) = if ends[1] < ends[0] { (1, ends[1]) } else { (0, ends[0]) };
    if ends[2] < end { 2 } else { axis }
}

impl Grid {
    /// Where the ray's line is within the box of the grid's voxels, or within its layer where it is repeated.
    pub(in crate::media) fn voxel_box(&self, ray: &Ray) -> (f32, f32) {
        let (o, d) = (self.index_from_local * ray.origin + Vec3::from(self.offset), self.index_from_local * ray.direction);
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
        if FINE { self.by_blocks(ray, t_max, |block| block.cells(&mut visit)) } else { self.by_blocks(ray, t_max, visit) }
    }

    /// Node by node, and within nodes that hold bricks block by block: each time one on along one axis, never back, whatever
    /// rounding does to distances.
    #[inline]
    fn by_blocks(&self, ray: &Ray, t_max: f32, mut visit: impl FnMut(Segment) -> ControlFlow<()>) {
        let direction = self.index_from_local * Vec3A::from(ray.direction);
        let mut origin = self.index_from_local * Vec3A::from(ray.origin) + self.offset;
        // What is no ray meets nothing: comparisons would pass over a NaN, and a flight that stands still would never end.
        if !(origin + direction).is_finite() || direction == Vec3A::ZERO {
            return;
        }
        let inverse = direction.recip().clamp(Vec3A::splat(-1e30), Vec3A::splat(1e30));
        let forward = inverse.to_array().map(|i| i > 0.0);
        // The stretch in which density can be above 0; without end along repeated axes.
        let (a, b) = ((self.first - origin) * inverse, (self.last - origin) * inverse);
        let (mut near, mut far) = (a.min(b), a.max(b));
        if self.periodic {
            (near, far) = (Vec3A::splat(near.z), Vec3A::splat(far.z));
        }
        let (enter, mut leave) = (near.max_element().max(0.0), far.min_element().min(t_max));
        if enter >= leave {
            return;
        }
        let (mut before, mut t, mut tiles) = (0.0f32, enter, 0u32);
        let tile = self.last - self.first;
        if self.periodic {
            // To the tile in which the ray enters.
            let p = origin + direction * t;
            for axis in 0..2 {
                origin[axis] -= ((p[axis] - self.first[axis]) / tile[axis]).floor() * tile[axis];
            }
        }
        let strides = [0, 1, 2].map(|axis| if forward[axis] { 1 } else { -1 } << (8 - 4 * axis));
        let onward = forward.map(|forward| if forward { 4.0 } else { -4.0 });
        let step = inverse.to_array();
        let mut cell = cell_at(origin + direction * t, self.low, self.high);
        loop {
            let corner = (cell >> NODE) << NODE;
            let (low, high) = (corner.max(self.low), (corner + (1 << NODE)).min(self.high));
            let (first, last) = (low.as_vec3a(), high.as_vec3a());
            let table = self.nodes[self.node(cell)];
            let axis;
            if table == NONE {
                let ends = ((first - origin) * inverse).max((last - origin) * inverse).to_array();
                axis = nearest(&ends);
                if ends[axis] >= leave {
                    return;
                }
                t = if ends[axis] > t { ends[axis] } else { t };
            } else {
                let majorants = &self.majorants[table as usize * BLOCKS..][..BLOCKS];
                let block = ((cell - corner) >> BLOCK).to_array();
                let mut at = block[0] << 8 | block[1] << 4 | block[2];
                // Blocks from here to the node's end, and the planes where the ray leaves this one, along each axis.
                let count = |axis: usize| {
                    let end = if forward[axis] { high[axis] - 1 } else { low[axis] } - corner[axis];
                    ((end >> BLOCK) - block[axis]).abs()
                };
                let mut left = [count(0), count(1), count(2)];
                let ahead = |axis: usize| (corner[axis] + ((block[axis] + i32::from(forward[axis])) << BLOCK)) as f32;
                let mut planes = [ahead(0), ahead(1), ahead(2)];
                let (from, first, last) = (origin.to_array(), first.to_array(), last.to_array());
                let end = |planes: &[f32; 3], axis: usize| {
                    let plane = if planes[axis] < last[axis] { planes[axis] } else { last[axis] };
                    let plane = if plane > first[axis] { plane } else { first[axis] };
                    (plane - from[axis]) * step[axis]
                };
                let mut ends = [end(&planes, 0), end(&planes, 1), end(&planes, 2)];
                axis = loop {
                    let axis = nearest(&ends);
                    let end_here = ends[axis];
                    let to = if end_here < leave { end_here } else { leave };
                    let majorant = majorants[at as usize % BLOCKS];
                    if majorant > 0.0 && to > t {
                        let here = corner + (IVec3::new(at >> 8, at >> 4 & 15, at & 15) << BLOCK);
                        let (low, high) = (here.max(low), (here + (1 << BLOCK)).min(high));
                        if visit(Segment { origin, direction, inverse, from: t, to, before, majorant, low, high }).is_break() {
                            return;
                        }
                    }
                    if end_here >= leave {
                        return;
                    }
                    t = if end_here > t { end_here } else { t };
                    if left[axis] == 0 {
                        break axis;
                    }
                    left[axis] -= 1;
                    at += strides[axis];
                    planes[axis] += onward[axis];
                    ends[axis] = end(&planes, axis);
                };
            }
            cell = cell_at(origin + direction * t, low, high);
            cell[axis] = if forward[axis] { high[axis] } else { low[axis] - 1 };
            if cell[axis] < self.low[axis] || cell[axis] >= self.high[axis] {
                if !self.periodic || axis == 2 || tiles == MOST_TILES {
                    return;
                }
                // The next tile: distances are counted anew, so that they stay small.
                tiles += 1;
                origin += direction * t;
                (before, leave, t) = (before + t, leave - t, 0.0);
                (cell[axis], origin[axis]) =
                    if forward[axis] { (self.low[axis], self.first[axis]) } else { (self.high[axis] - 1, self.last[axis]) };
            }
        }
    }
}
