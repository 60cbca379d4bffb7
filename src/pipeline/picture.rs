//! From regions to a picture.

use super::Job;
use super::account::Clock;
use crate::error::Result;
use crate::export::report::{Render, Report};
use crate::film::Film;
use crate::integrate::{self, Integrator, RenderSettings};
use crate::plan::{Density, Plan};
use crate::progress::Progress;
use crate::scene::{Framed, Region, Scene, View};
use std::borrow::Cow;
use std::time::Instant;

/// How pictures are taken.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Picture {
    /// How light is followed.
    pub integrator: Integrator,
    /// Samples a pixel.
    pub spp: u32,
    /// By how many stops the preview is brightened.
    pub exposure: f64,
    /// The camera and the size, where they are not the scene's.
    pub view: View,
}

impl Default for Picture {
    fn default() -> Self {
        Picture { integrator: Integrator::Path, spp: 64, exposure: 0.0, view: View::default() }
    }
}

/// The scene with the regions of the run in place of the layout's.
pub(super) fn lit<'a>(scene: &'a Scene, written: &[Region], density: Density) -> Cow<'a, Scene> {
    match density {
        Density::Source => Cow::Borrowed(scene),
        Density::Duality => Cow::Owned(Scene {
            regions: written.to_vec(),
            surfaces: scene.surfaces.clone(),
            sun: scene.sun,
            sky: scene.sky,
            camera: scene.camera,
        }),
    }
}

/// Takes the picture of a scene, and tells the report.
pub(super) fn take(
    job: &Job,
    scene: &Scene,
    framed: &Framed,
    report: &mut Report,
    clock: &mut Clock,
    watch: &dyn Progress,
) -> Result<Film> {
    let Picture { integrator, spp, .. } = job.picture;
    let settings = RenderSettings { integrator, width: framed.width, height: framed.height, spp, seed: job.duality.seed };
    // The effects of what is rendered: regions of the duality overlap where those of the layout may not.
    let plan = Plan::for_scene(scene, Density::Source);
    let begun = Instant::now();
    let rendering = integrate::render(scene, &plan, &framed.camera, &settings, watch)?;
    report.render = Some(Render::of(&settings, &rendering, begun.elapsed().as_secs_f64()));
    clock.end("render");
    Ok(rendering.film)
}
