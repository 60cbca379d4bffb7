//! The closed-form flight against slow, obvious twins.

use super::*;
use crate::rng::{Rng, Stage};
use crate::sampling::unit_ball;
use crate::scene::{Medium, Mesh};
use glam::{DAffine3, DMat3, DQuat};
use std::sync::Arc;

fn region(shape: Shape, sigma_t: f64) -> Region {
    Region { name: String::new(), shape, medium: Medium::with_albedo(sigma_t, 1.0, 0.0), photons: None }
}

fn random_direction(rng: &mut Rng) -> Vec3 {
    unit_ball([rng.uniform(), rng.uniform(), 1.0]).as_vec3().normalize()
}

fn cube(side: f64) -> Mesh {
    let h = side / 2.0;
    let vertices = (0..8)
        .map(|i| DVec3::new(if i & 1 > 0 { h } else { -h }, if i & 2 > 0 { h } else { -h }, if i & 4 > 0 { h } else { -h }))
        .collect();
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = quads.iter().flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect();
    Mesh { vertices, triangles }
}

/// A random crowd of every shape, overlapping.
fn crowd(rng: &mut Rng, n: usize) -> Vec<Region> {
    (0..n)
        .map(|i| {
            let centre = unit_ball([rng.uniform(), rng.uniform(), rng.uniform()]) * 2.0;
            let sigma = 0.1 + 5.0 * rng.uniform();
            let shape = match i % 4 {
                0 | 1 => Shape::sphere(centre, 0.2 + rng.uniform()),
                2 => {
                    let axes = DVec3::new(0.3 + rng.uniform(), 0.2 + rng.uniform(), 0.5 + rng.uniform());
                    let turn = DMat3::from_quat(DQuat::from_rotation_y(rng.uniform() * 6.0) * DQuat::from_rotation_x(rng.uniform() * 6.0));
                    Shape::Ellipsoid { world_from_unit: DAffine3 { matrix3: turn * DMat3::from_diagonal(axes), translation: centre } }
                }
                _ => {
                    let mut mesh = cube(0.5 + rng.uniform());
                    mesh.vertices.iter_mut().for_each(|v| *v += centre);
                    Shape::Mesh(Arc::new(mesh))
                }
            };
            region(shape, sigma)
        })
        .collect()
}

/// Inside or not, by the definition of each shape: the slow twin's only knowledge.
fn inside(shape: &Shape, p: DVec3) -> bool {
    match shape {
        Shape::Ellipsoid { world_from_unit } => world_from_unit.inverse().transform_point3(p).length_squared() < 1.0,
        Shape::Slab { centre, half_height, .. } => (p.z - centre.z).abs() < *half_height,
        Shape::Mesh(mesh) => (p - mesh.bounds().centre()).abs().max_element() < mesh.bounds().size().x * 0.5,
        Shape::Grid(grid) => grid.density(p) > 0.0,
    }
}

/// A layer without extinction, such as an empty channel of a coloured one, takes nothing from a level ray that is in it for ever.
#[test]
fn a_level_ray_in_an_empty_layer_has_no_depth() {
    let shape = Shape::Slab { centre: DVec3::ZERO, half_height: 1.0, half_extent: glam::DVec2::ONE };
    let region = Region { name: "layer".into(), shape, medium: Medium::grey(0.0, 0.0, 0.0), photons: None };
    let (media, ray, mut scratch) =
        (Media::new(&[region], DVec3::ZERO), Ray { origin: Vec3::ZERO, direction: Vec3::X }, Scratch::default());
    assert_eq!(media.optical_depth(&ray, f32::INFINITY, &mut scratch), 0.0);
    let mut rng = Rng::new(1, crate::rng::Stage::Render, 0);
    assert_eq!(media.sunlight(Vec3::ZERO, Vec3::X, 1.0, &mut rng, &mut scratch), 1.0);
    assert_eq!(media.fly(&ray, f32::INFINITY, 0.1, 0.0, &mut rng, &mut scratch), Flight::Passed);
}

#[test]
fn optical_depth_equals_a_fine_march_through_overlapping_shapes() {
    let mut rng = Rng::new(1, Stage::Photons, 0);
    let regions = crowd(&mut rng, 24);
    let media = Media::new(&regions, DVec3::ZERO);
    let mut scratch = Scratch::default();
    for _ in 0..60 {
        let origin = unit_ball([rng.uniform(), rng.uniform(), rng.uniform()]) * 3.0;
        let ray = Ray { origin: origin.as_vec3(), direction: random_direction(&mut rng) };
        let (steps, length) = (40_000, 8.0);
        let march: f64 = (0..steps)
            .map(|i| {
                let p = origin + ray.direction.as_dvec3() * (length * (f64::from(i) + 0.5) / f64::from(steps));
                regions.iter().filter(|r| inside(&r.shape, p)).map(|r| r.medium.sigma_t()).sum::<f64>()
            })
            .sum::<f64>()
            * length
            / f64::from(steps);
        let exact = media.optical_depth(&ray, length as f32, &mut scratch);
        assert!((exact - march).abs() < 0.02 + 1e-3 * march, "{exact} against {march}");
    }
}

#[test]
fn flights_end_where_the_optical_depth_is_spent_whatever_the_hint() {
    let mut rng = Rng::new(2, Stage::Photons, 0);
    let regions = crowd(&mut rng, 24);
    let media = Media::new(&regions, DVec3::ZERO);
    let mut scratch = Scratch::default();
    let mut collided = 0;
    for _ in 0..3000 {
        let ray = Ray {
            origin: (unit_ball([rng.uniform(), rng.uniform(), rng.uniform()]) * 3.0).as_vec3(),
            direction: random_direction(&mut rng),
        };
        let tau = rng.optical_depth();
        let flight = media.fly_regions(&ray, f32::INFINITY, tau, 0.0, || 0.5, &mut scratch);
        assert_eq!(flight, media.fly_regions(&ray, f32::INFINITY, tau, 1e9, || 0.5, &mut scratch));
        let whole = media.optical_depth(&ray, f32::INFINITY, &mut scratch);
        match flight {
            Flight::Collision { distance, region, .. } => {
                collided += 1;
                let spent = media.optical_depth(&ray, distance, &mut scratch);
                assert!((spent - tau).abs() < 1e-4 * (1.0 + tau), "{spent} of {tau}");
                let p = ray.at(distance).as_dvec3();
                assert!(
                    inside(&regions[region as usize].shape, p)
                        || (0..6).any(|a| {
                            let nudge = if a % 2 == 0 { 1e-4 } else { -1e-4 } * DVec3::AXES[a / 2];
                            inside(&regions[region as usize].shape, p + nudge)
                        })
                );
            }
            Flight::Passed => assert!(whole <= tau * 1.000_01, "{whole} {tau}"),
        }
    }
    assert!(collided > 1000);
}

#[test]
fn overlapping_spheres_equal_one_sphere_of_summed_extinction() {
    let one = Media::new(&[region(Shape::sphere(DVec3::ZERO, 1.0), 6.0)], DVec3::ZERO);
    let three: Vec<Region> = [1.0, 2.0, 3.0].map(|s| region(Shape::sphere(DVec3::ZERO, 1.0), s)).to_vec();
    let three = Media::new(&three, DVec3::ZERO);
    let (mut rng, mut scratch) = (Rng::new(3, Stage::Photons, 0), Scratch::default());
    let mut counts = [0u32; 3];
    for _ in 0..60_000 {
        let ray = Ray {
            origin: (unit_ball([rng.uniform(), rng.uniform(), rng.uniform()]) * 1.5).as_vec3(),
            direction: random_direction(&mut rng),
        };
        let (tau, pick) = (rng.optical_depth(), rng.uniform());
        match (
            one.fly_regions(&ray, f32::INFINITY, tau, 0.0, || pick, &mut scratch),
            three.fly_regions(&ray, f32::INFINITY, tau, 0.0, || pick, &mut scratch),
        ) {
            (Flight::Collision { distance: a, .. }, Flight::Collision { distance: b, region, .. }) => {
                assert!((a - b).abs() < 1e-5);
                counts[region as usize] += 1;
            }
            (Flight::Passed, Flight::Passed) => {}
            other => panic!("{other:?}"),
        }
    }
    // Collisions fall to the regions in proportion to extinction: chi-squared with 2 degrees, 99.99 % at 18.4.
    let total = f64::from(counts.iter().sum::<u32>());
    let chi2: f64 = (0..3)
        .map(|i| {
            let e = total * (i + 1) as f64 / 6.0;
            (f64::from(counts[i]) - e).powi(2) / e
        })
        .sum();
    assert!(chi2 < 18.4, "{counts:?}: {chi2}");
}

#[test]
fn slabs_and_spheres_share_their_light_path() {
    let slab = Shape::Slab { centre: DVec3::ZERO, half_height: 1.0, half_extent: glam::DVec2::ONE };
    let media = Media::new(&[region(slab, 2.0), region(Shape::sphere(DVec3::ZERO, 0.5), 3.0)], DVec3::ZERO);
    let mut scratch = Scratch::default();
    let down = Ray { origin: Vec3::new(0.0, 0.0, 9.0), direction: Vec3::NEG_Z };
    assert!((media.optical_depth(&down, f32::INFINITY, &mut scratch) - 7.0).abs() < 1e-5);
    let level = Ray { origin: Vec3::new(0.0, 0.0, 0.9), direction: Vec3::X };
    let flight = media.fly_regions(&level, f32::INFINITY, 10.0, 0.0, || 0.0, &mut scratch);
    assert_eq!(flight, Flight::Collision { distance: 5.0, region: 0, sigma_t: 2.0 });
}

#[test]
fn hits_survive_a_thousand_radii_and_grazing() {
    // Haines 2019: the textbook discriminant loses 5 % of hits at 1,000 radii in f32.
    let media = Media::new(&[region(Shape::sphere(DVec3::ZERO, 1.0), 1.0)], DVec3::ZERO);
    let (mut rng, mut scratch) = (Rng::new(4, Stage::Photons, 0), Scratch::default());
    let (mut hits, n) = (0, 20_000);
    for _ in 0..n {
        let (x, y) = (rng.uniform_f32() * 2.0 - 1.0, rng.uniform_f32() * 2.0 - 1.0);
        let ray = Ray { origin: Vec3::new(x, y, 1000.0), direction: Vec3::NEG_Z };
        let expected = 2.0 * (1.0 - f64::from(x).powi(2) - f64::from(y).powi(2)).max(0.0).sqrt();
        let depth = media.optical_depth(&ray, f32::INFINITY, &mut scratch);
        hits += u32::from(depth > 0.0);
        assert!((depth - expected).abs() < 0.02, "{depth} {expected}");
    }
    let p = f64::from(hits) / f64::from(n);
    assert!((p - std::f64::consts::FRAC_PI_4).abs() < 4.5 * (0.785 * 0.215 / f64::from(n)).sqrt(), "{p}");
}

#[test]
fn rays_through_a_cubes_edges_and_diagonals_are_inside_once() {
    let media = Media::new(&[region(Shape::Mesh(Arc::new(cube(2.0))), 1.0)], DVec3::ZERO);
    let mut scratch = Scratch::default();
    for (x, y) in [(0.0, 0.0), (0.5, 0.5), (-0.25, -0.25), (0.5, -0.5), (0.0, 0.75)] {
        for direction in [Vec3::NEG_Z, Vec3::new(0.1, 0.1, -1.0).normalize()] {
            let down = Ray { origin: Vec3::new(x, y, 0.0) - direction * 5.0, direction };
            let expected = 2.0 / f64::from(-direction.z);
            let got = media.optical_depth(&down, f32::INFINITY, &mut scratch);
            assert!((got - expected).abs() < 1e-4 || (x.abs() > 0.7 && got <= expected + 1e-4), "({x}, {y}) {direction}: {got}");
        }
    }
}

#[test]
fn nothing_collides_beside_the_spheres() {
    // Within the lattice's box, but in a cell that no sphere reaches.
    let media = Media::new(&[region(Shape::sphere(DVec3::ZERO, 1.0), 20.0), region(Shape::sphere(DVec3::X * 4.0, 1.0), 20.0)], DVec3::ZERO);
    let mut scratch = Scratch::default();
    let ray = Ray { origin: Vec3::new(2.0, 0.9, 0.9), direction: Vec3::Y };
    assert_eq!(media.fly_regions(&ray, f32::INFINITY, 1e-9, 0.0, || 0.5, &mut scratch), Flight::Passed);
}

#[test]
fn the_mean_free_path_is_one_over_the_extinction() {
    // Exponential: mean 1 / sigma, variance 1 / sigma^2; also where two regions share the extinction.
    let both = [region(Shape::sphere(DVec3::ZERO, 1e3), 0.5), region(Shape::sphere(DVec3::X, 1e3), 1.5)];
    let media = Media::new(&both, DVec3::ZERO);
    let (mut rng, mut scratch, n) = (Rng::new(6, Stage::Photons, 0), Scratch::default(), 200_000);
    let (mut sum, mut sum2) = (0.0, 0.0);
    for _ in 0..n {
        let ray = Ray { origin: Vec3::new(0.5, 0.0, 0.0), direction: random_direction(&mut rng) };
        let Flight::Collision { distance, .. } = media.fly_regions(&ray, f32::INFINITY, rng.optical_depth(), 0.0, || 0.5, &mut scratch)
        else {
            panic!()
        };
        sum += f64::from(distance);
        sum2 += f64::from(distance).powi(2);
    }
    let (mean, mean2) = (sum / f64::from(n), sum2 / f64::from(n));
    assert!((mean - 0.5).abs() < 4.5 * 0.5 / f64::from(n).sqrt(), "{mean}");
    // The second moment 2 / sigma^2 has variance 20 / sigma^4.
    assert!((mean2 - 0.5).abs() < 4.5 * 20f64.sqrt() / 4.0 / f64::from(n).sqrt(), "{mean2}");
}

#[test]
fn extreme_scales_stay_finite() {
    for radius in [1e-6, 1.0, 1e6] {
        for sigma in [1e-12, 1.0, 1e12] {
            let media = Media::new(
                &[region(Shape::sphere(DVec3::ZERO, radius), sigma), region(Shape::sphere(DVec3::ZERO, 1e6), 1e-12)],
                DVec3::ZERO,
            );
            let (mut rng, mut scratch) = (Rng::new(5, Stage::Photons, 0), Scratch::default());
            for _ in 0..500 {
                let ray = Ray { origin: random_direction(&mut rng) * (radius as f32 * 2.0), direction: random_direction(&mut rng) };
                let depth = media.optical_depth(&ray, f32::INFINITY, &mut scratch);
                assert!(depth.is_finite() && depth >= 0.0 && depth <= 2.000_01 * (radius * sigma + 1e-6), "{radius} {sigma}: {depth}");
                if let Flight::Collision { distance, .. } =
                    media.fly_regions(&ray, f32::INFINITY, rng.optical_depth(), sigma, || 0.3, &mut scratch)
                {
                    assert!(distance.is_finite() && distance >= 0.0);
                }
            }
        }
    }
}

#[test]
fn a_crowd_too_large_for_a_lattice_does_without() {
    // Each sphere is in one cell at least: no cell, however coarse, keeps so many within the room for entries.
    let mut rng = Rng::new(6, Stage::Photons, 0);
    let balls: Vec<(Vec3, f32, u32)> = (0..4_100_000).map(|_| (Vec3::new(rng.uniform_f32(), rng.uniform_f32(), 0.0), 1e-3, 0)).collect();
    assert!(Cells::new(&balls, &[Optics { sigma_t: 100.0, albedo: 1.0, g: 0.0 }]).is_empty());
}

#[test]
fn flights_that_start_between_spheres_collide_only_where_the_depth_suffices() {
    // Two spheres far apart: most of the lattice's cells hold nothing.
    let regions = [region(Shape::sphere(DVec3::Z * -10.0, 1.0), 2.0), region(Shape::sphere(DVec3::Z * 10.0, 1.0), 1.0)];
    let media = Media::new(&regions, DVec3::ZERO);
    assert!(!media.cells.is_empty());
    let (mut rng, mut scratch) = (Rng::new(7, Stage::Photons, 0), Scratch::default());
    let mut collided = 0;
    for _ in 0..20_000 {
        let origin = (DVec3::new(rng.uniform(), rng.uniform(), rng.uniform()) * 2.0 - 1.0) * DVec3::new(1.0, 1.0, 11.4);
        let ray = Ray { origin: origin.as_vec3(), direction: (Vec3::Z + 0.1 * random_direction(&mut rng)).normalize() };
        let tau = rng.optical_depth();
        let whole = media.optical_depth(&ray, f32::INFINITY, &mut scratch);
        match media.fly_regions(&ray, f32::INFINITY, tau, 0.0, || 0.5, &mut scratch) {
            Flight::Collision { distance, .. } => {
                collided += 1;
                assert!(distance.is_finite() && distance >= 0.0 && whole * 1.000_01 >= tau, "{ray:?}: {distance}, {whole} {tau}");
            }
            Flight::Passed => assert!(whole <= tau * 1.000_01, "{ray:?}: {whole} {tau}"),
        }
    }
    assert!(collided > 1000);
}
