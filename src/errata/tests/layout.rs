//! Traps 7 and 8: the new regions, and the light in them.

use super::*;
use crate::photon::{Model, Photon, PhotonMap, Tracer};
use crate::plan::{Density, Plan};
use crate::progress::Silent;
use crate::regions::{Duality, Synthesis, synthesise};
use crate::sampling::unit_ball;
use crate::stats::Ratios;
use glam::Vec3;
use std::f64::consts::PI;

fn in_ball(rng: &mut Rng) -> DVec3 {
    unit_ball([rng.uniform(), rng.uniform(), rng.uniform()])
}

fn duality(scene: &Scene, map: &PhotonMap, estimate: u64, seed: u64) -> Synthesis {
    synthesise(scene, map, &Duality { model: Model::Hura2006, estimate: Some(estimate), seed, ..Duality::default() }, &Silent).unwrap()
}

/// Where a photon lies in the world.
fn place(map: &PhotonMap, photon: &Photon) -> DVec3 {
    map.origin + Vec3::from_array(photon.position).as_dvec3()
}

/// How many balls hold a point.
fn holding(balls: &[(DVec3, f64)], p: DVec3) -> usize {
    balls.iter().filter(|(centre, r)| (p - *centre).length_squared() <= r * r).count()
}

fn balls(s: &Synthesis) -> Vec<(DVec3, f64)> {
    s.regions.iter().map(|r| (r.shape.centre(), r.shape.smallest_half_extent())).collect()
}

#[test]
fn trap_07_balls_of_the_whole_volume_leave_a_third_of_it_empty() {
    // Equal balls at random in a cube that repeats: no boundary, so that this is the inside of a region without end.
    for (n, runs, empty) in [(10, 4000, 0.349), (100, 1000, 0.366), (1000, 200, 0.368)] {
        let r2 = (0.75 / PI / f64::from(n)).powf(2.0 / 3.0);
        let mut rng = random(7 + n as u64);
        let cube = |rng: &mut Rng| DVec3::new(rng.uniform(), rng.uniform(), rng.uniform());
        let (mut none, mut several) = (Vec::new(), Vec::new());
        for _ in 0..runs {
            let centres: Vec<DVec3> = (0..n).map(|_| cube(&mut rng)).collect();
            let counts: Vec<usize> = (0..50)
                .map(|_| {
                    let p = cube(&mut rng);
                    centres.iter().filter(|c| ((p - **c) - (p - **c).round()).length_squared() <= r2).count()
                })
                .collect();
            none.push(counts.iter().filter(|&&k| k == 0).count() as f64 / 50.0);
            several.push(counts.iter().filter(|&&k| k > 1).count() as f64 / 50.0);
        }
        let q = 1.0 - 1.0 / f64::from(n);
        agrees(&format!("empty, {n}"), mean(none), q.powi(n));
        printed(&format!("empty, {n}"), exact(q.powi(n)), empty, 1e-3);
        agrees(&format!("overlap, {n}"), mean(several), 1.0 - q.powi(n) - q.powi(n - 1));
    }
}

#[test]
fn trap_07_so_does_the_duality_in_the_middle_of_a_large_sphere() {
    // Twenty-four free paths in radius, photons everywhere, one of them enough: every distance of eq. 17 becomes a ball.
    let scene = overhead(Shape::sphere(DVec3::ZERO, 24.0), thesis_medium());
    let whole = scene.regions[0].shape.volume();
    let runs = (0..32).map(|seed| {
        let mut rng = random(700 + seed);
        let mut map = PhotonMap::new(DVec3::ZERO, 0);
        let photon = |p: DVec3| Photon::new(p.as_vec3(), glam::Vec3::Z, 1.0, 0, 0);
        map.extend(&(0..20_000).map(|_| photon(24.0 * in_ball(&mut rng))).collect::<Vec<_>>());
        map.finish(1.0);
        let balls = balls(&duality(&scene, &map, 1, seed));
        let empty = (0..200).filter(|_| holding(&balls, 10.0 * in_ball(&mut rng)) == 0).count() as f64 / 200.0;
        // Centres uniform and independent: each ball misses a point by the share of the region that it is not.
        (empty, balls.iter().map(|(_, r)| 1.0 - 4.0 / 3.0 * PI * r.powi(3) / whole).product::<f64>(), balls.len() as f64)
    });
    let runs: Vec<(f64, f64, f64)> = runs.collect();
    agrees("empty less expected", mean(runs.iter().map(|r| r.0 - r.1)), 0.0);
    printed("empty", mean(runs.iter().map(|r| r.0)), 0.34, 0.01);
    printed("balls", mean(runs.iter().map(|r| r.2)), 1100.0, 100.0);
}

#[test]
fn trap_07_and_08_the_thesis_s_own_sphere() {
    let scene = thesis_sphere();
    let plan = Plan::for_scene(&scene, Density::Duality);
    let letter = Tracer::new(&scene, &plan, Model::Hura2006);
    let physical = Tracer::new(&scene, &plan, Model::Physical);
    let mut figures: [Vec<f64>; 8] = Default::default();
    let mut shade = Ratios::<1>::default();
    for seed in 0..32 {
        let mut rng = random(800 + seed);
        let map = letter.fill(10_000, seed, &Silent).unwrap().map;
        let s = duality(&scene, &map, 100, seed);
        let balls = balls(&s);
        // Coverage of the whole sphere, and of its photons.
        let empty = (0..500).filter(|_| holding(&balls, 6.0 * in_ball(&mut rng)) == 0).count() as f64 / 500.0;
        let counts: Vec<usize> = map.photons().iter().step_by(20).map(|p| holding(&balls, place(&map, p))).collect();
        let share = |f: &dyn Fn(usize) -> bool| counts.iter().filter(|&&k| f(k)).count() as f64 / counts.len() as f64;
        // The power that scatters in the third of the sphere that is farthest from the sun: what the old photons in
        // new regions carry, over what is found when photons are traced through the new regions.
        let new = Scene { regions: s.regions.clone(), ..scene.clone() };
        let again = Tracer::new(&new, &Plan::for_scene(&new, Density::Duality), Model::Physical);
        let power = |tracer: &Tracer, seen: &dyn Fn(DVec3) -> bool| -> f64 {
            let map = tracer.fill(5000, seed, &Silent).unwrap().map;
            let at = |p: &Photon| place(&map, p);
            map.photons().iter().filter(|p| at(p).z < -2.0 && seen(at(p))).map(|p| f64::from(p.power)).sum()
        };
        shade.add([power(&physical, &|p| holding(&balls, p) > 0)], power(&again, &|_| true));
        let found = [
            s.sources[0].regions as f64,
            s.sources[0].candidates as f64,
            s.sources[0].synthesised / s.sources[0].mass,
            s.sticking_out,
            empty,
            share(&|k| k == 0),
            share(&|k| k > 1),
            physical.sunlight_through(&s.regions, seed).1.value,
        ];
        figures.iter_mut().zip(found).for_each(|(all, x)| all.push(x));
    }
    let figure = |i: usize, name: &str, figure: f64, digit: f64| printed(name, mean(figures[i].iter().copied()), figure, digit);
    figure(0, "balls", 16.4, 0.1);
    figure(1, "candidates", 4359.0, 1.0);
    figure(2, "volume made", 0.998, 1e-3);
    figure(3, "sticking out", 0.23, 0.01);
    figure(4, "empty", 0.46, 0.01);
    figure(5, "photons in no region", 0.43, 0.01);
    figure(6, "photons in several regions", 0.20, 0.01);
    figure(7, "sunlight through", 0.18, 0.01);
    printed("light in the shade", shade.ratio(0), 0.35, 0.01);
    printed("sunlight through the old sphere", exact(clear(12.0)), 0.0139, 1e-4);
}
