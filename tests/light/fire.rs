//! What shines by itself, against what thermodynamics and conservation say.

use super::oracles::{grid, region};
use cloudvdb::integrate::photon::PhotonSettings;
use cloudvdb::integrate::{Integrator, RenderSettings, Rendering, render};
use cloudvdb::plan::{Density, Plan};
use cloudvdb::progress::Silent;
use cloudvdb::scene::{Air, BrickGrid, Camera, Flame, Medium, Mesh, Scene, Shape, Sun, Surface, VoxelGrid};
use glam::{DAffine3, DVec3};
use std::sync::Arc;

const SIZE: u32 = 28;

fn dark() -> Scene {
    Scene { sun: Sun { irradiance: [0.0; 3], ..Sun::default() }, ..Scene::default() }
}

fn shining(shape: &Shape, emission: [f64; 3]) -> Flame {
    Flame { name: "fire".into(), shape: shape.clone(), emission }
}

/// A camera on the x axis, so far away, that sees a ball of so wide a radius around the origin.
fn facing(distance: f64, radius: f64) -> Camera {
    Camera::look_at(DVec3::new(distance, 0.0, 0.0), DVec3::ZERO, 2.0 * (radius / distance).asin()).unwrap()
}

fn picture(scene: &Scene, camera: &Camera, integrator: Integrator, spp: u32, photons: u64, seed: u64) -> Rendering {
    sized(SIZE, scene, camera, integrator, spp, photons, seed)
}

fn sized(size: u32, scene: &Scene, camera: &Camera, integrator: Integrator, spp: u32, photons: u64, seed: u64) -> Rendering {
    let photon = PhotonSettings { photons, ..PhotonSettings::default() };
    let settings = RenderSettings { integrator, width: size, height: size, spp, seed, photon };
    render(scene, &Plan::for_scene(scene, Density::Source), camera, &settings, None, &Silent).unwrap()
}

/// The irradiance on a plane across the camera's axis, W m^-2, by channel.
fn irradiance(picture: &Rendering, camera: &Camera) -> [f64; 3] {
    let side = 2.0 * (0.5 * camera.yfov).tan() / f64::from(SIZE);
    let mut sum = [0.0; 3];
    for (i, pixel) in picture.film.pixels.iter().enumerate() {
        let at = |i: u32| (f64::from(i) + 0.5 - 0.5 * f64::from(SIZE)) * side;
        let (x, y) = (at(i as u32 % SIZE), at(i as u32 / SIZE));
        // The solid angle of a pixel has a cosine to the third power in it, and what arrives there one more.
        let share = side * side / (1.0 + x * x + y * y).powi(2);
        sum.iter_mut().zip(pixel.combined()).for_each(|(sum, light)| *sum += share * f64::from(light));
    }
    sum
}

/// Mean and standard error over seeds.
fn over(seeds: u64, of: impl Fn(u64) -> [f64; 3]) -> ([f64; 3], [f64; 3]) {
    let all: Vec<[f64; 3]> = (0..seeds).map(of).collect();
    let n = seeds as f64;
    let mean: [f64; 3] = std::array::from_fn(|c| all.iter().map(|a| a[c]).sum::<f64>() / n);
    let se = std::array::from_fn(|c| (all.iter().map(|a| (a[c] - mean[c]).powi(2)).sum::<f64>() / (n - 1.0) / n).sqrt());
    (mean, se)
}

/// What a white ball sends out is what shines in it, however often light scatters: at a distance D the irradiance is all of its power
/// over 4 pi D^2. `bias` is what an integrator that smooths may be off by.
fn conserved(name: &str, scene: &Scene, emission: [f64; 3], volume: f64, integrator: Integrator, bias: f64) {
    let camera = facing(12.0, 1.3);
    let (mean, se) = over(4, |seed| irradiance(&picture(scene, &camera, integrator, 8, 50_000, seed), &camera));
    for c in 0..3 {
        let truth = emission[c] * volume / 144.0;
        let off = (mean[c] - truth).abs();
        println!("{name} {integrator:?} {c}: {:.6} +- {:.6}, truth {truth:.6}, {:+.2} %", mean[c], se[c], 100.0 * (mean[c] / truth - 1.0));
        // Squares of pixels leave out none of it; their own size blurs the ball's rim both ways.
        assert!(off < 5.0 * se[c] + bias * truth && se[c] < 0.02 * truth, "{name} {integrator:?}, channel {c}");
    }
}

#[test]
fn what_shines_in_a_white_ball_leaves_it() {
    let ball = Shape::sphere(DVec3::ZERO, 1.0);
    let emission = [2.0, 1.0, 0.25];
    let volume = 4.0 / 3.0 * std::f64::consts::PI;
    for (tau, g) in [(0.0, 0.0), (1.0, 0.6), (6.0, 0.85)] {
        let regions = if tau > 0.0 { vec![region(ball.clone(), Medium::with_albedo(tau, 1.0, g))] } else { vec![] };
        let scene = Scene { regions, flames: vec![shining(&ball, emission)], ..dark() };
        let name = format!("tau {tau}, g {g}");
        conserved(&name, &scene, emission, volume, Integrator::Path, 0.001);
        if tau > 0.0 {
            conserved(&name, &scene, emission, volume, Integrator::Grid, 0.02);
        }
        if tau == 1.0 {
            conserved(&name, &scene, emission, volume, Integrator::Photon, 0.03);
        }
    }
}

/// Voxels that shine, of two colours, in voxels that scatter.
#[test]
fn what_shines_in_white_voxels_leaves_them() {
    let lattice = |density: &dyn Fn(DVec3) -> f64| {
        let world = |at: [i32; 3]| DVec3::from_array(at.map(|i| (f64::from(i) - 7.5) / 8.0));
        let made = grid([16; 3], DVec3::splat(0.125), false, |at| density(world(at)));
        let bricks = BrickGrid {
            world_from_index: DAffine3::from_translation(DVec3::splat(-1.0)) * made.bricks.world_from_index,
            ..made.bricks.clone()
        };
        Arc::new(VoxelGrid::new(bricks, made.min, made.max, false))
    };
    let cloud = lattice(&|p| if p.length() < 0.95 { 1.0 } else { 0.0 });
    let hot = lattice(&|p| (0.5 - p.distance(DVec3::new(0.1, 0.2, 0.0))).max(0.0));
    let warm = lattice(&|p| if p.z < -0.2 && p.length() < 0.8 { 0.3 } else { 0.0 });
    let (blue, red) = ([0.5, 1.0, 2.0], [4.0, 1.0, 0.1]);
    let flames = vec![shining(&Shape::Grid(Arc::clone(&hot)), blue), shining(&Shape::Grid(Arc::clone(&warm)), red)];
    let regions = vec![region(Shape::Grid(cloud), Medium::with_albedo(3.0, 1.0, 0.5))];
    let scene = Scene { regions, flames, ..dark() };
    let whole: [f64; 3] = std::array::from_fn(|c| blue[c] * hot.integral() + red[c] * warm.integral());
    // The cloud is no ball: what goes one way is more or less than the mean of all.
    let mean = |integrator: Integrator, spp: u32| {
        let each = [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z].map(|axis| {
            let camera = Camera::look_at(axis * 12.0, DVec3::ZERO, 0.24).unwrap();
            over(1, |seed| irradiance(&picture(&scene, &camera, integrator, spp, 12_000, seed), &camera)).0
        });
        std::array::from_fn::<f64, 3, _>(|c| each.iter().map(|e| e[c]).sum::<f64>() / 6.0 * 144.0)
    };
    let (path, voxels) = (mean(Integrator::Path, 8), mean(Integrator::Grid, 4));
    for c in 0..3 {
        println!("{c}: path {:.5}, grid {:.5}, whole {:.5}", path[c], voxels[c], whole[c]);
        // Voxels of light at their finest are as wide as what shines here.
        assert!((voxels[c] / path[c] - 1.0).abs() < 0.03 && (path[c] / whole[c] - 1.0).abs() < 0.06);
    }
}

/// What is as hot as the sky is not to be told from it, whatever it scatters and absorbs (Kirchhoff): every pixel is the sky's.
#[test]
fn a_ball_as_hot_as_the_sky_is_not_seen() {
    let ball = Shape::sphere(DVec3::ZERO, 1.0);
    let sky = [0.7, 1.0, 1.6];
    let camera = facing(6.0, 1.5);
    for (tau, albedo, g) in [(0.5, 0.5, 0.0), (3.0, 0.9, 0.8), (30.0, 0.2, 0.4)] {
        let medium = Medium::with_albedo(tau, albedo, g);
        let emission = sky.map(|b| b * tau * (1.0 - albedo));
        let scene = Scene { regions: vec![region(ball.clone(), medium)], flames: vec![shining(&ball, emission)], sky, ..dark() };
        for (integrator, bias) in [(Integrator::Path, 0.0), (Integrator::Grid, 0.02)] {
            let found = over(4, |seed| {
                let picture = picture(&scene, &camera, integrator, 8, 50_000, seed);
                let middle = |i: &usize| (i % SIZE as usize).abs_diff(14) + (i / SIZE as usize).abs_diff(14) < 9;
                let kept: Vec<[f32; 3]> =
                    (0..picture.film.pixels.len()).filter(middle).map(|i| picture.film.pixels[i].combined()).collect();
                std::array::from_fn(|c| kept.iter().map(|p| f64::from(p[c])).sum::<f64>() / kept.len() as f64)
            });
            for (c, sky) in sky.into_iter().enumerate() {
                println!("tau {tau} albedo {albedo} {integrator:?} {c}: {:.5} +- {:.5}, sky {sky}", found.0[c], found.1[c]);
                assert!((found.0[c] - sky).abs() < 5.0 * found.1[c] + (bias + 1e-5) * sky);
            }
        }
    }
}

/// A flame without media, in air and over ground: path, grid and, by its mean, what a march in small steps says.
#[test]
fn air_dims_a_flame_by_channel() {
    let ball = Shape::sphere(DVec3::ZERO, 1.0);
    let air = cloudvdb::import::air::spelt("clear:visibility=40").unwrap();
    let scene = |air: Air| Scene { flames: vec![shining(&ball, [1.0; 3])], air, ..dark() };
    let camera = facing(30.0, 1.2);
    let clear = irradiance(&picture(&scene(Air::default()), &camera, Integrator::Path, 4, 1, 0), &camera);
    let (path, se) = over(6, |seed| irradiance(&picture(&scene(air), &camera, Integrator::Path, 32, 1, seed), &camera));
    let (voxels, _) = over(2, |seed| irradiance(&picture(&scene(air), &camera, Integrator::Grid, 16, 20_000, seed), &camera));
    for c in 0..3 {
        println!("{c}: clear {:.6}, path {:.6} +- {:.6}, grid {:.6}", clear[c], path[c], se[c], voxels[c]);
        // What air scatters into the picture is little, and the same for both.
        assert!(path[c] < 0.6 * clear[c] && (path[c] - voxels[c]).abs() < 5.0 * se[c] + 0.03 * path[c]);
    }
}

/// Ground near a flame is lit by it.
#[test]
fn flames_light_the_ground_and_what_is_over_it() {
    let corner = |x: f64, y: f64| DVec3::new(x * 8.0, y * 8.0, -1.1);
    let vertices = vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    let ground = Surface { name: "ground".into(), mesh: Mesh { vertices, triangles: vec![[0, 1, 2], [0, 2, 3]] }, albedo: [0.8, 0.5, 0.2] };
    let cloud = region(Shape::sphere(DVec3::new(0.0, 0.0, 0.5), 1.0), Medium::with_albedo(2.0, 0.95, 0.4));
    let flame = shining(&Shape::sphere(DVec3::new(2.2, 0.0, -0.6), 0.4), [10.0, 5.0, 1.0]);
    let scene = Scene { regions: vec![cloud], surfaces: vec![ground], flames: vec![flame], ..dark() };
    let camera = Camera::look_at(DVec3::new(2.0, -8.0, 3.0), DVec3::ZERO, 0.8).unwrap();
    let mean = |integrator: Integrator, spp: u32, seed: u64| {
        let picture = sized(18, &scene, &camera, integrator, spp, 50_000, seed);
        std::array::from_fn(|c| picture.film.pixels.iter().map(|p| f64::from(p.combined()[c])).sum::<f64>())
    };
    let (path, se) = over(6, |seed| mean(Integrator::Path, 64, seed));
    let (voxels, noise) = over(4, |seed| mean(Integrator::Grid, 16, seed));
    for c in 0..3 {
        println!("{c}: path {:.4} +- {:.4}, grid {:.4} +- {:.4}", path[c], se[c], voxels[c], noise[c]);
        assert!((path[c] - voxels[c]).abs() < 4.0 * se[c].hypot(noise[c]) + 0.01 * path[c] && se[c] < 0.02 * path[c]);
    }
}

/// Far from a small flame, light scatters and surfaces reflect it by looks at it; the means are those of photons.
#[test]
fn a_far_small_flame_lights_a_cloud_and_the_ground() {
    let corner = |x: f64, y: f64| DVec3::new(x * 30.0, y * 30.0, -1.5);
    let vertices = vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    let ground = Surface { name: "ground".into(), mesh: Mesh { vertices, triangles: vec![[0, 1, 2], [0, 2, 3]] }, albedo: [0.5; 3] };
    let cloud = region(Shape::sphere(DVec3::ZERO, 1.0), Medium::with_albedo(3.0, 0.98, 0.7));
    let flame = shining(&Shape::sphere(DVec3::new(6.0, 3.0, 1.0), 0.2), [3000.0, 1000.0, 200.0]);
    let scene = Scene { regions: vec![cloud], surfaces: vec![ground], flames: vec![flame], ..dark() };
    let camera = Camera::look_at(DVec3::new(0.0, -8.0, 1.0), DVec3::ZERO, 0.5).unwrap();
    let mean = |integrator: Integrator, spp: u32, seed: u64| {
        let picture = sized(18, &scene, &camera, integrator, spp, 40_000, seed);
        std::array::from_fn(|c| picture.film.pixels.iter().map(|p| f64::from(p.combined()[c])).sum::<f64>())
    };
    let (path, se) = over(6, |seed| mean(Integrator::Path, 16, seed));
    let (voxels, noise) = over(4, |seed| mean(Integrator::Grid, 8, seed));
    for c in 0..3 {
        println!("{c}: path {:.4} +- {:.4}, grid {:.4} +- {:.4}", path[c], se[c], voxels[c], noise[c]);
        assert!((path[c] - voxels[c]).abs() < 4.0 * se[c].hypot(noise[c]) + 0.01 * path[c] && se[c] < 0.01 * path[c]);
    }
}

/// What is too cold or too bright for single precision is dark, or as bright as numbers go, and nothing else breaks.
#[test]
fn flames_of_any_strength_are_finite() {
    let ball = Shape::sphere(DVec3::ZERO, 1.0);
    let camera = facing(6.0, 1.5);
    for emission in [[1e-300; 3], [1e-60, 0.0, 1e-45], [1e30; 3]] {
        let regions = vec![region(ball.clone(), Medium::with_albedo(2.0, 0.9, 0.5))];
        let corner = |x: f64, y: f64| DVec3::new(x * 4.0, y * 4.0, -1.1);
        let vertices = vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0)];
        let ground = Surface { name: "ground".into(), mesh: Mesh { vertices, triangles: vec![[0, 1, 2]] }, albedo: [0.5; 3] };
        let scene = Scene { regions, surfaces: vec![ground], flames: vec![shining(&ball, emission)], ..dark() };
        for integrator in [Integrator::Path, Integrator::Grid, Integrator::Photon] {
            let picture = sized(6, &scene, &camera, integrator, 2, 500, 0);
            let wrong = picture.film.pixels.iter().filter(|p| p.combined().iter().any(|c| !c.is_finite())).count();
            assert_eq!(wrong, 0, "{emission:?} {integrator:?}");
        }
    }
}
