//! The energy balance: where the sunlight goes that meets the media.

use crate::error::Result;
use crate::plan::Plan;
use crate::progress::Progress;
use crate::scene::Scene;
use crate::stats::Estimate;

/// The energy balance of a scene: shares of the sunlight that crosses the media's bounds. They add up to 1.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Flux {
    /// Leaves upward.
    pub up: Estimate,
    /// Leaves downward, neither scattered nor reflected.
    pub down_direct: Estimate,
    /// Leaves downward, scattered or reflected at least once.
    pub down_diffuse: Estimate,
    /// Is absorbed in media.
    pub absorbed_medium: Estimate,
    /// Is absorbed by surfaces.
    pub absorbed_surface: Estimate,
    /// The mean length of the way inside the media, m.
    pub mean_path_length: Estimate,
    /// The mean number of scatterings.
    pub mean_scatterings: Estimate,
    /// Photons that crossed the bounds.
    pub photons: u64,
    /// Collisions.
    pub collisions: u64,
    /// Paths cut after very many collisions, counted as absorbed in media.
    pub truncated: u64,
}

/// The energy balance by `photons` emitted photons.
///
/// # Errors
/// [`crate::Error::Interrupted`]; [`crate::Error::Scene`] where no light reaches the media.
pub fn flux(_: &Scene, _: &Plan, _photons: u64, _seed: u64, _: &dyn Progress) -> Result<Flux> {
    unimplemented!()
}
