//! Integrators: from a scene to what a camera sees of it, and to where its energy goes.

mod band;
pub mod flux;
mod lens;
mod path;
mod sunlight;

use crate::error::Result;
use crate::film::{Film, NOTHING, Pixel};
use crate::media::Scratch;
use crate::plan::Plan;
use crate::progress::Progress;
use crate::rng::{Rng, Stage};
use crate::scene::{Camera, Scene};
use glam::{DVec3, Vec3};
use lens::{Lens, View};
use path::PathTracer;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};

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
    /// Samples of a grid above the majorant that they were met under; each would be a bias.
    pub violations: u64,
}

/// Pixels along a side of a tile: the item that has a stream of random numbers of its own.
const TILE: u32 = 8;
/// Samples of a pixel that also measure the transmittance, exactly along each ray.
const CLEAR: u32 = 8;

/// Renders a scene as `camera` sees it.
///
/// # Errors
/// [`crate::Error::Interrupted`].
pub fn render(scene: &Scene, plan: &Plan, camera: &Camera, settings: &RenderSettings, progress: &dyn Progress) -> Result<Rendering> {
    let tracer = PathTracer::new(scene, plan);
    let (width, height) = (settings.width, settings.height);
    let lens = Lens::new(camera, width, height, tracer.origin);
    let (across, down) = (width.div_ceil(TILE), height.div_ceil(TILE));
    progress.begin("render", u64::from(width) * u64::from(height));
    let done = AtomicU64::new(0);
    let tiles: Vec<Tile> = (0..across * down)
        .into_par_iter()
        .map(|tile| {
            let mut rng = Rng::new(settings.seed, Stage::Render, tile.into());
            let mut out = Tile::default();
            let (x0, y0) = (tile % across * TILE, tile / across * TILE);
            for y in y0..(y0 + TILE).min(height) {
                for x in x0..(x0 + TILE).min(width) {
                    if progress.cancelled() {
                        return out;
                    }
                    out.pixel(&tracer, &lens, (x, y), settings.spp, &mut rng, progress);
                }
            }
            progress.at(done.fetch_add(out.pixels.len() as u64, Ordering::Relaxed) + out.pixels.len() as u64);
            out
        })
        .collect();
    progress.check()?;
    let mut film = Film { width, height, pixels: vec![Pixel::default(); (width * height) as usize], sky: tracer.sky.max_element() > 0.0 };
    for (tile, out) in (0..).zip(&tiles) {
        let (x0, y0) = (tile % across * TILE, tile / across * TILE);
        let columns = TILE.min(width - x0);
        for (i, pixel) in (0..).zip(&out.pixels) {
            film.pixels[((y0 + i / columns) * width + x0 + i % columns) as usize] = *pixel;
        }
    }
    let sum = |of: fn(&Tile) -> u64| tiles.iter().map(of).sum();
    Ok(Rendering {
        film,
        samples: u64::from(width) * u64::from(height) * u64::from(settings.spp),
        collisions: sum(|t| t.collisions),
        truncated: sum(|t| t.truncated),
        violations: sum(|t| t.scratch.violations),
    })
}

/// What one tile gives.
#[derive(Debug, Default)]
struct Tile {
    pixels: Vec<Pixel>,
    collisions: u64,
    truncated: u64,
    scratch: Scratch,
}

impl Tile {
    /// Renders one pixel: all its samples, summed in f64.
    fn pixel(&mut self, tracer: &PathTracer, lens: &Lens, (x, y): (u32, u32), spp: u32, rng: &mut Rng, progress: &dyn Progress) {
        let (mut light, mut squares) = ([DVec3::ZERO; 4], DVec3::ZERO);
        let (mut depth, mut events) = (0.0f64, 0u32);
        let (mut through, mut opaque) = (0.0f64, 0u32);
        for sample in 0..spp {
            if sample % 64 == 63 && progress.cancelled() {
                break;
            }
            let view = lens.view(x as f32 + rng.uniform_f32(), y as f32 + rng.uniform_f32());
            if sample < CLEAR {
                let (share, surface) = self.clear(tracer, &view);
                (through, opaque) = (through + share, opaque + u32::from(surface));
            }
            let mut sum = Vec3::ZERO;
            for band in &tracer.bands {
                let arrival = tracer.radiance(band, view.ray, view.reach, rng, &mut self.scratch);
                for (layer, arrived) in light.iter_mut().zip(arrival.light) {
                    *layer += arrived.as_dvec3();
                    sum += arrived;
                }
                if let Some(distance) = arrival.depth {
                    (depth, events) = (depth + f64::from(view.near + distance * view.cos), events + 1);
                }
                self.collisions += arrival.collisions;
                self.truncated += u64::from(arrival.truncated);
            }
            squares += sum.as_dvec3() * sum.as_dvec3();
        }
        let n = f64::from(spp);
        let rgb = |sum: DVec3| (sum / n).as_vec3().to_array();
        let mean = light.iter().copied().sum::<DVec3>() / n;
        let variance = (squares / n - mean * mean).max(DVec3::ZERO) / (n - 1.0);
        let clear = f64::from(spp.min(CLEAR));
        self.pixels.push(Pixel {
            volume_direct: rgb(light[0]),
            volume_indirect: rgb(light[1]),
            surface: rgb(light[2]),
            environment: rgb(light[3]),
            // One sample does not know its error.
            standard_error: if spp > 1 {
                DVec3::from_array(variance.to_array().map(f64::sqrt)).as_vec3().to_array()
            } else {
                [f32::INFINITY; 3]
            },
            transmittance: (through / clear) as f32,
            opaque: (f64::from(opaque) / clear) as f32,
            depth: if events > 0 { (depth / f64::from(events)) as f32 } else { NOTHING },
        });
    }

    /// The transmittance along a camera ray up to a surface, or to the end; and whether there is a surface. The mean of the bands.
    fn clear(&mut self, tracer: &PathTracer, view: &View) -> (f64, bool) {
        let hit = tracer.surfaces.nearest(&view.ray, view.reach);
        let reach = hit.map_or(view.reach, |h| h.t);
        let depths = tracer.bands.iter().map(|band| band.media.optical_depth(&view.ray, reach, &mut self.scratch));
        let sum = depths.fold(0.0, |sum, depth| sum + (-depth).exp());
        (sum / tracer.bands.len() as f64, hit.is_some())
    }
}
