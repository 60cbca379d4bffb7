//! Photons of an even sky: from all directions alike, aimed at the regions and at what surfaces may send toward them.

use super::emit::Start;
use crate::geom::{Ray, basis};
use crate::rng::Rng;
use crate::scene::Scene;
use crate::scene::medium::luminance;
use glam::{DVec3, Vec3};
use std::f64::consts::{PI, TAU};

/// The sky, compiled.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sky {
    /// W m^-2 sr^-1.
    radiance: f64,
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
        let reach = |b: crate::geom::Bounds| (b.min - origin).abs().max((b.max - origin).abs()).length() as f32 * 1.001 + f32::MIN_POSITIVE;
        Some(Sky { radiance, radius: reach(bounds), far: reach(everything), beside: bounces && !scene.surfaces.is_empty() })
    }

    /// The power of the light that meets the regions' bounding sphere, W.
    pub fn power(&self) -> f64 {
        self.radiance * 4.0 * PI * PI * f64::from(self.radius).powi(2)
    }

    /// Starts one photon. Where light beside the regions counts, its distance from the middle has the density
    /// 1 / (2 pi r^2) (1 + rho^2 / r^2)^(-3/2), as what ground at that distance can send back falls.
    pub fn emit(&self, rng: &mut Rng) -> Start {
        let z = 1.0 - 2.0 * rng.uniform();
        let (sin, cos) = (TAU * rng.uniform()).sin_cos();
        let s = (1.0 - z * z).max(0.0).sqrt();
        let direction = DVec3::new(s * cos, s * sin, z).as_vec3().normalize();
        let (u, v) = basis(direction);
        let r2 = f64::from(self.radius).powi(2);
        let xi = rng.uniform();
        let (rho, area) = if self.beside {
            let c = 1.0 / (1.0 - xi);
            ((r2 * (c * c - 1.0).max(0.0)).sqrt(), TAU * r2 * c.powi(3))
        } else {
            ((r2 * xi).sqrt(), PI * r2)
        };
        let (sin, cos) = (TAU * rng.uniform()).sin_cos();
        let p: Vec3 = u * (rho * cos) as f32 + v * (rho * sin) as f32 - direction * (self.far + if self.beside { rho as f32 } else { 0.0 });
        // Beyond all surfaces nothing sends light back.
        let power = if self.beside && rho > 4.0 * f64::from(self.far) { 0.0 } else { self.radiance * 4.0 * PI * area };
        Start { ray: Ray { origin: p, direction }, power, counted: false, scattered: true }
    }
}
