//! Cameras that look toward the sun: the more nearly, the more often light scatters in the scene's own media.

use super::*;

/// A cloud whose light turns by so many degrees on its way to the camera of [`picture`].
fn turning(degrees: f64, g: f64) -> Scene {
    let eye = DVec3::new(3.0, -5.0, 2.5).normalize();
    let aside = eye.cross(DVec3::Z).normalize();
    let mut scene = lit(vec![ball(DVec3::ZERO, 1.0, Medium::with_albedo(5.0, 0.999, g))]);
    let (sin, cos) = degrees.to_radians().sin_cos();
    scene.sun.direction = eye * cos + aside * sin;
    scene
}

#[test]
fn light_keeps_to_its_media_where_its_peak_is_seen() {
    let eye = Vec3::new(3.0, -5.0, 2.5);
    let own = |scene: &Scene| Aspect::of(scene, eye).own;
    // The ball is seen within 16 degrees of its middle, as its box has corners.
    assert_eq!([10.0, 35.0, 60.0, 120.0].map(|degrees| own(&turning(degrees, 0.85))), [6, 6, 4, 2]);
    // Where peaks are seen, they are not smoothed over: the less, the nearer they are. From within light comes from everywhere; from a dark sun
    // nowhere.
    let sharp = |scene: &Scene, eye: Vec3| Aspect::of(scene, eye).sharp;
    assert!(sharp(&turning(10.0, 0.95), eye) < 0.34 * sharp(&turning(10.0, 0.85), eye) && sharp(&turning(120.0, 0.85), eye).is_infinite());
    assert!(sharp(&turning(10.0, 0.85), 2.0 * eye) > 2.0 * sharp(&turning(10.0, 0.85), eye));
    assert_eq!(Aspect::of(&turning(120.0, 0.85), Vec3::ZERO).own, 6);
    let mut dark = turning(10.0, 0.85);
    dark.sun.irradiance = [0.0; 3];
    assert_eq!(own(&dark), 2);
}

#[test]
fn the_grid_integrator_sees_what_the_path_tracer_sees() {
    for (degrees, g) in [(5.0, 0.85), (50.0, 0.85), (50.0, 0.95)] {
        agrees(&format!("g {g}, {degrees} degrees from the sun"), &turning(degrees, g), 2500, 8);
    }
}
