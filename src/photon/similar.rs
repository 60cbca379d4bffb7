//! The media of a scene as light meets them that has scattered before.

use crate::media::Media;
use crate::scene::{Phase, Region, Scene, Similar};
use glam::DVec3;
use std::sync::Arc;

/// Media of the same shapes in which light spreads alike by fewer scatterings ([`Similar`]).
#[derive(Debug)]
pub struct SimilarMedia {
    /// Their extinctions and albedos.
    pub media: Arc<Media>,
    /// Of each region; and its extinction over that of the scene's.
    phases: Vec<(Phase, f64)>,
    /// The least of these.
    thinnest: f64,
}

impl SimilarMedia {
    /// Those of a scene, relative to `origin`, as far from it as `part` says ([`Similar::to`]); `None` where phase functions have no peak, or
    /// absorption has a colour.
    pub fn of(scene: &Scene, part: f64, origin: DVec3) -> Option<Self> {
        let similar: Vec<Similar> = scene.regions.iter().map(|r| Similar::to(r.medium.g, part)).collect();
        let even =
            |r: &Region| r.medium.sigma_a.iter().zip(r.medium.sigma_s).all(|(a, s)| a * r.medium.sigma_s[0] == r.medium.sigma_a[0] * s);
        if similar.iter().all(|s| s.straight == 0.0) || !scene.regions.iter().all(even) {
            return None;
        }
        let one = |(region, similar): (&Region, &Similar)| Region { medium: similar.medium(&region.medium), ..region.clone() };
        let regions: Vec<Region> = scene.regions.iter().zip(&similar).map(one).collect();
        let ratio = |(own, other): (&Region, &Region)| other.medium.sigma_t() / own.medium.sigma_t().max(f64::MIN_POSITIVE);
        let ratios: Vec<f64> = scene.regions.iter().zip(&regions).map(ratio).collect();
        let thinnest = ratios.iter().copied().filter(|&ratio| ratio > 0.0).fold(1.0, f64::min);
        let phases = similar.iter().map(|s| s.phase).zip(ratios).collect();
        Some(SimilarMedia { media: Arc::new(Media::new(&regions, origin)), phases, thinnest })
    }

    /// How a region scatters.
    #[inline]
    pub fn phase(&self, region: u32) -> Phase {
        self.phases[region as usize].0
    }

    /// A region's extinction over that of the scene's.
    #[inline]
    pub fn ratio(&self, region: u32) -> f64 {
        self.phases[region as usize].1
    }

    /// The least of these.
    pub fn thinnest(&self) -> f64 {
        self.thinnest
    }
}
