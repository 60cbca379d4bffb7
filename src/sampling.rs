//! Sampling of directions and discs: each warp maps uniform numbers to its density.

use crate::geom::basis;
use crate::rng::Rng;
use glam::Vec3;

/// The direction at angle theta from `axis` (unit length) and azimuth `2 pi u`; renormalised.
#[inline]
pub fn around(axis: Vec3, cos_theta: f32, sin_theta: f32, u: f32) -> Vec3 {
    let (s, t) = basis(axis);
    let (sin_phi, cos_phi) = (std::f32::consts::TAU * u).sin_cos();
    (s * (cos_phi * sin_theta) + t * (sin_phi * sin_theta) + axis * cos_theta).normalize()
}

/// A direction from all alike.
pub fn uniform_sphere(rng: &mut Rng) -> Vec3 {
    let z = 1.0 - 2.0 * rng.uniform();
    around(Vec3::Z, z as f32, (1.0 - z * z).max(0.0).sqrt() as f32, rng.uniform_f32())
}

/// A cosine-weighted direction around the unit normal `n`: density cos / pi (thesis eq. 26).
pub fn cosine_hemisphere(n: Vec3, u1: f32, u2: f32) -> Vec3 {
    around(n, u1.sqrt(), (1.0 - u1).max(0.0).sqrt(), u2)
}

/// The density of [`cosine_hemisphere`] in 1/sr, at an angle with that cosine from the normal.
pub fn cosine_hemisphere_pdf(cos: f32) -> f32 {
    cos.max(0.0) * std::f32::consts::FRAC_1_PI
}

/// A direction uniform in projected area over a disc of half-angle `alpha` around `axis`: the sun's uniform disc.
///
/// Density cos / (pi sin^2 alpha) per steradian, so that every sample carries the same irradiance on the plane
/// perpendicular to the axis. `sin_alpha` is sin(alpha), in [0, 1].
pub fn uniform_disc(axis: Vec3, sin_alpha: f32, u1: f32, u2: f32) -> Vec3 {
    let sin = sin_alpha * u1.sqrt();
    around(axis, (1.0 - sin * sin).max(0.0).sqrt(), sin, u2)
}

/// The density of [`uniform_disc`] in 1/sr, at an angle with that cosine from the axis.
pub fn uniform_disc_pdf(sin_alpha: f32, cos: f32) -> f32 {
    let inside = cos > 0.0 && 1.0 - cos * cos <= sin_alpha * sin_alpha;
    if inside { cos * std::f32::consts::FRAC_1_PI / (sin_alpha * sin_alpha) } else { 0.0 }
}

/// A point uniform in the unit ball.
pub fn unit_ball(u: [f64; 3]) -> glam::DVec3 {
    let z = 1.0 - 2.0 * u[0];
    let rho = (1.0 - z * z).max(0.0).sqrt();
    let (sin, cos) = (std::f64::consts::TAU * u[1]).sin_cos();
    glam::DVec3::new(rho * cos, rho * sin, z) * u[2].cbrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::{Rng, Stage};
    use std::f64::consts::TAU;

    /// Chi-squared of counts against probabilities that add up to 1, over its degrees of freedom; bins with fewer than 5
    /// expected are put together.
    fn chi_squared(counts: &[u64], probabilities: &[f64]) -> (f64, f64) {
        let n = counts.iter().sum::<u64>() as f64;
        let (mut sum, mut bins, mut rest) = (0.0, 0.0, (0.0, 0.0));
        for (&count, &p) in counts.iter().zip(probabilities) {
            if n * p >= 5.0 {
                (sum, bins) = (sum + (count as f64 - n * p).powi(2) / (n * p), bins + 1.0);
            } else {
                rest = (rest.0 + count as f64, rest.1 + n * p);
            }
        }
        if rest.1 >= 1.0 {
            (sum, bins) = (sum + (rest.0 - rest.1).powi(2) / rest.1, bins + 1.0);
        } else {
            assert!(rest.0 < 10.0, "{} samples where {} may be", rest.0, rest.1);
        }
        (sum, bins - 1.0)
    }

    /// Directions drawn by `sample` fall as `pdf`(cosine with the axis) says, over the whole sphere: 16 rings by 12 sectors,
    /// the rings' probabilities by quadrature of the density.
    fn directions(name: &str, axis: Vec3, low: f64, sample: impl Fn(&mut Rng) -> Vec3, pdf: impl Fn(f64) -> f64) {
        let (rings, sectors, n) = (16usize, 12usize, 400_000);
        let (s, t) = basis(axis);
        let ring = |cos: f64| (((cos - low) / (1.0 - low) * rings as f64).floor()).clamp(-1.0, rings as f64 - 1.0);
        let steps = 4000;
        let mut probabilities: Vec<f64> = (0..rings * sectors)
            .map(|bin| {
                let width = (1.0 - low) / rings as f64;
                let from = low + width * (bin / sectors) as f64;
                let cos = |i: i32| from + width * (f64::from(i) + 0.5) / f64::from(steps);
                (0..steps).map(|i| pdf(cos(i))).sum::<f64>() * width / f64::from(steps) * TAU / sectors as f64
            })
            .collect();
        // What lies outside the rings: nothing.
        probabilities.push(0.0);
        let whole: f64 = probabilities.iter().sum();
        assert!((whole - 1.0).abs() < 1e-3, "{name}: the density integrates to {whole}");
        let mut counts = vec![0u64; rings * sectors + 1];
        let mut rng = Rng::new(11, Stage::Render, 1);
        for _ in 0..n {
            let d = sample(&mut rng);
            assert!((d.length() - 1.0).abs() < 1e-6, "{name}: {d}");
            let (ring, phi) = (ring(f64::from(d.dot(axis))), f64::from(d.dot(t).atan2(d.dot(s))));
            let sector = ((phi / TAU).rem_euclid(1.0) * sectors as f64) as usize % sectors;
            counts[if ring < 0.0 { rings * sectors } else { ring as usize * sectors + sector }] += 1;
        }
        let (chi2, freedom) = chi_squared(&counts, &probabilities);
        // Wilson and Hilferty 1931: 4.5 sigma.
        let z = ((chi2 / freedom).cbrt() - (1.0 - 2.0 / (9.0 * freedom))) / (2.0 / (9.0 * freedom)).sqrt();
        assert!(z.abs() < 4.5, "{name}: chi-squared {chi2} with {freedom} degrees, z {z}");
    }

    #[test]
    fn directions_pass_chi_squared_against_their_densities() {
        for axis in [Vec3::Z, Vec3::NEG_Z, Vec3::new(0.6, -0.48, 0.64)] {
            let hemisphere = |rng: &mut Rng| cosine_hemisphere(axis, rng.uniform_f32(), rng.uniform_f32());
            directions("cosine hemisphere", axis, 0.0, hemisphere, |cos| f64::from(cosine_hemisphere_pdf(cos as f32)));
            for sin_alpha in [0.3f32, 0.9, 1.0] {
                let low = (1.0 - f64::from(sin_alpha).powi(2)).sqrt();
                let disc = |rng: &mut Rng| uniform_disc(axis, sin_alpha, rng.uniform_f32(), rng.uniform_f32());
                directions("disc", axis, low, disc, |cos| f64::from(uniform_disc_pdf(sin_alpha, cos as f32)));
            }
        }
    }

    #[test]
    fn the_unit_ball_is_filled_evenly() {
        // Shells and octants of equal volume.
        let mut rng = Rng::new(5, Stage::Regions, 3);
        let mut counts = vec![0u64; 10 * 8];
        for _ in 0..200_000 {
            let p = unit_ball([rng.uniform(), rng.uniform(), rng.uniform()]);
            let shell = ((p.length().powi(3) * 10.0) as usize).min(9);
            let octant = usize::from(p.x > 0.0) | usize::from(p.y > 0.0) << 1 | usize::from(p.z > 0.0) << 2;
            counts[shell * 8 + octant] += 1;
        }
        let (chi2, freedom) = chi_squared(&counts, &[1.0 / 80.0; 80]);
        assert!((chi2 - freedom).abs() < 4.5 * (2.0 * freedom).sqrt(), "{chi2} with {freedom} degrees");
    }

    #[test]
    fn optical_depths_are_exponential() {
        let mut rng = Rng::new(3, Stage::Flux, 9);
        let mut counts = vec![0u64; 50];
        for _ in 0..500_000 {
            // Uniform by the distribution's own function.
            counts[((-(-rng.optical_depth()).exp_m1() * 50.0) as usize).min(49)] += 1;
        }
        let (chi2, freedom) = chi_squared(&counts, &[0.02; 50]);
        assert!((chi2 - freedom).abs() < 4.5 * (2.0 * freedom).sqrt(), "{chi2} with {freedom} degrees");
    }
}
