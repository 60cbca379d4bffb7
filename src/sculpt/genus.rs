//! The kinds of clouds, and what makes each.

use glam::DVec3;

/// The kinds of clouds whose detail is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Genus {
    /// Cumulus humilis: small heaps with flat bases.
    Humilis,
    /// Cumulus congestus: towers like cauliflowers.
    Congestus,
    /// A deck of rolls and lumps with few gaps.
    Stratocumulus,
    /// Cloudlets side by side, with gaps.
    Altocumulus,
    /// Wisps along the wind, which blows along x.
    Cirrus,
}

impl Genus {
    /// All, with the names that files and flags know them by.
    pub const NAMES: [(&str, Genus); 5] = [
        ("humilis", Genus::Humilis),
        ("congestus", Genus::Congestus),
        ("stratocumulus", Genus::Stratocumulus),
        ("altocumulus", Genus::Altocumulus),
        ("cirrus", Genus::Cirrus),
    ];

    /// What makes it; lengths are in units of the detail's size.
    pub(super) fn look(self) -> Character {
        match self {
            Genus::Humilis => Character {
                form: Form::Bumps { jitter: 1.0, mean: 0.286 },
                amplitude: 0.45,
                gain: 0.55,
                bias: 0.0,
                stretch: DVec3::ONE,
                warp: 0.12,
                base: 0.35,
                edge: 0.06,
                contrast: 5.0,
                erosion: 0.35,
            },
            Genus::Congestus => Character {
                form: Form::Bumps { jitter: 1.0, mean: 0.286 },
                amplitude: 0.7,
                gain: 0.62,
                bias: 0.0,
                stretch: DVec3::ONE,
                warp: 0.1,
                base: 0.2,
                edge: 0.03,
                contrast: 8.0,
                erosion: 0.2,
            },
            Genus::Stratocumulus => Character {
                form: Form::Bumps { jitter: 0.9, mean: 0.280 },
                amplitude: 1.1,
                gain: 0.45,
                bias: -0.3,
                stretch: DVec3::new(2.0, 1.0, 1.3),
                warp: 0.15,
                base: 0.0,
                edge: 0.12,
                contrast: 3.0,
                erosion: 0.5,
            },
            Genus::Altocumulus => Character {
                form: Form::Bumps { jitter: 0.7, mean: 0.268 },
                amplitude: 1.3,
                gain: 0.35,
                bias: -0.6,
                stretch: DVec3::new(1.3, 1.0, 1.5),
                warp: 0.1,
                base: 0.0,
                edge: 0.15,
                contrast: 3.0,
                erosion: 0.5,
            },
            Genus::Cirrus => Character {
                form: Form::Fibres,
                amplitude: 0.35,
                gain: 0.6,
                bias: -0.05,
                stretch: DVec3::new(6.0, 1.2, 0.6),
                warp: 0.5,
                base: 0.0,
                edge: 1.0,
                contrast: 1.0,
                erosion: 0.9,
            },
        }
    }
}

/// How a kind of cloud is detailed, at strength 1; lengths in units of the detail's size.
#[derive(Debug, Clone, Copy)]
pub(super) struct Character {
    pub form: Form,
    /// How far the largest octave moves the boundary, from its mean to its farthest.
    pub amplitude: f64,
    /// The amplitude of each octave over that of the one before it, which is twice as large.
    pub gain: f64,
    /// The mean displacement: below 0 where gaps should open.
    pub bias: f64,
    /// How much longer noise is along each axis.
    pub stretch: DVec3,
    /// How far points are swirled before noise is looked up.
    pub warp: f64,
    /// What is cut off at the bottom, flat.
    pub base: f64,
    /// Over which depth density rises to its full value where a shape has none of its own.
    pub edge: f64,
    /// By how much the rise of a metaball's density is steepened.
    pub contrast: f64,
    /// How much of a thin edge is eaten: 1 leaves nothing where the noise is strongest.
    pub erosion: f64,
}

#[derive(Debug, Clone, Copy)]
pub(super) enum Form {
    /// Cellular noise: rounded outside, creased between; `jitter` 0 would be a lattice of bumps. The mean is that of the squared
    /// distance to the nearest point, which displacement is counted from; it depends on the jitter.
    Bumps { jitter: f32, mean: f64 },
    /// Ridges of gradient noise.
    Fibres,
}
