//! Voxel grids as rays see them: a sparse tree of bricks, local majorants, and walks that provably advance.
//!
//! Index space is that of the grid, moved so that its lowest node is at 0. A *cell* (i, j, k) spans the samples i to i + 1
//! along each axis; density within it is trilinear. Nodes of 64^3 cells hold bricks of 8^3 cells, a brick eight blocks of
//! 4^3 cells, and each block the largest sample that its cells can see: its majorant, exact by construction.

use crate::geom::Ray;
use crate::rng::Rng;
use crate::scene::VoxelGrid;
use crate::scene::density::{BRICK_SIDE, BRICK_VOXELS};
use glam::{DAffine3, DVec3, IVec3, Mat3, Vec3};
use rayon::prelude::*;
use shade::Shade;
use std::ops::ControlFlow;
use std::sync::Arc;

const NONE: u32 = u32::MAX;
/// Bits of a cell's coordinate below those of its node, brick, block.
const NODE: i32 = 6;
const BRICK: i32 = 3;
const BLOCK: i32 = 2;
/// So many voxels are near.
const NEAR: f32 = 8.0;
/// A transmittance plays roulette each time that it has fallen by so many optical depths, and goes on with this probability.
const FAINT_DEPTH: f64 = 2.0;
const SURVIVAL: f64 = 0.25;
/// A level ray in an empty gap of a repeated grid never leaves: after so many tiles it is let go.
const MOST_TILES: u32 = 1 << 20;

/// A voxel grid, compiled.
#[derive(Debug, Clone)]
pub(super) struct Grid {
    pub(super) region: u32,
    source: Arc<VoxelGrid>,
    /// From the scene's local space (m) to index space.
    index_from_local: Mat3,
    offset: Vec3,
    /// What rays see of index space: where density can be above zero, or one tile along repeated axes.
    low: IVec3,
    high: IVec3,
    periodic: bool,
    /// Nodes along each axis; their tables' numbers, or NONE.
    size: IVec3,
    nodes: Vec<u32>,
    /// 512 entries a node: the brick's entry in `bricks`, or NONE.
    tables: Vec<u32>,
    bricks: Vec<Brick>,
    shade: Shade,
    /// Extinction in 1/m of a sample of 1.
    sigma_t: f64,
}

#[derive(Debug, Clone, Copy)]
struct Brick {
    /// The largest sample that each block's cells can see, x slowest.
    majorants: [f32; 8],
    /// The mean density of each block.
    means: [f32; 8],
    /// The first of its samples in the source's, or NONE where they are all 0.
    samples: u32,
}

/// A stretch of a ray within one block.
struct Segment {
    /// The ray's origin, in index space and within this tile.
    origin: Vec3,
    direction: Vec3,
    /// Distances along the ray from `origin`, m.
    from: f32,
    to: f32,
    /// To be added to them: from the ray's own origin to `origin`.
    before: f32,
    /// The largest sample that can be met.
    majorant: f32,
    /// The block's cells: from `low`, below `high`.
    low: IVec3,
    high: IVec3,
}

impl Grid {
    /// Compiles the grid of region number `region`, with extinction `sigma_t` for a sample of 1, relative to `origin`.
    pub(super) fn new(region: u32, source: &Arc<VoxelGrid>, sigma_t: f64, origin: DVec3) -> Self {
        let node = 1 << NODE;
        let (min, max) = (IVec3::from_array(source.min), IVec3::from_array(source.max));
        let repeated = IVec3::new(source.periodic.into(), source.periodic.into(), 0);
        let (low, high) = (min - (IVec3::ONE - repeated), max + 1);
        let base = IVec3::from_array(low.to_array().map(|l| l.div_euclid(node) * node));
        let size = (high - base) / node + 1;
        let world = source.bricks.world_from_index;
        let to_index = DAffine3::from_translation(-base.as_dvec3()) * world.inverse() * DAffine3::from_translation(origin);
        let mut grid = Grid {
            region,
            source: Arc::clone(source),
            index_from_local: to_index.matrix3.as_mat3(),
            offset: to_index.translation.as_vec3(),
            low: low - base,
            high: high - base,
            periodic: source.periodic,
            size,
            nodes: vec![NONE; (size.x * size.y * size.z) as usize],
            tables: Vec::new(),
            bricks: Vec::new(),
            shade: Shade::default(),
            sigma_t,
        };
        grid.plant(base);
        grid
    }

    /// Fills nodes, tables and bricks.
    fn plant(&mut self, base: IVec3) {
        // A brick's first samples are seen by the cells of the bricks before it, across the tile's seam too.
        let seam = |axis: usize, at: i32| {
            let across = self.periodic && axis < 2 && at <= self.low[axis];
            [Some(at), Some(at - BRICK_SIDE), across.then_some((self.high[axis] - 1) & !(BRICK_SIDE - 1))]
        };
        let source = Arc::clone(&self.source);
        let own: Vec<IVec3> = source.bricks.origins.iter().map(|&o| IVec3::from_array(o) - base).collect();
        let mut wanted: Vec<[i32; 3]> = Vec::with_capacity(own.len() * 2);
        for o in &own {
            for x in seam(0, o.x).into_iter().flatten() {
                for y in seam(1, o.y).into_iter().flatten() {
                    for z in seam(2, o.z).into_iter().flatten() {
                        if x.min(y).min(z) >= 0 {
                            wanted.push([x, y, z]);
                        }
                    }
                }
            }
        }
        wanted.sort_unstable();
        wanted.dedup();
        for &o in &wanted {
            let slot = self.node(IVec3::from_array(o));
            if self.nodes[slot] == NONE {
                self.nodes[slot] = (self.tables.len() / 512) as u32;
                self.tables.resize(self.tables.len() + 512, NONE);
            }
            let entry = self.entry(IVec3::from_array(o)).unwrap_or_default();
            self.tables[entry] = self.bricks.len() as u32;
            self.bricks.push(Brick { majorants: [0.0; 8], means: [0.0; 8], samples: NONE });
        }
        for (i, &o) in own.iter().enumerate() {
            if let Some(brick) = self.brick(o) {
                self.bricks[brick].samples = i as u32;
            }
        }
        let blocks: Vec<[(f32, f32); 8]> = wanted.par_iter().map(|&o| self.blocks(IVec3::from_array(o))).collect();
        for (brick, blocks) in self.bricks.iter_mut().zip(blocks) {
            (brick.majorants, brick.means) = (blocks.map(|b| b.0), blocks.map(|b| b.1));
        }
    }

    /// Of each block of a brick, the largest of the 5^3 samples that its cells see, and their mean density.
    fn blocks(&self, brick: IVec3) -> [(f32, f32); 8] {
        std::array::from_fn(|block| {
            let corner = brick + IVec3::new(block as i32 >> 2 & 1, block as i32 >> 1 & 1, block as i32 & 1) * (1 << BLOCK);
            let (mut most, mut sum) = (0.0f32, 0.0f32);
            for x in 0..=4 {
                for y in 0..=4 {
                    for z in 0..=4 {
                        let at = corner + IVec3::new(x, y, z);
                        if at.cmplt(self.size << NODE).all() {
                            let sample = self.sample(at);
                            most = most.max(sample);
                            // Samples on a face belong half to the neighbour.
                            sum += sample * [x, y, z].iter().map(|&i| if i % 4 == 0 { 0.5 } else { 1.0 }).product::<f32>();
                        }
                    }
                }
            }
            (most, sum / 64.0)
        })
    }

    #[inline]
    fn node(&self, cell: IVec3) -> usize {
        let n = cell >> NODE;
        ((n.x * self.size.y + n.y) * self.size.z + n.z) as usize
    }

    /// Where the tables name a cell's brick; `None` where its node is empty.
    #[inline]
    fn entry(&self, cell: IVec3) -> Option<usize> {
        let table = *self.nodes.get(self.node(cell))?;
        let b = (cell >> BRICK) & 7;
        (table != NONE).then(|| table as usize * 512 + (b.x << 6 | b.y << 3 | b.z) as usize)
    }

    #[inline]
    fn brick(&self, cell: IVec3) -> Option<usize> {
        let brick = self.tables[self.entry(cell)?];
        (brick != NONE).then_some(brick as usize)
    }

    /// The sample at an index that no cell's corner lies beyond.
    #[inline]
    fn sample(&self, mut at: IVec3) -> f32 {
        if self.periodic {
            for axis in 0..2 {
                if at[axis] >= self.high[axis] {
                    at[axis] -= self.high[axis] - self.low[axis];
                }
            }
        }
        let samples = self.brick(at).map_or(NONE, |b| self.bricks[b].samples);
        if samples == NONE {
            return 0.0;
        }
        let v = at & 7;
        self.source.bricks.values[samples as usize * BRICK_VOXELS + (v.x << 6 | v.y << 3 | v.z) as usize]
    }

    /// The mean density of a cell's block.
    #[inline]
    fn mean(&self, cell: IVec3) -> f32 {
        let b = (cell >> BLOCK) & 1;
        self.brick(cell).map_or(0.0, |brick| self.bricks[brick].means[(b.x << 2 | b.y << 1 | b.z) as usize])
    }

    /// The size in bits and the majorant of the largest block around a cell that is known to be alike.
    #[inline]
    fn block(&self, cell: IVec3) -> (i32, f32) {
        let Some(entry) = self.entry(cell) else { return (NODE, 0.0) };
        let brick = self.tables[entry];
        if brick == NONE {
            return (BRICK, 0.0);
        }
        let b = (cell >> BLOCK) & 1;
        (BLOCK, self.bricks[brick as usize].majorants[(b.x << 2 | b.y << 1 | b.z) as usize])
    }

    /// Flies until a collision, at most to `t_max`, by null collisions: the distance.
    ///
    /// A collision is accepted by one of the eight samples around it, drawn with its weight as probability: the expectation
    /// is the trilinear density, so collisions are distributed as by that, for an eighth of the work.
    pub(super) fn fly(&self, ray: &Ray, t_max: f32, rng: &mut Rng, violations: &mut u64) -> Option<f32> {
        let mut tau = rng.optical_depth();
        let mut found = None;
        self.walk::<false>(ray, t_max, |segment| {
            let sigma = f64::from(segment.majorant) * self.sigma_t;
            let mut at = f64::from(segment.from);
            loop {
                let left = sigma * (f64::from(segment.to) - at);
                if tau >= left {
                    tau -= left;
                    return ControlFlow::Continue(());
                }
                at += tau / sigma;
                let sample = self.one_sample(&segment, at as f32, rng);
                *violations += u64::from(sample > segment.majorant);
                if rng.uniform_f32() * segment.majorant < sample {
                    found = Some(segment.before + at as f32);
                    return ControlFlow::Break(());
                }
                tau = rng.optical_depth();
            }
        });
        found
    }

    /// An unbiased estimate of the transmittance over the first `t_max` metres: exact until it has fallen by
    /// [`FAINT_DEPTH`], where what is left begins to play roulette.
    pub(super) fn transmittance(&self, ray: &Ray, t_max: f32, rng: &mut Rng) -> f64 {
        let (mut depth, mut limit, mut weight) = (0.0, FAINT_DEPTH, 1.0);
        self.walk::<true>(ray, t_max, |segment| {
            depth += self.depth(&segment) * self.sigma_t;
            while depth > limit {
                if rng.uniform() >= SURVIVAL {
                    weight = 0.0;
                    return ControlFlow::Break(());
                }
                weight /= SURVIVAL;
                limit += FAINT_DEPTH;
            }
            ControlFlow::Continue(())
        });
        if weight > 0.0 { weight * (-depth).exp() } else { 0.0 }
    }

    /// The optical depth over the first `t_max` metres, exact but for rounding: along a line trilinear density is a cubic within
    /// each cell, which Simpson's rule integrates without error.
    pub(super) fn optical_depth(&self, ray: &Ray, t_max: f32) -> f64 {
        let mut sum = 0.0;
        self.walk::<true>(ray, t_max, |segment| {
            sum += self.depth(&segment);
            ControlFlow::Continue(())
        });
        sum * self.sigma_t
    }

    /// The integral of density along a stretch within one cell, by Simpson's rule.
    #[inline]
    fn depth(&self, segment: &Segment) -> f64 {
        let corners = self.corners(segment.low);
        let low = segment.low.as_vec3();
        let density = |t: f32| trilinear(&corners, segment.origin + segment.direction * t - low);
        let (from, to) = (segment.from, segment.to);
        f64::from(to - from) * f64::from(density(from) + 4.0 * density(0.5 * (from + to)) + density(to)) * (1.0 / 6.0)
    }

    /// The samples at a cell's corners, x slowest.
    #[inline]
    fn corners(&self, cell: IVec3) -> [f32; 8] {
        let v = cell & 7;
        // All in one brick, and none beyond a tile's seam.
        if v.max_element() < 7 && (cell + 1).cmplt(self.high).all() {
            let samples = self.brick(cell).map_or(NONE, |b| self.bricks[b].samples);
            if samples == NONE {
                return [0.0; 8];
            }
            let at = samples as usize * BRICK_VOXELS + (v.x << 6 | v.y << 3 | v.z) as usize;
            if let Some(s) = self.source.bricks.values.get(at..at + 74) {
                return [s[0], s[1], s[8], s[9], s[64], s[65], s[72], s[73]];
            }
        }
        std::array::from_fn(|i| self.sample(cell + IVec3::new(i as i32 >> 2 & 1, i as i32 >> 1 & 1, i as i32 & 1)))
    }

    /// Where the ray's line is within the box of the grid's voxels, or within its layer where it is repeated.
    pub(super) fn voxel_box(&self, ray: &Ray) -> (f32, f32) {
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

    /// One of the eight samples around the point at distance `at`, drawn by its weight.
    #[inline]
    fn one_sample(&self, segment: &Segment, at: f32, rng: &mut Rng) -> f32 {
        let p = segment.origin + segment.direction * at;
        // Rounding may carry a point out of its block: it is held there, where the majorant is known.
        let base = p.as_ivec3().clamp(segment.low, segment.high - 1);
        let beyond = rng.uniform_vec3().cmplt(p - base.as_vec3());
        self.sample(base + IVec3::new(beyond.x.into(), beyond.y.into(), beyond.z.into()))
    }

    /// The optical depth along `ray`, roughly, and no farther than to `most`: near by in steps of a voxel, then by the means of blocks.
    fn rough_depth(&self, ray: &Ray, most: f32) -> f32 {
        let mut depth = 0.0;
        self.walk::<false>(ray, f32::INFINITY, |segment| {
            let (length, per_metre) = (segment.to - segment.from, segment.direction.length());
            if segment.before + segment.from > NEAR / per_metre {
                depth += self.mean(segment.low) * length * self.sigma_t as f32;
                return if depth < most { ControlFlow::Continue(()) } else { ControlFlow::Break(()) };
            }
            let steps = (length * per_metre).ceil();
            let step = length / steps;
            for i in 0..steps as u32 {
                let p = segment.origin + segment.direction * (segment.from + (i as f32 + 0.5) * step);
                let cell = p.as_ivec3().clamp(segment.low, segment.high - 1);
                depth += trilinear(&self.corners(cell), p - cell.as_vec3()) * step * self.sigma_t as f32;
            }
            if depth < most { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        });
        depth
    }

    /// Visits the stretches of the ray within blocks whose majorant is not 0 (within their cells, on a fine walk), in order.
    #[inline]
    fn walk<const FINE: bool>(&self, ray: &Ray, t_max: f32, mut visit: impl FnMut(Segment) -> ControlFlow<()>) {
        let direction = self.index_from_local * ray.direction;
        let mut origin = self.index_from_local * ray.origin + self.offset;
        let inverse = Vec3::from_array(direction.to_array().map(|d| if d.abs() < 1e-30 { 1e30f32.copysign(d) } else { 1.0 / d }));
        let forward = inverse.cmpgt(Vec3::ZERO);
        // The stretch in which density can be above 0; without end along repeated axes.
        let (near, far) = ((self.low.as_vec3() - origin) * inverse, (self.high.as_vec3() - origin) * inverse);
        let (mut enter, mut leave) = (0.0f32, t_max);
        for axis in (if self.periodic { 2 } else { 0 })..3 {
            enter = enter.max(near[axis].min(far[axis]));
            leave = leave.min(near[axis].max(far[axis]));
        }
        // NaN (a ray that is none) ends here too.
        if enter.partial_cmp(&leave) != Some(std::cmp::Ordering::Less) {
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

/// Between the eight values at a cell's corners, x slowest; held within the cell.
#[inline]
fn trilinear(c: &[f32; 8], p: Vec3) -> f32 {
    let f = p.clamp(Vec3::ZERO, Vec3::ONE);
    let mix = |a: f32, b: f32, f: f32| a + (b - a) * f;
    let face = |i: usize| mix(mix(c[i], c[i + 1], f.z), mix(c[i + 2], c[i + 3], f.z), f.y);
    mix(face(0), face(4), f.x)
}

mod shade;
