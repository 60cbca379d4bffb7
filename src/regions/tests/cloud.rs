//! The duality of voxel grids against counting points, closed forms, and the same source as a sphere.

use super::super::cloud::Cloud;
use super::super::search::Ball;
use super::statistics::assert_chi2;
use super::*;
use crate::scene::density::BRICK_VOXELS;
use crate::scene::{BrickGrid, VoxelGrid};
use glam::IVec3;

fn voxels(world_from_index: DAffine3, min: [i32; 3], max: [i32; 3], periodic: bool, value: impl Fn(DVec3) -> f64) -> Arc<VoxelGrid> {
    let mut bricks = BrickGrid { world_from_index, origins: Vec::new(), values: Vec::new() };
    let (low, high) = (IVec3::from_array(min), IVec3::from_array(max));
    for x in low.x >> 3..=high.x >> 3 {
        for y in low.y >> 3..=high.y >> 3 {
            for z in low.z >> 3..=high.z >> 3 {
                let origin = IVec3::new(x, y, z) * 8;
                let at = |v: i32| origin + IVec3::new(v >> 6, v >> 3 & 7, v & 7);
                let inside = |at: IVec3| at.cmpge(low).all() && at.cmple(high).all();
                let sample = |at: IVec3| if inside(at) { value(world_from_index.transform_point3(at.as_dvec3())) as f32 } else { 0.0 };
                bricks.origins.push(origin.to_array());
                bricks.values.extend((0..BRICK_VOXELS as i32).map(|v| sample(at(v))));
            }
        }
    }
    Arc::new(VoxelGrid::new(bricks, min, max, periodic))
}

/// Cubic voxels of `size` metres around a point.
fn cubic(size: f64) -> DAffine3 {
    DAffine3::from_scale(DVec3::splat(size))
}

/// Voxels that are not cubes, turned, far from the origin.
fn skewed() -> DAffine3 {
    let turn = DMat3::from_quat(DQuat::from_rotation_y(0.7) * DQuat::from_rotation_x(2.1));
    DAffine3 { matrix3: turn * DMat3::from_diagonal(DVec3::new(-0.06, 0.11, 0.05)), translation: DVec3::new(30.0, -20.0, 9.0) }
}

/// A hundred times as dense at one end as at the other.
fn graded(p: DVec3) -> f64 {
    10f64.powf(1.0 - 2.0 * (0.5 * (p.x + 1.0)).clamp(0.0, 1.0))
}

/// A round cloud: dense within, thin outside, nothing beyond 1 m.
fn cloud(p: DVec3) -> f64 {
    (2.0 * (1.0 - p.length())).clamp(0.0, 1.0).powi(2) * (1.0 + 0.6 * (9.0 * p.x).sin() * (7.0 * p.y).cos())
}

/// Grids of every kind, with an optical depth of 20 across.
fn grids() -> Vec<Scene> {
    let far = skewed().translation;
    let thick = |name: &str, grid: Arc<VoxelGrid>| {
        let sigma = 20.0 / grid.thickest();
        region(name, Shape::Grid(grid), sigma)
    };
    let box20 = |world, periodic, value: fn(DVec3) -> f64| voxels(world, [-10, -10, -10], [9, 9, 9], periodic, value);
    let constant = thick("constant", box20(cubic(0.1), false, |_| 2.0));
    let graded = thick("graded", box20(cubic(0.1), false, graded));
    let round = thick("cloud", voxels(cubic(0.05), [-21; 3], [21; 3], false, cloud));
    let skew = thick("skewed", voxels(skewed(), [-10, -9, -11], [10, 12, 9], false, move |p| cloud(p - far)));
    let tile = thick("tile", voxels(cubic(0.1), [-3, 2, -5], [9, 10, 6], true, |p| 1.0 + 0.5 * (3.0 * p.x).sin()));
    let speck = thick("one voxel", voxels(cubic(1.0), [5; 3], [5; 3], false, |_| 1.0));
    let sphere = region("sphere", Shape::sphere(DVec3::new(1.5, 0.0, 0.0), 1.0), 10.0);
    let alone = [&constant, &graded, &round, &skew, &tile, &speck].map(|r| scene(vec![r.clone()]));
    alone.into_iter().chain([scene(vec![constant, sphere, round, graded])]).collect()
}

fn grid(region: &Region) -> &VoxelGrid {
    let Shape::Grid(grid) = &region.shape else { panic!("{} is no grid", region.name) };
    grid
}

/// The regions made of each source, by name: a grid's is one.
fn of<'a>(s: &'a Synthesis, source: &Source) -> Vec<&'a Region> {
    s.regions.iter().filter(|r| r.name == source.name || r.name.starts_with(&format!("{}.", source.name))).collect()
}

#[test]
fn optical_mass_is_kept_in_every_grid() {
    for scene in grids() {
        let map = uniform_map(&scene, 20_000, 1);
        for placement in [Placement::Uniform, Placement::Importance] {
            let s = run(&scene, &map, Duality { placement, ..with(4) });
            for (source, layout) in s.sources.iter().zip(&scene.regions) {
                let made = of(&s, source);
                let ratio = made.iter().map(|r| r.optical_mass()).sum::<f64>() / layout.optical_mass();
                assert!((ratio - 1.0).abs() < 1e-6, "{} {placement:?}: {ratio}", source.name);
                assert_eq!(source.synthesised, source.mass, "{}", source.name);
                assert!(source.regions > 1 && source.candidates >= source.regions, "{source:?}");
                let Shape::Grid(before) = &layout.shape else { continue };
                let after = grid(made[0]);
                assert_eq!((made.len(), &made[0].name, made[0].medium), (1, &layout.name, layout.medium));
                assert_eq!((after.min, after.max, after.periodic), (before.min, before.max, before.periodic));
                assert_eq!(after.bricks.world_from_index, before.bricks.world_from_index);
                assert!(made[0].photons >= Some(4 * (source.regions - 1)));
                for (brick, &origin) in after.bricks.origins.iter().enumerate() {
                    for (voxel, &value) in after.bricks.brick(brick).iter().enumerate() {
                        let index = IVec3::from_array(origin) + IVec3::new(voxel as i32 >> 6, voxel as i32 >> 3 & 7, voxel as i32 & 7);
                        let was = before.bricks.at(index.to_array());
                        assert!(value >= 0.0 && f64::from(value) <= f64::from(was) * 4.0 * source.regions as f64, "{value} {was}");
                    }
                }
            }
            let grids = scene.regions.iter().all(|r| matches!(r.shape, Shape::Grid(_)));
            assert_eq!(s.sticking_out == 0.0, grids);
        }
    }
}

#[test]
fn to_the_letter_a_grid_never_holds_more_than_its_source() {
    for scene in grids() {
        let map = uniform_map(&scene, 20_000, 2);
        let s = run(&scene, &map, Duality { model: Model::Hura2006, ..with(4) });
        for (source, layout) in s.sources.iter().zip(&scene.regions) {
            let mass: f64 = of(&s, source).iter().map(|r| r.optical_mass()).sum();
            assert!((mass - source.synthesised).abs() <= 1e-6 * source.mass, "{}: {mass} {}", source.name, source.synthesised);
            assert!(mass <= layout.optical_mass() * (1.0 + 1e-6) && mass > 0.8 * layout.optical_mass(), "{}: {mass}", source.name);
        }
    }
}

#[test]
fn coverage_equals_counting_points() {
    // The slow twin: 10^3 points a voxel, inside or not.
    for (world, periodic) in [(cubic(0.1), false), (skewed(), false), (cubic(0.1), true)] {
        let grid = voxels(world, [-9, -5, -6], [7, 6, 8], periodic, |_| 1.0);
        let cloud = Cloud::new(&grid);
        let n = 10;
        for (offset, radius) in [(0.0, 0.3), (0.31, 0.12), (-0.52, 0.42), (0.2, 0.05), (0.7, 0.013), (0.3, 1.1)] {
            let centre = world.translation + DVec3::new(offset, -0.4 * offset, 0.03);
            let ball = Ball { centre, radius, photons: 0 };
            let made = cloud.within(&[ball]);
            assert!((made.integral() / cloud.volume(centre, radius, f64::INFINITY) - 1.0).abs() < 1e-6);
            let period = (grid.bounds().size() * DVec3::new(1.0, 1.0, 0.0)).max(DVec3::splat(1e-9));
            let (mut sum, mut worst) = (0.0, 0.0f64);
            let whole = grid.bricks.voxel_volume();
            for (brick, &origin) in grid.bricks.origins.iter().enumerate() {
                for voxel in (0..BRICK_VOXELS).filter(|&v| grid.bricks.brick(brick)[v] > 0.0) {
                    let index = IVec3::from_array(origin) + IVec3::new(voxel as i32 >> 6, voxel as i32 >> 3 & 7, voxel as i32 & 7);
                    let mut inside = 0;
                    for i in 0..n * n * n {
                        let part = (IVec3::new(i % n, i / n % n, i / n / n).as_dvec3() + 0.5) / f64::from(n) - 0.5;
                        let p = world.transform_point3(index.as_dvec3() + part) - centre;
                        // Every image of the ball counts.
                        let near = |a: usize| if periodic { -1..=1 } else { 0..=0 }.map(move |k| p[a] + f64::from(k) * period[a]);
                        let mut hits = 0;
                        for x in near(0) {
                            hits += near(1).filter(|y| x * x + y * y + p.z * p.z <= radius * radius).count();
                        }
                        inside += hits;
                    }
                    let share = inside as f64 / f64::from(n * n * n);
                    sum += share;
                    let ours = f64::from(made.bricks.at(index.to_array()));
                    worst = worst.max((share - ours).abs() / share.max(1.0));
                }
            }
            let volume = sum * whole;
            // A small ball is met by few points.
            let rough = (0.004 / radius).max(0.02);
            assert!(worst < 0.1, "{periodic} {radius}: {worst}");
            assert!((made.integral() - volume).abs() <= rough * volume, "{radius}: {} {volume}", made.integral());
        }
        // Within the grid, a ball holds its own volume; so does one across a tile's seam.
        let centre = grid.bounds().centre() + if periodic { DVec3::X * 0.8 } else { DVec3::ZERO };
        for radius in [1e-6, 0.004, 0.016, 0.02, 0.05, 0.1, 0.2] {
            let ratio = cloud.volume(centre, radius, f64::INFINITY) / (4.0 / 3.0 * PI * f64::powi(radius, 3));
            assert!((ratio - 1.0).abs() < 2e-3, "{radius}: {ratio}");
        }
    }
}

#[test]
fn a_ball_is_shrunk_to_hold_what_is_left() {
    let grid = voxels(skewed(), [-10, -9, -11], [10, 12, 9], false, |p| cloud(p - skewed().translation));
    let cloud = Cloud::new(&grid);
    for share in [1e-7, 1e-3, 0.1, 0.5, 0.99] {
        let wanted = share * cloud.volume(skewed().translation, 0.6, f64::INFINITY);
        let (radius, held) = cloud.shrunk(skewed().translation, 0.6, wanted);
        assert!(radius < 0.6 && held <= wanted && held > wanted * 0.999, "{share}: {held} {wanted}");
        assert_eq!(held, cloud.volume(skewed().translation, radius, f64::INFINITY));
    }
}

#[test]
fn photons_are_counted_across_a_seam() {
    let tile = region("tile", Shape::Grid(voxels(cubic(0.1), [0; 3], [9, 7, 9], true, |_| 1.0)), 15.0);
    let map = uniform_map(&scene(vec![tile.clone()]), 3000, 8);
    let balls = balls(&tile, &map, 3);
    let size = tile.shape.bounds().size();
    let mut across = 0;
    for ball in &balls {
        let count = |reach: i32| {
            let near = |p: &&Photon| {
                let p = Vec3::from_array(p.position).as_dvec3() + map.origin - ball.centre;
                let images = (-reach..=reach).flat_map(|x| (-reach..=reach).map(move |y| (f64::from(x), f64::from(y))));
                images.filter(|&(x, y)| (p + DVec3::new(x * size.x, y * size.y, 0.0)).length() <= ball.radius).count()
            };
            map.photons().iter().map(|p| near(&p) as u64).sum::<u64>()
        };
        assert!(ball.photons.abs_diff(count(2)) <= 1, "{ball:?} {}", count(2));
        across += u64::from(ball.photons > count(0));
    }
    assert!(across > 5, "{across}");
}

#[test]
fn grids_come_out_the_same_on_any_number_of_threads() {
    for scene in grids().into_iter().skip(3) {
        let map = uniform_map(&scene, 2000, 11);
        // To the letter the last of a search takes longest: once is enough.
        let models = [Model::Physical, Model::Hura2006];
        for &model in models.iter().take(if scene.regions[0].name == "tile" { 2 } else { 1 }) {
            let text = |threads| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                format!("{:?}", pool.install(|| run(&scene, &map, Duality { model, ..with(10) })))
            };
            assert!(text(1) == text(3), "{model:?}");
        }
    }
}

#[test]
fn a_search_in_a_grid_ends() {
    let mut constant = grids().remove(0);
    constant.regions[0].medium = Medium::with_albedo(20.0, 0.99, 0.8);
    let mut rng = Rng::new(5, Stage::Photons, 2);
    let cornered = map_of(DVec3::ZERO, (0..5000).map(|_| (0, DVec3::splat(0.8) + 0.02 * rng.uniform())));
    for model in [Model::Physical, Model::Hura2006] {
        // Photons in one corner: few candidates are near enough, and what is missing is said.
        let s = run(&constant, &cornered, Duality { model, ..with(5000) });
        let source = &s.sources[0];
        assert!(source.synthesised < 0.9 * source.mass && source.candidates >= source.regions + REFUSALS, "{source:?}");
        assert!((s.regions.iter().map(Region::optical_mass).sum::<f64>() - source.synthesised).abs() <= 1e-6 * source.mass);
        // Where density is above zero and no voxel is: balls that hold nothing, and the run ends.
        let one = voxels(cubic(1.0), [0; 3], [0; 3], false, |_| 1.0);
        let fringe = scene(vec![region("fringe", Shape::Grid(one), 1e5)]);
        let beside = map_of(DVec3::ZERO, (0..100).map(|_| (0, DVec3::X * 0.75)));
        for place in [Placement::Uniform, Placement::Importance] {
            let s = run(&fringe, &beside, Duality { model, placement: place, ..with(2) });
            assert_eq!((s.regions.len(), s.sources[0].candidates), (0, REFUSALS));
        }
        // Nothing at all.
        let empty = scene(vec![region("empty", Shape::Grid(voxels(cubic(1.0), [0; 3], [3; 3], false, |_| 0.0)), 1.0)]);
        let s = run(&empty, &map_of(DVec3::ZERO, [(0, DVec3::ONE)]), Duality { model, ..with(1) });
        assert_eq!((s.regions.len(), s.sources[0].candidates), (0, 0));
    }
}

#[test]
fn breadth_is_how_thick_the_dense_part_is() {
    let of = |grid: Arc<VoxelGrid>| grid.breadth();
    let flat = |periodic| of(voxels(cubic(0.1), [0; 3], [30, 9, 19], periodic, |_| 3.0));
    assert!((flat(false) - 1.0).abs() < 1e-9 && (flat(true) - 2.0).abs() < 1e-9);
    let ball = |p: DVec3| f64::from(p.length() < 1.0);
    let round = of(voxels(cubic(0.05), [-21; 3], [21; 3], false, ball));
    assert!((round - 2.0).abs() < 0.11, "{round}");
    // A thin fringe around it.
    let fringed = of(voxels(cubic(0.05), [-80; 3], [80; 3], false, |p| ball(p).max(0.01)));
    assert!((fringed / round - 1.0).abs() < 0.1, "{fringed} {round}");
}

/// The balls of a region, by the search itself.
fn balls(region: &Region, map: &PhotonMap, seed: u64) -> Vec<Ball> {
    let tree = PhotonTree::new(map.of_region(0)).unwrap();
    let search = Search {
        points: Points::new(region, map.of_region(0), map.origin, Placement::Uniform),
        tree: &tree,
        origin: map.origin,
        model: Model::Physical,
        estimate: 3,
        sigma_t: region.medium.sigma_t(),
        volume: region.shape.volume(),
        seed,
        stream: 0,
    };
    let mut found = match &region.shape {
        Shape::Grid(grid) => search.run(&Cloud::new(grid), &|_| Ok(())),
        shape => search.run(&Even::new(shape), &|_| Ok(())),
    }
    .unwrap();
    assert_eq!(found.left, 0.0);
    // The last one is shrunk.
    found.balls.pop();
    found.balls
}

#[test]
fn balls_of_an_even_grid_are_those_of_the_sphere() {
    // The same photons in a sphere and in the grid of its voxels. Away from the surface, where density is even, radii follow eq. 17
    // conditioned on three photons within, and photons in a ball are as many.
    let (big, sigma, near, n) = (1.2, 40.0, 0.95, 60_000);
    let sphere = region("sphere", Shape::sphere(DVec3::ZERO, big), sigma);
    let even = region("grid", Shape::Grid(voxels(cubic(0.06), [-21; 3], [21; 3], false, |p| f64::from(p.length() < big))), sigma);
    let map = uniform_map(&scene(vec![sphere.clone()]), n, 6);
    let inside =
        |region: &Region| -> Vec<Ball> { (0..4).flat_map(|seed| balls(region, &map, seed)).filter(|b| b.centre.length() < near).collect() };
    let accepted = |d: f64| {
        let steps = 100;
        let one = |i: i32| {
            let r = near * ((f64::from(i) + 0.5) / f64::from(steps)).cbrt();
            let p = shared(d / big, r / big) * 0.75 / PI;
            // Fewer than three of n: Poisson to within p.
            let mean = -(-p).ln_1p() * f64::from(n as u32);
            1.0 - (-mean).exp() * (1.0 + mean + 0.5 * mean * mean)
        };
        (0..steps).map(one).sum::<f64>() / f64::from(steps)
    };
    let (bins, most) = (25, 0.5 * grid(&even).breadth().min(2.0 * big));
    let edge = |b: usize| if b == bins { most } else { -(-(b as f64) / bins as f64).ln_1p() / sigma };
    let weights: Vec<f64> = (0..bins)
        .map(|b| {
            let (from, steps) = (edge(b), 100);
            let width = (edge(b + 1) - from) / f64::from(steps);
            let at = |i: i32| from + (f64::from(i) + 0.5) * width;
            (0..steps).map(|i| sigma * (-sigma * at(i)).exp() * accepted(at(i)) * width).sum()
        })
        .collect();
    let whole: f64 = weights.iter().sum();
    let both = [&sphere, &even].map(inside);
    for (name, balls) in ["sphere", "grid"].iter().zip(&both) {
        let mut counts = vec![0.0; bins];
        balls.iter().for_each(|b| counts[(((1.0 - (-sigma * b.radius).exp()) * bins as f64) as usize).min(bins - 1)] += 1.0);
        assert!(balls.len() > 6_000, "{}", balls.len());
        let expected: Vec<f64> = weights.iter().map(|w| w / whole * balls.len() as f64).collect();
        assert_chi2(name, &counts, &expected);
    }
    type Figure = fn(&Ball) -> f64;
    let figures: [(&str, Figure); 3] =
        [("radius", |b| b.radius), ("photons", |b| b.photons as f64), ("photons per volume", |b| b.photons as f64 / b.radius.powi(3))];
    for (name, figure) in figures {
        let [a, b] = both.each_ref().map(|balls| {
            let (n, mean) = (balls.len() as f64, balls.iter().map(figure).sum::<f64>() / balls.len() as f64);
            (mean, balls.iter().map(|b| (figure(b) - mean).powi(2)).sum::<f64>() / (n - 1.0) / n)
        });
        let z = (a.0 - b.0) / (a.1 + b.1).sqrt();
        assert!(z.abs() < 4.5, "{name}: {a:?} {b:?}, z {z}");
    }
}
