//! Photons that leave light in voxels.

use super::basis::Basis;
use super::field::Groups;
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

/// What photons have left: by class, of each voxel and number of the basis, what each group brought to the medium there, over the whole
/// voxel, as a sum.
pub(super) type Gathered = [Vec<Groups>; CLASSES.len()];

/// Room for what photons leave.
pub(super) fn empty(space: &Space, basis: &Basis) -> Gathered {
    CLASSES.map(|_| vec![[0.0f32; GROUPS]; space.frame.voxels() * basis.len()])
}

/// Follows photons, `items` of each group, from the item `first` on, and adds what they leave.
///
/// # Errors
/// [`crate::Error::Interrupted`].
pub(super) fn gather(
    (tracer, media, basis): (&Tracer, &Media, &Basis),
    space: &Space,
    (first, items): (u64, u64),
    seed: u64,
    into: &mut Gathered,
    progress: &dyn Progress,
) -> Result<()> {
    let step = f64::from(space.frame.step);
    let spacing = (SPACING / (space.usual * step)).max(1.0);
    let whole = WHOLE / (tracer.strongest() * basis.peak());
    let places = space.frame.voxels() * basis.len();
    let sums = (0..places * CLASSES.len()).into_par_iter().map(|_| AtomicU64::new(0)).collect();
    let held = space.fill.iter().map(|fill| Held::of(fill.share)).collect();
    let mut deposits = Deposits { space, basis, media, held, sums, whole, spacing: spacing as f32 };
    let unit = spacing / (whole * step.powi(2));
    progress.begin("photons", items * GROUPS as u64);
    for group in 0..GROUPS {
        let first = first + group as u64 * items;
        tracer.follow(first..first + items, seed, &deposits, progress)?;
        progress.at((group as u64 + 1) * items);
        for (class, light) in into.iter_mut().enumerate() {
            light.par_iter_mut().enumerate().for_each(|(place, light)| {
                let sum = deposits.sums[place * CLASSES.len() + class].load(Ordering::Relaxed) as i64;
                light[group] += (sum as f64 * unit) as f32;
            });
        }
        deposits.sums.par_iter_mut().for_each(|sum| *sum.get_mut() = 0);
    }
    Ok(())
}

/// How much of a voxel is medium.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Held {
    Nothing,
    Part,
    All,
}

impl Held {
    fn of(share: f32) -> Self {
        match share {
            ..=0.0 => Held::Nothing,
            1.0.. => Held::All,
            _ => Held::Part,
        }
    }
}

/// Where photons leave their light.
struct Deposits<'a> {
    space: &'a Space,
    basis: &'a Basis,
    media: &'a Media,
    /// Of each voxel: a byte, for the sake of the cache.
    held: Vec<Held>,
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
            match self.held[voxel] {
                Held::All => {}
                Held::Part if self.media.extinction(p) > 0.0 => {}
                _ => return,
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
