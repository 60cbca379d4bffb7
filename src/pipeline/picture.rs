//! From regions to a picture.

use crate::integrate::photon::{Gathering, PhotonSettings};
use crate::integrate::{Directional, Integrator, RenderSettings};
use crate::photon::Model;
use crate::plan::Density;
use crate::regions::Duality;
use crate::scene::{Framed, Region, Scene, View};
use std::borrow::Cow;

mod forecast;
mod goal;
mod series;
mod timed;

pub use goal::{Goal, take_to};
pub use series::take;

/// How pictures are taken.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Picture {
    /// How light is followed; where nobody says, by [`Integrator::Grid`] where it can, and else by [`Integrator::Path`].
    pub integrator: Option<Integrator>,
    /// Samples a pixel; [`Integrator::usual_spp`] where nobody says.
    pub spp: Option<u32>,
    /// Photons of the grid integrator; as many as of the run, where nobody says.
    pub photons: Option<u64>,
    /// The relative error of a pixel ([`crate::film::Film::relative_error`]) to go on to, where one is asked for.
    pub error: Option<f64>,
    /// The seconds of the whole run within which the picture is to be as good as it can be, where they are given.
    pub seconds: Option<f64>,
    /// What the voxels of [`Integrator::Grid`] may take, and what stored photons may, bytes; where nobody says, a gigabyte, and what the
    /// system has free.
    pub memory: Option<u64>,
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
        let PhotonSettings { gather, step, shadow_rays, directional, .. } = PhotonSettings::default();
        Picture {
            integrator: None,
            spp: None,
            photons: None,
            error: None,
            seconds: None,
            memory: None,
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
        let Picture { spp, gather, step, shadow_rays, directional, .. } = *self;
        let spp = spp.unwrap_or(integrator.usual_spp());
        let Duality { model, estimate, seed, .. } = *duality;
        let photons = self.photons.filter(|_| integrator == Integrator::Grid).unwrap_or(photons);
        let memory = self.voxel_memory();
        let photon = PhotonSettings { model, gather, photons, estimate, step, shadow_rays, memory, directional };
        RenderSettings { integrator, width: framed.width, height: framed.height, spp, seed, photon }
    }

    /// What the voxels of [`Integrator::Grid`] may take, bytes.
    pub fn voxel_memory(&self) -> u64 {
        self.memory.unwrap_or(PhotonSettings::default().memory)
    }

    /// What is missing in it.
    pub(super) fn notes(&self, scene: &Scene, model: Model) -> Vec<String> {
        match self.integrator {
            None => {
                let reason = gridless(&scene.regions, model);
                reason.map(|reason| format!("the picture is by --integrator path, as {reason}")).into_iter().collect()
            }
            Some(Integrator::Photon) => {
                let air = "the atmosphere is not in the picture: --integrator photon knows none; grid and path do";
                let sky = "the sky is seen, and lights surfaces, but stored photons come from the sun alone: its light is not scattered in regions; --integrator path scatters it";
                let missing = [(air, !scene.air.is_empty()), (sky, scene.sky.iter().any(|&c| c > 0.0))];
                missing.into_iter().filter(|(_, missing)| *missing).map(|(note, _)| note.into()).collect()
            }
            Some(_) => Vec::new(),
        }
    }
}

/// Why [`Integrator::Grid`] cannot follow the light of some regions, where it cannot.
pub fn gridless<'a>(regions: impl IntoIterator<Item = &'a Region>, model: Model) -> Option<String> {
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
            lamps: scene.lamps.clone(),
            flames: scene.flames.clone(),
            sky: scene.sky,
            dome: scene.dome.clone(),
            air: scene.air,
            camera: scene.camera,
            wishes: scene.wishes,
        }),
    }
}
