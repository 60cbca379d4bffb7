//! What a picture by other settings would take, and how wrong it would be: extrapolated from one or two that were taken.
//!
//! Seconds are those of each stage: photons and samples cost in proportion, smoothing by voxels. The noise of samples falls as 1 / spp in
//! variance. That of photons falls more slowly than 1 / photons, as the kernels of [`Integrator::Grid`] become narrower; two pictures tell
//! how fast, and so they do for what smoothing may be off.
//!
//! Settings for an error are chosen by [`Forecast::work`], which knows no clock: the same run asks for the same settings again.

use crate::export::report::{Level, Stage};
use crate::film::Film;
use crate::integrate::{Integrator, RenderSettings, Rendering};

/// Of the variance of photons, and of the square of what smoothing may be off, by powers of 1 / photons: where one picture is all there is.
/// Kernels become narrower and similar media nearer to the scene's as photons get more, so that both fall more slowly than as one over
/// them. Measured from 50k to 5M photons on the published cumulus.
const FALL: [f64; 2] = [0.65, 0.4];
/// The first in air, whose own light has as many paths by few photons as by half a million.
const FALL_IN_AIR: f64 = 0.6;
/// What two pictures may tell of that: their noise is in it too.
const FALLS: [(f64, f64); 2] = [(0.5, 1.0), (0.3, 1.2)];
/// The most photons, the fewest, and the most voxels a photon, a pixel and a byte: as the grid integrator has it.
const PHOTONS: (f64, f64) = (8192.0, u32::MAX as f64);
const VOXELS: (f64, f64, f64) = (30_000.0, 48.0, 900.0);
const FINE_VOXELS: f64 = 120_000.0;

/// What a photon and a voxel cost, samples of a pixel being 1: as measured on cumulus clouds of optical depth 60.
const WORK: (f64, f64) = (4.0, 3.0);
/// What a voxel takes of the stage of photons, over what it takes of smoothing.
const KEEPING: f64 = 0.2;
/// Voxels are enough where they are fewer than this part of what was asked for.
const ENOUGH: f64 = 0.7;
/// Noise of samples is never nothing: that of photons it is told from is as large as this part of it unsure.
const UNSURE: f64 = 0.003;

/// The variance of samples falls by this power of the number of pixels, as each sees less that is different: measured from 192 x 144 to 960 x 720.
const FINER: f64 = 0.2;

/// Settings, what they took, and how wrong the picture is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Shot {
    /// Photons, and samples a pixel, of so many.
    pub photons: f64,
    pub spp: f64,
    pub pixels: f64,
    /// Voxels, and the photons that they were asked for by.
    pub voxels: f64,
    pub voxels_for: f64,
    /// Seconds of what is always the same, of photons, of smoothing, of samples.
    pub seconds: [f64; 4],
    /// Squares of relative errors: samples' noise, photons' noise, what smoothing may be off.
    pub squares: [f64; 3],
}

/// Extrapolates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Forecast {
    integrator: Integrator,
    shot: Shot,
    falls: [f64; 2],
    pixels: f64,
    most_voxels: f64,
    /// Seconds a photon; what is left of the stage of photons goes by voxels. And what the same photons cost beside that stage.
    a_photon: f64,
    beside: f64,
}

impl Shot {
    /// What a picture took; `None` where no pixel receives light, or its error is not known.
    pub fn of(settings: &RenderSettings, voxels_for: u64, rendering: &Rendering, stages: &[Stage]) -> Option<Self> {
        let film: &Film = &rendering.film;
        let seconds = |name: &str| stages.iter().filter(|s| s.stage == name).map(|s| s.seconds).sum::<f64>();
        let (photons, smoothing, render) = (seconds("photons"), seconds("smoothing"), seconds("render"));
        let rest = stages.iter().map(|s| s.seconds).sum::<f64>() - photons - smoothing - render;
        let (noise, of_photons) = (film.relative_noise()?.powi(2), film.relative_photon_noise()?.powi(2));
        let samples = (noise - of_photons).max(UNSURE * noise);
        Some(Shot {
            photons: settings.photon.photons as f64,
            spp: f64::from(settings.spp),
            pixels: f64::from(settings.width) * f64::from(settings.height),
            voxels: rendering.photons.map_or(0.0, |lit| lit.voxels as f64),
            voxels_for: voxels_for as f64,
            seconds: [rest, photons, smoothing, render],
            squares: [samples, noise - samples, film.relative_bias()?.powi(2)],
        })
    }
}

impl Forecast {
    /// Of pictures like one by `settings`, from the last, which may have had fewer pixels, and the one before it.
    pub fn new(settings: &RenderSettings, mut shot: Shot, before: Option<Shot>, in_air: bool) -> Self {
        let mut falls = [if in_air { FALL_IN_AIR } else { FALL[0] }, FALL[1]];
        let before = before.filter(|b| shot.photons > 1.5 * b.photons);
        if let Some(before) = before {
            let decades = (shot.photons / before.photons).ln();
            // Other voxels, other noise: that it falls slowly is told all the same.
            let alike = (before.voxels / shot.voxels - 1.0).abs() < 0.1;
            for (i, fall) in falls.iter_mut().enumerate() {
                let found = (before.squares[i + 1] / shot.squares[i + 1]).ln() / decades;
                if found.is_finite() && (alike || found < *fall) {
                    *fall = found.clamp(FALLS[i].0, FALLS[i].1);
                }
            }
        }
        let pixels = f64::from(settings.width) * f64::from(settings.height);
        let more = pixels / shot.pixels;
        shot.seconds[3] *= more;
        shot.squares[0] /= more.powf(FINER);
        // Far fewer than were asked for are enough for all there is to see.
        let enough = shot.voxels > 0.0 && shot.voxels < ENOUGH * shot.voxels_for;
        let most_voxels =
            if enough { shot.voxels } else { (VOXELS.1 * pixels).max(FINE_VOXELS).min(settings.photon.memory as f64 / VOXELS.2) };
        // What voxels take of the photons' seconds is not much: the rest goes by photons.
        let whole = shot.seconds[1].max(0.0);
        let a_photon = (whole - KEEPING * shot.seconds[2]).max(0.5 * whole) / shot.photons;
        let mut forecast = Forecast { integrator: settings.integrator, shot, falls, pixels, most_voxels, a_photon, beside: 0.0 };
        if let Some(before) = before {
            forecast.beside = ((shot.seconds[0] - before.seconds[0]) / (shot.photons - before.photons)).max(0.0);
            // Seconds = a * photons + b * voxels, of both.
            let (v, w) = (before.voxels, shot.voxels);
            let found = (before.seconds[1] * w - shot.seconds[1] * v) / (before.photons * w - shot.photons * v);
            if found > 0.0 && found < whole / shot.photons {
                forecast.a_photon = found;
            }
        }
        forecast
    }

    /// Where the voxels of the next picture are known.
    pub fn with_voxels(mut self, voxels: u64) -> Self {
        self.most_voxels = voxels as f64;
        self
    }

    /// The relative error of a picture of so many photons and samples.
    pub fn error(&self, (photons, spp): (f64, f64)) -> f64 {
        let [samples, noise, bias] = self.shot.squares;
        let fewer = self.shot.photons / photons;
        (samples * self.shot.spp / spp + noise * fewer.powf(self.falls[0]) + bias * fewer.powf(self.falls[1])).sqrt()
    }

    /// Its seconds.
    pub fn seconds(&self, (photons, spp): (f64, f64)) -> f64 {
        let [rest, of_photons, smoothing, render] = self.shot.seconds;
        let each = if self.integrator == Integrator::Grid { self.a_photon + self.beside } else { 0.0 };
        let more = each * (photons - self.shot.photons);
        let wider = if self.shot.voxels > 0.0 { self.voxels(photons) / self.shot.voxels } else { 1.0 };
        let by_voxels = of_photons - self.a_photon * self.shot.photons;
        rest + more + self.a_photon * self.shot.photons + (by_voxels + smoothing) * wider + render * spp / self.shot.spp
    }

    /// What it costs, in samples of a pixel; by the clock of no machine.
    pub fn work(&self, (photons, spp): (f64, f64)) -> f64 {
        let grid = self.integrator == Integrator::Grid;
        self.pixels * spp + if grid && photons > 0.0 { WORK.0 * photons + WORK.1 * self.voxels(photons) } else { 0.0 }
    }

    /// The cheapest settings for an error by their work; `None` where none are allowed that reach it.
    pub fn reach(&self, error: f64) -> Option<(f64, f64)> {
        let of = |photons: f64| {
            let rest = error.powi(2) - self.error((photons, f64::INFINITY)).powi(2);
            let spp = self.rounded(self.shot.squares[0] * self.shot.spp / rest);
            (rest > 0.0 && spp <= f64::from(u32::MAX)).then_some((photons, spp))
        };
        self.choices().filter_map(of).min_by(|a, b| self.work(*a).total_cmp(&self.work(*b)))
    }

    /// The best settings for so many seconds; the least there are where these are too few.
    pub fn within(&self, seconds: f64) -> (f64, f64) {
        let of = |photons: f64| {
            let spare = seconds - self.seconds((photons, 0.0));
            let spp = (spare / self.shot.seconds[3] * self.shot.spp).clamp(0.0, f64::from(u32::MAX));
            let spp = self.rounded_down(spp);
            (spp >= self.steps().1).then_some((photons, spp))
        };
        let best = self.choices().filter_map(of).min_by(|a, b| self.error(*a).total_cmp(&self.error(*b)));
        best.unwrap_or((self.choices().next().unwrap_or(self.shot.photons), self.steps().1))
    }

    /// The samples that leave as much of an `error` as what photons and smoothing leave; `None` where these alone reach it.
    pub fn samples(&self, error: f64) -> Option<f64> {
        let rest = error.powi(2) - self.shot.squares[1] - self.shot.squares[2];
        let spp = self.rounded(self.shot.squares[0] * self.shot.spp / rest);
        (rest > 0.0 && spp <= f64::from(u32::MAX)).then_some(spp)
    }

    /// The samples that fill so many seconds.
    pub fn samples_within(&self, seconds: f64) -> f64 {
        self.rounded_down(seconds / self.shot.seconds[3] * self.shot.spp).clamp(self.steps().1, f64::from(u32::MAX))
    }

    /// What half the error of the last picture would take, what a round figure below a fifth of it, and what was `asked` for.
    pub fn levels(&self, asked: Option<f64>) -> Vec<Level> {
        let error = self.error((self.shot.photons, self.shot.spp));
        let half: f64 = format!("{:.1e}", error / 2.0).parse().unwrap_or(error / 2.0);
        let magnitude = 10f64.powf((error / 5.0).log10().floor());
        let round = [5.0, 2.0, 1.0].map(|digit| digit * magnitude).into_iter().find(|&level| level <= error / 5.0);
        let of = |relative_error: f64| {
            let (photons, spp) = self.reach(relative_error)?;
            let shown = (self.integrator == Integrator::Grid).then_some(photons as u64);
            let seconds = self.seconds((photons, spp));
            Some(Level { relative_error, seconds, photons: shown, spp: spp as u64, estimate: None })
        };
        asked.into_iter().chain([half]).chain(round).filter(|&level| level < error).filter_map(of).collect()
    }

    /// Numbers of photons to choose from, from few to many.
    fn choices(&self) -> impl Iterator<Item = f64> + use<> {
        let (from, to) = if self.integrator == Integrator::Grid { PHOTONS } else { (self.shot.photons, self.shot.photons) };
        (0..).map(move |i| (from * 1.06f64.powi(i)).round()).take_while(move |&n| n <= to)
    }

    /// Samples are dealt to parts of a pixel by the grid integrator, two to each: their steps, and the least, below the first step.
    fn steps(&self) -> (f64, f64) {
        if self.integrator == Integrator::Grid { (4.0, 2.0) } else { (1.0, 2.0) }
    }

    fn rounded(&self, spp: f64) -> f64 {
        let (step, least) = self.steps();
        if spp <= least { least } else { ((spp / step).ceil() * step).max(least) }
    }

    fn rounded_down(&self, spp: f64) -> f64 {
        let (step, least) = self.steps();
        let steps = (spp / step).floor() * step;
        if steps < least && spp >= least { least } else { steps }
    }

    /// Voxels of a picture by so many photons.
    fn voxels(&self, photons: f64) -> f64 {
        photons.max(VOXELS.0).min(self.most_voxels)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn forecast(integrator: Integrator) -> Forecast {
        let settings = RenderSettings { integrator, width: 640, height: 480, spp: 8, seed: 0, photon: Default::default() };
        let (seconds, noise) = if integrator == Integrator::Grid { ([0.1, 0.5, 1.0, 2.0], 0.04) } else { ([0.1, 0.0, 0.0, 2.0], 0.0) };
        let shot =
            Shot { photons: 1e5, spp: 8.0, pixels: 640.0 * 480.0, voxels: 1e5, voxels_for: 1e5, seconds, squares: [0.01, noise, 0.0] };
        let before = Shot { photons: 2.5e4, squares: [0.02, 0.12, 0.0], ..shot };
        Forecast::new(&settings, shot, Some(before), false)
    }

    #[test]
    fn path_goes_as_the_root_of_its_samples() {
        let path = forecast(Integrator::Path);
        let (photons, spp) = path.reach(0.01).unwrap();
        assert_eq!((photons, spp), (1e5, 800.0));
        assert!((path.error((photons, spp)) - 0.01).abs() < 1e-12 && (path.seconds((photons, spp)) - 200.1).abs() < 1e-9);
        assert_eq!(path.within(200.2).1, 800.0);
        // The least there is, where there is no time; and nothing beyond what can be asked for.
        assert_eq!(path.within(0.01).1, 2.0);
        assert_eq!(path.reach(1e-9), None);
    }

    /// Samples fill what photons leave, and no number of them more than that.
    #[test]
    fn samples_are_for_what_photons_leave() {
        let grid = forecast(Integrator::Grid);
        let spp = grid.samples(0.21).unwrap();
        assert!(grid.error((1e5, spp)) <= 0.21 && grid.error((1e5, spp - 4.0)) > 0.21, "{spp}");
        assert_eq!((grid.samples(0.2), grid.samples(0.9)), (None, Some(2.0)));
        assert_eq!((grid.samples_within(7.9), grid.samples_within(0.1)), (28.0, 2.0));
    }

    /// What is chosen costs no more than any other that reaches as much; and what a time is filled with is no worse.
    #[test]
    fn grid_takes_the_cheapest_way() {
        let grid = forecast(Integrator::Grid);
        // Fourfold photons took it from 0.12 to 0.04, with as many voxels.
        assert!((grid.falls[0] - 3f64.ln() / 4f64.ln()).abs() < 1e-12);
        let best = grid.reach(0.05).unwrap();
        assert!(grid.error(best) <= 0.05 && best.1 % 4.0 == 0.0);
        for photons in (0..60).map(|i| 1e4 * 1.25f64.powi(i)) {
            for spp in (2..200).map(|i| 4.0 * f64::from(i)) {
                let other = (photons, spp);
                assert!(grid.error(other) > 0.05 || grid.work(other) >= 0.97 * grid.work(best), "{other:?} {best:?}");
            }
        }
        let quick = grid.within(grid.seconds(best));
        assert!(grid.seconds(quick) <= grid.seconds(best) && grid.error(quick) < 0.052);
    }
}
