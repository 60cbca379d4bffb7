//! Light in voxels for bakes: what a [`super::field::Field`] holds, without the groups that tell its noise. So the same memory holds ten
//! times the voxels, and the numbers of a voxel are smoothed together.

use super::basis::Basis;
use super::deposit::{Held, SPACING, WHOLE};
use super::field::Request;
use super::fit::{Fit, needed};
use super::orders::Orders;
use super::space::Space;
use crate::error::Result;
use crate::geom::Ray;
use crate::media::Media;
use crate::photon::{Colour, Tracer, Witness};
use crate::progress::Progress;
use crate::rng::Rng;
use crate::scene::Phase;
use glam::Vec3;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};

/// As many numbers as are smoothed at once.
const LANES: usize = 8;
/// What a number of a voxel takes while light is gathered; and what a voxel takes while it is smoothed, beside each of its numbers, bytes.
const GATHERED: u64 = 60;
const SMOOTHED: [u64; 2] = [500, 24];
/// Classes whose harmonics of degrees 0 and 1 are kept apart: light that goes on to its second scattering, and to its third or fourth.
pub(super) const APART: usize = 2;
/// Harmonics of degrees 0 and 1.
const LOW: usize = 4;
/// A bake shows every edge from everywhere, and shares its noise among all views: voxels and kernels are so much narrower than a picture's.
pub(super) const NARROWER: f64 = 0.7;

/// Light in voxels.
#[derive(Debug)]
pub(super) struct Plain {
    basis: Basis,
    space: Space,
    photons: u64,
    /// Of each voxel, per unit of optical depth and of albedo: the numbers of the basis, and after them the first four of
    /// each class that is kept apart.
    light: Vec<f32>,
    /// Whether a voxel has medium around it.
    lit: Vec<bool>,
}

impl Plain {
    /// Voxels that so many bytes hold.
    pub(super) fn room(basis: &Basis, memory: u64) -> u64 {
        let numbers = basis.len() as u64;
        memory / (GATHERED * numbers).max(SMOOTHED[0] + SMOOTHED[1] * numbers)
    }

    /// Follows so many photons, and smooths their light.
    ///
    /// # Errors
    /// [`crate::Error::Interrupted`].
    pub(super) fn new(request: Request, tracer: &Tracer, photons: u64, progress: &dyn Progress) -> Result<Self> {
        let space = Space::new(&request);
        let Request { media, basis, orders, seed, .. } = request;
        let (numbers, items) = (basis.len(), photons.div_ceil(Tracer::PATHS));
        let photons = items * Tracer::PATHS;
        let step = f64::from(space.frame.step);
        let spacing = (SPACING / (space.usual * step)).max(1.0);
        let whole = WHOLE / (tracer.strongest() * basis.peak());
        let places = space.frame.voxels() * orders.count() * numbers;
        let sums = (0..places).into_par_iter().map(|_| AtomicU64::new(0)).collect();
        let held = space.fill.iter().map(|fill| Held::of(fill.share)).collect();
        let deposits = Deposits { space: &space, basis: &basis, orders: &orders, media, held, sums, whole, spacing: spacing as f32 };
        progress.begin("photons", items);
        tracer.follow(0..items, seed, (&deposits, &deposits.sums), progress, |done| progress.at(done))?;
        let unit = spacing / (whole * step.powi(2) * photons as f64);
        let raw: Vec<f32> = deposits.sums.par_iter().map(|sum| (sum.load(Ordering::Relaxed) as i64 as f64 * unit) as f32).collect();
        drop(deposits);
        let (light, lit) = smoothed(&space, &basis, &orders, &raw, (photons as f64 / tracer.silhouette(), request.coarser), progress)?;
        Ok(Plain { basis, space, photons, light, lit })
    }

    /// Paths that have been followed.
    pub(super) fn photons(&self) -> u64 {
        self.photons
    }

    /// Numbers of a place: those of the basis, and of harmonics the first four of each class that is kept apart.
    pub(super) fn numbers(&self) -> usize {
        stride(&self.basis)
    }

    /// Adds the light at `p`, per unit of optical depth and of albedo, to each of the numbers; `false` where there is none near.
    pub(super) fn at(&self, p: Vec3, into: &mut [f32]) -> bool {
        let (stride, mut whole) = (self.numbers(), 0.0f32);
        self.space.frame.around(p, |voxel, weight| whole += if self.lit[voxel] { weight } else { 0.0 });
        if whole <= 0.0 {
            return false;
        }
        self.space.frame.around(p, |voxel, weight| {
            if self.lit[voxel] {
                let light = &self.light[voxel * stride..][..stride];
                into.iter_mut().zip(light).for_each(|(sum, l)| *sum += weight / whole * l);
            }
        });
        true
    }

    /// Of the numbers of a place, what scattering with mean cosine `g` sends toward the camera of a basis that has one.
    pub(super) fn toward(&self, numbers: &[f32], g: f64) -> f32 {
        match &self.basis {
            Basis::View { cosines, .. } => numbers[cosines.iter().position(|&c| c == g).unwrap_or(0)],
            Basis::Around { .. } => 0.0,
        }
    }
}

/// How many numbers a voxel keeps.
fn stride(basis: &Basis) -> usize {
    basis.len() + if apart(basis) { LOW * APART } else { 0 }
}

/// Whether classes are kept apart.
fn apart(basis: &Basis) -> bool {
    matches!(basis, Basis::Around { degree: 1.. })
}

/// Raw light, by voxel, class and number, smoothed and added up; and whether a voxel has medium around it. `crowd` is photons over each
/// square metre, and how much wider than usual kernels are.
fn smoothed(
    space: &Space,
    basis: &Basis,
    orders: &Orders,
    raw: &[f32],
    (crowd, coarser): (f64, f64),
    progress: &dyn Progress,
) -> Result<(Vec<f32>, Vec<bool>)> {
    let Space { frame, fill, usual, .. } = space;
    let (numbers, stride, apart) = (basis.len(), stride(basis), apart(basis));
    let mut light = vec![0.0f32; frame.voxels() * stride];
    let mut lit = vec![true; frame.voxels()];
    let needed = needed(frame, fill);
    progress.begin("smoothing", orders.count() as u64);
    for class in 0..orders.count() {
        progress.check()?;
        progress.at(class as u64);
        let fit = Fit::new(frame, fill, &needed, coarser * orders.kernel(class, crowd / usual.powi(2)) / (usual * f64::from(frame.step)));
        lit.iter_mut().enumerate().for_each(|(voxel, lit)| *lit &= fit.holds(voxel));
        // Of each voxel `width` numbers, of which `lanes` are the basis's from `first` on.
        let mut add = |(first, lanes): (usize, usize), smooth: &[f32], width: usize| {
            light.par_chunks_exact_mut(stride).zip(smooth.par_chunks_exact(width)).for_each(|(light, smooth)| {
                for (number, &value) in (first..first + lanes).zip(smooth) {
                    light[number] += value;
                    if apart && class < APART && number < LOW {
                        light[numbers + LOW * class + number] = value;
                    }
                }
            });
        };
        let at = |voxel: usize, number: usize| raw[(voxel * orders.count() + class) * numbers + number];
        let mut first = 0;
        while first < numbers {
            // What is left over goes one by one.
            if numbers - first >= LANES / 2 {
                let lanes = LANES.min(numbers - first);
                let part = |voxel: usize| -> [f32; LANES] { std::array::from_fn(|i| if i < lanes { at(voxel, first + i) } else { 0.0 }) };
                let one: Vec<[f32; LANES]> = (0..frame.voxels()).into_par_iter().map(part).collect();
                let smooth = fit.smooth(&one).0;
                add((first, lanes), smooth.as_flattened(), LANES);
                first += lanes;
            } else {
                let one: Vec<[f32; 1]> = (0..frame.voxels()).into_par_iter().map(|voxel| [at(voxel, first)]).collect();
                let smooth = fit.smooth(&one).0;
                add((first, 1), smooth.as_flattened(), 1);
                first += 1;
            }
        }
    }
    Ok((light, lit))
}

/// Where photons leave their light.
struct Deposits<'a> {
    space: &'a Space,
    basis: &'a Basis,
    orders: &'a Orders,
    media: &'a Media,
    held: Vec<Held>,
    /// By voxel, class and number of the basis.
    sums: Vec<AtomicU64>,
    /// What a photon of 1 W leaves in a point for 1/sr.
    whole: f64,
    /// Between points, in voxels.
    spacing: f32,
}

impl Witness for Deposits<'_> {
    const KEEPS: bool = false;

    #[inline]
    fn flight(&self, ray: &Ray, reach: f32, power: f64, _: Colour, events: u64, rng: &mut Rng) {
        if events == 0 {
            return;
        }
        let (class, share) = (self.orders.class(events + 1), (power * self.whole) as f32);
        // Below zero as the two's complement: sums come out right.
        let add = |sum: &AtomicU64, light: f32| {
            sum.fetch_add((share * light) as i64 as u64, Ordering::Relaxed);
        };
        let numbers = self.basis.len();
        let whole = self.basis.of_direction(ray.direction);
        self.space.frame.along(ray, reach, (self.spacing, rng.uniform_f32()), |p, voxel| {
            match self.held[voxel] {
                Held::All => {}
                Held::Part if self.media.extinction(p) > 0.0 => {}
                _ => return,
            }
            let sums = &self.sums[(voxel * self.orders.count() + class) * numbers..][..numbers];
            match &whole {
                Some(values) => sums.iter().zip(values).for_each(|(sum, &value)| add(sum, value)),
                None => self.basis.each(p, ray.direction, false, |number, value| add(&sums[number], value)),
            }
        });
    }

    fn aside(&self, p: Vec3, before: Vec3, phase: Phase, rng: &mut Rng) -> Option<(Vec3, f64)> {
        self.basis.aside(p, before, phase, rng)
    }

    fn share(&self, p: Vec3, before: Vec3, direction: Vec3, phase: Phase) -> f64 {
        self.basis.share(p, before, direction, phase)
    }
}
