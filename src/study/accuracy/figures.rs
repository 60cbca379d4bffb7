//! What a study's pictures say: error, noise and bias of each cell.

use super::against::Other;
use super::line::{GOALS, Line, overtakes};
use super::store::Run;
use super::{Job, Setting};
use crate::export::report::{duration, percent};
use crate::integrate::Integrator;
use crate::scene::medium::luminance;
use serde::Serialize;

/// The reference: two independent halves.
#[derive(Debug, Clone)]
pub struct Truth {
    a: Vec<f64>,
    b: Vec<f64>,
    mean: f64,
    /// Pixels in a row.
    pub width: usize,
    /// The mean of the halves, RGB.
    pub pixels: Vec<[f32; 3]>,
}

fn grey(texel: &[f32; 3]) -> f64 {
    luminance(texel.map(f64::from))
}

impl Truth {
    /// Of two pictures; `None` where no pixel receives light.
    pub fn new(a: Vec<[f32; 3]>, b: Vec<[f32; 3]>, width: usize) -> Option<Self> {
        let pixels = a.iter().zip(&b).map(|(a, b)| std::array::from_fn(|c| 0.5 * (a[c] + b[c]))).collect();
        let [a, b] = [a, b].map(|half| half.iter().map(grey).collect::<Vec<f64>>());
        let lit: Vec<f64> = a.iter().zip(&b).map(|(a, b)| 0.5 * (a + b)).filter(|&l| l > 0.0).collect();
        let mean = lit.iter().sum::<f64>() / lit.len().max(1) as f64;
        (mean > 0.0).then_some(Truth { a, b, mean, width, pixels })
    }

    /// The mean over lit pixels of something of their number.
    fn over_lit(&self, of: impl Fn(usize) -> f64) -> f64 {
        let lit = (0..self.a.len()).filter(|&i| self.a[i] + self.b[i] > 0.0);
        let (n, sum) = lit.fold((0.0, 0.0), |(n, sum), i| (n + 1.0, sum + of(i)));
        sum / n
    }

    /// The relative noise of the mean of the halves.
    pub fn noise(&self) -> f64 {
        self.over_lit(|i| (self.a[i] - self.b[i]).powi(2) / 4.0).sqrt() / self.mean
    }

    /// The mean squared relative error of a picture, without the reference's noise, and the picture's mean over the reference's.
    pub fn off(&self, picture: &[[f32; 3]]) -> (f64, f64) {
        let light: Vec<f64> = picture.iter().map(grey).collect();
        let square = self.over_lit(|i| (light[i] - self.a[i]) * (light[i] - self.b[i])) / self.mean.powi(2);
        (square, self.over_lit(|i| light[i]) / self.mean)
    }
}

/// The pictures of one setting, all seeds.
#[derive(Debug, Clone, Serialize)]
pub struct Cell {
    /// The setting.
    #[serde(flatten)]
    pub setting: Setting,
    /// Seeds.
    pub seeds: usize,
    /// The median, s.
    pub seconds: f64,
    /// The most that the process has held by then, bytes.
    pub peak_memory: u64,
    /// The mean squared relative error of a pixel, and the standard error of that.
    pub square: f64,
    /// Of [`Cell::square`], by the seeds' scatter.
    pub square_error: f64,
    /// What of it is noise: what seeds differ by.
    pub noise_square: f64,
    /// What is left: the square of the bias, whose estimate may come out below zero.
    pub bias_square: f64,
    /// The mean over the reference's, less 1.
    pub mean_off: f64,
    /// The relative error that pictures stated themselves; the root of their mean square.
    pub stated: Option<f64>,
    /// The first seed's picture.
    #[serde(skip)]
    pub picture: Vec<[f32; 3]>,
}

impl Cell {
    /// Of runs of one setting, two at least.
    pub fn new(setting: Setting, runs: &[(Run, Vec<[f32; 3]>)], truth: &Truth) -> Self {
        let n = runs.len() as f64;
        let off: Vec<(f64, f64)> = runs.iter().map(|(_, picture)| truth.off(picture)).collect();
        let square = off.iter().map(|o| o.0).sum::<f64>() / n;
        let scatter = off.iter().map(|o| (o.0 - square).powi(2)).sum::<f64>() / (n - 1.0);
        let light: Vec<Vec<f64>> = runs.iter().map(|(_, picture)| picture.iter().map(grey).collect()).collect();
        let variance = |i: usize| {
            let mean = light.iter().map(|l| l[i]).sum::<f64>() / n;
            light.iter().map(|l| (l[i] - mean).powi(2)).sum::<f64>() / (n - 1.0)
        };
        let noise_square = truth.over_lit(variance) / truth.mean.powi(2);
        let mut seconds: Vec<f64> = runs.iter().map(|(run, _)| run.seconds).collect();
        seconds.sort_by(f64::total_cmp);
        let stated: Option<Vec<f64>> = runs.iter().map(|(run, _)| run.stated).collect();
        Cell {
            setting,
            seeds: runs.len(),
            seconds: seconds.get(runs.len() / 2).copied().unwrap_or(f64::NAN),
            peak_memory: runs.iter().map(|(run, _)| run.peak_memory).max().unwrap_or(0),
            square,
            square_error: (scatter / n).sqrt(),
            noise_square,
            bias_square: square - noise_square,
            mean_off: off.iter().map(|o| o.1).sum::<f64>() / n - 1.0,
            stated: stated.map(|s| (s.iter().map(|s| s * s).sum::<f64>() / n).sqrt()),
            picture: runs.first().map(|(_, picture)| picture.clone()).unwrap_or_default(),
        }
    }

    /// Whether its bias is more than two of its errors.
    pub fn is_off(&self) -> bool {
        self.bias_square > 2.0 * self.square_error
    }

    /// The relative error of a pixel.
    pub fn error(&self) -> f64 {
        self.square.max(0.0).sqrt()
    }
}

/// Everything that a study found.
#[derive(Debug, Clone, Serialize)]
pub struct Figures {
    /// The scene's file.
    pub scene: String,
    /// Pixels.
    pub size: [u32; 2],
    /// Samples a pixel of each half of the reference, and the relative noise of their mean.
    pub reference_samples: u64,
    /// That noise.
    pub reference_noise: f64,
    /// By setting.
    pub cells: Vec<Cell>,
    /// By integrator.
    pub lines: Vec<Line>,
    /// Cells that no other beats in both time and error, by number.
    pub pareto: Vec<usize>,
    /// The time from which on the path tracer's error is the smallest, s, and that error.
    pub path_overtakes: Option<(f64, f64)>,
    /// Pictures by others.
    pub others: Vec<Other>,
    #[serde(skip)]
    pub(super) truth: Truth,
}

impl Figures {
    pub(super) fn new(job: &Job, size: [u32; 2], reference_samples: u64, truth: Truth, cells: Vec<Cell>, others: Vec<Other>) -> Self {
        let of = |integrator: Integrator| {
            let usual = cells.iter().filter(move |c| c.setting.integrator == integrator && c.setting.change.is_none());
            usual.collect::<Vec<&Cell>>()
        };
        let all = [Integrator::Path, Integrator::Grid, Integrator::Photon];
        let lines: Vec<Line> = all.into_iter().filter_map(|integrator| Line::new(integrator, &of(integrator))).collect();
        let beaten = |c: &Cell| cells.iter().any(|o| o.seconds < c.seconds && o.error() < c.error());
        let pareto = (0..cells.len()).filter(|&i| !beaten(&cells[i])).collect();
        let path_overtakes = overtakes(&lines);
        let name = job.input.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        let reference_noise = truth.noise();
        Figures { scene: name, size, reference_samples, reference_noise, cells, lines, pareto, path_overtakes, others, truth }
    }

    /// As JSON.
    pub fn json(&self) -> String {
        serde_json::to_string_pretty(self).unwrap_or_default() + "\n"
    }

    /// For the terminal.
    pub fn table(&self) -> String {
        let mut text =
            format!("reference   twice {} samples a pixel, known to {}\n", self.reference_samples, percent(self.reference_noise));
        text += &format!("{:<8}{:>9}{:>10}{:>10}{:>10}{:>10}\n", "", "work", "seconds", "error", "noise", "stated");
        for c in &self.cells {
            let (error, noise, stated) = (percent(c.error()), percent(c.noise_square.sqrt()), c.stated.map_or("-".into(), percent));
            let changed = c.setting.change.map_or(String::new(), |change| format!("  {change}"));
            let name = name(c.setting.integrator);
            text += &format!("{name:<8}{:>9}{:>10.2}{error:>10}{noise:>10}{stated:>10}{changed}\n", c.setting.work, c.seconds);
        }
        for o in &self.others {
            text += &format!("{:<17}{:>10.2}{:>10}\n", o.name, o.seconds, percent(o.error));
        }
        for line in &self.lines {
            let to = GOALS.iter().zip(line.to).map(|(&goal, s)| format!("{} in {}", percent(goal), s.map_or("never".into(), duration)));
            text += &format!("{:<8}{}\n", name(line.integrator), to.collect::<Vec<_>>().join(", "));
        }
        if let Some((seconds, error)) = self.path_overtakes {
            text += &format!("path is the most exact from {} on, at {}\n", duration(seconds), percent(error));
        }
        text
    }

    /// A line for each cell.
    pub fn csv(&self) -> String {
        let mut text = String::from(
            "integrator,work,change,seeds,seconds,peak_memory_bytes,error,noise,bias_square,square_standard_error,mean_off,stated\n",
        );
        for c in &self.cells {
            let stated = c.stated.map_or(String::new(), |s| format!("{s:.6}"));
            text += &format!(
                "{},{},{},{},{:.3},{},{:.6},{:.6},{:.3e},{:.3e},{:.6},{stated}\n",
                name(c.setting.integrator),
                c.setting.work,
                c.setting.change.map_or(String::new(), |change| change.to_string()),
                c.seeds,
                c.seconds,
                c.peak_memory,
                c.error(),
                c.noise_square.sqrt(),
                c.bias_square,
                c.square_error,
                c.mean_off,
            );
        }
        text
    }
}

/// An integrator by its name.
pub fn name(integrator: Integrator) -> &'static str {
    match integrator {
        Integrator::Path => "path",
        Integrator::Grid => "grid",
        Integrator::Photon => "photon",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::{Rng, Stage};

    fn noisy(rng: &mut Rng, truth: &[f32], bias: f32, noise: f64) -> Vec<[f32; 3]> {
        let mut normal = || (-2.0 * (1.0 - rng.uniform()).ln()).sqrt() * (std::f64::consts::TAU * rng.uniform()).cos();
        truth.iter().map(|&t| [t * (1.0 + bias) + (noise * normal()) as f32; 3]).collect()
    }

    /// Pictures of known noise and bias, and a reference as noisy: what is found is what was put in.
    #[test]
    fn noise_and_bias_are_told_apart_and_the_references_noise_is_in_neither() {
        let mut rng = Rng::new(7, Stage::Render, 0);
        let light: Vec<f32> = (0..4000).map(|i| 1.0 + (i % 7) as f32 / 7.0).collect();
        let truth = Truth::new(noisy(&mut rng, &light, 0.0, 0.05), noisy(&mut rng, &light, 0.0, 0.05), 80).unwrap();
        assert!((truth.noise() * truth.mean / (0.05 / 2f64.sqrt()) - 1.0).abs() < 0.05);
        let run = |seed| Run {
            setting: Setting { integrator: Integrator::Grid, work: 100, change: None },
            seed,
            seconds: 1.0,
            peak_memory: 1,
            stated: None,
        };
        for (bias, noise) in [(0.0, 0.05), (0.03, 0.05), (0.05, 0.01)] {
            let runs: Vec<_> = (0..8).map(|seed| (run(seed), noisy(&mut rng, &light, bias, noise))).collect();
            let cell = Cell::new(runs[0].0.setting, &runs, &truth);
            let squares = light.iter().map(|l| f64::from(l * bias).powi(2)).sum::<f64>() / 4000.0;
            let [noise, bias] = [noise * noise, squares].map(|square| square / truth.mean.powi(2));
            println!("noise {:.2e} of {noise:.2e}, bias {:.2e} of {bias:.2e}", cell.noise_square, cell.bias_square);
            assert!((cell.noise_square / noise - 1.0).abs() < 0.05);
            // The error of a mean of 8 seeds, and of the reference's part in it, that all seeds share.
            let doubt = cell.square_error
                + 2.0 * 0.05 * bias.sqrt() / truth.mean / 4000f64.sqrt()
                + 0.05f64.powi(2) / truth.mean.powi(2) / 4000f64.sqrt();
            assert!((cell.bias_square - bias).abs() < 4.0 * doubt, "{} +- {doubt}", cell.bias_square - bias);
        }
    }
}
