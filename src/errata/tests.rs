//! The experiments behind the page: each asserts the figures that the page prints, at 4.5 sigma where they are estimates.

mod density;
mod layout;
mod marching;
mod sampling;
mod tracing;

use crate::rng::{Rng, Stage};
use crate::scene::{Medium, Region, Scene, Shape, Sun};
use crate::stats::Estimate;
use glam::DVec3;

fn random(item: u64) -> Rng {
    Rng::new(2006, Stage::Photons, item)
}

/// The mean of independent values, with its standard error.
fn mean(values: impl IntoIterator<Item = f64>) -> Estimate {
    let (mut n, mut sum, mut squares) = (0.0, 0.0, 0.0);
    for x in values {
        (n, sum, squares) = (n + 1.0, sum + x, squares + x * x);
    }
    let value = sum / n;
    Estimate { value, se: ((squares / n - value * value).max(0.0) / (n - 1.0)).sqrt() }
}

/// Fails beyond 4.5 sigma.
fn agrees(name: &str, e: Estimate, truth: f64) {
    assert!((e.value - truth).abs() < 4.5 * e.se, "{name}: {} +- {} against {truth}", e.value, e.se);
}

/// Fails where a figure of the page, printed to a multiple of `digit`, is not what was measured: beyond its rounding and 4.5 sigma.
fn printed(name: &str, e: Estimate, figure: f64, digit: f64) {
    let off = (e.value - figure).abs();
    assert!(off <= 0.5 * digit * (1.0 + 1e-9) + 4.5 * e.se, "{name}: {} +- {} against {figure}", e.value, e.se);
}

/// A figure that no chance is in.
fn exact(value: f64) -> Estimate {
    Estimate { value, se: 0.0 }
}

/// One region under a sun overhead that is a point.
fn overhead(shape: Shape, medium: Medium) -> Scene {
    let region = Region { name: "cloud".into(), shape, medium, photons: None };
    Scene { regions: vec![region], sun: Sun { direction: DVec3::NEG_Z, angular_diameter: 0.0, ..Sun::default() }, ..Scene::default() }
}

/// The thesis's medium (its section 4.1), 1/m.
fn thesis_medium() -> Medium {
    Medium::preset("hura2006").unwrap()
}

/// A sphere of the thesis's medium with a radius of six free paths.
fn thesis_sphere() -> Scene {
    overhead(Shape::sphere(DVec3::ZERO, 6.0), thesis_medium())
}

/// The share of parallel light that crosses a sphere of optical diameter `t`: Beer-Lambert over its chords.
fn clear(t: f64) -> f64 {
    2.0 * (1.0 - (1.0 + t) * (-t).exp()) / (t * t)
}
