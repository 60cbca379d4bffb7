//! Trap 4: the density of photons out of the n nearest.

use super::*;
use std::f64::consts::PI;

const POINTS: usize = 1000;

fn ball(r: f64) -> f64 {
    4.0 / 3.0 * PI * r.powi(3)
}

/// The volume of a ball of radius `r` below a plane that lies `depth` above its centre.
fn below(r: f64, depth: f64) -> f64 {
    let h = (r - depth).max(0.0);
    ball(r) - PI * h * h * (3.0 * r - h) / 3.0
}

/// The distance from `at` to the n-th nearest of uniform points in the box of unit width around z = `bottom` to `top`.
fn distances(rng: &mut Rng, bottom: f64, top: f64, at: DVec3) -> Vec<f64> {
    let point = |rng: &mut Rng| DVec3::new(rng.uniform() - 0.5, rng.uniform() - 0.5, bottom + (top - bottom) * rng.uniform());
    let mut all: Vec<f64> = (0..POINTS).map(|_| (point(rng) - at).length()).collect();
    all.sort_unstable_by(f64::total_cmp);
    all
}

#[test]
fn trap_04_n_over_the_ball_is_too_much_by_n_over_n_less_one() {
    let mut rng = random(4);
    let trials: Vec<Vec<f64>> = (0..6000).map(|_| distances(&mut rng, -0.5, 0.5, DVec3::ZERO)).collect();
    for (n, factor) in [(2, 2.0), (5, 1.25), (10, 1.111), (100, 1.0101)] {
        let density = |count: usize| mean(trials.iter().map(|d| count as f64 / ball(d[n - 1]) / POINTS as f64));
        // At n = 2 the variance itself is infinite, barely: the mean over its estimated error is still normal in the limit.
        agrees(&format!("n = {n}"), density(n), n as f64 / (n - 1) as f64);
        printed(&format!("n = {n}"), exact(n as f64 / (n - 1) as f64), factor, 1e-3);
        agrees(&format!("n - 1, n = {n}"), density(n - 1), 1.0);
    }
}

#[test]
fn trap_04_the_ball_is_half_empty_at_a_boundary() {
    let n = 100;
    // The radius of the ball of n photons far inside.
    let inside = (n as f64 / (2.0 * POINTS as f64) * 0.75 / PI).cbrt();
    for (share, figure) in [(0.0, 0.5), (0.5, 0.828), (1.0, 1.0)] {
        let depth = share * inside;
        let mut rng = random(44);
        let trials: Vec<f64> = (0..2000).map(|_| distances(&mut rng, -0.5, 0.0, DVec3::new(0.0, 0.0, -depth))[n - 1]).collect();
        let density = |volume: &dyn Fn(f64) -> f64| mean(trials.iter().map(|&r| (n - 1) as f64 / volume(r) / (2.0 * POINTS as f64)));
        let naive = density(&ball);
        if share == 0.0 {
            agrees("on the boundary", naive, 0.5);
        }
        printed(&format!("{share} of the radius inside"), naive, figure, 1e-3);
        agrees("over the part inside", density(&|r| below(r, depth)), 1.0);
    }
}
