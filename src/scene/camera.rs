//! A perspective camera, as glTF describes it, or placed here.

use crate::geom::Bounds;
use glam::{DAffine3, DMat3, DQuat, DVec3};

/// A perspective camera in world space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// The camera looks along its local -Z, with +Y up.
    pub world_from_camera: DAffine3,
    /// The vertical angle of view in radians.
    pub yfov: f64,
    /// Width over height of the picture, where the file fixes it.
    pub aspect: Option<f64>,
    /// The near clipping distance in metres; 0 clips nothing.
    pub znear: f64,
    /// The far clipping distance in metres, where there is one.
    pub zfar: Option<f64>,
}

/// The angle of view along the longer side of a picture when nobody says it, radians: Blender's (50 mm before 36 mm).
pub const FOV: f64 = 0.691_111_2;
/// The share of the picture's half width and half height that a framed scene leaves free.
const MARGIN: f64 = 0.08;
/// How far a framing camera looks down on a scene with an end, radians.
const DOWN: f64 = 0.25;
/// And on one without, radians: so steep that no horizon is seen with usual lenses.
const DOWN_ENDLESS: f64 = std::f64::consts::FRAC_PI_4;
/// From the direction of the sun's light to that of the look, about the vertical, radians: the sun stands behind the camera's
/// left shoulder, so that it lights what is seen and models it.
const BESIDE: f64 = std::f64::consts::FRAC_PI_4;

/// The vertical angle of view that belongs to a horizontal one, radians both, in a picture of this width over height.
pub fn vertical(xfov: f64, aspect: f64) -> f64 {
    2.0 * ((0.5 * xfov).tan() / aspect).atan()
}

impl Camera {
    /// A camera at `position` that looks at `target` (m), Z up in the picture, with a vertical angle of view in radians. Clips
    /// nothing. Straight down, +Y is up in the picture and +X to the right, as in Blender's view from the top; straight up, -Y is up.
    ///
    /// `None` where the two are one point, and give no direction.
    pub fn look_at(position: DVec3, target: DVec3, yfov: f64) -> Option<Camera> {
        let matrix3 = orientation(target - position)?;
        Some(Camera { world_from_camera: DAffine3 { matrix3, translation: position }, yfov, aspect: None, znear: 0.0, zfar: None })
    }

    /// The same camera, turned to `target`. `None` where it stands there.
    pub fn turned_to(self, target: DVec3) -> Option<Camera> {
        let matrix3 = orientation(target - self.world_from_camera.translation)?;
        Some(Camera { world_from_camera: DAffine3 { matrix3, ..self.world_from_camera }, ..self })
    }

    /// A camera that sees all of `bounds` (m) with a margin, in a picture of this width over height and vertical angle of view
    /// (radians). `light` is the direction in which the sun's light travels.
    ///
    /// It looks a little down, and 45 degrees to the left of where the light goes: the sun is behind it and beside it. With the
    /// default sun that is Blender's view from the front, along +Y; so it is with a sun in the zenith. An `endless` scene is seen
    /// from above, 45 degrees down, all of the tile in the picture.
    pub fn framing(bounds: Bounds, aspect: f64, yfov: f64, light: DVec3, endless: bool) -> Camera {
        let flat = DVec3::new(light.x, light.y, 0.0);
        let ahead =
            if flat.length() > 1e-3 * light.length() { DQuat::from_rotation_z(BESIDE) * flat.normalize_or(DVec3::Y) } else { DVec3::Y };
        let (sin, cos) = if endless { DOWN_ENDLESS } else { DOWN }.sin_cos();
        let forward = ahead * cos - DVec3::Z * sin;
        let axes = orientation(forward).unwrap_or(DMat3::IDENTITY);
        let (centre, half) = (bounds.centre(), bounds.size() * 0.5);
        let ty = (0.5 * yfov).tan() * (1.0 - MARGIN);
        let tx = ty * aspect;
        let mut distance = 0.0f64;
        for corner in 0..8usize {
            let sign = |axis: usize| if corner >> axis & 1 == 1 { 1.0 } else { -1.0 };
            let p = axes.transpose() * (half * DVec3::new(sign(0), sign(1), sign(2)));
            distance = distance.max(p.z + (p.x.abs() / tx).max(p.y.abs() / ty));
        }
        if endless {
            // Above the layer, however wide the lens.
            distance = distance.max(1.5 * half.z / sin);
        }
        let distance = if distance > 0.0 { distance } else { 1.0 };
        Camera {
            world_from_camera: DAffine3 { matrix3: axes, translation: centre - forward * distance },
            yfov,
            aspect: None,
            znear: 0.0,
            zfar: None,
        }
    }
}

/// The camera's axes in the world when it looks along `forward`, of any length but 0.
fn orientation(forward: DVec3) -> Option<DMat3> {
    let back = (-forward).try_normalize()?;
    let right = DVec3::Z.cross(back);
    let right = if right.length() > 1e-9 { right.normalize() } else { DVec3::X };
    Some(DMat3::from_cols(right, back.cross(right).normalize(), back))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Where a point is in the picture: right and up, 1 at the edges; and its depth.
    fn seen(camera: &Camera, aspect: f64, p: DVec3) -> (f64, f64, f64) {
        let p = camera.world_from_camera.inverse().transform_point3(p);
        let t = (0.5 * camera.yfov).tan();
        (p.x / (-p.z * t * aspect), p.y / (-p.z * t), -p.z)
    }

    #[test]
    fn a_camera_looks_where_it_is_told_with_z_up() {
        let camera = Camera::look_at(DVec3::new(1.0, -10.0, 2.0), DVec3::new(1.0, 0.0, 2.0), 0.5).unwrap();
        let (x, y, depth) = seen(&camera, 1.0, DVec3::new(1.0, 0.0, 2.0));
        assert!(x.abs() < 1e-12 && y.abs() < 1e-12 && (depth - 10.0).abs() < 1e-12);
        assert!(seen(&camera, 1.0, DVec3::new(2.0, 0.0, 2.0)).0 > 0.0 && seen(&camera, 1.0, DVec3::new(1.0, 0.0, 3.0)).1 > 0.0);
        assert!((camera.world_from_camera.matrix3.determinant() - 1.0).abs() < 1e-12);
        assert_eq!(Camera::look_at(DVec3::ONE, DVec3::ONE, 0.5), None);
    }

    #[test]
    fn straight_up_and_down_are_no_special_places() {
        let down = Camera::look_at(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, 0.5).unwrap();
        assert!(seen(&down, 1.0, DVec3::X).0 > 0.0 && seen(&down, 1.0, DVec3::Y).1 > 0.0);
        let up = Camera::look_at(DVec3::ZERO, DVec3::new(0.0, 0.0, 5.0), 0.5).unwrap();
        for camera in [down, up] {
            let m = camera.world_from_camera.matrix3;
            assert!(m.is_finite() && (m.determinant() - 1.0).abs() < 1e-12 && (m * m.transpose()).abs_diff_eq(DMat3::IDENTITY, 1e-12));
        }
    }

    #[test]
    fn a_framed_scene_is_in_the_picture_and_fills_it() {
        let lights = [DVec3::new(0.5, 0.5, -0.7), DVec3::NEG_Z, DVec3::new(-3.0, 0.1, 0.2)];
        let boxes = [DVec3::ONE, DVec3::new(100.0, 1.0, 1.0), DVec3::new(0.01, 0.02, 5.0), DVec3::new(1e5, 1e5, 10.0)];
        for (light, half) in lights.into_iter().flat_map(|l| boxes.map(|b| (l, b))) {
            let bounds = Bounds { min: DVec3::splat(7.0) - half, max: DVec3::splat(7.0) + half };
            for (aspect, yfov, endless) in [(16.0 / 9.0, 0.4, false), (0.5, 1.2, false), (1.0, 0.7, true), (2.0, 2.9, true)] {
                let camera = Camera::framing(bounds, aspect, yfov, light, endless);
                let mut most = 0.0f64;
                for corner in 0..8 {
                    let sign = |bit: i32| if corner & bit == 0 { -1.0 } else { 1.0 };
                    let (x, y, depth) = seen(&camera, aspect, DVec3::splat(7.0) + half * DVec3::new(sign(1), sign(2), sign(4)));
                    assert!(depth > 0.0, "{half} {aspect} {yfov}");
                    most = most.max(x.abs()).max(y.abs());
                }
                assert!(most <= 1.0 - MARGIN + 1e-9 && (endless || most > 0.9), "{half} {aspect} {yfov}: {most}");
                let at = camera.world_from_camera;
                assert!(!endless || at.translation.z > bounds.max.z);
                // Looking roughly where the light goes: the lit side is seen.
                let flat = DVec3::new(light.x, light.y, 0.0).normalize_or_zero();
                assert!((at.matrix3 * DVec3::NEG_Z).dot(flat) >= 0.0);
            }
        }
        let front = Camera::framing(Bounds { min: DVec3::ZERO, max: DVec3::ONE }, 1.0, 0.5, super::super::Sun::default().direction, false);
        assert!((front.world_from_camera.matrix3.x_axis - DVec3::X).length() < 1e-12);
    }

    #[test]
    fn angles_of_view_belong_together() {
        assert!((vertical(FOV, 1.0) - FOV).abs() < 1e-12);
        assert!((vertical(std::f64::consts::FRAC_PI_2, 2.0) - 2.0 * 0.5f64.atan()).abs() < 1e-12);
        assert!((FOV - 2.0 * (18.0f64 / 50.0).atan()).abs() < 1e-6);
    }
}
