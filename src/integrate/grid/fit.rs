//! Smoothing what photons left in voxels, with little bias.
//!
//! Around each voxel a straight line in x, y and z is fitted to what lies within a Gaussian kernel (local linear regression; Fan and
//! Gijbels 1996), to the light in the medium alone: light bends where the medium ends, and what is beyond says nothing about what is
//! within. A voxel that the medium fills in part counts by its share, at the middle of that share. What the fit took away is fitted once more and given back (Tukey's twicing), so that the bias that is left falls as
//! the fourth power of the kernel's width, at the boundary as elsewhere. What was gathered is the mean over a voxel, and what will be looked up is
//! interpolated between voxels' centres: it is the means of that which are compared, so that neither dims what is curved.

use super::frame::Frame;
use super::sums::{SIDE, Taps, Terms};
use crate::scene::density::BRICK_VOXELS;
use glam::{IVec3, Mat3, Vec3};
use rayon::prelude::*;

/// No kernel is narrower, in voxels.
const NARROWEST: f64 = 0.3;
/// None reaches beyond the next brick.
const WIDEST: f64 = 3.4;
/// A kernel ends at so many standard deviations.
const REACH: f64 = 2.35;
/// How often what a fit took away is fitted and given back.
const GIVEN_BACK: u32 = 2;
/// What keeps a fit to voxels in a plane from tilting freely, as a share of the kernel's variance.
const RIDGE: f32 = 1e-3;
/// With less medium in a kernel, as a share of it, nothing is fitted.
const LEAST: f32 = 1e-4;

/// A kernel, ready for the voxels of a frame.
pub(super) struct Fit<'a> {
    frame: &'a Frame,
    taps: Taps,
    /// Of each voxel: what the sums of light, and of light times distance along each axis, count.
    shares: Vec<[f32; 4]>,
    fill: &'a [Fill],
    needed: &'a [bool],
    /// Of each voxel, how much of what is interpolated in it comes from voxels that hold light.
    known: Vec<f32>,
}

/// The sums of one kind alone.
const PLAIN: Terms<1, 1, 1> = Terms { x: [0], y: [(0, 0)], z: [(0, 0)] };

/// How much of a voxel holds medium, and the middle of that from the voxel's, in voxels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Fill {
    pub share: f32,
    pub middle: Vec3,
}

impl<'a> Fit<'a> {
    /// A kernel with a standard deviation of `width` voxels. `fill` is of each voxel, and `needed` says of each line of 8
    /// along z whether any light there will be looked up.
    pub fn new(frame: &'a Frame, fill: &'a [Fill], needed: &'a [bool], width: f64) -> Self {
        let width = width.clamp(NARROWEST, WIDEST);
        let taps = Taps::new(width, ((REACH * width).ceil() as usize).min(SIDE));
        // Of the weights, and of the middles times them: 1, x, y, z, xx, xy, xz, yy, yz, zz.
        let own: Vec<[f32; 4]> = fill.iter().map(|f| (f.middle * f.share).extend(f.share).to_array()).collect();
        let moments = Terms {
            x: [0, 1, 2],
            y: [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (2, 0)],
            z: [(0, 0), (3, 0), (1, 0), (0, 1), (5, 0), (4, 0), (3, 1), (2, 0), (1, 1), (0, 2)],
        };
        let ridge = RIDGE * (width * width) as f32;
        let least = LEAST * taps.whole().powi(3);
        let shares = |_: usize, z: [[f32; 4]; 10]| {
            let weights = z.map(|z| z[3]);
            let middles = [z[0], z[1], z[2], z[3]].map(|z| Vec3::from_slice(&z));
            if weights[0] < least { [0.0; 4] } else { shares(weights, middles, ridge) }
        };
        let shares = taps.around(frame, &own, &moments, needed, [0.0; 4], shares);
        let holds: Vec<[f32; 1]> = shares.iter().map(|s| [if *s == [0.0; 4] { 0.0 } else { 1.0 }]).collect();
        let known = Taps::interpolated().around(frame, &holds, &PLAIN, needed, 0.0, |_, [[sum]]| sum);
        Fit { frame, taps, shares, fill, needed, known }
    }

    /// Whether a voxel has medium enough around it.
    pub fn holds(&self, voxel: usize) -> bool {
        self.shares[voxel] != [0.0; 4]
    }

    /// Light per volume of the voxels, as it lies in their medium, to light at the voxels' centres, smoothed; and what of that was given
    /// back last, which tells by how much smoothing may still be off.
    pub fn smooth<const N: usize>(&self, light: &[[f32; N]]) -> (Vec<[f32; N]>, Vec<[f32; N]>) {
        let (mut sum, mut last) = (self.once(light), Vec::new());
        for _ in 0..GIVEN_BACK {
            let means = self.means(&sum);
            let rest = |(v, light): (usize, &[f32; N])| {
                let share = self.fill[v].share;
                let there = if share < 1.0 { self.in_medium(&sum, v) } else { means[v] };
                std::array::from_fn(|i| light[i] - share * there[i])
            };
            let rest: Vec<[f32; N]> = light.par_iter().enumerate().map(rest).collect();
            let back = self.once(&rest);
            sum.par_iter_mut().zip(&back).for_each(|(s, b)| s.iter_mut().zip(b).for_each(|(s, b)| *s += b));
            last = back;
        }
        (sum, last)
    }

    /// The mean light in each voxel, as it is looked up.
    fn means<const N: usize>(&self, light: &[[f32; N]]) -> Vec<[f32; N]> {
        let mean = |voxel: usize, [sum]: [[f32; N]; 1]| sum.map(|s| if self.known[voxel] > 0.0 { s / self.known[voxel] } else { 0.0 });
        Taps::interpolated().around(self.frame, light, &PLAIN, self.needed, [0.0; N], mean)
    }

    /// Light in the middle of a voxel's medium.
    fn in_medium<const N: usize>(&self, light: &[[f32; N]], voxel: usize) -> [f32; N] {
        let Fill { share, middle } = self.fill[voxel];
        if share <= 0.0 || middle == Vec3::ZERO {
            return light[voxel];
        }
        let (mut sum, mut whole) = ([0.0; N], 0.0);
        self.frame.beside(voxel, middle, |voxel, weight| {
            if self.holds(voxel) {
                whole += weight;
                sum.iter_mut().zip(&light[voxel]).for_each(|(s, l)| *s += weight * l);
            }
        });
        if whole > 0.0 { sum.map(|s| s / whole) } else { light[voxel] }
    }

    pub(super) fn once<const N: usize>(&self, own: &[[f32; N]]) -> Vec<[f32; N]> {
        let terms = Terms { x: [0, 1], y: [(0, 0), (0, 1), (1, 0)], z: [(0, 0), (2, 0), (1, 0), (0, 1)] };
        let fitted = |voxel: usize, sums: [[f32; N]; 4]| {
            let shares = &self.shares[voxel];
            std::array::from_fn(|i| sums.iter().zip(shares).map(|(sum, share)| share * sum[i]).sum())
        };
        self.taps.around(self.frame, own, &terms, self.needed, [0.0; N], fitted)
    }
}

/// Of each line of 8 voxels along z, whether there is medium in it or in the voxels around it.
pub(super) fn needed(frame: &Frame, fill: &[Fill]) -> Vec<bool> {
    let lines = |brick: usize| {
        let offsets = (0..27).map(|i| IVec3::new(i / 9 - 1, i / 3 % 3 - 1, i % 3 - 1));
        let around: Vec<(IVec3, usize)> = offsets.filter_map(|o| Some((o * SIDE as i32, frame.brick(frame.bricks[brick] + o)?))).collect();
        (0..BRICK_VOXELS / SIDE).map(move |line| {
            let (x, y) = ((line / SIDE) as i32, (line % SIDE) as i32);
            around.iter().any(|&(first, number)| {
                // The part of the neighbourhood of the line that lies in this brick.
                let (low, high) = (IVec3::new(x - 1, y - 1, -1) - first, IVec3::new(x + 1, y + 1, SIDE as i32) - first);
                let (low, high) = (low.max(IVec3::ZERO), high.min(IVec3::splat(SIDE as i32 - 1)));
                (low.x..=high.x).any(|i| {
                    (low.y..=high.y)
                        .any(|j| (low.z..=high.z).any(|k| fill[number * BRICK_VOXELS + (i << 6 | j << 3 | k) as usize].share > 0.0))
                })
            })
        })
    };
    (0..frame.bricks.len()).into_par_iter().flat_map_iter(lines).collect()
}

/// From the moments of the weights around a voxel, and those of the middles times them, to what each sum of light counts in the fit's
/// value there: the first row of the inverse of the equations that say that the fit's errors, and those times distance, sum to zero.
fn shares([one, x, y, z, xx, xy, xz, yy, yz, zz]: [f32; 10], middles: [Vec3; 4], ridge: f32) -> [f32; 4] {
    let (d, dd) = (Vec3::new(x, y, z) / one, [Vec3::new(xx, xy, xz), Vec3::new(xy, yy, yz), Vec3::new(xz, yz, zz)]);
    // Where the light is, and its spread by where voxels are: rows by voxel, columns by light.
    let at = d + middles[0] / one;
    let row = |i: usize| (dd[i] + middles[i + 1]) / one - d[i] * at + ridge * Vec3::AXES[i];
    let slope = Mat3::from_cols(row(0), row(1), row(2)).inverse() * at / one;
    if !slope.is_finite() {
        return [1.0 / one, 0.0, 0.0, 0.0];
    }
    [1.0 / one + slope.dot(d), -slope.x, -slope.y, -slope.z]
}
