//! From regions to a picture.

use crate::error::Result;
use crate::export::report::Render;
use crate::film::Film;
use crate::integrate::photon::{Gathering, PhotonSettings};
use crate::integrate::{Directional, Integrator, RenderSettings, Renderer};
use crate::photon::{Model, PhotonMap};
use crate::plan::{Density, Plan};
use crate::progress::Progress;
use crate::regions::Duality;
use crate::scene::{Framed, Region, Scene, View};
use std::borrow::Cow;
use std::time::Instant;

/// How pictures are taken.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Picture {
    /// How light is followed; where nobody says, by [`Integrator::Grid`] where it can, and else by [`Integrator::Path`].
    pub integrator: Option<Integrator>,
    /// Samples a pixel; [`Integrator::usual_spp`] where nobody says.
    pub spp: Option<u32>,
    /// The relative error of a pixel ([`Film::relative_error`]) to go on to, where one is asked for.
    pub error: Option<f64>,
    /// What the voxels of [`Integrator::Grid`] may take, bytes.
    pub memory: u64,
    /// What they keep of light's directions.
    pub directional: Directional,
    /// Where [`Integrator::Photon`] looks for photons.
    pub gather: Gathering,
    /// The optical depth of its march's first step.
    pub step: f64,
    /// Its looks at the sun from each point of a surface.
    pub shadow_rays: u32,
    /// By how many stops the preview is brightened.
    pub exposure: f64,
    /// The camera and the size, where they are not the scene's.
    pub view: View,
}

impl Default for Picture {
    fn default() -> Self {
        let PhotonSettings { gather, step, shadow_rays, memory, directional, .. } = PhotonSettings::default();
        Picture {
            integrator: None,
            spp: None,
            error: None,
            memory,
            directional,
            gather,
            step,
            shadow_rays,
            exposure: 0.0,
            view: View::default(),
        }
    }
}

impl Picture {
    /// What the integrators are told of a scene's, with the photons, the model and the seed of a run.
    pub fn settings(&self, scene: &Scene, framed: &Framed, photons: u64, duality: &Duality) -> RenderSettings {
        let able = if gridless(&scene.regions, duality.model).is_none() { Integrator::Grid } else { Integrator::Path };
        let integrator = self.integrator.unwrap_or(able);
        let Picture { spp, gather, step, shadow_rays, memory, directional, .. } = *self;
        let spp = spp.unwrap_or(integrator.usual_spp());
        let Duality { model, estimate, seed, .. } = *duality;
        let photon = PhotonSettings { model, gather, photons, estimate, step, shadow_rays, memory, directional };
        RenderSettings { integrator, width: framed.width, height: framed.height, spp, seed, photon }
    }

    /// What is missing in it, where anything is.
    pub(super) fn note(&self, scene: &Scene, model: Model) -> Option<String> {
        match self.integrator {
            None => gridless(&scene.regions, model).map(|reason| format!("the picture is by --integrator path, as {reason}")),
            Some(Integrator::Photon) if !scene.air.is_empty() => {
                Some("the atmosphere is not in the picture: --integrator photon knows none; grid and path do".into())
            }
            Some(Integrator::Photon) if scene.sky.iter().any(|&c| c > 0.0) => Some(
                "the sky is seen, and lights surfaces, but stored photons come from the sun alone: its light is not scattered in regions; --integrator path scatters it".into(),
            ),
            Some(_) => None,
        }
    }
}

/// Why [`Integrator::Grid`] cannot follow the light of some regions, where it cannot.
pub(super) fn gridless<'a>(regions: impl IntoIterator<Item = &'a Region>, model: Model) -> Option<String> {
    if let Some(region) = regions.into_iter().find(|r| r.shape.is_endless()) {
        return Some(format!("region {:?} goes on without end, and --integrator grid needs bounds", region.name));
    }
    (model == Model::Hura2006).then(|| "--integrator grid conserves energy, which --model hura2006 does not".into())
}

/// The scene with the regions of the run in place of the layout's.
pub fn lit<'a>(scene: &'a Scene, written: &[Region], density: Density) -> Cow<'a, Scene> {
    match density {
        Density::Source => Cow::Borrowed(scene),
        Density::Duality => Cow::Owned(Scene {
            regions: written.to_vec(),
            surfaces: scene.surfaces.clone(),
            sun: scene.sun,
            sky: scene.sky,
            air: scene.air,
            camera: scene.camera,
            wishes: scene.wishes,
        }),
    }
}

/// Takes the picture of a scene. The photons of pass 1 light it where they are given.
///
/// # Errors
/// [`crate::Error::Interrupted`].
pub fn take(
    scene: &Scene,
    framed: &Framed,
    settings: &RenderSettings,
    pass1: Option<PhotonMap>,
    watch: &dyn Progress,
) -> Result<(Film, Render)> {
    // The effects of what is rendered: regions of the duality overlap where those of the layout may not.
    let plan = Plan::for_scene(scene, Density::Source);
    let begun = Instant::now();
    let rendering = Renderer::new(scene, &plan, &framed.camera, false).take(settings, pass1, watch)?;
    let render = Render::of(settings, &rendering, begun.elapsed().as_secs_f64());
    Ok((rendering.film, render))
}

/// Rounds of [`take_to`] at most, and by how much settings grow from one to the next at most.
const ROUNDS: u32 = 6;
const GROWTH: f64 = 64.0;
/// What the first round takes.
const FIRST_PHOTONS: u64 = 100_000;
const FIRST_SPP: u32 = 8;

/// Takes pictures by more and more photons and samples, until a pixel is known to `error`; the last one counts.
///
/// # Errors
/// [`crate::Error::Interrupted`].
pub fn take_to(error: f64, scene: &Scene, framed: &Framed, settings: &RenderSettings, watch: &dyn Progress) -> Result<(Film, Render)> {
    let mut settings = RenderSettings { spp: FIRST_SPP, photon: PhotonSettings { photons: FIRST_PHOTONS, ..settings.photon }, ..*settings };
    let plan = Plan::for_scene(scene, Density::Source);
    let mut renderer = Renderer::new(scene, &plan, &framed.camera, true);
    let begun = Instant::now();
    let mut round = 1;
    loop {
        let rendering = renderer.take(&settings, None, watch)?;
        let short = rendering.film.relative_error().map_or(1.0, |found| found / error);
        if short <= 1.0 || round == ROUNDS {
            let render = Render::of(&settings, &rendering, begun.elapsed().as_secs_f64());
            return Ok((rendering.film, render));
        }
        // The error falls as the root of what is spent; a quarter more, because it is itself an estimate, and a further round costs more.
        let more = (1.25 * short * short).clamp(1.2, GROWTH);
        settings.photon.photons = (settings.photon.photons as f64 * more) as u64;
        // Samples cost the grid integrator little of its error.
        let more = if settings.integrator == Integrator::Grid { more.sqrt() } else { more };
        settings.spp = ((f64::from(settings.spp) * more / 4.0).ceil() * 4.0) as u32;
        round += 1;
    }
}
