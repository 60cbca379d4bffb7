//! Photons on their way, where they bounce and where they collide with air.

use super::{Batch, Fate, Tracer};
use crate::geom::Ray;
use crate::media::air::{Atmosphere, Layer, Spectrum};
use crate::media::{Flight, Media, Scratch};
use crate::photon::{Colour, Model, Witness};
use crate::rng::Rng;
use crate::sampling::{around, cosine_hemisphere};
use crate::trimesh::Hit;
use glam::Vec3;
use smallvec::SmallVec;
use std::f64::consts::PI;

/// A photon on its way: its path may branch where it bounces.
#[derive(Debug, Clone, Copy)]
pub(super) struct Branch {
    pub ray: Ray,
    pub power: f64,
    /// What of it counts in its next flight, where a witness has flights of its own.
    pub share: f64,
    /// What its power counts in each channel.
    pub tint: Vec3,
    pub spectrum: Spectrum,
    /// Whether its power is in the energy balance: it crossed the silhouette, or a surface sent it toward the regions.
    pub counted: bool,
    /// Whether a surface has reflected it, or it comes from the sky or from air: it is not the sun's any more.
    pub bounced: bool,
    /// Whether it has collided with a region.
    pub met: bool,
    /// Whether it is light of the air.
    pub from_air: bool,
}

impl Branch {
    /// Its colour along its next flight.
    pub(super) fn colour<'a>(&self, air: &'a Atmosphere) -> Colour<'a> {
        Colour { tint: self.tint, spectrum: self.spectrum, air }
    }

    /// How it goes on after a collision with air, if it does: before it has met a region, the light of the air stands for it.
    pub(super) fn in_air(&self, distance: f32, layer: &Layer, rng: &mut Rng) -> Option<Branch> {
        let kept = layer.albedo.max_element();
        if !self.met || rng.uniform_f32() >= kept {
            return None;
        }
        let (cos, sin) = layer.scattering.sample(rng.uniform());
        let direction = around(self.ray.direction, cos as f32, sin as f32, rng.uniform_f32());
        let tint = self.tint * layer.albedo / kept;
        Some(Branch { ray: Ray { origin: self.ray.at(distance), direction }, tint, share: 1.0, bounced: true, ..*self })
    }
}

impl Tracer {
    /// How far a flight along a ray goes, to a collision or to a surface.
    pub(super) fn reach(&self, media: &Media, ray: &Ray, hint: f64, spectrum: &Spectrum, rng: &mut Rng, scratch: &mut Scratch) -> f32 {
        let flight = media.fly(ray, f32::INFINITY, rng.optical_depth(), hint, rng, scratch);
        let reach = if let Flight::Collision { distance, .. } = flight { distance } else { f32::INFINITY };
        let reach = if self.surfaces.is_empty() { reach } else { self.surfaces.nearest(ray, reach).map_or(reach, |h| h.t) };
        if self.air.is_empty() { reach } else { self.air.fly(ray, reach, spectrum, rng).map_or(reach, |(distance, _)| distance) }
    }

    /// A Lambertian bounce (thesis eq. 26). What goes toward the regions is a branch of its own, sampled over the cone of
    /// their bounding sphere, so that light from far ground arrives by many weak photons and not by a few strong ones; what
    /// goes elsewhere is sampled over the hemisphere and dropped inside the cone. To the letter there is no such branch, as the
    /// duality counts photons and not their power. Returns how the latter goes on.
    pub(super) fn bounce<W: Witness>(
        &self,
        at: &Branch,
        hit: &Hit,
        (witness, scratch): (&W, &mut Scratch),
        rng: &mut Rng,
        batch: &mut Batch,
        left: &mut SmallVec<[Branch; 8]>,
    ) -> Option<Branch> {
        let albedo = self.albedos[hit.owner as usize];
        let tint = at.tint * self.surface_tint(hit.owner);
        let origin = hit.off(&at.ray);
        let aimed = albedo > 0.0 && self.model == Model::Physical;
        let cone = self.emitter.aim().filter(|_| aimed).and_then(|aim| aim.seen_from(origin));
        let cosine = |direction: Vec3| f64::from(direction.dot(hit.normal)).max(0.0);
        // The photon's own flights and the witness's share directions by the balance heuristic.
        let own = |direction: Vec3| cone.filter(|c| c.holds(direction)).map_or_else(|| cosine(direction) / PI, |c| 1.0 / c.solid_angle);
        let share = |direction: Vec3| match witness.off_surface_density(origin, direction) {
            0.0 => 1.0,
            other => own(direction) / (own(direction) + other),
        };
        for _ in 0..W::OFF_SURFACE {
            let Some(direction) = witness.off_surface(origin, rng) else { break };
            let part = albedo * cosine(direction) / PI / (own(direction) + witness.off_surface_density(origin, direction));
            if part > 0.0 {
                let (ray, next) = (Ray { origin, direction }, Branch { tint, ..*at });
                let reach = self.reach(&self.media, &ray, 0.0, &at.spectrum, rng, scratch);
                witness.flight(&ray, reach, at.power * part, next.colour(&self.air), 1, rng);
            }
        }
        if let Some(cone) = &cone {
            let direction = cone.sample(rng);
            let cos = cosine(direction);
            let power = at.power * albedo * cos * cone.solid_angle / PI;
            // Branches too weak to matter play roulette.
            let floor = 0.1 * self.emitter.base_power();
            let kept = if power >= floor {
                power
            } else if rng.uniform() * floor < power {
                floor
            } else {
                0.0
            };
            batch.shift(Fate::Roulette, at, -kept);
            if kept > 0.0 {
                if !at.counted {
                    batch.power += kept;
                }
                let share = share(direction);
                left.push(Branch { ray: Ray { origin, direction }, power: kept, share, tint, counted: true, bounced: true, ..*at });
            }
        }
        if rng.uniform() >= albedo {
            batch.end(Fate::AbsorbedSurface, at);
            return None;
        }
        let direction = cosine_hemisphere(hit.normal, rng.uniform_f32(), rng.uniform_f32());
        if cone.is_some_and(|cone| cone.holds(direction)) {
            batch.shift(Fate::Roulette, at, at.power);
            return None;
        }
        // Light that surfaces send to within the regions' bounding sphere has begun to count.
        let counted = at.counted || self.emitter.aim().is_some_and(|aim| aim.holds(origin));
        if counted && !at.counted {
            batch.power += at.power;
        }
        let share = share(direction);
        Some(Branch { ray: Ray { origin, direction }, share, tint, counted, bounced: true, ..*at })
    }
}
