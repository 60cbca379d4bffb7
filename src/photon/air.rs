//! Photons that air sends to the regions: sunlight, and the sky's, that has scattered in air and not in a region before.
//!
//! Such light enters the regions' bounding sphere from outside, or scatters within it for the last time. Photons of the first kind start
//! where a line enters the sphere, with the light that a path followed backward from there finds; those of the second kind where
//! they scatter. From then on they are photons as any other; one that collides with air before it has met a region ends there, because
//! the paths that are followed backward stand for what it would become.

use super::emit::Start;
use super::trace::Tracer;
use crate::geom::{Ray, basis};
use crate::media::air::Layer;
use crate::media::{Flight, Scratch};
use crate::rng::{Rng, Stage};
use crate::sampling::{around, cosine_hemisphere, uniform_disc};
use crate::scene::phase::{henyey_greenstein, one_minus_cos, sample_henyey_greenstein};
use glam::Vec3;
use std::f64::consts::{FRAC_1_PI, PI, TAU};

/// How many photons are looked at to learn their power.
const PILOT: u32 = 4096;
/// The mean cosine of the half of directions that lie about the sun's, where droplets send most.
const AUREOLE: f64 = 0.7;
/// Roulette begins below this throughput.
const DIM: f64 = 0.25;

/// The light of air, compiled.
#[derive(Debug, Clone, Copy)]
pub(super) struct AirLight {
    /// The regions' bounding sphere, around the origin, m.
    radius: f32,
    /// The share of photons that scatter within it for the last time.
    inside: f64,
    /// The mean power of a photon, W.
    pub(super) power: f64,
}

impl AirLight {
    /// The light of the tracer's air; `None` where regions have no end, or there is no light.
    pub fn of(tracer: &Tracer) -> Option<Self> {
        let radius = tracer.emitter.aim()?.radius;
        let across = tracer.air.optical_depth(&Ray { origin: Vec3::X * -radius, direction: Vec3::X }, 2.0 * radius);
        let around = tracer.air.optical_depth(&Ray { origin: Vec3::ZERO, direction: Vec3::Z }, f32::INFINITY).min(1.0);
        let inside = (across / (across + around)).clamp(0.1, 0.9);
        let mut light = AirLight { radius, inside, power: 0.0 };
        let (mut rng, mut scratch) = (Rng::new(0, Stage::Sunlight, 1 << 32), Scratch::default());
        light.power = (0..PILOT).map(|_| light.emit(tracer, &mut rng, &mut scratch).power).sum::<f64>() / f64::from(PILOT);
        (light.power > 0.0).then_some(light)
    }

    /// Starts one photon.
    pub fn emit(&self, tracer: &Tracer, rng: &mut Rng, scratch: &mut Scratch) -> Start {
        let axis = tracer.emitter.axis;
        let direction = if rng.uniform() < 0.5 {
            let z = 1.0 - 2.0 * rng.uniform();
            around(Vec3::Z, z as f32, (1.0 - z * z).max(0.0).sqrt() as f32, rng.uniform_f32())
        } else {
            let (cos, sin) = sample_henyey_greenstein(AUREOLE, rng.uniform());
            around(axis, cos as f32, sin as f32, rng.uniform_f32())
        };
        let pdf = 0.5 / (4.0 * PI) + 0.5 * henyey_greenstein(AUREOLE, one_minus_cos(axis, direction));
        let (u, v) = basis(direction);
        let (radius, (sin, cos)) = (f64::from(self.radius), (TAU * rng.uniform()).sin_cos());
        let rho = radius * rng.uniform().sqrt();
        let half = (radius * radius - rho * rho).max(0.0).sqrt();
        let entrance = u * (rho * cos) as f32 + v * (rho * sin) as f32 - direction * half as f32;
        let weight = PI * radius * radius / pdf;
        let back = Ray { origin: entrance, direction: -direction };
        let (origin, power) = if rng.uniform() < self.inside {
            let chord = 2.0 * half;
            let origin = entrance + direction * (rng.uniform() * chord) as f32;
            let there = Ray { origin, ..back };
            (origin, tracer.sent(there, rng, scratch) * chord / self.inside)
        } else {
            (entrance, tracer.arriving(back, 1.0, false, rng, scratch) / (1.0 - self.inside))
        };
        Start { ray: Ray { origin, direction }, power: power * weight, counted: false, scattered: true, from_air: true }
    }

    /// Whether a point is within the regions' bounding sphere.
    pub fn holds(&self, p: Vec3) -> bool {
        p.length() <= self.radius
    }
}

impl Tracer {
    /// What air at a ray's origin scatters back along the ray per metre of it, W m^-3 sr^-1; an unbiased estimate.
    fn sent(&self, ray: Ray, rng: &mut Rng, scratch: &mut Scratch) -> f64 {
        let whole: f64 = self.air.layers().iter().map(|layer| layer.extinction(ray.origin)).sum();
        let mut left = rng.uniform() * whole;
        let picked = self.air.layers().iter().find(|layer| {
            left -= layer.extinction(ray.origin);
            left < 0.0
        });
        let Some(layer) = picked else { return 0.0 };
        let albedo = f64::from(layer.albedo.x);
        let (once, onward) = self.scattered(ray, layer, rng, scratch);
        whole * albedo * (once + self.arriving(onward, 1.0, true, rng, scratch))
    }

    /// Sunlight that air of albedo 1 at the ray's origin scatters back along it, and the ray on which other light would come.
    fn scattered(&self, ray: Ray, layer: &Layer, rng: &mut Rng, scratch: &mut Scratch) -> (f64, Ray) {
        let (toward, light) = self.sun_at(ray.origin, rng, scratch);
        let once = light * layer.scattering.value(one_minus_cos(ray.direction, toward));
        let (cos, sin) = layer.scattering.sample(rng.uniform());
        (once, Ray { direction: around(ray.direction, cos as f32, sin as f32, rng.uniform_f32()), ..ray })
    }

    /// A direction to the sun's disc, and the irradiance that arrives from it.
    fn sun_at(&self, p: Vec3, rng: &mut Rng, scratch: &mut Scratch) -> (Vec3, f64) {
        let (axis, sin_alpha) = (self.emitter.axis, self.emitter.sin_alpha);
        let light = if sin_alpha > 0.0 { uniform_disc(axis, sin_alpha, rng.uniform_f32(), rng.uniform_f32()) } else { axis };
        let ray = Ray { origin: p, direction: -light };
        let irradiance = self.emitter.irradiance / f64::from(light.dot(axis));
        if irradiance <= 0.0 || (!self.surfaces.is_empty() && self.surfaces.nearest(&ray, f32::INFINITY).is_some()) {
            return (-light, 0.0);
        }
        let depth = self.media.optical_depth(&ray, f32::INFINITY, scratch) + self.air.optical_depth(&ray, f32::INFINITY);
        (-light, irradiance * (-depth).exp())
    }

    /// The radiance that arrives at a ray's origin from along it without having met a region, times `throughput`; that has scattered in
    /// air too, unless it `counts` as it is. An unbiased estimate.
    fn arriving(&self, mut ray: Ray, mut throughput: f64, mut counts: bool, rng: &mut Rng, scratch: &mut Scratch) -> f64 {
        let mut light = 0.0;
        loop {
            let flight = self.media.fly(&ray, f32::INFINITY, rng.optical_depth(), 0.0, rng, scratch);
            let reach = if let Flight::Collision { distance, .. } = flight { distance } else { f32::INFINITY };
            let hit = if self.surfaces.is_empty() { None } else { self.surfaces.nearest(&ray, reach) };
            if let Some((distance, layer)) = self.air.fly(&ray, hit.map_or(reach, |h| h.t), rng) {
                counts = true;
                throughput *= f64::from(layer.albedo.x);
                let (once, onward) = self.scattered(Ray { origin: ray.at(distance), ..ray }, layer, rng, scratch);
                light += throughput * once;
                ray = onward;
            } else if let Some(hit) = hit {
                throughput *= self.albedos[hit.owner as usize];
                let p = hit.off(&ray);
                if counts && throughput > 0.0 {
                    let (toward, irradiance) = self.sun_at(p, rng, scratch);
                    light += throughput * irradiance * f64::from(toward.dot(hit.normal).max(0.0)) * FRAC_1_PI;
                }
                ray = Ray { origin: p, direction: cosine_hemisphere(hit.normal, rng.uniform_f32(), rng.uniform_f32()) };
            } else {
                let sky = if reach.is_finite() || !counts { 0.0 } else { self.sky_radiance };
                return light + throughput * sky;
            }
            if throughput < DIM {
                if rng.uniform() * DIM >= throughput {
                    return light;
                }
                throughput = DIM;
            }
        }
    }
}
