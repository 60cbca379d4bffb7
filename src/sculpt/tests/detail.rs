//! Detail: none is none, it does not know of voxels, seeds or threads change what they should, tiles have no seam.

use super::*;

fn cloud() -> Vec<Part> {
    [(0.0, 1.0), (1.1, 0.8), (-0.9, 0.7)].map(|(x, r)| even(Shape::sphere(DVec3::new(x, 0.2 * x, 0.1 * x), r))).to_vec()
}

#[test]
fn a_trace_of_detail_is_almost_the_smooth_cloud() {
    let smooth = voxels(&of(cloud(), None), 0.05).integral();
    for (_, genus) in Genus::NAMES {
        let faint = voxels(&of(cloud(), Some(detail(genus, 1e-6, 0.4))), 0.05).integral();
        assert!((faint / smooth - 1.0).abs() < 5e-3, "{genus:?}: {faint} {smooth}");
        let full = voxels(&of(cloud(), Some(detail(genus, 1.0, 0.4))), 0.05);
        assert!((full.integral() / smooth - 1.0).abs() > 1e-3, "{genus:?} changes nothing");
        assert!(full.bricks.values.iter().all(|v| (0.0..=3.0).contains(v)));
    }
}

#[test]
fn the_mass_does_not_depend_on_the_voxels() {
    for (_, genus) in Genus::NAMES {
        let sculpture = of(cloud(), Some(Detail { octaves: 2, ..detail(genus, 1.0, 0.5) }));
        // The voxels that it asks for, and much finer ones.
        let usual = sculpture.voxel_size(None, 1 << 24, &no_meshes, &Silent).unwrap().0;
        let [coarse, fine] = [usual, 0.5 * usual].map(|size| voxels(&sculpture, size).integral());
        assert!((coarse / fine - 1.0).abs() < 0.01, "{genus:?}: {coarse} {fine}");
    }
}

/// All octaves at every point: the slow way to what `moved` stops looking at.
#[test]
fn octaves_that_cannot_matter_are_left_out_without_a_trace() {
    for (_, genus) in Genus::NAMES {
        let noise = Noise::new(&detail(genus, 1.0, 0.4), None);
        let mut rng = Rng::new(5, Stage::Photons, 0);
        for _ in 0..2000 {
            let p = DVec3::new(rng.uniform(), rng.uniform(), rng.uniform()) * 5.0;
            let by = noise.moved(p, &mut Moved::default(), |by| by);
            assert!(by <= noise.reach() + 1e-9 && by >= -noise.bite() - 1e-9, "{genus:?}: {by}");
            let rise = |by: f64| ((rng_depth(p) + by) / 0.02).clamp(0.0, 1.0);
            assert_eq!(noise.moved(p, &mut Moved::default(), rise), rise(by));
        }
    }
}

/// Some depth between -0.5 and 0.5.
fn rng_depth(p: DVec3) -> f64 {
    (p.dot(DVec3::new(12.9, 78.2, 37.7)).sin() * 43758.5).fract() * 0.5
}

/// What displacement is counted from is its mean, or clouds would swell with their detail.
#[test]
fn displacement_has_the_mean_that_it_says() {
    for (_, genus) in Genus::NAMES {
        let noise = Noise::new(&detail(genus, 1.0, 1.0), None);
        let mut rng = Rng::new(6, Stage::Photons, 0);
        let n = 20_000;
        let sum: f64 = (0..n)
            .map(|_| noise.moved(DVec3::new(rng.uniform(), rng.uniform(), rng.uniform()) * 97.0, &mut Moved::default(), |by| by))
            .sum();
        // The base of the mean: what the genus is biased by.
        let bias = noise.bias();
        assert!((sum / f64::from(n) - bias).abs() < 0.02, "{genus:?}: {} {bias}", sum / f64::from(n));
    }
}

#[test]
fn seeds_differ_threads_do_not() {
    let grid = |seed: u32| voxels(&of(cloud(), Some(Detail { seed, ..detail(Genus::Congestus, 1.0, 0.4) })), 0.06);
    let pool = |n: usize| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
    let (one, three) = (pool(1).install(|| grid(1)), pool(3).install(|| grid(1)));
    assert_eq!(one.bricks, three.bricks);
    assert_ne!(one.bricks, grid(2).bricks);
}

#[test]
fn a_deck_has_no_seam() {
    let slab = Shape::Slab { centre: DVec3::ZERO, half_height: 0.4, half_extent: DVec2::new(3.0, 2.0) };
    let tile = slab.bounds();
    for genus in [Genus::Stratocumulus, Genus::Altocumulus, Genus::Cirrus] {
        let sculpture = Sculpture { parts: vec![even(slab.clone())], detail: Some(detail(genus, 1.0, 0.5)), tile: Some(tile) };
        let grid = voxels(&sculpture, 0.05);
        let (min, max) = (grid.min, grid.max);
        assert_eq!((max[0] - min[0] + 1, max[1] - min[1] + 1), (120, 80));
        // Across the seam neighbours differ as much as they do in the middle.
        let differ = |x: i32| -> f64 {
            let rows = (min[1]..=max[1]).flat_map(|y| (min[2]..=max[2]).map(move |z| (y, z)));
            rows.map(|(y, z)| f64::from(grid.sample([x, y, z]) - grid.sample([x + 1, y, z])).powi(2)).sum()
        };
        let middle = (50..70).map(differ).sum::<f64>() / 20.0;
        assert!(differ(max[0]) < 3.0 * middle, "{genus:?}: {} {middle}", differ(max[0]));
        let noise = Noise::new(&sculpture.detail.unwrap(), Some(tile));
        for y in [-1.9, 0.3, 1.7] {
            let at = |x: f64| noise.moved(DVec3::new(x, y, 0.1), &mut Moved::default(), |by| by);
            assert!((at(-3.0 + 1e-7) - at(3.0 - 1e-7)).abs() < 1e-4 && (at(0.4) - at(6.4)).abs() < 1e-9);
        }
    }
}
