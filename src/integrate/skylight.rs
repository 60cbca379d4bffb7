//! Light of the sky along paths: seen where they leave, and where the sky has bright spots also looked for at every event; the two ways
//! share by the balance heuristic (Veach 1997, 9.2).

use super::band::Band;
use super::sunlight::visible;
use crate::media::Scratch;
use crate::rng::Rng;
use crate::scene::{Dome, Scene};
use crate::trimesh::TriMesh;
use glam::{DVec3, Vec3};
use std::sync::Arc;

/// A sky whose brightest spot is less than so many times its mean is found by paths that leave.
const PEAKED: f64 = 12.0;

/// The sky, compiled.
#[derive(Debug, Clone)]
pub(super) struct Skylight {
    /// Where it is even, W m^-2 sr^-1.
    even: Vec3,
    dome: Option<Arc<Dome>>,
    /// Whether it is looked for.
    peaked: bool,
}

impl Skylight {
    pub(super) fn new(scene: &Scene) -> Self {
        let peaked = scene.dome.as_ref().is_some_and(|dome| dome.contrast() > PEAKED);
        Skylight { even: DVec3::from_array(scene.sky).as_vec3(), dome: scene.dome.clone(), peaked }
    }

    /// Whether looks at it are worth their time.
    #[inline]
    pub(super) fn peaked(&self) -> bool {
        self.peaked
    }

    /// What is seen of it in a direction.
    #[inline]
    pub(super) fn seen(&self, direction: Vec3) -> Vec3 {
        self.dome.as_ref().map_or(self.even, |dome| dome.radiance(direction))
    }

    /// What a path brings that leaves in a direction which an event drew with density `own`, 1/sr; looks have found the rest.
    #[inline]
    pub(super) fn met(&self, direction: Vec3, own: f64) -> Vec3 {
        match &self.dome {
            Some(dome) if self.peaked && own.is_finite() => {
                dome.radiance(direction) * (own / (own + f64::from(dome.density_of(direction)))) as f32
            }
            _ => self.seen(direction),
        }
    }

    /// A look at the sky from `p`: what an event brings that sends on a share `sent` of the light from a direction, 1/sr, and would draw
    /// that direction with that density.
    pub(super) fn look(
        &self,
        band: &Band,
        surfaces: &TriMesh,
        p: Vec3,
        sent: impl Fn(Vec3) -> f64,
        rng: &mut Rng,
        scratch: &mut Scratch,
    ) -> Vec3 {
        let Some(dome) = self.dome.as_ref().filter(|_| self.peaked) else { return Vec3::ZERO };
        let (toward, density) = dome.sample(rng.uniform_f32(), rng.uniform_f32());
        let toward = toward.normalize();
        let own = sent(toward);
        if own <= 0.0 {
            return Vec3::ZERO;
        }
        let weight = (own / (own + f64::from(density))) as f32;
        dome.radiance(toward) * visible(band, surfaces, p, toward, weight, rng, scratch) * weight
    }
}
