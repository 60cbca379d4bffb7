//! Spheres, eight at a time: by far the commonest regions.

use super::Interval;
use crate::bvh::{Box3, Bvh};
use crate::geom::{Bounds, Ray};
use glam::{DVec3, Vec3};
use smallvec::SmallVec;
use std::ops::Range;
use wide::f32x8;

/// Spheres that one step of the inner loop looks at.
pub(super) const LANES: usize = 8;

/// So many spheres need no hierarchy.
const HANDFUL: usize = 32;

/// Spheres coordinate by coordinate, so that eight load at once.
#[derive(Debug, Clone, Default)]
pub(super) struct Columns {
    x: Vec<f32>,
    y: Vec<f32>,
    z: Vec<f32>,
    radius: Vec<f32>,
    region: Vec<u32>,
}

impl Columns {
    pub(super) fn len(&self) -> usize {
        self.region.len()
    }

    pub(super) fn push(&mut self, (centre, radius, region): (Vec3, f32, u32)) {
        self.x.push(centre.x);
        self.y.push(centre.y);
        self.z.push(centre.z);
        self.radius.push(radius);
        self.region.push(region);
    }

    /// Room for a whole step at the last sphere, once all are there.
    pub(super) fn pad(&mut self) {
        for column in [&mut self.x, &mut self.y, &mut self.z, &mut self.radius] {
            column.resize(column.len() + LANES, 0.0);
        }
    }

    /// Adds the stretches of the ray inside the spheres of a range, that begin before `t_max` and end after 0.
    #[inline]
    pub(super) fn intervals(&self, ray: &Ray, t_max: f32, range: Range<usize>, out: &mut SmallVec<[Interval; 32]>) {
        for start in range.clone().step_by(LANES) {
            self.step(ray, t_max, start..range.end.min(start + LANES), out);
        }
    }

    /// The same for at most [`LANES`] spheres.
    ///
    /// Roots as in [`super::ray_unit_ball`], with a direction of unit length.
    #[inline]
    fn step(&self, ray: &Ray, t_max: f32, range: Range<usize>, out: &mut SmallVec<[Interval; 32]>) {
        let (o, d) = (ray.origin, ray.direction);
        let (dx, dy, dz) = (f32x8::splat(d.x), f32x8::splat(d.y), f32x8::splat(d.z));
        let lanes =
            |column: &[f32]| f32x8::from(<[f32; LANES]>::try_from(&column[range.start..range.start + LANES]).unwrap_or([0.0; LANES]));
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
    }
}

/// Spheres in the order of a hierarchy's leaves.
#[derive(Debug, Clone, Default)]
pub(super) struct Balls {
    bvh: Bvh,
    columns: Columns,
    /// (centre, radius, region) in the order that they were given in.
    given: Vec<(Vec3, f32, u32)>,
}

impl Balls {
    /// Spheres given as (centre, radius, region).
    pub(super) fn new(balls: &[(Vec3, f32, u32)]) -> Self {
        let bounds = |&(c, r, _): &(Vec3, f32, u32)| Bounds { min: (c - r).as_dvec3(), max: (c + r).as_dvec3() };
        let boxes: Vec<Option<Box3>> = balls.iter().map(|b| Some(Box3::around(bounds(b), DVec3::ZERO))).collect();
        // A handful is faster looked at whole.
        let bvh = Bvh::new(&boxes, if balls.len() <= HANDFUL { HANDFUL } else { LANES });
        let mut columns = Columns::default();
        bvh.items().iter().for_each(|&i| columns.push(balls[i as usize]));
        columns.pad();
        Balls { bvh, columns, given: balls.to_vec() }
    }

    /// Calls `visit(centre, radius, region)` for every sphere whose leaf's box meets `query`.
    #[inline]
    pub(super) fn near(&self, query: &Box3, mut visit: impl FnMut(Vec3, f32, u32)) {
        self.bvh.overlapping(query, |i| {
            let (centre, radius, region) = self.given[i as usize];
            visit(centre, radius, region);
            false
        });
    }

    /// Adds the stretches of the ray inside each sphere that begin before `t_max` and end after 0.
    #[inline]
    pub(super) fn intervals(&self, ray: &Ray, t_max: f32, out: &mut SmallVec<[Interval; 32]>) {
        self.bvh.leaves(ray.origin, ray.direction, t_max, |range, _| self.columns.intervals(ray, t_max, range, out));
    }
}
