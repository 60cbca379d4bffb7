//! Air along camera rays: sunlight that it scatters, in the shadows of clouds and out of them (sunbeams); and what else it sends.

use super::field::{Found, grey};
use super::{Channel, Room};
use crate::geom::Ray;
use crate::integrate::lens::Stratum;
use crate::integrate::path::PathTracer;
use crate::media::air::{Layer, Spectrum};
use crate::rng::Rng;
use crate::sampling::around;
use glam::{DVec3, Vec3};

/// Looks at the sun in each layer, along a camera ray and along the others.
const LOOKS: u32 = 4;
const FEW: u32 = 1;

/// What air sends along a stretch of a ray.
#[derive(Debug, Default)]
pub(super) struct Sent {
    /// Sunlight that scattered once.
    pub direct: Vec3,
    /// What was looked up of all else, and what was followed.
    pub found: Found,
    pub followed: Vec3,
    /// Looks at the sun.
    pub looks: u64,
}

impl Channel {
    /// What air sends along the first `reach` metres of a ray, of whose regions the room holds the profile. In each layer, points are
    /// spread evenly over the chance of a collision in that layer alone. Light that comes from elsewhere than the sun is looked up along
    /// camera rays; along others it is followed, from one of the points.
    pub(super) fn air(&self, (ray, stratum): (&Ray, Stratum), reach: f32, first: bool, rng: &mut Rng, room: &mut Room) -> Sent {
        let (tracer, band) = (&self.tracer, &self.tracer.bands[0]);
        let mut sent = Sent::default();
        let looks = if first { LOOKS } else { FEW };
        let (mut whole, mut chosen) = (0.0f32, None);
        let layers = band.air.layers();
        for (number, layer) in layers.iter().enumerate() {
            let chances = layer.optical_depth(ray, reach).map(|depth| -(-depth).exp_m1());
            if chances == DVec3::ZERO {
                continue;
            }
            for i in 0..looks {
                // By one of the channels; what each would have found so counts by the balance heuristic.
                let hero = Spectrum::draw(&band.air, rng).hero();
                let share = stratum.of(number as u32 * looks + i, rng.uniform());
                let along = (f64::from(i) + share) / f64::from(looks) * chances[hero];
                let Some(distance) = layer.distance(ray, reach, -(-along).ln_1p() / layer.sigma_t()[hero]) else { continue };
                let own = layer.sigma_t() * layer.optical_depth(ray, distance).map(|depth| (-depth).exp());
                let density = DVec3::select(chances.cmpgt(DVec3::ZERO), own / chances, DVec3::ZERO).element_sum() / 3.0;
                let before = |(n, other): (usize, &Layer)| if n == number { DVec3::ZERO } else { other.optical_depth(ray, distance) };
                let others: DVec3 = layers.iter().enumerate().map(before).sum();
                let clear = (-others - room.profile.until(distance)).map(f64::exp);
                let weight = layer.albedo * (own / density / f64::from(looks) * clear).as_vec3();
                let here = Ray { origin: ray.at(distance), direction: ray.direction };
                let sun = tracer.sun.in_air(band, &tracer.surfaces, &here, layer, rng, &mut room.scratch);
                sent.direct += weight * (sun + tracer.lamps_in_air(band, &here, layer, rng, &mut room.scratch));
                sent.looks += 1;
                if let Some(glow) = self.glow.as_ref().filter(|_| first) {
                    glow.sent(ray, distance, number, weight, &mut sent.found);
                } else {
                    // A reservoir of one: each point is kept in proportion to its weight.
                    let grey = grey(weight);
                    whole += grey;
                    if rng.uniform_f32() * whole < grey {
                        chosen = Some((here, layer, weight / grey));
                    }
                }
            }
        }
        // What follows plays roulette, with the chance of the light that it stands for.
        let kept = whole.min(1.0);
        if let Some((here, layer, tint)) = chosen.filter(|_| rng.uniform_f32() < kept) {
            sent.followed = tint * (whole / kept) * onward(tracer, &here, layer, rng, room);
        }
        sent
    }
}

/// What a layer sends back along a ray from its origin, sunlight that scattered once apart, with albedo 1.
fn onward(tracer: &PathTracer, here: &Ray, layer: &Layer, rng: &mut Rng, room: &mut Room) -> Vec3 {
    let (cos, sin) = layer.scattering.sample(rng.uniform());
    let ray = Ray { origin: here.origin, direction: around(here.direction, cos as f32, sin as f32, rng.uniform_f32()) };
    tracer.radiance(&tracer.bands[0], ray, f32::INFINITY, rng, &mut room.scratch).light.iter().sum()
}
