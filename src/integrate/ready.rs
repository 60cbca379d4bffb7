//! A scene made ready for one view: compiled, lit, and exposed, each on its own, so that a picture by more samples needs no new light.

use super::grid::GridTracer;
use super::path::PathTracer;
use super::photon::{Gathering, Lighting, PhotonTracer};
use super::{Integrator, RenderSettings, Rendering, expose};
use crate::error::Result;
use crate::photon::PhotonMap;
use crate::plan::Plan;
use crate::progress::Progress;
use crate::scene::{Camera, Scene};

/// A scene as one of the integrators sees it.
#[derive(Debug)]
pub struct Ready<'a> {
    scene: &'a Scene,
    camera: &'a Camera,
    settings: RenderSettings,
    way: Way,
}

#[derive(Debug)]
enum Way {
    Path(Box<PathTracer>),
    Photon(Box<PhotonTracer>),
    Grid(Box<GridTracer>),
}

impl<'a> Ready<'a> {
    /// Compiles a scene. By [`Integrator::Grid`] it is dark yet, and has voxels for the light of `voxels_for` photons; by
    /// [`Integrator::Photon`] it is lit, by the photons of `pass1` where they are given.
    ///
    /// # Errors
    /// As [`super::render`].
    pub fn new(
        scene: &'a Scene,
        plan: &Plan,
        camera: &'a Camera,
        settings: &RenderSettings,
        voxels_for: u64,
        pass1: Option<PhotonMap>,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let way = match settings.integrator {
            Integrator::Path => Way::Path(Box::new(PathTracer::new(scene, plan))),
            Integrator::Photon => Way::Photon(Box::new(PhotonTracer::new(scene, plan, settings, pass1, progress)?)),
            Integrator::Grid => Way::Grid(Box::new(GridTracer::new(scene, plan, camera, settings, voxels_for))),
        };
        Ok(Ready { scene, camera, settings: *settings, way })
    }

    /// How it is followed.
    pub fn settings(&self) -> &RenderSettings {
        &self.settings
    }

    /// What lights it; `None` where nothing is kept of light.
    pub fn lighting(&self) -> Option<Lighting> {
        match &self.way {
            Way::Path(_) => None,
            Way::Photon(tracer) => Some(tracer.lighting),
            Way::Grid(tracer) => Some(tracer.lighting()),
        }
    }

    /// Lights what is dark yet, by as many photons as the settings say.
    ///
    /// # Errors
    /// [`crate::Error::Interrupted`].
    pub fn brighten(&mut self, progress: &dyn Progress) -> Result<()> {
        match &mut self.way {
            Way::Grid(tracer) => tracer.brighten(self.settings.photon.photons, progress),
            Way::Path(_) | Way::Photon(_) => Ok(()),
        }
    }

    /// A picture by so many samples a pixel.
    ///
    /// # Errors
    /// As [`super::render`].
    pub fn expose(&mut self, spp: u32, progress: &dyn Progress) -> Result<Rendering> {
        self.settings.spp = spp;
        let (scene, camera, settings) = (self.scene, self.camera, &self.settings);
        let mut rendering = match &self.way {
            Way::Path(tracer) => expose(&**tracer, tracer.origin, scene, camera, settings, progress),
            Way::Photon(tracer) => expose(&**tracer, tracer.origin, scene, camera, settings, progress),
            Way::Grid(tracer) => expose(&**tracer, tracer.origin, scene, camera, settings, progress),
        }?;
        // Of paths, and of beams, which pierce few photons that throw light toward the camera, a few bring most.
        if matches!(self.way, Way::Path(_)) || (matches!(self.way, Way::Photon(_)) && settings.photon.gather == Gathering::Beam) {
            rendering.film.share_noise();
        }
        if matches!(self.way, Way::Photon(_)) {
            rendering.film.spread_blur();
        }
        Ok(Rendering { photons: self.lighting(), ..rendering })
    }
}
