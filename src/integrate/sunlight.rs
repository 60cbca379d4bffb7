//! Sunlight at the events of a path: the disc sampled, its way looked along, and the directions that lead to it.

use super::band::Band;
use crate::geom::Ray;
use crate::media::Scratch;
use crate::media::air::Layer;
use crate::rng::Rng;
use crate::sampling::{around, uniform_disc};
use crate::scene::Sun;
use crate::scene::phase::{henyey_greenstein, one_minus_cos, sample_henyey_greenstein};
use crate::trimesh::{Hit, TriMesh};
use glam::{DVec3, Vec3};
use std::f32::consts::FRAC_1_PI;

/// Phase functions with a mean cosine below this have no peak worth aiming at.
const PEAKED: f64 = 0.3;
/// How fast the chance of a look sunward grows with the share of sunlight that arrives; and the least chance.
const SUNWARD: f64 = 3.0;
const LEAST: f64 = 0.05;

/// The sun, compiled.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sunlight {
    /// In which its light travels, from the middle of the disc.
    direction: Vec3,
    sin_alpha: f32,
    pub(super) irradiance: Vec3,
}

/// A collision at which one more direction was drawn, toward the sun: the two strategies share what they find by the balance
/// heuristic (Veach 1997, 9.2).
#[derive(Debug, Clone, Copy)]
pub(super) struct Rivals {
    g: f64,
    /// How often a direction is drawn sunward.
    rate: f64,
}

impl Sunlight {
    pub(super) fn new(sun: &Sun, disc: bool) -> Self {
        Sunlight {
            direction: sun.direction.as_vec3().normalize(),
            sin_alpha: if disc { (sun.angular_diameter * 0.5).sin() as f32 } else { 0.0 },
            irradiance: DVec3::from_array(sun.irradiance).as_vec3(),
        }
    }

    /// The sunlight that a collision at the ray's origin, with albedo 1, scatters back along the ray, times `share`; and the
    /// part of sunlight that arrives there.
    #[inline]
    pub(super) fn in_medium(
        &self,
        band: &Band,
        surfaces: &TriMesh,
        ray: &Ray,
        (g, share): (f64, f32),
        rng: &mut Rng,
        scratch: &mut Scratch,
    ) -> (Vec3, f64) {
        let Some((toward, weight)) = self.toward(rng) else { return (Vec3::ZERO, 0.0) };
        let phase = henyey_greenstein(g, one_minus_cos(ray.direction, toward)) as f32 * weight * share;
        let isotropic = phase * (4.0 * std::f32::consts::PI);
        let clear = visible(band, surfaces, ray.origin, toward, isotropic, rng, scratch);
        (self.irradiance * clear * phase, clear.max_element().into())
    }

    /// The sunlight that air of albedo 1 at the ray's origin scatters back along the ray.
    pub(super) fn in_air(&self, band: &Band, surfaces: &TriMesh, ray: &Ray, layer: &Layer, rng: &mut Rng, scratch: &mut Scratch) -> Vec3 {
        let Some((toward, weight)) = self.toward(rng) else { return Vec3::ZERO };
        let phase = layer.scattering.value(one_minus_cos(ray.direction, toward)) as f32 * weight;
        // What counts as usual is even scattering.
        self.irradiance * visible(band, surfaces, ray.origin, toward, 1.0, rng, scratch) * phase
    }

    /// The sunlight that a white Lambertian surface sends out from `p` (radiance); whether regions may shade it.
    pub(super) fn on_surface(
        &self,
        band: &Band,
        surfaces: &TriMesh,
        (p, shaded): (Vec3, bool),
        hit: &Hit,
        rng: &mut Rng,
        scratch: &mut Scratch,
    ) -> Vec3 {
        let Some((toward, weight)) = self.toward(rng) else { return Vec3::ZERO };
        let cos = toward.dot(hit.normal);
        if cos <= 0.0 {
            return Vec3::ZERO;
        }
        let clear =
            if shaded { visible(band, surfaces, p, toward, cos, rng, scratch) } else { past(band, surfaces, p, toward, f32::INFINITY) };
        self.irradiance * clear * (cos * FRAC_1_PI * weight)
    }

    /// A direction to a point of the sun's disc, and the irradiance across it over that on the plane across the sun's axis.
    #[inline]
    pub(super) fn toward(&self, rng: &mut Rng) -> Option<(Vec3, f32)> {
        if self.irradiance == Vec3::ZERO {
            return None;
        }
        if self.sin_alpha == 0.0 {
            return Some((-self.direction, 1.0));
        }
        let light = uniform_disc(self.direction, self.sin_alpha, rng.uniform_f32(), rng.uniform_f32());
        Some((-light, 1.0 / light.dot(self.direction)))
    }

    /// Whether to look sunward from a collision that the share `clear` of sunlight reaches, and how often.
    #[inline]
    pub(super) fn rivals(&self, g: f64, clear: f64) -> Option<Rivals> {
        let worth = g >= PEAKED && self.irradiance != Vec3::ZERO;
        worth.then(|| Rivals { g, rate: (SUNWARD * clear + LEAST).clamp(LEAST, 1.0) })
    }

    /// A direction from which a collision scatters much sunlight back, if one is drawn this time.
    #[inline]
    pub(super) fn sunward(&self, rivals: &Rivals, rng: &mut Rng) -> Option<Vec3> {
        (rng.uniform() < rivals.rate).then(|| {
            let (cos, sin) = sample_henyey_greenstein(rivals.g, rng.uniform());
            around(-self.direction, cos as f32, sin as f32, rng.uniform_f32())
        })
    }

    /// The share of what is found along `direction` that belongs to the phase function's own sampling, of a path that came along
    /// `before`; times its density over that of sunward sampling it is also the weight of a sunward direction.
    #[inline]
    pub(super) fn share(&self, rivals: &Rivals, before: Vec3, direction: Vec3) -> f32 {
        let own = henyey_greenstein(rivals.g, one_minus_cos(before, direction));
        let sunward = henyey_greenstein(rivals.g, one_minus_cos(-self.direction, direction));
        (own / (own + rivals.rate * sunward)) as f32
    }
}

/// The share of light, by channel, that arrives at `p` from direction `toward`, far away; an unbiased estimate. `weight` as in
/// [`Media::sunlight`](crate::media::Media::sunlight).
pub(super) fn visible(band: &Band, surfaces: &TriMesh, p: Vec3, toward: Vec3, weight: f32, rng: &mut Rng, scratch: &mut Scratch) -> Vec3 {
    let clear = past(band, surfaces, p, toward, f32::INFINITY);
    if clear == Vec3::ZERO { clear } else { clear * band.media.sunlight(p, toward, weight, rng, scratch) as f32 }
}

/// The share that surfaces and air let pass over a distance, m, by channel.
pub(super) fn past(band: &Band, surfaces: &TriMesh, p: Vec3, toward: Vec3, distance: f32) -> Vec3 {
    let ray = Ray { origin: p, direction: toward };
    let hidden = !surfaces.is_empty() && surfaces.nearest(&ray, distance).is_some();
    if hidden { Vec3::ZERO } else { band.air.transmittance(&ray, distance) }
}
