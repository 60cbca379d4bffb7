//! Where single precision matters, and by how much: the balance of a ball, beside a slow twin that computes everything in `f64`.

use crate::pictures::lit;
use cloudvdb::integrate::flux::flux;
use cloudvdb::plan::{Density, Plan};
use cloudvdb::progress::Silent;
use cloudvdb::rng::{Rng, Stage};
use cloudvdb::scene::phase::sample_henyey_greenstein;
use cloudvdb::scene::{Medium, Region, Shape};
use cloudvdb::stats::{Estimate, Ratios};
use glam::DVec3;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// A ball of a homogeneous medium at `place`, in a scene whose middle lies at the origin.
#[derive(Debug, Clone, Copy)]
struct Ball {
    radius: f64,
    sigma: f64,
    albedo: f64,
    g: f64,
    place: DVec3,
}

/// A vector perpendicular to `n`, and the other one.
fn basis(n: DVec3) -> (DVec3, DVec3) {
    let s = n.any_orthonormal_vector();
    (s, n.cross(s))
}

/// How far the ray goes inside the ball, from a point within or on it: the exit of [`ray`](Haines 2019) in `f64`.
fn exit(ball: &Ball, o: DVec3, d: DVec3) -> f64 {
    let b = o.dot(d);
    let nearest = (o - b * d).length();
    let half = ((ball.radius + nearest) * (ball.radius - nearest)).max(0.0).sqrt();
    if b > 0.0 { (ball.radius * ball.radius - o.length_squared()).max(0.0) / (half + b) } else { half - b }
}

/// What is absorbed, leaves upward, leaves downward, of light straight down: photons of weight 1, absorbed by chance.
fn twin(ball: &Ball, photons: u64) -> [Estimate; 3] {
    let batch = |item: u64| {
        let mut rng = Rng::new(77, Stage::Flux, item);
        let mut ends = [0.0; 3];
        for _ in 0..1000 {
            let (r, phi) = (rng.uniform().sqrt() * ball.radius, TAU * rng.uniform());
            // Positions are about the ball's centre: nothing is lost where it lies.
            let mut o = DVec3::new(r * phi.cos(), r * phi.sin(), ((ball.radius - r) * (ball.radius + r)).sqrt());
            let mut d = DVec3::NEG_Z;
            let end = loop {
                let distance = rng.optical_depth() / ball.sigma;
                if distance >= exit(ball, o, d) {
                    break if d.z > 0.0 { 1 } else { 2 };
                }
                if rng.uniform() >= ball.albedo {
                    break 0;
                }
                o += d * distance;
                let (cos, sin) = sample_henyey_greenstein(ball.g, rng.uniform());
                let ((s, t), phi) = (basis(d), TAU * rng.uniform());
                d = (s * (sin * phi.cos()) + t * (sin * phi.sin()) + d * cos).normalize();
            };
            ends[end] += 1.0;
        }
        ends
    };
    let mut sums = Ratios::<3>::default();
    for ends in (0..photons.div_ceil(1000)).into_par_iter().map(batch).collect::<Vec<_>>() {
        sums.add(ends, 1000.0);
    }
    [0, 1, 2].map(|i| sums.ratio(i))
}

/// The same by the library. Where the ball does not lie at the origin, one of vacuum as far on the other side puts the scene's
/// middle there.
fn ours(ball: &Ball, photons: u64) -> [Estimate; 3] {
    let region = |place: DVec3, sigma: f64| Region {
        name: "ball".into(),
        shape: Shape::sphere(place, ball.radius),
        medium: Medium::with_albedo(sigma, ball.albedo, ball.g),
        photons: None,
    };
    let mut regions = vec![region(ball.place, ball.sigma)];
    let aside = ball.place != DVec3::ZERO;
    if aside {
        regions.push(region(-ball.place, 0.0));
    }
    let scene = lit(regions, DVec3::NEG_Z, 0.0);
    let f = flux(&scene, &Plan::for_scene(&scene, Density::Source), if aside { 2 * photons } else { photons }, 5, &Silent).unwrap();
    // Light on the other one counts too, and passes.
    let share = if aside { 0.5 } else { 1.0 };
    let of = |e: Estimate| Estimate { value: e.value / share, se: e.se / share };
    let down = f.down_direct.value + f.down_diffuse.value - (1.0 - share);
    let se = f.down_direct.se.hypot(f.down_diffuse.se);
    [of(f.absorbed_medium), of(f.up), Estimate { value: down / share, se: se / share }]
}

/// One row; the largest difference in standard errors, and the difference in what is absorbed with its standard error.
fn row(name: &str, ball: &Ball, photons: u64) -> (f64, Estimate) {
    let (a, b) = (ours(ball, photons), twin(ball, photons));
    let z = |i: usize| (a[i].value - b[i].value) / a[i].se.hypot(b[i].se).max(1e-12);
    let zs = [0, 1, 2].map(z);
    println!(
        "{name:<44} | {:.5} | {:.5} | {:+.5} +- {:.5} | {:+.1} {:+.1} {:+.1}",
        b[0].value,
        a[0].value,
        a[0].value - b[0].value,
        a[0].se.hypot(b[0].se),
        zs[0],
        zs[1],
        zs[2]
    );
    (zs.iter().fold(0.0, |most: f64, z| most.max(z.abs())), Estimate { value: a[0].value - b[0].value, se: a[0].se.hypot(b[0].se) })
}

/// A ball of radius 1 m at the origin.
fn alone(sigma: f64, albedo: f64, g: f64) -> Ball {
    Ball { radius: 1.0, sigma, albedo, g, place: DVec3::ZERO }
}

/// Beyond, a free path is less than 100 steps of a position: the README has by how much that shows.
const THICK: [f64; 4] = [1.0, 1e2, 1e4, 1e5];

/// As thick as a cloud in a scene that is so many times wider.
fn small(times: f64) -> Ball {
    Ball { place: DVec3::new(0.6, 0.8, 0.0) * times, ..alone(20.0, 0.99, 0.85) }
}

#[test]
fn single_precision_does_not_show_where_it_is_used() {
    assert!((twin(&alone(2.0, 0.0, 0.0), 100_000)[0].value / (1.0 - 2.0 * (1.0 - 5.0 * (-4.0f64).exp()) / 16.0) - 1.0).abs() < 0.01);
    for sigma in THICK {
        let (z, _) = row(&format!("radius {sigma:e} mean free paths"), &alone(sigma, 0.9, 0.0), 100_000);
        assert!(z < 4.5, "{sigma}: z {z}");
    }
    for times in [1.0, 1e2, 1e3] {
        let (z, _) = row(&format!("a cloud in a scene {times:e} times as wide"), &small(times), 100_000);
        assert!(z < 4.5, "{times}: z {z}");
    }
}

/// The README's table: beyond what is resolved too.
#[test]
#[ignore = "minutes"]
fn single_precision_by_how_much() {
    for sigma in [1.0, 1e2, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e12] {
        row(&format!("radius {sigma:e} mean free paths"), &alone(sigma, 0.9, 0.0), 1_000_000);
    }
    for times in [1.0, 1e2, 1e3, 1e4, 1e5, 1e6] {
        row(&format!("a cloud in a scene {times:e} times as wide"), &small(times), 1_000_000);
    }
    for g in [0.99, 0.9999, 1.0 - 1e-6, -0.9999] {
        row(&format!("g {g}, radius 20 mean free paths"), &alone(20.0, 0.99, g), 1_000_000);
    }
}
