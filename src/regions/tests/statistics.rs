//! Where regions come to lie and how large they are, by chi-squared.

use super::*;

/// Chi-squared over bins against expected counts, thin bins pooled; fails beyond 4.5 sigma of its distribution (Wilson-Hilferty).
pub(super) fn assert_chi2(name: &str, counts: &[f64], expected: &[f64]) {
    let z = chi2(counts, expected);
    assert!(z < 4.5, "{name}: z {z}\n{counts:?}\n{expected:?}");
}

fn chi2(counts: &[f64], expected: &[f64]) -> f64 {
    let (mut sum, mut bins, mut pool) = (0.0, 0.0, (0.0, 0.0));
    for (c, e) in counts.iter().zip(expected) {
        pool = (pool.0 + c, pool.1 + e);
        if pool.1 > 20.0 {
            sum += (pool.0 - pool.1).powi(2) / pool.1;
            bins += 1.0;
            pool = (0.0, 0.0);
        }
    }
    let (degrees, spread): (f64, f64) = (bins - 1.0, 2.0 / (9.0 * (bins - 1.0)));
    assert!(degrees > 5.0 && pool.1 < 20.0);
    ((sum / degrees).cbrt() - (1.0 - spread)) / spread.sqrt()
}

#[test]
fn accepted_radii_follow_equation_17_conditioned_on_the_rule() {
    // The density of accepted radii is sigma e^(-sigma d) P(accepted | d), up to the radius of the region. Uniformly placed, a ball
    // is empty of N uniform photons with probability (1 - shared volume)^N; placed at photons it never is.
    let (sigma, n) = (30.0, 100_000);
    let scene = ball(sigma);
    let map = uniform_map(&scene, n, 6);
    let accepted = |d: f64, placement| match placement {
        Placement::Importance => 1.0,
        Placement::Uniform => {
            let steps = 200;
            let one = |i: i32| {
                let r = (f64::from(i) + 0.5) / f64::from(steps);
                3.0 * r * r * (1.0 - (1.0 - shared(d, r) * 0.75 / PI).powi(n as i32))
            };
            (0..steps).map(one).sum::<f64>() / f64::from(steps)
        }
    };
    for placement in [Placement::Uniform, Placement::Importance] {
        let mut radii: Vec<f64> = Vec::new();
        for seed in 0..6 {
            let s = run(&scene, &map, Duality { placement, seed, ..with(1) });
            assert_eq!(s.sources[0].synthesised, s.sources[0].mass);
            // The last one is shrunk.
            radii.extend(s.regions[..s.regions.len() - 1].iter().map(radius));
        }
        assert!(radii.len() > 15_000);
        // Bins equal in e^(-sigma d).
        let bins = 25;
        let edge = |b: usize| if b == bins { 1.0 } else { -(-(b as f64) / bins as f64).ln_1p() / sigma };
        let weights: Vec<f64> = (0..bins)
            .map(|b| {
                let (from, to, steps) = (edge(b), edge(b + 1), 100);
                let width = (to - from) / f64::from(steps);
                let at = |i: i32| from + (f64::from(i) + 0.5) * width;
                (0..steps).map(|i| sigma * (-sigma * at(i)).exp() * accepted(at(i), placement) * width).sum()
            })
            .collect();
        let total: f64 = weights.iter().sum();
        let expected: Vec<f64> = weights.iter().map(|w| w / total * radii.len() as f64).collect();
        let mut counts = vec![0.0; bins];
        for d in radii {
            counts[(((1.0 - (-sigma * d).exp()) * bins as f64) as usize).min(bins - 1)] += 1.0;
        }
        assert_chi2(&format!("{placement:?}"), &counts, &expected);
    }
}

/// Ten shells of equal volume by eight octants, in the unit ball.
fn cell(p: DVec3) -> usize {
    let octant = usize::from(p.x > 0.0) | usize::from(p.y > 0.0) << 1 | usize::from(p.z > 0.0) << 2;
    (p.length().powi(3) * 10.0).min(9.0) as usize * 8 + octant
}

#[test]
fn candidates_are_uniform_in_every_shape() {
    let mut rng = Rng::new(8, Stage::Regions, 3);
    for shape in [Shape::sphere(DVec3::new(5.0, -2.0, 1.0), 3.0), ellipsoid()] {
        let region = region("r", shape, 1.0);
        let Shape::Ellipsoid { world_from_unit } = region.shape else { panic!() };
        let (points, n) = (Points::new(&region, &[], DVec3::ZERO, Placement::Uniform), 80_000);
        let mut counts = vec![0.0; 80];
        for _ in 0..n {
            counts[cell(world_from_unit.inverse().transform_point3(points.draw(&mut rng)))] += 1.0;
        }
        assert_chi2("ellipsoid", &counts, &[f64::from(n) / 80.0; 80]);
    }
    // In a tetrahedron, the smallest barycentric coordinate times four is uniform in its cube's complement: P(min > t) = (1 - 4t)^3.
    let mesh = region("mesh", Shape::Mesh(Arc::new(tetrahedron())), 1.0);
    let (points, n) = (Points::new(&mesh, &[], DVec3::ZERO, Placement::Uniform), 40_000);
    let v = tetrahedron().vertices;
    let to_barycentric = DMat3::from_cols(v[1] - v[0], v[2] - v[0], v[3] - v[0]).inverse();
    let mut counts = vec![0.0; 80];
    for _ in 0..n {
        let b = to_barycentric * (points.draw(&mut rng) - v[0]);
        let all = [b.x, b.y, b.z, 1.0 - b.element_sum()];
        let (least, &min) = all.iter().enumerate().min_by(|a, b| a.1.total_cmp(b.1)).unwrap();
        assert!(min > -1e-6, "{all:?}");
        counts[least * 20 + ((1.0 - (1.0 - 4.0 * min).max(0.0).powi(3)) * 20.0).clamp(0.0, 19.0) as usize] += 1.0;
    }
    assert_chi2("mesh", &counts, &[f64::from(n) / 80.0; 80]);
}

#[test]
fn centres_are_uniform_or_follow_the_photons() {
    // So dense that no candidate is refused: centres are candidates.
    let scene = ball(30.0);
    let dense = uniform_map(&scene, 400_000, 9);
    let mut counts = vec![0.0; 80];
    // Below this, a ball may be empty, the sooner the nearer it lies to the rim.
    let sure = 0.045;
    for seed in 0..20 {
        let s = run(&scene, &dense, Duality { seed, ..with(1) });
        s.regions.iter().filter(|r| radius(r) > sure).for_each(|r| counts[cell(r.shape.centre())] += 1.0);
    }
    let total: f64 = counts.iter().sum();
    assert_chi2("uniform", &counts, &[total / 80.0; 80]);
    // Photons that gather toward one side and the rim.
    let mut rng = Rng::new(10, Stage::Photons, 4);
    let gathered = (0..400_000).filter_map(|_| {
        let p = unit_ball([rng.uniform(), rng.uniform(), rng.uniform()]);
        (rng.uniform() < (0.3 + 0.2 * p.x + 0.5 * p.length().powi(4)).min(1.0)).then_some((0, p))
    });
    let map = map_of(DVec3::ZERO, gathered);
    let mut expected = vec![0.0; 80];
    map.photons().iter().for_each(|p| expected[cell(Vec3::from_array(p.position).as_dvec3())] += 1.0);
    let mut counts = vec![0.0; 80];
    for seed in 0..6 {
        let s = run(&scene, &map, Duality { seed, placement: Placement::Importance, ..with(1) });
        s.regions.iter().for_each(|r| counts[cell(r.shape.centre())] += 1.0);
    }
    let scale = counts.iter().sum::<f64>() / map.len() as f64;
    expected.iter_mut().for_each(|e| *e *= scale);
    assert_chi2("importance", &counts, &expected);
    // And differ from uniform ones, or the test above could not fail.
    let total: f64 = counts.iter().sum();
    assert!(chi2(&counts, &[total / 80.0; 80]) > 20.0);
}
