//! Photons that leave light in voxels.

use super::basis::Basis;
use super::field::{Groups, Request};
use super::space::Space;
use crate::error::Result;
use crate::geom::Ray;
use crate::media::Media;
use crate::photon::{GROUPS, Tracer, Witness};
use crate::progress::Progress;
use crate::rng::Rng;
use glam::Vec3;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};

/// The last order of each class of light: what has scattered alike often is smoothed alike.
pub(super) const CLASSES: [u64; 5] = [2, 4, 8, 16, u64::MAX];
/// Points along a flight are so many mean free paths apart, or a voxel where that is more.
const SPACING: f64 = 1.0;
/// Phase functions with a mean cosine nearer to 0 have no peak worth aiming with.
const PEAKED: f64 = 0.3;
/// How many flights are aimed at the camera, per collision.
const ASIDE: f32 = 0.3;
/// Sums are of whole numbers, of which the strongest photon in the phase function's peak is 2^36: the same in whatever order.
const WHOLE: f64 = (1u64 << 36) as f64;

/// Follows the photons: by class, what each group leaves in the medium of each voxel, over the whole voxel, as its share of all.
///
/// # Errors
/// [`crate::Error::Interrupted`].
pub(super) fn gathered(request: &Request, space: &Space, progress: &dyn Progress) -> Result<Vec<Vec<Groups>>> {
    let Space { frame, usual, .. } = space;
    let (tracer, basis) = (request.tracer, &request.basis);
    let items = request.photons.div_ceil(GROUPS as u64 * Tracer::PATHS);
    let step = f64::from(frame.step);
    let spacing = (SPACING / (usual * step)).max(1.0);
    let whole = WHOLE / (tracer.strongest() * basis.peak());
    let values = frame.voxels() * basis.len();
    let sums = (0..values * CLASSES.len()).into_par_iter().map(|_| AtomicU64::new(0)).collect();
    let deposits = Deposits { space, basis, media: request.media, sums, whole, spacing: spacing as f32 };
    let mut classes = vec![vec![[0.0f32; GROUPS]; values]; CLASSES.len()];
    // Each group is an independent estimate; their mean is the field.
    let unit = spacing / (whole * step.powi(2) * (items * Tracer::PATHS) as f64 * GROUPS as f64);
    progress.begin("photons", items * GROUPS as u64);
    for group in 0..GROUPS {
        let first = request.first + group as u64 * items;
        tracer.follow(first..first + items, request.seed, &deposits, progress)?;
        progress.at((group as u64 + 1) * items);
        for (class, light) in classes.iter_mut().enumerate() {
            light.par_iter_mut().enumerate().for_each(|(i, light)| {
                let sum = deposits.sums[i * CLASSES.len() + class].swap(0, Ordering::Relaxed) as i64;
                light[group] = (sum as f64 * unit) as f32;
            });
        }
    }
    Ok(classes)
}

/// Where photons leave their light.
struct Deposits<'a> {
    space: &'a Space,
    basis: &'a Basis,
    media: &'a Media,
    /// Of each voxel and number of the basis, by class.
    sums: Vec<AtomicU64>,
    /// What a photon of 1 W leaves in a point for 1/sr.
    whole: f64,
    /// Between points, in voxels.
    spacing: f32,
}

impl Witness for Deposits<'_> {
    const KEEPS: bool = false;

    #[inline]
    fn flight(&self, ray: &Ray, reach: f32, power: f64, events: u64, rng: &mut Rng) {
        if events == 0 {
            return;
        }
        let class = CLASSES.iter().filter(|&&last| last < events + 1).count();
        let share = (power * self.whole) as f32;
        self.space.frame.along(ray, reach, (self.spacing, rng.uniform_f32()), |p, voxel| {
            let held = self.space.fill[voxel].share;
            if held < 1.0 && (held <= 0.0 || self.media.extinction(p) <= 0.0) {
                return;
            }
            let first = voxel * self.basis.len() * CLASSES.len() + class;
            self.basis.each(p, ray.direction, |number, value| {
                // Below zero as the two's complement: sums come out right.
                self.sums[first + number * CLASSES.len()].fetch_add((share * value) as i64 as u64, Ordering::Relaxed);
            });
        });
    }

    /// Most of what a photon sends toward the camera it sends when it happens to fly there, seldom and much at once. So now and then
    /// a flight begins toward the camera by the phase function of the scattering that is to follow, and shares with the photon's
    /// own by the balance heuristic: what either could find is bounded by the other.
    #[inline]
    fn aside(&self, p: Vec3, before: Vec3, g: f64, rng: &mut Rng) -> Option<(Vec3, f64)> {
        if g.abs() < PEAKED || !matches!(self.basis, Basis::View { .. }) || rng.uniform_f32() >= ASIDE {
            return None;
        }
        let direction = self.basis.toward(p, g, (rng.uniform(), rng.uniform_f32()))?;
        Some((direction, self.basis.own(p, before, direction, g, ASIDE).into()))
    }

    #[inline]
    fn share(&self, p: Vec3, before: Vec3, direction: Vec3, g: f64) -> f64 {
        if g.abs() < PEAKED { 1.0 } else { self.basis.own(p, before, direction, g, ASIDE).into() }
    }
}
