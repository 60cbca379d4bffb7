//! Integrators: from a scene to what a camera sees of it, and to where its energy goes.

mod band;
mod emission;
mod firelight;
pub mod flux;
mod grid;
mod lamplight;
mod lens;
mod lobe;
mod path;
pub mod photon;
mod ready;
mod skylight;
mod sunlight;
mod tile;

use crate::error::Result;
use crate::film::{Film, Pixel};
use crate::photon::PhotonMap;
use crate::plan::Plan;
use crate::progress::{Progress, share};
use crate::rng::{Rng, Stage};
use crate::scene::{Camera, Scene};
pub use emission::{Emitted, render_emission};
use glam::DVec3;
pub use grid::{Kept, Light, Part, SourceFunction, SourceSettings, harmonics, of_flow};
use lens::Lens;
use photon::{Lighting, PhotonSettings};
pub use ready::Ready;
use tile::{Done, Tile, Transport};

/// How light is followed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Integrator {
    /// The reference: unbiased path tracing.
    #[default]
    Path,
    /// The thesis's pass 2: single scattering along each ray, and stored photons for the rest.
    Photon,
    /// Photons' light toward the camera, gathered in voxels and smoothed by orders of scattering.
    Grid,
}

impl Integrator {
    /// Samples a pixel, where nobody says how many: the grid integrator's noise is its photons'.
    pub fn usual_spp(self) -> u32 {
        if self == Integrator::Grid { 16 } else { 64 }
    }
}

/// What of light's directions the voxels of [`Integrator::Grid`] keep.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Directional {
    /// What goes toward the camera, with the phase functions' peaks.
    #[default]
    View,
    /// All, by spherical harmonics of degrees 0 to 2: for any camera, and off where phase functions are peaked.
    Sh2,
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
    /// What [`Integrator::Photon`] and [`Integrator::Grid`] ask.
    pub photon: PhotonSettings,
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
    /// Samples of a grid above the majorant that they were met under; each would be a bias.
    pub violations: u64,
    /// The stored photons that lit it, where any did.
    pub photons: Option<Lighting>,
}

/// Pixels along a side of a tile: the item that has a stream of random numbers of its own.
const TILE: u32 = 8;

/// Renders a scene as `camera` sees it. [`Integrator::Photon`] lights it by photons of its own, or by those of `pass1` where
/// they are given.
///
/// # Errors
/// [`crate::Error::Interrupted`], but where [`Progress::keeps`] pixels that are done are given back, and the others are
/// [`Pixel::UNKNOWN`]; and [`crate::Error::Scene`] where photons find no region.
pub fn render(
    scene: &Scene,
    plan: &Plan,
    camera: &Camera,
    settings: &RenderSettings,
    pass1: Option<PhotonMap>,
    progress: &dyn Progress,
) -> Result<Rendering> {
    let mut ready = Ready::new(scene, plan, camera, settings, settings.photon.photons, pass1, progress)?;
    ready.brighten(progress)?;
    ready.expose(settings.spp, progress)
}

/// Every pixel of a picture; `origin` is that of the transport's local space.
fn expose<T: Transport>(
    transport: &T,
    origin: DVec3,
    scene: &Scene,
    camera: &Camera,
    settings: &RenderSettings,
    progress: &dyn Progress,
) -> Result<Rendering> {
    let (width, height) = (settings.width, settings.height);
    let lens = Lens::new(camera, width, height, origin);
    let (across, down) = (width.div_ceil(TILE), height.div_ceil(TILE));
    progress.begin("render", u64::from(width) * u64::from(height));
    let one = |item: u64| {
        let mut rng = Rng::new(settings.seed, Stage::Render, item);
        let (mut out, tile) = (Tile::default(), item as u32);
        let (x0, y0) = (tile % across * TILE, tile / across * TILE);
        for y in y0..(y0 + TILE).min(height) {
            for x in x0..(x0 + TILE).min(width) {
                if progress.cancelled() {
                    return Done::default();
                }
                out.pixel(transport, &lens, (x, y), settings.spp, &mut rng, progress);
            }
        }
        if progress.cancelled() {
            // Its last pixel may have been left early.
            return Done::default();
        }
        let violations = T::scratch(&out.room).violations;
        out.done(violations)
    };
    let pixels = u64::from(TILE * TILE);
    let tiles: Vec<Done> = share(0..u64::from(across * down), one, progress, |done| progress.at(done * pixels))?;
    if !progress.keeps() {
        progress.check()?;
    }
    let sky = scene.sky.iter().any(|&c| c as f32 > 0.0);
    let mut film = Film { width, height, pixels: vec![Pixel::UNKNOWN; (width * height) as usize], sky };
    for (tile, out) in (0..).zip(&tiles) {
        let (x0, y0) = (tile % across * TILE, tile / across * TILE);
        let columns = TILE.min(width - x0);
        for (i, pixel) in (0..).zip(&out.pixels) {
            film.pixels[((y0 + i / columns) * width + x0 + i % columns) as usize] = *pixel;
        }
    }
    let sum = |of: fn(&Done) -> u64| tiles.iter().map(of).sum();
    Ok(Rendering {
        film,
        samples: sum(|t| t.pixels.len() as u64) * u64::from(settings.spp),
        collisions: sum(|t| t.collisions),
        truncated: sum(|t| t.truncated),
        violations: sum(|t| t.violations),
        photons: None,
    })
}
