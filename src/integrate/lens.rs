//! From pixels to rays: a pinhole camera in the local space of the hot loops.

use crate::geom::Ray;
use crate::scene::Camera;
use glam::{DVec3, Mat3, Vec3};

/// A camera, compiled for a picture of a given size.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lens {
    position: Vec3,
    axes: Mat3,
    /// Half the picture's extent at distance 1, over half its pixels.
    per_pixel: f32,
    half: (f32, f32),
    near: f32,
    far: f32,
}

/// A camera ray.
#[derive(Debug, Clone, Copy)]
pub(super) struct View {
    /// It starts at the near clipping plane.
    pub ray: Ray,
    /// Its length to the far clipping plane, m.
    pub reach: f32,
    /// Depth along the camera's axis per metre of the ray.
    pub cos: f32,
    /// Depth where it starts, m.
    pub near: f32,
}

impl Lens {
    pub(super) fn new(camera: &Camera, width: u32, height: u32, origin: DVec3) -> Self {
        let half = (width as f32 * 0.5, height as f32 * 0.5);
        Lens {
            position: (camera.world_from_camera.translation - origin).as_vec3(),
            axes: camera.world_from_camera.matrix3.as_mat3(),
            per_pixel: ((camera.yfov * 0.5).tan() / (f64::from(height) * 0.5)) as f32,
            half,
            near: camera.znear as f32,
            far: camera.zfar.map_or(f32::INFINITY, |z| z as f32),
        }
    }

    /// Where the camera is, in the local space.
    pub(super) fn position(&self) -> Vec3 {
        self.position
    }

    /// Whether a ball may be in the picture.
    pub(super) fn frames(&self, centre: Vec3, radius: f32) -> bool {
        let p = self.axes.transpose() * (centre - self.position);
        let (depth, (right, top)) = (-p.z, (self.half.0 * self.per_pixel, self.half.1 * self.per_pixel));
        let within = |x: f32, tan: f32| x.abs() - depth * tan <= radius * (1.0 + tan * tan).sqrt();
        depth >= -radius && within(p.x, right) && within(p.y, top)
    }

    /// Where a direction meets the picture, in pixels from its upper left corner.
    pub(super) fn pixel(&self, direction: Vec3) -> [f32; 2] {
        let p = self.axes.transpose() * direction;
        [self.half.0 - p.x / (p.z * self.per_pixel), self.half.1 + p.y / (p.z * self.per_pixel)]
    }

    /// The ray through a point of the picture, in pixels from its upper left corner.
    pub(super) fn view(&self, x: f32, y: f32) -> View {
        let local = Vec3::new((x - self.half.0) * self.per_pixel, (self.half.1 - y) * self.per_pixel, -1.0);
        let stretch = local.length();
        let direction = (self.axes * (local / stretch)).normalize();
        let ray = Ray { origin: self.position + direction * (self.near * stretch), direction };
        View { ray, reach: (self.far - self.near) * stretch, cos: 1.0 / stretch, near: self.near }
    }
}
