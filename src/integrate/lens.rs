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
    /// What part of its pixel's samples it stands for.
    pub stratum: Stratum,
}

/// Samples of a pixel are dealt to 2^`bits` strata in turn. Each is a part of the pixel, and a part of every slice of a ray in which a
/// place is drawn: another part in each slice, by what `turns` says for all samples of the pixel, so that over all strata places are
/// spread evenly along the slice, and every part of the pixel may meet every part of it.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Stratum {
    pub number: u32,
    pub bits: u32,
    pub turns: u64,
}

impl Stratum {
    /// A number in [0, 1) for a slice, uniform over all that `turns` may be, by one that is.
    #[inline]
    pub(super) fn of(&self, slice: u32, xi: f64) -> f64 {
        let turn = self.turns.rotate_right(self.bits * slice) as u32 & ((1 << self.bits) - 1);
        (f64::from(self.number ^ turn) + xi) / f64::from(1 << self.bits)
    }
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
        View { ray, reach: (self.far - self.near) * stretch, cos: 1.0 / stretch, near: self.near, stratum: Stratum::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::{Rng, Stage};

    /// The strata of a pixel share every slice without a gap; and over pixels each has every part of it as often.
    #[test]
    fn strata_fill_every_slice() {
        let mut rng = Rng::new(4, Stage::Render, 0);
        for bits in 0..=4u32 {
            let of = 1u32 << bits;
            let mut met = vec![0; of as usize];
            for _ in 0..1000 {
                let turns = rng.bits();
                for slice in [0, 1, 5, 15, 40] {
                    let share = |number: u32| Stratum { number, bits, turns }.of(slice, 0.5) * f64::from(of);
                    let mut parts: Vec<u32> = (0..of).map(|number| share(number) as u32).collect();
                    met[parts[0] as usize] += 1;
                    parts.sort_unstable();
                    assert!(parts.iter().copied().eq(0..of), "{parts:?}");
                }
            }
            let (mean, most) = (5000.0 / f64::from(of), met.iter().map(|&n| f64::from(n)).fold(0.0, f64::max));
            assert!(most - mean < 5.0 * mean.sqrt(), "{met:?}");
        }
    }
}
