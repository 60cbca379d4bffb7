//! The beam radiance estimate (Jarosz, Zwicker and Jensen 2008): every stored photon is a ball, and one walk along the ray finds all
//! that it pierces.
//!
//! Balls rather than discs across the ray: a ball's photon is spread evenly over the extinction that the ball holds, so that its
//! power is kept wherever regions end, and whatever way a ray crosses their rim. Of a disc the share outside depends on the ray; to
//! leave it out, or to take the ball's for it, is a bias that falls as the radius and not as its square.

use super::Room;
use super::gather::{Groups, thinned};
use crate::bvh::{Box3, Bvh};
use crate::error::Result;
use crate::geom::Ray;
use crate::integrate::lobe::Lobe;
use crate::media::Media;
use crate::photon::{Nearest, Neighbourhood, Photon, bounds, unpack_direction};
use crate::progress::Progress;
use crate::rng::Rng;
use glam::Vec3;
use rayon::prelude::*;

/// Photons that follow one another along the curve and share a radius and a place in the hierarchy.
const BLOCK: usize = 16;
/// Photons of the thinned map that decide a radius.
const PILOTS: u64 = 64;
/// Where less than this share of light passes, the ray plays roulette about going on.
const FAINT: f64 = 0.02;

/// Stored photons as balls.
#[derive(Debug)]
pub(super) struct Beams {
    /// In blocks of [`BLOCK`]; their powers over the optical mass of their balls, in W m^-2.
    photons: Vec<Photon>,
    /// Of each block, m.
    radii: Vec<f32>,
    bvh: Bvh,
    estimate: u64,
    /// The same of every eighth photon: balls twice as wide.
    wide: Option<Box<Beams>>,
}

/// A stretch of a ray in which nothing changes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Even {
    from: f32,
    to: f32,
    /// Optical depth before it.
    before: f64,
    sigma_t: f64,
    sigma_s: f64,
    lobe: Lobe,
}

impl Beams {
    /// Over photons in the order of [`crate::photon::PhotonMap::along_curve`]; a ball's radius is the distance within which
    /// about `estimate` of them lie.
    pub(super) fn new(photons: Vec<Photon>, estimate: u64, media: &Media, progress: &dyn Progress) -> Result<Self> {
        let wide = Beams::of(thinned(&photons), estimate, media, progress)?;
        Ok(Beams { wide: Some(Box::new(wide)), ..Beams::of(photons, estimate, media, progress)? })
    }

    fn of(mut photons: Vec<Photon>, estimate: u64, media: &Media, progress: &dyn Progress) -> Result<Self> {
        let estimate = estimate.clamp(1, (photons.len() as u64).max(1));
        let thin = estimate.div_ceil(PILOTS).max(1);
        let pilots = Nearest::new(photons.iter().step_by(thin as usize).copied().collect(), estimate.div_ceil(thin), None);
        progress.check()?;
        let blocks = photons.len().div_ceil(BLOCK);
        progress.begin("beams", blocks as u64);
        // Fixed groups of blocks, so that no thread's past decides anything.
        let radii: Vec<f32> = photons
            .par_chunks_mut(BLOCK * 256)
            .flat_map_iter(|group| {
                let mut hood = Neighbourhood::default();
                group.chunks_mut(BLOCK).map(|block| radius(block, &pilots, media, &mut hood)).collect::<Vec<f32>>()
            })
            .collect();
        progress.check()?;
        let around = |(block, &radius): (&[Photon], &f32)| {
            let Box3 { min, max } = bounds(block);
            Some(Box3 { min: min - radius, max: max + radius })
        };
        let bvh = Bvh::new(&photons.chunks(BLOCK).zip(&radii).map(around).collect::<Vec<_>>(), 2);
        Ok(Beams { photons, radii, bvh, estimate, wide: None })
    }

    /// Photons in an estimate.
    pub(super) fn estimate(&self) -> u64 {
        self.estimate
    }

    /// Adds what the photons around the first `reach` metres of a ray scatter toward its start, by groups of paths; and what of that
    /// would differ by balls twice as wide, where the room asks for it.
    pub(super) fn along(
        &self,
        ray: &Ray,
        reach: f32,
        media: &Media,
        (groups, wider): (&mut Groups, &mut Groups),
        rng: &mut Rng,
        room: &mut Room,
    ) {
        evens(ray, reach, media, rng, room);
        let evens = &room.stretches;
        let Some(last) = evens.last() else { return };
        // Beyond this the roulette is lost.
        let deepest = -(FAINT * (1.0 - rng.uniform())).ln();
        let end = match evens.iter().find(|e| e.before + e.sigma_t * f64::from(e.to - e.from) > deepest) {
            Some(e) => (f64::from(e.from) + (deepest - e.before) / e.sigma_t) as f32,
            None => last.to,
        };
        let mut found = Groups::default();
        self.pierced(ray, end, evens, &mut found);
        groups.iter_mut().zip(found).for_each(|(sum, own)| *sum += own);
        if let Some(wide) = self.wide.as_ref().filter(|_| room.wider) {
            wide.pierced(ray, end, evens, wider);
            wider.iter_mut().zip(found).for_each(|(sum, own)| *sum -= own);
        }
    }

    /// Adds what the balls bring that a ray pierces on its way through `evens` to its `end`.
    fn pierced(&self, ray: &Ray, end: f32, evens: &[Even], groups: &mut Groups) {
        let Some(first) = evens.first() else { return };
        self.bvh.traverse(ray.origin, ray.direction, end, |block, _| {
            let radius2 = self.radii[block as usize] * self.radii[block as usize];
            let from = block as usize * BLOCK;
            for photon in &self.photons[from..(from + BLOCK).min(self.photons.len())] {
                let away = Vec3::from_array(photon.position) - ray.origin;
                let t = away.dot(ray.direction);
                let half2 = radius2 - (away - ray.direction * t).length_squared();
                if half2 <= 0.0 {
                    continue;
                }
                let half = half2.sqrt();
                let (enter, exit) = ((t - half).max(first.from), (t + half).min(end));
                for even in &evens[evens.partition_point(|e| e.to <= enter)..] {
                    let (from, to) = (even.from.max(enter), even.to.min(exit));
                    if from >= to {
                        break;
                    }
                    let middle = 0.5 * (from + to) - even.from;
                    let clear = (-(even.before + even.sigma_t * f64::from(middle))).exp().max(FAINT);
                    let value = photon.power * (to - from) * even.lobe.value(unpack_direction(photon.direction));
                    groups[photon.group()] += clear * even.sigma_s * f64::from(value);
                }
            }
        });
    }
}

#[cfg(test)]
impl Beams {
    /// Each photon with the radius of its ball.
    pub(super) fn each(&self) -> impl Iterator<Item = (&Photon, f32)> {
        self.photons.iter().enumerate().map(|(i, p)| (p, self.radii[i / BLOCK]))
    }
}

/// The radius of a block's balls; its photons' powers are divided by the optical mass within it, which says what of a ball lies
/// outside of all regions, or where they overlap.
fn radius(block: &mut [Photon], pilots: &Nearest, media: &Media, hood: &mut Neighbourhood) -> f32 {
    let middle = block.iter().map(|p| Vec3::from_array(p.position)).sum::<Vec3>() / block.len() as f32;
    let radius = pilots.find(middle, hood).unwrap_or(0.0);
    for photon in block {
        let mass = media.mass_within(Vec3::from_array(photon.position), radius);
        photon.power = if mass > 0.0 { (f64::from(photon.power) / mass) as f32 } else { 0.0 };
    }
    radius
}

/// Fills `room.stretches` with those of the ray's first `reach` metres that lie in regions. Where several overlap, one of their
/// phase functions is drawn in proportion to what they scatter.
fn evens(ray: &Ray, reach: f32, media: &Media, rng: &mut Rng, room: &mut Room) {
    media.crossings(ray, reach, &mut room.scratch, &mut room.crossings);
    let crossings = &room.crossings;
    let mut ends: Vec<f32> = crossings.iter().flat_map(|c| [c.0, c.1]).collect();
    ends.sort_unstable_by(f32::total_cmp);
    ends.dedup();
    room.stretches.clear();
    let mut before = 0.0;
    for pair in ends.windows(2) {
        let (from, to) = (pair[0], pair[1]);
        let (mut sigma_t, mut sigma_s, mut g) = (0.0, 0.0, 0.0);
        for &(enter, exit, region) in crossings {
            if enter <= from && exit >= to {
                let optics = media.optics(region);
                let scattered = optics.sigma_t * optics.albedo;
                (sigma_t, sigma_s) = (sigma_t + optics.sigma_t, sigma_s + scattered);
                if optics.g != g && rng.uniform() * sigma_s < scattered {
                    g = optics.g;
                }
            }
        }
        if sigma_t > 0.0 {
            room.stretches.push(Even { from, to, before, sigma_t, sigma_s, lobe: Lobe::new(g, -ray.direction) });
            before += sigma_t * (f64::from(to) - f64::from(from));
        }
    }
}
