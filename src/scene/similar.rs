//! Similarity: media in which light that has scattered before spreads alike by fewer, wider scatterings.
//!
//! Of a peaked phase function a share goes nearly straight on, and is taken for no scattering at all; the rest is a wider function with which the whole
//! keeps its first two moments (similarity relations of orders 1 and 2; Wyman, Patterson and Wilson 1989, Zhao, Ramamoorthi and Bala
//! 2014): a Henyey-Greenstein function of which an even part is taken away. How much may go straight on is limited by that function,
//! which must not fall below zero.

use super::{Medium, Phase};

/// Phase functions with a mean cosine below this are left as they are: little of them goes straight on.
const PEAKED: f64 = 0.6;

/// What a Henyey-Greenstein phase function of a mean cosine is like.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Similar {
    /// The share of scattering that goes straight on.
    pub straight: f64,
    /// The rest.
    pub phase: Phase,
}

impl Similar {
    /// Of a mean cosine `g`, where of the share at which the wider function would reach zero a part, below 1, goes straight on. Where there is no
    /// peak, nothing does.
    pub fn to(g: f64, part: f64) -> Self {
        if g < PEAKED {
            return Similar { straight: 0.0, phase: Phase::henyey_greenstein(g) };
        }
        // Moments of the whole are straight + (1 - straight) part cosine^l, for l = 1 and 2.
        let rest = |straight: f64| Phase {
            g: (g * g - straight) / (g - straight),
            part: (g - straight).powi(2) / ((1.0 - straight) * (g * g - straight)),
        };
        let backward = |phase: Phase| phase.part * (1.0 - phase.g) / (1.0 + phase.g).powi(2) - (phase.part - 1.0);
        let (mut low, mut high) = (0.0, g * g);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            *(if backward(rest(middle)) > 0.0 { &mut low } else { &mut high }) = middle;
        }
        Similar { straight: part * low, phase: rest(part * low) }
    }

    /// The medium without what goes straight on; its phase function is [`Similar::phase`].
    pub fn medium(&self, medium: &Medium) -> Medium {
        Medium { sigma_s: medium.sigma_s.map(|s| s * (1.0 - self.straight)), g: self.phase.g, ..*medium }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::{Rng, Stage};
    use std::f64::consts::PI;

    #[test]
    fn the_whole_keeps_two_moments_and_never_falls_below_zero() {
        for (g, part) in [(0.6, 0.97), (0.75, 0.5), (0.85, 0.97), (0.95, 0.8), (0.99, 0.97)] {
            let Similar { straight, phase } = Similar::to(g, part);
            assert!(straight > 0.2 && straight < g * g, "{g}: {straight}");
            // By the midpoint rule over the cosine, in a variable that resolves the peak.
            let (mut moments, n) = ([0.0; 3], 200_000);
            for i in 0..n {
                let (cos, _) = crate::scene::phase::sample_henyey_greenstein(phase.g, (f64::from(i) + 0.5) / f64::from(n));
                let value = phase.value(1.0 - cos);
                assert!(value >= 0.0, "{g} at {cos}: {value}");
                let weight = value / crate::scene::phase::henyey_greenstein(phase.g, 1.0 - cos) / f64::from(n);
                moments[0] += weight;
                moments[1] += weight * cos;
                moments[2] += weight * 0.5 * (3.0 * cos * cos - 1.0);
            }
            for (l, moment) in moments.into_iter().enumerate() {
                let whole = straight + (1.0 - straight) * moment;
                assert!((whole - g.powi(l as i32)).abs() < 1e-4, "{g}, degree {l}: {whole}");
            }
        }
    }

    #[test]
    fn samples_are_distributed_as_the_value_says() {
        let Similar { phase, .. } = Similar::to(0.85, 0.97);
        let mut rng = Rng::new(3, Stage::Photons, 0);
        let (n, bins) = (400_000, 40);
        let mut counts = vec![0.0f64; bins];
        for _ in 0..n {
            let (cos, sin) = phase.sample(&mut rng);
            assert!((cos * cos + sin * sin - 1.0).abs() < 1e-9);
            counts[((0.5 * (cos + 1.0) * bins as f64) as usize).min(bins - 1)] += 1.0;
        }
        let chi_squared: f64 = counts
            .iter()
            .enumerate()
            .map(|(bin, count)| {
                let steps = 200;
                let value = |i: i32| phase.value(1.0 - (2.0 * (bin as f64 + (f64::from(i) + 0.5) / f64::from(steps)) / bins as f64 - 1.0));
                let expected = (0..steps).map(value).sum::<f64>() / f64::from(steps) * 2.0 / bins as f64 * 2.0 * PI * f64::from(n);
                (count - expected).powi(2) / expected
            })
            .sum();
        // The 99.99 % quantile with 39 degrees of freedom.
        assert!(chi_squared < 81.0, "{chi_squared}");
    }
}
