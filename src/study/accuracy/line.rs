//! Lines through a study's cells: how noise and bias fall, what less error would take, and where the path tracer overtakes.

use super::figures::Cell;
use crate::integrate::Integrator;
use serde::Serialize;

/// Errors whose seconds are foretold.
pub const GOALS: [f64; 4] = [0.05, 0.02, 0.01, 0.002];

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
    /// The last cell's work, and its squared noise by the line.
    last: (f64, f64),
}

impl Line {
    /// Through cells of growing work, two at least.
    pub(super) fn new(integrator: Integrator, cells: &[&Cell]) -> Option<Self> {
        let last = cells.last().filter(|_| cells.len() > 1)?;
        let work = |c: &Cell| c.setting.work as f64;
        let points: Vec<(f64, f64)> = cells.iter().map(|c| (work(c).ln(), c.noise_square.ln())).collect();
        let (slope, doubt, noise) = fitted(&points);
        let (fixed, each) = costs(cells.iter().map(|c| (work(c), c.seconds)));
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
            fixed_seconds: fixed,
            each_seconds: each,
            to: [None; GOALS.len()],
            last: (work(last), noise(work(last).ln()).exp()),
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

/// The slope of a straight line through points, its standard error by their distances from it, and the line.
fn fitted(points: &[(f64, f64)]) -> (f64, Option<f64>, impl Fn(f64) -> f64) {
    let n = points.len() as f64;
    let (x, y) = points.iter().fold((0.0, 0.0), |(x, y), p| (x + p.0 / n, y + p.1 / n));
    let xx: f64 = points.iter().map(|p| (p.0 - x).powi(2)).sum();
    let slope = points.iter().map(|p| (p.0 - x) * (p.1 - y)).sum::<f64>() / xx;
    let rest: f64 = points.iter().map(|p| (p.1 - y - slope * (p.0 - x)).powi(2)).sum();
    (slope, (points.len() > 2).then(|| (rest / (n - 2.0) / xx).sqrt()), move |at| y + slope * (at - x))
}

/// Seconds whatever is asked, and for each sample or photon, neither below zero: what is relatively nearest to all pairs of work and seconds.
fn costs(pairs: impl Iterator<Item = (f64, f64)>) -> (f64, f64) {
    let sums = pairs.fold([0.0; 5], |[n, x, xx, y, xy], (work, seconds)| {
        let (one, x_) = (1.0 / seconds, work / seconds);
        [n + one * one, x + one * x_, xx + x_ * x_, y + one, xy + x_]
    });
    let [n, x, xx, y, xy] = sums;
    let (fixed, each) = ((y * xx - x * xy) / (n * xx - x * x), (n * xy - x * y) / (n * xx - x * x));
    if fixed < 0.0 {
        (0.0, xy / xx)
    } else if each < 0.0 {
        (y / n, 0.0)
    } else {
        (fixed, each)
    }
}

/// From when on the path tracer has the smallest error, by the lines.
pub(super) fn overtakes(lines: &[Line]) -> Option<(f64, f64)> {
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

#[cfg(test)]
mod tests {
    use super::super::Setting;
    use super::*;

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

    /// Seconds that are not straight are split between the cells in proportion, and nothing costs less than nothing.
    #[test]
    fn costs_are_nearest_to_all_and_not_below_zero() {
        let of = |pairs: &[(f64, f64)]| costs(pairs.iter().copied());
        let (fixed, each) = of(&[(1.0, 2.5), (4.0, 4.0), (16.0, 10.0)]);
        assert!((fixed - 2.0).abs() < 1e-12 && (each - 0.5).abs() < 1e-12);
        let bent = [(1.0, 1.0), (10.0, 12.0), (100.0, 90.0)];
        let off =
            |(fixed, each): (f64, f64)| bent.iter().map(|&(work, seconds)| ((fixed + each * work) / seconds - 1.0).powi(2)).sum::<f64>();
        let best = of(&bent);
        assert!([(1.01, 1.0), (0.99, 1.0), (1.0, 1.01), (1.0, 0.99)].iter().all(|by| off((best.0 * by.0, best.1 * by.1)) > off(best)));
        assert_eq!(of(&[(1.0, 1.0), (2.0, 4.0)]).0, 0.0);
        assert_eq!(of(&[(1.0, 4.0), (2.0, 1.0)]).1, 0.0);
    }
}
