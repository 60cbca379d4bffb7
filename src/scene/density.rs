//! Sparse voxel grids: bricks of 8 x 8 x 8 samples, the shape of OpenVDB's leaves.

use glam::{DAffine3, DVec3};
use rayon::prelude::*;

/// Samples along one side of a brick.
pub const BRICK_SIDE: i32 = 8;
/// Samples in a brick.
pub const BRICK_VOXELS: usize = 512;

/// A sparse grid of scalar samples, voxel-centred: index (i, j, k) is the sample at `world_from_index * (i, j, k)`.
/// Space outside the bricks is zero.
#[derive(Debug, Clone, PartialEq)]
pub struct BrickGrid {
    /// From index space (whole numbers are sample positions) to the world.
    pub world_from_index: DAffine3,
    /// The smallest index of each brick, multiples of 8, sorted (x, then y, then z), each once.
    pub origins: Vec<[i32; 3]>,
    /// 512 samples a brick in the order of `origins`; within a brick z runs fastest: `x * 64 + y * 8 + z`.
    pub values: Vec<f32>,
}

impl BrickGrid {
    /// The samples of brick `i`, z fastest.
    pub fn brick(&self, i: usize) -> &[f32] {
        &self.values[i * BRICK_VOXELS..(i + 1) * BRICK_VOXELS]
    }

    /// The smallest and the largest index of the bricks' samples.
    pub fn extent(&self) -> ([i32; 3], [i32; 3]) {
        let low = self.origins.iter().fold([i32::MAX; 3], |m, o| std::array::from_fn(|a| m[a].min(o[a])));
        let high = self.origins.iter().fold([i32::MIN; 3], |m, o| std::array::from_fn(|a| m[a].max(o[a] + BRICK_SIDE - 1)));
        (low, high)
    }

    /// The sample at an index; 0 outside the bricks.
    pub fn at(&self, index: [i32; 3]) -> f32 {
        self.at_or(index, 0.0)
    }

    /// The sample at an index; `beyond` outside the bricks.
    pub fn at_or(&self, index: [i32; 3], beyond: f32) -> f32 {
        let origin = index.map(|i| i & !(BRICK_SIDE - 1));
        let [x, y, z] = std::array::from_fn(|a| (index[a] - origin[a]) as usize);
        self.origins.binary_search(&origin).map_or(beyond, |brick| self.brick(brick)[x << 6 | y << 3 | z])
    }

    /// The volume of one voxel in m^3.
    pub fn voxel_volume(&self) -> f64 {
        self.world_from_index.matrix3.determinant().abs()
    }

    /// The integral of the grid over space (its value times m^3), summed in f64, by bricks: the same on any number of threads.
    pub fn integral(&self) -> f64 {
        let sum = |brick: &[f32]| {
            let mut lanes = [0.0f64; 8];
            brick.chunks_exact(8).for_each(|row| lanes.iter_mut().zip(row).for_each(|(lane, &value)| *lane += f64::from(value)));
            lanes.iter().sum()
        };
        let bricks: Vec<f64> = self.values.par_chunks(BRICK_VOXELS).map(sum).collect();
        bricks.iter().sum::<f64>() * self.voxel_volume()
    }

    /// The number of samples that are not zero.
    pub fn active_voxels(&self) -> u64 {
        self.values.par_chunks(BRICK_VOXELS).map(|brick| brick.iter().filter(|&&v| v != 0.0).count() as u64).sum()
    }

    /// The world position of sample `voxel` of brick `brick`.
    pub fn position(&self, brick: usize, voxel: usize) -> DVec3 {
        let local = [voxel >> 6, (voxel >> 3) & 7, voxel & 7];
        let index = std::array::from_fn::<f64, 3, _>(|a| f64::from(self.origins[brick][a]) + local[a] as f64);
        self.world_from_index.transform_point3(DVec3::from_array(index))
    }
}
