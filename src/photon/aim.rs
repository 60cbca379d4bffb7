//! What surfaces aim at: the cone of directions from a point to the regions' bounding sphere.

use crate::rng::Rng;
use crate::sampling::around;
use glam::Vec3;
use std::f64::consts::{PI, TAU};

/// The regions' bounding sphere around the origin.
#[derive(Debug, Clone, Copy)]
pub(super) struct Aim {
    pub(super) radius: f32,
}

/// A cone of directions, such as that from a point to a sphere.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cone {
    axis: Vec3,
    cos_alpha: f64,
    /// In sr.
    pub(super) solid_angle: f64,
}

impl Aim {
    /// Whether a point is inside: it sees the sphere all around.
    pub(super) fn holds(&self, p: Vec3) -> bool {
        p.length() <= self.radius
    }

    /// The cone from a point outside.
    pub(super) fn seen_from(&self, p: Vec3) -> Option<Cone> {
        if self.holds(p) {
            return None;
        }
        let distance = p.length();
        let sin2 = (f64::from(self.radius) / f64::from(distance)).powi(2).min(1.0);
        let cos_alpha = (1.0 - sin2).sqrt();
        Some(Cone { axis: -p / distance, cos_alpha, solid_angle: TAU * sin2 / (1.0 + cos_alpha) })
    }
}

impl Cone {
    /// All directions.
    pub(super) const ALL: Cone = Cone { axis: Vec3::Z, cos_alpha: -2.0, solid_angle: 4.0 * PI };

    /// The cone about an axis with that cosine of its half angle.
    pub(super) fn around(axis: Vec3, cos_alpha: f64) -> Self {
        Cone { axis, cos_alpha, solid_angle: TAU * (1.0 - cos_alpha) }
    }

    /// A direction uniform over the cone.
    pub(super) fn sample(&self, rng: &mut Rng) -> Vec3 {
        let away = rng.uniform() * self.solid_angle / TAU;
        let sin = (away * (2.0 - away)).max(0.0).sqrt();
        around(self.axis, (1.0 - away) as f32, sin as f32, rng.uniform_f32())
    }

    /// Whether a direction (unit length) lies in the cone.
    pub(super) fn holds(&self, direction: Vec3) -> bool {
        f64::from(direction.dot(self.axis)) > self.cos_alpha
    }
}
