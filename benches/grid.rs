//! What walks through a sparse voxel grid reach: tentative collisions a second on two threads, and what pass 1 makes of them.
//!
//! `cargo bench --bench grid`. A tentative collision is one step of null-collision sampling, accepted or not. Medians of many short
//! runs in turn: by the clock, and by the processor time that was spent, which other work on the machine disturbs less.
#![allow(missing_docs, clippy::unwrap_used)]

use cloudvdb::geom::Ray;
use cloudvdb::media::{Flight, Media, Scratch};
use cloudvdb::photon::{Model, Tracer};
use cloudvdb::plan::{Density, Plan};
use cloudvdb::progress::Silent;
use cloudvdb::rng::{Rng, Stage};
use cloudvdb::sampling::{around, unit_ball};
use cloudvdb::scene::phase::sample_henyey_greenstein;
use cloudvdb::scene::{BrickGrid, Medium, Region, Scene, Shape, VoxelGrid};
use glam::{DAffine3, IVec3, Vec3};
use rayon::prelude::*;
use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

/// Samples along an axis, a metre apart.
const SIDE: i32 = 192;
/// Of the cloud, through its middle.
const DEPTH: f64 = 60.0;
const G: f64 = 0.86;
const ALBEDO: f64 = 0.9999;
const THREADS: usize = 2;
const RUNS: u64 = 15;
/// Paths of a run, and of each stream of random numbers in it.
const PATHS: u64 = 16384;
const BATCH: u64 = 64;

/// A number in [0, 1) for each index.
fn hash(at: IVec3) -> f32 {
    let mixed = (at.x as u64) << 42 ^ (at.y as u64) << 21 ^ at.z as u64;
    let mixed = (mixed ^ mixed >> 31).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let mixed = (mixed ^ mixed >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    ((mixed ^ mixed >> 32) >> 40) as f32 / (1u64 << 24) as f32
}

/// Noise between the numbers of a lattice, `scale` samples apart.
fn noise(at: IVec3, scale: i32) -> f32 {
    let (base, f) = (at.div_euclid(IVec3::splat(scale)), at.rem_euclid(IVec3::splat(scale)).as_vec3() / scale as f32);
    (0..8).fold(0.0, |sum, corner| {
        let side = IVec3::new(corner >> 2 & 1, corner >> 1 & 1, corner & 1);
        let weight = Vec3::select(side.cmpeq(IVec3::ONE), f, 1.0 - f);
        sum + weight.element_product() * hash(base + side)
    })
}

/// A cumulus: a union of soft balls on a flat base, frayed by noise of three sizes.
fn cloud() -> Arc<VoxelGrid> {
    let mut rng = Rng::new(20, Stage::Regions, 0);
    let half = SIDE as f32 / 2.0;
    let balls: Vec<(Vec3, f32)> = (0..48)
        .map(|_| {
            let p = unit_ball([rng.uniform(), rng.uniform(), rng.uniform()]).as_vec3() * Vec3::new(0.62, 0.62, 0.45);
            (half + p * half, half * (0.12 + 0.2 * rng.uniform_f32()))
        })
        .collect();
    let density = |at: IVec3| {
        let fray = 0.6 * noise(at, 16) + 0.3 * noise(at, 8) + 0.2 * noise(at, 3) - 0.45;
        let inside = balls.iter().map(|(c, r)| 1.0 - c.distance(at.as_vec3()) / r).fold(f32::MIN, f32::max);
        (4.0 * inside + 1.6 * fray).clamp(0.0, 1.0) * (0.4 + 0.6 * noise(at, 12))
    };
    let corners: Vec<IVec3> =
        (0..(SIDE / 8).pow(3)).map(|i| IVec3::new(i / (SIDE / 8).pow(2), i / (SIDE / 8) % (SIDE / 8), i % (SIDE / 8)) * 8).collect();
    let brick = |corner: &IVec3| (0..512).map(|v| density(*corner + IVec3::new(v >> 6, v >> 3 & 7, v & 7))).collect::<Vec<f32>>();
    let mut all: Vec<(IVec3, Vec<f32>)> = corners.par_iter().map(|c| (*c, brick(c))).collect();
    all.retain(|(_, values)| values.iter().any(|&v| v > 0.0));
    let (origins, values) = (all.iter().map(|(c, _)| c.to_array()).collect(), all.iter().flat_map(|(_, v)| v.iter().copied()).collect());
    let bricks = BrickGrid { world_from_index: DAffine3::IDENTITY, origins, values };
    Arc::new(VoxelGrid::new(bricks, [0; 3], [SIDE - 1; 3], false))
}

/// The cloud in the sun, as dense as it takes.
fn scene() -> Scene {
    let grid = cloud();
    let region = |sigma_t: f64| Region {
        name: "cloud".into(),
        shape: Shape::Grid(Arc::clone(&grid)),
        medium: Medium::with_albedo(sigma_t, ALBEDO, G),
        photons: None,
    };
    let thin = Media::new(&[region(1.0)], grid.bounds().centre());
    let across: Vec<f64> = [Vec3::X, Vec3::Y, Vec3::Z]
        .map(|direction| thin.optical_depth(&Ray { origin: direction * -300.0, direction }, f32::INFINITY, &mut Scratch::default()))
        .to_vec();
    let scene = Scene { regions: vec![region(DEPTH * 3.0 / across.iter().sum::<f64>())], ..Scene::default() };
    let active = grid.bricks.active_voxels() as f64 / f64::from(SIDE).powi(3);
    println!("{SIDE}^3 samples, {:.1} % active in {} bricks", 100.0 * active, grid.bricks.origins.len());
    scene
}

/// A ray of the sun's, spread over the cloud.
fn sun_ray(rng: &mut Rng) -> Ray {
    let direction = Vec3::new(0.4, -0.3, -0.85).normalize();
    let aim = unit_ball([rng.uniform(), rng.uniform(), rng.uniform()]).as_vec3() * 0.4 * SIDE as f32;
    Ray { origin: aim - direction * 400.0, direction }
}

/// A ray of a camera's beside the cloud.
fn camera_ray(rng: &mut Rng) -> Ray {
    let (origin, aim) = (Vec3::new(-350.0, -80.0, -40.0), (rng.uniform_vec3() - 0.5) * Vec3::new(0.0, 0.7, 0.5) * SIDE as f32);
    Ray { origin, direction: (aim - origin).normalize() }
}

/// Walks along a ray until it is absorbed or leaves: collisions.
fn walk(media: &Media, mut ray: Ray, rng: &mut Rng, scratch: &mut Scratch) -> u64 {
    let mut collisions = 0;
    loop {
        let tau = rng.optical_depth();
        let Flight::Collision { distance, region, .. } = media.fly(&ray, f32::INFINITY, tau, 0.0, rng, scratch) else {
            return collisions;
        };
        collisions += 1;
        let optics = media.optics(region);
        if rng.uniform() >= optics.albedo {
            return collisions;
        }
        let (cos, sin) = sample_henyey_greenstein(optics.g, rng.uniform());
        ray = Ray { origin: ray.at(distance), direction: around(ray.direction, cos as f32, sin as f32, rng.uniform_f32()) };
    }
}

/// All walks of a run: tentative collisions, and collisions.
fn walks(media: &Media, start: impl Fn(&mut Rng) -> Ray + Sync, run: u64) -> (u64, u64) {
    let batch = |item: u64| {
        let (mut rng, mut scratch) = (Rng::new(run, Stage::Photons, item), Scratch::default());
        let collisions = (0..BATCH).map(|_| walk(media, start(&mut rng), &mut rng, &mut scratch)).sum::<u64>();
        (scratch.tentative, collisions)
    };
    (0..PATHS / BATCH).into_par_iter().map(batch).reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1))
}

/// Looks at the sun from points of the cloud: their number.
fn looks(media: &Media, run: u64) -> u64 {
    let batch = |item: u64| {
        let (mut rng, mut scratch) = (Rng::new(run, Stage::Render, item), Scratch::default());
        let toward = Vec3::new(-0.4, 0.3, 0.85).normalize();
        let point = |rng: &mut Rng| unit_ball([rng.uniform(), rng.uniform(), rng.uniform()]).as_vec3() * 0.4 * SIDE as f32;
        (0..1024).map(|_| media.sunlight(point(&mut rng), toward, 1.0, &mut rng, &mut scratch)).sum::<f64>()
    };
    black_box((0..32).into_par_iter().map(batch).sum::<f64>());
    32 * 1024
}

/// Seconds that the processors have given to this process's threads; where the system does not say, `None`.
fn processor_time() -> Option<f64> {
    let one = |task: std::fs::DirEntry| std::fs::read_to_string(task.path().join("schedstat")).ok()?.split(' ').next()?.parse::<f64>().ok();
    Some(std::fs::read_dir("/proc/self/task").ok()?.flatten().filter_map(one).sum::<f64>() * 1e-9)
}

/// Millions a second of what was counted: by the clock, and by processor time on [`THREADS`] of them.
fn rate(run: impl FnOnce() -> u64) -> [f64; 2] {
    let (clock, spent) = (Instant::now(), processor_time());
    let count = run() as f64 * 1e-6;
    let clock = clock.elapsed().as_secs_f64();
    let spent = spent.zip(processor_time()).map_or(clock, |(before, after)| (after - before) / THREADS as f64);
    [count / clock, count / spent]
}

fn median(mut of: Vec<f64>) -> f64 {
    of.sort_unstable_by(f64::total_cmp);
    of[of.len() / 2]
}

fn main() {
    rayon::ThreadPoolBuilder::new().num_threads(THREADS).build_global().unwrap();
    let scene = scene();
    let mut media = Media::new(&scene.regions, scene.region_bounds().centre());
    media.learn_shade(Vec3::new(-0.4, 0.3, 0.85).normalize());
    let tracer = Tracer::new(&scene, &Plan::for_scene(&scene, Density::Duality), Model::Physical);
    let (tentative, collisions) = walks(&media, sun_ray, 0);
    println!(
        "{:.2} tentative collisions a collision, {:.1} collisions a photon",
        tentative as f64 / collisions as f64,
        collisions as f64 / PATHS as f64
    );
    let names = ["tentative collisions, photons", "tentative collisions, camera rays", "collisions, Tracer::fill", "looks at the sun"];
    let mut rates = vec![Vec::new(); names.len()];
    for run in 0..RUNS {
        rates[0].push(rate(|| walks(&media, sun_ray, run).0));
        rates[1].push(rate(|| walks(&media, camera_ray, run).0));
        rates[2].push(rate(|| tracer.fill(200_000, run, &Silent).unwrap().collisions));
        rates[3].push(rate(|| looks(&media, run)));
    }
    for (name, rates) in names.iter().zip(rates) {
        let [clock, spent] = [0, 1].map(|i| median(rates.iter().map(|r| r[i]).collect()));
        println!("{name:36} {clock:6.2} M/s by the clock, {spent:6.2} M/s by processor time");
    }
}
