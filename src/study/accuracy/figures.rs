//! What a study's pictures say: error, noise and bias of each cell, how they fall, and what less error would take.

use super::against::Other;
use super::store::Run;
use super::{Job, Setting};
use crate::export::report::{duration, percent};
use crate::integrate::Integrator;
use crate::scene::medium::luminance;
use serde::Serialize;

/// Errors whose seconds are foretold.
pub const GOALS: [f64; 4] = [0.05, 0.02, 0.01, 0.002];

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

/// One integrator's cells, and how they fall.
#[derive(Debug, Clone, Serialize)]
pub struct Line {
    /// Which.
    pub integrator: Integrator,
    /// The power of samples or photons by which the mean squared noise falls.
    pub noise_falls: f64,
    /// Of that, by the cells' distance from the line; absent with two cells.
    pub noise_falls_error: Option<f64>,
    /// The relative bias that the last cell has; 0 where its square is within two of its errors of 0.
    pub bias: f64,
    /// The power of photons by which the squared bias falls, by the last two cells that show one; 0 where fewer do.
    pub bias_falls: f64,
    /// Seconds whatever is asked, and for each sample or photon.
    pub fixed_seconds: f64,
    /// Seconds for each of them.
    pub each_seconds: f64,
    /// Seconds to each of the [`GOALS`]; none where a bias that does not fall is more.
    pub to: [Option<f64>; GOALS.len()],
    last: (f64, f64),
}

impl Line {
    /// Through cells of growing work, two at least.
    fn new(integrator: Integrator, cells: &[&Cell]) -> Option<Self> {
        let (first, last) = (cells.first()?, cells.last().filter(|_| cells.len() > 1)?);
        let points: Vec<(f64, f64)> = cells.iter().map(|c| ((c.setting.work as f64).ln(), c.noise_square.ln())).collect();
        let (slope, doubt) = fitted(&points);
        let work = |c: &Cell| c.setting.work as f64;
        let each = ((last.seconds - first.seconds) / (work(last) - work(first))).max(0.0);
        let bias = if last.is_off() { last.bias_square.sqrt() } else { 0.0 };
        let off: Vec<&&Cell> = cells.iter().filter(|c| c.is_off()).collect();
        let bias_falls = match off[..] {
            [.., before, end] if bias > 0.0 => (end.bias_square / before.bias_square).ln() / (work(end) / work(before)).ln(),
            _ => 0.0,
        };
        let mut line = Line {
            integrator,
            noise_falls: slope,
            noise_falls_error: doubt,
            bias,
            bias_falls: bias_falls.min(0.0),
            fixed_seconds: (last.seconds - each * work(last)).max(0.0),
            each_seconds: each,
            to: [None; GOALS.len()],
            last: (work(last), last.noise_square),
        };
        line.to = GOALS.map(|goal| line.seconds(goal));
        Some(line)
    }

    /// The squared error with so many times the last cell's work.
    fn square(&self, more: f64) -> f64 {
        self.last.1 * more.powf(self.noise_falls) + self.bias.powi(2) * more.powf(self.bias_falls)
    }

    /// Seconds to an error; `None` where a bias that does not fall is more.
    pub fn seconds(&self, error: f64) -> Option<f64> {
        // By decades of work, halved sixty times.
        let (mut little, mut much) = (-12.0f64, 24.0f64);
        if self.noise_falls >= 0.0 || self.square(10f64.powf(much)) >= error * error {
            return None;
        }
        for _ in 0..60 {
            let middle = 0.5 * (little + much);
            *if self.square(10f64.powf(middle)) > error * error { &mut little } else { &mut much } = middle;
        }
        Some(self.fixed_seconds + self.each_seconds * self.last.0 * 10f64.powf(much))
    }

    /// The error after so many seconds; `None` where nothing is done by then.
    pub fn error(&self, seconds: f64) -> Option<f64> {
        let work = (seconds - self.fixed_seconds) / self.each_seconds;
        (work > 0.0).then(|| self.square(work / self.last.0).sqrt())
    }
}

/// The slope of a straight line through points, and its standard error by their distances from it.
fn fitted(points: &[(f64, f64)]) -> (f64, Option<f64>) {
    let n = points.len() as f64;
    let (x, y) = points.iter().fold((0.0, 0.0), |(x, y), p| (x + p.0 / n, y + p.1 / n));
    let xx: f64 = points.iter().map(|p| (p.0 - x).powi(2)).sum();
    let slope = points.iter().map(|p| (p.0 - x) * (p.1 - y)).sum::<f64>() / xx;
    let rest: f64 = points.iter().map(|p| (p.1 - y - slope * (p.0 - x)).powi(2)).sum();
    (slope, (points.len() > 2).then(|| (rest / (n - 2.0) / xx).sqrt()))
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

/// From when on the path tracer has the smallest error, by the lines.
fn overtakes(lines: &[Line]) -> Option<(f64, f64)> {
    let path = lines.iter().find(|l| l.integrator == Integrator::Path)?;
    let behind = |t: f64| {
        let own = path.error(t).unwrap_or(f64::INFINITY);
        lines.iter().filter(|l| l.integrator != Integrator::Path).any(|l| l.error(t).is_some_and(|other| other < own))
    };
    // From a third of a year down to a hundredth of a second.
    let times = (0..900).map(|i| 1e7 * 10f64.powf(-f64::from(i) / 100.0));
    let before = times.take_while(|&t| !behind(t)).last()?;
    (before < 0.999e7).then_some((before, path.error(before)?))
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

    /// A line through cells that fall as they should foretells what they were made by.
    #[test]
    fn lines_foretell_what_they_were_made_by() {
        let cell = |integrator, work: u64, noise: f64, bias: f64, seconds| Cell {
            setting: Setting { integrator, work, change: None },
            seeds: 4,
            seconds,
            peak_memory: 0,
            square: noise * noise + bias * bias,
            square_error: 1e-9,
            noise_square: noise * noise,
            bias_square: bias * bias,
            mean_off: 0.0,
            stated: None,
            picture: vec![],
        };
        let path: Vec<Cell> = [4u64, 16, 64].map(|n| cell(Integrator::Path, n, 0.8 / (n as f64).sqrt(), 0.0, 0.5 + 0.1 * n as f64)).into();
        let grid: Vec<Cell> =
            [1000u64, 4000].map(|n| cell(Integrator::Grid, n, 2.0 / (n as f64).powf(0.4), 0.01, 1.0 + 1e-3 * n as f64)).into();
        let lines =
            [(Integrator::Path, path), (Integrator::Grid, grid)].map(|(i, cells)| Line::new(i, &cells.iter().collect::<Vec<_>>()).unwrap());
        assert!((lines[0].noise_falls + 1.0).abs() < 1e-9 && (lines[1].noise_falls + 0.8).abs() < 1e-9);
        // 0.02 = 0.8 / sqrt(1600).
        assert!((lines[0].seconds(0.02).unwrap() - 160.5).abs() < 1e-6 && lines[1].seconds(0.009).is_none());
        // A bias that falls is no floor.
        let falling =
            [(1000u64, 0.04), (4000, 0.02)].map(|(n, bias)| cell(Integrator::Photon, n, 1e-4 / (n as f64).sqrt(), bias, 1e-3 * n as f64));
        let falling = Line::new(Integrator::Photon, &falling.iter().collect::<Vec<_>>()).unwrap();
        assert!((falling.bias_falls + 1.0).abs() < 1e-9 && (falling.seconds(0.01).unwrap() - 16.0).abs() < 0.01);
        let (when, error) = overtakes(&lines).unwrap();
        // There the two are as good as each other, and later the path tracer is better.
        assert!(
            (lines[1].error(when).unwrap() / error - 1.0).abs() < 0.02
                && lines[1].error(2.0 * when).unwrap() > lines[0].error(2.0 * when).unwrap()
        );
    }
}
