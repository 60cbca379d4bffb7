//! Sums along the axes of a frame's voxels: what separable kernels are made of.

use super::frame::Frame;
use crate::scene::density::BRICK_VOXELS;
use glam::IVec3;
use rayon::prelude::*;

/// Voxels along a brick, and so the longest reach of a kernel.
pub(super) const SIDE: usize = 8;

/// A kernel along an axis.
pub(super) struct Taps {
    /// By powers 0, 1 and 2 of the distance: values at -reach..=reach.
    powers: [Vec<f32>; 3],
}

/// Of each value, some sums: which of several values is summed, and by which power of the distance times the kernel.
pub(super) type Terms<const P: usize> = [(usize, usize); P];

impl Taps {
    /// A Gaussian with a standard deviation of `width` voxels that ends after `reach` of them.
    pub fn new(width: f64, reach: usize) -> Self {
        let tap = |i: usize, power: i32| {
            let d = i as f64 - reach as f64;
            ((-0.5 * (d / width).powi(2)).exp() * d.powi(power)) as f32
        };
        Taps { powers: [0, 1, 2].map(|power| (0..=2 * reach).map(|i| tap(i, power)).collect()) }
    }

    /// What the kernel itself sums to.
    pub fn whole(&self) -> f32 {
        self.powers[0].iter().sum()
    }

    /// Sums along an axis, of every voxel what `finish` makes of the `terms`; of lines along z only those that are `needed`, if that is
    /// given. Where there is nothing, the sum is `nothing`.
    pub fn along<const N: usize, const I: usize, const P: usize, R: Copy + Send + Sync>(
        &self,
        frame: &Frame,
        axis: usize,
        from: &[[[f32; N]; I]],
        (terms, needed): (Terms<P>, Option<&[bool]>),
        nothing: R,
        finish: impl Fn(usize, [[f32; N]; P]) -> R + Sync,
    ) -> Vec<R> {
        let stride = [64, 8, 1][axis];
        let reach = self.powers[0].len() / 2;
        // Of a brick, the first voxels of its lines along the axis.
        let starts: Vec<usize> = (0..BRICK_VOXELS).filter(|v| v / stride % SIDE == 0).collect();
        let mut out = vec![nothing; from.len()];
        out.par_chunks_exact_mut(BRICK_VOXELS).zip(&frame.bricks).enumerate().for_each(|(number, (out, &brick))| {
            let beside: [Option<usize>; 3] = std::array::from_fn(|i| frame.brick(brick + IVec3::AXES[axis] * (i as i32 - 1)));
            let mut lines = [[[0.0; N]; 3 * SIDE]; I];
            for &start in &starts {
                if needed.is_some_and(|needed| !needed[(number * BRICK_VOXELS + start) / SIDE]) {
                    continue;
                }
                let mut any = false;
                for (part, number) in beside.into_iter().enumerate() {
                    for k in 0..SIDE {
                        let values = number.map_or([[0.0; N]; I], |n| from[n * BRICK_VOXELS + start + k * stride]);
                        any |= values[0] != [0.0; N];
                        lines.iter_mut().zip(values).for_each(|(line, value)| line[part * SIDE + k] = value);
                    }
                }
                // Much of a brick at the boundary is empty.
                if !any {
                    continue;
                }
                for k in 0..SIDE {
                    let voxel = start + k * stride;
                    let sums = terms.map(|(which, power)| weighed(&self.powers[power], &lines[which][SIDE + k - reach..]));
                    out[voxel] = finish(number * BRICK_VOXELS + voxel, sums);
                }
            }
        });
        out
    }
}

#[inline]
fn weighed<const N: usize>(taps: &[f32], line: &[[f32; N]]) -> [f32; N] {
    let mut sum = [0.0; N];
    for (tap, from) in taps.iter().zip(line) {
        for (s, f) in sum.iter_mut().zip(from) {
            *s += tap * f;
        }
    }
    sum
}
