//! Hard cases of pictures and energy balances: extreme media, suns, cameras and sizes; colour; threads; and symmetries.
//!
//! A pixel may be negative: sunlight in a grid is a rough guess put right by chance, and what puts it right may exceed it. Its
//! mean is right, which `media::grid::tests` shows.

use cloudvdb::Error;
use cloudvdb::integrate::flux::{Flux, flux};
use cloudvdb::integrate::photon::PhotonSettings;
use cloudvdb::integrate::{Integrator, RenderSettings, Rendering, render};
use cloudvdb::plan::{Density, Plan};
use cloudvdb::progress::Silent;
use cloudvdb::rng::{Rng, Stage};
use cloudvdb::scene::{BrickGrid, Camera, Medium, Mesh, Region, Scene, Shape, Sun, Surface, VoxelGrid};
use glam::{DAffine3, DMat3, DQuat, DVec2, DVec3};
use std::f64::consts::PI;
use std::sync::Arc;

pub fn region(shape: Shape, medium: Medium) -> Region {
    Region { name: "cloud".into(), shape, medium, photons: None }
}

pub fn ball(x: f64, sigma: f64, albedo: f64, g: f64) -> Region {
    region(Shape::sphere(DVec3::new(x, 0.0, 0.0), 1.0), Medium::with_albedo(sigma, albedo, g))
}

pub fn slab(medium: Medium) -> Region {
    region(Shape::Slab { centre: DVec3::ZERO, half_height: 0.5, half_extent: DVec2::ONE }, medium)
}

/// A lumpy grid of `n` voxels a side, 2 m wide, about the origin.
pub fn lumps(n: i32) -> Shape {
    let side = (n + 7) / 8;
    let (mut origins, mut values) = (Vec::new(), Vec::new());
    for i in 0..side.pow(3) {
        let origin = [i / side / side * 8, i / side % side * 8, i % side * 8];
        origins.push(origin);
        values.extend((0..512).map(|v| {
            let at = [origin[0] + (v >> 6), origin[1] + (v >> 3 & 7), origin[2] + (v & 7)];
            let p = DVec3::from_array(at.map(|i| (f64::from(i) + 0.5) / f64::from(n) * 2.0 - 1.0));
            let value = (1.3 - p.length() + 0.5 * (7.0 * p.x).sin() * (5.0 * p.y + 1.0).sin()).clamp(0.0, 1.0);
            if at.iter().all(|&i| i < n) { value as f32 } else { 0.0 }
        }));
    }
    let voxel = 2.0 / f64::from(n);
    let world_from_index = DAffine3 { matrix3: DMat3::from_diagonal(DVec3::splat(voxel)), translation: DVec3::splat(0.5 * voxel - 1.0) };
    Shape::Grid(Arc::new(VoxelGrid::new(BrickGrid { world_from_index, origins, values }, [0; 3], [n - 1; 3], false)))
}

pub fn lit(regions: Vec<Region>, direction: DVec3, angular_diameter: f64) -> Scene {
    Scene { regions, sun: Sun { direction: direction.normalize(), irradiance: [1.0; 3], angular_diameter }, ..Scene::default() }
}

pub fn slanted(regions: Vec<Region>) -> Scene {
    lit(regions, DVec3::new(0.4, 0.3, -0.8), 0.00918)
}

pub fn ground(z: f64, half: f64, albedo: [f64; 3]) -> Surface {
    let corner = |x: f64, y: f64| DVec3::new(x * half, y * half, z);
    let vertices = vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    Surface { name: "ground".into(), mesh: Mesh { vertices, triangles: vec![[0, 1, 2], [0, 2, 3]] }, albedo }
}

pub fn camera(position: DVec3, target: DVec3) -> Camera {
    let back = (position - target).normalize();
    let right = if back.z.abs() > 0.9 { DVec3::X } else { DVec3::Z.cross(back) };
    let right = (right - back * right.dot(back)).normalize();
    let matrix3 = DMat3::from_cols(right, back.cross(right), back);
    Camera { world_from_camera: DAffine3 { matrix3, translation: position }, yfov: 0.7, aspect: None, znear: 0.0, zfar: None }
}

pub fn usual() -> Camera {
    camera(DVec3::new(3.0, -2.5, 1.0), DVec3::ZERO)
}

fn picture(scene: &Scene, camera: &Camera, (width, height): (u32, u32), spp: u32, seed: u64) -> Rendering {
    let settings = RenderSettings { integrator: Integrator::Path, width, height, spp, seed, photon: PhotonSettings::default() };
    render(scene, &Plan::for_scene(scene, Density::Source), camera, &settings, None, &Silent).unwrap()
}

/// Renders and checks what holds of every picture.
fn sane(name: &str, scene: &Scene, camera: &Camera, size: (u32, u32), spp: u32) -> Rendering {
    let start = std::time::Instant::now();
    let r = picture(scene, camera, size, spp, 1);
    let seconds = start.elapsed().as_secs_f64();
    assert_eq!((r.truncated, r.violations, r.film.pixels.len()), (0, 0, (size.0 * size.1) as usize), "{name}");
    let grid = scene.regions.iter().any(|r| matches!(r.shape, Shape::Grid(_)));
    for p in &r.film.pixels {
        let layers = [p.volume_direct, p.volume_indirect, p.surface, p.environment];
        assert!(layers.iter().flatten().all(|c| c.is_finite() && (grid || *c >= 0.0)), "{name}: {p:?}");
        assert!(p.standard_error.iter().all(|e| *e >= 0.0 && (spp == 1 || e.is_finite())), "{name}: {p:?}");
        assert!((0.0..=1.0).contains(&p.transmittance) && (0.0..=1.0).contains(&p.opaque) && p.depth >= 0.0, "{name}: {p:?}");
    }
    assert!(seconds < 10.0, "{name}: {seconds} s");
    println!("{name:<44} mean {:.3e}, {} collisions, {seconds:.2} s", r.film.mean(), r.collisions);
    r
}

fn balance(name: &str, scene: &Scene, photons: u64) -> Flux {
    let f = flux(scene, &Plan::for_scene(scene, Density::Source), photons, 1, &Silent).unwrap();
    let all = [f.up, f.down_direct, f.down_diffuse, f.absorbed_medium, f.absorbed_surface];
    let sum = all.iter().map(|e| e.value).sum::<f64>();
    assert!((sum - 1.0).abs() < 1e-6 && f.truncated == 0, "{name}: the shares add up to {sum}, {f:?}");
    assert!(all.iter().all(|e| e.value >= 0.0 && e.se >= 0.0 && e.se.is_finite()), "{name}: {f:?}");
    assert!(f.mean_path_length.value.is_finite() && f.mean_scatterings.value.is_finite(), "{name}: {f:?}");
    f
}

/// Of each quarter of a picture: the mean of a channel, and its squared standard error; over `unit`.
fn quarters(r: &Rendering, channel: usize, unit: f64) -> [(f64, f64); 4] {
    let mut sums = [(0.0, 0.0); 4];
    let n = r.film.pixels.len() as f64 / 4.0;
    for (p, i) in r.film.pixels.iter().zip(0..) {
        let quarter = usize::from(i % r.film.width * 2 >= r.film.width) + 2 * usize::from(i / r.film.width * 2 >= r.film.height);
        sums[quarter].0 += f64::from(p.combined()[channel]) / n / unit;
        sums[quarter].1 += (f64::from(p.standard_error[channel]) / n / unit).powi(2);
    }
    sums
}

/// Two renderings agree in each quarter, within 4.5 standard errors of the difference.
fn agree(name: &str, (a, ca, ua): (&Rendering, usize, f64), (b, cb, ub): (&Rendering, usize, f64)) {
    for (q, (a, b)) in quarters(a, ca, ua).into_iter().zip(quarters(b, cb, ub)).enumerate() {
        let z = (a.0 - b.0) / (a.1 + b.1).sqrt().max(1e-6 * a.0.abs() + 1e-30);
        println!("{name:<44} quarter {q}: {:.5} and {:.5}, z {z:+.2}", a.0, b.0);
        assert!(z.abs() < 4.5, "{name}, quarter {q}: {a:?}, {b:?}, z {z}");
        assert!(a.1.sqrt() <= 0.1 * a.0, "{name}: sharp enough to tell");
    }
}

#[test]
fn extreme_media_render_and_balance() {
    for (g, albedo, sigma) in [
        (0.9999, 1.0, 5.0),
        (-0.9999, 1.0, 5.0),
        (0.0, 1.0, 5.0),
        (0.8, 0.0, 5.0),
        (0.8, 0.5, 1e4),
        (0.8, 0.999, 1e4),
        (0.9999, 0.9, 1e4),
        (0.5, 1.0, 1e-6),
        (0.0, 1.0, 0.0),
    ] {
        for (kind, shape) in [("ball", Shape::sphere(DVec3::ZERO, 1.0)), ("grid", lumps(12))] {
            let name = format!("{kind}, g {g}, albedo {albedo}, radius {sigma}");
            let mut scene = slanted(vec![region(shape, Medium::with_albedo(sigma, albedo, g))]);
            scene.sky = [0.1; 3];
            let r = sane(&name, &scene, &usual(), (10, 10), 4);
            if albedo == 0.0 {
                assert!(r.film.pixels.iter().all(|p| p.volume_direct == [0.0; 3] && p.volume_indirect == [0.0; 3]), "{name}");
            }
            let f = balance(&name, &scene, 4000);
            assert!(albedo < 1.0 || f.absorbed_medium.value < 1e-9, "{name}: {f:?}");
            assert!(albedo > 0.0 || f.mean_scatterings.value == 0.0, "{name}: {f:?}");
        }
    }
}

#[test]
fn suns_and_cameras_of_every_kind() {
    let sun = DVec3::new(0.4, 0.3, -0.8).normalize();
    for angle in [0.0, 0.00918, 1.0, PI * 0.999] {
        let mut scene = lit(vec![ball(0.0, 5.0, 0.99, 0.85), region(lumps(12), Medium::with_albedo(5.0, 1.0, 0.85))], sun, angle);
        scene.surfaces.push(ground(-1.5, 5.0, [0.5; 3]));
        let (edge, name) = (DVec3::X, |what: &str| format!("disc {angle}, {what}"));
        for (what, position, target) in [
            ("far", DVec3::new(3.0, -2.5, 1.0), DVec3::ZERO),
            ("inside", DVec3::new(0.1, 0.05, 0.2), DVec3::ZERO),
            ("at the very centre", DVec3::ZERO, DVec3::X),
            ("on the boundary, inward", edge, DVec3::ZERO),
            ("on the boundary, along", edge, edge + DVec3::Z),
            ("on the ground's plane", DVec3::new(2.0, 0.0, -1.5), DVec3::new(0.0, 0.0, -1.5)),
            ("into the sun", sun * 1.4, DVec3::ZERO),
            ("down the sun's rays", sun * -4.0, DVec3::ZERO),
        ] {
            sane(&name(what), &scene, &camera(position, target), (8, 8), 4);
        }
        // Of a disc as wide as the sky so much light starts beside the cloud that so few photons may all miss it.
        if angle < 3.0 {
            balance(&name("balance"), &scene, 4000);
        }
    }
}

#[test]
fn pictures_of_odd_shapes() {
    let scene = slanted(vec![ball(0.0, 5.0, 0.99, 0.85), region(lumps(1), Medium::with_albedo(5.0, 1.0, 0.85))]);
    for (size, spp) in [((1, 1), 1), ((1, 1), 64), ((2000, 1), 1), ((1, 500), 2), ((9, 7), 1)] {
        sane(&format!("{size:?} at {spp}"), &scene, &usual(), size, spp);
    }
    let only = slanted(vec![region(lumps(1), Medium::with_albedo(5.0, 1.0, 0.85))]);
    assert!(sane("a grid of one voxel", &only, &usual(), (16, 16), 8).collisions > 100);
    balance("a grid of one voxel", &only, 5000);
    sane("nothing at all", &lit(vec![], DVec3::NEG_Z, 0.0), &usual(), (4, 4), 2);
}

/// The scene and its camera through a similarity; extinction is divided by the scale.
fn moved(scene: &Scene, camera: &Camera, scale: f64, turn: DQuat, by: DVec3) -> (Scene, Camera) {
    let map = DAffine3::from_scale_rotation_translation(DVec3::splat(scale), turn, by);
    let mut scene = scene.clone();
    for r in &mut scene.regions {
        match &mut r.shape {
            Shape::Ellipsoid { world_from_unit } => *world_from_unit = map * *world_from_unit,
            Shape::Grid(grid) => {
                let mut b = grid.bricks.clone();
                b.world_from_index = map * b.world_from_index;
                *grid = Arc::new(VoxelGrid::new(b, grid.min, grid.max, false));
            }
            _ => panic!("not moved here"),
        }
        (0..3).for_each(|c| (r.medium.sigma_s[c], r.medium.sigma_a[c]) = (r.medium.sigma_s[c] / scale, r.medium.sigma_a[c] / scale));
    }
    scene.surfaces.iter_mut().flat_map(|s| &mut s.mesh.vertices).for_each(|v| *v = map.transform_point3(*v));
    scene.sun.direction = turn * scene.sun.direction;
    let pose = camera.world_from_camera;
    let pose = DAffine3 { matrix3: DMat3::from_quat(turn) * pose.matrix3, translation: map.transform_point3(pose.translation) };
    (scene, Camera { world_from_camera: pose, ..*camera })
}

#[test]
fn a_scene_looks_the_same_wherever_it_is_and_however_large() {
    let mut scene = slanted(vec![ball(-0.6, 4.0, 0.95, 0.6), region(lumps(20), Medium::with_albedo(8.0, 0.99, 0.8))]);
    scene.surfaces.push(ground(-1.3, 3.0, [0.6; 3]));
    let (size, turn) = ((16, 16), DQuat::from_rotation_x(0.8) * DQuat::from_rotation_z(2.0));
    let truth = picture(&scene, &usual(), size, 64, 1);
    for (i, (name, scale, turn, by)) in [
        ("a millimetre", 1e-3, DQuat::IDENTITY, DVec3::ZERO),
        ("a thousand kilometres", 1e6, DQuat::IDENTITY, DVec3::ZERO),
        ("1e7 m from the origin", 1.0, DQuat::IDENTITY, DVec3::new(1e7, -1e7, 1e7)),
        ("turned", 1.0, turn, DVec3::ZERO),
        ("all at once", 30.0, turn, DVec3::new(-1e7, 3.0, 1e7)),
    ]
    .into_iter()
    .enumerate()
    {
        let (there, camera) = moved(&scene, &usual(), scale, turn, by);
        let other = picture(&there, &camera, size, 64, 10 + i as u64);
        assert_eq!((other.truncated, other.violations), (0, 0));
        agree(name, (&truth, 0, 1.0), (&other, 0, 1.0));
    }
}

#[test]
fn each_channel_is_a_grey_picture_of_its_own() {
    let (sigma_s, sigma_a) = ([1.0, 4.0, 9.0], [0.0, 0.5, 0.1]);
    let even = [(5.0, 0.0), (4.0, 1.0), (4.9, 0.1)];
    for (name, medium) in [
        ("extinction by channel", Medium { sigma_s, sigma_a, g: 0.7 }),
        ("albedo by channel", Medium { sigma_s: even.map(|e| e.0), sigma_a: even.map(|e| e.1), g: 0.7 }),
    ] {
        for (kind, shape) in [("ball", Shape::sphere(DVec3::ZERO, 1.0)), ("grid", lumps(12))] {
            let albedo = [0.9, 0.5, 0.2];
            let mut scene = slanted(vec![region(shape, medium)]);
            (scene.sun.irradiance, scene.sky) = ([1.0, 0.5, 2.0], [0.1, 0.3, 0.2]);
            scene.surfaces.push(ground(-1.2, 4.0, albedo));
            let coloured = picture(&scene, &usual(), (12, 12), 64, 1);
            balance(name, &scene, 4000);
            for (c, &albedo) in albedo.iter().enumerate() {
                let mut grey = scene.clone();
                grey.regions[0].medium = Medium::grey(medium.sigma_s[c], medium.sigma_a[c], medium.g);
                (grey.sun.irradiance, grey.sky) = ([scene.sun.irradiance[c]; 3], [scene.sky[c]; 3]);
                grey.surfaces[0].albedo = [albedo; 3];
                let grey = picture(&grey, &usual(), (12, 12), 64, 5 + c as u64);
                agree(&format!("{name}, {kind}, channel {c}"), (&coloured, c, 1.0), (&grey, 0, 1.0));
            }
        }
    }
}

#[test]
fn the_same_bytes_on_any_number_of_threads_and_others_for_another_seed() {
    let mut scene = slanted(vec![ball(-0.5, 4.0, 0.9, 0.8), region(lumps(20), Medium::with_albedo(5.0, 1.0, 0.85))]);
    scene.surfaces.push(ground(-1.2, 4.0, [0.9, 0.5, 0.2]));
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| (picture(&scene, &usual(), (33, 17), 4, 7).film, balance("threads", &scene, 5000)))
    };
    let one = on(1);
    assert!(one == on(2) && one == on(3) && one == on(1));
    assert_ne!(one.0, picture(&scene, &usual(), (33, 17), 4, 8).film);
}

#[test]
fn furnaces_and_black_grounds() {
    let white =
        vec![ball(-0.6, 4.0, 1.0, -0.5), region(lumps(12), Medium::with_albedo(8.0, 1.0, 0.9)), slab(Medium::with_albedo(0.7, 1.0, 0.0))];
    let coloured = |r: &mut Region| r.medium.sigma_s = [0.5, 1.0, 4.0];
    for (name, colour) in [("grey", false), ("coloured", true)] {
        let mut scene = lit(white.clone(), DVec3::NEG_Z, 0.0);
        (scene.sky, scene.sun.irradiance) = ([1.0, 2.0, 3.0], [0.0; 3]);
        scene.surfaces.push(ground(-1.2, 4.0, [1.0; 3]));
        if colour {
            scene.regions.iter_mut().for_each(coloured);
        }
        for p in sane(name, &scene, &camera(DVec3::new(3.0, -2.5, 1.5), DVec3::ZERO), (16, 16), 8).film.pixels {
            assert!((0..3).all(|c| (p.combined()[c] / (c + 1) as f32 - 1.0).abs() < 1e-5), "{name}: {p:?}");
        }
    }
    let mut black = slanted(white[..1].to_vec());
    black.surfaces.push(ground(-1.2, 4.0, [0.0; 3]));
    let r = sane("a black ground", &black, &usual(), (16, 16), 8);
    assert!(r.film.pixels.iter().all(|p| p.surface == [0.0; 3]) && r.film.pixels.iter().any(|p| p.opaque == 1.0));
}

#[test]
fn coincident_regions_add_and_empty_ones_do_not_count() {
    let grid = |sigma: f64| region(lumps(12), Medium::with_albedo(sigma, 0.95, 0.8));
    let vacuum = [ball(0.3, 0.0, 1.0, 0.0), grid(0.0)];
    for (name, one, two) in [
        ("balls", vec![ball(0.0, 6.0, 0.9, 0.5)], vec![ball(0.0, 3.0, 0.9, 0.5); 2]),
        ("grids", vec![grid(6.0)], vec![grid(3.0); 2]),
        ("a ball beside vacuum", vec![ball(0.0, 6.0, 0.9, 0.5)], [&[ball(0.0, 6.0, 0.9, 0.5)], &vacuum[..]].concat()),
        ("a grid beside vacuum", vec![grid(6.0)], [&[grid(6.0)], &vacuum[..]].concat()),
    ] {
        let (a, b) = (picture(&slanted(one), &usual(), (12, 12), 256, 1), picture(&slanted(two), &usual(), (12, 12), 256, 2));
        agree(name, (&a, 0, 1.0), (&b, 0, 1.0));
    }
}

#[test]
fn balances_under_hard_suns() {
    let cloud = || vec![ball(0.0, 5.0, 0.99, 0.85), region(lumps(12), Medium::with_albedo(5.0, 1.0, 0.85))];
    balance("at the horizon", &lit(cloud(), DVec3::X, 0.00918), 5000);
    let below = balance("from below", &lit(cloud(), DVec3::Z, 0.0), 20_000);
    let above = balance("from above", &lit(cloud(), DVec3::NEG_Z, 0.0), 20_000);
    assert!(below.down_direct.value == 0.0 && below.up.value > above.up.value, "forward is up: {below:?}");
    let mut coloured = lit(cloud(), DVec3::new(0.1, 0.0, -1.0), 0.00918);
    coloured.regions[0].medium.sigma_s = [1.0, 3.0, 9.0];
    (coloured.sun.irradiance, coloured.surfaces) = ([1.0, 0.0, 3.0], vec![ground(-1.5, 3.0, [0.9, 0.1, 0.3])]);
    balance("coloured", &coloured, 5000);
    let dark = Scene { sun: Sun { irradiance: [0.0; 3], ..coloured.sun }, ..coloured.clone() };
    let roofed = Scene { surfaces: vec![ground(2.0, 100.0, [0.0; 3])], ..coloured.clone() };
    let level = lit(vec![slab(Medium::grey(1.0, 0.0, 0.0))], DVec3::X, 0.0);
    let under = lit(vec![slab(Medium::grey(1.0, 0.0, 0.0))], DVec3::Z, 0.0);
    for (name, scene) in [("dark", dark), ("roofed", roofed), ("level", level), ("under", under)] {
        let found = flux(&scene, &Plan::for_scene(&scene, Density::Source), 5000, 1, &Silent);
        let Err(Error::Scene { reason, fix }) = found else { panic!("{name}: {found:?}") };
        assert!(reason.contains("none reaches the media") && !fix.is_empty(), "{name}: {reason}. {fix}");
    }
}

#[test]
fn a_hundred_random_scenes() {
    let mut rng = Rng::new(11, Stage::Regions, 0);
    for case in 0..100 {
        let pick = |rng: &mut Rng, of: &[f64]| of[(rng.uniform() * of.len() as f64) as usize];
        let mut regions = Vec::new();
        for _ in 0..1 + (rng.uniform() * 4.0) as u32 {
            let albedo = pick(&mut rng, &[0.0, 0.5, 0.99, 1.0]);
            let mut medium = Medium::with_albedo(
                pick(&mut rng, &[0.0, 1e-6, 0.3, 5.0, 200.0]),
                albedo,
                pick(&mut rng, &[-0.999, 0.0, 0.3, 0.9, 0.9999]),
            );
            if rng.uniform() < 0.3 {
                medium.sigma_s[1] *= rng.uniform();
            }
            let (kind, x) = (rng.uniform(), 2.0 * rng.uniform() - 1.0);
            let squashed = DAffine3::from_scale_rotation_translation(DVec3::new(1.0, 0.3, -0.7), DQuat::from_rotation_x(x), DVec3::Y * x);
            regions.push(match kind {
                k if k < 0.4 => region(Shape::sphere(DVec3::new(x, -x, 0.2), 0.2 + rng.uniform()), medium),
                k if k < 0.6 => region(Shape::Ellipsoid { world_from_unit: squashed }, medium),
                k if k < 0.7 => slab(medium),
                _ => region(lumps(1 + (rng.uniform() * 17.0) as i32), medium),
            });
        }
        let toward = DVec3::new(rng.uniform() - 0.5, rng.uniform() - 0.5, -0.1 - rng.uniform());
        let mut scene = lit(regions, toward, pick(&mut rng, &[0.0, 0.00918, 1.0]));
        scene.sky = [0.0, rng.uniform(), 0.5];
        if rng.uniform() < 0.5 {
            scene.surfaces.push(ground(-1.0 + 0.5 * rng.uniform(), 3.0, [rng.uniform(), 1.0, 0.0]));
        }
        let from = DVec3::new(rng.uniform() - 0.5, rng.uniform() - 0.5, rng.uniform()) * 6.0;
        sane(&format!("random scene {case}"), &scene, &camera(from, DVec3::new(0.0, 0.1, 0.0)), (6, 5), 3);
        balance(&format!("random scene {case}"), &scene, 1000);
    }
}
