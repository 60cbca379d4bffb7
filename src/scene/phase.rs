//! The Henyey-Greenstein phase function: value and sampling, stable at every g.
//!
//! Directions are those of propagation: `cos` is w_in . w_out, forward is +1; normalised to 1 over 4 pi (thesis eq. 7).

use crate::rng::Rng;
use glam::Vec3;
use std::f64::consts::PI;

/// The Henyey-Greenstein phase function's value in 1/sr, at the cosine given as `one_minus_cos` = 1 - cos(theta).
///
/// Taking 1 - cos and not cos keeps the forward peak exact: (1 - g)^2 + 2 g (1 - cos) has no cancellation for
/// g >= 0, and its mirror image has none below.
pub fn henyey_greenstein(g: f64, one_minus_cos: f64) -> f64 {
    let base =
        if g >= 0.0 { (1.0 - g) * (1.0 - g) + 2.0 * g * one_minus_cos } else { (1.0 + g) * (1.0 + g) - 2.0 * g * (2.0 - one_minus_cos) };
    (1.0 - g) * (1.0 + g) / (4.0 * PI * base * base.sqrt())
}

/// 1 - cos of the angle between two directions of unit length, |a - b|^2 / 2: without cancellation.
#[inline]
pub fn one_minus_cos(a: Vec3, b: Vec3) -> f64 {
    0.5 * f64::from((a - b).length_squared())
}

/// (cos, sin) of a scattering angle distributed as [`henyey_greenstein`], by xi in [0, 1).
///
/// Never divides by g: 1 - cos and 1 + cos are each computed as products (eq. 19 is 0/0 at g = 0 and cancels near it).
/// Negative g is the mirror image of positive g, so that no sum in it cancels.
#[inline]
pub fn sample_henyey_greenstein(g: f64, xi: f64) -> (f64, f64) {
    let (a, xi) = if g < 0.0 { (-g, 1.0 - xi) } else { (g, xi) };
    let d = 1.0 - a + 2.0 * a * xi;
    let inv = 1.0 / (d * d);
    let minus = 2.0 * (1.0 - a) * (1.0 - a) * (1.0 - xi) * (1.0 + a * xi) * inv;
    let plus = 2.0 * (1.0 + a) * (1.0 + a) * xi * (1.0 - a + a * xi) * inv;
    let cos = if minus < plus { 1.0 - minus } else { plus - 1.0 };
    (if g < 0.0 { -cos } else { cos }, (minus * plus).max(0.0).sqrt())
}

/// A Henyey-Greenstein function, of which an even part may be taken away: part HG(g) + (1 - part) / (4 pi).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Phase {
    /// The mean cosine of the Henyey-Greenstein function.
    pub g: f64,
    /// What it counts, 1 or more; the whole is not below zero.
    pub part: f64,
}

impl Phase {
    /// The function itself.
    pub fn henyey_greenstein(g: f64) -> Self {
        Phase { g, part: 1.0 }
    }

    /// Its value in 1/sr, at the cosine given as 1 - cos(theta).
    pub fn value(&self, one_minus_cos: f64) -> f64 {
        self.part * henyey_greenstein(self.g, one_minus_cos) + (1.0 - self.part) / (4.0 * PI)
    }

    /// (cos, sin) of a scattering angle distributed so.
    #[inline]
    pub fn sample(&self, rng: &mut Rng) -> (f64, f64) {
        loop {
            let turn = sample_henyey_greenstein(self.g, rng.uniform());
            // What is taken away is as likely as the even part is a part there.
            if self.part == 1.0 || rng.uniform() * (4.0 * PI * self.part * henyey_greenstein(self.g, 1.0 - turn.0)) >= self.part - 1.0 {
                return turn;
            }
        }
    }
}

/// (cos, sin) by eq. 19 to the letter, as `--model hura2006` asks: cancels near g = 0, and 0/0 at it (isotropic then, eq. 5).
#[inline]
pub fn sample_eq19(g: f64, xi: f64) -> (f64, f64) {
    let cos = if g == 0.0 {
        2.0 * xi - 1.0
    } else {
        let s = (1.0 - g * g) / (1.0 - g + 2.0 * g * xi);
        ((1.0 + g * g - s * s) / (2.0 * g)).clamp(-1.0, 1.0)
    };
    (cos, (1.0 - cos * cos).max(0.0).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::{Rng, Stage};

    const GS: [f64; 9] = [-0.9999, -0.9, -1e-9, 0.0, 1e-9, 0.3, 0.85, 0.99, 0.999_999];

    #[test]
    fn integrates_to_one_over_the_sphere() {
        for g in GS {
            // Substituting by the sampler's own CDF would be circular: integrate in s = ln(1 - cos + e), which resolves the peak.
            let n = 400_000;
            let e = 1e-16f64;
            let (a, b) = (e.ln(), (2.0 + e).ln());
            let sum: f64 = (0..n)
                .map(|i| {
                    let s = a + (b - a) * (f64::from(i) + 0.5) / f64::from(n);
                    let one_minus_cos = (s.exp() - e).clamp(0.0, 2.0);
                    let mirrored = if g < 0.0 { 2.0 - one_minus_cos } else { one_minus_cos };
                    henyey_greenstein(g, mirrored) * s.exp()
                })
                .sum();
            let integral = sum * (b - a) / f64::from(n) * 2.0 * PI;
            assert!((integral - 1.0).abs() < 1e-4, "g = {g}: {integral}");
        }
    }

    #[test]
    fn sampled_cosines_pass_chi_squared_against_the_density() {
        // 40 bins of equal probability by the exact CDF; 99.99 % quantile of chi-squared with 39 degrees is 81.
        for g in GS {
            let mut rng = Rng::new(7, Stage::Photons, 1);
            let (bins, n) = (40usize, 200_000);
            let mut counts = vec![0u32; bins];
            for _ in 0..n {
                let (cos, _) = sample_henyey_greenstein(g, rng.uniform());
                counts[((cdf(g, cos) * bins as f64) as usize).min(bins - 1)] += 1;
            }
            if g.abs() > 0.9999 {
                continue; // cos itself has no resolution left there; its mean is checked below.
            }
            let expected = f64::from(n) / bins as f64;
            let chi2: f64 = counts.iter().map(|&c| (f64::from(c) - expected).powi(2) / expected).sum();
            assert!(chi2 < 81.0, "g = {g}: chi2 {chi2}");
        }
    }

    /// P(cos' <= cos), from integrating eq. 7 by hand; the isotropic limit where that cancels.
    fn cdf(g: f64, cos: f64) -> f64 {
        if g.abs() < 1e-6 {
            return 0.5 * (1.0 + cos);
        }
        (1.0 - g * g) / (2.0 * g) * (1.0 / (1.0 + g * g - 2.0 * g * cos).sqrt() - 1.0 / (1.0 + g))
    }

    #[test]
    fn mean_cosine_is_g() {
        for g in GS {
            // By quadrature over xi = e^s (the side scatter of a sharp peak lies at tiny xi): no sample size could see 1 - 1e-6.
            let (n, low) = (200_000, 1e-14f64.ln());
            let mean: f64 = (0..n)
                .map(|i| {
                    let xi = (low * (f64::from(i) + 0.5) / f64::from(n)).exp();
                    let (cos, sin) = sample_henyey_greenstein(g, if g < 0.0 { 1.0 - xi } else { xi });
                    assert!((cos * cos + sin * sin - 1.0).abs() < 1e-12, "g = {g}");
                    // Sums 1 - |cos| side: (1 - cos) for g >= 0, (1 + cos) below.
                    (1.0 - cos * g.signum()) * xi
                })
                .sum::<f64>()
                * -low
                / f64::from(n);
            assert!((mean - (1.0 - g.abs())).abs() < 1e-5 * (1.0 - g.abs()) + 1e-9, "g = {g}: {mean}");
        }
    }

    #[test]
    fn eq19_agrees_with_the_stable_form_where_it_is_well_conditioned() {
        for g in [-0.8, 0.3, 0.9] {
            for i in 0..1000 {
                let xi = (f64::from(i) + 0.5) / 1000.0;
                assert!((sample_eq19(g, xi).0 - sample_henyey_greenstein(g, xi).0).abs() < 1e-12);
            }
        }
    }
}
