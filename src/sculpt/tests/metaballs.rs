//! Metaballs: the density of a lone ball in closed form, families and their sizes.

use super::*;

fn ball(at: DVec3, radius: f64, stiffness: f64) -> Element {
    Element::new(ElementKind::Ball, DAffine3::from_translation(at), radius, stiffness, DVec3::ONE)
}

fn family(elements: Vec<Element>) -> Solid {
    Solid::Metaballs(Arc::new(Metaballs { threshold: 0.6, elements }))
}

/// 4 pi times the integral of r^2 (s (1 - r^2/R^2)^3 - T) / (s - T) up to the visible radius.
fn lone(radius: f64, stiffness: f64, threshold: f64) -> f64 {
    let u = visible_radius(radius, threshold, stiffness).unwrap() / radius;
    let field = u.powi(3) / 3.0 - 3.0 * u.powi(5) / 5.0 + 3.0 * u.powi(7) / 7.0 - u.powi(9) / 9.0;
    4.0 * std::f64::consts::PI * radius.powi(3) * (stiffness * field - threshold * u.powi(3) / 3.0) / (stiffness - threshold)
}

#[test]
fn a_lone_balls_integral_is_the_closed_form_at_every_voxel_size() {
    for size in [0.1, 0.05, 0.02] {
        let grid = voxels(&of(vec![Part::new(family(vec![ball(DVec3::new(0.2, 0.1, -0.3), 1.5, 2.0)]))], None), size);
        let expected = lone(1.5, 2.0, 0.6);
        assert!((grid.integral() / expected - 1.0).abs() < 2e-3, "{size}: {} {expected}", grid.integral());
        assert!((grid.bricks.values.iter().copied().fold(0.0, f32::max) - 1.0).abs() < 0.02);
    }
}

/// The evaluation by bricks, against the sum over all elements at each voxel.
#[test]
fn bricks_hold_what_the_field_says_at_their_voxels() {
    let skewed = DAffine3::from_rotation_x(0.8) * DAffine3::from_scale(DVec3::new(1.5, 0.6, 1.1)) * DAffine3::from_rotation_y(0.5);
    let elements = vec![
        ball(DVec3::ZERO, 1.0, 2.0),
        ball(DVec3::new(0.7, 0.2, 0.1), 0.8, 3.0),
        ball(DVec3::new(0.3, -0.5, 0.2), 0.6, -1.5),
        Element::new(ElementKind::Capsule, DAffine3::from_rotation_z(0.4), 0.5, 2.0, DVec3::new(1.2, 0.0, 0.0)),
        Element::new(ElementKind::Cube, DAffine3::from_translation(DVec3::splat(0.8)), 0.4, 2.0, DVec3::splat(0.3)),
        Element::new(ElementKind::Plane, skewed, 0.3, -0.8, DVec3::new(0.5, 0.2, 0.0)),
        Element::new(ElementKind::Ellipsoid, skewed, 0.5, 2.5, DVec3::new(1.4, 0.6, 0.9)),
    ];
    let solid = family(elements);
    let Solid::Metaballs(balls) = solid.clone() else { unreachable!() };
    let grid = voxels(&of(vec![Part::new(solid)], None), 0.04).bricks;
    let mut filled = 0;
    for brick in 0..grid.origins.len() {
        for (voxel, &value) in grid.brick(brick).iter().enumerate() {
            let expected = ((balls.field(grid.position(brick, voxel)) - 0.6) / (3.0 - 0.6)).clamp(0.0, 1.0);
            assert!((f64::from(value) - expected).abs() < 1e-6);
            filled += u32::from(value > 0.0);
        }
    }
    assert!(filled > 10_000);
    // And nothing is outside the bricks.
    let mut rng = Rng::new(1, Stage::Photons, 0);
    for _ in 0..20_000 {
        let p = DVec3::new(rng.uniform(), rng.uniform(), rng.uniform()) * 6.0 - 3.0;
        let index = grid.world_from_index.inverse().transform_point3(p).round().as_ivec3();
        let centre = grid.world_from_index.transform_point3(index.as_dvec3());
        assert!(grid.at(index.to_array()) > 0.0 || balls.field(centre) <= 0.6);
    }
}

#[test]
fn thickness_and_size_are_those_of_what_shows() {
    let solid = family(vec![ball(DVec3::ZERO, 2.0, 2.0)]);
    let visible = visible_radius(2.0, 0.6, 2.0).unwrap();
    assert!((solid.radius() - visible).abs() < 1e-12);
    // Twice the integral of the density along a radius.
    let n = 10_000;
    let along: f64 =
        (0..n).map(|i| ((2.0 * (1.0 - ((f64::from(i) + 0.5) / f64::from(n) * visible / 2.0).powi(2)).powi(3) - 0.6) / 1.4).max(0.0)).sum();
    let expected = 2.0 * visible * along / f64::from(n);
    let thickness = solid.thickness(&Silent).unwrap();
    assert!((thickness / expected - 1.0).abs() < 0.06, "{thickness} {expected}");
    assert_eq!(family(vec![ball(DVec3::ZERO, 1.0, 0.5)]).thickness(&Silent).unwrap(), 0.0);
}
