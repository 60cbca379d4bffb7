//! Light that has scattered more than once, in voxels.
//!
//! Photons are followed as in pass 1, and at even distances along every flight leave in the voxel they are in what they would send
//! toward the camera: power times distance times phase function over volume, an unbiased estimate of the mean, over the medium in the
//! voxel, of the integral of radiance times phase function (a track-length estimator). Each order of scattering is smoothed over a distance
//! that fits it ([`super::fit`]), and rays look the sum up. What smoothing costs is told by the comparison with
//! [`crate::integrate::Integrator::Path`].

use super::basis::Basis;
use super::deposit::{CLASSES, gathered};
use super::fit::{Fit, needed};
use super::frame::Frame;
use super::space::Space;
use crate::bvh::Box3;
use crate::error::Result;
use crate::media::Media;
use crate::photon::{GROUPS, Tracer};
use crate::progress::Progress;
use crate::scene::Scene;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// What each group of photons brings, W m^-2 sr^-1.
pub(super) type Groups = [f32; GROUPS];
/// As many groups as are smoothed at once: what memory that takes.
const LANES: usize = 8;
/// The standard deviation of each class's kernel in mean free paths, at [`USUAL`] photons over each square mean free path.
const KERNELS: [f64; CLASSES.len()] = [0.55, 0.8, 1.2, 1.7, 2.4];
const USUAL: f64 = 200.0;

/// What a field is for.
pub(super) struct Request<'a> {
    pub scene: &'a Scene,
    pub media: &'a Media,
    pub tracer: &'a Tracer,
    pub basis: Basis,
    /// Of the local space, in the world.
    pub origin: DVec3,
    /// Whether light in a box is asked for.
    pub seen: &'a (dyn Fn(Box3) -> bool + Sync),
    /// Paths, the first item of [`Tracer::follow`], and the seed.
    pub photons: u64,
    pub first: u64,
    pub seed: u64,
    /// Voxels at most, and how much wider than usual.
    pub voxels: usize,
    pub coarser: f64,
}

/// Light in voxels.
#[derive(Debug)]
pub(super) struct Field {
    frame: Frame,
    basis: Basis,
    /// Of each voxel and number of the basis, per unit of optical depth and of albedo, by groups.
    light: Vec<Groups>,
    /// Whether a voxel has medium around it.
    lit: Vec<bool>,
}

impl Field {
    /// The light of a scene.
    ///
    /// # Errors
    /// [`crate::Error::Interrupted`].
    pub(super) fn new(request: Request, progress: &dyn Progress) -> Result<Self> {
        let space = Space::new(&request);
        let classes = gathered(&request, &space, progress)?;
        let Space { frame, fill, usual } = space;
        // The kernel that is best grows slowly as photons get fewer: with twicing its bias falls as a high power of its width.
        let crowd = request.photons as f64 / (request.tracer.silhouette() * usual * usual);
        let wider = (USUAL / crowd).powf(1.0 / 11.0).clamp(0.5, 2.0);
        let numbers = request.basis.len();
        let mut light = vec![[0.0f32; GROUPS]; frame.voxels() * numbers];
        let needed = needed(&frame, &fill);
        let mut lit = vec![true; frame.voxels()];
        progress.begin("smoothing", CLASSES.len() as u64);
        for (class, gathered) in classes.into_iter().enumerate() {
            progress.check()?;
            progress.at(class as u64);
            let fit = Fit::new(&frame, &fill, &needed, request.coarser * wider * KERNELS[class] / (usual * f64::from(frame.step)));
            lit.iter_mut().enumerate().for_each(|(voxel, lit)| *lit &= fit.holds(voxel));
            for number in 0..numbers {
                for first in (0..GROUPS).step_by(LANES) {
                    let part = |i: usize| -> [f32; LANES] { std::array::from_fn(|lane| gathered[i * numbers + number][first + lane]) };
                    let one: Vec<[f32; LANES]> = (0..frame.voxels()).into_par_iter().map(part).collect();
                    for (sum, add) in light.iter_mut().skip(number).step_by(numbers).zip(fit.smooth(&one)) {
                        sum[first..].iter_mut().zip(add).for_each(|(s, a)| *s += a);
                    }
                }
            }
        }
        Ok(Field { frame, basis: request.basis, light, lit })
    }

    /// Adds `share` of the light that scattering with mean cosine `g` at `p` sends into `outward`, per unit of optical depth and of
    /// albedo, by groups whose sum it is. In the field of a camera `outward` is the way to it.
    #[inline]
    pub(super) fn scattered(&self, p: Vec3, outward: Vec3, g: f64, share: f32, sum: &mut Groups) {
        let (mut whole, mut found, mut count) = (0.0f32, [(0usize, 0.0f32); 8], 0);
        self.frame.around(p, |voxel, weight| {
            if self.lit[voxel] {
                whole += weight;
                found[count] = (voxel, weight);
                count += 1;
            }
        });
        if whole <= 0.0 {
            return;
        }
        let numbers = self.basis.len();
        for &(voxel, weight) in &found[..count] {
            let weight = weight * share / whole;
            self.basis.shares(g, outward, |number, part| {
                sum.iter_mut().zip(&self.light[voxel * numbers + number]).for_each(|(s, &l)| *s += weight * part * l);
            });
        }
    }

    /// Voxels.
    pub(super) fn voxels(&self) -> u64 {
        self.frame.voxels() as u64
    }
}
