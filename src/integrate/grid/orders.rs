//! Orders of scattering: what has scattered alike often is smoothed alike; and in what media it is followed.

use crate::photon::SimilarMedia;
use crate::scene::Scene;
use glam::DVec3;

/// The last order of each class of light, and the usual standard deviation of its kernel in mean free paths.
const ALL: [(u64, f64); 5] = [(2, 0.55), (4, 0.8), (8, 1.2), (16, 1.7), (u64::MAX, 2.4)];
/// The same where light is followed in similar media: they count fewer scatterings.
const SIMILAR: [(u64, f64); 3] = [(OWN, 0.8), (OWN + 2, 1.2), (u64::MAX, 2.2)];
/// Media may be as far from the scene's as this where so many photons are followed, and less by this power of their number where they are more,
/// so that what that is off by falls as noise does. From [`EXACT`] on light keeps to the scene's own.
const FARTHEST: f64 = 0.97;
const FEW: f64 = 200e3;
const NEARER: f64 = 0.1;
const EXACT: f64 = 12e6;
/// By how much light in the farthest may be off: so much it was found to be, in blocks of pixels, against the path tracer. It falls about as the
/// cube of how far they are.
const OFF: f64 = 0.016;
/// Scatterings of which light remembers the directions, in the scene's own media, before similar ones pass for them.
pub(super) const OWN: u64 = 2;

/// How the orders of a field are dealt with.
#[derive(Debug)]
pub(super) struct Orders {
    /// With how far they are ([`crate::scene::Similar::to`]).
    similar: Option<(SimilarMedia, f64)>,
    classes: &'static [(u64, f64)],
}

impl Orders {
    /// All of them in the scene's own media.
    pub fn own() -> Self {
        Orders { similar: None, classes: &ALL }
    }

    /// In similar media, where the scene has peaked phase functions and photons are not too many for them.
    pub fn similarly(scene: &Scene, origin: DVec3, photons: u64) -> Self {
        let part = FARTHEST * (FEW / (photons as f64).max(FEW)).powf(NEARER);
        let similar = if photons as f64 >= EXACT { None } else { SimilarMedia::of(scene, part, origin) };
        similar.map_or_else(Orders::own, |similar| Orders { similar: Some((similar, part)), classes: &SIMILAR })
    }

    /// How far the similar media are from the scene's.
    pub fn part(&self) -> Option<f64> {
        self.similar.as_ref().map(|similar| similar.1)
    }

    /// By what share of itself light in similar media may be off.
    pub fn off(&self) -> f32 {
        self.part().map_or(0.0, |part| OFF * (part / FARTHEST).powi(3)) as f32
    }

    /// How many classes there are.
    pub fn count(&self) -> usize {
        self.classes.len()
    }

    /// The standard deviation of a class's kernel in mean free paths, where so many photons start over each square mean free path. The kernel that
    /// is best grows slowly as they get fewer: with twicing its bias falls as a high power of its width.
    pub fn kernel(&self, class: usize, crowd: f64) -> f64 {
        let (usual, power) = if self.similar.is_some() { (100.0, 1.0 / 8.0) } else { (200.0, 1.0 / 11.0) };
        self.classes[class].1 * (usual / crowd).powf(power).clamp(0.4, 2.0)
    }

    /// The class of an order of scattering.
    #[inline]
    pub fn class(&self, order: u64) -> usize {
        self.classes.iter().filter(|&&(last, _)| last < order).count()
    }

    /// The media through which light is followed from [`OWN`] scatterings on, and seen.
    #[inline]
    pub fn similar(&self) -> Option<&SimilarMedia> {
        self.similar.as_ref().map(|similar| &similar.0)
    }
}
