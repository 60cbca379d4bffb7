//! Pass 2 against the path tracer: what it converges to, and how fast.
//!
//! `cargo test --release --lib photon::tests -- --nocapture` prints every figure with its error; `make crosscheck` runs the
//! longer variants.

mod basics;
mod boundary;
mod energy;
mod image;
mod noise;
mod rates;

use super::*;
use crate::integrate::{Integrator, Rendering, render};
use crate::plan::Density;
use crate::progress::Silent;
use crate::rng::Stage;
use crate::sampling::around;
use crate::scene::phase::sample_henyey_greenstein;
use crate::scene::{Camera, Mesh, Shape, Sun};
use crate::stats::Estimate;
use rayon::prelude::*;

/// Paths of an oracle that share a stream of random numbers.
const CHUNK: u64 = 4096;

fn region(shape: Shape, medium: Medium) -> Region {
    Region { name: "cloud".into(), shape, medium, photons: None }
}

fn ball(centre: DVec3, radius: f64, medium: Medium) -> Region {
    region(Shape::sphere(centre, radius), medium)
}

/// Regions under a sun of 1 W m^-2 whose light travels along `direction`, a point at infinity.
fn lit(regions: Vec<Region>, direction: DVec3) -> Scene {
    Scene { regions, sun: Sun { direction, irradiance: [1.0; 3], angular_diameter: 0.0 }, ..Scene::default() }
}

fn plan(scene: &Scene) -> Plan {
    Plan::for_scene(scene, Density::Source)
}

fn settings(gather: Gathering, photons: u64, estimate: u64) -> PhotonSettings {
    PhotonSettings { gather, photons, estimate: Some(estimate), ..PhotonSettings::default() }
}

fn lights(scene: &Scene, photon: PhotonSettings, seed: u64) -> PhotonTracer {
    let settings = RenderSettings { integrator: Integrator::Photon, width: 1, height: 1, spp: 1, seed, photon };
    PhotonTracer::new(scene, &plan(scene), &settings, None, &Silent).unwrap()
}

/// The mean of independent samples with its standard error.
fn mean(samples: &[f64]) -> Estimate {
    let n = samples.len() as f64;
    let value = samples.iter().sum::<f64>() / n;
    let squares = samples.iter().map(|x| (x - value).powi(2)).sum::<f64>();
    Estimate { value, se: (squares / (n - 1.0) / n).sqrt() }
}

/// The mean of what `sample` gives, over about so many samples in independent chunks.
fn oracle(samples: u64, seed: u64, sample: impl Fn(&mut Rng, &mut Scratch) -> f64 + Sync) -> Estimate {
    let chunks: Vec<f64> = (0..samples.div_ceil(CHUNK))
        .into_par_iter()
        .map(|item| {
            let (mut rng, mut scratch) = (Rng::new(seed, Stage::Flux, item), Scratch::default());
            (0..CHUNK).map(|_| sample(&mut rng, &mut scratch)).sum::<f64>() / CHUNK as f64
        })
        .collect();
    mean(&chunks)
}

/// What arrives along the first `reach` metres of a ray, by layer, in grey.
fn arrives(reference: &PathTracer, ray: Ray, reach: f32, rng: &mut Rng, scratch: &mut Scratch) -> [f64; 4] {
    let arrival = reference.arrival(&View { ray, reach, cos: 1.0, near: 0.0, stratum: Default::default() }, rng, scratch);
    arrival.light.map(|light| f64::from(light.y))
}

/// What [`Gather::scattered`] estimates, by the path tracer: light that has collided before, averaged over the directions that it
/// arrives from with the phase function as their density. The sun itself is never met by such a ray.
fn scattered(reference: &PathTracer, p: Vec3, outward: Vec3, g: f64, paths: u64, seed: u64) -> Estimate {
    oracle(paths, seed, |rng, scratch| {
        let (cos, sin) = sample_henyey_greenstein(g, rng.uniform());
        let inward = around(outward, cos as f32, sin as f32, rng.uniform_f32());
        arrives(reference, Ray { origin: p, direction: -inward }, f32::INFINITY, rng, scratch).iter().sum()
    })
}

/// The slope of the straight line through (x, y) with independent errors of y, and its standard error.
fn slope(points: &[(f64, Estimate)]) -> Estimate {
    let sum = |f: &dyn Fn(f64, &Estimate) -> f64| points.iter().map(|(x, y)| f(*x, y) / (y.se * y.se)).sum::<f64>();
    let (w, x, y) = (sum(&|_, _| 1.0), sum(&|x, _| x), sum(&|_, y| y.value));
    let (xx, xy) = (sum(&|x, _| x * x), sum(&|x, y| x * y.value));
    let determinant = w * xx - x * x;
    Estimate { value: (w * xy - x * y) / determinant, se: (w / determinant).sqrt() }
}
