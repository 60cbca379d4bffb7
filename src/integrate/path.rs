//! The reference: unbiased path tracing through media and off surfaces, sunlight sampled at every event.
//!
//! No step is cut and nothing is interpolated: media are crossed by [`Media::fly`](crate::media::Media::fly), the sun's disc
//! is sampled, the sky is met by leaving. Roulette begins where throughput has fallen below [`DIM`]; what it kills and what
//! it keeps balance in the mean.

use super::band::{Band, bands};
use crate::geom::Ray;
use crate::media::{Flight, Scratch};
use crate::plan::{EffectName, Plan};
use crate::rng::Rng;
use crate::sampling::{around, cosine_hemisphere, uniform_disc};
use crate::scene::Scene;
use crate::scene::phase::{henyey_greenstein, sample_henyey_greenstein};
use crate::trimesh::{Hit, TriMesh};
use glam::{DVec3, Vec3};
use std::f32::consts::FRAC_1_PI;

/// Roulette begins below this throughput.
const DIM: f32 = 0.25;
/// Collisions after which a path is cut, and counted as such.
const MOST_COLLISIONS: u64 = 1 << 24;

/// The scene, compiled for path tracing.
#[derive(Debug, Clone)]
pub(super) struct PathTracer {
    pub bands: Vec<Band>,
    pub surfaces: TriMesh,
    /// Of each surface; black where the plan leaves bounces out.
    albedos: Vec<Vec3>,
    sun: Sun,
    pub sky: Vec3,
    /// World position of the local space's origin.
    pub origin: DVec3,
}

#[derive(Debug, Clone, Copy)]
struct Sun {
    /// In which its light travels.
    direction: Vec3,
    sin_alpha: f32,
    irradiance: Vec3,
}

/// How a path reached the camera: the layer that its light belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Layer {
    VolumeDirect,
    VolumeIndirect,
    Surface,
    Environment,
}

/// What one camera ray brings.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Arrival {
    /// Radiance by [`Layer`].
    pub light: [Vec3; 4],
    /// Distance to the first event, m.
    pub depth: Option<f32>,
    pub collisions: u64,
    pub truncated: bool,
}

impl PathTracer {
    pub(super) fn new(scene: &Scene, plan: &Plan) -> Self {
        let origin = scene.region_bounds().centre();
        let meshes: Vec<_> = scene.surfaces.iter().map(|s| &s.mesh).collect();
        let colour = |rgb: [f64; 3]| DVec3::from_array(rgb).as_vec3();
        let bounces = plan.on(EffectName::SurfaceBounce);
        let disc = plan.on(EffectName::SunDisc);
        PathTracer {
            bands: bands(scene, origin, -scene.sun.direction.as_vec3()),
            surfaces: TriMesh::new(&meshes, origin),
            albedos: scene.surfaces.iter().map(|s| if bounces { colour(s.albedo) } else { Vec3::ZERO }).collect(),
            sun: Sun {
                direction: scene.sun.direction.as_vec3().normalize(),
                sin_alpha: if disc { (scene.sun.angular_diameter * 0.5).sin() as f32 } else { 0.0 },
                irradiance: colour(scene.sun.irradiance),
            },
            sky: colour(scene.sky),
            origin,
        }
    }

    /// What arrives along `ray` from its first `reach` metres, or from the sky behind; an unbiased estimate.
    pub(super) fn radiance(&self, band: &Band, mut ray: Ray, reach: f32, rng: &mut Rng, scratch: &mut Scratch) -> Arrival {
        let mut arrival = Arrival::default();
        let (mut throughput, mut layer) = (band.mask, Layer::Environment);
        let (mut hint, mut reach) = (0.0, reach);
        loop {
            let tau = rng.optical_depth();
            let flight = band.media.fly(&ray, reach, tau, hint, rng, scratch);
            let distance = if let Flight::Collision { distance, .. } = flight { distance } else { reach };
            let hit = if self.surfaces.is_empty() { None } else { self.surfaces.nearest(&ray, distance) };
            let first = layer == Layer::Environment;
            if let Some(hit) = hit {
                if first {
                    (arrival.depth, layer) = (Some(hit.t), Layer::Surface);
                } else if layer == Layer::VolumeDirect {
                    layer = Layer::VolumeIndirect;
                }
                let albedo = self.albedos[hit.owner as usize];
                if albedo == Vec3::ZERO {
                    return arrival;
                }
                throughput *= albedo;
                let p = hit.off(&ray);
                arrival.light[layer as usize] += throughput * self.sun_on_surface(band, p, &hit, rng, scratch);
                ray = Ray { origin: p, direction: cosine_hemisphere(hit.normal, rng.uniform_f32(), rng.uniform_f32()) };
                hint = 0.0;
            } else if let Flight::Collision { distance, region, sigma_t } = flight {
                if first {
                    (arrival.depth, layer) = (Some(distance), Layer::VolumeDirect);
                } else if layer == Layer::VolumeDirect {
                    layer = Layer::VolumeIndirect;
                }
                arrival.collisions += 1;
                let (albedo, g) = band.optics[region as usize];
                throughput *= albedo;
                ray.origin = ray.at(distance);
                arrival.light[layer as usize] += throughput * self.sun_in_medium(band, &ray, g, rng, scratch);
                let (cos, sin) = sample_henyey_greenstein(g, rng.uniform());
                ray.direction = around(ray.direction, cos as f32, sin as f32, rng.uniform_f32());
                hint = sigma_t;
            } else {
                arrival.light[layer as usize] += throughput * self.sky;
                return arrival;
            }
            reach = f32::INFINITY;
            let brightest = throughput.max_element();
            if brightest < DIM {
                if rng.uniform_f32() * DIM >= brightest {
                    return arrival;
                }
                throughput *= DIM / brightest;
            }
            if arrival.collisions >= MOST_COLLISIONS {
                arrival.truncated = true;
                return arrival;
            }
        }
    }

    /// The sunlight that a collision at the ray's origin scatters back along the ray, for an albedo of 1.
    #[inline]
    fn sun_in_medium(&self, band: &Band, ray: &Ray, g: f64, rng: &mut Rng, scratch: &mut Scratch) -> Vec3 {
        let Some((toward, weight)) = self.toward_sun(rng) else { return Vec3::ZERO };
        // |a - b|^2 / 2 is 1 - cos without cancellation.
        let one_minus_cos = 0.5 * f64::from((ray.direction - toward).length_squared());
        let phase = henyey_greenstein(g, one_minus_cos) as f32 * weight;
        let isotropic = phase * (4.0 * std::f32::consts::PI);
        self.sun.irradiance * (phase * self.visible(band, ray.origin, toward, isotropic, rng, scratch))
    }

    /// The sunlight that a white Lambertian surface at `p` sends out (radiance).
    fn sun_on_surface(&self, band: &Band, p: Vec3, hit: &Hit, rng: &mut Rng, scratch: &mut Scratch) -> Vec3 {
        let Some((toward, weight)) = self.toward_sun(rng) else { return Vec3::ZERO };
        let cos = toward.dot(hit.normal);
        if cos <= 0.0 {
            return Vec3::ZERO;
        }
        self.sun.irradiance * (cos * FRAC_1_PI * weight * self.visible(band, p, toward, cos, rng, scratch))
    }

    /// A direction to a point of the sun's disc, and the irradiance across it over that on the plane across the sun's axis.
    #[inline]
    fn toward_sun(&self, rng: &mut Rng) -> Option<(Vec3, f32)> {
        let Sun { direction, sin_alpha, irradiance } = self.sun;
        if irradiance == Vec3::ZERO {
            return None;
        }
        if sin_alpha == 0.0 {
            return Some((-direction, 1.0));
        }
        let light = uniform_disc(direction, sin_alpha, rng.uniform_f32(), rng.uniform_f32());
        Some((-light, 1.0 / light.dot(direction)))
    }

    /// The share of light that arrives at `p` from direction `toward`, far away; an unbiased estimate.
    fn visible(&self, band: &Band, p: Vec3, toward: Vec3, weight: f32, rng: &mut Rng, scratch: &mut Scratch) -> f32 {
        if !self.surfaces.is_empty() && self.surfaces.nearest(&Ray { origin: p, direction: toward }, f32::INFINITY).is_some() {
            return 0.0;
        }
        band.media.sunlight(p, toward, weight, rng, scratch) as f32
    }
}
