//! Air: the path tracer against a layer that is a region, and in a white furnace; the grid integrator against the path tracer.

use super::*;
use crate::scene::{
    Air,
    air::{AirLayer, Scattering},
};

fn haze(sigma_t: f64, albedo: f64, scattering: Scattering, scale_height: Option<f64>) -> AirLayer {
    let (base, top) = (-1.3, 2.4);
    AirLayer { sigma_s: [sigma_t * albedo; 3], sigma_a: [sigma_t * (1.0 - albedo); 3], scattering, base, top, scale_height }
}

fn cloud() -> Scene {
    let mut scene = lit(vec![ball(DVec3::new(0.0, 0.0, 0.4), 0.8, Medium::with_albedo(6.0, 0.999, 0.8))]);
    scene.surfaces.push(ground(0.4));
    scene
}

/// Even haze as air is even haze as a slab: another code, whose reflection and transmission tables confirm.
#[test]
fn an_even_layer_is_a_slab() {
    let mut air = cloud();
    air.air = Air::new([haze(0.15, 0.9, Scattering::HenyeyGreenstein(0.6), None)]);
    let mut slab = cloud();
    slab.regions.push(Region {
        name: "haze".into(),
        shape: Shape::Slab { centre: DVec3::new(0.0, 0.0, 0.55), half_height: 1.85, half_extent: glam::DVec2::splat(40.0) },
        medium: Medium::with_albedo(0.15, 0.9, 0.6),
        photons: None,
    });
    let pictures = [picture(&air, Integrator::Path, 600, 0, 3), picture(&slab, Integrator::Path, 600, 0, 4)];
    let [air, slab] = pictures.map(|p| means(&p)[1]);
    let z = (air.0 - slab.0) / air.1.hypot(slab.1);
    println!("{air:?} {slab:?}: z = {z:.2}");
    assert!(air.1 < 0.01 * air.0 && z.abs() < 3.5);
}

/// Where nothing absorbs and light comes from everywhere alike, everything looks alike: whatever the air, region and ground do.
#[test]
fn a_white_furnace_of_air_is_even() {
    let mut scene = cloud();
    scene.regions[0].medium = Medium::with_albedo(4.0, 1.0, 0.5);
    scene.surfaces[0].albedo = [1.0; 3];
    (scene.sun.irradiance, scene.sky) = ([0.0; 3], [1.0; 3]);
    let layers = [haze(0.2, 1.0, Scattering::Rayleigh, Some(0.8)), haze(0.1, 1.0, Scattering::HenyeyGreenstein(0.7), None)];
    scene.air = Air::new(layers);
    let path = picture(&scene, Integrator::Path, 4, 0, 1);
    assert!(path.film.pixels.iter().all(|p| (p.combined()[0] - 1.0).abs() < 1e-4));
    let grid = several(&scene, Integrator::Grid, (8, 40_000, 4))[1];
    println!("grid: {grid:?}");
    assert!(grid.1 < 0.01 && (grid.0 - 1.0).abs() < BIAS + 3.5 * grid.1);
}

#[test]
fn the_grid_integrator_sees_what_the_path_tracer_sees() {
    let mut scene = cloud();
    let layers = [haze(0.25, 1.0, Scattering::Rayleigh, Some(1.0)), haze(0.15, 0.9, Scattering::HenyeyGreenstein(0.7), None)];
    scene.air = Air::new(layers);
    scene.sky = [0.05; 3];
    agrees("cloud in thick air", &scene, 200, 3);
}

/// Blue air, and ground and cloud of other colours.
#[test]
fn the_grid_integrator_sees_colours_in_air() {
    let mut scene = cloud();
    let layers = [haze(0.25, 1.0, Scattering::Rayleigh, Some(1.0)), haze(0.15, 0.9, Scattering::HenyeyGreenstein(0.7), None)];
    scene.air = Air::new([layers[0].coloured(|_| [0.05, 0.12, 0.3]), layers[1].coloured(|_| [0.1, 0.1, 0.02])]);
    scene.sky = [0.05; 3];
    scene.surfaces[0].albedo = [0.6, 0.3, 0.1];
    scene.regions[0].medium = Medium { sigma_s: [5.99, 5.9, 5.7], sigma_a: [0.01, 0.1, 0.3], g: 0.8 };
    agrees("cloud in blue air", &scene, 150, 3);
}

/// A path whose flights through coloured air one channel draws is worth as much in every channel as paths of that channel alone.
#[test]
fn a_path_counts_in_three_colours() {
    let mut scene = cloud();
    scene.sky = [0.05; 3];
    let thin = haze(0.0, 1.0, Scattering::Rayleigh, Some(1.0)).coloured(|_| [0.02, 0.2, 0.9]);
    scene.air = Air::new([thin, haze(0.15, 0.9, Scattering::HenyeyGreenstein(0.7), None)]);
    let together = means(&picture(&scene, Integrator::Path, 300, 0, 5));
    for (c, together) in together.iter().enumerate() {
        let mut alone = scene.clone();
        alone.air = scene.air.coloured(|rgb| [rgb[c]; 3]);
        let alone = means(&picture(&alone, Integrator::Path, 300, 0, 6 + c as u64))[c];
        let z = (together.0 - alone.0) / together.1.hypot(alone.1);
        println!("channel {c}: {together:?} {alone:?}: z = {z:.2}");
        assert!(together.1 < 0.01 * together.0 && z.abs() < 3.5);
    }
}
