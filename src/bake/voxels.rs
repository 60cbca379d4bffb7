//! Light at the voxels of a density grid, and one voxel beyond: what lies between the last sample and the first empty one has light too.

use crate::error::Result;
use crate::integrate::SourceFunction;
use crate::media::Scratch;
use crate::progress::{Progress, share};
use crate::scene::BrickGrid;
use crate::scene::density::{BRICK_SIDE, BRICK_VOXELS};
use glam::{DAffine3, DVec3};
use rayon::prelude::*;
use std::collections::BTreeSet;

/// Beyond this optical depth across, a voxel's light is the mean of its eighths'.
const THICK: f64 = 0.5;

/// Some numbers a voxel.
pub(super) struct Numbers {
    count: usize,
    world_from_index: DAffine3,
    origins: Vec<[i32; 3]>,
    /// Of each voxel of each brick.
    values: Vec<f32>,
}

impl Numbers {
    /// A grid of what `of` makes of each voxel's; `None` where that is nothing everywhere.
    pub(super) fn grid(&self, of: impl Fn(&[f32]) -> f32 + Sync + Send) -> Option<BrickGrid> {
        let values: Vec<f32> = self.values.par_chunks(self.count).map(of).collect();
        let lit = values.par_iter().any(|&v| v != 0.0);
        lit.then(|| BrickGrid { world_from_index: self.world_from_index, origins: self.origins.clone(), values })
    }
}

/// The numbers of a part of the light where density is not zero, and around there.
///
/// # Errors
/// [`crate::Error::Interrupted`].
pub(super) fn lit(
    source: &SourceFunction,
    part: usize,
    density: &BrickGrid,
    turned: Option<DAffine3>,
    progress: &dyn Progress,
) -> Result<Numbers> {
    let count = source.numbers();
    let scene_from_index = turned.map_or(density.world_from_index, |turn| turn.inverse() * density.world_from_index);
    let (bricks, before) = (density.origins.len() as u64, (part * density.origins.len()) as u64);
    let of_brick = |brick: u64| {
        let brick = brick as usize;
        if progress.cancelled() { Vec::new() } else { one(source, part, density, brick, scene_from_index, &mut Scratch::default()) }
    };
    let inside: Vec<Vec<f32>> = share(0..bricks, of_brick, progress, |done| progress.at(before + done))?;
    progress.check()?;
    // The bricks that a voxel beyond the medium may be in.
    let mut around = BTreeSet::new();
    for (brick, origin) in density.origins.iter().enumerate() {
        let values = density.brick(brick);
        for i in 0..27 {
            let way = [i / 9 - 1, i / 3 % 3 - 1, i % 3 - 1];
            let reaches = |v: usize| {
                let at = [v >> 6, v >> 3 & 7, v & 7];
                (0..3).all(|a| way[a] == 0 || at[a] as i32 == if way[a] < 0 { 0 } else { BRICK_SIDE - 1 })
            };
            if (0..BRICK_VOXELS).any(|v| values[v] != 0.0 && reaches(v)) {
                let beside: [i32; 3] = std::array::from_fn(|a| origin[a] + way[a] * BRICK_SIDE);
                around.insert(beside);
            }
        }
    }
    let origins: Vec<[i32; 3]> = around.into_iter().collect();
    let grown: Vec<Vec<f32>> = origins.par_iter().map(|&origin| grow(density, &inside, count, origin)).collect();
    Ok(Numbers { count, world_from_index: density.world_from_index, origins, values: grown.concat() })
}

/// The numbers of a brick's voxels; NaN where there is no medium.
fn one(source: &SourceFunction, part: usize, density: &BrickGrid, brick: usize, scene: DAffine3, scratch: &mut Scratch) -> Vec<f32> {
    let count = source.numbers();
    let mut out = vec![f32::NAN; BRICK_VOXELS * count];
    let edge = scene.matrix3.determinant().abs().cbrt();
    let mut eighth = vec![0.0; count];
    for (v, numbers) in out.chunks_exact_mut(count).enumerate() {
        if density.brick(brick)[v] == 0.0 {
            continue;
        }
        let at: [f64; 3] = std::array::from_fn(|a| f64::from(density.origins[brick][a] + [v >> 6, v >> 3 & 7, v & 7][a] as i32));
        let centre = DVec3::from_array(at);
        let sigma_t = source.at(part, scene.transform_point3(centre), scratch, numbers);
        if sigma_t > 0.0 && sigma_t * edge < THICK {
            continue;
        }
        let (mut sums, mut whole) = (vec![0.0f64; count], 0.0);
        for i in 0..8 {
            let offset = DVec3::new(f64::from(i >> 2), f64::from(i >> 1 & 1), f64::from(i & 1)) * 0.5 - 0.25;
            let sigma_t = source.at(part, scene.transform_point3(centre + offset), scratch, &mut eighth);
            if sigma_t > 0.0 {
                whole += sigma_t;
                sums.iter_mut().zip(&eighth).for_each(|(sum, &e)| *sum += sigma_t * f64::from(e));
            }
        }
        numbers.iter_mut().zip(&sums).for_each(|(n, sum)| *n = if whole > 0.0 { (sum / whole) as f32 } else { f32::NAN });
    }
    out
}

/// The numbers of a brick's voxels, those without medium by the mean of what is beside them.
fn grow(density: &BrickGrid, inside: &[Vec<f32>], count: usize, origin: [i32; 3]) -> Vec<f32> {
    // The brick and one voxel around it.
    let side = BRICK_SIDE + 2;
    let known: Vec<Option<&[f32]>> = (0..27)
        .map(|i| {
            let beside: [i32; 3] = std::array::from_fn(|a| origin[a] + [i / 9 - 1, i / 3 % 3 - 1, i % 3 - 1][a] * BRICK_SIDE);
            density.origins.binary_search(&beside).ok().map(|brick| &inside[brick][..])
        })
        .collect();
    let numbers = |p: [i32; 3]| {
        let brick = p.map(|c| c.div_euclid(BRICK_SIDE) + 1);
        let within = p.map(|c| c.rem_euclid(BRICK_SIDE));
        let first = (within[0] << 6 | within[1] << 3 | within[2]) as usize * count;
        let numbers = &known[(brick[0] * 9 + brick[1] * 3 + brick[2]) as usize]?[first..first + count];
        (!numbers[0].is_nan()).then_some(numbers)
    };
    let table: Vec<Option<&[f32]>> = (0..side.pow(3)).map(|i| numbers([i / side / side - 1, i / side % side - 1, i % side - 1])).collect();
    let mut out = vec![0.0; BRICK_VOXELS * count];
    for (v, out) in out.chunks_exact_mut(count).enumerate() {
        let at = ((v as i32 >> 6) * side + (v as i32 >> 3 & 7)) * side + (v as i32 & 7);
        if let Some(own) = table[(at + side * side + side + 1) as usize] {
            out.copy_from_slice(own);
            continue;
        }
        let mut found = 0.0f32;
        for i in 0..27 {
            if let Some(beside) = table[(at + (i / 9 * side + i / 3 % 3) * side + i % 3) as usize] {
                found += 1.0;
                out.iter_mut().zip(beside).for_each(|(sum, &b)| *sum += b);
            }
        }
        if found > 0.0 {
            out.iter_mut().for_each(|sum| *sum /= found);
        }
    }
    out
}
