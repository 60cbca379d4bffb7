//! Light from all sides, of which photons that fly toward the camera matter most: a region that scatters forward sends on what comes from
//! behind it.

use super::trace::Tracer;
use crate::rng::Rng;
use crate::sampling::around;
use crate::scene::phase::{henyey_greenstein, one_minus_cos, sample_henyey_greenstein};
use glam::Vec3;

/// The share of directions that are drawn toward the camera.
const SHARE: f64 = 0.25;
/// Phase functions with a mean cosine below this have no peak worth aiming at.
const PEAKED: f64 = 0.3;

/// The directions in which light passes the regions on its way to a camera.
#[derive(Debug, Clone, Copy)]
pub(super) struct Eye {
    axis: Vec3,
    /// The mean cosine about the axis.
    g: f64,
}

impl Eye {
    /// A direction; `others` draws one, whose density `pdf` tells, where it is not toward the camera. With the density of the mixture, 1/sr.
    pub fn mixed(eye: Option<&Eye>, rng: &mut Rng, others: impl FnOnce(&mut Rng) -> Vec3, pdf: impl FnOnce(Vec3) -> f64) -> (Vec3, f64) {
        let Some(eye) = eye else {
            let direction = others(rng);
            return (direction, pdf(direction));
        };
        let direction = if rng.uniform() < SHARE {
            let (cos, sin) = sample_henyey_greenstein(eye.g, rng.uniform());
            around(eye.axis, cos as f32, sin as f32, rng.uniform_f32())
        } else {
            others(rng)
        };
        let own = henyey_greenstein(eye.g, one_minus_cos(eye.axis, direction));
        (direction, SHARE * own + (1.0 - SHARE) * pdf(direction))
    }
}

impl Tracer {
    /// The tracer of photons for a camera at `eye`, relative to the scene's origin: the sky's and the air's are sent toward it more often.
    pub fn seen_from(mut self, eye: Vec3) -> Self {
        let g = (0..self.tiles.len() as u32).map(|region| self.media.optics(region).g).fold(0.0, f64::max);
        let distance = eye.length();
        // From within the regions, or close by, no direction stands out.
        let radius = self.emitter.aim().map_or(f32::INFINITY, |aim| aim.radius);
        let narrow = f64::from(distance / (distance + radius));
        let worth = g * narrow > PEAKED && distance > radius;
        self.eye = worth.then(|| Eye { axis: eye / distance, g: g * narrow });
        self
    }
}
