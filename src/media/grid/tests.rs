//! The grid against slow, obvious twins: depths by quadrature between all planes of samples, flights by their distribution.

use super::*;
use crate::geom::Ray;
use crate::media::{Flight, Media, Scratch};
use crate::rng::{Rng, Stage};
use crate::sampling::unit_ball;
use crate::scene::{BrickGrid, Medium, Region, Shape};
use glam::{DMat3, DQuat};
use std::ops::ControlFlow;

/// A reproducible number in [0, 1) for each index.
fn noise(at: IVec3) -> f32 {
    Rng::new(77, Stage::Regions, at.x as u64 ^ (at.y as u64) << 20 ^ (at.z as u64) << 40).uniform_f32()
}

/// A third of the samples are zero, the others vary widely.
fn rough(at: IVec3) -> f32 {
    (1.5 * noise(at) - 0.5).max(0.0).powi(2)
}

fn voxels(world_from_index: DAffine3, min: IVec3, size: IVec3, periodic: bool, value: impl Fn(IVec3) -> f32) -> Arc<VoxelGrid> {
    let (max, side) = (min + size - 1, IVec3::splat(8));
    let (first, last) = (min.div_euclid(side), max.div_euclid(side));
    let (mut origins, mut values) = (Vec::new(), Vec::new());
    for x in first.x..=last.x {
        for y in first.y..=last.y {
            for z in first.z..=last.z {
                let origin = IVec3::new(x, y, z) * 8;
                let brick: Vec<f32> = (0..512)
                    .map(|v| origin + IVec3::new(v >> 6, v >> 3 & 7, v & 7))
                    .map(|at| if at.cmpge(min).all() && at.cmple(max).all() { value(at) } else { 0.0 })
                    .collect();
                if brick.iter().any(|&v| v > 0.0) {
                    origins.push(origin.to_array());
                    values.extend(brick);
                }
            }
        }
    }
    Arc::new(VoxelGrid::new(BrickGrid { world_from_index, origins, values }, min.to_array(), max.to_array(), periodic))
}

/// Transforms of every kind: voxels of about half a metre.
fn worlds() -> [DAffine3; 4] {
    let turn = DMat3::from_quat(DQuat::from_rotation_y(0.7) * DQuat::from_rotation_x(2.1));
    let of = |matrix3: DMat3, translation: DVec3| DAffine3 { matrix3, translation };
    [
        of(DMat3::from_diagonal(DVec3::splat(0.5)), DVec3::ZERO),
        of(turn * 0.5, DVec3::new(3.0, -2.0, 1.0)),
        of(turn * DMat3::from_diagonal(DVec3::new(0.2, 0.9, 0.5)), DVec3::new(-7.0, 0.5, 2.0)),
        of(turn * DMat3::from_diagonal(DVec3::new(-0.4, 0.6, 0.5)), DVec3::new(1.0, 1.0, 1.0)),
    ]
}

/// Grids of every kind, an origin to see it from, and how far single precision moves a ray there, in voxels.
fn grids() -> Vec<(String, Arc<VoxelGrid>, DVec3, f64)> {
    let v = IVec3::new;
    let sizes = [
        ("one voxel", v(0, 0, 0), v(1, 1, 1), false),
        ("one brick", v(-8, 0, 8), v(8, 8, 8), false),
        ("odd sizes", v(-5, 3, -1), v(13, 7, 21), false),
        ("several nodes", v(-70, -3, 60), v(140, 6, 10), false),
        ("far indices", v(100_000, -100_003, 99_999), v(9, 10, 11), false),
        ("tile", v(-3, 2, 0), v(11, 5, 9), true),
        ("tile of one in y", v(0, 4, 0), v(70, 1, 6), true),
        ("tile of a brick", v(0, 0, 0), v(8, 16, 8), true),
    ];
    let mut all = Vec::new();
    for (name, min, size, periodic) in sizes {
        for (i, mut world) in worlds().into_iter().enumerate() {
            // Repeated tiles are level: their layers are those of z.
            if periodic {
                world.matrix3 =
                    DMat3::from_diagonal([DVec3::splat(0.5), DVec3::new(0.3, 0.5, 0.7), DVec3::ONE, DVec3::new(-0.5, 0.5, 0.5)][i]);
            }
            let grid = voxels(world, min, size, periodic, |at| if size == IVec3::ONE { 1.0 } else { rough(at) });
            let origin = grid.bounds().centre();
            all.push((format!("{name}, world {i}"), Arc::clone(&grid), origin, 1e-5));
            if name == "odd sizes" {
                // Seen from an origin 1e5 voxels away: a step of single precision is a hundredth of a voxel there.
                all.push((format!("{name}, world {i}, far off"), grid, origin + DVec3::new(5e4, -4e4, 3e4), 0.05));
            }
        }
    }
    all
}

/// A ray that passes a grid, of one of the kinds that are hard.
fn ray(kind: u32, grid: &VoxelGrid, origin: DVec3, rng: &mut Rng) -> Ray {
    let (min, max) = (IVec3::from_array(grid.min).as_dvec3() - 1.0, IVec3::from_array(grid.max).as_dvec3() + 1.0);
    let u = DVec3::new(rng.uniform(), rng.uniform(), rng.uniform());
    let mut at = min + (max - min) * u;
    let free = unit_ball([rng.uniform(), rng.uniform(), 1.0]);
    let axis = (rng.uniform() * 3.0) as usize;
    let sign = if rng.uniform() < 0.5 { 1.0 } else { -1.0 };
    let mut along = DVec3::splat(-0.0);
    along[axis] = sign;
    let world = grid.bricks.world_from_index;
    let direction = match kind % 8 {
        0 => free,
        1 => along,
        // Along a line of samples, and along the diagonals between them.
        2 => {
            at = at.round();
            along
        }
        3 => {
            at = at.round();
            let d = DVec3::new(sign, (axis as f64) - 1.0, if rng.uniform() < 0.5 { 1.0 } else { -1.0 });
            if axis == 2 { DVec3::new(d.x, d.y, 0.0) } else { d }
        }
        // Grazing: in the outermost plane of samples, or of the support.
        4 => {
            let other = (axis + 1) % 3;
            at[other] = [min[other], min[other] + 1.0, max[other] - 1.0, max[other]][(rng.uniform() * 4.0) as usize];
            along
        }
        5 => along + free * 1e-6,
        6 => along + free * [1e-12, 1e-25, 1e-37, 1e-42][(rng.uniform() * 4.0) as usize],
        _ => free * DVec3::new(1.0, 1.0, 1e-3),
    };
    let direction = world.transform_vector3(direction).normalize();
    let back = if rng.uniform() < 0.5 { 0.0 } else { world.transform_vector3(max - min).length() };
    Ray { origin: (world.transform_point3(at) - direction * back - origin).as_vec3(), direction: direction.as_vec3() }
}

/// The integral of density along a ray: between each two planes of samples by Gauss's rule, which has no error for cubics.
fn slow_depth(grid: &VoxelGrid, origin: DVec3, ray: &Ray, t_max: f64) -> f64 {
    let index = grid.bricks.world_from_index.inverse();
    let (o, d) = (origin + ray.origin.as_dvec3(), ray.direction.as_dvec3());
    let (io, id) = (index.transform_point3(o), index.transform_vector3(d));
    let (mut from, mut to) = (0.0f64, t_max);
    for a in (if grid.periodic { 2 } else { 0 })..3 {
        let (low, high) = (f64::from(grid.min[a]) - 1.0, f64::from(grid.max[a]) + 1.0);
        if id[a].abs() < 1e-20 {
            if io[a] <= low || io[a] >= high {
                return 0.0;
            }
        } else {
            let (s, e) = ((low - io[a]) / id[a], (high - io[a]) / id[a]);
            (from, to) = (from.max(s.min(e)), to.min(s.max(e)));
        }
    }
    if from >= to {
        return 0.0;
    }
    let mut ts = vec![from, to];
    for a in 0..3 {
        let (s, e) = (io[a] + id[a] * from, io[a] + id[a] * to);
        ts.extend((s.min(e).ceil() as i64..=s.max(e).floor() as i64).map(|p| (p as f64 - io[a]) / id[a]).filter(|t| *t > from && *t < to));
    }
    ts.sort_unstable_by(f64::total_cmp);
    let node = 0.5 / 3f64.sqrt();
    ts.windows(2)
        .map(|w| {
            let (mid, length) = (0.5 * (w[0] + w[1]), w[1] - w[0]);
            0.5 * length * (grid.density(o + d * (mid - node * length)) + grid.density(o + d * (mid + node * length)))
        })
        .sum()
}

fn random_reach(periodic: bool, rng: &mut Rng) -> f32 {
    if periodic || rng.uniform() < 0.3 {
        (0.1 + 40.0 * rng.uniform()) as f32
    } else {
        [f32::INFINITY, 1e30, 1e7][(rng.uniform() * 3.0) as usize]
    }
}

#[test]
fn depths_equal_a_quadrature_between_the_planes_of_samples() {
    let mut rng = Rng::new(1, Stage::Render, 0);
    let mut met = 0;
    for (name, source, origin, slack) in grids() {
        let grid = Grid::new(0, &source, 3.0, origin);
        for i in 0..160 {
            let ray = ray(i, &source, origin, &mut rng);
            let t_max = random_reach(source.periodic, &mut rng);
            let truth = 3.0 * slow_depth(&source, origin, &ray, t_max.into());
            let found = grid.optical_depth(&ray, t_max);
            met += u32::from(truth > 0.1);
            // Single precision moves a far ray aside by so many voxels: what that can change at most.
            let aside = |axis: usize, by: f64| {
                let shift = source.bricks.world_from_index.transform_vector3(DVec3::AXES[axis] * by);
                (3.0 * slow_depth(&source, origin + shift, &ray, t_max.into()) - truth).abs()
            };
            let moved = (0..6).map(|s| aside(s / 2, if s % 2 == 0 { slack } else { -slack })).fold(0.0, f64::max);
            let most = 2.0 * moved + 1e-4 * (1.0 + truth);
            assert!((found - truth).abs() < most, "{name}, ray {i}, {ray:?} to {t_max}: {found}, not {truth}");
            if truth + most < 1.9 {
                let exact = grid.transmittance(&ray, t_max, &mut rng);
                assert!((exact - (-truth).exp()).abs() < most, "{name}, ray {i}: no roulette above e^-2");
            }
        }
    }
    assert!(met > 1500, "{met} rays met something");
}

#[test]
fn flights_are_distributed_as_the_depths_say() {
    let mut rng = Rng::new(2, Stage::Render, 0);
    let (n, mut scratch, mut worst, mut tests) = (4000usize, Scratch::default(), 0.0f64, 0);
    for (name, source, origin, _) in grids() {
        let grid = Grid::new(0, &source, 2.0, origin);
        for i in 0..6 {
            let ray = ray(i, &source, origin, &mut rng);
            let t_max = random_reach(source.periodic, &mut rng);
            let all = 1.0 - (-grid.optical_depth(&ray, t_max)).exp();
            let mut shares: Vec<f64> = (0..n)
                .filter_map(|_| grid.fly(&ray, t_max, &mut rng, &mut scratch))
                .map(|t| {
                    assert!(t >= 0.0 && t <= t_max, "{name}: {t}");
                    1.0 - (-grid.optical_depth(&ray, t)).exp()
                })
                .collect();
            shares.sort_unstable_by(f64::total_cmp);
            // Kolmogorov's statistic; those that pass are an atom at the end.
            let d = shares.iter().enumerate().map(|(i, &s)| (s - i as f64 / n as f64).abs().max((s - (i + 1) as f64 / n as f64).abs()));
            let d = d.fold((shares.len() as f64 / n as f64 - all).abs(), f64::max);
            worst = worst.max(d * (n as f64).sqrt());
            tests += 1;
            // Beyond 2.6 by chance once in 400,000.
            assert!(d * (n as f64).sqrt() < 2.6, "{name}, ray {i}: {d}");
        }
    }
    println!("{tests} rays, Kolmogorov's statistic at most {worst:.2}");
    assert_eq!(scratch.violations, 0);
}

/// Mean and standard error.
fn mean(n: u32, mut draw: impl FnMut() -> f64) -> (f64, f64) {
    let (sum, squares) = (0..n).map(|_| draw()).fold((0.0, 0.0), |(s, q), x| (s + x, q + x * x));
    let m = sum / f64::from(n);
    (m, ((squares / f64::from(n) - m * m).max(0.0) / f64::from(n - 1)).sqrt())
}

#[test]
fn transmittances_are_right_in_the_mean_however_thick() {
    let mut rng = Rng::new(3, Stage::Render, 0);
    let source = voxels(worlds()[2], IVec3::new(-5, 3, -1), IVec3::new(13, 9, 21), false, |at| rough(at) + 0.1);
    let origin = source.bounds().centre();
    for i in 0..40 {
        let ray = ray(i, &source, origin, &mut rng);
        let per = Grid::new(0, &source, 1.0, origin).optical_depth(&ray, f32::INFINITY);
        for depth in [0.5, 3.0, 6.0, 9.0] {
            if per > 1e-3 {
                let grid = Grid::new(0, &source, depth / per, origin);
                let (found, error) = mean(40_000, || grid.transmittance(&ray, f32::INFINITY, &mut rng));
                let z = (found - (-depth).exp()) / error.max(1e-4 * found);
                assert!(z.abs() < 4.5, "ray {i}, depth {depth}: {found} +- {error}, z {z}");
            }
        }
        let opaque = Grid::new(0, &source, 1e7, origin);
        let (found, _) = mean(100, || opaque.transmittance(&ray, f32::INFINITY, &mut rng));
        assert!(found < 1e-9 || per < 1e-4, "{found} through a depth of {}", per * 1e7);
    }
}

fn region(shape: Shape, sigma_t: f64) -> Region {
    Region { name: String::new(), shape, medium: Medium::with_albedo(sigma_t, 1.0, 0.0), photons: None }
}

#[test]
fn sunlight_is_right_in_the_mean_for_every_weight() {
    let mut rng = Rng::new(4, Stage::Render, 0);
    let mut scratch = Scratch::default();
    let (mut squares, mut tests) = (0.0, 0.0);
    for (k, periodic) in [(0, false), (2, false), (3, false), (0, true)] {
        for sigma in [0.3, 3.0, 30.0] {
            let source = voxels(worlds()[k], IVec3::new(-5, 3, -1), IVec3::new(13, 9, 21), periodic, rough);
            let bounds = source.support();
            let ball = region(Shape::sphere(bounds.centre(), 2.0), 0.2);
            let mut media = Media::new(&[region(Shape::Grid(Arc::clone(&source)), sigma), ball], bounds.centre());
            let toward = Vec3::new(0.3, -0.5, 0.8).normalize();
            media.learn_shade(toward);
            for _ in 0..12 {
                let p = (bounds.size() * (DVec3::new(rng.uniform(), rng.uniform(), rng.uniform()) - 0.5) * 1.1).as_vec3();
                let toward = (toward + unit_ball([rng.uniform(), rng.uniform(), 1.0]).as_vec3() * 0.02).normalize();
                let truth = (-media.optical_depth(&Ray { origin: p, direction: toward }, f32::INFINITY, &mut scratch)).exp();
                for weight in [0.0, 0.1, 1.0, 1e6] {
                    let (found, error) = mean(6000, || media.sunlight(p, toward, weight, &mut rng, &mut scratch));
                    let z = (found - truth) / error.max(1e-4 * truth + 1e-6);
                    assert!(truth < 1e-3 || z.abs() < 4.7, "world {k}, sigma {sigma}, weight {weight}: {found} +- {error}, not {truth}");
                    if truth > 0.02 && error > 1e-4 * truth {
                        (squares, tests) = (squares + z * z, tests + 1.0);
                    }
                }
            }
        }
    }
    println!("{tests} means, squared z {:.3}", squares / tests);
    assert!((squares / tests - 1.0).abs() < 4.5 * (2.0f64 / tests).sqrt(), "errors are as large as they say: {squares} of {tests}");
}

#[test]
fn every_walk_ends_within_as_many_cells_as_a_line_can_cross() {
    let mut rng = Rng::new(5, Stage::Render, 0);
    for (name, source, origin, _) in grids() {
        let grid = Grid::new(0, &source, 1.0, origin);
        let (mut most, tile) = (0, grid.high - grid.low);
        for i in 0..40_000 {
            let ray = ray(i, &source, origin, &mut rng);
            let t_max = random_reach(source.periodic, &mut rng);
            let (mut cells, mut last) = (0, 0.0f32);
            grid.walk::<true>(&ray, t_max, |s| {
                cells += 1;
                assert!(s.from < s.to && s.before + s.from >= last * 0.9999 && s.low.cmplt(s.high).all(), "{name}: {ray:?}");
                last = s.before + s.from;
                ControlFlow::Continue(())
            });
            most = most.max(cells);
            let crossed = (grid.index_from_local * ray.direction).abs().element_sum() * t_max.min(1e4);
            let room = if source.periodic { crossed as i32 + 8 } else { tile.element_sum() + 3 };
            assert!(cells <= room, "{name}: {cells} cells of {room}, {ray:?}");
        }
        assert!(most > 0);
    }
}

#[test]
fn majorants_are_the_largest_samples_that_cells_of_a_block_see() {
    let mut rng = Rng::new(7, Stage::Render, 0);
    for (name, source, origin, _) in grids() {
        let grid = Grid::new(0, &source, 1.0, origin);
        let repeated = IVec3::new(source.periodic.into(), source.periodic.into(), 0);
        let base = IVec3::from_array(source.min) - (IVec3::ONE - repeated) - grid.low;
        for i in 0..200 {
            let ray = ray(i, &source, origin, &mut rng);
            grid.walk::<false>(&ray, random_reach(source.periodic, &mut rng), |s| {
                let size = s.high - s.low + 1;
                let samples = (0..size.element_product()).map(|i| s.low + IVec3::new(i / size.z / size.y, i / size.z % size.y, i % size.z));
                let most = samples.map(|at| source.sample((at + base).to_array())).fold(0.0, f32::max);
                let whole = size == IVec3::splat(5);
                assert!(s.majorant == most || (!whole && s.majorant >= most), "{name}: {} for {most}, from {}", s.majorant, s.low);
                ControlFlow::Continue(())
            });
        }
    }
}

#[test]
fn what_is_no_ray_meets_nothing_and_level_rays_in_a_gap_are_let_go() {
    let mut rng = Rng::new(6, Stage::Render, 0);
    let mut scratch = Scratch::default();
    let odd = [f32::NAN, 0.0, -0.0, f32::INFINITY, f32::NEG_INFINITY];
    for periodic in [false, true] {
        let source = voxels(worlds()[0], IVec3::ZERO, IVec3::new(8, 1, 24), periodic, |at| if (4..20).contains(&at.z) { 0.0 } else { 1.0 });
        let grid = Grid::new(0, &source, 1.0, DVec3::ZERO);
        for case in 0..125 {
            let v = Vec3::new(odd[case % 5], odd[case / 5 % 5], odd[case / 25]);
            let at = Vec3::new(1.0, 0.1, 11.6);
            for ray in [Ray { origin: at, direction: v }, Ray { origin: v, direction: Vec3::X }] {
                if ray.direction.is_finite() && ray.origin.is_finite() && ray.direction != Vec3::ZERO {
                    continue;
                }
                assert_eq!(grid.fly(&ray, f32::INFINITY, &mut rng, &mut scratch), None, "{ray:?}");
                assert_eq!(grid.optical_depth(&ray, f32::INFINITY), 0.0, "{ray:?}");
            }
        }
        for direction in [Vec3::X, Vec3::NEG_Y, Vec3::new(0.6, -0.8, -0.0)] {
            let level = Ray { origin: Vec3::new(1.0, 0.1, 6.0), direction };
            assert_eq!(grid.fly(&level, f32::INFINITY, &mut rng, &mut scratch), None);
            assert_eq!(grid.transmittance(&level, f32::INFINITY, &mut rng), 1.0);
        }
    }
    assert_eq!(scratch.violations, 0);
}

#[test]
fn collisions_fall_to_grid_and_ball_as_their_extinctions_do() {
    let mut rng = Rng::new(7, Stage::Render, 0);
    let mut scratch = Scratch::default();
    let source = voxels(worlds()[1], IVec3::ZERO, IVec3::new(12, 12, 12), false, rough);
    let (origin, n) = (source.bounds().centre(), 40_000);
    let media = Media::new(&[region(Shape::sphere(origin, 2.0), 0.4), region(Shape::Grid(Arc::clone(&source)), 1.5)], origin);
    for i in 0..10 {
        let direction = unit_ball([rng.uniform(), rng.uniform(), 1.0]).as_vec3().normalize();
        let ray = Ray { origin: direction * -5.0 + unit_ball([rng.uniform(), rng.uniform(), 1.0]).as_vec3(), direction };
        // What of the light each region takes: the integral of its extinction times the transmittance up to there.
        let (steps, length) = (20_000, 12.0);
        let (mut depth, mut taken) = (0.0f64, [0.0f64; 2]);
        for s in 0..steps {
            let p = ray.origin.as_dvec3() + ray.direction.as_dvec3() * (length * (f64::from(s) + 0.5) / f64::from(steps));
            let sigma = [if p.length() < 2.0 { 0.4 } else { 0.0 }, 1.5 * source.density(origin + p)];
            let step = (sigma[0] + sigma[1]) * length / f64::from(steps);
            let lost = (-depth).exp() * -(-step).exp_m1();
            (0..2).for_each(|r| taken[r] += if step > 0.0 { lost * sigma[r] / (sigma[0] + sigma[1]) } else { 0.0 });
            depth += step;
        }
        let mut counts = [0.0; 2];
        for _ in 0..n {
            let tau = rng.optical_depth();
            if let Flight::Collision { region, .. } = media.fly(&ray, f32::INFINITY, tau, 0.0, &mut rng, &mut scratch) {
                counts[region as usize] += 1.0;
            }
        }
        for r in 0..2 {
            let z = (counts[r] - taken[r] * f64::from(n)) / (taken[r] * (1.0 - taken[r]) * f64::from(n)).sqrt().max(1.0);
            assert!(z.abs() < 4.5, "ray {i}, region {r}: {} of {n}, not {}", counts[r], taken[r]);
        }
    }
    assert_eq!(scratch.violations, 0);
}

#[test]
fn within_a_cell_depths_go_by_what_is_there() {
    // Density that rises along x, from nothing; and a ball across the middle.
    let rising = voxels(DAffine3::IDENTITY, IVec3::ZERO, IVec3::new(5, 4, 4), false, |at| 0.25 * at.x as f32);
    let ball = region(Shape::sphere(DVec3::new(2.3, 1.5, 1.5), 0.8), 0.7);
    for regions in [vec![region(Shape::Grid(rising.clone()), 3.0)], vec![region(Shape::Grid(rising), 3.0), ball]] {
        let media = Media::new(&regions, DVec3::ZERO);
        let (mut profile, mut scratch) = (crate::media::Profile::default(), Scratch::default());
        for direction in [Vec3::X, Vec3::NEG_X] {
            let ray = Ray { origin: Vec3::new(2.0, 1.5, 1.5) - 5.0 * direction, direction };
            media.profile(&ray, f32::INFINITY, (f64::INFINITY, f64::INFINITY), &mut scratch, &mut profile);
            let mut step = 0;
            for i in 0..200 {
                let distance = 3.01 + 0.0199 * i as f32;
                let depth = media.optical_depth(&ray, distance, &mut scratch);
                assert!((profile.until(distance) - depth).abs() < 1e-4, "{distance}: {} for {depth}", profile.until(distance));
                let found = profile.distance(depth, &mut step);
                // Where there is next to nothing, no depth tells where.
                let here = media.extinction(ray.at(distance));
                assert!(f64::from((found - distance).abs()) * here < 1e-3, "{distance}: {found}");
            }
        }
    }
}
