//! What is plain stays what it was; soft edges and tiles have closed forms.

use super::*;

fn ball() -> Shape {
    Shape::sphere(DVec3::new(0.3, -0.2, 4.1), 1.0)
}

#[test]
fn plain_parts_are_voxelised_as_regions_are() {
    let shapes = [ball(), Shape::sphere(DVec3::new(0.9, 0.1, 4.0), 0.7)];
    let region =
        |shape: &Shape| Region { name: String::new(), shape: shape.clone(), medium: Medium::with_albedo(1.0, 1.0, 0.0), photons: None };
    let whole = voxelise(&shapes.iter().map(region).collect::<Vec<_>>(), 0.11, 1.0, Up::Z, &Silent).unwrap();
    let grid = voxels(&of(shapes.into_iter().map(even).collect(), None), 0.11);
    assert_eq!(grid.bricks, whole);
}

/// Density rises over a depth f: a ball's integral is that of clamp((R - r) / f).
#[test]
fn a_falloff_thins_a_ball_as_the_integral_says() {
    for f in [0.3, 0.8] {
        let part = Part { falloff: f, ..even(ball()) };
        let grid = voxels(&of(vec![part], None), 0.02);
        // 4 pi times the integral of r^2 min(1, (1 - r) / f) over [0, 1].
        let k: f64 = 1.0 - f;
        let expected = 4.0 * std::f64::consts::PI * (k.powi(3) / 3.0 + ((1.0 - k.powi(3)) / 3.0 - (1.0 - k.powi(4)) / 4.0) / f);
        assert!((grid.integral() / expected - 1.0).abs() < 2e-3, "{f}: {} {expected}", grid.integral());
    }
}

/// An ellipsoid's depth is that to its surface where that is near.
#[test]
fn an_ellipsoid_with_a_thin_rim_keeps_its_volume() {
    let turned = DMat3::from_quat(DQuat::from_rotation_x(0.7)) * DMat3::from_diagonal(DVec3::new(1.0, 0.5, 0.7));
    let shape = Shape::Ellipsoid { world_from_unit: DAffine3 { matrix3: turned, translation: DVec3::splat(2.0) } };
    let (volume, rim) = (shape.volume(), 0.02);
    let grid = voxels(&of(vec![Part { falloff: rim, ..even(shape) }], None), 0.02);
    // The surface of an ellipsoid within 1.1 % (Thomsen).
    let p: f64 = 1.6075;
    let [a, b, c] = [1.0f64, 0.5, 0.7].map(|x| x.powf(p));
    let area = 4.0 * std::f64::consts::PI * ((a * b + a * c + b * c) / 3.0).powf(1.0 / p);
    assert!((grid.integral() / (volume - 0.5 * rim * area) - 1.0).abs() < 3e-3, "{} {volume}", grid.integral());
}

#[test]
fn a_tile_holds_what_sticks_out_of_it_on_the_other_side() {
    // A ball across the tile's corner, and one within.
    let shapes = [Shape::sphere(DVec3::new(-1.9, 1.9, 0.0), 0.8), Shape::sphere(DVec3::new(0.5, 0.0, 0.3), 0.5)];
    let volume: f64 = shapes.iter().map(Shape::volume).sum();
    let tile = Bounds { min: DVec3::new(-2.0, -2.0, 0.0), max: DVec3::new(2.0, 2.0, 0.0) };
    for (size, falloff) in [(0.07, 0.0), (0.05, 0.2)] {
        let parts = shapes.iter().map(|s| Part { falloff, ..even(s.clone()) }).collect::<Vec<_>>();
        let whole = voxels(&of(parts.clone(), None), 0.05).integral();
        let grid = voxels(&Sculpture { parts, detail: None, tile: Some(tile) }, size);
        let expected = if falloff == 0.0 { volume } else { whole };
        assert!(grid.periodic && (grid.integral() / expected - 1.0).abs() < 3e-3, "{} {expected}", grid.integral());
        let at = |p: DVec3| grid.sample(grid.bricks.world_from_index.inverse().transform_point3(p).round().as_ivec3().to_array());
        assert!(at(DVec3::new(-1.9, 1.9, 0.0)) > 0.99 && at(DVec3::new(1.9, -1.9, 0.0)) > 0.99 && at(DVec3::new(-1.9, -1.9, 0.0)) > 0.99);
        let bounds = grid.bounds();
        assert!((bounds.size().truncate() - DVec2::splat(4.0)).length() < 1e-9, "{bounds:?}");
    }
}

#[test]
fn voxel_sizes_follow_the_smallest_thing_and_fit() {
    let sculpture = of(vec![even(ball())], Some(detail(Genus::Congestus, 1.0, 0.4)));
    let (size, coarsened) = sculpture.voxel_size(None, 1 << 24, &no_meshes, &Silent).unwrap();
    assert!(!coarsened && (size - 0.4 / 16.0 / 3.0).abs() < 1e-12, "{size}");
    let (coarse, coarsened) = sculpture.voxel_size(None, 100_000, &no_meshes, &Silent).unwrap();
    let active = voxels(&sculpture, coarse).bricks.active_voxels();
    assert!(coarsened && (50_000..110_000).contains(&active), "{coarse}: {active}");
    assert!(matches!(sculpture.voxel_size(Some(0.001), 100_000, &no_meshes, &Silent), Err(crate::Error::TooManyVoxels { .. })));
    assert_eq!(sculpture.voxel_size(Some(0.1), 100_000, &no_meshes, &Silent).unwrap(), (0.1, false));
}
