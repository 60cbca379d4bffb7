//! Light in voxels for bakes: what a [`super::field::Field`] holds, without the groups that tell its noise. So the same memory holds ten
//! times the voxels, and the numbers of a voxel are smoothed together.

use super::basis::Basis;
use super::behind::behind;
use super::deposit::Deposits;
use super::field::Request;
use super::fit::{Fit, needed};
use super::orders::{Orders, Through};
use super::space::Space;
use crate::error::Result;
use crate::media::Media;
use crate::photon::{SimilarMedia, Tracer};
use crate::progress::Progress;
use crate::trimesh::TriMesh;
use glam::Vec3;
use rayon::prelude::*;

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
    orders: Orders,
    photons: u64,
    /// Of each voxel, per unit of optical depth and of albedo: the numbers of the basis, and after them the first four of
    /// each class that is kept apart; or those seen through similar media, and what arrives from behind through these, W m^-2 sr^-1.
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
    pub(super) fn new(request: Request, (tracer, surfaces): (&Tracer, &TriMesh), photons: u64, progress: &dyn Progress) -> Result<Self> {
        let space = Space::new(&request);
        let Request { media, basis, orders, seed, .. } = request;
        let (numbers, items) = (basis.len(), photons.div_ceil(Tracer::PATHS));
        let photons = items * Tracer::PATHS;
        let deposits = Deposits::new((tracer, media, &basis, &orders), &space, 1);
        progress.begin("photons", items);
        deposits.follow(tracer, 0..items, seed, progress, |done| progress.at(done))?;
        let (places, classes, each) = (space.frame.voxels() * numbers, orders.count(), 1.0 / photons as f64);
        let raw = |i: usize| (deposits.take(i / classes, i % classes, 0) * each) as f32;
        let raw: Vec<f32> = (0..places * classes).into_par_iter().map(raw).collect();
        drop(deposits);
        let (light, lit) = smoothed(&space, &basis, &orders, &raw, (photons as f64 / tracer.silhouette(), request.coarser), progress)?;
        let mut plain = Plain { basis, space, orders, photons, light, lit };
        plain.look_behind(media, surfaces);
        Ok(plain)
    }

    /// Adds what arrives from behind through similar media.
    fn look_behind(&mut self, media: &Media, surfaces: &TriMesh) {
        let (Some(similar), Basis::View { eye, .. }) = (self.orders.similar(), &self.basis) else { return };
        let stride = self.numbers();
        let sent = |voxel: usize, g: f64| self.toward(&self.light[voxel * stride..][..stride], g, Through::Similar);
        let found = behind(&self.space, (media, similar), surfaces, *eye, sent);
        self.light.par_chunks_exact_mut(stride).zip(found).for_each(|(light, found)| light[stride - 1] = found);
    }

    /// The media through which some of its light is seen.
    pub(super) fn similar(&self) -> Option<&SimilarMedia> {
        self.orders.similar()
    }

    /// Paths that have been followed.
    pub(super) fn photons(&self) -> u64 {
        self.photons
    }

    /// Numbers of a place: those of the basis, and of harmonics the first four of each class that is kept apart.
    pub(super) fn numbers(&self) -> usize {
        stride(&self.basis, &self.orders)
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

    /// Of the numbers of a place, what scattering with mean cosine `g` sends toward the camera of a basis that has one, as far as it is seen
    /// through such media.
    pub(super) fn toward(&self, numbers: &[f32], g: f64, through: Through) -> f32 {
        match &self.basis {
            Basis::View { cosines, .. } => {
                let number = cosines.iter().position(|&c| c == g).unwrap_or(0);
                numbers[number + if through == Through::Similar { cosines.len() } else { 0 }]
            }
            Basis::Around { .. } => 0.0,
        }
    }

    /// Of the numbers of a place, what arrives there from behind through similar media, on its way to the camera.
    pub(super) fn behind(&self, numbers: &[f32]) -> f32 {
        if self.similar().is_some() { numbers[self.numbers() - 1] } else { 0.0 }
    }
}

/// How many numbers a voxel keeps.
fn stride(basis: &Basis, orders: &Orders) -> usize {
    match (basis, orders.similar()) {
        (Basis::View { .. }, Some(_)) => 2 * basis.len() + 1,
        _ => basis.len() + if apart(basis) { LOW * APART } else { 0 },
    }
}

/// Whether classes are kept apart.
fn apart(basis: &Basis) -> bool {
    matches!(basis, Basis::Around { degree: 1.. })
}

/// Raw light, by voxel, number and class, smoothed and added up; and whether a voxel has medium around it. `crowd` is photons over each
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
    let (numbers, stride, apart) = (basis.len(), stride(basis, orders), apart(basis));
    let mut light = vec![0.0f32; frame.voxels() * stride];
    let mut lit = vec![true; frame.voxels()];
    let needed = needed(frame, fill);
    progress.begin("smoothing", orders.count() as u64);
    for class in 0..orders.count() {
        progress.check()?;
        progress.at(class as u64);
        let fit = Fit::new(frame, fill, &needed, coarser * orders.kernel(class, crowd / usual.powi(2), *usual) / f64::from(frame.step));
        lit.iter_mut().enumerate().for_each(|(voxel, lit)| *lit &= fit.holds(voxel));
        let similar = matches!(basis, Basis::View { .. }) && orders.through(class) == Through::Similar;
        let place = if similar { numbers } else { 0 };
        // Of each voxel `width` numbers, of which `lanes` are the basis's from `first` on.
        let mut add = |(first, lanes): (usize, usize), smooth: &[f32], width: usize| {
            light.par_chunks_exact_mut(stride).zip(smooth.par_chunks_exact(width)).for_each(|(light, smooth)| {
                for (number, &value) in (first..first + lanes).zip(smooth) {
                    light[place + number] += value;
                    if apart && class < APART && number < LOW {
                        light[numbers + LOW * class + number] = value;
                    }
                }
            });
        };
        let at = |voxel: usize, number: usize| raw[(voxel * numbers + number) * orders.count() + class];
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
