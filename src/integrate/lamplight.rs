//! Light of lamps at the events of a path: one of them is looked at from each.

use super::band::Band;
use super::sunlight::past;
use crate::geom::Ray;
use crate::media::Scratch;
use crate::rng::Rng;
use crate::scene::{Lamp, Scene};
use crate::trimesh::TriMesh;
use glam::{DVec3, Vec3};

/// The lamps, compiled.
#[derive(Debug, Clone)]
pub(super) struct Lamplight(Vec<Lamp>);

impl Lamplight {
    pub(super) fn new(scene: &Scene, origin: DVec3) -> Self {
        Lamplight(Lamp::all_from(&scene.lamps, origin))
    }

    /// What an event at `p` brings that sends on a share `sent` of the light from a direction, 1/sr; an unbiased estimate.
    #[inline]
    pub(super) fn look(
        &self,
        band: &Band,
        surfaces: &TriMesh,
        p: Vec3,
        sent: impl Fn(Vec3) -> f64,
        rng: &mut Rng,
        scratch: &mut Scratch,
    ) -> Vec3 {
        if self.0.is_empty() {
            return Vec3::ZERO;
        }
        let Some(look) = Lamp::look(&self.0, p, rng) else { return Vec3::ZERO };
        let light = look.light * sent(look.toward) as f32;
        let light = if light == Vec3::ZERO { light } else { light * past(band, surfaces, p, look.toward, look.distance) };
        if light == Vec3::ZERO {
            return light;
        }
        light * band.media.clear(&Ray { origin: p, direction: look.toward }, look.distance, rng, scratch) as f32
    }
}
