//! The light of a cloud in its voxels: what absorbs and emits looks like what scatters.
//!
//! Beside `density` go grids of the source function ([`crate::integrate::SourceFunction`]): what the medium sends toward the camera, or
//! toward anyone, per unit of optical depth. Extinction times that is emission, and a volume that absorbs and emits shows all orders of
//! scattering without one bounce. The source function is kept apart from the density, and not multiplied into it, for it is smooth where
//! density is not: between samples both are trilinear, and so is neither's edge the other's.
//!
//! | bake | grids | toward `omega`, per unit of optical depth |
//! | --- | --- | --- |
//! | [`Bake::View`] | `light` | `light` |
//! | [`Bake::Isotropic`] | `light` | `light` |
//! | [`Bake::Sh1`], [`Bake::Sh2`] | `sunlight`, `glow`, `flow`, `flow_x` to `_z`, `light_0` to `light_3` or `_15` | `sunlight` p(g, c) + `glow` p(g^2, c) + `flow` p(h, d) + the sum of `light_i` Y_i(omega) |
//!
//! times the part's scale, W m^-2 sr^-1; c is the cosine between `omega` and the sun's light, p the Henyey-Greenstein function, d the
//! cosine between `omega` and the vector (`flow_x`, `flow_y`, `flow_z`), h its length over `flow` ([`Term::Flow`]), Y the real orthonormal
//! spherical harmonics of z up, in the order of degrees and of m. Where the sun's light and the sky's have different
//! colours, or the medium has one, each light has grids of its own: `light_sun` and `light_sky`, or `light_red` and so on.
//!
//! Light of lamps and flames is in these grids once it has scattered. What flames send out themselves is not: the file
//! has it in grids of its own, which whoever shows the bake adds.

use crate::error::Result;
use crate::integrate::{Kept, Light, Part, SourceFunction};
use crate::progress::Progress;
use crate::scene::{BrickGrid, Camera};
use glam::DAffine3;
use serde::Serialize;
use std::f64::consts::PI;

mod judge;
mod voxels;

pub use judge::{BakeError, Beside, judge};

/// What of the light's directions is baked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Bake {
    /// What goes toward the scene's camera.
    View,
    /// The mean over all directions.
    Isotropic,
    /// All directions: sunlight that scattered once by its phase function, the rest by lobes and harmonics up to degree 1.
    Sh1,
    /// The same up to degree 3: the lobes are for what harmonics of degree 2 leave out, and next to them those of degree 3 are worth most.
    Sh2,
}

impl Bake {
    /// What of the source function this asks for.
    pub fn kept(self, camera: &Camera) -> Kept {
        match self {
            Bake::View => Kept::Toward(camera.world_from_camera.translation),
            Bake::Isotropic => Kept::Around { degree: 0 },
            Bake::Sh1 => Kept::Around { degree: 1 },
            Bake::Sh2 => Kept::Around { degree: 3 },
        }
    }
}

/// What a grid holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Term {
    /// What goes toward the viewer, whatever the direction.
    Light,
    /// Sunlight that arrives and scatters: times the phase function.
    Sunlight,
    /// What has scattered twice, as a lobe about the sun's light: times the phase function of its own mean cosine, one of [`Baked::lobes`].
    Glow,
    /// What has scattered three or four times, as a lobe about its own flow: times the phase function whose mean cosine is the length of the
    /// flow over this, at most 0.9.
    Flow,
    /// That flow along x: the integral over all directions of what goes there times the direction.
    FlowX,
    /// Along y.
    FlowY,
    /// Along z.
    FlowZ,
    /// The coefficient of a spherical harmonic.
    Harmonic(usize),
}

/// A grid of light.
#[derive(Debug, Clone)]
pub struct LightGrid {
    /// Its name in the file.
    pub name: String,
    /// What it holds.
    pub term: Term,
    /// Of which of [`Baked::parts`].
    pub part: usize,
    /// The samples, in units of the part's scale.
    pub bricks: BrickGrid,
}

/// Baked light.
#[derive(Debug, Clone)]
pub struct Baked {
    /// What was asked for.
    pub bake: Bake,
    /// The lights.
    pub parts: Vec<Part>,
    /// The mean cosine of each part's lobe about the sun's light; 0 without one.
    pub lobes: Vec<f64>,
    /// The mean cosine of sunlight that scattered once.
    pub mean_cosine: f64,
    /// Photons that were followed.
    pub photons: u64,
    /// The grids.
    pub grids: Vec<LightGrid>,
}

impl Baked {
    /// Looks the light up for the voxels of `density`, whose world is turned from the scene's by `turned`.
    ///
    /// # Errors
    /// [`crate::Error::Interrupted`].
    pub fn new(
        bake: Bake,
        source: &SourceFunction,
        density: &BrickGrid,
        turned: Option<DAffine3>,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let parts: Vec<Part> = source.parts().copied().collect();
        let mut grids = Vec::new();
        progress.begin("bake", (density.origins.len() * parts.len()) as u64);
        for (part, Part { light, .. }) in parts.iter().enumerate() {
            let suffix = match light {
                Light::All => "",
                Light::Sun => "_sun",
                Light::Sky => "_sky",
                Light::Red => "_red",
                Light::Green => "_green",
                Light::Blue => "_blue",
            };
            let numbers = voxels::lit(source, part, density, turned, progress)?;
            let mut one = |name: &str, term: Term, bricks: Option<BrickGrid>| {
                grids.extend(bricks.map(|bricks| LightGrid { name: format!("{name}{suffix}"), term, part, bricks }));
            };
            match bake {
                Bake::View => one("light", Term::Light, numbers.grid(|n| n[0])),
                Bake::Isotropic => one("light", Term::Light, numbers.grid(isotropic)),
                Bake::Sh1 | Bake::Sh2 => {
                    one("sunlight", Term::Sunlight, numbers.grid(|n| n[0]));
                    one("glow", Term::Glow, numbers.grid(|n| n[1]));
                    one("flow", Term::Flow, numbers.grid(|n| n[2]));
                    for (i, (name, term)) in
                        [("flow_x", Term::FlowX), ("flow_y", Term::FlowY), ("flow_z", Term::FlowZ)].into_iter().enumerate()
                    {
                        one(name, term, numbers.grid(|n| n[3 + i]));
                    }
                    for i in 0..source.numbers() - 6 {
                        one(&format!("light_{i}"), Term::Harmonic(i), numbers.grid(|n| n[6 + i]));
                    }
                }
            }
        }
        let lobes = (0..parts.len()).map(|part| source.lobe(part)).collect();
        Ok(Baked { bake, parts, lobes, mean_cosine: source.mean_cosine(), photons: source.photons(), grids })
    }
}

/// The mean over all directions of sunlight and first harmonic; without directions there are no lobes.
fn isotropic(numbers: &[f32]) -> f32 {
    const MEAN: f64 = 1.0 / (4.0 * PI);
    (f64::from(numbers[0]) * MEAN + f64::from(numbers[6]) * MEAN.sqrt()) as f32
}
