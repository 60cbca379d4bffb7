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
const THICK: f64 = 2.0;
/// Voxels along a side of a brick and of what is around it.
const SIDE: i32 = BRICK_SIDE + 2;

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
    let inside = Bricks { count, origins: &density.origins, values: &inside };
    let grown: Vec<Vec<f32>> = origins.par_iter().map(|&origin| grow(source, part, &inside, origin, scene_from_index)).collect();
    let grown = Bricks { count, origins: &origins, values: &grown };
    let values: Vec<Vec<f32>> = origins.par_iter().map(|&origin| sharpen(&grown, origin)).collect();
    let values = values.concat();
    Ok(Numbers { count, world_from_index: density.world_from_index, origins, values })
}

/// Numbers of voxels by bricks, in the order of their origins; the first of a voxel that has none is NaN.
struct Bricks<'a> {
    count: usize,
    origins: &'a [[i32; 3]],
    values: &'a [Vec<f32>],
}

impl Bricks<'_> {
    /// The numbers of the voxels of a brick and of those around it, [`SIDE`] along each axis.
    fn table(&self, origin: [i32; 3]) -> Vec<Option<&[f32]>> {
        let known: Vec<Option<&[f32]>> = (0..27)
            .map(|i| {
                let beside: [i32; 3] = std::array::from_fn(|a| origin[a] + [i / 9 - 1, i / 3 % 3 - 1, i % 3 - 1][a] * BRICK_SIDE);
                self.origins.binary_search(&beside).ok().map(|brick| &self.values[brick][..])
            })
            .collect();
        let numbers = |p: [i32; 3]| {
            let brick = p.map(|c| c.div_euclid(BRICK_SIDE) + 1);
            let within = p.map(|c| c.rem_euclid(BRICK_SIDE));
            let first = (within[0] << 6 | within[1] << 3 | within[2]) as usize * self.count;
            let numbers = &known[(brick[0] * 9 + brick[1] * 3 + brick[2]) as usize]?[first..first + self.count];
            (!numbers[0].is_nan()).then_some(numbers)
        };
        (0..SIDE.pow(3)).map(|i| numbers([i / SIDE / SIDE - 1, i / SIDE % SIDE - 1, i % SIDE - 1])).collect()
    }
}

/// Where a voxel of a brick is in [`Bricks::table`].
fn place(voxel: usize) -> usize {
    let (side, [x, y, z]) = (SIDE as usize, [voxel >> 6, voxel >> 3 & 7, voxel & 7]);
    ((x + 1) * side + y + 1) * side + z + 1
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

/// The numbers of a brick's voxels; those of a voxel without medium as if that of the nearest one beside it reached there.
fn grow(source: &SourceFunction, part: usize, inside: &Bricks, origin: [i32; 3], scene: DAffine3) -> Vec<f32> {
    let (table, mut scratch) = (inside.table(origin), Scratch::default());
    let mut ways: Vec<[i32; 3]> = (0..27).map(|i| [i / 9 - 1, i / 3 % 3 - 1, i % 3 - 1]).collect();
    ways.sort_by_key(|way| way.iter().map(|w| w.abs()).sum::<i32>());
    let mut out = vec![0.0; BRICK_VOXELS * inside.count];
    for (v, out) in out.chunks_exact_mut(inside.count).enumerate() {
        let at = |way: [i32; 3]| table[(place(v) as i32 + (way[0] * SIDE + way[1]) * SIDE + way[2]) as usize];
        let Some((way, beside)) = ways.iter().find_map(|&way| Some((way, at(way)?))) else {
            out[0] = f32::NAN;
            continue;
        };
        let p = DVec3::from_array(std::array::from_fn(|a| f64::from(origin[a] + [v >> 6, v >> 3 & 7, v & 7][a] as i32)));
        let [p, middle] = [p, p + DVec3::from_array(way.map(f64::from))].map(|p| scene.transform_point3(p));
        // A voxel may hold medium, and its middle none.
        if way == [0; 3] || source.beside(part, (p, middle), &mut scratch, out) <= 0.0 {
            out.copy_from_slice(beside);
        }
    }
    out
}

/// The numbers of a brick's voxels so that what is trilinear between them is nearest to the light: a curve lies below its chords by a
/// twelfth of its second difference in the mean. What has no light gets 0.
fn sharpen(grown: &Bricks, origin: [i32; 3]) -> Vec<f32> {
    let table = grown.table(origin);
    let mut out = vec![0.0; BRICK_VOXELS * grown.count];
    for (v, out) in out.chunks_exact_mut(grown.count).enumerate() {
        let Some(own) = table[place(v)] else { continue };
        out.copy_from_slice(own);
        for stride in [SIDE * SIDE, SIDE, 1] {
            let Some((a, b)) = table[place(v) - stride as usize].zip(table[place(v) + stride as usize]) else { continue };
            out.iter_mut().zip(own).zip(a.iter().zip(b)).for_each(|((out, own), (a, b))| *out -= (a + b - 2.0 * own) / 12.0);
        }
        // Of light toward someone, and of sunlight, there is never less than none.
        if own[0] >= 0.0 {
            out[0] = out[0].max(0.0);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_trilinear_between_samples_is_right_in_the_mean() {
        // A parabola along an axis each; beyond the brick nothing is known.
        let f = |x: f64| 3.0 + 0.5 * x * x;
        let values: Vec<f32> = (0..BRICK_VOXELS).flat_map(|v| [f((v >> 6) as f64) as f32, f((v & 7) as f64) as f32]).collect();
        let grown = Bricks { count: 2, origins: &[[0; 3]], values: &[values] };
        let out = sharpen(&grown, [0; 3]);
        let at = |x: usize, z: usize, number: usize| f64::from(out[(x << 6 | 4 << 3 | z) * 2 + number]);
        // The curve's mean from 2 to 3.
        let mean = 3.0 + 0.5 * (27.0 - 8.0) / 3.0;
        assert!((0.5 * (at(2, 4, 0) + at(3, 4, 0)) - mean).abs() < 1e-5, "{}", at(2, 4, 0));
        assert!((0.5 * (at(4, 2, 1) + at(4, 3, 1)) - mean).abs() < 1e-5);
        // Unsharpened the chord is a twelfth too high; and where a neighbour is missing nothing is changed.
        assert!((0.5 * (f(2.0) + f(3.0)) - mean - 1.0 / 12.0).abs() < 1e-9);
        assert_eq!(at(0, 4, 0), f(0.0));
    }
}
