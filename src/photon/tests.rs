//! Pass 1 against closed forms, published tables and slow twins.

use super::emit::Target;
use super::trace::Fate;
use super::*;
use crate::plan::{Density, Plan};
use crate::progress::Silent;
use crate::rng::{Rng, Stage};
use crate::sampling::unit_ball;
use crate::scene::{BrickGrid, Medium, Mesh, Region, Scene, Shape, Sun, Surface, VoxelGrid};
use crate::stats::Estimate;
use glam::{DAffine3, DVec2, DVec3, Vec2};
use std::sync::Arc;

fn region(shape: Shape, medium: Medium) -> Region {
    Region { name: "r".into(), shape, medium, photons: None }
}

fn overhead(regions: Vec<Region>) -> Scene {
    Scene { regions, sun: Sun { direction: DVec3::NEG_Z, ..Sun::default() }, ..Scene::default() }
}

fn tracer(scene: &Scene, model: Model) -> Tracer {
    Tracer::new(scene, &Plan::for_scene(scene, Density::Duality), model)
}

fn shoot(scene: &Scene, photons: u64, seed: u64) -> Shot {
    tracer(scene, Model::Physical).fill(photons, seed, &Silent).unwrap()
}

fn ground(z: f64, half: f64, albedo: f64) -> Surface {
    let vertices = vec![DVec3::new(-half, -half, z), DVec3::new(half, -half, z), DVec3::new(half, half, z), DVec3::new(-half, half, z)];
    Surface { name: "ground".into(), mesh: Mesh { vertices, triangles: vec![[0, 1, 2], [0, 2, 3]] }, albedo: [albedo; 3] }
}

/// Fails beyond 4.5 sigma.
fn assert_agrees(name: &str, e: Estimate, truth: f64) {
    assert!((e.value - truth).abs() < 4.5 * e.se && e.se > 0.0, "{name}: {} +- {} against {truth}", e.value, e.se);
}

fn difference(a: Estimate, b: Estimate) -> Estimate {
    Estimate { value: a.value - b.value, se: a.se.hypot(b.se) }
}

/// Power per emitted path in W, with its standard error.
fn power(shot: &Shot, fate: Fate) -> Estimate {
    let per_path = shot.energy.denominator() / shot.traced as f64;
    let e = shot.energy.ratio(fate as usize);
    Estimate { value: e.value * per_path, se: e.se * per_path }
}

#[test]
fn energy_emitted_is_absorbed_or_escapes() {
    let mut scene = overhead(vec![
        region(Shape::sphere(DVec3::ZERO, 1.0), Medium::with_albedo(8.0, 0.98, 0.8)),
        region(Shape::sphere(DVec3::new(0.7, 0.2, 0.1), 0.8), Medium::with_albedo(3.0, 0.9, -0.3)),
    ]);
    scene.surfaces = vec![ground(-1.5, 20.0, 0.6)];
    for model in [Model::Physical, Model::Hura2006] {
        let shot = tracer(&scene, model).fill(100_000, 3, &Silent).unwrap();
        let ended: f64 = (0..super::trace::FATES).map(|i| shot.energy.total(i)).sum();
        assert!((ended / shot.energy.denominator() - 1.0).abs() < 1e-6, "{model:?}: {ended}");
        assert!(shot.energy.total(Fate::AbsorbedSurface as usize) > 0.0);
        assert_eq!(shot.energy.total(Fate::Attenuated as usize) > 0.0, model == Model::Hura2006);
        assert_eq!(shot.map.len(), 100_000);
    }
}

#[test]
fn slab_absorbs_what_discrete_ordinates_say() {
    // 64-stream discrete ordinates: g 0.75, albedo 0.9, tau 2, sun overhead: R 0.09739, T 0.66096.
    let slab = Shape::Slab { centre: DVec3::ZERO, half_height: 1.0, half_extent: DVec2::ONE };
    let mut scene = overhead(vec![region(slab, Medium::with_albedo(1.0, 0.9, 0.75))]);
    scene.sun.angular_diameter = 0.0;
    let shot = shoot(&scene, 2_000_000, 1);
    assert_agrees("A", shot.energy.ratio(Fate::AbsorbedMedium as usize), 1.0 - 0.09739 - 0.66096);
    // A slab of 1 m^2 gets its irradiance times its area: 4 W.
    assert!((shot.energy.denominator() / shot.traced as f64 - 4.0).abs() < 1e-5);
    assert!(shot.map.photons().iter().all(|p| p.position.iter().all(|x| x.abs() <= 1.0)));
}

#[test]
fn a_black_sphere_takes_what_the_closed_form_says() {
    // Albedo 0: absorbed = pi R^2 E (1 - 2 (1 - (1 + t) e^-t) / t^2), t = 2 R sigma: Beer-Lambert over the chords.
    // With no second collision the map stays empty, so a trace of albedo lets a few photons in.
    for (radius, sigma) in [(1.0, 0.5), (2.0, 1.0), (0.01, 300.0)] {
        let medium = Medium { sigma_s: [sigma * 0.02; 3], sigma_a: [sigma * 0.98; 3], g: 0.9 };
        let scene = overhead(vec![region(Shape::sphere(DVec3::new(5.0, 1.0, -3.0), radius), medium)]);
        let shot = shoot(&scene, 4000, 5);
        let t = 2.0 * radius * sigma;
        let collided = std::f64::consts::PI * radius * radius * (1.0 - 2.0 * (1.0 - (1.0 + t) * (-t).exp()) / (t * t));
        let e = power(&shot, Fate::AbsorbedMedium);
        // Of what collides, at least 98 % is absorbed at once; the rest again collides with probability at most 1.
        assert!(e.value > 0.98 * collided - 4.5 * e.se && e.value < collided + 4.5 * e.se, "{e:?} of {collided}");
    }
}

#[test]
fn overlapping_regions_equal_their_union_of_summed_extinction() {
    let medium = |s| Medium::with_albedo(s, 0.95, 0.7);
    let parts = shoot(&overhead([1.0, 2.0, 3.0].map(|s| region(Shape::sphere(DVec3::ZERO, 1.0), medium(s))).to_vec()), 400_000, 1);
    let whole = shoot(&overhead(vec![region(Shape::sphere(DVec3::ZERO, 1.0), medium(6.0))]), 400_000, 2);
    for fate in [Fate::AbsorbedMedium, Fate::Escaped] {
        assert_agrees("union", difference(power(&parts, fate), power(&whole, fate)), 0.0);
    }
}

#[test]
fn the_order_of_regions_does_not_matter() {
    let mut rng = Rng::new(1, Stage::Photons, 77);
    let mut regions: Vec<Region> = (0..12)
        .map(|i| {
            region(
                Shape::sphere(unit_ball([rng.uniform(), rng.uniform(), rng.uniform()]) * 2.0, 0.3 + rng.uniform()),
                Medium::with_albedo(1.0 + i as f64, 0.99, 0.8),
            )
        })
        .collect();
    let a = shoot(&overhead(regions.clone()), 300_000, 1);
    regions.reverse();
    let b = shoot(&overhead(regions), 300_000, 2);
    for fate in [Fate::AbsorbedMedium, Fate::Escaped] {
        assert_agrees("order", difference(power(&a, fate), power(&b, fate)), 0.0);
    }
}

#[test]
fn aimed_emission_brings_the_same_power_as_flooding_everything() {
    // The slow twin floods a wide rectangle; the aimed emitter starts over the silhouette and, for the light that the
    // white ground sends back, around it. Both must bring the same power into the medium.
    let mut scene = overhead(vec![region(Shape::sphere(DVec3::new(0.0, 0.0, 1.5), 1.0), Medium::with_albedo(4.0, 0.8, 0.5))]);
    scene.surfaces = vec![ground(0.0, 12.0, 0.9)];
    scene.sun.direction = DVec3::new(0.3, -0.2, -1.0).normalize();
    let aimed = shoot(&scene, 3_000_000, 1);
    let mut flood = tracer(&scene, Model::Physical);
    flood.emitter.target = Target::Tile { min: Vec2::splat(-20.0), size: Vec2::splat(40.0), top: 6.0 };
    let flooded = flood.fill(300_000, 2, &Silent).unwrap();
    let (a, b) = (power(&aimed, Fate::AbsorbedMedium), power(&flooded, Fate::AbsorbedMedium));
    assert!(a.se < 0.01 * a.value && b.se < 0.02 * b.value, "{a:?} {b:?}");
    assert_agrees("aimed", difference(a, b), 0.0);
    // And so must the stored photons' power.
    let stored = |shot: &Shot| shot.map.photons().iter().map(|p| f64::from(p.power)).sum::<f64>();
    assert!((stored(&aimed) / stored(&flooded) - 1.0).abs() < 0.03, "{} {}", stored(&aimed), stored(&flooded));
}

#[test]
fn stored_power_is_the_scattered_power_and_hura_stores_one_over_albedo_more() {
    // Physical: what is stored is power times albedo at each collision from the second on, so its sum over (1 - albedo) / albedo
    // is what these collisions absorb. The thesis stores absorbed photons at full power: 1 / albedo too bright.
    let scene = overhead(vec![region(Shape::sphere(DVec3::ZERO, 1.0), Medium::with_albedo(6.0, 0.8, 0.6))]);
    let shot = shoot(&scene, 1_000_000, 4);
    let stored: f64 = shot.map.photons().iter().map(|p| f64::from(p.power)).sum();
    let t: f64 = 12.0;
    let first = std::f64::consts::PI * (1.0 - 2.0 * (1.0 - (1.0 + t) * (-t).exp()) / (t * t));
    let absorbed = power(&shot, Fate::AbsorbedMedium);
    let expected = (absorbed.value - 0.2 * first) * 0.8 / 0.2;
    assert!((stored / expected - 1.0).abs() < 4.5 * 4.0 * absorbed.se / expected + 2e-3, "{stored} {expected}");
}

#[test]
fn the_same_bytes_on_any_number_of_threads() {
    let scene = overhead(vec![
        region(Shape::sphere(DVec3::ZERO, 1.0), Medium::with_albedo(20.0, 0.9999, 0.86)),
        region(Shape::sphere(DVec3::X, 0.7), Medium::with_albedo(20.0, 0.9999, 0.86)),
    ]);
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| shoot(&scene, 200_000, 11))
    };
    let one = run(1);
    for threads in [2, 3, 8] {
        let other = run(threads);
        assert_eq!(bytemuck::cast_slice::<_, u8>(one.map.photons()), bytemuck::cast_slice::<_, u8>(other.map.photons()));
        assert_eq!((one.emitted, &one.energy), (other.emitted, &other.energy));
    }
}

#[test]
fn no_light_is_an_error_that_says_so() {
    let mut dark = overhead(vec![region(Shape::sphere(DVec3::ZERO, 1.0), Medium::with_albedo(5.0, 1.0, 0.0))]);
    dark.sun.irradiance = [0.0; 3];
    let error = tracer(&dark, Model::Physical).fill(100, 1, &Silent).unwrap_err().to_string();
    assert!(error.contains("no light"), "{error}");
    let mut roofed = overhead(vec![region(Shape::sphere(DVec3::ZERO, 1.0), Medium::with_albedo(5.0, 1.0, 0.0))]);
    roofed.surfaces = vec![ground(3.0, 50.0, 0.0)];
    let error = tracer(&roofed, Model::Physical).fill(100, 1, &Silent).unwrap_err().to_string();
    assert!(error.contains("surfaces stand between"), "{error}");
    // A roof shades a layer without end too: light starts above both.
    let slab = Shape::Slab { centre: DVec3::ZERO, half_height: 1.0, half_extent: DVec2::ONE };
    let mut covered = overhead(vec![region(slab, Medium::with_albedo(5.0, 1.0, 0.0))]);
    covered.surfaces = vec![ground(3.0, 50.0, 0.0)];
    let error = tracer(&covered, Model::Physical).fill(100, 1, &Silent).unwrap_err().to_string();
    assert!(error.contains("surfaces stand between"), "{error}");
}

#[test]
fn packed_directions_stay_within_a_ten_thousandth() {
    let mut rng = Rng::new(1, Stage::Photons, 5);
    let mut random: Vec<Vec3> = (0..20_000).map(|_| unit_ball([rng.uniform(), rng.uniform(), 1.0]).as_vec3().normalize()).collect();
    random.extend([Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z]);
    for d in random {
        assert!((unpack_direction(pack_direction(d)) - d).length() < 1e-4, "{d}");
    }
}

#[test]
fn trees_count_what_brute_force_counts() {
    let scene = overhead(vec![
        region(Shape::sphere(DVec3::ZERO, 1.0), Medium::with_albedo(10.0, 0.99, 0.8)),
        region(Shape::sphere(DVec3::X * 1.5, 1.0), Medium::with_albedo(10.0, 0.99, 0.8)),
    ]);
    let shot = shoot(&scene, 20_000, 1);
    assert_eq!(shot.map.of_region(0).len() + shot.map.of_region(1).len(), 20_000);
    let mut rng = Rng::new(2, Stage::Regions, 0);
    for index in 0..2 {
        let photons = shot.map.of_region(index);
        assert!(photons.iter().all(|p| p.region() == index as u32));
        let tree = PhotonTree::new(photons).unwrap();
        for _ in 0..200 {
            let centre = Vec3::from_array(photons[(rng.uniform() * photons.len() as f64) as usize].position);
            let radius = rng.uniform_f32() * 0.5;
            let brute =
                photons.iter().filter(|p| (Vec3::from_array(p.position) - centre).length_squared() <= radius * radius).count() as u64;
            // The two round the squared distance differently: allow the photons that lie on the rim.
            let rim = photons.iter().filter(|p| ((Vec3::from_array(p.position) - centre).length() - radius).abs() < 1e-6).count() as u64;
            assert!(tree.count_within(centre, radius).abs_diff(brute) <= rim);
        }
    }
}

#[test]
fn trees_stand_photons_that_share_a_point_or_a_plane() {
    let photon = |x: f32, y: f32| Photon::new(Vec3::new(x, y, 0.5), Vec3::Z, 1.0, 0, 0);
    let point = vec![photon(0.25, 0.5); 50_000];
    assert_eq!(PhotonTree::new(&point).unwrap().count_within(Vec3::new(0.25, 0.5, 0.5), 1e-3), 50_000);
    let plane: Vec<Photon> = (0..50_000).map(|i| photon((i % 250) as f32, (i / 250) as f32)).collect();
    assert_eq!(PhotonTree::new(&plane).unwrap().count_within(Vec3::new(100.0, 100.0, 0.5), 1.1), 5);
    assert_eq!(PhotonTree::new(&[]).map_or(0, |t| t.count_within(Vec3::ZERO, 1.0)), 0);
}

/// Light starts over what a grid holds and a sample around it, not over its blocks, bricks or box.
#[test]
fn the_silhouette_of_voxels_is_that_of_what_they_hold() {
    let area = |filled: &[[usize; 3]]| {
        let mut values = vec![0.0; 512];
        filled.iter().for_each(|[x, y, z]| values[x << 6 | y << 3 | z] = 1.0);
        let bricks = BrickGrid { world_from_index: DAffine3::IDENTITY, origins: vec![[0; 3]], values };
        let grid = Shape::Grid(Arc::new(VoxelGrid::new(bricks, [0; 3], [7; 3], false)));
        let mut scene = overhead(vec![region(grid, Medium::with_albedo(1.0, 0.9, 0.0))]);
        scene.sun.angular_diameter = 0.0;
        tracer(&scene, Model::Physical).silhouette()
    };
    // The mask's cells add a little.
    for (filled, truth) in [(vec![[1, 2, 0]], 4.0), (vec![[1, 2, 0], [6, 6, 7]], 8.0), (vec![[1, 2, 0], [2, 3, 5], [1, 3, 7]], 8.0)] {
        let found = area(&filled);
        assert!((truth..1.02 * truth).contains(&found), "{filled:?}: {found} instead of {truth}");
    }
}
