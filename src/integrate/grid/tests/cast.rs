//! What media send to surfaces: looked up between few places, against many directions followed from each point.

use super::*;
use crate::integrate::grid::cast::Cast;
use crate::photon::GROUPS;
use crate::rng::{Rng, Stage};

/// A channel of a cloud above ground, lit; and what it casts.
fn lit_ground(scene: &Scene, photons: u64) -> (Channel, Cast, Lens) {
    let photon = PhotonSettings { photons, ..PhotonSettings::default() };
    let settings = RenderSettings { integrator: Integrator::Grid, width: SIZE, height: SIZE, spp: 1, seed: 5, photon };
    let camera = Camera::look_at(DVec3::new(3.0, -5.0, 2.5), DVec3::new(0.1, 0.0, -0.6), 0.5).unwrap();
    let mut tracer = GridTracer::new(scene, &Plan::for_scene(scene, Density::Source), &camera, &settings, photons);
    tracer.brighten(photons, &Silent).unwrap();
    let lens = Lens::new(&camera, SIZE, SIZE, tracer.origin);
    let mut channel = tracer.channels.remove(0);
    let cast = channel.cast.take().unwrap();
    (channel, cast, lens)
}

#[test]
fn what_clouds_cast_is_what_many_directions_bring() {
    let mut scene = lit(vec![ball(DVec3::ZERO, 1.0, Medium::with_albedo(5.0, 0.99, 0.8))]);
    scene.surfaces.push(ground(0.5));
    let (channel, cast, lens) = lit_ground(&scene, 800_000);
    let mut room = Room::default();
    let (mut sums, mut told, mut worst) = ([0.0f64; 2], 0, 0.0f64);
    let mut variance = 0.0;
    for i in 0..49u8 {
        let at = |i: u8| (f32::from(i) + 0.5) * SIZE as f32 / 7.0;
        let view = lens.view(at(i % 7), at(i / 7));
        let Some(hit) = channel.tracer.surfaces.nearest(&view.ray, view.reach) else { continue };
        let p = hit.off(&view.ray);
        let Some(found) = cast.on(p, &hit) else { continue };
        let looked_up: f64 = found.groups.iter().map(|&g| f64::from(g)).sum();
        assert!((looked_up - f64::from(field::grey(found.rgb))).abs() < 1e-5 * looked_up, "its colours are another light's");
        let mean = looked_up / GROUPS as f64;
        let apart: f64 = found.groups.iter().map(|&g| (f64::from(g) - mean).powi(2)).sum();
        let own = apart * GROUPS as f64 / (GROUPS - 1) as f64;
        let mut rng = Rng::new(9, Stage::Cast, i.into());
        let ways = 4_000;
        let mut sum = [0.0f64; 2];
        for _ in 0..ways {
            let light: Vec3 = channel.cast_on(p, hit.normal, &mut rng, &mut room).light.iter().sum();
            let light = f64::from(field::grey(light));
            sum = [sum[0] + light, sum[1] + light * light];
        }
        let n = f64::from(ways);
        let (truth, square) = (sum[0] / n, (sum[1] / n - (sum[0] / n).powi(2)) / n);
        let z = (looked_up - truth) / (own + square + f64::from(found.doubt).powi(2)).sqrt();
        worst = worst.max(z.abs());
        (told, sums, variance) = (told + 1, [sums[0] + looked_up, sums[1] + truth], variance + own + square);
    }
    let (off, sigma) = (sums[0] / sums[1] - 1.0, variance.sqrt() / sums[1]);
    println!("{told} points: off by {:+.2} % +- {:.2} %, the worst by {worst:.1} standard errors", 100.0 * off, 100.0 * sigma);
    assert!(told > 20 && sigma < 0.02, "{told} points, {sigma}: says nothing");
    assert!(worst < 4.5 && off.abs() < 4.0 * sigma, "{worst}, {off} +- {sigma}");
}

/// Nothing is looked up across the corner of a wall, nor from places that are far from a point for how near a cloud is.
#[test]
fn other_surfaces_and_near_clouds_are_followed() {
    let mut scene = lit(vec![ball(DVec3::new(0.0, 0.0, -1.0), 0.4, Medium::with_albedo(8.0, 0.99, 0.8))]);
    scene.surfaces.push(ground(0.5));
    let (channel, cast, lens) = lit_ground(&scene, 20_000);
    let view = lens.view(2.0, SIZE as f32 - 2.0);
    let hit = channel.tracer.surfaces.nearest(&view.ray, view.reach).unwrap();
    let p = hit.off(&view.ray);
    assert!(cast.on(p, &hit).is_some(), "far from the cloud");
    let wall = crate::trimesh::Hit { normal: Vec3::X, ..hit };
    assert!(cast.on(p, &wall).is_none(), "a wall there");
    assert!(cast.on(p + 0.3 * hit.normal, &hit).is_none(), "above it");
    // Within the cloud, which lies on the ground, light comes from everywhere near.
    let within = (DVec3::new(0.0, 0.0, -1.3) - scene.region_bounds().centre()).as_vec3() + hit.normal * 1e-5;
    assert!(cast.on(within, &hit).is_none(), "in the cloud");
}
