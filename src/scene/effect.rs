//! The effects that can be simulated, and what a user wishes of them.

/// An effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum EffectName {
    /// Light that scatters more than once.
    MultipleScattering,
    /// Media that absorb.
    Absorption,
    /// A phase function that is not isotropic.
    Anisotropy,
    /// Extinction that varies within a region.
    Heterogeneity,
    /// Regions that overlap: extinction adds.
    Overlap,
    /// The sun's disc: soft edges of shadows.
    SunDisc,
    /// Light of the sky.
    Sky,
    /// Surfaces that shade the regions.
    SurfaceShadow,
    /// Regions that shade surfaces.
    CloudShadow,
    /// Light that regions send to surfaces.
    CloudLight,
    /// Light that surfaces send back to the regions.
    SurfaceBounce,
    /// Air around the clouds: haze, the sky's blue, sunbeams.
    Air,
    /// Media that shine by themselves.
    Emission,
    /// Media or light of more than one colour.
    Colour,
    /// The synthesis of regions (thesis 3.3.1).
    Duality,
}

impl EffectName {
    /// Those that a user may switch, with their names. Whether there are overlaps, variation and shadows of surfaces is the scene's matter;
    /// the duality is asked for by the density.
    pub const SWITCHES: [(&str, EffectName); 11] = [
        ("multiple_scattering", EffectName::MultipleScattering),
        ("absorption", EffectName::Absorption),
        ("anisotropy", EffectName::Anisotropy),
        ("sun_disc", EffectName::SunDisc),
        ("sky", EffectName::Sky),
        ("cloud_shadow", EffectName::CloudShadow),
        ("cloud_light", EffectName::CloudLight),
        ("surface_bounce", EffectName::SurfaceBounce),
        ("air", EffectName::Air),
        ("emission", EffectName::Emission),
        ("colour", EffectName::Colour),
    ];
}

/// What may be left out of a scene's light, where nobody says: less than noise shows.
const TOLERANCE: f64 = 1e-3;

/// What a user wishes of the effects of a scene.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Wishes {
    /// An effect that changes less than this share is left out.
    pub tolerance: f64,
    /// Of each of [`EffectName::SWITCHES`]: on or off whatever it changes.
    pub forced: [Option<bool>; EffectName::SWITCHES.len()],
}

impl Default for Wishes {
    fn default() -> Self {
        Wishes { tolerance: TOLERANCE, forced: [None; EffectName::SWITCHES.len()] }
    }
}

impl Wishes {
    /// Whether an effect is to be on or off, if anybody says so.
    pub fn forced(&self, name: EffectName) -> Option<bool> {
        EffectName::SWITCHES.iter().zip(self.forced).find(|((_, known), _)| *known == name).and_then(|(_, wish)| wish)
    }

    /// The same with one effect on, off, or as the scene calls for.
    pub fn with(mut self, name: EffectName, wish: Option<bool>) -> Self {
        for ((_, known), forced) in EffectName::SWITCHES.iter().zip(&mut self.forced) {
            if *known == name {
                *forced = wish;
            }
        }
        self
    }
}
