//! The reference: unbiased path tracing through media and off surfaces, sun and lamps looked at from every event.
//!
//! No step is cut and nothing is interpolated: media are crossed by [`Media::fly`](crate::media::Media::fly), air by a flight of its
//! own of which the shorter counts, the sun's disc
//! is sampled, the sky is met by leaving, and looked for where it has bright spots. Roulette begins where throughput has fallen below [`DIM`]; what it kills and what
//! it keeps balance in the mean.

use super::band::{Band, bands};
use super::firelight;
use super::lamplight::Lamplight;
use super::lens::View;
use super::skylight::Skylight;
use super::sunlight::Sunlight;
use super::tile::{Arrival, Layer, Transport};
use crate::geom::Ray;
use crate::media::{
    Fire, Flight, Profile, Scratch,
    air::{self, Spectrum},
};
use crate::plan::{EffectName, Plan};
use crate::rng::Rng;
use crate::sampling::{around, cosine_hemisphere, cosine_hemisphere_pdf};
use crate::scene::Scene;
use crate::scene::phase::{henyey_greenstein, one_minus_cos, sample_henyey_greenstein};
use crate::trimesh::{Hit, TriMesh};
use glam::{DVec3, Vec3};

/// Roulette begins below this throughput.
const DIM: f32 = 0.25;
/// Collisions after which a path is cut, and counted as such.
const MOST_COLLISIONS: u64 = 1 << 24;

/// The scene, compiled for path tracing.
#[derive(Debug, Clone)]
pub(super) struct PathTracer {
    pub bands: Vec<Band>,
    pub surfaces: TriMesh,
    /// Of each surface.
    pub albedos: Vec<Vec3>,
    pub sun: Sunlight,
    pub sky: Skylight,
    lamps: Lamplight,
    pub fire: Fire,
    /// Collisions with regions after which a path ends.
    orders: u64,
    /// Whether surfaces light regions, and regions shade surfaces and light them.
    bounces: bool,
    shades: bool,
    pub lights: bool,
    /// World position of the local space's origin.
    pub origin: DVec3,
}

impl PathTracer {
    pub(super) fn new(scene: &Scene, plan: &Plan) -> Self {
        let scene = &*plan.scene(scene);
        let origin = scene.region_bounds().centre();
        let meshes: Vec<_> = scene.surfaces.iter().map(|s| &s.mesh).collect();
        let colour = |rgb: [f64; 3]| DVec3::from_array(rgb).as_vec3();
        PathTracer {
            bands: bands(scene, origin, scene.sun.shines().then(|| -scene.sun.direction.as_vec3())),
            surfaces: TriMesh::new(&meshes, origin),
            albedos: scene.surfaces.iter().map(|s| colour(s.albedo)).collect(),
            sun: Sunlight::new(&scene.sun, plan.on(EffectName::SunDisc)),
            sky: Skylight::new(scene),
            lamps: Lamplight::new(scene, origin),
            fire: Fire::new(scene, origin),
            orders: plan.orders.map_or(MOST_COLLISIONS, u64::from),
            bounces: plan.on(EffectName::SurfaceBounce),
            shades: plan.on(EffectName::CloudShadow),
            lights: plan.on(EffectName::CloudLight),
            origin,
        }
    }

    /// What arrives along `ray` from its first `reach` metres, or from the sky behind; an unbiased estimate.
    pub(super) fn radiance(&self, band: &Band, mut ray: Ray, reach: f32, rng: &mut Rng, scratch: &mut Scratch) -> Arrival {
        let mut arrival = Arrival::default();
        let (mut throughput, mut layer) = (band.mask, Layer::Environment);
        let (mut hint, mut reach) = (0.0, reach);
        // What of the sunlight at the next collision is left to this path, the rest being found by a look sunward.
        let (mut share, mut order) = (1.0, 0);
        // The density with which the last event drew this direction; the camera's is the only one.
        let mut own = f64::INFINITY;
        let mut spectrum = Spectrum::draw(&band.air, rng);
        // Within what distance flights find flames: the last event has looked at others.
        let mut near = f32::INFINITY;
        loop {
            let tau = rng.optical_depth();
            let flight = band.media.fly(&ray, reach, tau, hint, rng, scratch);
            let distance = if let Flight::Collision { distance, .. } = flight { distance } else { reach };
            let hit = if self.surfaces.is_empty() { None } else { self.surfaces.nearest(&ray, distance) };
            let (free, mut in_air) = (hit.map_or(distance, |h| h.t), None);
            if !band.air.is_empty() {
                in_air = band.air.fly(&ray, free, &spectrum, rng);
            }
            if !self.fire.is_empty() {
                let reach = in_air.map_or(free, |(distance, _)| distance).min(near);
                arrival.light[layer.beside(Layer::VolumeDirect) as usize] +=
                    throughput * self.fire_of_flight(band, spectrum, &ray, reach, rng, scratch);
            }
            if !band.air.is_empty() {
                throughput *= spectrum.flown(&band.air, &ray, in_air.map_or(free, |(distance, _)| distance), in_air.map(|(_, air)| air));
            }
            if let Some((distance, air)) = in_air {
                layer = layer.then(Layer::VolumeDirect);
                arrival.event(distance);
                arrival.collisions += 1;
                throughput *= air.albedo;
                ray.origin = ray.at(distance);
                arrival.light[layer as usize] += throughput * self.sun.in_air(band, &self.surfaces, &ray, air, rng, scratch);
                let before = ray.direction;
                let sent = |toward| air.scattering.value(one_minus_cos(before, toward));
                arrival.light[layer as usize] += throughput * self.sky.look(band, &self.surfaces, ray.origin, sent, rng, scratch);
                arrival.light[layer as usize] += throughput * self.lamps_in_air(band, &ray, air, rng, scratch);
                near = self.fire.near(ray.origin);
                arrival.light[layer as usize] +=
                    throughput * firelight::look(&self.fire, band, &self.surfaces, (ray.origin, near), sent, rng, scratch);
                let (cos, sin) = air.scattering.sample(rng.uniform());
                ray.direction = around(before, cos as f32, sin as f32, rng.uniform_f32());
                own = if self.sky.peaked() { sent(ray.direction) } else { own };
                (hint, share) = (0.0, 1.0);
            } else if let Some(hit) = hit {
                layer = layer.then(Layer::Surface);
                arrival.event(hit.t);
                let albedo = self.albedos[hit.owner as usize];
                if albedo == Vec3::ZERO || (order > 0 && !self.bounces) {
                    return arrival;
                }
                throughput *= albedo;
                let p = hit.off(&ray);
                arrival.light[layer as usize] += throughput * self.on_surface(band, p, &hit, rng, scratch);
                arrival.light[layer as usize] += throughput * self.sky_on_surface(band, p, &hit, rng, scratch);
                ray = Ray { origin: p, direction: cosine_hemisphere(hit.normal, rng.uniform_f32(), rng.uniform_f32()) };
                own = cosine_hemisphere_pdf(ray.direction.dot(hit.normal)).into();
                (hint, share, near) = (0.0, 1.0, self.fire.near_surface());
            } else if let Flight::Collision { distance, region, sigma_t } = flight {
                order += 1;
                if order > self.orders || (layer == Layer::Surface && !self.lights) {
                    return arrival;
                }
                layer = layer.then(Layer::VolumeDirect);
                arrival.event(distance);
                arrival.collisions += 1;
                let (albedo, g) = band.optics[region as usize];
                throughput *= albedo;
                ray.origin = ray.at(distance);
                hint = sigma_t;
                let (light, clear) = self.sun.in_medium(band, &self.surfaces, &ray, (g, share), rng, scratch);
                arrival.light[layer as usize] += throughput * (light + self.lamps_in_medium(band, &ray, g, rng, scratch));
                let rivals = if order < self.orders { self.sun.rivals(g, clear) } else { None };
                if let Some(direction) = rivals.and_then(|r| self.sun.sunward(&r, rng)) {
                    let share = rivals.map_or(0.0, |r| self.sun.share(&r, ray.direction, direction));
                    let light = self.sun_ahead(band, Ray { direction, ..ray }, (hint, share), rng, scratch);
                    arrival.light[layer.then(Layer::VolumeIndirect) as usize] += throughput * light;
                }
                let before = ray.direction;
                let sent = |toward| henyey_greenstein(g, one_minus_cos(before, toward));
                near = self.fire.near(ray.origin);
                arrival.light[layer as usize] +=
                    throughput * firelight::look(&self.fire, band, &self.surfaces, (ray.origin, near), sent, rng, scratch);
                if self.sky.peaked() {
                    arrival.light[layer as usize] += throughput * self.sky.look(band, &self.surfaces, ray.origin, sent, rng, scratch);
                }
                let (cos, sin) = sample_henyey_greenstein(g, rng.uniform());
                ray.direction = around(before, cos as f32, sin as f32, rng.uniform_f32());
                own = if self.sky.peaked() { henyey_greenstein(g, one_minus_cos(before, ray.direction)) } else { own };
                share = rivals.map_or(1.0, |r| self.sun.share(&r, before, ray.direction));
            } else {
                arrival.light[layer as usize] += throughput * self.sky.met(ray.direction, own);
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
                arrival.truncated = 1;
                return arrival;
            }
        }
    }

    /// The light of sun and lamps that a white surface sends out from `p` (radiance).
    pub(super) fn on_surface(&self, band: &Band, p: Vec3, hit: &Hit, rng: &mut Rng, scratch: &mut Scratch) -> Vec3 {
        let sent = |toward: Vec3| cosine_hemisphere_pdf(toward.dot(hit.normal)).into();
        let lamps = self.lamps.look(band, &self.surfaces, p, sent, rng, scratch);
        let fire = firelight::look(&self.fire, band, &self.surfaces, (p, self.fire.near_surface()), sent, rng, scratch);
        lamps + fire + self.sun.on_surface(band, &self.surfaces, (p, self.shades), hit, rng, scratch)
    }

    /// What of the sky's light a white surface sends out from `p` (radiance) that looks find.
    pub(super) fn sky_on_surface(&self, band: &Band, p: Vec3, hit: &Hit, rng: &mut Rng, scratch: &mut Scratch) -> Vec3 {
        let sent = |toward: Vec3| cosine_hemisphere_pdf(toward.dot(hit.normal).max(0.0)).into();
        self.sky.look(band, &self.surfaces, p, sent, rng, scratch)
    }

    /// The light of lamps that a collision at the ray's origin, with albedo 1, scatters back along the ray.
    #[inline]
    pub(super) fn lamps_in_medium(&self, band: &Band, ray: &Ray, g: f64, rng: &mut Rng, scratch: &mut Scratch) -> Vec3 {
        let sent = |toward| henyey_greenstein(g, one_minus_cos(ray.direction, toward));
        self.lamps.look(band, &self.surfaces, ray.origin, sent, rng, scratch)
    }

    /// The light of lamps that air of albedo 1 at the ray's origin scatters back along the ray.
    pub(super) fn lamps_in_air(&self, band: &Band, ray: &Ray, layer: &air::Layer, rng: &mut Rng, scratch: &mut Scratch) -> Vec3 {
        let sent = |toward| layer.scattering.value(one_minus_cos(ray.direction, toward));
        self.lamps.look(band, &self.surfaces, ray.origin, sent, rng, scratch)
    }

    /// What flames along a flight of that reach send back along it; an unbiased estimate of what arrives, as the flight's end is drawn.
    fn fire_of_flight(&self, band: &Band, spectrum: Spectrum, ray: &Ray, reach: f32, rng: &mut Rng, scratch: &mut Scratch) -> Vec3 {
        if band.air.is_empty() {
            return self.fire.along(ray, reach, scratch);
        }
        self.fire.weighed(ray, reach, || rng.uniform(), |distance| { spectrum }.flown(&band.air, ray, distance, None), scratch)
    }

    /// What flames along the ray's first `reach` metres send to its origin, past the media of `before` and past air; `own` is room for it.
    pub(super) fn fire_along(&self, ray: &Ray, reach: f32, before: &Profile, scratch: &mut Scratch, own: &mut Profile) -> Vec3 {
        let air = &self.bands[0].air;
        let clear = |distance: f32| if air.is_empty() { Vec3::ONE } else { air.transmittance(ray, distance) };
        self.fire.seen(ray, reach, before, clear, scratch, own)
    }

    /// The sunlight that the next collision along `ray` scatters back along it, times `share`.
    fn sun_ahead(&self, band: &Band, ray: Ray, (hint, share): (f64, f32), rng: &mut Rng, scratch: &mut Scratch) -> Vec3 {
        let tau = rng.optical_depth();
        let Flight::Collision { distance, region, .. } = band.media.fly(&ray, f32::INFINITY, tau, hint, rng, scratch) else {
            return Vec3::ZERO;
        };
        if !self.surfaces.is_empty() && self.surfaces.nearest(&ray, distance).is_some() {
            return Vec3::ZERO;
        }
        let (albedo, g) = band.optics[region as usize];
        let there = Ray { origin: ray.at(distance), direction: ray.direction };
        // Air on the way turns some of the flights aside.
        let clear = band.air.transmittance(&ray, distance);
        albedo * clear * self.sun.in_medium(band, &self.surfaces, &there, (g, share), rng, scratch).0
    }
}

impl Transport for PathTracer {
    type Room = Scratch;

    const STORED: bool = false;

    fn arrival(&self, view: &View, rng: &mut Rng, scratch: &mut Scratch) -> Arrival {
        if let [band] = &self.bands[..] {
            return self.radiance(band, view.ray, view.reach, rng, scratch);
        }
        let mut whole = Arrival::default();
        for band in &self.bands {
            whole.add(&self.radiance(band, view.ray, view.reach, rng, scratch), Vec3::ONE);
        }
        whole
    }

    fn clear(&self, view: &View, _: &Arrival, scratch: &mut Scratch) -> (f64, bool) {
        let hit = self.surfaces.nearest(&view.ray, view.reach);
        let reach = hit.map_or(view.reach, |h| h.t);
        // The mean of the bands.
        let depths =
            self.bands.iter().map(|band| band.media.optical_depth(&view.ray, reach, scratch) + band.air.optical_depth(&view.ray, reach));
        let sum = depths.fold(0.0, |sum, depth| sum + depth.map(|d| (-d).exp()).element_sum() / 3.0);
        (sum / self.bands.len() as f64, hit.is_some())
    }

    fn scratch(scratch: &Scratch) -> &Scratch {
        scratch
    }
}
