//! Stretches of a ray inside regions: where they begin and end, and how optical depth is spent along them.

use super::{Optics, Scratch};
use glam::Vec3;

/// A stretch of a ray inside one region; `enter` may be negative (the ray starts inside).
#[derive(Debug, Clone, Copy)]
pub(super) struct Interval {
    pub enter: f32,
    pub exit: f32,
    pub region: u32,
}

/// With at most so many intervals, looking for the next end is faster than sorting all.
const FEW: usize = 12;

/// The distance at which the intervals, and `base` extinction all along, have used up `tau`, if that is before `t_max`.
pub(super) fn spend(scratch: &mut Scratch, optics: &[Optics], base: f64, t_max: f32, tau: f64) -> Option<f32> {
    if scratch.intervals.is_empty() {
        // `base` may be an empty sum, which is -0: no quotient may see it.
        let distance = tau / base;
        return (base > 0.0 && distance < f64::from(t_max)).then_some(distance as f32);
    }
    if scratch.intervals.len() <= FEW {
        spend_few(&scratch.intervals, optics, base, t_max, tau)
    } else {
        spend_sorted(scratch, optics, base, t_max, tau)
    }
}

/// From end to end, each time the nearest that is left.
fn spend_few(intervals: &[Interval], optics: &[Optics], base: f64, t_max: f32, tau: f64) -> Option<f32> {
    let (mut at, mut left) = (0.0f32, tau);
    while at < t_max {
        let (mut next, mut sigma) = (t_max, base);
        for interval in intervals {
            if interval.enter > at {
                next = next.min(interval.enter);
            } else if interval.exit > at {
                next = next.min(interval.exit);
                sigma += optics[interval.region as usize].sigma_t;
            }
        }
        let length = f64::from(next) - f64::from(at);
        if left < sigma * length {
            return Some((f64::from(at) + left / sigma) as f32);
        }
        if next >= t_max {
            return None;
        }
        // Outside all media an infinite length costs nothing; 0 x inf would be NaN.
        left -= if sigma > 0.0 { sigma * length } else { 0.0 };
        at = next;
    }
    None
}

/// By sorting all ends: for crowds.
fn spend_sorted(scratch: &mut Scratch, optics: &[Optics], base: f64, t_max: f32, tau: f64) -> Option<f32> {
    let ends = &mut scratch.ends;
    ends.clear();
    for interval in &scratch.intervals {
        let sigma = optics[interval.region as usize].sigma_t as f32;
        ends.push((interval.enter.max(0.0), sigma));
        ends.push((interval.exit, -sigma));
    }
    // Exits first where ends coincide (their sign is negative), so that touching regions never count twice.
    ends.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    ends.push((t_max, 0.0));
    let (mut at, mut sigma, mut inside, mut left) = (0.0f32, base, 0u32, tau);
    for &(t, change) in ends.iter() {
        let to = t.min(t_max);
        if sigma > 0.0 {
            let length = f64::from(to) - f64::from(at);
            if left < sigma * length {
                return Some((f64::from(at) + left / sigma) as f32);
            }
            left -= sigma * length;
        }
        if t >= t_max {
            return None;
        }
        at = t;
        // f32 sums in f64 are exact over 29 binary orders; outside all intervals the sum is `base` by definition.
        inside = if change.is_sign_positive() { inside + 1 } else { inside - 1 };
        sigma = if inside == 0 { base } else { sigma + f64::from(change) };
    }
    None
}

/// Where the line `o + t d` is inside the unit ball around zero; NaN or enter > exit where it is not. `d` of any length.
///
/// The discriminant as 4 a (1 + |v|)(1 - |v|), v the foot of the perpendicular: the textbook form loses hits far away
/// (Haines et al. 2019, Precision improvements for ray/sphere intersection).
#[inline]
pub(super) fn ray_unit_ball(o: Vec3, d: Vec3) -> (f32, f32) {
    let a = d.length_squared();
    let half_b = o.dot(d);
    let v = (o - d * (half_b / a)).length();
    let discriminant = a * (1.0 + v) * (1.0 - v);
    if discriminant < 0.0 {
        return (f32::NAN, f32::NAN);
    }
    let q = -(half_b + discriminant.sqrt().copysign(half_b));
    let c = {
        let l = o.length();
        (l + 1.0) * (l - 1.0)
    };
    let (t0, t1) = (q / a, c / q);
    (t0.min(t1), t0.max(t1))
}

/// Where a line is inside a horizontal layer.
pub(super) fn ray_slab(z: f32, dz: f32, bottom: f32, top: f32) -> (f32, f32) {
    if dz == 0.0 {
        return if z > bottom && z < top { (f32::NEG_INFINITY, f32::INFINITY) } else { (f32::NAN, f32::NAN) };
    }
    let (a, b) = ((bottom - z) / dz, (top - z) / dz);
    (a.min(b), a.max(b))
}
