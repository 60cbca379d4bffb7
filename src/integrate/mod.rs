//! Integrators: from a scene to what a camera sees of it, and to where its energy goes.

pub mod flux;

use crate::error::Result;
use crate::film::Film;
use crate::plan::Plan;
use crate::progress::Progress;
use crate::scene::{Camera, Scene};

/// How light is followed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Integrator {
    /// The reference: unbiased path tracing.
    #[default]
    Path,
}

/// How a picture is made.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct RenderSettings {
    /// How light is followed.
    pub integrator: Integrator,
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Samples a pixel.
    pub spp: u32,
    /// The seed.
    pub seed: u64,
}

/// A picture, and what it took.
#[derive(Debug, Clone)]
pub struct Rendering {
    /// The picture.
    pub film: Film,
    /// Camera rays.
    pub samples: u64,
    /// Collisions with media.
    pub collisions: u64,
    /// Paths cut after very many collisions; their light is missing.
    pub truncated: u64,
}

/// Renders a scene as `camera` sees it.
///
/// # Errors
/// [`crate::Error::Interrupted`].
pub fn render(_: &Scene, _: &Plan, _: &Camera, _: &RenderSettings, _: &dyn Progress) -> Result<Rendering> {
    unimplemented!()
}
