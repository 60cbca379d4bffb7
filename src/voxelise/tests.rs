use super::size::active_voxels;
use super::*;
use crate::error::Error;
use crate::progress::Silent;
use crate::scene::{Medium, Mesh, Shape};
use glam::{DAffine3, DMat3, DQuat, DVec2, DVec3};

fn region(shape: Shape, sigma_t: f64) -> Region {
    Region { name: String::new(), shape, medium: Medium::with_albedo(sigma_t, 1.0, 0.0), photons: None }
}

fn shapes() -> Vec<(&'static str, Region)> {
    let turned =
        DMat3::from_quat(DQuat::from_rotation_x(0.7) * DQuat::from_rotation_z(0.4)) * DMat3::from_diagonal(DVec3::new(1.0, 0.4, 0.7));
    let tetra = Mesh {
        vertices: [[0.0, 0.0, 0.0], [1.1, 0.1, 0.0], [0.2, 1.3, 0.1], [0.1, 0.2, 0.9]].map(DVec3::from_array).to_vec(),
        triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]],
    };
    vec![
        ("sphere", region(Shape::sphere(DVec3::new(0.3, -7.1, 2.2), 1.0), 3.0)),
        ("ellipsoid", region(Shape::Ellipsoid { world_from_unit: DAffine3 { matrix3: turned, translation: DVec3::splat(5.0) } }, 2.0)),
        ("slab", region(Shape::Slab { centre: DVec3::new(0.2, 0.1, 0.4), half_height: 0.33, half_extent: DVec2::new(1.0, 1.7) }, 4.0)),
        ("mesh", region(Shape::Mesh(std::sync::Arc::new(tetra)), 5.0)),
        ("far away", region(Shape::sphere(DVec3::splat(1e7), 1.0), 3.0)),
    ]
}

#[test]
fn the_integral_is_the_optical_mass_at_every_voxel_size() {
    for (name, region) in shapes() {
        for size in [0.5, 0.2, 0.07] {
            for up in [Up::Z, Up::Y] {
                let grid = voxelise(std::slice::from_ref(&region), size, 2.0, up, &Silent).unwrap();
                let ratio = grid.integral() * 2.0 / region.optical_mass();
                assert!((ratio - 1.0).abs() < 2e-3, "{name} at {size}: {ratio}");
                assert!(grid.values.iter().all(|&v| (0.0..=region.medium.sigma_t() as f32 / 2.0 * 1.000_01).contains(&v)));
            }
        }
    }
}

#[test]
fn the_centroid_is_the_shapes_own() {
    for (name, region) in shapes().into_iter().filter(|s| s.0 != "mesh") {
        for (up, centre) in [
            (Up::Z, region.shape.centre()),
            (Up::Y, {
                let c = region.shape.centre();
                DVec3::new(c.x, c.z, -c.y)
            }),
        ] {
            let grid = voxelise(std::slice::from_ref(&region), 0.2, 1.0, up, &Silent).unwrap();
            let mut sum = DVec3::ZERO;
            for (i, &value) in grid.values.iter().enumerate() {
                sum += (grid.position(i / BRICK_VOXELS, i % BRICK_VOXELS) - centre) * f64::from(value);
            }
            let offset = sum * grid.voxel_volume() / region.optical_mass();
            assert!(offset.length() < 0.01, "{name}: {offset}");
        }
    }
}

#[test]
fn coverage_equals_counting_points() {
    // The slow twin: 20^3 points a voxel, inside or not.
    let region = region(Shape::sphere(DVec3::new(0.31, 0.12, 0.53), 0.9), 1.0);
    let grid = voxelise(std::slice::from_ref(&region), 0.3, 1.0, Up::Z, &Silent).unwrap();
    for (i, &value) in grid.values.iter().enumerate() {
        let centre = grid.position(i / BRICK_VOXELS, i % BRICK_VOXELS);
        let n = 20;
        let inside = (0..n * n * n).filter(|j| {
            let at = |k: i32| (f64::from(k) + 0.5) / f64::from(n) - 0.5;
            let p = centre + DVec3::new(at(j % n), at(j / n % n), at(j / n / n)) * 0.3;
            (p - region.shape.centre()).length() < 0.9
        });
        let share = inside.count() as f64 / f64::from(n * n * n);
        assert!((share - f64::from(value)).abs() < 0.02, "{share} {value}");
    }
}

#[test]
fn overlaps_add() {
    let parts: Vec<Region> = shapes().into_iter().take(4).map(|s| s.1).collect();
    let whole: f64 = parts.iter().map(Region::optical_mass).sum();
    let doubled: Vec<Region> = parts.iter().chain(&parts).cloned().collect();
    let grid = voxelise(&doubled, 0.11, 1.0, Up::Z, &Silent).unwrap();
    assert!((grid.integral() / (2.0 * whole) - 1.0).abs() < 2e-3);
    assert!(grid.origins.is_sorted());
}

#[test]
fn the_voxel_size_fits_or_is_refused_with_one_that_does() {
    let regions = vec![region(Shape::sphere(DVec3::ZERO, 1.0), 1.0)];
    assert_eq!(voxel_size(&regions, None, 1 << 24).unwrap(), (2.0 / 128.0, false));
    let (coarse, coarsened) = voxel_size(&regions, None, 40).unwrap();
    assert!(coarsened && active_voxels(&regions, coarse) <= 40.0);
    let Err(Error::TooManyVoxels { fitting, .. }) = voxel_size(&regions, Some(0.001), 100_000) else { panic!() };
    assert_eq!(voxel_size(&regions, Some(fitting), 100_000).unwrap(), (fitting, false));
    let grid = voxelise(&regions, fitting, 1.0, Up::Z, &Silent).unwrap();
    assert!(grid.active_voxels() <= 110_000 && grid.active_voxels() > 60_000, "{}", grid.active_voxels());
}

/// A tile that repeats is written once: what is beyond it belongs to the next.
#[test]
fn a_repeated_grid_is_resampled_to_the_mass_of_its_tile() {
    let world = DAffine3 { matrix3: DMat3::from_diagonal(DVec3::splat(0.1)), translation: DVec3::new(0.3, -0.2, 1.0) };
    let values = (0..512).map(|v| 1.0 + (v % 7) as f32).collect();
    let bricks = BrickGrid { world_from_index: world, origins: vec![[0; 3]], values };
    for periodic in [false, true] {
        let grid = crate::scene::VoxelGrid::new(bricks.clone(), [0; 3], [7; 3], periodic);
        let region = region(Shape::Grid(std::sync::Arc::new(grid)), 3.0);
        for (size, up) in [(0.1, Up::Z), (0.05, Up::Y), (0.013, Up::Z)] {
            let written = voxelise(std::slice::from_ref(&region), size, 1.0, up, &Silent).unwrap();
            let ratio = written.integral() / region.optical_mass();
            assert!((ratio - 1.0).abs() < 0.02, "{periodic} {size}: {ratio}");
        }
    }
}

/// Voxels that no brick reaches are skipped, and only those: the same bits as with bricks of zeros between two that hold something.
#[test]
fn what_is_skipped_of_a_scattered_grid_is_empty() {
    use crate::scene::VoxelGrid;
    let held = |origin: [i32; 3]| origin == [-80, -8, 0] || origin == [40, 0, 16];
    let all: Vec<[i32; 3]> = (-11..7).flat_map(|x| (-2..2).flat_map(move |y| (-1..4).map(move |z| [8 * x, 8 * y, 8 * z]))).collect();
    for turn in [DMat3::IDENTITY, DMat3::from_quat(DQuat::from_rotation_x(0.7) * DQuat::from_rotation_z(0.4))] {
        let of = |origins: Vec<[i32; 3]>| {
            let brick = |&origin: &[i32; 3]| (0..512).map(move |i| if held(origin) { (i % 5) as f32 } else { 0.0 });
            let bricks =
                BrickGrid { world_from_index: DAffine3::from_mat3(turn), values: origins.iter().flat_map(brick).collect(), origins };
            region(Shape::Grid(std::sync::Arc::new(VoxelGrid::new(bricks, [-80, -8, 0], [47, 7, 23], false))), 2.0)
        };
        let (sparse, dense) = (of(vec![[-80, -8, 0], [40, 0, 16]]), of(all.clone()));
        for size in [1.5, 4.0, 16.0, 90.0] {
            let grids = [&sparse, &dense].map(|r| voxelise(std::slice::from_ref(r), size, 1.0, Up::Z, &Silent).unwrap());
            assert_eq!(grids[0], grids[1], "voxels of {size}");
            assert!(grids[0].integral() > 0.5 * sparse.optical_mass());
        }
    }
}
