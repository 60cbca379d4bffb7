//! Air: what light meets between and around the clouds. Layers above a flat ground, without end to the sides.

use std::f64::consts::PI;

/// How a layer of air scatters.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Scattering {
    /// By molecules: 3 (1 + cos^2) / (16 pi).
    Rayleigh,
    /// By droplets and dust: the Henyey-Greenstein function of that mean cosine, in (-1, 1).
    HenyeyGreenstein(f64),
}

/// A layer of air. Its coefficients hold at its base, per metre, RGB, and fall with height where it has a scale height.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct AirLayer {
    /// Scattering coefficient at the base, 1/m.
    pub sigma_s: [f64; 3],
    /// Absorption coefficient at the base, 1/m.
    pub sigma_a: [f64; 3],
    /// The phase function.
    pub scattering: Scattering,
    /// World height at which it begins, m. There is none below.
    pub base: f64,
    /// World height at which it ends, m.
    pub top: f64,
    /// The climb over which it thins by e, m; without one it is even.
    pub scale_height: Option<f64>,
}

/// All layers; the coefficients of layers that overlap add.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Air([Option<AirLayer>; MOST_LAYERS]);

/// The most layers there can be.
pub const MOST_LAYERS: usize = 4;

/// Molecules at sea level at 680, 550 and 440 nm, 1/m, and the height over which they thin (Bruneton and Neyret 2008, 2.1 and 4).
const RAYLEIGH: [f64; 3] = [5.8e-6, 13.5e-6, 33.1e-6];
const RAYLEIGH_HEIGHT: f64 = 8000.0;
/// Aerosol of a clear day: scattering, 1/m, its share of extinction, the mean cosine (their 4), and the height.
const AEROSOL: f64 = 4.0e-6;
const AEROSOL_ALBEDO: f64 = 0.9;
const AEROSOL_G: f64 = 0.8;
const AEROSOL_HEIGHT: f64 = 1200.0;
/// Where air ends: so many scale heights above its base it is one part in 10^13.
pub const SCALE_HEIGHTS: f64 = 30.0;
/// The contrast at which dark things vanish in haze, as an optical depth: ln 50 (Koschmieder 1924).
pub const VISIBLE: f64 = 3.912;

impl AirLayer {
    /// Extinction at the base, 1/m, RGB.
    pub fn sigma_t(&self) -> [f64; 3] {
        std::array::from_fn(|c| self.sigma_s[c] + self.sigma_a[c])
    }

    /// The optical depth straight up through the whole, RGB.
    pub fn depth(&self) -> [f64; 3] {
        let height = (self.top - self.base).max(0.0);
        let column = self.scale_height.map_or(height, |h| -h * (-height / h).exp_m1());
        self.sigma_t().map(|sigma| sigma * column)
    }

    /// The molecules of air, thinning over 8 km from a height of `base` metres upward.
    pub fn molecules(base: f64) -> Self {
        let top = base + SCALE_HEIGHTS * RAYLEIGH_HEIGHT;
        let scattering = Scattering::Rayleigh;
        AirLayer { sigma_s: RAYLEIGH, sigma_a: [0.0; 3], scattering, base, top, scale_height: Some(RAYLEIGH_HEIGHT) }
    }

    /// Aerosol, thinning over 1.2 km: that of a clear day, or so much that dark things are seen from `visibility` metres at `base`.
    pub fn aerosol(base: f64, visibility: Option<f64>) -> Self {
        let sigma_t = visibility.map_or(AEROSOL / AEROSOL_ALBEDO, |v| (VISIBLE / v - RAYLEIGH[1]).max(0.0));
        let (sigma_s, sigma_a) = ([sigma_t * AEROSOL_ALBEDO; 3], [sigma_t * (1.0 - AEROSOL_ALBEDO); 3]);
        let scattering = Scattering::HenyeyGreenstein(AEROSOL_G);
        AirLayer { sigma_s, sigma_a, scattering, base, top: base + SCALE_HEIGHTS * AEROSOL_HEIGHT, scale_height: Some(AEROSOL_HEIGHT) }
    }

    /// The layer in other colours, coefficient by coefficient.
    pub fn coloured(self, of: impl Fn([f64; 3]) -> [f64; 3]) -> Self {
        AirLayer { sigma_s: of(self.sigma_s), sigma_a: of(self.sigma_a), ..self }
    }
}

impl Air {
    /// Air of some layers, of which [`MOST_LAYERS`] count.
    pub fn new(layers: impl IntoIterator<Item = AirLayer>) -> Self {
        let mut layers = layers.into_iter().filter(|layer| layer.depth().iter().any(|&d| d > 0.0));
        Air(std::array::from_fn(|_| layers.next()))
    }

    /// Clean air with the aerosol of a clear day, or with that of the `visibility` in metres, from a height of `base` metres upward.
    pub fn clear(base: f64, visibility: Option<f64>) -> Self {
        Air::new([AirLayer::molecules(base), AirLayer::aerosol(base, visibility)])
    }

    /// Its layers.
    pub fn layers(&self) -> impl Iterator<Item = &AirLayer> {
        self.0.iter().flatten()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.layers().next().is_none()
    }

    /// The optical depth straight up through all of it, RGB.
    pub fn depth(&self) -> [f64; 3] {
        self.layers().fold([0.0; 3], |sum, layer| std::array::from_fn(|c| sum[c] + layer.depth()[c]))
    }

    /// Whether the three channels are the same.
    pub fn is_grey(&self) -> bool {
        let same = |c: [f64; 3]| c[0] == c[1] && c[1] == c[2];
        self.layers().all(|layer| same(layer.sigma_s) && same(layer.sigma_a))
    }

    /// The air in other colours.
    pub fn coloured(&self, of: impl Fn([f64; 3]) -> [f64; 3]) -> Self {
        Air(self.0.map(|layer| layer.map(|layer| layer.coloured(&of))))
    }
}

impl serde::Serialize for Air {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.layers())
    }
}

impl Scattering {
    /// The phase function's value in 1/sr, at the cosine given as 1 - cos(theta).
    pub fn value(&self, one_minus_cos: f64) -> f64 {
        match *self {
            Scattering::Rayleigh => 3.0 / (16.0 * PI) * (1.0 + (1.0 - one_minus_cos).powi(2)),
            Scattering::HenyeyGreenstein(g) => super::phase::henyey_greenstein(g, one_minus_cos),
        }
    }

    /// (cos, sin) of a scattering angle distributed as [`Scattering::value`], by xi in [0, 1).
    pub fn sample(&self, xi: f64) -> (f64, f64) {
        match *self {
            Scattering::Rayleigh => {
                // The root of cos^3 + 3 cos = 8 xi - 4 (Frisvad 2011): the two terms never cancel, as the larger is taken first.
                let half = 4.0 * xi - 2.0;
                let large = (half.abs() + (half * half + 1.0).sqrt()).cbrt();
                let cos = ((large - 1.0 / large).copysign(half)).clamp(-1.0, 1.0);
                (cos, ((1.0 - cos) * (1.0 + cos)).max(0.0).sqrt())
            }
            Scattering::HenyeyGreenstein(g) => super::phase::sample_henyey_greenstein(g, xi),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Where the sampler puts the share xi of its angles, the integral of the phase function has come to xi.
    #[test]
    fn molecules_scatter_as_sampled() {
        let integral = |cos: f64| {
            let steps = 20_000;
            let width = (cos + 1.0) / f64::from(steps);
            let at = |i: i32| Scattering::Rayleigh.value(2.0 - width * (f64::from(i) + 0.5));
            (0..steps).map(at).sum::<f64>() * width * 2.0 * PI
        };
        for xi in [0.0, 1e-12, 0.01, 0.3, 0.5, 0.5 + 1e-9, 0.77, 0.999, 1.0 - 1e-12] {
            let (cos, sin) = Scattering::Rayleigh.sample(xi);
            assert!((integral(cos) - xi).abs() < 1e-8, "xi = {xi}: {cos}");
            assert!((cos * cos + sin * sin - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_clear_day_is_as_deep_as_it_is() {
        let depth = Air::clear(0.0, None).depth();
        // Bruneton and Neyret's coefficients times their scale heights.
        assert!((depth[1] - (13.5e-6 * 8000.0 + 4.0e-6 / 0.9 * 1200.0)).abs() < 1e-9);
        // 20 km of sight: 3.912 optical depths along it at the base, molecules included.
        let hazy = Air::clear(100.0, Some(20_000.0));
        let sum: f64 = hazy.layers().map(|layer| layer.sigma_t()[1]).sum();
        assert!((sum * 20_000.0 - 3.912).abs() < 1e-9);
        assert!(Air::default().is_empty() && !hazy.is_grey());
    }
}
