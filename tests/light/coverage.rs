//! What the path tracer says of its own noise: intervals of 95 % hold the truth in about that many pixels, also where few paths bring most light.

use super::oracles::region;
use cloudvdb::integrate::photon::PhotonSettings;
use cloudvdb::integrate::{Integrator, RenderSettings, render};
use cloudvdb::plan::{Density, Plan};
use cloudvdb::progress::Silent;
use cloudvdb::scene::{Camera, Medium, Mesh, Scene, Shape, Sun, Surface};
use glam::DVec3;

/// A thick ball that throws light forward, over ground in its shadow.
fn scene() -> Scene {
    let corner = |x: f64, y: f64| DVec3::new(3.0 * x, 3.0 * y, -1.4);
    let vertices = vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    let mesh = Mesh { vertices, triangles: vec![[0, 1, 2], [0, 2, 3]] };
    Scene {
        regions: vec![region(Shape::sphere(DVec3::ZERO, 1.0), Medium::with_albedo(8.0, 0.9999, 0.85))],
        surfaces: vec![Surface { name: "ground".into(), mesh, albedo: [0.3; 3] }],
        sun: Sun { direction: DVec3::new(0.8, 0.4, -0.6).normalize(), irradiance: [3.0; 3], ..Sun::default() },
        ..Scene::default()
    }
}

#[test]
fn intervals_of_the_path_tracer_hold_the_truth_as_often_as_they_say() {
    let scene = scene();
    let plan = Plan::for_scene(&scene, Density::Source);
    let camera = Camera::look_at(DVec3::new(0.0, -6.0, 1.0), DVec3::new(0.0, 0.0, -0.2), 0.6).unwrap();
    let film = |spp, seed| {
        let photon = PhotonSettings::default();
        let settings = RenderSettings { integrator: Integrator::Path, width: 32, height: 24, spp, seed, photon };
        render(&scene, &plan, &camera, &settings, None, &Silent).unwrap().film
    };
    let truth = film(4096, 99);
    let (mut held, mut all) = (0.0, 0.0);
    for film in (0..4).map(|seed| film(128, seed)) {
        for (pixel, truth) in film.pixels.iter().zip(&truth.pixels).filter(|(p, t)| p.standard_error[1] > 0.0 && t.combined()[1] > 0.02) {
            let off = f64::from(pixel.combined()[1] - truth.combined()[1]).abs();
            held += f64::from(off <= 1.96 * f64::from(pixel.standard_error[1]).hypot(truth.standard_error[1].into()));
            all += 1.0;
        }
    }
    println!("{:.1} % of {all} intervals hold the truth", 100.0 * held / all);
    assert!(all > 1500.0 && (0.93..0.97).contains(&(held / all)), "{held} of {all}");
}
