//! Which effects a scene calls for: decided once, with the reason, the figure, and a bound on what leaving one out changes. Nobody
//! decides again later: what is off is taken out of the scene ([`Plan::scene`]), or asked of the plan ([`Plan::on`]).

use crate::scene::medium::luminance;
use crate::scene::{Air, Medium, Region, Scene, Sun, Surface, Wishes};
use serde::Serialize;
use std::borrow::Cow;
use std::sync::Arc;

pub use crate::scene::effect::EffectName;

mod rules;

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
    /// An upper bound on what leaving it out changes, as a share of the light that comes from what it concerns (regions; surfaces,
    /// where it is shadows on them); 0 where there is nothing to leave out, 1 where all may change.
    pub bound: f64,
}

/// All effects of a scene.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Plan {
    /// In the order of [`EffectName`].
    pub effects: Vec<Effect>,
    /// Collisions with regions after which a path ends, where later ones change less than the tolerance.
    pub orders: Option<u32>,
    /// What may be left out.
    pub tolerance: f64,
}

/// What a rule finds in a scene.
struct Finding {
    /// Whether there is any of it.
    there: bool,
    figure: f64,
    bound: f64,
    reason: String,
}

impl Plan {
    /// Looks at the scene once. What the duality makes of it is not known yet: for [`Density::Duality`] nothing is left out that its
    /// photons meet.
    pub fn for_scene(scene: &Scene, density: Density) -> Plan {
        let wishes = scene.wishes;
        // Half of what may be left out is for orders of scattering that are cut off.
        let (multiple, orders) = rules::multiple_scattering(scene, 0.5 * wishes.tolerance);
        let found = [
            (EffectName::MultipleScattering, multiple),
            (EffectName::Absorption, rules::absorption(scene)),
            (EffectName::Anisotropy, rules::anisotropy(scene)),
            (EffectName::Heterogeneity, rules::heterogeneity(scene)),
            (EffectName::Overlap, rules::overlap(scene)),
            (EffectName::SunDisc, rules::sun_disc(scene)),
            (EffectName::Sky, rules::sky(scene)),
            (EffectName::SurfaceShadow, rules::surface_shadow(scene)),
            (EffectName::CloudShadow, rules::cloud_shadow(scene)),
            (EffectName::CloudLight, rules::cloud_light(scene)),
            (EffectName::SurfaceBounce, rules::surface_bounce(scene)),
            (EffectName::Air, rules::air(scene)),
            (EffectName::Emission, rules::emission(scene)),
            (EffectName::Colour, rules::colour(scene)),
            (EffectName::Duality, rules::duality(scene, density)),
        ];
        let mut effects: Vec<Effect> = found.into_iter().map(|(name, found)| decide(name, found, scene, density)).collect();
        limit(&mut effects, &wishes, if orders.is_some_and(|orders| orders > 1) { 0.5 } else { 1.0 } * wishes.tolerance);
        let multiple = effects.iter().any(|e| e.name == EffectName::MultipleScattering && e.on);
        let forced = wishes.forced(EffectName::MultipleScattering) == Some(true);
        let orders = match density {
            Density::Duality => None,
            Density::Source if !multiple => Some(1),
            Density::Source => orders.filter(|_| !forced),
        };
        Plan { effects, orders, tolerance: wishes.tolerance }
    }

    /// Whether an effect is simulated.
    pub fn on(&self, name: EffectName) -> bool {
        self.effects.iter().any(|e| e.name == name && e.on)
    }

    /// Whether an effect is there and is left out.
    fn without(&self, name: EffectName) -> bool {
        self.effects.iter().any(|e| e.name == name && !e.on && e.bound > 0.0)
    }

    /// The scene without what is left out, for those who follow light.
    pub fn scene<'a>(&self, scene: &'a Scene) -> Cow<'a, Scene> {
        use EffectName::{Absorption, Air as AirEffect, Anisotropy, Colour, Emission, Sky, SunDisc};
        if ![Absorption, AirEffect, Anisotropy, Colour, Emission, Sky, SunDisc].into_iter().any(|name| self.without(name)) {
            return Cow::Borrowed(scene);
        }
        let grey = |rgb: [f64; 3]| if self.without(Colour) { [luminance(rgb); 3] } else { rgb };
        let medium = |m: Medium| {
            let (sigma_s, sigma_a) = (grey(m.sigma_s), grey(m.sigma_a));
            let white = self.without(Absorption);
            Medium {
                sigma_s: if white { std::array::from_fn(|c| sigma_s[c] + sigma_a[c]) } else { sigma_s },
                sigma_a: if white { [0.0; 3] } else { sigma_a },
                g: if self.without(Anisotropy) { 0.0 } else { m.g },
            }
        };
        let angular_diameter = if self.without(SunDisc) { 0.0 } else { scene.sun.angular_diameter };
        Cow::Owned(Scene {
            regions: scene.regions.iter().map(|r| Region { medium: medium(r.medium), ..r.clone() }).collect(),
            surfaces: scene.surfaces.iter().map(|s| Surface { albedo: grey(s.albedo), ..s.clone() }).collect(),
            sun: Sun { irradiance: grey(scene.sun.irradiance), angular_diameter, ..scene.sun },
            lamps: scene.lamps.iter().map(|lamp| lamp.coloured(grey)).collect(),
            flames: if self.without(Emission) { vec![] } else { scene.flames.iter().map(|flame| flame.coloured(grey)).collect() },
            sky: if self.without(Sky) { [0.0; 3] } else { grey(scene.sky) },
            dome: scene.dome.as_ref().filter(|_| !self.without(Sky)).and_then(|dome| dome.coloured(grey)).map(Arc::new),
            air: if self.without(AirEffect) { Air::default() } else { scene.air.coloured(grey) },
            camera: scene.camera,
            wishes: scene.wishes,
        })
    }
}

/// Turns effects on again, the largest first, until what all that are off without a wish may change is within `most` together.
fn limit(effects: &mut [Effect], wishes: &Wishes, most: f64) {
    let wished = |e: &Effect| wishes.forced(e.name).is_some();
    let mut off: Vec<&mut Effect> = effects.iter_mut().filter(|e| !e.on && e.bound > 0.0 && !wished(e)).collect();
    off.sort_by(|a, b| a.bound.total_cmp(&b.bound));
    let mut sum = 0.0;
    for effect in off {
        sum += effect.bound;
        if sum > most {
            effect.on = true;
            effect.reason = effect.reason.replace(LESS, "; with what else is left out it would be more than the tolerance");
        }
    }
}

/// How the reason of an effect ends that changes too little.
const LESS: &str = "; less than the tolerance";

/// On where there is any of it and it changes more than the tolerance, or where the user says so.
fn decide(name: EffectName, found: Finding, scene: &Scene, density: Density) -> Effect {
    let Finding { there, figure, bound, mut reason } = found;
    // Photons that are counted, not weighed, decide where the duality's regions are.
    let kept = density == Density::Duality && matches!(name, EffectName::MultipleScattering | EffectName::SurfaceBounce);
    let wish = scene.wishes.forced(name);
    let called_for = there && (bound > scene.wishes.tolerance || kept);
    let on = there && wish.unwrap_or(called_for);
    if there && !on {
        reason += if wish.is_some() { "; off by --effect" } else { LESS };
    } else if on && !called_for {
        reason += "; on by --effect";
    }
    Effect { name, on, reason, figure, bound: if there { bound } else { 0.0 } }
}

#[cfg(test)]
mod tests;
