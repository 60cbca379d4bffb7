//! Voxel grids as rays see them: a sparse tree of bricks, local majorants, and walks that provably advance.
//!
//! Index space is that of the grid, moved so that its lowest node is at 0. A *cell* (i, j, k) spans the samples i to i + 1
//! along each axis; density within it is trilinear. Nodes of 64^3 cells hold bricks of 8^3 cells, a brick eight blocks of
//! 4^3 cells, and each block the largest sample that its cells can see: its majorant, exact by construction.

use crate::scene::VoxelGrid;
use crate::scene::density::{BRICK_SIDE, BRICK_VOXELS};
use glam::{DAffine3, DVec3, IVec3, Mat3A, Vec3, Vec3A};
use rayon::prelude::*;
use shade::Shade;
use shares::Shares;
use std::sync::Arc;

const NONE: u32 = u32::MAX;
/// Bits of a cell's coordinate below those of its node, brick, block.
const NODE: i32 = 6;
const BRICK: i32 = 3;
const BLOCK: i32 = 2;
/// Blocks in a node.
const BLOCKS: usize = 4096;

/// A voxel grid, compiled.
#[derive(Debug, Clone)]
pub(super) struct Grid {
    pub(super) region: u32,
    source: Arc<VoxelGrid>,
    /// From the scene's local space (m) to index space.
    index_from_local: Mat3A,
    offset: Vec3A,
    /// What rays see of index space: where density can be above zero, or one tile along repeated axes.
    low: IVec3,
    high: IVec3,
    /// The same, as rays compute with them.
    first: Vec3A,
    last: Vec3A,
    /// The first sample that is another's repetition.
    seam: IVec3,
    periodic: bool,
    /// Nodes along each axis; their tables' numbers, or NONE.
    size: IVec3,
    nodes: Vec<u32>,
    /// 512 entries a node: the brick's number, or NONE.
    tables: Vec<u32>,
    /// Those with samples first, as in the source; the others are seen by cells whose far samples are a neighbour's.
    bricks: Vec<Brick>,
    /// 4096 entries a node: the largest sample that each block's cells can see, x slowest.
    majorants: Vec<f32>,
    shares: Shares,
    shade: Shade,
    /// Extinction in 1/m of a sample of 1.
    sigma_t: f64,
}

#[derive(Debug, Clone, Copy)]
struct Brick {
    /// Its first cell.
    corner: IVec3,
    /// The mean density of each block, x slowest.
    means: [f32; 8],
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
            index_from_local: to_index.matrix3.as_mat3().into(),
            offset: to_index.translation.as_vec3a(),
            low: low - base,
            high: high - base,
            first: (low - base).as_vec3a(),
            last: (high - base).as_vec3a(),
            seam: IVec3::select(repeated.cmpgt(IVec3::ZERO), high - base, IVec3::MAX),
            periodic: source.periodic,
            size,
            nodes: vec![NONE; (size.x * size.y * size.z) as usize],
            tables: Vec::new(),
            bricks: Vec::new(),
            majorants: Vec::new(),
            shares: Shares::new(&source.bricks.values),
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
        let mut seen: Vec<[i32; 3]> = Vec::with_capacity(own.len() * 2);
        for o in &own {
            for x in seam(0, o.x).into_iter().flatten() {
                for y in seam(1, o.y).into_iter().flatten() {
                    for z in seam(2, o.z).into_iter().flatten() {
                        seen.push([x, y, z]);
                    }
                }
            }
        }
        seen.sort_unstable();
        seen.dedup();
        // Bricks with samples have the same number here as in the source, even where rays see nothing of them.
        for (i, corner) in own.iter().copied().chain(seen.into_iter().map(IVec3::from_array)).enumerate() {
            let inside = corner.cmpge(IVec3::ZERO).all() && corner.cmplt(self.size << NODE).all();
            if i >= own.len() && (!inside || self.brick(corner).is_some()) {
                continue;
            }
            if inside {
                let slot = self.node(corner);
                if self.nodes[slot] == NONE {
                    self.nodes[slot] = (self.tables.len() / 512) as u32;
                    self.tables.resize(self.tables.len() + 512, NONE);
                }
                let entry = self.entry(corner).unwrap_or_default();
                self.tables[entry] = self.bricks.len() as u32;
            }
            self.bricks.push(Brick { corner, means: [0.0; 8] });
        }
        let blocks: Vec<[(f32, f32); 8]> = self.bricks.par_iter().map(|brick| self.blocks(brick.corner)).collect();
        self.majorants = vec![0.0; self.tables.len() / 512 * BLOCKS];
        for (i, blocks) in blocks.into_iter().enumerate() {
            self.bricks[i].means = blocks.map(|b| b.1);
            let corner = self.bricks[i].corner;
            // Only bricks that rays can see have an entry.
            if self.brick(corner) == Some(i) {
                let table = self.nodes[self.node(corner)] as usize * BLOCKS;
                for (b, (majorant, _)) in blocks.into_iter().enumerate() {
                    let at = (corner >> BLOCK & 15) + IVec3::new(b as i32 >> 2, b as i32 >> 1 & 1, b as i32 & 1);
                    self.majorants[table + (at.x << 8 | at.y << 4 | at.z) as usize] = majorant;
                }
            }
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

    /// An index that no cell's corner lies beyond, as one of this tile's samples.
    #[inline]
    fn unrepeated(&self, at: IVec3) -> IVec3 {
        at - IVec3::select(at.cmpge(self.seam), self.high - self.low, IVec3::ZERO)
    }

    /// The sample at an index that no cell's corner lies beyond.
    #[inline]
    fn sample(&self, at: IVec3) -> f32 {
        let at = self.unrepeated(at);
        self.brick(at).map_or(0.0, |brick| self.sample_in(brick, at))
    }

    /// The sample of a brick at an index in it; bricks beyond the source's have none that is not 0.
    #[inline]
    fn sample_in(&self, brick: usize, at: IVec3) -> f32 {
        let v = at & 7;
        self.source.bricks.values.get(brick * BRICK_VOXELS + (v.x << 6 | v.y << 3 | v.z) as usize).copied().unwrap_or(0.0)
    }

    /// The trilinear density at a point of the local space; 0 outside.
    pub(super) fn density(&self, p: Vec3) -> f32 {
        let mut at = self.index_from_local * p + Vec3::from(self.offset);
        let (low, high) = (self.low.as_vec3(), self.high.as_vec3());
        if self.periodic {
            let size = high - low;
            for axis in 0..2 {
                at[axis] = low[axis] + (at[axis] - low[axis]).rem_euclid(size[axis]).min(size[axis].next_down());
            }
        }
        let cell = at.floor().as_ivec3();
        if cell.cmplt(self.low).any() || cell.cmpge(self.high).any() {
            return 0.0;
        }
        trilinear(&self.corners(cell), (at - cell.as_vec3()).into())
    }

    /// The mean density of a cell's block.
    #[inline]
    fn mean(&self, cell: IVec3) -> f32 {
        let b = (cell >> BLOCK) & 1;
        self.brick(cell).map_or(0.0, |brick| self.bricks[brick].means[(b.x << 2 | b.y << 1 | b.z) as usize])
    }

    /// The samples at a cell's corners, x slowest.
    #[inline]
    fn corners(&self, cell: IVec3) -> [f32; 8] {
        let v = cell & 7;
        // All in one brick, and none beyond a tile's seam.
        if v.max_element() < 7 && (cell + 1).cmplt(self.seam).all() {
            let at = self.brick(cell).unwrap_or(self.bricks.len()) * BRICK_VOXELS + (v.x << 6 | v.y << 3 | v.z) as usize;
            return self.source.bricks.values.get(at..at + 74).map_or([0.0; 8], |s| [s[0], s[1], s[8], s[9], s[64], s[65], s[72], s[73]]);
        }
        std::array::from_fn(|i| self.sample(cell + IVec3::new(i as i32 >> 2 & 1, i as i32 >> 1 & 1, i as i32 & 1)))
    }
}

/// Between the eight values at a cell's corners, x slowest; held within the cell.
#[inline]
fn trilinear(c: &[f32; 8], p: Vec3A) -> f32 {
    let f = p.clamp(Vec3A::ZERO, Vec3A::ONE);
    let mix = |a: f32, b: f32, f: f32| a + (b - a) * f;
    let face = |i: usize| mix(mix(c[i], c[i + 1], f.z), mix(c[i + 2], c[i + 3], f.z), f.y);
    mix(face(0), face(4), f.x)
}

mod shade;
mod shares;
#[cfg(test)]
mod tests;
mod track;
mod walk;
