//! Turbulent detail as it is asked for: its kind, size and strength.

use super::genus::Genus;

/// The detail of a cloud.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Detail {
    /// The kind of cloud.
    pub genus: Genus,
    /// How much of it: 0 is the smooth cloud, 1 the genus as it is known.
    pub strength: f64,
    /// The size of the largest bumps, m.
    pub size: f64,
    /// Octaves of noise, 1 to 12; each halves the size.
    pub octaves: u32,
    /// Another seed, another cloud of the same kind.
    pub seed: u32,
}

/// The most octaves.
pub const MOST_OCTAVES: u32 = 12;
/// The largest strength: beyond it a cloud is all noise.
pub const MOST_STRENGTH: f64 = 4.0;

/// Detail as users ask for it: what they leave out follows from the layout.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct DetailRequest {
    /// The kind of cloud.
    pub genus: Genus,
    /// As [`Detail::strength`].
    pub strength: f64,
    /// The size of the largest bumps, m; the mean radius of the parts where it is not said.
    pub size: Option<f64>,
    /// As [`Detail::octaves`].
    pub octaves: u32,
    /// As [`Detail::seed`].
    pub seed: u32,
}

impl DetailRequest {
    /// A kind of cloud at full strength, with five octaves.
    pub fn new(genus: Genus) -> Self {
        DetailRequest { genus, strength: 1.0, size: None, octaves: 5, seed: 0 }
    }

    /// The detail of parts whose mean radius is `radius`; `None` where there is none.
    pub fn settled(&self, radius: f64) -> Option<Detail> {
        let DetailRequest { genus, strength, octaves, seed, .. } = *self;
        (strength > 0.0).then(|| Detail { genus, strength, size: self.size.unwrap_or(radius), octaves, seed })
    }
}

impl Detail {
    /// The size of the smallest bumps, m.
    pub fn finest(&self) -> f64 {
        self.size / f64::from(1u32 << (self.octaves - 1))
    }
}
