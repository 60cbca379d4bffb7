//! Homogeneous media: coefficients, presets.

/// A homogeneous participating medium. Coefficients are per metre; RGB.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Medium {
    /// Scattering coefficient sigma_s, 1/m.
    pub sigma_s: [f64; 3],
    /// Absorption coefficient sigma_a, 1/m.
    pub sigma_a: [f64; 3],
    /// Mean cosine of the Henyey-Greenstein phase function, in (-1, 1); forward is positive.
    pub g: f64,
}

/// Jensen, Marschner, Levoy and Hanrahan (2001), table 1, per millimetre: the reduced scattering coefficient and the absorption coefficient of
/// red, green and blue light. Of two kinds of skin and of chicken, the first.
const MEASURED: [(&str, [f64; 3], [f64; 3]); 9] = [
    ("milk", [2.55, 3.21, 3.77], [0.0011, 0.0024, 0.014]),
    ("skim_milk", [0.70, 1.22, 1.90], [0.0014, 0.0025, 0.0142]),
    ("cream", [7.38, 5.47, 3.15], [0.0002, 0.0028, 0.0163]),
    ("skin", [0.74, 0.88, 1.01], [0.032, 0.17, 0.48]),
    ("marble", [2.19, 2.62, 3.00], [0.0021, 0.0041, 0.0071]),
    ("apple", [2.29, 2.39, 1.97], [0.0030, 0.0034, 0.046]),
    ("potato", [0.68, 0.70, 0.55], [0.0024, 0.0090, 0.12]),
    ("chicken", [0.15, 0.21, 0.38], [0.015, 0.077, 0.19]),
    ("ketchup", [0.18, 0.07, 0.03], [0.061, 0.97, 1.45]),
];

/// The luminance of linear RGB (Rec. 709 primaries): how a colour becomes one number for grey transport.
pub fn luminance(rgb: [f64; 3]) -> f64 {
    // Written so that a grey colour gives back exactly its own value.
    rgb[1] + 0.2126 * (rgb[0] - rgb[1]) + 0.0722 * (rgb[2] - rgb[1])
}

impl Medium {
    /// A grey medium from its scattering and absorption coefficients in 1/m and its mean cosine.
    pub fn grey(sigma_s: f64, sigma_a: f64, g: f64) -> Self {
        Medium { sigma_s: [sigma_s; 3], sigma_a: [sigma_a; 3], g }
    }

    /// A grey medium from its extinction in 1/m, its single-scattering albedo and its mean cosine.
    pub fn with_albedo(sigma_t: f64, albedo: f64, g: f64) -> Self {
        Medium::grey(sigma_t * albedo, sigma_t * (1.0 - albedo), g)
    }

    /// A preset by its name, one of [`Medium::PRESETS`].
    ///
    /// Clouds of water: albedo 0.9999 and g 0.86 in the visible, sigma_t 10 to 120 per km at effective radii of
    /// 5 to 15 um. `hura2006` is the thesis's table 2. Translucent solids and liquids are those of [`MEASURED`]: per metre, with g 0, because
    /// what was measured is scattering reduced by its mean cosine, sigma_s (1 - g).
    pub fn preset(name: &str) -> Option<Self> {
        Some(match name {
            "cumulus" => Medium::with_albedo(0.06, 0.9999, 0.86),
            "stratus" => Medium::with_albedo(0.03, 0.9999, 0.85),
            "cirrus" => Medium::with_albedo(0.0005, 0.9999, 0.77),
            "haze" => Medium::with_albedo(0.0002, 0.95, 0.7),
            "smoke" => Medium::with_albedo(1.0, 0.6, 0.5),
            "hura2006" => Medium::grey(0.8, 0.2, 0.9),
            _ => {
                let (_, reduced, sigma_a) = MEASURED.into_iter().find(|(known, ..)| *known == name)?;
                Medium { sigma_s: reduced.map(|s| 1e3 * s), sigma_a: sigma_a.map(|a| 1e3 * a), g: 0.0 }
            }
        })
    }

    /// The names that [`Medium::preset`] knows.
    pub const PRESETS: [&str; 15] = [
        "cumulus",
        "stratus",
        "cirrus",
        "haze",
        "smoke",
        "hura2006",
        "milk",
        "skim_milk",
        "cream",
        "skin",
        "marble",
        "apple",
        "potato",
        "chicken",
        "ketchup",
    ];

    /// Extinction as one number, 1/m: the luminance of sigma_s + sigma_a.
    pub fn sigma_t(&self) -> f64 {
        luminance(self.sigma_s) + luminance(self.sigma_a)
    }

    /// Single-scattering albedo as one number: sigma_s / sigma_t; 0 in a medium without extinction.
    pub fn albedo(&self) -> f64 {
        let sigma_t = self.sigma_t();
        if sigma_t > 0.0 { luminance(self.sigma_s) / sigma_t } else { 0.0 }
    }

    /// Extinction by channel, 1/m.
    pub fn sigma_t_rgb(&self) -> [f64; 3] {
        std::array::from_fn(|c| self.sigma_s[c] + self.sigma_a[c])
    }

    /// Single-scattering albedo by channel; 0 where there is no extinction.
    pub fn albedo_rgb(&self) -> [f64; 3] {
        std::array::from_fn(|c| if self.sigma_s[c] > 0.0 { self.sigma_s[c] / (self.sigma_s[c] + self.sigma_a[c]) } else { 0.0 })
    }

    /// What one channel alone sees of it (0 red, 1 green, 2 blue): a grey medium.
    pub fn channel(&self, c: usize) -> Self {
        Medium::grey(self.sigma_s[c], self.sigma_a[c], self.g)
    }

    /// Whether the three channels are the same.
    pub fn is_grey(&self) -> bool {
        let same = |c: [f64; 3]| c[0] == c[1] && c[1] == c[2];
        same(self.sigma_s) && same(self.sigma_a)
    }
}
