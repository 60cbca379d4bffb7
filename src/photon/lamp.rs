//! Photons of lamps: aimed at the regions, and where surfaces may send them on, at all that a lamp shines on.

use super::aim::{Aim, Cone};
use super::emit::Start;
use super::trace::Tracer;
use crate::geom::{Ray, basis};
use crate::media::Scratch;
use crate::rng::Rng;
use crate::scene::{Lamp, Scene, medium::luminance};
use glam::{DVec3, Vec2, Vec3};
use std::f64::consts::TAU;

/// What light that is not aimed at the regions counts when photons are dealt out.
const ASIDE: f64 = 0.3;

/// The lamps of a scene, compiled.
#[derive(Debug, Clone)]
pub(super) struct Lamps {
    pub(super) lamps: Vec<Lamp>,
    beams: Vec<Beam>,
    /// What one photon stands for, over all lamps, W.
    pub(super) power: f64,
    /// Whether their light counts as scattered from the first flight on: nobody looks at it.
    gathered: bool,
}

/// Where a lamp's photons go.
#[derive(Debug, Clone)]
struct Beam {
    /// Holds every direction that leads to a region straight.
    aimed: Cone,
    /// All that the lamp shines on, and how often a direction is drawn from it.
    wide: Option<(Cone, f64)>,
    /// The part of [`Lamps::power`] that is its own.
    power: f64,
    tint: Vec3,
}

impl Lamps {
    /// Those of a scene, relative to `origin`; `aim` is the regions' bounding sphere, and `bounces` tells whether surfaces send light on.
    pub fn of(scene: &Scene, origin: DVec3, aim: Option<&Aim>, bounces: bool) -> Option<Self> {
        let lamps: Vec<Lamp> = Lamp::all_from(&scene.lamps, origin).into_iter().filter(|lamp| lamp.grey() > 0.0).collect();
        let beam = |lamp: &Lamp| {
            let all = lamp.spot.map_or(Cone::ALL, |spot| Cone::around(spot.axis.as_vec3(), spot.cosines[1]));
            // From every point of the lamp.
            let wider = aim.map(|aim| Aim { radius: aim.radius + lamp.radius as f32 });
            let seen = wider.and_then(|aim| aim.seen_from(lamp.position.as_vec3()));
            let aimed = seen.filter(|cone| cone.solid_angle < all.solid_angle).unwrap_or(all);
            let aside = ASIDE * all.solid_angle;
            let wide = (bounces && !scene.surfaces.is_empty()).then(|| (all, aside / (aside + aimed.solid_angle)));
            let power = lamp.grey() * (aimed.solid_angle + wide.map_or(0.0, |_| aside));
            let tint = (DVec3::from_array(lamp.intensity) / lamp.grey()).as_vec3();
            Beam { aimed, wide, power, tint }
        };
        let beams: Vec<Beam> = lamps.iter().map(beam).collect();
        let power = beams.iter().map(|beam| beam.power).sum();
        (!lamps.is_empty()).then_some(Lamps { lamps, beams, power, gathered: false })
    }

    /// About the largest power of a photon, W.
    pub fn strongest(&self) -> f64 {
        self.power / if self.beams.iter().any(|beam| beam.wide.is_some()) { ASIDE } else { 1.0 }
    }

    /// Starts one photon. Its colour is the lamp's, of luminance 1.
    pub fn emit(&self, rng: &mut Rng) -> Start {
        let mut left = rng.uniform() * self.power;
        let last = self.beams.len() - 1;
        let number = self.beams[..last].iter().position(|beam| {
            left -= beam.power;
            left < 0.0
        });
        let (lamp, beam) = (&self.lamps[number.unwrap_or(last)], &self.beams[number.unwrap_or(last)]);
        let often = beam.wide.as_ref().map_or(0.0, |(_, often)| *often);
        let drawn = beam.wide.as_ref().filter(|(_, often)| rng.uniform() < *often).map_or(&beam.aimed, |(cone, _)| cone);
        let direction = drawn.sample(rng);
        let part = |cone: &Cone| if cone.holds(direction) { 1.0 / cone.solid_angle } else { 0.0 };
        // The direction that was drawn is in its cone, whatever rounding says.
        let density = ((1.0 - often) * part(&beam.aimed) + beam.wide.as_ref().map_or(0.0, |(cone, often)| often * part(cone)))
            .max(if often > 0.0 { 0.0 } else { 1.0 / drawn.solid_angle });
        let power = if density > 0.0 { lamp.grey() * lamp.share(direction) / density * (self.power / beam.power) } else { 0.0 };
        let (u, v) = basis(direction);
        let (sin, cos) = (TAU * rng.uniform()).sin_cos();
        let disc = Vec2::new(cos as f32, sin as f32) * (lamp.radius * rng.uniform().sqrt()) as f32;
        let origin = lamp.position.as_vec3() + u * disc.x + v * disc.y;
        Start { ray: Ray { origin, direction }, power, tint: beam.tint, counted: false, scattered: self.gathered, from_air: false }
    }
}

impl Tracer {
    /// The tracer of photons for those who do not look at lamps: their light is gathered from its first flight on.
    pub fn with_lamps_gathered(mut self) -> Self {
        self.lamps.iter_mut().for_each(|lamps| lamps.gathered = true);
        self
    }

    /// The light of lamps that arrives at `p` and is sent on by a share `sent`, 1/sr, by channel (grey where photons have no colour); an
    /// unbiased estimate.
    pub(super) fn lamps_at(&self, p: Vec3, sent: impl Fn(Vec3) -> f64, rng: &mut Rng, scratch: &mut Scratch) -> DVec3 {
        let Some(look) = self.lamps.as_ref().and_then(|lamps| Lamp::look(&lamps.lamps, p, rng)) else { return DVec3::ZERO };
        let ray = Ray { origin: p, direction: look.toward };
        if !self.surfaces.is_empty() && self.surfaces.nearest(&ray, look.distance).is_some() {
            return DVec3::ZERO;
        }
        let light = look.light.as_dvec3();
        let light = if self.tints().is_some() { light } else { DVec3::splat(luminance(light.to_array())) };
        let clear = (-self.media.optical_depth(&ray, look.distance, scratch)).exp();
        light * sent(look.toward) * clear * self.air.transmittance(&ray, look.distance).as_dvec3()
    }
}
