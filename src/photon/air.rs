//! Photons that air sends to the regions: sunlight, and the sky's, that has scattered in air and not in a region before.
//!
//! Such light enters the regions' bounding sphere from outside, or scatters within it for the last time. Photons of the first kind start
//! where a line enters the sphere, with the light that a path followed backward from there finds; those of the second kind where
//! they scatter. From then on they are photons as any other; one that collides with air before it has met a region ends there, because
//! the paths that are followed backward stand for what it would become.

use super::emit::Start;
use super::eye::{Eye, across};
use super::trace::Tracer;
use crate::geom::{Ray, basis};
use crate::media::air::Layer;
use crate::media::air::Spectrum;
use crate::media::{Flight, Scratch};
use crate::rng::{Rng, Stage};
use crate::sampling::{around, cosine_hemisphere, uniform_disc, uniform_sphere};
use crate::scene::medium::luminance;
use crate::scene::phase::{henyey_greenstein, one_minus_cos, sample_henyey_greenstein};
use glam::{DVec3, Vec3};
use std::f64::consts::{FRAC_1_PI, PI, TAU};

/// How many photons are looked at to learn their power.
const PILOT: u32 = 1024;
/// Of so many candidates one starts, by their powers: most lines find no light, and some much.
const CANDIDATES: u32 = 8;
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
        let across = tracer.air.optical_depth(&Ray { origin: Vec3::X * -radius, direction: Vec3::X }, 2.0 * radius).max_element();
        let around = tracer.air.optical_depth(&Ray { origin: Vec3::ZERO, direction: Vec3::Z }, f32::INFINITY).max_element().min(1.0);
        let inside = (across / (across + around)).clamp(0.1, 0.9);
        let mut light = AirLight { radius, inside, power: 0.0 };
        let (mut rng, mut scratch) = (Rng::new(0, Stage::Sunlight, 1 << 32), Scratch::default());
        light.power = (0..PILOT).map(|_| light.emit(tracer, &mut rng, &mut scratch).power).sum::<f64>() / f64::from(PILOT);
        (light.power > 0.0).then_some(light)
    }

    /// Starts one photon, with the mean power of its rivals (resampled importance sampling; Talbot et al. 2005).
    pub fn emit(&self, tracer: &Tracer, rng: &mut Rng, scratch: &mut Scratch) -> Start {
        let mut chosen = self.candidate(tracer, rng, scratch);
        let mut whole = chosen.power;
        for _ in 1..CANDIDATES {
            let next = self.candidate(tracer, rng, scratch);
            whole += next.power;
            if rng.uniform() * whole < next.power {
                chosen = next;
            }
        }
        Start { power: whole / f64::from(CANDIDATES), ..chosen }
    }

    fn candidate(&self, tracer: &Tracer, rng: &mut Rng, scratch: &mut Scratch) -> Start {
        let axis = tracer.emitter.axis;
        let radius = f64::from(self.radius);
        let others = |rng: &mut Rng| {
            let direction = if rng.uniform() < 0.5 {
                uniform_sphere(rng)
            } else {
                let (cos, sin) = sample_henyey_greenstein(AUREOLE, rng.uniform());
                around(axis, cos as f32, sin as f32, rng.uniform_f32())
            };
            let ((u, v), (sin, cos), rho) = (basis(direction), (TAU * rng.uniform()).sin_cos(), radius * rng.uniform().sqrt());
            (direction, u * (rho * cos) as f32 + v * (rho * sin) as f32)
        };
        let density = |direction: Vec3, _| {
            let of_directions = 0.5 / (4.0 * PI) + 0.5 * henyey_greenstein(AUREOLE, one_minus_cos(axis, direction));
            of_directions / (PI * radius * radius)
        };
        let (direction, point, density) = Eye::mixed(tracer.eye.as_ref(), rng, others, density);
        let p = across(direction, point);
        let half = (radius * radius - f64::from(p.length_squared())).max(0.0).sqrt();
        let entrance = p - direction * half as f32;
        let weight = 1.0 / density;
        let back = Ray { origin: entrance, direction: -direction };
        let (origin, light) = if rng.uniform() < self.inside {
            let chord = 2.0 * half;
            let origin = entrance + direction * (rng.uniform() * chord) as f32;
            let there = Ray { origin, ..back };
            (origin, tracer.sent(there, rng, scratch) * (chord / self.inside))
        } else {
            (entrance, tracer.arriving(back, false, rng, scratch) / (1.0 - self.inside))
        };
        let grey = luminance(light.to_array());
        let tint = if grey > 0.0 { (light / grey).as_vec3() } else { Vec3::ONE };
        Start { ray: Ray { origin, direction }, power: grey * weight, tint, counted: false, scattered: true, from_air: true }
    }

    /// Whether a point is within the regions' bounding sphere.
    pub fn holds(&self, p: Vec3) -> bool {
        p.length() <= self.radius
    }
}

impl Tracer {
    /// What air at a ray's origin scatters back along the ray per metre of it, W m^-3 sr^-1, by channel; an unbiased estimate.
    fn sent(&self, ray: Ray, rng: &mut Rng, scratch: &mut Scratch) -> DVec3 {
        let grey = |layer: &Layer| layer.extinction(ray.origin).element_sum();
        let whole: f64 = self.air.layers().iter().map(grey).sum();
        let mut left = rng.uniform() * whole;
        let picked = self.air.layers().iter().find(|layer| {
            left -= grey(layer);
            left < 0.0
        });
        let Some(layer) = picked else { return DVec3::ZERO };
        let sigma_s = layer.extinction(ray.origin) * layer.albedo.as_dvec3() * (whole / grey(layer));
        let (once, onward) = self.scattered(ray, layer, rng, scratch);
        sigma_s * (once + self.arriving(onward, true, rng, scratch))
    }

    /// Sunlight, and light of lamps, that air of albedo 1 at the ray's origin scatters back along it, and the ray on which other light would come.
    fn scattered(&self, ray: Ray, layer: &Layer, rng: &mut Rng, scratch: &mut Scratch) -> (DVec3, Ray) {
        let (toward, light) = self.sun_at(ray.origin, rng, scratch);
        let once = light * layer.scattering.value(one_minus_cos(ray.direction, toward));
        let sent = |toward| layer.scattering.value(one_minus_cos(ray.direction, toward));
        let once = once + self.lamps_at(ray.origin, sent, rng, scratch);
        let (cos, sin) = layer.scattering.sample(rng.uniform());
        (once, Ray { direction: around(ray.direction, cos as f32, sin as f32, rng.uniform_f32()), ..ray })
    }

    /// The sky's radiance in a direction; its luminance where photons have no colour.
    fn sky_at(&self, direction: Vec3) -> DVec3 {
        let light = self.dome.as_ref().map_or(self.sky_radiance, |dome| dome.radiance(direction).as_dvec3());
        if self.tints().is_some() { light } else { DVec3::splat(luminance(light.to_array())) }
    }

    /// A direction to the sun's disc, and the irradiance that arrives from it, by channel.
    fn sun_at(&self, p: Vec3, rng: &mut Rng, scratch: &mut Scratch) -> (Vec3, DVec3) {
        let (axis, sin_alpha) = (self.emitter.axis, self.emitter.sin_alpha);
        let light = if sin_alpha > 0.0 { uniform_disc(axis, sin_alpha, rng.uniform_f32(), rng.uniform_f32()) } else { axis };
        let ray = Ray { origin: p, direction: -light };
        let irradiance = self.emitter.irradiance / f64::from(light.dot(axis));
        if irradiance <= 0.0 || (!self.surfaces.is_empty() && self.surfaces.nearest(&ray, f32::INFINITY).is_some()) {
            return (-light, DVec3::ZERO);
        }
        let tint = self.tints().map_or(Vec3::ONE, |tints| tints.sun) * self.air.transmittance(&ray, f32::INFINITY);
        let clear = (-self.media.optical_depth(&ray, f32::INFINITY, scratch)).exp();
        (-light, irradiance * clear * tint.as_dvec3())
    }

    /// The radiance, by channel, that arrives at a ray's origin from along it without having met a region; that has scattered in air too,
    /// unless it `counts` as it is. An unbiased estimate.
    fn arriving(&self, mut ray: Ray, mut counts: bool, rng: &mut Rng, scratch: &mut Scratch) -> DVec3 {
        let (mut light, mut throughput) = (DVec3::ZERO, DVec3::ONE);
        let mut spectrum = Spectrum::draw(&self.air, rng);
        loop {
            let flight = self.media.fly(&ray, f32::INFINITY, rng.optical_depth(), 0.0, rng, scratch);
            let reach = if let Flight::Collision { distance, .. } = flight { distance } else { f32::INFINITY };
            let hit = if self.surfaces.is_empty() { None } else { self.surfaces.nearest(&ray, reach) };
            let free = hit.map_or(reach, |h| h.t);
            let in_air = self.air.fly(&ray, free, &spectrum, rng);
            let flown = in_air.map_or(free, |(distance, _)| distance);
            throughput *= spectrum.flown(&self.air, &ray, flown, in_air.map(|(_, layer)| layer)).as_dvec3();
            if let Some((distance, layer)) = in_air {
                counts = true;
                throughput *= layer.albedo.as_dvec3();
                let (once, onward) = self.scattered(Ray { origin: ray.at(distance), ..ray }, layer, rng, scratch);
                light += throughput * once;
                ray = onward;
            } else if let Some(hit) = hit {
                throughput *= self.albedos[hit.owner as usize] * self.surface_tint(hit.owner).as_dvec3();
                let p = hit.off(&ray);
                if counts && throughput != DVec3::ZERO {
                    let (toward, irradiance) = self.sun_at(p, rng, scratch);
                    light += throughput * irradiance * (f64::from(toward.dot(hit.normal).max(0.0)) * FRAC_1_PI);
                    let sent = |toward: Vec3| f64::from(toward.dot(hit.normal).max(0.0)) * FRAC_1_PI;
                    light += throughput * self.lamps_at(p, sent, rng, scratch);
                }
                ray = Ray { origin: p, direction: cosine_hemisphere(hit.normal, rng.uniform_f32(), rng.uniform_f32()) };
            } else {
                let sky = if reach.is_finite() || !counts { DVec3::ZERO } else { self.sky_at(ray.direction) };
                return light + throughput * sky;
            }
            let brightest = throughput.max_element();
            if brightest < DIM {
                if rng.uniform() * DIM >= brightest {
                    return light;
                }
                throughput *= DIM / brightest;
            }
        }
    }
}
