//! Spheres, eight at a time: by far the commonest regions.

use super::Interval;
use crate::bvh::{Box3, Bvh};
use crate::geom::Ray;
use crate::scene::Region;
use glam::DVec3;
use smallvec::SmallVec;

/// Spheres that one step of the inner loop looks at; the compiler turns each line of it into vector instructions.
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
        self.bvh.leaves(o, d, t_max, |range, _| {
            let lanes = |column: &[f32]| -> [f32; LANES] { column[range.start..range.start + LANES].try_into().unwrap_or([0.0; LANES]) };
            let (x, y, z, r) = (lanes(&self.x), lanes(&self.y), lanes(&self.z), lanes(&self.radius));
            let (mut enter, mut exit) = ([0.0f32; LANES], [0.0f32; LANES]);
            for i in 0..LANES {
                let (ox, oy, oz) = (o.x - x[i], o.y - y[i], o.z - z[i]);
                let half_b = ox * d.x + oy * d.y + oz * d.z;
                let (vx, vy, vz) = (ox - d.x * half_b, oy - d.y * half_b, oz - d.z * half_b);
                let v = (vx * vx + vy * vy + vz * vz).sqrt();
                let l = (ox * ox + oy * oy + oz * oz).sqrt();
                // NaN where the line misses: it fails every comparison below.
                let root = ((r[i] + v) * (r[i] - v)).sqrt();
                let q = -(half_b + root.copysign(half_b));
                let other = (l + r[i]) * (l - r[i]) / q;
                (enter[i], exit[i]) = if q < other { (q, other) } else { (other, q) };
            }
            for i in 0..range.len() {
                if enter[i] < exit[i] && exit[i] > 0.0 && enter[i] < t_max {
                    out.push(Interval { enter: enter[i], exit: exit[i], region: self.region[range.start + i] });
                }
            }
        });
    }
}
