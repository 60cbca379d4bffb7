//! Photons that leave light in voxels.

use super::basis::Basis;
use super::field::Groups;
use super::orders::{Orders, Through};
use super::space::Space;
use crate::error::Result;
use crate::geom::Ray;
use crate::media::Media;
use crate::photon::{Colour, GROUPS, SimilarMedia, Tracer, Witness};
use crate::progress::Progress;
use crate::rng::Rng;
use crate::scene::{Phase, medium::luminance};
use glam::Vec3;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};

/// Points along a flight are so many mean free paths apart, or a voxel where that is more.
const SPACING: f64 = 1.0;
/// And so many times as far in similar media, whose free paths are longer.
const WIDER: f32 = 2.0;
/// Flights toward the camera where a surface reflects a photon: they cost little, and limbs before bright ground are as smooth as the rest.
const OFF_SURFACE: u32 = 6;
/// Sums are of whole numbers, of which the strongest photon in the phase function's peak is 2^36: the same in whatever order.
const WHOLE: f64 = (1u64 << 36) as f64;

/// What photons have left: by class, of each voxel and number of the basis, what they brought to the medium there, over the whole voxel,
/// as a sum.
pub(super) struct Gathered {
    /// Luminance, by groups.
    pub light: Vec<Vec<Groups>>,
    /// Red and blue of all groups, where colours ride along; else nothing.
    pub colour: Vec<Vec<[f32; 2]>>,
}

impl Gathered {
    /// Room for what photons leave.
    pub fn empty(space: &Space, basis: &Basis, classes: usize, coloured: bool) -> Self {
        let places = space.frame.voxels() * basis.len();
        Gathered {
            light: vec![vec![[0.0f32; GROUPS]; places]; classes],
            colour: vec![vec![[0.0f32; 2]; if coloured { places } else { 0 }]; classes],
        }
    }
}

/// Follows photons, `items` of each group, from the item `first` on, and adds what they leave.
///
/// # Errors
/// [`crate::Error::Interrupted`].
pub(super) fn gather(
    (tracer, media, basis, orders): (&Tracer, &Media, &Basis, &Orders),
    space: &Space,
    (first, items): (u64, u64),
    seed: u64,
    into: &mut Gathered,
    progress: &dyn Progress,
) -> Result<()> {
    let channels = if tracer.tint().is_none() { 3 } else { 1 };
    let mut deposits = Deposits::new((tracer, media, basis, orders), space, channels);
    progress.begin("photons", items * GROUPS as u64);
    for group in 0..GROUPS {
        let (first, before) = (first + group as u64 * items, group as u64 * items);
        deposits.follow(tracer, first..first + items, seed, progress, |done| progress.at(before + done))?;
        progress.at(before + items);
        for (class, light) in into.light.iter_mut().enumerate() {
            light.par_iter_mut().enumerate().for_each(|(place, light)| light[group] += deposits.take(place, class, 0) as f32);
        }
        // Red and blue are those of all groups: one rank keeps them until the last, so that they count once.
        let keeps = group + 1 == GROUPS || progress.leads();
        deposits.sums.par_iter_mut().step_by(if keeps { channels } else { 1 }).for_each(|sum| *sum.get_mut() = 0);
    }
    for (class, colour) in into.colour.iter_mut().enumerate() {
        let both = |place: usize| [1, 2].map(|channel| deposits.take(place, class, channel) as f32);
        colour.par_iter_mut().enumerate().for_each(|(place, colour)| *colour = both(place));
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
    pub(super) fn of(share: f32) -> Self {
        match share {
            ..=0.0 => Held::Nothing,
            1.0.. => Held::All,
            _ => Held::Part,
        }
    }
}

/// Where photons leave their light.
pub(super) struct Deposits<'a> {
    space: &'a Space,
    basis: &'a Basis,
    orders: &'a Orders,
    media: &'a Media,
    /// Of each voxel: a byte, for the sake of the cache.
    held: Vec<Held>,
    /// By voxel, class and number of the basis: luminance, and where colours ride along red and blue.
    sums: Vec<AtomicU64>,
    channels: usize,
    /// What a photon of 1 W leaves in a point for 1/sr; and what 1 of a sum is worth.
    whole: f64,
    unit: f64,
    /// Between points, in voxels.
    spacing: f32,
}

impl<'a> Deposits<'a> {
    /// Where nothing is yet; of one channel, or of three.
    pub fn new((tracer, media, basis, orders): (&Tracer, &'a Media, &'a Basis, &'a Orders), space: &'a Space, channels: usize) -> Self {
        let step = f64::from(space.frame.step);
        let spacing = (SPACING / (space.usual * step)).max(1.0);
        let whole = WHOLE / (tracer.strongest() * basis.peak());
        let places = space.frame.voxels() * basis.len() * orders.count() * channels;
        let sums = (0..places).into_par_iter().map(|_| AtomicU64::new(0)).collect();
        let held = space.fill.iter().map(|fill| Held::of(fill.share)).collect();
        let unit = spacing / (whole * step.powi(2));
        Deposits { space, basis, orders, media, held, sums, channels, whole, unit, spacing: spacing as f32 }
    }

    /// Follows photons.
    ///
    /// # Errors
    /// [`crate::Error::Interrupted`].
    pub fn follow(&self, tracer: &Tracer, items: Range<u64>, seed: u64, progress: &dyn Progress, told: impl Fn(u64) + Sync) -> Result<()> {
        tracer.follow(items, seed, (self, &self.sums), progress, told)
    }

    /// What a place, the number of a voxel's basis, got of a class.
    pub fn take(&self, place: usize, class: usize, channel: usize) -> f64 {
        let (numbers, classes) = (self.basis.len(), self.orders.count());
        let sum = ((place / numbers * classes + class) * numbers + place % numbers) * self.channels + channel;
        self.sums[sum].load(Ordering::Relaxed) as i64 as f64 * self.unit
    }
}

impl Witness for Deposits<'_> {
    const KEEPS: bool = false;
    const OFF_SURFACE: u32 = OFF_SURFACE;

    #[inline]
    fn similar(&self, events: u64) -> Option<&SimilarMedia> {
        self.orders.met(events)
    }

    #[inline]
    fn flight(&self, ray: &Ray, reach: f32, power: f64, colour: Colour, events: u64, rng: &mut Rng) {
        if events == 0 {
            return;
        }
        let (class, classes, last) = (self.orders.class(events + 1), self.orders.count(), self.orders.last(events + 1));
        let wider = last.0 == Through::Similar;
        let (numbers, everywhere) = (self.basis.len(), self.basis.of_direction(ray.direction));
        let spacing = self.spacing * if wider { WIDER } else { 1.0 };
        let share = (power * self.whole) as f32 * if wider { WIDER } else { 1.0 };
        self.space.frame.along(ray, reach, (spacing, rng.uniform_f32()), |p, voxel| {
            match self.held[voxel] {
                Held::All => {}
                Held::Part if self.media.extinction(p) > 0.0 => {}
                _ => return,
            }
            let first = (voxel * classes + class) * numbers;
            let each = |visit: &mut dyn FnMut(usize, f32)| match &everywhere {
                Some(values) => values.iter().take(numbers).enumerate().for_each(|(number, &value)| visit(number, value)),
                None => self.basis.each(p, ray.direction, last, visit),
            };
            // Below zero as the two's complement: sums come out right.
            let add = |place: usize, light: f32| self.sums[place].fetch_add(light as i64 as u64, Ordering::Relaxed);
            if self.channels == 1 {
                each(&mut |number, value| {
                    add(first + number, share * value);
                });
                return;
            }
            let rgb = colour.at(ray, (p - ray.origin).dot(ray.direction));
            let channels = [luminance(rgb.as_dvec3().to_array()) as f32, rgb.x, rgb.z].map(|channel| channel * share);
            each(&mut |number, value| {
                channels.iter().enumerate().for_each(|(i, channel)| {
                    add((first + number) * 3 + i, channel * value);
                });
            });
        });
    }

    #[inline]
    fn aside(&self, p: Vec3, before: Vec3, phase: Phase, rng: &mut Rng) -> Option<(Vec3, f64)> {
        self.basis.aside(p, before, phase, rng)
    }

    #[inline]
    fn off_surface(&self, p: Vec3, rng: &mut Rng) -> Option<Vec3> {
        self.basis.off_surface(p, rng)
    }

    #[inline]
    fn off_surface_density(&self, p: Vec3, direction: Vec3) -> f64 {
        f64::from(OFF_SURFACE) * self.basis.off_surface_density(p, direction)
    }

    #[inline]
    fn share(&self, p: Vec3, before: Vec3, direction: Vec3, phase: Phase) -> f64 {
        self.basis.share(p, before, direction, phase)
    }
}
