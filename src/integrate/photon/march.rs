//! Along a ray through media: sunlight scattered once, and stored photons for what scattered more often (thesis eqs 24, 29, 31).
//!
//! The step has no bias. The integral of transmittance times extinction times what scatters is cut into slices of equal chance of
//! a collision, and one point drawn in each: marching by equal steps of optical depth that grow longer behind, jittered. Eqs 28 to
//! 31 are this in the limit of short steps; the thesis names no length.

use super::gather::{Gather, Groups};
use super::{Channel, Light, Room};
use crate::geom::Ray;
use crate::media::Flight;
use crate::photon::{GROUPS, Model};
use crate::rng::Rng;
use glam::Vec3;

/// What a stretch of a ray brings to its start.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Stretch {
    /// Sunlight scattered once.
    pub direct: Vec3,
    /// Stored photons' light, by groups, before it is tinted.
    pub groups: Groups,
    /// What of these would differ, had photons been looked for twice as wide; where that is asked.
    pub wider: Groups,
    /// The transmittance.
    pub clear: f64,
    /// The mean distance of a collision, m, times its chance.
    pub depth: f64,
    pub gathered: u64,
}

impl Stretch {
    const NOTHING: Stretch =
        Stretch { direct: Vec3::ZERO, groups: [0.0; GROUPS], wider: [0.0; GROUPS], clear: 1.0, depth: 0.0, gathered: 0 };
}

impl Channel {
    /// The first `reach` metres of a ray, by slices of the chance of a collision of at most `slice`.
    pub(super) fn march(&self, ray: &Ray, reach: f32, slice: f64, rng: &mut Rng, room: &mut Room) -> Stretch {
        match self.model {
            Model::Physical => self.march_together(ray, reach, slice, rng, room),
            Model::Hura2006 => self.march_in_turn(ray, reach, slice, rng, room),
        }
    }

    /// All regions at once: where they overlap, extinction adds.
    fn march_together(&self, ray: &Ray, reach: f32, slice: f64, rng: &mut Rng, room: &mut Room) -> Stretch {
        let band = &self.tracer.bands[0];
        let depth = band.media.optical_depth(ray, reach, &mut room.scratch);
        let chance = -(-depth).exp_m1();
        let mut out = Stretch { clear: (-depth).exp(), ..Stretch::NOTHING };
        if chance <= 0.0 {
            return out;
        }
        let slices = (chance / slice).ceil().max(1.0) as u32;
        for i in 0..slices {
            let flight = if band.media.has_grids() {
                // Null collisions cannot be told where to end: each flight is on its own.
                let tau = rng.optical_depth();
                band.media.fly(ray, reach, tau, 0.0, rng, &mut room.scratch)
            } else {
                let xi = (f64::from(i) + rng.uniform()) / f64::from(slices);
                band.media.fly_regions(ray, reach, -(-xi * chance).ln_1p(), 0.0, || rng.uniform(), &mut room.scratch)
            };
            if let Flight::Collision { distance, region, .. } = flight {
                let weight = if band.media.has_grids() { 1.0 } else { chance } / f64::from(slices);
                self.collision(ray, distance, region, weight, i as usize, &mut out, rng, room);
            }
        }
        if let Light::Beams(beams) = &self.light {
            beams.along(ray, reach, &band.media, (&mut out.groups, &mut out.wider), rng, room);
        }
        out
    }

    /// Case 1 to the letter: each region from where the ray enters it to where it leaves it, one behind the other, each with all
    /// photons of the map.
    fn march_in_turn(&self, ray: &Ray, reach: f32, slice: f64, rng: &mut Rng, room: &mut Room) -> Stretch {
        let band = &self.tracer.bands[0];
        let mut crossings = std::mem::take(&mut room.crossings);
        band.media.crossings(ray, reach, &mut room.scratch, &mut crossings);
        let mut out = Stretch::NOTHING;
        for &(enter, exit, region) in &crossings {
            let sigma_t = band.media.optics(region).sigma_t;
            let depth = sigma_t * (f64::from(exit) - f64::from(enter));
            let chance = -(-depth).exp_m1();
            // Less light comes from behind, and fewer points do.
            let slices = (out.clear * chance / slice).ceil().max(1.0) as u32;
            for i in 0..slices {
                let xi = (f64::from(i) + rng.uniform()) / f64::from(slices);
                let distance = f64::from(enter) - (-xi * chance).ln_1p() / sigma_t;
                let weight = out.clear * chance / f64::from(slices);
                let number = out.gathered as usize;
                self.collision(ray, distance as f32, region, weight, number, &mut out, rng, room);
            }
            out.clear *= (-depth).exp();
        }
        room.crossings = crossings;
        out
    }

    /// What scatters toward the ray's start at one point of it, in one region.
    #[allow(clippy::too_many_arguments)]
    fn collision(
        &self,
        ray: &Ray,
        distance: f32,
        region: u32,
        weight: f64,
        slice: usize,
        out: &mut Stretch,
        rng: &mut Rng,
        room: &mut Room,
    ) {
        let (tracer, band) = (&self.tracer, &self.tracer.bands[0]);
        let (albedo, g) = band.optics[region as usize];
        let here = Ray { origin: ray.at(distance), direction: ray.direction };
        let (sunlight, _) = tracer.sun.in_medium(band, &tracer.surfaces, &here, (g, 1.0), rng, &mut room.scratch);
        let lamplight = tracer.lamps_in_medium(band, &here, g, rng, &mut room.scratch);
        out.direct += albedo * (sunlight + lamplight) * weight as f32;
        out.depth += weight * f64::from(distance);
        out.gathered += 1;
        if let Light::Nearest(gather) = &self.light {
            let optics = band.media.optics(region);
            let wider = room.wider;
            let mut look = |gather: &Gather, wide: bool| {
                let hood = room.neighbourhood(2 * self.number + usize::from(wide), slice);
                gather.scattered(here.origin, -ray.direction, g, optics.sigma_t, &band.media, hood)
            };
            let found = look(gather, false);
            // To the letter what is stored has the albedo in it, or should.
            let albedo = if self.model == Model::Physical { optics.albedo } else { 1.0 };
            for (sum, light) in out.groups.iter_mut().zip(found) {
                *sum += weight * albedo * light;
            }
            if let Some(wide) = gather.wide().filter(|_| wider) {
                for (sum, (wide, own)) in out.wider.iter_mut().zip(look(wide, true).into_iter().zip(found)) {
                    *sum += weight * albedo * (wide - own);
                }
            }
        }
    }
}
