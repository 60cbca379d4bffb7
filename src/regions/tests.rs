//! The duality against closed forms, brute force and the rule it is meant to follow (thesis 3.3.1, eqs 17 and 27).

use super::points::Inside;
use super::*;
use crate::photon::Photon;
use crate::progress::Silent;
use crate::sampling::unit_ball;
use crate::scene::{Medium, Mesh};
use glam::{DAffine3, DMat3, DQuat, DVec2, DVec3, Vec3};
use std::f64::consts::PI;
use std::sync::Arc;

fn region(name: &str, shape: Shape, sigma_t: f64) -> Region {
    Region { name: name.into(), shape, medium: Medium::with_albedo(sigma_t, 0.99, 0.8), photons: None }
}

fn scene(regions: Vec<Region>) -> Scene {
    Scene { regions, ..Scene::default() }
}

fn ball(sigma_t: f64) -> Scene {
    scene(vec![region("ball", Shape::sphere(DVec3::ZERO, 1.0), sigma_t)])
}

fn tetrahedron() -> Mesh {
    Mesh {
        vertices: [[0.0, 0.0, 0.0], [2.2, 0.2, 0.0], [0.4, 2.6, 0.2], [0.2, 0.4, 1.8]].map(DVec3::from_array).to_vec(),
        triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]],
    }
}

fn ellipsoid() -> Shape {
    let turn = DMat3::from_quat(DQuat::from_rotation_x(0.7) * DQuat::from_rotation_z(0.4));
    Shape::Ellipsoid {
        world_from_unit: DAffine3 { matrix3: turn * DMat3::from_diagonal(DVec3::new(1.5, 0.8, 1.1)), translation: DVec3::splat(2.0) },
    }
}

/// Every shape, with an optical thickness of 20 each.
fn shapes() -> Vec<Scene> {
    let slab = Shape::Slab { centre: DVec3::new(1.0, 2.0, 3.0), half_height: 0.6, half_extent: DVec2::new(2.0, 1.5) };
    let mesh = Shape::Mesh(Arc::new(tetrahedron()));
    let single = [("sphere", Shape::sphere(DVec3::new(3.0, 0.0, -1.0), 0.7)), ("ellipsoid", ellipsoid()), ("slab", slab), ("mesh", mesh)]
        .map(|(name, shape)| {
            let sigma = 20.0 / shape.thickness();
            scene(vec![region(name, shape, sigma)])
        });
    let crowd = (0..5)
        .map(|i| region(&format!("part {i}"), Shape::sphere(DVec3::X * (0.5 * f64::from(i)), 1.0), 4.0 + 3.0 * f64::from(i)))
        .chain([region("round all", Shape::sphere(DVec3::X, 2.0), 5.0)]);
    single.into_iter().chain([scene(crowd.collect())]).collect()
}

fn map_of(origin: DVec3, photons: impl IntoIterator<Item = (u32, DVec3)>) -> PhotonMap {
    let mut map = PhotonMap::new(origin, 0);
    let photons: Vec<Photon> =
        photons.into_iter().map(|(region, p)| Photon::new((p - origin).as_vec3(), glam::Vec3::Z, 1.0, region, 0)).collect();
    map.extend(&photons);
    map.finish(1.0);
    map
}

/// `n` photons uniform in each region.
fn uniform_map(scene: &Scene, n: usize, seed: u64) -> PhotonMap {
    let mut rng = Rng::new(seed, Stage::Photons, 1);
    let mut all = Vec::new();
    for (i, region) in scene.regions.iter().enumerate() {
        let points = Points::new(region, &[], DVec3::ZERO, Placement::Uniform);
        all.extend((0..n).map(|_| (i as u32, points.draw(&mut rng))));
    }
    map_of(scene.region_bounds().centre(), all)
}

fn run(scene: &Scene, map: &PhotonMap, duality: Duality) -> Synthesis {
    synthesise(scene, map, &duality, &Silent).unwrap()
}

fn with(estimate: u64) -> Duality {
    Duality { estimate: Some(estimate), seed: 7, ..Duality::default() }
}

/// The stretch of the new regions that each source made.
fn by_source(s: &Synthesis) -> Vec<&[Region]> {
    let mut from = 0;
    let parts = s.sources.iter().map(|source| {
        from += source.regions as usize;
        &s.regions[from - source.regions as usize..from]
    });
    let parts: Vec<_> = parts.collect();
    assert_eq!(from, s.regions.len());
    parts
}

fn mass(regions: &[Region]) -> f64 {
    regions.iter().map(Region::optical_mass).sum()
}

fn radius(r: &Region) -> f64 {
    r.shape.smallest_half_extent()
}

/// Finite, within the budget, each of its own medium, the books exact.
fn check_books(scene: &Scene, s: &Synthesis) {
    assert!((0.0..=1.0).contains(&s.sticking_out), "{}", s.sticking_out);
    assert_eq!(s.sources.len(), scene.regions.len());
    for ((source, made), layout) in s.sources.iter().zip(by_source(s)).zip(&scene.regions) {
        assert!((source.synthesised - mass(made)).abs() <= 2e-9 * source.mass, "{}: {} {}", source.name, source.synthesised, mass(made));
        assert!(source.synthesised <= source.mass * (1.0 + 1e-12));
        assert!((source.mass - layout.optical_mass()).abs() <= 1e-12 * source.mass);
        assert!(source.candidates >= source.regions && source.candidates <= (source.regions + 1) * REFUSALS);
        for r in made {
            assert!(radius(r).is_finite() && radius(r) > 0.0 && r.shape.centre().is_finite());
            assert_eq!(r.medium, layout.medium, "nothing is scaled");
        }
    }
}

#[test]
fn optical_mass_is_kept_to_a_billionth_whatever_the_shape() {
    for scene in shapes() {
        let map = uniform_map(&scene, 40_000, 1);
        for placement in [Placement::Uniform, Placement::Importance] {
            let s = run(&scene, &map, Duality { placement, ..with(4) });
            check_books(&scene, &s);
            for ((source, made), layout) in s.sources.iter().zip(by_source(&s)).zip(&scene.regions) {
                let ratio = mass(made) / layout.optical_mass();
                assert!((ratio - 1.0).abs() <= 1e-9, "{} {placement:?}: {ratio}", source.name);
                assert_eq!(source.synthesised, source.mass);
                assert!(made.len() > 1, "{}: {}", source.name, made.len());
            }
        }
    }
}

#[test]
fn the_thesis_never_exceeds_the_source_volume() {
    for scene in shapes() {
        let map = uniform_map(&scene, 40_000, 2);
        for seed in 0..4 {
            let s = run(&scene, &map, Duality { model: Model::Hura2006, seed, ..with(4) });
            check_books(&scene, &s);
            for (made, layout) in by_source(&s).iter().zip(&scene.regions) {
                let volume: f64 = made.iter().map(|r| r.shape.volume()).sum();
                // Summed in another order than the budget was spent.
                assert!(volume <= layout.shape.volume() * (1.0 + 1e-12), "{volume} {}", layout.shape.volume());
                assert!(volume > 0.9 * layout.shape.volume(), "4,096 refusals leave little: {volume}");
            }
        }
    }
}

#[test]
fn every_region_holds_the_photons_it_says_and_at_least_the_estimate() {
    for scene in shapes() {
        let map = uniform_map(&scene, 6000, 3);
        for (model, placement) in [
            (Model::Physical, Placement::Uniform),
            (Model::Physical, Placement::Importance),
            (Model::Hura2006, Placement::Uniform),
            (Model::Hura2006, Placement::Importance),
        ] {
            let s = run(&scene, &map, Duality { model, placement, ..with(12) });
            for (index, (made, source)) in by_source(&s).iter().zip(&s.sources).enumerate() {
                let filled = source.synthesised == source.mass;
                for (i, r) in made.iter().enumerate() {
                    let said = r.photons.unwrap();
                    let shrunk = model == Model::Physical && filled && i + 1 == made.len();
                    assert!(said >= 12 || shrunk, "{}: {said}", r.name);
                    let (centre, d) = ((r.shape.centre() - map.origin).as_vec3(), radius(r) as f32);
                    let distance = |p: &Photon| (Vec3::from_array(p.position) - centre).length();
                    let photons = map.of_region(index);
                    let brute = photons.iter().filter(|p| distance(p) <= d).count() as u64;
                    let rim = photons.iter().filter(|p| (distance(p) - d).abs() < 1e-6).count() as u64;
                    assert!(said.abs_diff(brute) <= rim, "{}: {said} {brute} {rim}", r.name);
                }
            }
        }
    }
}

#[test]
fn the_default_estimate_is_the_root_of_the_photons() {
    for (photons, estimate) in [(10_000, 100), (400, 20), (1, 1)] {
        let scene = ball(10.0);
        let s = run(&scene, &uniform_map(&scene, photons, 4), Duality::default());
        assert_eq!((s.sources[0].photons, s.sources[0].estimate), (photons as u64, estimate));
    }
}

#[test]
fn the_stopping_rule_ends_and_the_shortfall_is_exact() {
    let scene = ball(20.0);
    let mut rng = Rng::new(5, Stage::Photons, 2);
    let corner = DVec3::splat(0.55);
    let cornered = map_of(DVec3::ZERO, (0..5000).map(|_| (0, corner + 0.02 * unit_ball([rng.uniform(), rng.uniform(), rng.uniform()]))));
    let spread = uniform_map(&scene, 5000, 5);
    for model in [Model::Physical, Model::Hura2006] {
        // Photons in one corner: hardly any candidate is near enough.
        let s = run(&scene, &cornered, Duality { model, ..with(5000) });
        check_books(&scene, &s);
        assert!(s.sources[0].synthesised < s.sources[0].mass, "{:?}", s.sources[0]);
        assert!(s.regions.iter().all(|r| r.photons >= Some(5000)));
        // More photons than there are: not even looked for.
        let s = run(&scene, &spread, Duality { model, ..with(5001) });
        assert_eq!((s.regions.len(), s.sources[0].candidates, s.sources[0].synthesised), (0, 0, 0.0));
        assert_eq!(s.sticking_out, 0.0);
        // All of them, where a free path is a twentieth of the radius: refused to the end.
        let s = run(&scene, &spread, Duality { model, ..with(5000) });
        assert_eq!((s.regions.len(), s.sources[0].candidates, s.sources[0].synthesised), (0, REFUSALS, 0.0));
    }
    // The tail of candidates after the last region is the run of refusals.
    let s = run(&scene, &cornered, with(5000));
    let made = s.sources[0].regions;
    assert!(s.sources[0].candidates >= made + REFUSALS);
}

#[test]
fn nothing_one_and_a_million_photons_in_a_point_or_a_plane() {
    let scene = ball(6.0);
    let nothing = map_of(DVec3::ZERO, []);
    let one = map_of(DVec3::ZERO, [(0, DVec3::splat(0.2))]);
    let point = map_of(DVec3::ZERO, (0..1_000_000).map(|_| (0, DVec3::splat(0.3))));
    let plane = map_of(DVec3::ZERO, (0..1_000_000).map(|i| (0, DVec3::new(f64::from(i % 1000), f64::from(i / 1000), 0.0) * 0.001 - 0.5)));
    for model in [Model::Physical, Model::Hura2006] {
        for placement in [Placement::Uniform, Placement::Importance] {
            for estimate in [None, Some(0), Some(1)] {
                let duality = Duality { model, placement, estimate, seed: 1 };
                let s = run(&scene, &nothing, duality);
                check_books(&scene, &s);
                assert_eq!(s.regions.len(), 0, "{duality:?}");
            }
            check_books(&scene, &run(&scene, &one, Duality { model, placement, ..with(1) }));
            for map in [&point, &plane] {
                let s = run(&scene, map, Duality { model, placement, ..with(1000) });
                check_books(&scene, &s);
                assert!(s.regions.iter().rev().skip(1).all(|r| r.photons >= Some(1000)));
            }
        }
    }
    // All photons in a point, candidates at photons: every distance is accepted, and the budget is met.
    let s = run(&scene, &point, Duality { placement: Placement::Importance, ..with(1000) });
    assert_eq!(s.sources[0].synthesised, s.sources[0].mass);
    // A region without photons, extinction or volume, beside one that has them.
    let mut mixed = ball(12.0);
    mixed.regions.push(region("void", Shape::sphere(DVec3::X, 1.0), 0.0));
    mixed.regions.push(region("flat", Shape::Mesh(Arc::new(Mesh { triangles: vec![[0, 1, 2], [0, 2, 1]], ..tetrahedron() })), 5.0));
    for estimate in [None, Some(0), Some(1)] {
        let s = run(&mixed, &one, Duality { estimate, ..Duality::default() });
        check_books(&mixed, &s);
        assert_eq!((s.sources[1].regions, s.sources[2].regions), (0, 0));
    }
}

#[test]
fn an_opaque_region_does_not_ask_for_more_regions_than_memory_holds() {
    // A photon always finds itself: without a bound, an optical depth of 2,000 asks for 10^9 / 6 balls of a free path each.
    let scene = ball(1000.0);
    let map = map_of(DVec3::ZERO, (0..10).map(|i| (0, DVec3::X * 0.05 * f64::from(i))));
    let s = run(&scene, &map, Duality { placement: Placement::Importance, ..with(1) });
    check_books(&scene, &s);
    assert!(s.sources[0].synthesised < s.sources[0].mass);
    assert_eq!(s.sources[0].regions, MOST_REGIONS);
}

/// The volume that a ball of radius `d` shares with the unit ball, centres `r` apart.
fn shared(d: f64, r: f64) -> f64 {
    if r + d <= 1.0 {
        return 4.0 / 3.0 * PI * d.powi(3);
    }
    if r >= 1.0 + d {
        return 0.0;
    }
    PI * (1.0 + d - r).powi(2) * (r * r + 2.0 * r * d - 3.0 * d * d + 2.0 * r + 6.0 * d - 3.0) / (12.0 * r)
}

#[test]
fn the_same_bytes_on_any_number_of_threads() {
    for scene in shapes() {
        let map = uniform_map(&scene, 3000, 11);
        for placement in [Placement::Uniform, Placement::Importance] {
            let text = |threads| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                let s = pool.install(|| run(&scene, &map, Duality { placement, ..with(10) }));
                assert!(!s.regions.is_empty());
                // Debug prints every f64 so that it reads back as the same bits.
                format!("{s:?}")
            };
            let one = text(1);
            assert!(one == text(2) && one == text(3), "{placement:?}");
        }
    }
}

#[test]
fn sticking_out_is_what_a_finer_count_says() {
    for scene in shapes().into_iter().filter(|s| s.regions.len() == 1) {
        let source = &scene.regions[0];
        let s = run(&scene, &uniform_map(&scene, 20_000, 12), with(3));
        let (inside, mut rng) = (Inside::new(&source.shape).unwrap(), Rng::new(13, Stage::Regions, 5));
        let (mut out, mut whole, mut variance) = (0.0, 0.0, 0.0);
        let points = 1000;
        for r in &s.regions {
            let (centre, d, volume) = (r.shape.centre(), radius(r), r.shape.volume());
            let outside = |rng: &mut Rng| {
                // By rejection from the cube, and not by the warp that is under test.
                loop {
                    let p = DVec3::new(rng.uniform(), rng.uniform(), rng.uniform()) * 2.0 - 1.0;
                    if p.length_squared() <= 1.0 {
                        return !inside.holds(centre + p * d);
                    }
                }
            };
            let p = (0..points).filter(|_| outside(&mut rng)).count() as f64 / f64::from(points);
            out += p * volume;
            whole += volume;
            variance += volume * volume * p * (1.0 - p) * (1.0 / 32.0 + 1.0 / f64::from(points));
        }
        let (truth, se) = (out / whole, variance.sqrt() / whole);
        assert!(truth > 0.01 && (s.sticking_out - truth).abs() < 4.5 * se, "{}: {} {truth} +- {se}", source.name, s.sticking_out);
        if let (Shape::Ellipsoid { .. }, "sphere") = (&source.shape, source.name.as_str()) {
            let big = radius(source);
            let exact: f64 = s
                .regions
                .iter()
                .map(|r| {
                    let (d, at) = (radius(r) / big, (r.shape.centre() - source.shape.centre()).length() / big);
                    r.shape.volume() - shared(d, at) * big.powi(3)
                })
                .sum();
            assert!((s.sticking_out - exact / whole).abs() < 4.5 * se, "{} {}", s.sticking_out, exact / whole);
        }
    }
}

mod cloud;
mod crowded;
mod statistics;
