//! Who is told where photons fly.

use super::colour::Colour;
use super::similar::SimilarMedia;
use crate::geom::Ray;
use crate::rng::Rng;
use crate::scene::Phase;
use glam::Vec3;

/// Who is told of photons' flights, and may have some of its own.
pub trait Witness: Sync {
    /// Whether photons are stored as well.
    const KEEPS: bool;
    /// How many flights of its own begin where a surface reflects a photon.
    const OFF_SURFACE: u32 = 0;

    /// A flight along a ray, which ends after `reach` metres or not at all, of a photon of that power (before it is divided by the
    /// number of paths) and colour that has collided or bounced `events` times.
    fn flight(&self, ray: &Ray, reach: f32, power: f64, colour: Colour, events: u64, rng: &mut Rng);

    /// The media that a photon meets that has collided or bounced `events` times, where they are not the scene's own.
    fn similar(&self, _events: u64) -> Option<&SimilarMedia> {
        None
    }

    /// Whether a flight that begins at `p`, where a photon that came along `before` scatters by a phase function, is wanted in a
    /// direction of the witness's own; and the part of the photon's power that it stands for.
    fn aside(&self, _p: Vec3, _before: Vec3, _phase: Phase, _rng: &mut Rng) -> Option<(Vec3, f64)> {
        None
    }

    /// The direction of such a flight from `p`, where one is wanted.
    fn off_surface(&self, _p: Vec3, _rng: &mut Rng) -> Option<Vec3> {
        None
    }

    /// The density of all of these in a direction, 1/sr: it is their number in all.
    fn off_surface_density(&self, _p: Vec3, _direction: Vec3) -> f64 {
        0.0
    }

    /// What of the power is left to the photon's own flight in `direction`.
    fn share(&self, _p: Vec3, _before: Vec3, _direction: Vec3, _phase: Phase) -> f64 {
        1.0
    }
}

/// Photons are stored, and nobody is told.
pub(super) struct Store;

impl Witness for Store {
    const KEEPS: bool = true;

    #[inline]
    fn flight(&self, _: &Ray, _: f32, _: f64, _: Colour, _: u64, _: &mut Rng) {}
}
