//! From where a camera sees a scene's regions: how nearly toward the sun, and from how near.

use crate::integrate::lens::Lens;
use crate::media::{Media, Profile, Scratch};
use crate::scene::Scene;
use glam::{DVec3, Vec3};

/// The angles of the turn from the sunlight to the camera, at the point of the regions where it is least, below which light that is on its way so
/// shows what it has kept of its peak, degrees; and after how many scatterings similar media may pass for the scene's.
const KEPT_PEAKS: [(f64, u64); 3] = [(25.0, 6), (55.0, 4), (f64::INFINITY, FEWEST)];
/// At least so many.
pub(super) const FEWEST: u64 = 2;
/// Where peaks are seen, light is smoothed over no more than this part of a peak's width, as the camera sees it.
const BLUR: f64 = 0.3;
/// Regions are at least so far away, over their radius.
const NEAR: f64 = 0.1;
/// What lies behind so much optical depth is not looked at for that.
const DEEP: f64 = 30.0;
/// Rays across a picture, and down it, by which it is found what extinction is usual.
const RAYS: u32 = 24;

/// From where regions are seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Aspect {
    /// How often light is to scatter in the scene's own media before similar ones, that keep no peak, pass for them: the more often, the more nearly
    /// the camera looks toward the sun.
    pub own: u64,
    /// Over what distance light that keeps a peak may be smoothed at most, m.
    pub sharp: f64,
    /// Whether the camera is within the regions' bounds.
    pub within: bool,
}

impl Aspect {
    /// For a camera at `eye`, relative to the middle of the regions. Lamps and images of a sky may be anywhere.
    pub fn of(scene: &Scene, eye: Vec3) -> Self {
        let half = 0.5 * scene.region_bounds().size();
        let (distance, radius) = (f64::from(eye.length()), half.length());
        let gap = (eye.as_dvec3().abs() - half).max(DVec3::ZERO).length();
        let aside = scene.sun.direction.normalize().dot(eye.as_dvec3() / distance);
        // At the point of the regions that the camera sees most against the sun.
        let turn = (aside.clamp(-1.0, 1.0).acos() - (radius / distance).min(1.0).asin()).to_degrees();
        let within = gap == 0.0;
        let turn = match (!scene.lamps.is_empty() || scene.dome.is_some() || within, scene.sun.shines()) {
            (true, _) => 0.0,
            (false, true) => turn,
            (false, false) => 180.0,
        };
        let own = KEPT_PEAKS.iter().find(|(below, _)| turn < *below).map_or(KEPT_PEAKS[0].1, |peaks| peaks.1);
        let width = 1.0 - scene.regions.iter().map(|r| r.medium.g).fold(0.0, f64::max);
        let sharp = if own > FEWEST { BLUR * width * gap.max(NEAR * radius) } else { f64::INFINITY };
        Aspect { own, sharp, within }
    }
}

/// The mean extinction that camera rays meet, 1/m, up to an optical depth of [`DEEP`]: by rays spread over the picture.
pub(super) fn usual_extinction(media: &Media, lens: &Lens, size: [u32; 2]) -> f64 {
    let (mut scratch, mut profile) = (Scratch::default(), Profile::default());
    let (mut squares, mut depth) = (0.0, 0.0);
    for i in 0..RAYS * RAYS {
        let [x, y] = [i % RAYS, i / RAYS].map(|i| (i as f32 + 0.5) / RAYS as f32);
        let view = lens.view(x * size[0] as f32, y * size[1] as f32);
        media.profile(&view.ray, view.reach, (DEEP, DEEP), &mut scratch, &mut profile);
        let met = profile.met();
        (squares, depth) = (squares + met.0, depth + met.1);
    }
    if depth > 0.0 { squares / depth } else { 0.0 }
}
