//! Which effects a scene calls for: decided once, with the reason and the figure. Nobody decides again later.

use crate::bvh::{Box3, Bvh};
use crate::scene::{Region, Scene};
use serde::Serialize;

/// Which medium is written, rendered and baked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Density {
    /// The regions that the duality synthesises.
    #[default]
    Duality,
    /// The layout as given.
    Source,
}

/// The effects that can be simulated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum EffectName {
    /// Light that scatters more than once.
    MultipleScattering,
    /// Media that absorb.
    Absorption,
    /// A phase function that is not isotropic.
    Anisotropy,
    /// Regions that overlap: extinction adds.
    Overlap,
    /// The sun's disc: soft edges of shadows.
    SunDisc,
    /// Surfaces that shade the regions.
    SurfaceShadow,
    /// Light that surfaces send back to the regions.
    SurfaceBounce,
    /// Air around the clouds: haze, the sky's blue, sunbeams.
    Air,
    /// Media or light of more than one colour.
    Colour,
    /// The synthesis of regions (thesis 3.3.1).
    Duality,
}

/// One effect: on or off, why, and what leaving it out would change at most.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Effect {
    /// Which.
    pub name: EffectName,
    /// Whether it is simulated.
    pub on: bool,
    /// The reason, with the figure that decided.
    pub reason: String,
    /// The figure.
    pub figure: f64,
    /// An upper bound on what leaving it out changes, as a share of the light that meets the regions; 0 where there is nothing to leave out.
    pub bound: f64,
}

/// All effects of a scene.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Plan {
    /// In the order of [`EffectName`].
    pub effects: Vec<Effect>,
}

/// Shadows blurred by less than this share of the smallest region cannot be told from sharp ones.
const PENUMBRA: f64 = 1e-3;

impl Plan {
    /// Looks at the scene once.
    pub fn for_scene(scene: &Scene, density: Density) -> Plan {
        let most = |f: fn(&Region) -> f64| scene.regions.iter().map(f).fold(0.0, f64::max);
        let tau = most(|r| r.medium.sigma_t() * r.shape.thickness());
        // The second order is at most the share of collided light that collides again: (1 - e^-tau)^2.
        let second = (-(-tau).exp_m1()).powi(2);
        let absorbed = most(|r| 1.0 - r.medium.albedo());
        let g = most(|r| r.medium.g.abs());
        let overlapping = overlapping(&scene.regions);
        let smallest = scene.regions.iter().map(|r| r.shape.smallest_half_extent()).fold(f64::INFINITY, f64::min);
        let blur = scene.sun.angular_diameter * scene.region_bounds().size().length() / smallest;
        let albedo = scene.surfaces.iter().map(|s| s.albedo.iter().copied().fold(0.0, f64::max)).fold(0.0, f64::max);
        let coloured = scene.regions.iter().filter(|r| !r.medium.is_grey()).count();
        let sun = scene.sun.irradiance;
        let coloured_sun = sun[0] != sun[1] || sun[1] != sun[2];
        let effects = vec![
            effect(
                EffectName::MultipleScattering,
                tau > 0.0,
                second,
                format!("the thickest region has optical depth {tau:.3}: at most {:.2} % of its light scatters twice", 100.0 * second),
                tau,
            ),
            effect(
                EffectName::Absorption,
                absorbed > 0.0,
                absorbed,
                if absorbed > 0.0 {
                    format!("the darkest medium absorbs {:.4} % at each collision", 100.0 * absorbed)
                } else {
                    "every albedo is 1: no photon needs a roulette".into()
                },
                absorbed,
            ),
            effect(
                EffectName::Anisotropy,
                g > 0.0,
                1.0,
                if g > 0.0 { format!("mean cosine up to {g:.3}") } else { "every medium scatters alike in all directions".into() },
                g,
            ),
            effect(
                EffectName::Overlap,
                overlapping > 0,
                1.0,
                if overlapping > 0 {
                    format!("{overlapping} of {} regions may overlap another: extinction adds", scene.regions.len())
                } else {
                    "no two regions' bounds meet".into()
                },
                overlapping as f64,
            ),
            effect(
                EffectName::SunDisc,
                blur > PENUMBRA,
                blur.min(1.0),
                format!(
                    "{:.4} rad blurs shadows by up to {:.3} % of the smallest region's half extent{}",
                    scene.sun.angular_diameter,
                    100.0 * blur,
                    if blur > PENUMBRA { "" } else { ", too little to see" }
                ),
                blur,
            ),
            effect(
                EffectName::SurfaceShadow,
                !scene.surfaces.is_empty(),
                1.0,
                match scene.surfaces.len() {
                    0 => "there is no surface".into(),
                    n => format!("{n} surfaces can stand in the light's way"),
                },
                scene.surfaces.len() as f64,
            ),
            effect(
                EffectName::SurfaceBounce,
                albedo > 0.0,
                albedo,
                if albedo > 0.0 {
                    format!("the brightest surface reflects {:.1} %", 100.0 * albedo)
                } else if scene.surfaces.is_empty() {
                    "there is no surface".into()
                } else {
                    "every surface is black".into()
                },
                albedo,
            ),
            air(scene),
            effect(
                EffectName::Colour,
                false,
                0.0,
                match (coloured, coloured_sun) {
                    (0, false) => "sun and media are grey: one number says all".into(),
                    _ => format!(
                        "{coloured} coloured media{}: the density does not depend on it, photons carry luminance",
                        if coloured_sun { " and a coloured sun" } else { "" }
                    ),
                },
                coloured as f64,
            ),
            effect(
                EffectName::Duality,
                density == Density::Duality,
                1.0,
                match density {
                    Density::Duality => format!("{} regions of the layout become photon-cloud regions", scene.regions.len()),
                    Density::Source => {
                        "this looks at the layout as it is (--density source): no region is made, and no photon traced for it".into()
                    }
                },
                scene.regions.len() as f64,
            ),
        ];
        Plan { effects }
    }

    /// Whether an effect is simulated.
    pub fn on(&self, name: EffectName) -> bool {
        self.effects.iter().any(|e| e.name == name && e.on)
    }
}

/// An effect that is off because there is nothing of it has nothing to leave out: only a measured share is kept then.
fn effect(name: EffectName, on: bool, bound: f64, reason: String, figure: f64) -> Effect {
    Effect { name, on, reason, figure, bound: if on || name == EffectName::SunDisc { bound } else { 0.0 } }
}

/// Air takes and gives at most what collides in it, along the longest way that the scene has in it.
fn air(scene: &Scene) -> Effect {
    let depth = scene.air.depth().into_iter().fold(0.0, f64::max);
    let reason = match scene.air.layers().count() {
        0 => "there is no air".into(),
        n => format!("{n} layers of air, of optical depth {depth:.3} straight up"),
    };
    effect(EffectName::Air, depth > 0.0, 1.0, reason, depth)
}

/// How many regions' bounds meet another's.
fn overlapping(regions: &[Region]) -> usize {
    if regions.iter().any(|r| r.shape.is_endless()) && regions.len() > 1 {
        return regions.len();
    }
    let origin = regions.first().map_or(glam::DVec3::ZERO, |r| r.shape.centre());
    let boxes: Vec<Box3> = regions.iter().map(|r| Box3::around(r.shape.bounds(), origin)).collect();
    let bvh = Bvh::new(&boxes.iter().copied().map(Some).collect::<Vec<_>>(), 2);
    (0..boxes.len())
        .filter(|&i| {
            let mut met = false;
            bvh.overlapping(&boxes[i], |other| {
                met |= other as usize != i && boxes[other as usize].meets(&boxes[i]);
                met
            });
            met
        })
        .count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Medium, Shape, Surface};
    use glam::DVec3;

    fn scene(second_at: f64) -> Scene {
        let sphere = |x: f64| Region {
            name: "s".into(),
            shape: Shape::sphere(DVec3::new(x, 0.0, 0.0), 1.0),
            medium: Medium::with_albedo(5.0, 1.0, 0.0),
            photons: None,
        };
        Scene { regions: vec![sphere(0.0), sphere(second_at)], ..Scene::default() }
    }

    /// Every effect has a scene on either side of its rule.
    #[test]
    fn each_effect_is_on_only_where_the_scene_calls_for_it() {
        let bare = Plan::for_scene(&scene(5.0), Density::Source);
        for name in [
            EffectName::Absorption,
            EffectName::Anisotropy,
            EffectName::Overlap,
            EffectName::SurfaceShadow,
            EffectName::SurfaceBounce,
            EffectName::Duality,
        ] {
            assert!(!bare.on(name), "{name:?}");
        }
        assert!(bare.on(EffectName::MultipleScattering) && bare.on(EffectName::SunDisc));
        let mut full = scene(1.5);
        full.regions[0].medium = Medium::with_albedo(5.0, 0.9, 0.8);
        full.surfaces = vec![Surface { name: "ground".into(), albedo: [0.3; 3], ..Surface::default() }];
        let full = Plan::for_scene(&full, Density::Duality);
        for name in [
            EffectName::Absorption,
            EffectName::Anisotropy,
            EffectName::Overlap,
            EffectName::SurfaceShadow,
            EffectName::SurfaceBounce,
            EffectName::Duality,
        ] {
            assert!(full.on(name), "{name:?}");
        }
        let mut sharp = scene(5.0);
        sharp.sun.angular_diameter = 1e-6;
        assert!(!Plan::for_scene(&sharp, Density::Source).on(EffectName::SunDisc));
        let mut black = scene(5.0);
        black.surfaces = vec![Surface::default()];
        let black = Plan::for_scene(&black, Density::Source);
        assert!(black.on(EffectName::SurfaceShadow) && !black.on(EffectName::SurfaceBounce));
    }
}
