//! Media as files spell them: presets, coefficients, and what is left to the default.

use super::extras::Fields;
use crate::{Result, scene::Medium};

/// What one place (a node, a material, the scene) says about a medium. Each field may be missing.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct MediumSpec {
    preset: Option<Medium>,
    sigma_s: Option<[f64; 3]>,
    sigma_a: Option<[f64; 3]>,
    sigma_t: Option<[f64; 3]>,
    albedo: Option<[f64; 3]>,
    g: Option<f64>,
    shining: Shining,
}

/// How a medium shines by itself.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Shining {
    /// The emission coefficient, W m^-3 sr^-1.
    pub emission: Option<[f64; 3]>,
    /// K.
    pub temperature: Option<f64>,
    /// The absorption coefficient of what glows by its temperature, 1/m, where it is not the medium's own.
    pub soot: Option<f64>,
}

impl Shining {
    /// Whether it does.
    pub fn shines(&self) -> bool {
        self.emission.is_some() || self.temperature.is_some()
    }

    /// What another place says, over this.
    fn under(&self, nearer: &Shining) -> Shining {
        Shining {
            emission: nearer.emission.or(self.emission),
            temperature: nearer.temperature.or(self.temperature),
            soot: nearer.soot.or(self.soot),
        }
    }
}

/// A medium whose extinction may still be open.
#[derive(Debug, Clone, Copy)]
pub(super) struct Filling {
    sigma: Option<([f64; 3], [f64; 3])>,
    albedo: [f64; 3],
    g: f64,
    shining: Shining,
}

/// The albedo of a region about which nothing is said: cumulus.
pub(super) const ALBEDO: f64 = 0.9999;
/// Its mean cosine.
pub(super) const G: f64 = 0.86;
/// The optical depth across the largest region whose extinction nobody gave.
pub(super) const DEPTH: f64 = 40.0;

impl MediumSpec {
    /// What a VDB's metadata says: the extinction of a sample of 1, the albedo, the mean cosine.
    pub fn known(sigma_t: Option<f64>, albedo: Option<f64>, g: Option<f64>) -> MediumSpec {
        MediumSpec { sigma_t: sigma_t.map(|t| [t; 3]), albedo: albedo.map(|a| [a; 3]), g, ..MediumSpec::default() }
    }

    pub fn is_empty(&self) -> bool {
        *self == MediumSpec::default()
    }

    /// Reads the fields of a medium.
    pub fn read(fields: &Fields) -> Result<MediumSpec> {
        let preset = match fields.text("preset")? {
            Some(name) => {
                let expected = || format!("one of {}", Medium::PRESETS.join(", "));
                Some(Medium::preset(name).ok_or_else(|| fields.wrong("preset", format!("{name:?}"), expected()))?)
            }
            None => None,
        };
        let coefficient = |key: &str| -> Result<Option<[f64; 3]>> {
            let rgb = fields.rgb(key)?;
            rgb.iter().flatten().try_for_each(|&v| fields.at_least_zero(key, v).map(drop))?;
            Ok(rgb)
        };
        let (sigma_s, sigma_a, sigma_t) = (coefficient("sigma_s")?, coefficient("sigma_a")?, coefficient("sigma_t")?);
        let albedo = coefficient("albedo")?;
        if let Some(&bad) = albedo.iter().flatten().find(|&&v| v > 1.0) {
            return Err(fields.wrong("albedo", bad.to_string(), "a number from 0 to 1".into()));
        }
        if (sigma_s.is_some() || sigma_a.is_some()) && (sigma_t.is_some() || albedo.is_some()) {
            let key = if sigma_t.is_some() { "sigma_t" } else { "albedo" };
            return Err(fields.wrong(key, "beside sigma_s or sigma_a".into(), "either sigma_s and sigma_a, or sigma_t and albedo".into()));
        }
        let g = fields.number("g")?;
        if let Some(bad) = g.filter(|g| g.abs() >= 1.0) {
            return Err(fields.wrong("g", bad.to_string(), "a number between -1 and 1, both excluded".into()));
        }
        let below_zero = |key: &str| fields.number(key)?.map(|v| fields.at_least_zero(key, v)).transpose();
        let shining = Shining { emission: coefficient("emission")?, temperature: below_zero("temperature")?, soot: below_zero("soot")? };
        Ok(MediumSpec { preset, sigma_s, sigma_a, sigma_t, albedo, g, shining })
    }
}

impl Filling {
    /// What the places say, the farthest (the scene) first: each overrides what those before it said.
    pub fn new(places: &[MediumSpec]) -> Filling {
        let mut filling = Filling { sigma: None, albedo: [ALBEDO; 3], g: G, shining: Shining::default() };
        places.iter().for_each(|place| filling.apply(place));
        filling
    }

    /// The medium, where its extinction is known.
    pub fn medium(&self) -> Option<Medium> {
        self.sigma.map(|(sigma_s, sigma_a)| Medium { sigma_s, sigma_a, g: self.g })
    }

    /// How it shines.
    pub fn shining(&self) -> Shining {
        self.shining
    }

    fn apply(&mut self, spec: &MediumSpec) {
        if let Some(medium) = spec.preset {
            self.sigma = Some((medium.sigma_s, medium.sigma_a));
            self.g = medium.g;
        }
        if spec.sigma_s.is_some() || spec.sigma_a.is_some() {
            let (s, a) = self.sigma.unwrap_or_default();
            self.sigma = Some((spec.sigma_s.unwrap_or(s), spec.sigma_a.unwrap_or(a)));
        }
        if spec.sigma_t.is_some() || spec.albedo.is_some() {
            if let Some((s, a)) = self.sigma {
                self.albedo = zip(s, a, |s, a| if s + a > 0.0 { s / (s + a) } else { ALBEDO });
            }
            self.albedo = spec.albedo.unwrap_or(self.albedo);
            self.sigma = spec.sigma_t.or(self.sigma.map(|(s, a)| zip(s, a, |s, a| s + a))).map(|t| split(t, self.albedo));
        }
        self.g = spec.g.unwrap_or(self.g);
        self.shining = self.shining.under(&spec.shining);
    }
}

fn zip(a: [f64; 3], b: [f64; 3], f: impl Fn(f64, f64) -> f64) -> [f64; 3] {
    let ([a0, a1, a2], [b0, b1, b2]) = (a, b);
    [f(a0, b0), f(a1, b1), f(a2, b2)]
}

fn split(sigma_t: [f64; 3], albedo: [f64; 3]) -> ([f64; 3], [f64; 3]) {
    (zip(sigma_t, albedo, |t, w| t * w), zip(sigma_t, albedo, |t, w| t * (1.0 - w)))
}

/// The medium of each region, given its name and thickness (m); where extinction is open, such that the largest of those has
/// optical depth 40 across. Where `overridden`, another extinction follows, and there is nothing to say about this one.
pub(super) fn fill(regions: &[(&str, f64)], fillings: &[Filling], overridden: bool, notes: &mut Vec<String>) -> Vec<Medium> {
    let open = || regions.iter().zip(fillings).filter(|(_, filling)| filling.sigma.is_none()).map(|(region, _)| region);
    let mut sigma_t = 0.0;
    if let Some(&(name, thickness)) = open().reduce(|a, b| if b.1 > a.1 { b } else { a }) {
        sigma_t = DEPTH / thickness;
        let note = format!(
            "No extinction is given for {} of {} regions: sigma_t is {sigma_t:.6} per metre, such that the largest of them, {name:?} \
             ({thickness:.6} m), has optical depth {DEPTH} across (albedo {ALBEDO} and g {G} unless said). \
             Say otherwise with a preset or sigma_s and sigma_a in extras.cloudvdb of the node, its material or the scene.",
            open().count(),
            regions.len()
        );
        notes.extend((!overridden).then_some(note));
    }
    let one = |((name, _), filling): (&(&str, f64), &Filling)| {
        let (sigma_s, sigma_a) = filling.sigma.unwrap_or_else(|| split([sigma_t; 3], filling.albedo));
        let medium = Medium { sigma_s, sigma_a, g: filling.g };
        if medium.sigma_t() == 0.0 && !overridden && !filling.shining.shines() {
            notes.push(format!("Region {name:?} has no extinction: it changes nothing."));
        }
        medium
    };
    regions.iter().zip(fillings).map(one).collect()
}
