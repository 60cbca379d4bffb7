//! Photons of flames: from everywhere in them as much as shines there, in all directions, or where only regions matter toward these.

use super::aim::{Aim, Cone};
use super::emit::Start;
use crate::geom::Ray;
use crate::media::Fire;
use crate::rng::Rng;
use crate::sampling::uniform_sphere;
use crate::scene::Scene;
use glam::{DVec3, Vec3};
use std::f64::consts::PI;

/// How often a photon goes anywhere where surfaces may send it on, and not toward the regions.
const ANYWHERE: f64 = 0.3;

/// The flames of a scene, compiled.
#[derive(Debug, Clone)]
pub(super) struct Flames {
    fire: Fire,
    aim: Option<Aim>,
    /// Whether surfaces send light on.
    beside: bool,
}

impl Flames {
    /// Those of a scene, relative to `origin`; `aim` is the regions' bounding sphere, and `bounces` tells whether surfaces send light on.
    pub fn of(scene: &Scene, origin: DVec3, aim: Option<&Aim>, bounces: bool) -> Option<Self> {
        let fire = Fire::new(scene, origin);
        (fire.power() > 0.0).then(|| Flames { fire, aim: aim.copied(), beside: bounces && !scene.surfaces.is_empty() })
    }

    /// What all of them send out, W: the power of a photon that may go anywhere.
    pub fn power(&self) -> f64 {
        self.fire.power()
    }

    /// About the largest power of a photon, W.
    pub fn strongest(&self) -> f64 {
        self.power() / if self.beside { ANYWHERE } else { 1.0 }
    }

    /// Starts one photon. Its colour is that of the light from there, of luminance 1.
    pub fn emit(&self, rng: &mut Rng) -> Start {
        let (p, tint) = self.fire.sample(rng);
        let cone = self.aim.and_then(|aim| aim.seen_from(p)).filter(|cone| cone.solid_angle < 4.0 * PI);
        let anywhere = if cone.is_none() || (self.beside && rng.uniform() < ANYWHERE) { Some(uniform_sphere(rng)) } else { None };
        let direction = match (anywhere, &cone) {
            (Some(direction), _) => direction,
            (None, Some(cone)) => cone.sample(rng),
            (None, None) => Vec3::Z,
        };
        // Over the density of all directions alike.
        let density = cone.map_or(1.0, |cone: Cone| {
            let toward = if anywhere.is_none() || cone.holds(direction) { 4.0 * PI / cone.solid_angle } else { 0.0 };
            if self.beside { ANYWHERE + (1.0 - ANYWHERE) * toward } else { toward }
        });
        Start { ray: Ray { origin: p, direction }, power: self.power() / density, tint, counted: false, scattered: true, from_air: false }
    }
}
