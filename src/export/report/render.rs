//! What the report says about a picture.

use super::{Stage, duration};
use crate::integrate::photon::Lighting;
use crate::integrate::{Integrator, RenderSettings, Rendering};
use serde::Serialize;

/// Student's quantile of 95 % for the groups of photons, which are 16; and for samples, which are many.
const OF_GROUPS: f64 = 2.131;
const OF_SAMPLES: f64 = 1.96;

/// A picture: what it took, how wrong it may be, and what less error would take.
#[derive(Debug, Clone, PartialEq, Serialize)]
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
    /// What of that is noise.
    pub relative_noise: Option<f64>,
    /// How that is known.
    pub noise_by: &'static str,
    /// What of `relative_error` is no noise; 0 where there is none, absent where it is not known.
    pub relative_bias: Option<f64>,
    /// How that is known.
    pub bias_by: &'static str,
    /// How many standard errors to either side hold the truth of 95 % of pixels (Student's quantile).
    pub interval_95: f64,
    /// How long it took, with quicker pictures that came before.
    pub seconds: f64,
    /// Its own seconds by stage.
    pub stages: Vec<Stage>,
    /// Camera rays a second.
    pub samples_per_second: f64,
    /// The photons that lit it, where any did.
    pub photons: Option<Lighting>,
    /// What less error would take.
    pub forecast: Vec<Level>,
    /// What was forecast of it by quicker pictures, where it was to reach an error or to fill a time.
    pub expected: Option<Expected>,
    /// The flags that make the same picture again, in place of those that said what to reach.
    pub repeat: Option<String>,
    /// The share of pixels that were done where it was interrupted; the others have fewer samples and photons.
    pub finished: Option<f64>,
}

/// A picture that would be better.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Level {
    /// The relative error of a pixel.
    pub relative_error: f64,
    /// About how many seconds that would take.
    pub seconds: f64,
    /// The photons, where they are not those of the run.
    pub photons: Option<u64>,
    /// Samples a pixel.
    pub spp: u64,
    /// Photons in an estimate, where there are any.
    pub estimate: Option<u64>,
}

/// What was forecast of a picture.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Expected {
    /// The relative error of a pixel.
    pub relative_error: f64,
    /// Its seconds, with those of the quicker pictures.
    pub seconds: f64,
}

impl Render {
    /// The account of a picture that took so many seconds.
    pub fn of(settings: &RenderSettings, rendering: &Rendering, seconds: f64) -> Self {
        let film = &rendering.film;
        let known = |error: Option<f64>| error.filter(|_| settings.spp > 1);
        let (relative_bias, bias_by) = match settings.integrator {
            Integrator::Path => (Some(0.0), "an unbiased path tracer"),
            Integrator::Grid => (
                known(film.relative_bias()),
                "what two more fits of smoothing's kernels still gave back, and what similar media are off by",
            ),
            Integrator::Photon => (known(film.relative_bias()), "what twice as wide a look at every eighth photon changes"),
        };
        let relative_error = known(film.relative_error());
        // As many times the photons as of them in an estimate: half the noise, as much blur.
        let four_times = |p: Lighting| Level {
            relative_error: (known(film.relative_noise()).unwrap_or_default() / 2.0).hypot(relative_bias.unwrap_or_default()),
            seconds: 4.0 * seconds,
            photons: Some(4 * p.stored),
            spp: 4 * u64::from(settings.spp),
            estimate: Some(4 * p.estimate),
        };
        let stored = rendering.photons.filter(|_| settings.integrator == Integrator::Photon && relative_error.is_some());
        Render {
            integrator: settings.integrator,
            width: settings.width,
            height: settings.height,
            spp: settings.spp,
            samples: rendering.samples,
            collisions: rendering.collisions,
            truncated: rendering.truncated,
            majorant_violations: rendering.violations,
            mean_radiance: film.mean(),
            relative_error,
            relative_noise: known(film.relative_noise()),
            noise_by: if rendering.photons.is_some() {
                "16 independent groups of photons, and independent samples"
            } else {
                "independent samples"
            },
            relative_bias,
            bias_by,
            interval_95: if rendering.photons.is_some() { OF_GROUPS } else { OF_SAMPLES },
            seconds,
            stages: Vec::new(),
            samples_per_second: rendering.samples as f64 / seconds.max(1e-9),
            photons: rendering.photons,
            forecast: stored.map(four_times).into_iter().collect(),
            expected: None,
            repeat: None,
            finished: None,
        }
    }

    /// What the table for people says of the picture.
    pub(super) fn line(&self) -> String {
        let cut = match self.truncated {
            0 => String::new(),
            n => format!("; {n} paths cut after very many collisions"),
        };
        let lit = self.photons.map_or(String::new(), |p| match p.voxels {
            0 if p.stored == 0 => String::new(),
            0 => format!("lit by    {} stored photons, {} in an estimate\n", p.stored, p.estimate),
            _ => format!("lit by    {} photons in {} voxels\n", p.emitted, p.voxels),
        });
        let (width, height, spp) = (self.width, self.height, self.spp);
        format!("picture   {width} x {height}, {spp} samples a pixel, {:.3e} a second{cut}\n{lit}", self.samples_per_second)
    }

    /// What it says last: the error that was reached, what it took, and what less would take.
    pub(super) fn cost(&self) -> String {
        let (Some(error), Some(noise)) = (self.relative_error, self.relative_noise) else { return String::new() };
        let bias = match (self.integrator, self.relative_bias) {
            (Integrator::Path, _) => "no bias".into(),
            (Integrator::Photon, Some(bias)) => format!("stored photons blur by {}", percent(bias)),
            (_, bias) => format!("smoothing may be off by {}", percent(bias.unwrap_or_default())),
        };
        let stages: Vec<String> =
            self.stages.iter().filter(|s| s.seconds >= 0.005).map(|s| format!("{} {:.2}", s.stage, s.seconds)).collect();
        let mut t = format!("a pixel   is known to {}: {} noise ({}), {bias}\n", percent(error), percent(noise), self.noise_by);
        let levels: Vec<String> =
            self.forecast.iter().map(|l| format!("{} would take about {}", percent(l.relative_error), duration(l.seconds))).collect();
        let more = if levels.is_empty() { String::new() } else { format!("; {}", levels.join(", ")) };
        t += &format!("cost      {} in {} ({}){more}\n", percent(error), duration(self.seconds), stages.join(", "));
        if let Some(repeat) = &self.repeat {
            t += &format!("again by  {repeat}\n");
        }
        t
    }
}

/// A share in per cent, with two significant digits.
pub fn percent(share: f64) -> String {
    let rounded: f64 = format!("{:.1e}", 100.0 * share).parse().unwrap_or(100.0 * share);
    format!("{rounded} %")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_have_two_digits() {
        assert_eq!([0.02913, 0.0051, 0.5, 0.00001234, 0.0].map(percent), ["2.9 %", "0.51 %", "50 %", "0.0012 %", "0 %"]);
    }
}
