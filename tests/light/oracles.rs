//! Light transport against truths that nobody here wrote: discrete ordinates, invariants, symmetries.

use cloudvdb::integrate::flux::{Flux, flux};
use cloudvdb::integrate::photon::PhotonSettings;
use cloudvdb::integrate::{Integrator, RenderSettings, Rendering, render};
use cloudvdb::plan::{Density, Plan};
use cloudvdb::progress::Silent;
use cloudvdb::scene::{BrickGrid, Camera, Medium, Mesh, Region, Scene, Shape, Sun, Surface, VoxelGrid};
use cloudvdb::stats::Estimate;
use cloudvdb::voxelise::{Up, voxelise};
use glam::{DAffine3, DMat3, DVec2, DVec3};
use std::sync::Arc;

/// Plane-parallel layers under a sun from above, no surface: g, albedo, optical depth, reflected, transmitted (NaN: not given).
/// By 64-stream discrete ordinates, better than 1e-5.
const LAYERS: [(f64, f64, f64, f64, f64); 7] = [
    (0.0, 1.0, 1.0, 0.34133, 0.65867),
    (0.0, 1.0, 8.0, 0.82179, 0.17821),
    (0.75, 1.0, 1.0, 0.07874, 0.92126),
    (0.75, 1.0, 8.0, 0.50641, 0.49357),
    (0.75, 0.9, 2.0, 0.09739, 0.66096),
    (0.85, 1.0, 8.0, 0.35843, 0.64156),
    (0.85, 0.99, 8.0, 0.30215, f64::NAN),
];

pub fn region(shape: Shape, medium: Medium) -> Region {
    Region { name: "cloud".into(), shape, medium, photons: None }
}

fn overhead(regions: Vec<Region>) -> Scene {
    Scene { regions, sun: Sun { direction: DVec3::NEG_Z, irradiance: [1.0; 3], angular_diameter: 0.0 }, ..Scene::default() }
}

fn balance(scene: &Scene, photons: u64, seed: u64) -> Flux {
    let f = flux(scene, &Plan::for_scene(scene, Density::Source), photons, seed, &Silent).unwrap();
    let sum = [f.up, f.down_direct, f.down_diffuse, f.absorbed_medium, f.absorbed_surface].iter().map(|e| e.value).sum::<f64>();
    assert!((sum - 1.0).abs() < 1e-6, "the shares add up to {sum}");
    assert_eq!(f.truncated, 0);
    f
}

/// Within 3.9 standard errors (one in 10,000 by chance), which must be small.
fn close(what: &str, found: Estimate, truth: f64, most: f64) {
    let z = (found.value - truth) / found.se.max(1e-9);
    println!("{what:<56} {:.5} +- {:.5}, truth {truth:.5}, z {z:+.2}", found.value, found.se);
    // The truths are rounded to five digits.
    assert!(found.se <= most && (found.value - truth).abs() < 3.9 * found.se + 1e-5, "{what}: {found:?}, not {truth} (z {z:.2})");
}

/// A grid of one tile; samples by index.
pub fn grid(size: [i32; 3], voxel: DVec3, periodic: bool, density: impl Fn([i32; 3]) -> f64) -> Arc<VoxelGrid> {
    let bricks = size.map(|n| (n + 7) / 8);
    let (mut origins, mut values) = (Vec::new(), Vec::new());
    for x in 0..bricks[0] {
        for y in 0..bricks[1] {
            for z in 0..bricks[2] {
                let origin = [x * 8, y * 8, z * 8];
                origins.push(origin);
                values.extend((0..512).map(|v| {
                    let at = [origin[0] + (v >> 6), origin[1] + (v >> 3 & 7), origin[2] + (v & 7)];
                    if (0..3).all(|a| at[a] < size[a]) { density(at) as f32 } else { 0.0 }
                }));
            }
        }
    }
    let world_from_index = DAffine3 { matrix3: DMat3::from_diagonal(voxel), translation: voxel * 0.5 };
    Arc::new(VoxelGrid::new(BrickGrid { world_from_index, origins, values }, [0; 3], size.map(|n| n - 1), periodic))
}

/// A layer of optical depth 1 whose density varies tenfold between its levels, so that majorants do.
fn layered() -> Arc<VoxelGrid> {
    let level = |z: i32| if z / 6 % 2 == 0 { 1.0 } else { 0.1 };
    let sum: f64 = (0..36).map(level).sum();
    grid([16, 12, 36], DVec3::new(0.1, 0.15, 0.05), true, |[_, _, z]| level(z) / (sum * 0.05))
}

/// `times`: as many photons as a thousandth of the light needs.
fn layers(times: f64) {
    let (photons, slack) = ((300_000.0 * times) as u64, 1e-3 / times.sqrt());
    let slab = || Shape::Slab { centre: DVec3::ZERO, half_height: 0.5, half_extent: DVec2::ONE };
    let layered = layered();
    for (i, (g, albedo, tau, r, t)) in LAYERS.into_iter().enumerate() {
        let medium = Medium::with_albedo(tau, albedo, g);
        for (name, shape) in [("slab", slab()), ("grid", Shape::Grid(Arc::clone(&layered)))] {
            let f = balance(&overhead(vec![region(shape, medium)]), photons, 10 + i as u64);
            let of = |what: &str| format!("{name} g {g} albedo {albedo} tau {tau}: {what}");
            close(&of("reflected"), f.up, r, slack);
            close(&of("direct"), f.down_direct, (-tau).exp(), slack);
            if t.is_finite() {
                let through = Estimate { value: f.down_direct.value + f.down_diffuse.value, se: f.down_direct.se.hypot(f.down_diffuse.se) };
                // The truth took an albedo of 1 as 1 - 1e-6.
                close(&of("transmitted"), through, if albedo == 1.0 { 1.0 - r } else { t }, 1.6 * slack);
            }
        }
    }
}

#[test]
fn layers_reflect_and_transmit_what_discrete_ordinates_say() {
    layers(0.6);
}

#[test]
#[ignore = "takes a minute: make crosscheck"]
fn layers_reflect_and_transmit_what_discrete_ordinates_say_closely() {
    layers(10.0);
}

#[test]
fn the_step_cloud_of_i3rc() {
    // 32 columns of 15.625 m, 16 of optical depth 2 and 16 of 18, 250 m thick, periodic; g 0.85, albedo 1, sun overhead.
    let fine = 8;
    let cloud = grid([32 * fine, 1, 16], DVec3::new(15.625 / f64::from(fine), 100.0, 250.0 / 16.0), true, |[x, _, _]| {
        if x < 16 * fine { 2.0 / 250.0 } else { 18.0 / 250.0 }
    });
    let f = balance(&overhead(vec![region(Shape::Grid(cloud), Medium::with_albedo(1.0, 1.0, 0.85))]), 1_000_000, 3);
    println!("R {:.5} +- {:.5}, T {:.5}", f.up.value, f.up.se, f.down_direct.value + f.down_diffuse.value);
    assert!((f.up.value - 0.3276).abs() < 0.0015 && f.up.se < 5e-4, "{:?}", f.up);
    assert!((f.down_direct.value + f.down_diffuse.value - 0.6724).abs() < 0.0015);
}

/// Blanco and Fournier 2003: whatever scatters inside. A sphere in a parallel beam is one in isotropic light.
fn spheres(photons: impl Fn(f64, f64) -> u64, most: impl Fn(f64) -> f64) {
    for tau in [0.1, 1.0, 10.0, 100.0] {
        for g in [-0.9, 0.0, 0.85, 0.99] {
            let radius = 1.7;
            let sphere = region(Shape::sphere(DVec3::new(3.0, -2.0, 1.0), radius), Medium::with_albedo(tau / radius, 1.0, g));
            let mut scene = overhead(vec![sphere]);
            scene.sun.direction = DVec3::new(0.3, -0.5, -0.4).normalize();
            let (f, truth) = (balance(&scene, photons(tau, g), 5), 4.0 / 3.0 * radius);
            close(&format!("mean path, g {g}, optical radius {tau}"), f.mean_path_length, truth, most(tau) * truth);
        }
    }
}

#[test]
fn paths_through_a_white_sphere_are_four_thirds_of_its_radius_long() {
    // Photons that diffuse far are few and long: at optical radius 100 a quick look resolves six percent.
    spheres(|tau, _| if tau > 50.0 { 15_000 } else { 100_000 }, |tau| if tau > 50.0 { 0.064 } else { 0.009 });
}

#[test]
#[ignore = "takes minutes: make crosscheck"]
fn paths_through_a_white_sphere_to_a_thousandth() {
    let photons = |tau: f64, g: f64| match (tau > 50.0, g < 0.5) {
        (true, true) => 12_000_000,
        (true, false) => 6_000_000,
        _ => 4_000_000,
    };
    spheres(photons, |tau| if tau > 50.0 { 0.0025 } else { 0.0015 });
}

#[test]
fn voxels_of_a_layout_send_light_where_the_layout_does() {
    // Two overlapping balls in closed form, and as the grid that the voxeliser makes of them. More light counts that passes a grid's
    // voxels than what meets the balls: fluxes are compared per unit of light, as areas.
    let ball = |x: f64, radius: f64| region(Shape::sphere(DVec3::new(x, 0.2, -0.1), radius), Medium::with_albedo(8.0, 0.98, 0.7));
    let balls = vec![ball(-0.4, 0.8), ball(0.5, 0.6)];
    let bricks = voxelise(&balls, 0.02, 8.0, Up::Z, &Silent).unwrap();
    let (mut min, mut max) = ([i32::MAX; 3], [i32::MIN; 3]);
    for (brick, origin) in bricks.origins.iter().enumerate() {
        for (voxel, _) in bricks.brick(brick).iter().enumerate().filter(|v| *v.1 > 0.0) {
            let at = [origin[0] + (voxel >> 6) as i32, origin[1] + (voxel >> 3 & 7) as i32, origin[2] + (voxel & 7) as i32];
            (min, max) = (std::array::from_fn(|a| min[a].min(at[a])), std::array::from_fn(|a| max[a].max(at[a])));
        }
    }
    let voxels = VoxelGrid::new(bricks, min, max, false);
    let (closed, open) = (overhead(balls), overhead(vec![region(Shape::Grid(Arc::new(voxels)), Medium::with_albedo(8.0, 0.98, 0.7))]));
    let (a, b) = (balance(&closed, 400_000, 1), balance(&open, 600_000, 2));
    let union = {
        let (r, s, d) = (0.8f64, 0.6f64, 0.9f64);
        let (x, y) = ((d * d + r * r - s * s) / (2.0 * d), (d * d + s * s - r * r) / (2.0 * d));
        let lens = r * r * (x / r).acos() - x * (r * r - x * x).sqrt() + s * s * (y / s).acos() - y * (s * s - y * y).sqrt();
        std::f64::consts::PI * (r * r + s * s) - lens
    };
    close("the union of two discs, m^2", a.area, union, 1.6e-3);
    assert!((1.0..1.1).contains(&(b.area.value / union)), "few voxels hold nothing: {:?}", b.area);
    let per = |share: Estimate, area: Estimate| (share.value * area.value, (share.se * area.value).hypot(share.value * area.se));
    for (what, x, y) in
        [("up", a.up, b.up), ("absorbed", a.absorbed_medium, b.absorbed_medium), ("scatterings", a.mean_scatterings, b.mean_scatterings)]
    {
        let (a, b) = (per(x, a.area), per(y, b.area));
        println!("{what}: {:.5} +- {:.5} by balls, {:.5} +- {:.5} by voxels", a.0, a.1, b.0, b.1);
        // Voxels soften the outline by half of one: a thousandth.
        assert!((a.0 - b.0).abs() < 3.9 * a.1.hypot(b.1) + 1e-3 * a.0, "{what}");
    }
}

/// A camera that sees the given directions, far off.
fn camera(position: DVec3, target: DVec3, yfov: f64) -> Camera {
    let back = (position - target).normalize();
    let right = if back.z.abs() > 0.9 { DVec3::X } else { DVec3::Z.cross(back).normalize() };
    let right = (right - back * right.dot(back)).normalize();
    Camera {
        world_from_camera: DAffine3 { matrix3: DMat3::from_cols(right, back.cross(right), back), translation: position },
        yfov,
        aspect: None,
        znear: 1e-3,
        zfar: None,
    }
}

fn picture(scene: &Scene, camera: &Camera, size: u32, spp: u32, seed: u64) -> Rendering {
    let settings = RenderSettings { integrator: Integrator::Path, width: size, height: size, spp, seed, photon: PhotonSettings::default() };
    let r = render(scene, &Plan::for_scene(scene, Density::Source), camera, &settings, None, &Silent).unwrap();
    assert_eq!((r.truncated, r.violations), (0, 0));
    r
}

/// A lumpy grid of 20^3 voxels about the origin, 2 m wide.
fn lumps() -> Arc<VoxelGrid> {
    let mut lumps = Arc::unwrap_or_clone(grid([20, 20, 20], DVec3::splat(0.1), false, |at| {
        let p = DVec3::from_array(at.map(|i| (f64::from(i) - 9.5) / 10.0));
        (1.3 - p.length() + 0.5 * (7.0 * p.x).sin() * (5.0 * p.y + 1.0).sin() * (6.0 * p.z).cos()).clamp(0.0, 1.0)
    }));
    lumps.bricks.world_from_index.translation = DVec3::splat(-0.95);
    Arc::new(lumps)
}

fn ground(z: f64, half: f64, albedo: f64) -> Surface {
    let corner = |x: f64, y: f64| DVec3::new(x * half, y * half, z);
    let vertices = vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    Surface { name: "ground".into(), mesh: Mesh { vertices, triangles: vec![[0, 1, 2], [0, 2, 3]] }, albedo: [albedo; 3] }
}

/// Scenes of every kind of medium, with albedo 1.
fn white_scenes() -> Vec<(&'static str, Scene)> {
    let ball = |x: f64, sigma: f64| region(Shape::sphere(DVec3::new(x, 0.0, 0.0), 0.8), Medium::with_albedo(sigma, 1.0, 0.85));
    let lumps = || region(Shape::Grid(lumps()), Medium::with_albedo(12.0, 1.0, 0.85));
    let with_ground = |mut scene: Scene| {
        scene.surfaces.push(ground(-1.3, 40.0, 1.0));
        scene
    };
    vec![
        ("ball", overhead(vec![ball(0.0, 10.0)])),
        ("overlapping balls", overhead(vec![ball(-0.4, 6.0), ball(0.4, 3.0), ball(0.1, 1.0)])),
        ("grid", overhead(vec![lumps()])),
        ("grid and balls", overhead(vec![lumps(), ball(0.5, 5.0)])),
        ("ball over a white ground", with_ground(overhead(vec![ball(0.0, 10.0)]))),
        ("grid over a white ground", with_ground(overhead(vec![lumps()]))),
    ]
}

#[test]
fn in_a_white_furnace_nothing_can_be_seen() {
    for (name, mut scene) in white_scenes() {
        (scene.sky, scene.sun.irradiance) = ([1.0; 3], [0.0; 3]);
        let r = picture(&scene, &camera(DVec3::new(4.0, -3.0, 1.0), DVec3::ZERO, 0.6), 24, 8, 1);
        assert!(r.collisions > 5000, "{name}");
        for p in &r.film.pixels {
            assert!(p.combined().iter().all(|c| (c - 1.0).abs() < 1e-5), "{name}: {p:?}");
        }
    }
}

#[test]
fn light_goes_both_ways_alike() {
    // What a cloud scatters from one direction into another it scatters back: orthographic views, by cameras far away.
    let (a, b) = (DVec3::new(0.3, -1.0, 0.4).normalize(), DVec3::new(-0.8, -0.2, 0.7).normalize());
    for (name, scene) in white_scenes().into_iter().take(4) {
        let seen = |from: DVec3, lit: DVec3, seed: u64| {
            let mut scene = scene.clone();
            scene.sun.direction = -lit;
            let (distance, half) = (4000.0, 1.8);
            let r = picture(&scene, &camera(from * distance, DVec3::ZERO, 2.0 * f64::atan(half / distance)), 48, 96, seed);
            let n = r.film.pixels.len() as f64;
            let mean = r.film.pixels.iter().map(|p| f64::from(p.combined()[0])).sum::<f64>() / n;
            let variance = r.film.pixels.iter().map(|p| f64::from(p.standard_error[0]).powi(2)).sum::<f64>();
            Estimate { value: mean, se: variance.sqrt() / n }
        };
        let (one, other) = (seen(a, b, 1), seen(b, a, 2));
        let z = (one.value - other.value) / one.se.hypot(other.se);
        println!("{name}: {:.5} +- {:.5} and {:.5} +- {:.5}, z {z:+.2}", one.value, one.se, other.value, other.se);
        assert!(z.abs() < 3.9 && one.se < 0.03 * one.value, "{name}: {one:?} {other:?}");
    }
}
