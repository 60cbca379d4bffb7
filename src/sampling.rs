//! Sampling of directions and discs: each warp maps uniform numbers to its density.

use crate::geom::basis;
use glam::Vec3;

/// The direction at angle theta from `axis` (unit length) and azimuth `2 pi u`; renormalised.
#[inline]
pub fn around(axis: Vec3, cos_theta: f32, sin_theta: f32, u: f32) -> Vec3 {
    let (s, t) = basis(axis);
    let (sin_phi, cos_phi) = (std::f32::consts::TAU * u).sin_cos();
    (s * (cos_phi * sin_theta) + t * (sin_phi * sin_theta) + axis * cos_theta).normalize()
}

/// A cosine-weighted direction around the unit normal `n`: density cos / pi (thesis eq. 26).
pub fn cosine_hemisphere(n: Vec3, u1: f32, u2: f32) -> Vec3 {
    around(n, u1.sqrt(), (1.0 - u1).max(0.0).sqrt(), u2)
}

/// A direction uniform in projected area over a disc of half-angle `alpha` around `axis`: the sun's uniform disc.
///
/// Density cos / (pi sin^2 alpha) per steradian, so that every sample carries the same irradiance on the plane
/// perpendicular to the axis. `sin_alpha` is sin(alpha), in [0, 1].
pub fn uniform_disc(axis: Vec3, sin_alpha: f32, u1: f32, u2: f32) -> Vec3 {
    let sin = sin_alpha * u1.sqrt();
    around(axis, (1.0 - sin * sin).max(0.0).sqrt(), sin, u2)
}

/// A point uniform in the unit ball.
pub fn unit_ball(u: [f64; 3]) -> glam::DVec3 {
    let z = 1.0 - 2.0 * u[0];
    let rho = (1.0 - z * z).max(0.0).sqrt();
    let (sin, cos) = (std::f64::consts::TAU * u[1]).sin_cos();
    glam::DVec3::new(rho * cos, rho * sin, z) * u[2].cbrt()
}
