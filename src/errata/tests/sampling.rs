//! Traps 1 to 3: phase functions and the draws from them.

use super::*;
use crate::scene::phase::{henyey_greenstein, sample_eq19, sample_henyey_greenstein};
use std::f64::consts::PI;

/// The integral over the sphere of a phase function of 1 - cos: midpoints in the cosine.
fn over_the_sphere(phase: impl Fn(f64) -> f64) -> f64 {
    let n = 1_000_000;
    (0..n).map(|i| phase(2.0 * (f64::from(i) + 0.5) / f64::from(n))).sum::<f64>() * 4.0 * PI / f64::from(n)
}

#[test]
fn trap_01_phase_functions_that_do_not_integrate_to_one() {
    let rayleigh = |lambda: f64| move |one_minus_cos: f64| 0.75 * (1.0 + (1.0 - one_minus_cos).powi(2)) / lambda.powi(4);
    printed("eq. 5", exact(over_the_sphere(|_| 1.0)), 12.566, 1e-3);
    printed("eq. 6, 1 um", exact(over_the_sphere(rayleigh(1.0))), 12.566, 1e-3);
    printed("eq. 6, red", exact(over_the_sphere(rayleigh(0.65))), 70.4, 0.1);
    printed("eq. 6, blue", exact(over_the_sphere(rayleigh(0.45))), 306.5, 0.1);
    printed("eq. 7", exact(over_the_sphere(|x| henyey_greenstein(0.9, x))), 1.0, 1e-6);
    printed("eq. 7 at g = 0", exact(over_the_sphere(|x| henyey_greenstein(0.0, x))), 1.0, 1e-6);
    printed("eq. 6, normalised", exact(over_the_sphere(|x| 0.25 / PI * rayleigh(1.0)(x))), 1.0, 1e-6);
}

#[test]
fn trap_02_the_logarithm_of_zero() {
    // 24 bits are zero once in 2^24 draws: counted over 2^27. 53 bits are too rare to be seen.
    let mut rng = random(2);
    let zeros = (0..1u32 << 27).filter(|_| rng.uniform_f32() == 0.0).count() as f64;
    agrees("zeros of 24 bits", Estimate { value: zeros, se: 8f64.sqrt() }, 8.0);
    assert!(zeros > 0.0 && -(0f64.ln()) == f64::INFINITY && (f64::INFINITY * 0.0).is_nan());
    // The longest flight that is left: the smallest number above zero.
    printed("24 bits", exact(-(2f64.powi(-24)).ln()), 16.6, 0.1);
    printed("53 bits", exact(-(2f64.powi(-53)).ln()), 36.7, 0.1);
    let largest = 1.0 - 2f64.powi(-53);
    printed("1 - xi", exact(-(1.0 - largest).ln()), 36.7, 0.1);
}

/// Eq. 19 in single precision, not clamped.
fn eq19_f32(g: f32, xi: f32) -> f32 {
    let s = (1.0 - g * g) / (1.0 - g + 2.0 * g * xi);
    (1.0 + g * g - s * s) / (2.0 * g)
}

#[test]
fn trap_03_eq_19_loses_its_digits_near_g_0() {
    let grid = || (0..1024).map(|i| (f64::from(i) + 0.5) / 1024.0);
    assert!(eq19_f32(0.0, 0.3).is_nan());
    // (g, largest error of the cosine in double and in single precision), as the page prints them.
    for (g, double, single) in [(1e-1, 2e-15, 1e-6), (1e-3, 2e-13, 1e-4), (1e-5, 3e-11, 1e-2), (1e-7, 2e-9, 1.0), (1e-9, 1e-7, 1.0)] {
        let worst = |f: &dyn Fn(f64) -> f64| grid().map(f).fold(0.0, f64::max);
        let in_f64 = worst(&|xi| (sample_eq19(g, xi).0 - sample_henyey_greenstein(g, xi).0).abs());
        let rounded = f64::from(g as f32);
        let in_f32 = worst(&|xi| (f64::from(eq19_f32(g as f32, xi as f32)) - sample_henyey_greenstein(rounded, xi).0).abs());
        for (name, worst, figure) in [("double", in_f64, double), ("single", in_f32, single)] {
            printed(&format!("{name}, g = {g}"), exact(worst), figure, 10f64.powf(figure.log10().floor()));
        }
    }
}

#[test]
fn trap_03_eq_19_scatters_straight_on_near_g_1() {
    let n = 1_000_000;
    for (g, share, digit) in [(0.9, 0.0, 1e-4), (0.99, 4e-4, 1e-4), (0.999, 0.060, 1e-3), (0.9999, 0.591, 1e-3)] {
        let mut rng = random(3);
        let mut stable = 0;
        let straight = mean((0..n).map(|_| {
            let xi = rng.uniform_f32();
            stable += u32::from(xi > 0.0 && sample_henyey_greenstein(g, f64::from(xi)).1 as f32 == 0.0);
            f64::from(u8::from(eq19_f32(g as f32, xi) >= 1.0))
        }));
        printed(&format!("g = {g}"), straight, share, digit);
        assert_eq!(stable, 0, "the stable form always turns");
    }
}
