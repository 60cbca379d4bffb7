//! The colour of photons. Where only their colours differ, light of all three channels goes the same ways: a photon's power is its luminance
//! where it started, and what it has in each channel rides along as a tint. What scatters or absorbs the channels differently changes the
//! tint, and never where the photon goes but by the strongest channel's share.

use super::trace::Tracer;
use crate::geom::Ray;
use crate::media::air::{Atmosphere, Spectrum};
use crate::scene::{Scene, medium::luminance};
use glam::{DVec3, Vec3};

/// The largest that a channel's share of a luminance can be: blue alone.
const VIVID: f64 = 1.0 / 0.0722;
/// The largest weight of a [`Spectrum`].
const HEAVY: f64 = 3.0;

/// The colours of a scene.
#[derive(Debug, Clone)]
pub(super) enum Colours {
    /// All light has one colour, this one of luminance 1, wherever it goes.
    Even(Vec3),
    /// Colours ride along.
    Riding(Tints),
}

/// What tints photons.
#[derive(Debug, Clone)]
pub(super) struct Tints {
    /// The sun's and the sky's colours, of luminance 1; the sky's where it has one alone.
    pub sun: Vec3,
    pub sky: Option<Vec3>,
    /// Of each surface, and of each region: the albedo over the strongest channel's.
    pub surfaces: Vec<Vec3>,
    pub regions: Vec<Vec3>,
    /// Of each region: the strongest channel's albedo.
    pub kept: Vec<f64>,
}

/// A photon's colour along a flight.
#[derive(Debug, Clone, Copy)]
pub struct Colour<'a> {
    pub(super) tint: Vec3,
    pub(super) spectrum: Spectrum,
    pub(super) air: &'a Atmosphere,
}

impl Colour<'_> {
    /// What the photon's power counts in each channel at a distance along its ray, m.
    #[inline]
    pub fn at(mut self, ray: &Ray, distance: f32) -> Vec3 {
        self.tint * self.spectrum.flown(self.air, ray, distance, None)
    }
}

impl Colours {
    /// Those of a scene whose regions' extinction is grey.
    pub fn of(scene: &Scene) -> Self {
        let same = |c: [f64; 3]| c[0] == c[1] && c[1] == c[2];
        let tint = |rgb: [f64; 3]| {
            let grey = luminance(rgb);
            if grey > 0.0 { DVec3::from_array(rgb) / grey } else { DVec3::ONE }
        };
        let (sun, sky) = (tint(scene.sun.irradiance), tint(scene.sky));
        let overcast = luminance(scene.sky) > 0.0;
        let one = scene.dome.as_ref().is_none_or(|dome| dome.has_one_colour());
        let lights = || scene.tints().chain(overcast.then_some(sky));
        let main = lights().next().unwrap_or(DVec3::ONE);
        let alike = one && lights().all(|light| (light - main).abs().max_element() <= 1e-9);
        let grey = scene.regions.iter().all(|r| r.medium.is_grey()) && scene.surfaces.iter().all(|s| same(s.albedo)) && scene.air.is_grey();
        let (sun, sky) = (sun.as_vec3(), sky.as_vec3());
        if alike && grey {
            return Colours::Even(main.as_vec3());
        }
        let share = |rgb: [f64; 3]| {
            let strongest = rgb.into_iter().fold(0.0, f64::max);
            if strongest > 0.0 { (DVec3::from_array(rgb) / strongest).as_vec3() } else { Vec3::ONE }
        };
        let albedo = |r: &crate::scene::Region| r.medium.albedo_rgb();
        Colours::Riding(Tints {
            sun,
            sky: one.then_some(sky),
            surfaces: scene.surfaces.iter().map(|s| share(s.albedo)).collect(),
            regions: scene.regions.iter().map(|r| share(albedo(r))).collect(),
            kept: scene.regions.iter().map(|r| albedo(r).into_iter().fold(0.0, f64::max)).collect(),
        })
    }

    /// About the most that a photon's power may count in a channel.
    pub fn most(&self) -> f64 {
        if matches!(self, Colours::Even(_)) { 1.0 } else { VIVID * HEAVY }
    }
}

impl Tracer {
    /// The tracer of photons in colour; the scene is the one that it was made for, and the extinction of its regions is grey.
    pub fn in_colour(mut self, scene: &Scene) -> Self {
        self.colours = Colours::of(scene);
        if self.tints().is_some() {
            for (albedo, surface) in self.albedos.iter_mut().zip(&scene.surfaces) {
                *albedo = if *albedo > 0.0 { surface.albedo.into_iter().fold(0.0, f64::max).min(1.0) } else { 0.0 };
            }
        }
        self
    }

    /// What tints photons, where colours ride along.
    #[inline]
    pub(super) fn tints(&self) -> Option<&Tints> {
        if let Colours::Riding(tints) = &self.colours { Some(tints) } else { None }
    }

    /// What a surface does to the colour of a photon that it reflects.
    pub(super) fn surface_tint(&self, owner: u32) -> Vec3 {
        self.tints().map_or(Vec3::ONE, |tints| tints.surfaces[owner as usize])
    }
}
