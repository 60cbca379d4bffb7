//! Means with standard errors from independent batches.

/// A value with its standard error.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Estimate {
    /// The value.
    pub value: f64,
    /// Its standard error (one sigma).
    pub se: f64,
}

/// Sums of independent batches, for ratios of their totals: each batch brings a numerator for every quantity and one denominator.
#[derive(Debug, Clone, PartialEq)]
pub struct Ratios<const N: usize> {
    batches: f64,
    denominator: f64,
    denominator2: f64,
    numerators: [f64; N],
    numerators2: [f64; N],
    products: [f64; N],
}

impl<const N: usize> Default for Ratios<N> {
    fn default() -> Self {
        Ratios { batches: 0.0, denominator: 0.0, denominator2: 0.0, numerators: [0.0; N], numerators2: [0.0; N], products: [0.0; N] }
    }
}

impl<const N: usize> Ratios<N> {
    /// Adds one batch.
    pub fn add(&mut self, numerators: [f64; N], denominator: f64) {
        self.batches += 1.0;
        self.denominator += denominator;
        self.denominator2 += denominator * denominator;
        for (i, x) in numerators.into_iter().enumerate() {
            self.numerators[i] += x;
            self.numerators2[i] += x * x;
            self.products[i] += x * denominator;
        }
    }

    /// The sum of a numerator.
    pub fn total(&self, i: usize) -> f64 {
        self.numerators[i]
    }

    /// The sum of the denominators.
    pub fn denominator(&self) -> f64 {
        self.denominator
    }

    /// The ratio of totals, with its standard error by linearisation (Cochran 1977, 6.4); zero error with fewer than two batches.
    pub fn ratio(&self, i: usize) -> Estimate {
        if self.denominator == 0.0 {
            return Estimate { value: 0.0, se: 0.0 };
        }
        let r = self.numerators[i] / self.denominator;
        let residual2 = (self.numerators2[i] - 2.0 * r * self.products[i] + r * r * self.denominator2).max(0.0);
        let se = if self.batches > 1.0 { (residual2 * self.batches / (self.batches - 1.0)).sqrt() / self.denominator } else { 0.0 };
        Estimate { value: r, se }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::{Rng, Stage};

    #[test]
    fn the_standard_error_is_the_spread_of_repeated_runs() {
        // 400 runs of 50 batches with correlated numerator and denominator: the mean squared error of the ratio over the mean
        // squared stated error is 1 within 4.5 sigma of a chi-squared with 400 degrees.
        let mut rng = Rng::new(1, Stage::Photons, 9);
        let (mut actual, mut stated) = (0.0, 0.0);
        for _ in 0..400 {
            let mut ratios = Ratios::<1>::default();
            for _ in 0..50 {
                let d = 1.0 + rng.uniform();
                ratios.add([0.3 * d + 0.2 * (rng.uniform() - 0.5)], d);
            }
            let e = ratios.ratio(0);
            actual += (e.value - 0.3).powi(2);
            stated += e.se.powi(2);
        }
        assert!((actual / stated - 1.0).abs() < 4.5 * (2.0f64 / 400.0).sqrt(), "{}", actual / stated);
    }
}
