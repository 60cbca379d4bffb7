//! Light of flames at the events of a path: a point of them is looked at, beyond the distance within which paths find them.

use super::band::Band;
use super::sunlight::past;
use crate::geom::Ray;
use crate::media::{Fire, Scratch};
use crate::rng::Rng;
use crate::trimesh::TriMesh;
use glam::Vec3;
use std::f64::consts::PI;

/// What an event at `p` brings that sends on a share `sent` of the light from a direction, 1/sr, of what shines farther away than `near` m; an
/// unbiased estimate.
#[allow(clippy::too_many_arguments)]
pub(super) fn look(
    fire: &Fire,
    band: &Band,
    surfaces: &TriMesh,
    (p, near): (Vec3, f32),
    sent: impl Fn(Vec3) -> f64,
    rng: &mut Rng,
    scratch: &mut Scratch,
) -> Vec3 {
    if near == f32::INFINITY {
        return Vec3::ZERO;
    }
    let (there, tint) = fire.sample(rng);
    let (way, distance) = (there - p, there.distance(p));
    if distance <= near || distance == 0.0 {
        return Vec3::ZERO;
    }
    let toward = way / distance;
    let share = sent(toward) as f32 / (distance * distance);
    if share <= 0.0 {
        return Vec3::ZERO;
    }
    let clear = past(band, surfaces, p, toward, distance);
    if clear == Vec3::ZERO {
        return clear;
    }
    let ray = Ray { origin: p, direction: toward };
    // The power of all, over all directions.
    let strength = (fire.power() / (4.0 * PI)) as f32;
    tint * strength * share * clear * band.media.clear(&ray, distance, rng, scratch) as f32
}
