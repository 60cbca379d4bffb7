//! The mass within a ball against points drawn in it.

use super::*;
use crate::rng::{Rng, Stage};
use crate::sampling::unit_ball;
use crate::scene::{Medium, Mesh, Region, Shape};
use glam::{DAffine3, DMat3, DVec2, DVec3};
use std::sync::Arc;

fn region(shape: Shape, sigma_t: f64, albedo: f64) -> Region {
    Region { name: String::new(), shape, medium: Medium::with_albedo(sigma_t, albedo, 0.0), photons: None }
}

/// The mass by `points` random points, and its standard error.
fn drawn(c: DVec3, r: f64, rng: &mut Rng, extinction: impl Fn(DVec3) -> f64) -> (f64, f64) {
    let n = 40_000;
    let (mut sum, mut squares) = (0.0, 0.0);
    for _ in 0..n {
        let x = extinction(c + r * unit_ball([rng.uniform(), rng.uniform(), rng.uniform()]));
        (sum, squares) = (sum + x, squares + x * x);
    }
    let (n, volume) = (f64::from(n), 4.0 / 3.0 * PI * r.powi(3));
    let mean = sum / n;
    (mean * volume, ((squares / n - mean * mean).max(0.0) / n).sqrt() * volume)
}

#[test]
fn overlapping_spheres_and_slabs_have_their_mass_in_closed_form() {
    let mut rng = Rng::new(9, Stage::Gather, 1);
    let ball = |rng: &mut Rng| unit_ball([rng.uniform(), rng.uniform(), rng.uniform()]);
    let mut z = Vec::new();
    for _ in 0..60 {
        let spheres: Vec<(DVec3, f64, f64)> = (0..12).map(|_| (ball(&mut rng), 0.1 + rng.uniform(), rng.uniform() * 3.0)).collect();
        let mut regions: Vec<Region> = spheres.iter().map(|&(c, r, s)| region(Shape::sphere(c, r), s, 0.9)).collect();
        // What only absorbs holds no photons.
        regions.push(region(Shape::sphere(DVec3::ZERO, 0.7), 5.0, 0.0));
        regions.push(region(Shape::Slab { centre: DVec3::Z * 0.2, half_height: 0.3, half_extent: DVec2::ONE }, 2.0, 0.5));
        let media = Media::new(&regions, DVec3::ZERO);
        let (c, r) = (ball(&mut rng) * 1.5, 0.05 + 0.8 * rng.uniform());
        let found = media.mass_within(c.as_vec3(), r as f32);
        let (mass, se) = drawn(c, r, &mut rng, |p| {
            let of = |&(o, r, s): &(DVec3, f64, f64)| if o.distance(p) < r { s } else { 0.0 };
            spheres.iter().map(of).sum::<f64>() + if (p.z - 0.2).abs() < 0.3 { 2.0 } else { 0.0 }
        });
        // Centres and radii are rounded to single precision.
        let rounding = 1e-6 * mass;
        if se > rounding {
            z.push((found - mass) / se.hypot(rounding));
        } else {
            assert!((found - mass).abs() <= 5.0 * (rounding + se), "{found}, {mass}");
        }
    }
    // Chi-squared at 4.5 sigma, and none alone beyond that.
    let (n, sum) = (z.len() as f64, z.iter().map(|z| z * z).sum::<f64>());
    assert!(n > 40.0 && (sum - n).abs() < 4.5 * (2.0 * n).sqrt() && z.iter().all(|z| z.abs() < 4.5), "{n}, {sum}, {z:?}");
}

#[test]
fn touching_and_concentric_balls_share_what_they_should() {
    let unit = 4.0 / 3.0 * PI;
    for (d, a, b, shared) in
        [(0.0, 1.0, 2.0, unit), (3.0, 1.0, 2.0, 0.0), (1.0, 1.0, 2.0, unit), (0.0, 1.0, 1.0, unit), (1e-9, 1.0, 1.0, unit)]
    {
        assert!((shared_by_balls(d, a, b) - shared).abs() < 1e-7, "{d} {a} {b}: {}", shared_by_balls(d, a, b));
    }
    // Two unit balls a radius apart: 5 pi / 12 (two caps of height 1/2).
    assert!((shared_by_balls(1.0, 1.0, 1.0) - 5.0 * PI / 12.0).abs() < 1e-12);
    assert_eq!((below(2.0, 1.0), below(-2.0, 1.0)), (unit, 0.0));
    assert!((below(0.0, 1.0) - unit / 2.0).abs() < 1e-12);
}

#[test]
fn other_shapes_have_their_mass_by_points_of_the_ball() {
    let flat = DAffine3 { matrix3: DMat3::from_diagonal(DVec3::new(1.0, 1.0, 0.4)), translation: DVec3::ZERO };
    let corner = |i: usize| DVec3::new((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2 & 1) as f64) * 2.0 - 1.0;
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = quads.iter().flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect();
    let cube = Mesh { vertices: (0..8).map(corner).collect(), triangles };
    let inside_flat = |p: DVec3| (p / DVec3::new(1.0, 1.0, 0.4)).length_squared() < 1.0;
    let inside_cube = |p: DVec3| p.abs().max_element() < 1.0;
    let shapes: [(Shape, &dyn Fn(DVec3) -> bool); 2] =
        [(Shape::Ellipsoid { world_from_unit: flat }, &inside_flat), (Shape::Mesh(Arc::new(cube)), &inside_cube)];
    let mut rng = Rng::new(10, Stage::Gather, 1);
    for (shape, inside) in shapes {
        let media = Media::new(&[region(shape, 2.0, 0.9)], DVec3::ZERO);
        let mut off = Vec::new();
        for _ in 0..50 {
            let (c, r) = (unit_ball([rng.uniform(), rng.uniform(), rng.uniform()]), 0.05 + 0.3 * rng.uniform());
            let whole = 2.0 * 4.0 / 3.0 * PI * r.powi(3);
            let (mass, _) = drawn(c, r, &mut rng, |p| if inside(p) { 2.0 } else { 0.0 });
            off.push((media.mass_within(c.as_vec3(), r as f32) - mass) / whole);
        }
        // A share of 64 even points is better known than one of 64 random ones: within 1 / 8 of the whole ball each, 1 / 16 in the mean.
        let rms = (off.iter().map(|x| x * x).sum::<f64>() / 50.0).sqrt();
        assert!(off.iter().all(|x| x.abs() < 0.125) && rms < 0.0625, "{rms}, {off:?}");
    }
}
