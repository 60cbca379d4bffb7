//! Photons of the sky: from all directions as its light comes, aimed at the regions and at what surfaces may send toward them.

use super::emit::{Start, aside, aside_density, reach};
use super::eye::{Eye, across};
use crate::geom::{Ray, basis};
use crate::rng::Rng;
use crate::sampling::uniform_sphere;
use crate::scene::medium::luminance;
use crate::scene::{Dome, Scene};
use glam::{DVec3, Vec2, Vec3};
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

/// The sky, compiled.
#[derive(Debug, Clone)]
pub(super) struct Sky {
    /// The mean, W m^-2 sr^-1.
    radiance: f64,
    /// By direction, where it is not even.
    dome: Option<Arc<Dome>>,
    /// The regions' bounding sphere, around the origin, m.
    radius: f32,
    /// How far upstream lies everything, surfaces included, m.
    far: f32,
    /// Whether light beside the regions may reach them by way of a surface.
    beside: bool,
}

impl Sky {
    /// The sky of a scene that has one, and regions with bounds; relative to `origin`. `bounces`: whether surfaces send light back.
    pub fn of(scene: &Scene, origin: DVec3, bounces: bool) -> Option<Self> {
        let bounds = scene.region_support();
        let radiance = luminance(scene.sky);
        if radiance <= 0.0 || bounds.is_empty() || scene.regions.iter().any(|r| r.shape.is_endless()) {
            return None;
        }
        let everything = scene.surfaces.iter().fold(bounds, |b, s| b.union(s.mesh.bounds()));
        let dome = scene.dome.clone();
        Some(Sky {
            radiance,
            dome,
            radius: reach(bounds, origin),
            far: reach(everything, origin),
            beside: bounces && !scene.surfaces.is_empty(),
        })
    }

    /// The power of the light that meets the regions' bounding sphere, W.
    pub fn power(&self) -> f64 {
        self.radiance * 4.0 * PI * PI * f64::from(self.radius).powi(2)
    }

    /// Starts one photon. Where light beside the regions counts, it starts the more seldom the farther from them, as what ground there can
    /// send back falls ([`aside`]).
    /// Its colour is that of the light from there, of luminance 1.
    pub fn emit(&self, rng: &mut Rng, eye: Option<&Eye>) -> Start {
        let others = |rng: &mut Rng| {
            let direction = match &self.dome {
                Some(dome) => -dome.sample(rng.uniform_f32(), rng.uniform_f32()).0,
                None => uniform_sphere(rng),
            };
            let p = if self.beside {
                aside(self.radius, rng)
            } else {
                let (sin, cos) = (TAU * rng.uniform()).sin_cos();
                let rho = f64::from(self.radius) * rng.uniform().sqrt();
                Vec2::new((rho * cos) as f32, (rho * sin) as f32)
            };
            let (u, v) = basis(direction);
            (direction, u * p.x + v * p.y)
        };
        let density = |direction: Vec3, point: Vec3| {
            let pdf = if self.beside {
                aside_density(self.radius, across(direction, point).length())
            } else {
                1.0 / (PI * f64::from(self.radius).powi(2))
            };
            pdf * self.dome.as_ref().map_or(1.0 / (4.0 * PI), |dome| dome.density_of(-direction).into())
        };
        let (direction, point, density) = Eye::mixed(eye, rng, others, density);
        let direction = direction.normalize();
        let p = across(direction, point);
        let (radiance, tint) = match &self.dome {
            None => (self.radiance, Vec3::ONE),
            Some(dome) => {
                let light = dome.radiance(-direction);
                let grey = luminance(light.as_dvec3().to_array());
                (grey, if grey > 0.0 { light / grey as f32 } else { Vec3::ONE })
            }
        };
        // Beyond all surfaces nothing sends light back.
        let power = if p.length() > self.far { 0.0 } else { radiance / density };
        let origin = p - direction * self.far;
        Start { ray: Ray { origin, direction }, power, tint, counted: false, scattered: true, from_air: false }
    }
}
