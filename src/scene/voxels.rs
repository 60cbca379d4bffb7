//! A voxel grid as a shape: where it is, and how much it holds.

use super::BrickGrid;
use crate::geom::Bounds;
use glam::DVec3;
use rayon::prelude::*;

/// A grid of densities as a region's shape. A sample times the region's medium is extinction: the medium is that of a
/// sample of 1. Between samples density is trilinear; outside it is zero.
#[derive(Debug, Clone)]
pub struct VoxelGrid {
    /// The samples; none is negative, all are finite.
    pub bricks: BrickGrid,
    /// The smallest index of the samples that count: a tile begins here, and the bounds half a voxel before it.
    pub min: [i32; 3],
    /// The largest.
    pub max: [i32; 3],
    /// Whether the grid is repeated along its first two axes without end (`--periodic xy`).
    pub periodic: bool,
    integral: f64,
    thickest: f64,
    breadth: f64,
}

impl VoxelGrid {
    /// A grid whose samples from `min` to `max` (inclusive) count.
    pub fn new(bricks: BrickGrid, min: [i32; 3], max: [i32; 3], periodic: bool) -> Self {
        let integral = bricks.integral();
        let columns = columns(&bricks);
        let thickest = columns.iter().map(|c| c.depth).fold(0.0, f64::max);
        // Along repeated axes there is no end to measure to.
        let breadth = columns[if periodic { 2 } else { 0 }..].iter().map(|c| c.breadth).fold(f64::INFINITY, f64::min);
        VoxelGrid { bricks, min, max, periodic, integral, thickest, breadth }
    }

    /// The bounds of its voxels in the world; of one tile where it is periodic.
    pub fn bounds(&self) -> Bounds {
        self.grown(0.5)
    }

    /// Where its density can be above zero: half a voxel beyond the bounds.
    pub fn support(&self) -> Bounds {
        self.grown(1.0)
    }

    fn grown(&self, by: f64) -> Bounds {
        let end = |i: usize, far: bool| if far { f64::from(self.max[i]) + by } else { f64::from(self.min[i]) - by };
        (0..8usize).fold(Bounds::EMPTY, |bounds, corner| {
            let index = DVec3::from_array(std::array::from_fn(|i| end(i, corner >> i & 1 == 1)));
            bounds.include(self.bricks.world_from_index.transform_point3(index))
        })
    }

    /// The density at a point of the world, trilinear between samples: the slow way, for a few points.
    pub fn density(&self, p: DVec3) -> f64 {
        let p = self.bricks.world_from_index.inverse().transform_point3(p);
        let (base, f) = (p.floor(), p - p.floor());
        (0..8usize).fold(0.0, |sum, corner| {
            let side = [corner >> 2 & 1, corner >> 1 & 1, corner & 1];
            let weight: f64 = (0..3).map(|a| if side[a] == 1 { f[a] } else { 1.0 - f[a] }).product();
            sum + weight * f64::from(self.sample(std::array::from_fn(|a| base[a] as i32 + side[a] as i32)))
        })
    }

    /// The sample at an index, of whichever tile.
    pub fn sample(&self, mut index: [i32; 3]) -> f32 {
        if self.periodic {
            for ((index, min), max) in index.iter_mut().zip(self.min).zip(self.max).take(2) {
                *index = min + (*index - min).rem_euclid(max - min + 1);
            }
        }
        self.bricks.at(index)
    }

    /// The integral of density over space: its value times m^3.
    pub fn integral(&self) -> f64 {
        self.integral
    }

    /// The largest integral of density along a column of samples of any axis: its value times m.
    pub fn thickest(&self) -> f64 {
        self.thickest
    }

    /// How thick its dense part is, m: the least over the axes that do not repeat of the length that the column with the largest
    /// integral would have were it even, (sum of samples)^2 / (sum of their squares). The shortest side of an even box, an even
    /// ball's diameter; a thin fringe hardly changes it.
    pub fn breadth(&self) -> f64 {
        self.breadth
    }

    /// The shortest edge of a voxel, m.
    pub fn voxel_size(&self) -> f64 {
        let m = self.bricks.world_from_index.matrix3;
        [m.x_axis, m.y_axis, m.z_axis].iter().map(|a| a.length()).fold(f64::INFINITY, f64::min)
    }
}

/// A column of samples along an axis.
#[derive(Debug, Clone, Copy, Default)]
struct Column {
    /// The integral of density along it.
    depth: f64,
    /// The length that it would have were it even, m.
    breadth: f64,
}

impl Column {
    /// The one with the larger integral, the first of equals.
    fn deeper(self, other: Column) -> Column {
        if other.depth > self.depth { other } else { self }
    }
}

/// The column with the largest integral, of each axis: the same on any number of threads.
fn columns(bricks: &BrickGrid) -> [Column; 3] {
    [thickest::<0>(bricks), thickest::<1>(bricks), thickest::<2>(bricks)]
}

fn thickest<const AXIS: usize>(bricks: &BrickGrid) -> Column {
    let step = bricks.world_from_index.matrix3.col(AXIS).length();
    // Bricks of one column stand together, once sorted by their other two coordinates; their own order decides in which they are summed.
    let place = |i: u32| (bricks.origins[i as usize][(AXIS + 1) % 3], bricks.origins[i as usize][(AXIS + 2) % 3]);
    let mut order: Vec<u32> = (0..bricks.origins.len() as u32).collect();
    order.par_sort_by_key(|&i| place(i));
    let best = |group: &[u32]| {
        // Eight sums at a time, of samples that follow each other along z: columns side by side, or parts of one along z itself.
        let (mut sums, mut squares) = ([[0.0f64; 8]; 64], [[0.0f64; 8]; 64]);
        for &brick in group {
            for (row, samples) in bricks.brick(brick as usize).chunks_exact(8).enumerate() {
                let to = [row & 7, row >> 3, row][AXIS];
                for ((sum, square), &value) in sums[to].iter_mut().zip(&mut squares[to]).zip(samples) {
                    *sum += f64::from(value);
                    *square += f64::from(value) * f64::from(value);
                }
            }
        }
        let column = |(sum, squares): (f64, f64)| Column { depth: step * sum, breadth: step * sum * sum / squares };
        let each = sums.iter().zip(&squares);
        if AXIS == 2 {
            let whole = |(sums, squares): (&[f64; 8], &[f64; 8])| column((sums.iter().sum(), squares.iter().sum()));
            return each.map(whole).fold(Column::default(), Column::deeper);
        }
        let beside = each.take(8).flat_map(|(sums, squares)| sums.iter().copied().zip(squares.iter().copied()));
        beside.map(column).fold(Column::default(), Column::deeper)
    };
    let groups: Vec<Column> = order.par_chunk_by(|&i, &j| place(i) == place(j)).map(best).collect();
    groups.into_iter().fold(Column::default(), Column::deeper)
}
