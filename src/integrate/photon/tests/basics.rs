//! Pass 2's parts against slow, obvious twins, and what it does with photons that nobody would store.

use super::super::beam::Beams;
use super::super::gather::Groups;
use super::super::*;
use crate::film::{Film, Pixel};
use crate::integrate::lobe::Lobe;
use crate::integrate::{Integrator, render};
use crate::photon::{GROUPS, unpack_direction};
use crate::plan::Density;
use crate::progress::Silent;
use crate::rng::Stage;
use crate::sampling::unit_ball;
use crate::scene::phase::henyey_greenstein;
use crate::scene::{Camera, Mesh, Shape, Sun};
use glam::{DAffine3, DMat3};

fn region(centre: DVec3, radius: f64, medium: Medium) -> Region {
    Region { name: "ball".into(), shape: Shape::sphere(centre, radius), medium, photons: None }
}

fn direction(rng: &mut Rng) -> Vec3 {
    unit_ball([rng.uniform(), rng.uniform(), 1.0]).as_vec3().normalize()
}

fn crowd(n: usize, seed: u64) -> Vec<Photon> {
    let mut rng = Rng::new(seed, Stage::Gather, 0);
    let photon = |i: usize| {
        let p = unit_ball([rng.uniform(), rng.uniform(), rng.uniform()]).as_vec3();
        Photon::new(p, direction(&mut rng), rng.uniform_f32(), 0, i)
    };
    (0..n).map(photon).collect()
}

#[test]
fn the_lobe_is_henyey_and_greensteins() {
    let mut rng = Rng::new(1, Stage::Gather, 0);
    for g in [-0.99, -0.3, 0.0, 0.5, 0.86, 0.999] {
        for _ in 0..1000 {
            let (a, b) = (direction(&mut rng), direction(&mut rng));
            let (x, y) = (a.as_dvec3().normalize(), b.as_dvec3().normalize());
            let exact = henyey_greenstein(g, if g < 0.0 { 2.0 - 0.5 * (x + y).length_squared() } else { 0.5 * (x - y).length_squared() });
            let found = f64::from(Lobe::new(g, b).value(a));
            assert!((found / exact - 1.0).abs() < 1e-4, "g {g}: {found}, {exact}");
        }
    }
}

#[test]
fn the_estimate_is_its_sum() {
    let medium = Medium::with_albedo(2.0, 0.9, 0.6);
    let media = Media::new(&[region(DVec3::ZERO, 1.0, medium)], DVec3::ZERO);
    let (photons, mut rng) = (crowd(2000, 7), Rng::new(2, Stage::Gather, 0));
    for model in [Model::Physical, Model::Hura2006] {
        let gather = Gather::new(photons.clone(), 60, model, None);
        let mut hood = Neighbourhood::default();
        for _ in 0..50 {
            let (p, outward) = (unit_ball([rng.uniform(), rng.uniform(), rng.uniform()]).as_vec3(), direction(&mut rng));
            let found = gather.scattered(p, outward, 0.6, 2.0, &media, &mut hood);
            let mut all: Vec<&Photon> = photons.iter().collect();
            let far = |q: &Photon| Vec3::from_array(q.position).distance(p);
            all.sort_by(|a, b| far(a).total_cmp(&far(b)));
            let r = far(all[59]);
            let volume = 4.0 / 3.0 * std::f64::consts::PI * f64::from(r).powi(3);
            // Eq. 23 as printed; and with n - 1, and the extinction that the ball holds.
            let (n, mass) = if model == Model::Physical { (59, media.mass_within(p, r)) } else { (60, 2.0 * volume) };
            let mut expected: Groups = [0.0; GROUPS];
            for q in &all[..n] {
                let turn = 0.5 * f64::from((unpack_direction(q.direction) - outward).length_squared());
                expected[q.group()] += f64::from(q.power) * henyey_greenstein(0.6, turn) / mass;
            }
            for (a, b) in found.iter().zip(expected) {
                assert!((a - b).abs() <= 1e-4 * b, "{model:?}: {found:?}, {expected:?}");
            }
        }
    }
}

#[test]
fn a_beam_finds_every_ball_that_it_pierces() {
    // So thin that no roulette is played: the sum is then the same for every ray.
    let medium = Medium::with_albedo(0.3, 0.8, 0.4);
    let regions = [region(DVec3::ZERO, 1.0, medium), region(DVec3::X * 0.8, 0.7, medium)];
    let media = Media::new(&regions, DVec3::ZERO);
    let beams = Beams::new(crowd(5000, 8), 100, &media, &Silent).unwrap();
    let (mut rng, mut room) = (Rng::new(3, Stage::Gather, 0), Room::default());
    let mut met = 0;
    for _ in 0..60 {
        let origin = direction(&mut rng) * 3.0;
        let toward = (unit_ball([rng.uniform(), rng.uniform(), rng.uniform()]).as_vec3() - origin).normalize();
        let (ray, reach) = (Ray { origin, direction: toward }, 1.0 + 4.0 * rng.uniform_f32());
        let mut found: Groups = [0.0; GROUPS];
        beams.along(&ray, reach, &media, (&mut found, &mut Groups::default()), &mut rng, &mut room);
        // Each photon's light along its chord, by many points.
        let mut expected = 0.0;
        for (photon, radius) in beams.each() {
            let away = Vec3::from_array(photon.position) - origin;
            let t = away.dot(toward);
            let half2 = radius * radius - (away - toward * t).length_squared();
            if half2 <= 0.0 {
                continue;
            }
            met += 1;
            let (half, steps) = (half2.sqrt(), 100);
            let turn = 0.5 * f64::from((unpack_direction(photon.direction) + toward).length_squared());
            let light = f64::from(photon.power) * henyey_greenstein(0.4, turn) * f64::from(2.0 * half) / f64::from(steps);
            for i in 0..steps {
                let t = t - half + 2.0 * half * (i as f32 + rng.uniform_f32()) / steps as f32;
                let here = origin + toward * t;
                let holds = |r: &&Region| r.shape.centre().as_vec3().distance(here) < r.shape.smallest_half_extent() as f32;
                let regions = regions.iter().filter(holds).count();
                if regions > 0 && t > 0.0 && t < reach {
                    expected += light * 0.24 * regions as f64 * (-media.optical_depth(&ray, t, &mut room.scratch)).exp();
                }
            }
        }
        let sum: f64 = found.iter().sum();
        // Within a chord the transmittance is that of its middle: less by at most tau^2 / 24, and no chord is 0.44 deep.
        assert!((sum - expected).abs() <= 8e-3 * expected + 1e-9, "{sum}, {expected}");
    }
    assert!(met > 1000, "{met}");
}

fn settings(photon: PhotonSettings, seed: u64, spp: u32) -> RenderSettings {
    RenderSettings { integrator: Integrator::Photon, width: 24, height: 20, spp, seed, photon }
}

fn camera(z: f64) -> Camera {
    // Along -Y, from z metres away.
    let matrix3 = DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::NEG_Y);
    Camera { world_from_camera: DAffine3 { matrix3, translation: DVec3::NEG_Y * z }, yfov: 0.8, aspect: None, znear: 0.0, zfar: None }
}

fn picture(scene: &Scene, settings: &RenderSettings, pass1: Option<PhotonMap>) -> (Film, Lighting) {
    let plan = Plan::for_scene(scene, Density::Source);
    // So far that everything is seen.
    let far = 3.0 + scene.region_bounds().size().x;
    let r = render(scene, &plan, &camera(far), settings, pass1, &Silent).unwrap();
    let sound =
        |p: &Pixel| p.combined().iter().chain(&p.standard_error).chain([&p.depth, &p.transmittance]).all(|c| c.is_finite() && *c >= 0.0);
    assert!(r.film.pixels.iter().all(sound));
    (r.film, r.photons.unwrap())
}

fn two_balls() -> Scene {
    let (a, b) = (Medium::with_albedo(3.0, 0.9, 0.5), Medium::with_albedo(6.0, 0.7, -0.2));
    let regions = vec![region(DVec3::X * -0.4, 0.7, a), region(DVec3::X * 0.4, 0.6, b)];
    Scene { regions, sun: Sun { direction: DVec3::new(0.3, 0.5, -0.8).normalize(), ..Sun::default() }, ..Scene::default() }
}

#[test]
fn the_same_seed_gives_the_same_picture_on_any_number_of_threads() {
    let scene = two_balls();
    for (model, gather) in [(Model::Physical, Gathering::March), (Model::Physical, Gathering::Beam), (Model::Hura2006, Gathering::March)] {
        let photon = PhotonSettings { model, gather, photons: 20_000, ..PhotonSettings::default() };
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| picture(&scene, &settings(photon, 5, 2), None))
        };
        let one = with(1);
        assert!(one == with(2) && one == with(7), "{model:?} {gather:?}");
        assert!(one != picture(&scene, &settings(photon, 6, 2), None));
    }
}

#[test]
fn photons_that_nobody_would_store_make_a_picture_all_the_same() {
    let scene = two_balls();
    let map = |photons: Vec<Photon>| {
        let mut map = PhotonMap::new(scene.region_bounds().centre(), 0);
        map.extend(&photons);
        Some(map)
    };
    let at = |p: Vec3| Photon::new(p, Vec3::Z, 1e-3, 0, 0);
    let mut rng = Rng::new(4, Stage::Gather, 0);
    let disc: Vec<Photon> = (0..500).map(|i| Photon::new(direction(&mut rng) * Vec3::new(0.5, 0.0, 0.5), Vec3::Y, 1e-3, 1, i)).collect();
    let odd = [("none", vec![]), ("one", vec![at(Vec3::ZERO)]), ("one point", vec![at(Vec3::ZERO); 500]), ("a plane", disc)];
    for (name, photons) in odd {
        for (model, gather) in
            [(Model::Physical, Gathering::March), (Model::Physical, Gathering::Beam), (Model::Hura2006, Gathering::March)]
        {
            for estimate in [None, Some(1), Some(100_000)] {
                let photon = PhotonSettings { model, gather, estimate, ..PhotonSettings::default() };
                let (film, lighting) = picture(&scene, &settings(photon, 1, 2), map(photons.clone()));
                assert_eq!(lighting.stored, photons.len() as u64, "{name}");
                assert!(film.mean() > 0.0, "{name} {model:?}: sunlight that scattered once is there in any case");
            }
        }
    }
}

#[test]
fn scenes_without_stored_light_are_rendered() {
    let photon = PhotonSettings { photons: 1000, ..PhotonSettings::default() };
    let spare = |change: &dyn Fn(&mut Scene)| {
        let mut scene = two_balls();
        change(&mut scene);
        picture(&scene, &settings(photon, 1, 2), None)
    };
    let (dark, stored) = spare(&|s| s.sun.irradiance = [0.0; 3]);
    assert_eq!((dark.mean(), stored.stored), (0.0, 0));
    // Regions that only absorb; hardly any matter; a region beside that holds no light.
    let (black, _) = spare(&|s| s.regions.iter_mut().for_each(|r| r.medium = Medium::grey(0.0, 5.0, 0.0)));
    assert_eq!(black.mean(), 0.0);
    let (thin, _) = spare(&|s| s.regions.iter_mut().for_each(|r| r.medium = Medium::grey(1e-9, 0.0, 0.0)));
    assert!(thin.mean() > 0.0 && thin.mean() < 1e-8, "{}", thin.mean());
    let (half, _) = spare(&|s| s.regions[1].medium = Medium::grey(0.0, 5.0, 0.0));
    assert!(half.mean() > 0.0);
    // One of the two under a roof, where no light comes.
    let (shaded, lighting) = spare(&|s| {
        s.regions[1].shape = Shape::sphere(DVec3::X * 6.0, 0.6);
        let corner = |x: f64, y: f64| DVec3::new(6.0 + 2.0 * x, 2.0 * y, 2.0);
        let vertices = vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
        let mesh = Mesh { vertices, triangles: vec![[0, 1, 2], [0, 2, 3]] };
        s.surfaces.push(Surface { name: "roof".into(), mesh, albedo: [0.0; 3] });
        s.sun.direction = DVec3::NEG_Z;
    });
    assert!(shaded.mean() > 0.0 && lighting.stored == 1000);
    let (sky, _) = spare(&|s| (s.regions, s.sky) = (Vec::new(), [0.5; 3]));
    assert!((sky.mean() - 0.5).abs() < 1e-6, "{}", sky.mean());
}

#[test]
fn to_the_letter_a_coincident_region_is_lit_twice() {
    // Two regions in one place are one of twice the extinction: the physical picture agrees, the thesis's has the photons of both
    // in each.
    let scene = |sigma: f64, copies: usize| {
        let medium = Medium::with_albedo(sigma, 1.0, 0.0);
        Scene { regions: vec![region(DVec3::ZERO, 0.8, medium); copies], ..two_balls() }
    };
    // The mean of six seeds, and its squared standard error.
    let lit = |scene: &Scene, model: Model| {
        let photon = PhotonSettings { model, photons: 20_000, estimate: Some(100), ..PhotonSettings::default() };
        let one =
            |seed| picture(scene, &settings(photon, seed, 4), None).0.pixels.iter().map(|p| f64::from(p.volume_indirect[1])).sum::<f64>();
        let all: Vec<f64> = (0..6).map(one).collect();
        let mean = all.iter().sum::<f64>() / 6.0;
        (mean, all.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 30.0)
    };
    let (once, twice) = (scene(2.0, 1), scene(1.0, 2));
    for (model, expected) in [(Model::Physical, 1.0), (Model::Hura2006, 2.0)] {
        let ((one, one2), (two, two2)) = (lit(&once, model), lit(&twice, model));
        let (z, half) = ((two - expected * one) / (two2 + expected * expected * one2).sqrt(), (two2 / two / two).sqrt());
        // Student's t with some 10 degrees of freedom; and so well known that 1 and 2 are told apart.
        assert!(z.abs() < 5.0 && half < 0.05, "{model:?}: {one}, {two}, Z {z}, {half}");
    }
}
