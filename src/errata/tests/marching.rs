//! Traps 9 to 11: marching, regions that overlap, and shadows.

use super::*;
use std::f64::consts::PI;

/// The radiance that leaves a stretch of a ray: `dx` metres a step, from the far end to the near one, `behind` what comes from
/// beyond. `light` is what a metre sends toward the eye at a place, `sigma` the extinction there, `length` what of a step counts.
fn march(
    (from, to): (f64, f64),
    dx: f64,
    light: impl Fn(f64) -> f64,
    sigma: impl Fn(f64) -> f64,
    length: impl Fn(f64) -> f64,
    behind: f64,
) -> f64 {
    let steps = ((to - from) / dx).round() as u32;
    (0..steps).rev().fold(behind, |radiance, i| {
        let x = from + dx * (f64::from(i) + 0.5);
        light(x) * length(sigma(x)) + (-sigma(x) * dx).exp() * radiance
    })
}

/// What of a step of `dx` metres counts: the integral of e^-sigma x over it.
fn seen(dx: f64) -> impl Fn(f64) -> f64 {
    move |sigma| -(-sigma * dx).exp_m1() / sigma
}

#[test]
fn trap_09_a_step_of_the_first_order_is_too_bright() {
    for (dx, figure) in [(0.02, 1.010), (0.1, 1.051), (0.5, 1.271), (1.0, 1.582)] {
        // Extinction 1 per metre and a constant source of 1: the radiance behind tau metres is 1 - e^-tau.
        for tau in [2.0, 40.0] {
            let truth = -f64::exp_m1(-tau);
            let by = |length: &dyn Fn(f64) -> f64| march((0.0, tau), dx, |_| 1.0, |_| 1.0, length, 0.0) / truth;
            printed(&format!("eq. 28, {dx}, {tau}"), exact(by(&|_| dx)), figure, 1e-3);
            assert!((by(&|_| dx) - dx / -(-dx).exp_m1()).abs() < 1e-12);
            assert!((by(&seen(dx)) - 1.0).abs() < 1e-12);
        }
    }
}

#[test]
fn trap_10_recursion_counts_photons_twice_where_regions_overlap() {
    // Two stretches of 2 m of a ray, alike, the second from `start`; their photons are uniform and send 1 a metre toward the eye.
    for (start, sigma, figure) in
        [(0.0, 1e-4, 2.0), (0.0, 0.5, 2.0), (0.0, 5.0, 2.0), (1.0, 1e-4, 1.5), (1.0, 0.5, 1.443), (1.0, 5.0, 1.007), (2.0, 0.5, 1.0)]
    {
        let (a, b) = ((0.0, 2.0), (start, start + 2.0));
        let regions = |x: f64| [a, b].iter().filter(|r| r.0 <= x && x < r.1).count() as f64;
        let dx = 0.001;
        // The map holds the photons of both: each region is marched through all of them, by its own extinction.
        let one = |region: (f64, f64), behind: f64| march(region, dx, regions, |_| sigma, seen(dx), behind);
        let twice = one(a, one(b, 0.0));
        let once = march((0.0, start + 2.0), dx, regions, |x| sigma * regions(x), seen(dx), 0.0);
        printed(&format!("from {start} m, {sigma} per m"), exact(twice / once), figure, 1e-3);
    }
}

#[test]
fn trap_11_radiance_is_no_irradiance() {
    // The irradiance below a ball of radiance 1 straight above, by its centre's distance in radii; overcast is a distance of 1.
    let mut rng = random(11);
    for (distance, irradiance) in [(1.0, PI), (2.0, 0.785), (10.0, 0.031)] {
        let sin2 = 1.0 / (distance * distance);
        let directions = (0..400_000).map(|_| rng.uniform()).map(|cos| if cos * cos > 1.0 - sin2 { 2.0 * PI * cos } else { 0.0 });
        agrees(&format!("{distance} radii"), mean(directions), PI * sin2);
        printed(&format!("{distance} radii"), exact(PI * sin2), irradiance, 1e-3);
    }
}
