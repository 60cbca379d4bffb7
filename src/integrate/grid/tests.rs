//! The grid integrator against the path tracer and the photon integrator, and against what is known.
//!
//! `cargo test --release --lib grid::tests -- --nocapture` prints every figure with its error.

mod against;
mod air;
mod behind;
mod cast;
mod fit;
mod sky;

use super::*;
use crate::integrate::photon::PhotonSettings;
use crate::integrate::{Integrator, Rendering, render};
use crate::plan::Density;
use crate::progress::Silent;
use crate::scene::{Medium, Mesh, Shape, Sun, Surface};

const SIZE: u32 = 24;

fn ball(centre: DVec3, radius: f64, medium: Medium) -> Region {
    Region { name: "cloud".into(), shape: Shape::sphere(centre, radius), medium, photons: None }
}

fn ground(albedo: f64) -> Surface {
    let corner = |x: f64, y: f64| DVec3::new(x * 20.0, y * 20.0, -1.3);
    let vertices = vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    Surface { name: "ground".into(), mesh: Mesh { vertices, triangles: vec![[0, 1, 2], [0, 2, 3]] }, albedo: [albedo; 3] }
}

fn lit(regions: Vec<Region>) -> Scene {
    let sun = Sun { direction: DVec3::new(0.3, 0.5, -0.8).normalize(), irradiance: [1.0; 3], angular_diameter: 0.01 };
    Scene { regions, sun, ..Scene::default() }
}

fn picture(scene: &Scene, integrator: Integrator, spp: u32, photons: u64, seed: u64) -> Rendering {
    let photon = PhotonSettings { photons, ..PhotonSettings::default() };
    let settings = RenderSettings { integrator, width: SIZE, height: SIZE, spp, seed, photon };
    let camera = Camera::look_at(DVec3::new(3.0, -5.0, 2.5), DVec3::new(0.1, 0.0, 0.0), 0.5).unwrap();
    render(scene, &Plan::for_scene(scene, Density::Source), &camera, &settings, None, &Silent).unwrap()
}

/// A picture's mean, by channel, with its standard error.
fn means(r: &Rendering) -> [(f64, f64); 3] {
    let n = r.film.pixels.len() as f64;
    std::array::from_fn(|c| {
        let sum: f64 = r.film.pixels.iter().map(|p| f64::from(p.combined()[c])).sum();
        // Pixels of a path tracer are independent.
        let squares: f64 = r.film.pixels.iter().map(|p| f64::from(p.standard_error[c]).powi(2)).sum();
        (sum / n, squares.sqrt() / n)
    })
}

/// The mean of pictures of several seeds, by channel, with its standard error.
fn several(scene: &Scene, integrator: Integrator, (spp, photons, seeds): (u32, u64, u64)) -> [(f64, f64); 3] {
    let found: Vec<[(f64, f64); 3]> = (0..seeds).map(|seed| means(&picture(scene, integrator, spp, photons, seed))).collect();
    std::array::from_fn(|c| {
        let mean = found.iter().map(|f| f[c].0).sum::<f64>() / seeds as f64;
        let squares: f64 = found.iter().map(|f| (f[c].0 - mean).powi(2)).sum();
        (mean, (squares / (seeds - 1) as f64 / seeds as f64).sqrt())
    })
}

/// The share by which smoothing may be off in a picture's mean; the README states what it is on more scenes.
const BIAS: f64 = 0.012;

fn agrees(name: &str, scene: &Scene, spp: u32, seeds: u64) {
    let truth = means(&picture(scene, Integrator::Path, spp, 0, 77));
    let found = several(scene, Integrator::Grid, (8, 40_000, seeds));
    for (c, (found, truth)) in found.iter().zip(&truth).enumerate() {
        let (off, sigma) = (found.0 / truth.0 - 1.0, found.1.hypot(truth.1) / truth.0);
        println!("{name}, channel {c}: off by {:+.2} % +- {:.2} %", 100.0 * off, 100.0 * sigma);
        assert!(sigma < 0.02, "{name}: {sigma} says nothing");
        assert!(off.abs() < BIAS + 3.5 * sigma, "{name}, channel {c}: {off} +- {sigma}");
    }
}

#[test]
fn a_ball_with_a_hard_edge() {
    agrees("thick", &lit(vec![ball(DVec3::ZERO, 1.0, Medium::with_albedo(8.0, 0.999, 0.85))]), 400, 4);
}

#[test]
#[ignore = "takes a minute: make crosscheck"]
fn balls_of_other_media() {
    agrees("isotropic", &lit(vec![ball(DVec3::ZERO, 1.0, Medium::with_albedo(5.0, 0.99, 0.0))]), 300, 4);
    agrees("thin", &lit(vec![ball(DVec3::ZERO, 1.0, Medium::with_albedo(0.3, 0.999, 0.6))]), 600, 4);
    agrees("backward", &lit(vec![ball(DVec3::ZERO, 1.0, Medium::with_albedo(4.0, 0.999, -0.5))]), 300, 4);
    agrees("overlaps", &overlaps(), 300, 4);
}

fn overlaps() -> Scene {
    lit(vec![
        ball(DVec3::new(-0.4, 0.0, 0.0), 0.8, Medium::with_albedo(4.0, 0.95, 0.7)),
        ball(DVec3::new(0.5, 0.1, 0.1), 0.7, Medium::with_albedo(3.0, 0.8, 0.0)),
        ball(DVec3::new(0.2, -0.2, 0.4), 0.3, Medium::with_albedo(1.5, 0.0, 0.0)),
    ])
}

#[test]
fn overlaps_ground_sky_and_colours() {
    let mut scene = overlaps();
    scene.surfaces.push(ground(0.5));
    scene.sky = [0.2, 0.3, 0.6];
    agrees("above ground, under a blue sky", &scene, 100, 3);
}

/// Under a coloured sky grey clouds have no other colours than the sun's and the sky's, in their noise neither.
#[test]
fn noise_has_the_colours_of_the_lights() {
    let mut scene = lit(vec![ball(DVec3::ZERO, 1.0, Medium::with_albedo(5.0, 0.99, 0.7))]);
    scene.sky = [0.2, 0.3, 0.6];
    for pixel in &picture(&scene, Integrator::Grid, 4, 5_000, 1).film.pixels {
        // White light adds to each channel alike: what is left is the sky's.
        let [r, g, b] = pixel.combined().map(f64::from);
        assert!(((b - g) - 3.0 * (g - r)).abs() < 1e-4, "{r} {g} {b}");
    }
    agrees("under a blue sky", &scene, 200, 3);
}

/// Where nothing is absorbed and light comes from everywhere alike, it goes everywhere alike: the sky's photons, the fits and the march
/// together make 1 of 1. (At the limb, which is thin, 24 pictures gave 1.008 +- 0.002, elsewhere 1.002 +- 0.002.)
#[test]
fn a_white_furnace() {
    let mut scene =
        lit(vec![ball(DVec3::ZERO, 1.0, Medium::with_albedo(6.0, 1.0, 0.5)), ball(DVec3::X, 0.7, Medium::with_albedo(3.0, 1.0, 0.0))]);
    scene.sun.irradiance = [0.0; 3];
    scene.sky = [1.0; 3];
    for surfaces in [vec![], vec![ground(1.0)]] {
        scene.surfaces = surfaces;
        let (mean, se) = several(&scene, Integrator::Grid, (8, 30_000, 4))[0];
        println!("furnace with {} surfaces: {mean:.5} +- {se:.5}", scene.surfaces.len());
        assert!(se < 8e-3 && (mean - 1.0).abs() < 3.5 * se + BIAS / 4.0, "{mean} +- {se}");
    }
}

#[test]
#[ignore = "takes a minute: make crosscheck"]
fn the_photon_integrator_sees_the_same() {
    let scene = lit(vec![ball(DVec3::ZERO, 1.0, Medium::with_albedo(6.0, 0.99, 0.7))]);
    let (grid, photon) = (several(&scene, Integrator::Grid, (8, 60_000, 4))[0], several(&scene, Integrator::Photon, (16, 100_000, 3))[0]);
    let (off, sigma) = (grid.0 / photon.0 - 1.0, grid.1.hypot(photon.1) / photon.0);
    println!("grid over photon: {:+.2} % +- {:.2} %", 100.0 * off, 100.0 * sigma);
    // Both are biased: the estimate of the nearest as well.
    assert!(off.abs() < 2.0 * BIAS + 3.5 * sigma, "{off} +- {sigma}");
}

/// The truth lies within a pixel's 95 % interval (Student's, by 16 groups) about as often as that says: noise and smoothing together. The
/// README tells what a dozen scenes gave.
#[test]
fn intervals_hold() {
    let scene = lit(vec![ball(DVec3::ZERO, 1.0, Medium::with_albedo(8.0, 0.999, 0.0))]);
    let truth = picture(&scene, Integrator::Path, 400, 0, 99).film;
    let (mut held, mut all) = (0.0, 0.0);
    for seed in 0..3 {
        let shot = picture(&scene, Integrator::Grid, 16, 50_000, seed).film;
        for (found, truth) in shot.pixels.iter().zip(&truth.pixels).filter(|(_, t)| t.combined()[1] > 0.0) {
            let off = f64::from(found.combined()[1] - truth.combined()[1]).abs();
            held += f64::from(off < 2.131 * f64::from(found.standard_error[1]).hypot(truth.standard_error[1].into()));
            all += 1.0;
        }
    }
    println!("{:.1} % of pixels held", 100.0 * held / all);
    // Pixels err together: three pictures say it to a few per cent.
    assert!((0.91..0.985).contains(&(held / all)), "{}", held / all);
}

/// The stated error falls as photons grow; and what a few of them show by the voxels of more is what they show by so many voxels.
#[test]
fn more_photons_know_more() {
    let scene = lit(vec![ball(DVec3::ZERO, 1.0, Medium::with_albedo(8.0, 0.999, 0.85))]);
    let camera = Camera::look_at(DVec3::new(3.0, -5.0, 2.5), DVec3::ZERO, 0.5).unwrap();
    let plan = Plan::for_scene(&scene, Density::Source);
    let take = |photons: u64, voxels_for: u64| {
        let photon = PhotonSettings { photons, ..PhotonSettings::default() };
        let settings = RenderSettings { integrator: Integrator::Grid, width: SIZE, height: SIZE, spp: 16, seed: 5, photon };
        let mut ready = crate::integrate::Ready::new(&scene, &plan, &camera, &settings, voxels_for, None, &Silent).unwrap();
        ready.brighten(&Silent).unwrap();
        ready.expose(settings.spp, &Silent).unwrap()
    };
    let (few, many, again) = (take(4_000, 64_000), take(64_000, 64_000), take(64_000, 64_000));
    assert_eq!(many.film, again.film);
    assert_eq!(few.photons.unwrap().voxels, many.photons.unwrap().voxels);
    assert!((64_000..67_000).contains(&many.photons.unwrap().emitted), "{:?}", many.photons);
    let (few, many) = (few.film.relative_error().unwrap(), many.film.relative_error().unwrap());
    println!("known to {few:.4} by 4,000 photons, to {many:.4} by 64,000");
    // Sixteen times the photons are a quarter of their noise; smoothing and samples add what does not fall.
    assert!((0.2..0.5).contains(&(many / few)), "{few} {many}");
}

/// From behind, below and against the sun.
#[test]
fn harmonics_see_the_same() {
    harmonics(DVec3::new(-4.0, 3.0, -3.0));
}

#[test]
#[ignore = "takes half a minute: make crosscheck"]
fn harmonics_see_the_same_from_the_other_side() {
    harmonics(DVec3::new(3.0, -5.0, 2.5));
}

/// Harmonics of any direction, for phase functions that are not peaked.
fn harmonics(eye: DVec3) {
    let scene = lit(vec![ball(DVec3::ZERO, 1.0, Medium::with_albedo(3.0, 0.99, 0.4))]);
    let plan = Plan::for_scene(&scene, Density::Source);
    let camera = Camera::look_at(eye, DVec3::ZERO, 0.5).unwrap();
    let take = |integrator, spp, seed| {
        let photon = PhotonSettings { photons: 30_000, directional: Directional::Sh2, ..PhotonSettings::default() };
        let settings = RenderSettings { integrator, width: SIZE, height: SIZE, spp, seed, photon };
        means(&render(&scene, &plan, &camera, &settings, None, &Silent).unwrap())[0]
    };
    let truth = take(Integrator::Path, 150, 9);
    let found: Vec<f64> = (0..3).map(|seed| take(Integrator::Grid, 8, seed).0).collect();
    let mean = found.iter().sum::<f64>() / 3.0;
    let se = (found.iter().map(|f| (f - mean).powi(2)).sum::<f64>() / 6.0).sqrt();
    let (off, sigma) = (mean / truth.0 - 1.0, se.hypot(truth.1) / truth.0);
    println!("from {eye}: off by {:+.2} % +- {:.2} %", 100.0 * off, 100.0 * sigma);
    assert!(sigma < 0.02 && off.abs() < BIAS + 3.5 * sigma, "{off} +- {sigma}");
}

#[test]
fn threads_change_nothing() {
    let mut scene = lit(vec![ball(DVec3::ZERO, 1.0, Medium::with_albedo(8.0, 0.999, 0.85))]);
    scene.surfaces.push(ground(0.4));
    scene.sky = [0.3; 3];
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let shot = pool.install(|| picture(&scene, Integrator::Grid, 4, 5000, 3));
        shot.film.pixels.iter().flat_map(|p| [p.combined(), p.standard_error]).flatten().map(f32::to_bits).collect::<Vec<_>>()
    };
    let one = with(1);
    assert!([2, 3, 8].into_iter().all(|threads| with(threads) == one));
}

/// Very thick and very small regions, far apart: bounded voxels, finite light.
#[test]
fn extremes_are_finite_and_bounded() {
    for (radius, sigma) in [(1e-3, 1e6), (1e3, 1e-6), (1.0, 2000.0), (1.0, 1e-9)] {
        let regions = (0..3).map(|i| ball(DVec3::X * 2e3 * f64::from(i), radius, Medium::with_albedo(sigma, 0.9, 0.9))).collect();
        let shot = picture(&lit(regions), Integrator::Grid, 2, 500, 1);
        assert!(shot.film.pixels.iter().all(|p| p.combined().iter().all(|c| c.is_finite() && *c >= -1e-6)), "{radius} {sigma}");
        let voxels = shot.photons.unwrap().voxels;
        assert!(voxels <= PhotonSettings::default().memory / BYTES, "{voxels}");
    }
}
