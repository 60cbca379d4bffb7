//! What the report says about a picture.

use super::duration;
use crate::integrate::photon::Lighting;
use crate::integrate::{Integrator, RenderSettings, Rendering};
use serde::Serialize;

/// Student's quantile of 95 % for the groups of photons, which are 16; and for samples, which are many.
const OF_GROUPS: f64 = 2.131;
const OF_SAMPLES: f64 = 1.96;

/// A picture: what it took, how wrong it may be, and what half the error would take.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Render {
    /// How light was followed.
    pub integrator: Integrator,
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Samples a pixel.
    pub spp: u32,
    /// Camera rays.
    pub samples: u64,
    /// Collisions with media.
    pub collisions: u64,
    /// Paths cut after very many collisions; their light is missing.
    pub truncated: u64,
    /// Samples of a grid above their majorant, each a bias; 0 by construction.
    pub majorant_violations: u64,
    /// The mean luminance of the picture, W m^-2 sr^-1.
    pub mean_radiance: f64,
    /// The relative standard error of a pixel: [`crate::film::Film::relative_error`]; absent where one sample cannot tell.
    pub relative_error: Option<f64>,
    /// How many standard errors to either side hold the truth of 95 % of pixels (Student's quantile).
    pub interval_95: f64,
    /// How long it took.
    pub seconds: f64,
    /// Camera rays a second.
    pub samples_per_second: f64,
    /// The photons that lit it, where any did; what stored ones blur over the distances between them is in no error here.
    pub photons: Option<Lighting>,
    /// Samples a pixel that would halve `relative_error`; with stored photons, four times as many of those too, and in an estimate.
    pub spp_for_half: u64,
    /// About how many seconds that would take.
    pub seconds_for_half: f64,
}

impl Render {
    /// The account of a picture that took so many seconds.
    pub fn of(settings: &RenderSettings, rendering: &Rendering, seconds: f64) -> Self {
        Render {
            integrator: settings.integrator,
            width: settings.width,
            height: settings.height,
            spp: settings.spp,
            samples: rendering.samples,
            collisions: rendering.collisions,
            truncated: rendering.truncated,
            majorant_violations: rendering.violations,
            mean_radiance: rendering.film.mean(),
            relative_error: rendering.film.relative_error().filter(|_| settings.spp > 1),
            interval_95: if rendering.photons.is_some() { OF_GROUPS } else { OF_SAMPLES },
            seconds,
            samples_per_second: rendering.samples as f64 / seconds.max(1e-9),
            photons: rendering.photons,
            // The error of independent samples falls as their root.
            spp_for_half: 4 * u64::from(settings.spp),
            seconds_for_half: 4.0 * seconds,
        }
    }

    /// The line of the table for people.
    pub(super) fn line(&self) -> String {
        let cut = match self.truncated {
            0 => String::new(),
            n => format!("; {n} paths cut after very many collisions"),
        };
        let known = self.relative_error.map_or(String::new(), |error| {
            let (spp, seconds) = (self.spp_for_half, duration(self.seconds_for_half));
            let photons = self.photons.map_or(String::new(), |p| match p.voxels {
                0 => format!(", --photons {} and --estimate {}", 4 * p.stored, 4 * p.estimate),
                _ => format!(" and --photons {}", 4 * p.emitted),
            });
            format!("; a pixel is known to {:.2} %, and {spp} samples{photons} would halve that in about {seconds}", 100.0 * error)
        });
        let lit = self.photons.map_or(String::new(), |p| match p.voxels {
            0 => format!("lit by    {} stored photons, {} in an estimate; what they blur is not in the error\n", p.stored, p.estimate),
            _ => format!("lit by    {} photons in {} voxels\n", p.emitted, p.voxels),
        });
        let (width, height, spp) = (self.width, self.height, self.spp);
        format!("picture   {width} x {height}, {spp} samples a pixel, {:.3e} a second{known}{cut}\n{lit}", self.samples_per_second)
    }
}
