//! Samplers at the ends of their ranges: no NaN, no infinity, no panic, and what they return lies where it may.

use cloudvdb::geom::{Ray, basis};
use cloudvdb::media::{Flight, Media, Scratch};
use cloudvdb::rng::{Rng, Stage};
use cloudvdb::sampling::{around, cosine_hemisphere, uniform_disc, unit_ball};
use cloudvdb::scene::phase::{henyey_greenstein, sample_eq19, sample_henyey_greenstein};
use cloudvdb::scene::{BrickGrid, Medium, Region, Shape, VoxelGrid};
use glam::{DAffine3, DMat3, DVec2, DVec3, Vec3};
use rayon::prelude::*;
use std::sync::Arc;

/// 1 - 2^-53: the largest number that [`Rng::uniform`] returns.
const LAST: f64 = 1.0 - f64::EPSILON / 2.0;

/// A number in [0, 1) that is hard on a formula, or any.
fn hard(rng: &mut Rng) -> f64 {
    const HARD: [f64; 12] =
        [0.0, f64::EPSILON / 2.0, f64::EPSILON, 1e-12, 2e-9, 1e-6, 0.25, 0.5, 0.75, 1.0 - 1e-6, 1.0 - f64::EPSILON, LAST];
    let pick = (rng.uniform() * 24.0) as usize;
    HARD.get(pick).copied().unwrap_or_else(|| rng.uniform())
}

/// As [`hard`], in single precision: never 1.
fn hard_f32(rng: &mut Rng) -> f32 {
    (hard(rng) as f32).min(1.0 - f32::EPSILON / 2.0)
}

/// A unit vector: along an axis, nearly so, of denormal parts, or any.
fn direction(rng: &mut Rng) -> Vec3 {
    let axis = Vec3::AXES[(rng.uniform() * 3.0) as usize] * if rng.uniform() < 0.5 { 1.0 } else { -1.0 };
    let any = unit_ball([rng.uniform(), rng.uniform(), 1.0]).as_vec3().normalize();
    match (rng.uniform() * 6.0) as u32 {
        0 => axis,
        1 => (axis + any * 1e-4).normalize(),
        2 => (axis + any * 1e-7).normalize(),
        3 => axis + any * 1e-40,
        4 => Vec3::ONE.normalize() * axis.dot(Vec3::ONE),
        _ => any,
    }
}

const GS: [f64; 13] = [0.0, 1e-9, -1e-9, 1e-3, -1e-3, 0.85, 0.99, -0.99, 0.9999, -0.9999, 1.0 - 1e-6, -(1.0 - 1e-6), f64::MIN_POSITIVE];

fn unit(what: &str, v: Vec3) {
    assert!((v.length() - 1.0).abs() < 1e-5, "{what}: {v}, of length {}", v.length());
}

/// One call of each warp.
fn warps(rng: &mut Rng) {
    let g = GS[(rng.uniform() * GS.len() as f64) as usize];
    let (xi, u) = (hard(rng), hard_f32(rng));
    let (cos, sin) = sample_henyey_greenstein(g, xi);
    assert!((-1.0..=1.0).contains(&cos) && (cos * cos + sin * sin - 1.0).abs() < 1e-9 && sin >= 0.0, "g {g}, xi {xi}: {cos}, {sin}");
    let (cos19, sin19) = sample_eq19(g, xi);
    assert!((-1.0..=1.0).contains(&cos19) && (0.0..=1.0).contains(&sin19), "eq. 19, g {g}, xi {xi}: {cos19}, {sin19}");
    let value = henyey_greenstein(g, hard(rng) * 2.0);
    assert!(value.is_finite() && value >= 0.0, "g {g}: {value}");
    let axis = direction(rng);
    let (s, t) = basis(axis);
    assert!(s.dot(t).abs() < 1e-5 && s.dot(axis).abs() < 1e-5 && t.dot(axis).abs() < 1e-5, "{axis}: {s}, {t}");
    unit("scattered", around(axis, cos as f32, sin as f32, u));
    unit("reflected", cosine_hemisphere(axis, hard_f32(rng), u));
    unit("of the sun's disc", uniform_disc(axis, hard_f32(rng), hard_f32(rng), u));
    let ball = unit_ball([hard(rng), hard(rng), hard(rng)]);
    assert!(ball.length() <= 1.0 + 1e-12, "{ball}");
    let tau = rng.optical_depth();
    assert!((0.0..37.0).contains(&tau), "{tau}");
}

/// Media of every shape and extinction, and the half extent that rays should know.
fn worlds() -> Vec<(String, Media, f32)> {
    let region =
        |shape: Shape, sigma: f64| Region { name: String::new(), shape, medium: Medium::with_albedo(sigma, 0.9, 0.5), photons: None };
    let checker = |size: f64, low: f32, high: f32| {
        let values = (0..512).map(|i| if (i ^ i >> 3 ^ i >> 6) & 1 == 0 { low } else { high }).collect();
        let matrix3 = DMat3::from_diagonal(DVec3::splat(size / 4.0));
        let world_from_index = DAffine3 { matrix3, translation: DVec3::splat(-0.875 * size) };
        let bricks = BrickGrid { world_from_index, origins: vec![[0; 3]], values };
        Shape::Grid(Arc::new(VoxelGrid::new(bricks, [0; 3], [7; 3], false)))
    };
    let mut worlds = Vec::new();
    for size in [1e-6, 1.0, 1e6] {
        for sigma in [0.0, 1e-12, 1.0, 1e6, 1e12] {
            let (sphere, squashed) = (Shape::sphere(DVec3::ZERO, size), DMat3::from_diagonal(DVec3::new(size, 1e-3 * size, 0.5 * size)));
            let ellipsoid = Shape::Ellipsoid { world_from_unit: DAffine3 { matrix3: squashed, translation: DVec3::ZERO } };
            let slab = Shape::Slab { centre: DVec3::ZERO, half_height: size, half_extent: DVec2::splat(size) };
            let inner = Shape::sphere(DVec3::X * 0.5 * size, 0.5 * size);
            let kinds = [
                ("sphere", vec![sphere.clone()]),
                ("ellipsoid", vec![ellipsoid]),
                ("slab", vec![slab]),
                ("touching inside", vec![sphere.clone(), inner]),
                ("identical", vec![sphere.clone(), sphere]),
                ("checkered voxels", vec![checker(size, 0.0, 1.0)]),
                ("denormal voxels", vec![checker(size, 0.0, 1e-40)]),
            ];
            for (kind, shapes) in kinds {
                // Thicker voxels are refused at import: a flight takes the root of their depth in steps.
                if kind.ends_with("voxels") && sigma > 1e6 {
                    continue;
                }
                let regions: Vec<Region> = shapes.into_iter().map(|shape| region(shape, sigma / size)).collect();
                worlds.push((format!("{kind} of {size:e} m, {sigma:e} mean free paths"), Media::new(&regions, DVec3::ZERO), size as f32));
            }
        }
    }
    worlds
}

/// A free flight and an optical depth along a ray from a hard place in a hard direction: axes, corners of voxels, tangents.
fn flight((name, media, size): &(String, Media, f32), rng: &mut Rng, scratch: &mut Scratch) {
    let corner = Vec3::from_array(std::array::from_fn(|_| (rng.uniform() * 9.0).floor() as f32 / 4.0 - 1.0));
    let any = direction(rng) * rng.uniform_f32();
    let place = match (rng.uniform() * 6.0) as u32 {
        0 => Vec3::ZERO,
        1 => direction(rng),
        2 => corner,
        3 => direction(rng) * 1e6,
        4 => corner + any * 1e-6,
        _ => any,
    };
    let mut toward = direction(rng);
    if rng.uniform() < 0.3 {
        toward = (corner - place).normalize_or(toward);
    }
    let ray = Ray { origin: place * *size, direction: toward };
    let t_max = [f32::INFINITY, *size, 0.0][(rng.uniform() * 3.0) as usize];
    let depth = media.optical_depth(&ray, t_max, scratch);
    // A level ray in a layer without end is as deep as nothing is.
    let endless = name.starts_with("slab") && !name.contains(" 0e0 ") && t_max == f32::INFINITY;
    assert!(depth >= 0.0 && (depth.is_finite() || endless), "{name}: {depth} along {ray:?} to {t_max}");
    let tau = if rng.uniform() < 0.2 { 0.0 } else { rng.optical_depth() };
    if let Flight::Collision { distance, region, sigma_t } = media.fly(&ray, t_max, tau, 0.0, rng, scratch) {
        assert!(distance >= 0.0 && distance <= t_max && distance.is_finite(), "{name}: {distance} along {ray:?} to {t_max}");
        assert!((region as usize) < 2 && sigma_t.is_finite() && sigma_t >= 0.0, "{name}: {region}, {sigma_t}");
    }
    let clear = media.sunlight(ray.origin, toward, hard_f32(rng), rng, scratch);
    assert!(clear.is_finite(), "{name}: {clear} from {ray:?}");
}

/// So many calls in all, by batches with a stream each.
fn calls(count: u64) {
    // Nine of warps and three of flights, a round.
    const ROUNDS: u64 = 1000;
    let worlds = worlds();
    (0..count.div_ceil(12 * ROUNDS)).into_par_iter().for_each(|batch| {
        let (mut rng, mut scratch) = (Rng::new(8, Stage::Render, batch), Scratch::default());
        for round in batch * ROUNDS..(batch + 1) * ROUNDS {
            warps(&mut rng);
            flight(&worlds[round as usize % worlds.len()], &mut rng, &mut scratch);
        }
        assert_eq!(scratch.violations, 0);
    });
}

#[test]
fn four_million_calls_of_samplers() {
    calls(4_000_000);
}

#[test]
#[ignore = "minutes"]
fn a_billion_calls_of_samplers() {
    calls(1_000_000_000);
}
