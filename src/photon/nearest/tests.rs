//! The nearest photons against a list that is sorted whole.

use super::*;
use crate::rng::{Rng, Stage};
use crate::sampling::unit_ball;

fn photon(p: Vec3) -> Photon {
    Photon::new(p, Vec3::Z, 1.0, 0, 0)
}

fn ball(rng: &mut Rng) -> Vec3 {
    unit_ball([rng.uniform(), rng.uniform(), rng.uniform()]).as_vec3()
}

/// Squared distances of the nearest of `photons` and all their images, the nearest first.
fn sorted(photons: &[Photon], p: Vec3, n: usize, shifts: &[Vec3]) -> Vec<f32> {
    let one = |shift: &Vec3| photons.iter().map(|q| (Vec3::from_array(q.position) + *shift).distance_squared(p)).collect::<Vec<_>>();
    let mut all: Vec<f32> = shifts.iter().flat_map(one).collect();
    all.sort_unstable_by(f32::total_cmp);
    all.truncate(n);
    all
}

/// Found one after the other with one neighbourhood, and each by sorting.
fn check(name: &str, photons: Vec<Photon>, n: u64, tile: Option<Tile>, points: &[Vec3]) {
    let nearest = Nearest::new(photons.clone(), n, tile);
    let size = tile.map_or(Vec3::ZERO, |tile| tile.size());
    let shifts: Vec<Vec3> = if tile.is_some() {
        (-2..=2).flat_map(|x| (-2..=2).map(move |y| Vec3::new(x as f32 * size.x, y as f32 * size.y, 0.0))).collect()
    } else {
        vec![Vec3::ZERO]
    };
    let mut hood = Neighbourhood::default();
    for (i, &p) in points.iter().enumerate() {
        let farthest = nearest.find(p, &mut hood).unwrap();
        let p = nearest.wrapped(p);
        let expected = sorted(&photons, p, nearest.count(), &shifts);
        assert_eq!((nearest.found(&hood).len(), expected.len()), (nearest.count(), nearest.count()), "{name}, point {i}");
        let last = expected.last().unwrap().sqrt().max(nearest.floor());
        assert!((farthest - last).abs() <= 4.0 * f32::EPSILON * (last + p.length()), "{name}, point {i}: {farthest}, {last}");
        // The same photons, or others at the same distance.
        let near = |q: &Photon| shifts.iter().map(|s| (Vec3::from_array(q.position) + *s).distance(p)).fold(f32::INFINITY, f32::min);
        assert!(nearest.found(&hood).all(|q| near(q) <= farthest * 1.00001 + nearest.floor()), "{name}, point {i}");
        let mut numbers: Vec<u64> = hood.order.clone();
        numbers.sort_unstable();
        numbers.dedup();
        assert!(numbers.len() == nearest.count() || tile.is_some(), "{name}, point {i}: a photon came twice");
    }
}

#[test]
fn the_nearest_are_the_nearest_however_points_follow_one_another() {
    let mut rng = Rng::new(3, Stage::Gather, 0);
    let photons: Vec<Photon> = (0..3000).map(|_| photon(ball(&mut rng))).collect();
    let scattered: Vec<Vec3> = (0..100).map(|_| ball(&mut rng) * 1.5).collect();
    // Steps of every size: some find all in the neighbourhood, some almost all, some nothing.
    let mut at = Vec3::ZERO;
    let walk: Vec<Vec3> = (0..300)
        .map(|i| {
            at = (at + ball(&mut rng) * 0.3f32.powi(i % 5)).clamp_length_max(1.2);
            at
        })
        .collect();
    for n in [1, 2, 50, 700, 2999, 3000, 5000] {
        check("scattered", photons.clone(), n, None, &scattered);
        check("a walk", photons.clone(), n, None, &walk);
    }
}

#[test]
fn across_a_tiles_seam_photons_are_found_on_both_sides() {
    let mut rng = Rng::new(4, Stage::Gather, 0);
    let (min, max) = (Vec3::new(-1.0, -2.0, -0.5), Vec3::new(1.0, 1.0, 0.5));
    let photons: Vec<Photon> = (0..800).map(|_| photon(min + (max - min) * rng.uniform_vec3())).collect();
    let points: Vec<Vec3> = (0..80).map(|_| (min + (max - min) * rng.uniform_vec3()) * Vec3::new(3.0, 3.0, 1.0)).collect();
    for n in [1, 40, 400] {
        check("tile", photons.clone(), n, Some(Tile { min, max }), &points);
    }
}

#[test]
fn photons_in_one_point_in_a_line_and_in_a_plane_are_found() {
    let mut rng = Rng::new(5, Stage::Gather, 0);
    let points: Vec<Vec3> = (0..20).map(|_| ball(&mut rng) * 3.0).chain([Vec3::ZERO, Vec3::ONE]).collect();
    for n in [1, 7, 500] {
        check("point", vec![photon(Vec3::ONE); 500], n, None, &points);
        check("line", (0..500).map(|i| photon(Vec3::X * (i / 2) as f32)).collect(), n, None, &points);
        check("plane", (0..500).map(|_| photon(ball(&mut rng) * Vec3::new(1.0, 1.0, 0.0))).collect(), n, None, &points);
        check("far", (0..500).map(|_| photon(ball(&mut rng) + 1e5)).collect(), n, None, &points);
    }
    assert!(Nearest::new(Vec::new(), 5, None).find(Vec3::ZERO, &mut Neighbourhood::default()).is_none());
}

#[test]
fn of_a_million_photons_in_one_point_or_plane_the_nearest_are_found() {
    let mut rng = Rng::new(6, Stage::Gather, 0);
    let points: Vec<Vec3> = (0..3).map(|_| ball(&mut rng) * 2.0).chain([Vec3::ONE, Vec3::ONE]).collect();
    check("point", vec![photon(Vec3::ONE); 1_000_000], 1000, None, &points);
    check("plane", (0..1_000_000).map(|_| photon(ball(&mut rng) * Vec3::new(1.0, 1.0, 0.0))).collect(), 1000, None, &points);
}
