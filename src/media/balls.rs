//! Spheres, eight at a time: by far the commonest regions.

use super::Interval;
use crate::bvh::{Box3, Bvh};
use crate::geom::Ray;
use crate::scene::Region;
use glam::DVec3;
use smallvec::SmallVec;
use wide::{CmpGt, CmpLt, f32x8};

/// Spheres that one step of the inner loop looks at.
const LANES: usize = 8;

/// Spheres in the order of a hierarchy's leaves, coordinate by coordinate.
#[derive(Debug, Clone, Default)]
pub(super) struct Balls {
    bvh: Bvh,
    x: Vec<f32>,
    y: Vec<f32>,
    z: Vec<f32>,
    radius: Vec<f32>,
    region: Vec<u32>,
}

impl Balls {
    /// Spheres given as (region, radius), relative to `origin`.
    pub(super) fn new(balls: &[(u32, f32)], regions: &[Region], origin: DVec3) -> Self {
        let shape = |i: u32| &regions[balls[i as usize].0 as usize].shape;
        let boxes: Vec<Option<Box3>> = (0..balls.len() as u32).map(|i| Some(Box3::around(shape(i).bounds(), origin))).collect();
        let mut all = Balls { bvh: Bvh::new(&boxes, LANES), ..Balls::default() };
        for &i in all.bvh.items() {
            let centre = (shape(i).centre() - origin).as_vec3();
            all.x.push(centre.x);
            all.y.push(centre.y);
            all.z.push(centre.z);
            all.radius.push(balls[i as usize].1);
            all.region.push(balls[i as usize].0);
        }
        // Room for a whole step at the last leaf; no ray is inside a ball of negative radius.
        for column in [&mut all.x, &mut all.y, &mut all.z] {
            column.resize(column.len() + LANES, 0.0);
        }
        all.radius.resize(all.radius.len() + LANES, -1.0);
        all
    }

    /// Adds the stretches of the ray inside each sphere that begin before `t_max` and end after 0.
    ///
    /// Roots as in [`super::ray_unit_ball`], with a direction of unit length.
    #[inline]
    pub(super) fn intervals(&self, ray: &Ray, t_max: f32, out: &mut SmallVec<[Interval; 32]>) {
        let (o, d) = (ray.origin, ray.direction);
        let (dx, dy, dz) = (f32x8::splat(d.x), f32x8::splat(d.y), f32x8::splat(d.z));
        self.bvh.leaves(o, d, t_max, |range, _| {
            let lanes = |column: &[f32]| f32x8::from(<[f32; LANES]>::try_from(&column[range.start..range.start + LANES]).unwrap_or([0.0; LANES]));
            let (ox, oy, oz) = (f32x8::splat(o.x) - lanes(&self.x), f32x8::splat(o.y) - lanes(&self.y), f32x8::splat(o.z) - lanes(&self.z));
            let r = lanes(&self.radius);
            let half_b = ox * dx + oy * dy + oz * dz;
            let (vx, vy, vz) = (ox - dx * half_b, oy - dy * half_b, oz - dz * half_b);
            let v = (vx * vx + vy * vy + vz * vz).sqrt();
            let l = (ox * ox + oy * oy + oz * oz).sqrt();
            // NaN where the line misses: it fails every comparison below.
            let root = ((r + v) * (r - v)).sqrt();
            let negative = half_b.simd_lt(f32x8::ZERO);
            let q = negative.select(root - half_b, -half_b - root);
            let other = (l + r) * (l - r) / q;
            let (enter, exit) = (negative.select(other, q), negative.select(q, other));
            let met = enter.simd_lt(exit) & exit.simd_gt(f32x8::ZERO) & enter.simd_lt(f32x8::splat(t_max));
            let mut left = met.to_bitmask() & ((1u32 << range.len()) - 1);
            let (enter, exit) = (enter.to_array(), exit.to_array());
            while left != 0 {
                let i = left.trailing_zeros() as usize;
                left &= left - 1;
                out.push(Interval { enter: enter[i], exit: exit[i], region: self.region[range.start + i] });
            }
        });
    }
}
