//! Skies that are not even: the path tracer against a sun of its own, the grid integrator against the path tracer.

use super::*;
use crate::scene::Dome;
use std::sync::Arc;

fn under(dome: Dome) -> Scene {
    let mut scene = lit(vec![ball(DVec3::new(0.0, 0.0, 0.4), 0.8, Medium::with_albedo(6.0, 0.99, 0.8))]);
    scene.surfaces.push(ground(0.4));
    scene.sun.irradiance = [0.0; 3];
    scene.sky = dome.mean();
    scene.dome = Some(Arc::new(dome));
    scene
}

/// A bright disc in an image of the sky is a sun: other code, that aims at its disc in closed form.
#[test]
fn a_bright_disc_is_a_sun() {
    let toward = DVec3::new(0.3, -0.5, 0.8).normalize();
    let half: f64 = 0.12;
    let disc = Dome::of(1024, 512, |d| [if d.dot(toward) > half.cos() { 10.0 } else { 0.0 }; 3]).unwrap();
    let painted = under(disc);
    let mut shining = painted.clone();
    (shining.sky, shining.dome) = ([0.0; 3], None);
    // The irradiance across the middle's direction, of the painted disc's own light: its mean times all directions, and the mean cosine.
    let irradiance = painted.sky[0] * 4.0 * std::f64::consts::PI * 0.5 * (1.0 + half.cos());
    shining.sun = Sun { direction: -toward, irradiance: [irradiance; 3], angular_diameter: 2.0 * half };
    let [painted, shining] = [(&painted, 3), (&shining, 4)].map(|(scene, seed)| means(&picture(scene, Integrator::Path, 300, 0, seed))[1]);
    let z = (painted.0 - shining.0) / painted.1.hypot(shining.1);
    println!("{painted:?} {shining:?}: z = {z:.2}");
    assert!(painted.1 < 0.01 * painted.0 && z.abs() < 3.5);
}

#[test]
fn the_grid_integrator_sees_what_the_path_tracer_sees() {
    let low = DVec3::new(0.9, 0.3, 0.3).normalize();
    // Blue above, red about a low spot, green below.
    let dome = |spot: f64| {
        let light = move |d: DVec3| {
            let glow = if d.dot(low) > 0.98 { spot } else { 0.0 };
            [0.1 + glow, 0.2 + 0.4 * glow + 0.1 * (-d.z).max(0.0), 0.3 + 0.3 * d.z.max(0.0) + 0.1 * glow]
        };
        Dome::of(128, 64, light).unwrap()
    };
    agrees("under a sky of many colours", &under(dome(0.8)), 150, 3);
    let mut peaked = under(dome(60.0));
    peaked.surfaces[0].albedo = [0.5, 0.4, 0.2];
    agrees("under a sky with a bright spot", &peaked, 150, 3);
}
