//! The thesis's second research question: what is saved by rendering only what receives light that scattered more than once, and
//! what is lost.

use super::Job;
use super::one::{Given, How, Taken, take};
use super::thesis::{SAMPLES, SIZE};
use crate::error::Result;
use crate::film::{Film, Pixel};
use crate::integrate::Integrator;
use crate::integrate::photon::Gathering;
use crate::photon::Model;
use crate::plan::Density;
use crate::progress::Progress;
use crate::scene::medium::luminance;
use crate::stats::Estimate;
use serde::Serialize;

/// Photons and photons in an estimate: those of tests 4 to 6.
const PHOTONS: (u64, u64) = (100_000, 500);
/// The side of a block in pixels.
const BLOCK: usize = 8;
/// Samples a pixel of the reference.
const REFERENCE: u32 = 256;
/// The relative error of a pixel at which costs are compared.
pub(super) const EQUAL: f64 = 0.10;

/// A layout with and without the duality, at the same settings, in the physical model.
#[derive(Debug, Clone, Serialize)]
pub struct Savings {
    /// Regions of the layout.
    pub regions: usize,
    /// Photons stored, in either picture.
    pub photons: u64,
    /// Photons in an estimate.
    pub estimate: u64,
    /// The layout itself.
    pub source: Side,
    /// The regions that the duality makes of it.
    pub duality: Side,
    /// The mean radiance of the layout by the path tracer, W m^-2 sr^-1.
    pub reference: f64,
    /// The relative standard error of the reference's mean radiance.
    pub reference_error: f64,
}

/// One picture by the photon integrator.
#[derive(Debug, Clone, Serialize)]
pub struct Side {
    /// Regions shown.
    pub regions: u64,
    /// Searches of the photon map.
    pub queries: u64,
    /// Of the duality, where there is one, and the picture.
    pub seconds: f64,
    /// The relative standard error of a pixel, as the film states it.
    pub relative_error: f64,
    /// Queries that an error of a tenth would take: they go as the inverse square of the error.
    pub queries_at_equal: f64,
    /// Seconds likewise; those before the picture do not grow.
    pub seconds_at_equal: f64,
    /// The mean radiance over the reference's, less 1.
    pub mean_difference: f64,
    /// The root mean square of what blocks of 8 x 8 pixels differ from the reference by, over the reference's mean.
    pub block_difference: f64,
    /// The share of sunlight that crosses the medium without a collision.
    pub sunlight: Estimate,
}

/// Compares a layout with its duality. The films: the layout's, the duality's, the reference.
pub(super) fn compare(given: &Given, job: &Job, progress: &dyn Progress) -> Result<(Savings, [Film; 3])> {
    let (photons, estimate) = PHOTONS;
    let how = How {
        integrator: Integrator::Photon,
        model: Model::Physical,
        gather: Gathering::March,
        photons,
        estimate,
        size: SIZE,
        spp: SAMPLES,
        seed: job.seed,
    };
    let source = take(given, Density::Source, &how, progress)?;
    let duality = take(given, Density::Duality, &how, progress)?;
    let reference = take(given, Density::Source, &How { integrator: Integrator::Path, spp: REFERENCE, ..how }, progress)?;
    let nothing = [Estimate { value: 0.0, se: 0.0 }; 2];
    let [before, after] = duality.sunlight.unwrap_or(nothing);
    let savings = Savings {
        regions: given.layout.scene.regions.len(),
        photons,
        estimate,
        source: Side::of(&source, before, &reference.film),
        duality: Side::of(&duality, after, &reference.film),
        reference: reference.film.mean(),
        reference_error: reference.film.relative_error().unwrap_or(0.0) / (reference.film.pixels.len() as f64).sqrt(),
    };
    Ok((savings, [source.film, duality.film, reference.film]))
}

impl Side {
    fn of(taken: &Taken, sunlight: Estimate, reference: &Film) -> Side {
        let render = &taken.render;
        // What photons blur is no matter of how many.
        let relative_error = render.relative_noise.unwrap_or(f64::NAN);
        let grow = (relative_error / EQUAL).powi(2);
        let mean = reference.mean();
        Side {
            regions: taken.regions,
            queries: render.collisions,
            seconds: taken.seconds,
            relative_error,
            queries_at_equal: grow * render.collisions as f64,
            seconds_at_equal: taken.seconds - render.seconds + grow * render.seconds,
            mean_difference: taken.film.mean() / mean - 1.0,
            block_difference: block_rms(&taken.film, reference) / mean,
            sunlight,
        }
    }
}

/// The root mean square of the differences of two films' blocks, in mean luminance.
fn block_rms(a: &Film, b: &Film) -> f64 {
    let width = a.width as usize;
    let across = width.div_ceil(BLOCK);
    let mut sums = vec![(0.0, 0.0); across * (a.height as usize).div_ceil(BLOCK)];
    let grey = |p: &Pixel| luminance(p.combined().map(f64::from));
    for (i, (p, q)) in a.pixels.iter().zip(&b.pixels).enumerate() {
        let (x, y) = (i % width, i / width);
        let (sum, pixels) = &mut sums[y / BLOCK * across + x / BLOCK];
        (*sum, *pixels) = (*sum + grey(p) - grey(q), *pixels + 1.0);
    }
    // Blocks at the rims weigh as many pixels as they have.
    let square: f64 = sums.iter().map(|(sum, pixels)| sum * sum / pixels).sum();
    (square / a.pixels.len() as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_differ_by_their_means() {
        let film = |light: &dyn Fn(u32, u32) -> f32| {
            let pixel = |i: u32| Pixel { surface: [light(i % 20, i / 20); 3], ..Pixel::default() };
            Film { width: 20, height: 12, pixels: (0..240).map(pixel).collect(), sky: false }
        };
        let black = film(&|_, _| 0.0);
        // Even everywhere; noise that a block averages away; one block of 8 x 8 alone, and one at the rim of 4 x 4.
        assert!((block_rms(&film(&|_, _| 2.0), &black) - 2.0).abs() < 1e-6);
        assert!(block_rms(&film(&|x, y| if (x + y) % 2 == 0 { 1.0 } else { -1.0 }), &black) < 1e-6);
        let one = film(&|x, y| if x < 8 && y < 8 { 1.0 } else { 0.0 });
        assert!((block_rms(&one, &black) - (64.0f64 / 240.0).sqrt()).abs() < 1e-6);
        let rim = film(&|x, y| if x >= 16 && y >= 8 { 1.0 } else { 0.0 });
        assert!((block_rms(&black, &rim) - (16.0f64 / 240.0).sqrt()).abs() < 1e-6);
    }
}
