//! How much extinction a small ball holds: what stored photons are compared with where regions end or overlap.

use super::{Media, Solid};
use crate::bvh::Box3;
use glam::Vec3;
use std::f64::consts::PI;

/// Points that stand for a ball where a shape has no closed form.
const POINTS: u32 = 64;

impl Media {
    /// The optical mass within a ball of radius `r` metres around `c` (local space): the integral of extinction over it, in
    /// m^2, of all regions that scatter light at all.
    ///
    /// In closed form for spheres and slabs, by 64 points of the ball for other shapes and for voxels.
    pub fn mass_within(&self, c: Vec3, r: f32) -> f64 {
        let mut mass = 0.0;
        let sigma_t = |region: u32| {
            let optics = self.optics(region);
            if optics.albedo > 0.0 { optics.sigma_t } else { 0.0 }
        };
        let query = Box3 { min: c - r, max: c + r };
        self.balls.near(&query, |centre, radius, region| {
            mass += sigma_t(region) * shared_by_balls(f64::from(centre.distance(c)), f64::from(radius), f64::from(r));
        });
        let whole = 4.0 / 3.0 * PI * f64::from(r).powi(3);
        let share = |inside: &dyn Fn(Vec3) -> f64| (0..POINTS).map(|i| inside(c + r * ball_point(i))).sum::<f64>() / f64::from(POINTS);
        for &region in &self.unbounded {
            if let Solid::Slab { bottom, top } = self.solids[region as usize] {
                mass += sigma_t(region) * (below(top - c.z, r) - below(bottom - c.z, r));
            }
        }
        self.others.overlapping(&query, |region| {
            mass += sigma_t(region) * whole * share(&|p| f64::from(u8::from(self.solids[region as usize].holds(p))));
            false
        });
        for grid in &self.grids {
            mass += sigma_t(grid.region) * whole * share(&|p| f64::from(grid.density(p)));
        }
        mass
    }
}

/// The volume that two balls of radii `a` and `b` share, their centres `d` apart.
fn shared_by_balls(d: f64, a: f64, b: f64) -> f64 {
    if d >= a + b {
        return 0.0;
    }
    if d <= (a - b).abs() {
        return 4.0 / 3.0 * PI * a.min(b).powi(3);
    }
    PI * (a + b - d).powi(2) * (d * d + 2.0 * d * (a + b) - 3.0 * (a - b).powi(2)) / (12.0 * d)
}

/// The volume of a ball of radius `r` that lies below a level plane, `z` above its centre.
fn below(z: f32, r: f32) -> f64 {
    let (z, r) = (f64::from(z).clamp(-f64::from(r), f64::from(r)), f64::from(r));
    PI * (z + r).powi(2) * (2.0 * r - z) / 3.0
}

/// Point number `i` of an even sequence in the unit ball (Roberts 2018, the R3 sequence; radius by the cube root).
fn ball_point(i: u32) -> Vec3 {
    let part = |a: f64| ((f64::from(i) + 0.5) * a).fract();
    crate::sampling::unit_ball([part(0.819_172_513_396_164_4), part(0.671_043_606_703_789_2), part(0.549_700_477_901_970_3)]).as_vec3()
}

#[cfg(test)]
mod tests;
