//! One picture of the study by the photon integrator, timed and weighed; and the duality alone, for other seeds.

use crate::error::Result;
use crate::export::report::{Render, peak_memory};
use crate::film::Film;
use crate::import::Layout;
use crate::integrate::Integrator;
use crate::integrate::photon::Gathering;
use crate::photon::Model;
use crate::pipeline::{self, Clock, Pass1, Picture, lit};
use crate::plan::Density;
use crate::progress::Progress;
use crate::regions::Duality;
use crate::scene::View;
use crate::stats::Estimate;
use std::path::PathBuf;
use std::time::Instant;

/// A layout of the study, by the name it was given.
pub(super) struct Given {
    pub input: PathBuf,
    pub layout: Layout,
}

/// How a picture is made.
#[derive(Debug, Clone, Copy)]
pub(super) struct How {
    pub integrator: Integrator,
    pub model: Model,
    pub gather: Gathering,
    pub photons: u64,
    pub estimate: u64,
    pub size: [u32; 2],
    pub spp: u32,
    pub seed: u64,
}

/// A picture, and what it took.
pub(super) struct Taken {
    pub film: Film,
    pub render: Render,
    /// Regions that the picture shows.
    pub regions: u64,
    /// Of the duality and the picture.
    pub seconds: f64,
    /// The most memory held meanwhile, bytes.
    pub memory: u64,
    /// The share of sunlight that crosses what is shown, where the duality made it; and the layout.
    pub sunlight: Option<[Estimate; 2]>,
}

impl How {
    fn duality(&self) -> Duality {
        Duality { model: self.model, estimate: Some(self.estimate), seed: self.seed, ..Duality::default() }
    }

    fn pass1(&self, given: &Given, progress: &dyn Progress) -> Result<Pass1> {
        let pass1 = Pass1::of(&given.layout.scene, self.photons, &self.duality(), &mut Clock::start(), progress);
        pass1.map_err(|e| e.of_file(&given.input))
    }
}

/// How many regions the duality makes with another seed.
pub(super) fn count(given: &Given, how: &How, progress: &dyn Progress) -> Result<u64> {
    Ok(how.pass1(given, progress)?.synthesis.regions.len() as u64)
}

/// Takes a picture of a layout, or of the regions that the duality makes of it, by the steps of the main job.
pub(super) fn take(given: &Given, density: Density, how: &How, progress: &dyn Progress) -> Result<Taken> {
    let scene = &given.layout.scene;
    forget_peak();
    let begun = Instant::now();
    let (regions, pass1, sunlight) = match density {
        Density::Source => (scene.regions.clone(), None, None),
        Density::Duality => {
            let pass1 = how.pass1(given, progress)?;
            let (before, after) = pass1.tracer.sunlight_through(&pass1.synthesis.regions, how.seed);
            let (regions, map) = pass1.regions(how.model);
            (regions, map, Some([before, after]))
        }
    };
    let view = View { size: Some(how.size), ..View::default() };
    let framed = view.frame(scene).map_err(|e| e.of_file(&given.input))?;
    let How { integrator, gather, spp, .. } = *how;
    let picture =
        Picture { integrator: Some(integrator), gather, spp: Some(spp), shadow_rays: super::thesis::SAMPLES, view, ..Picture::default() };
    let settings = picture.settings(scene, &framed, how.photons, &how.duality());
    let (film, render) = pipeline::take(&lit(scene, &regions, density), &framed, &settings, pass1, progress)?;
    let (seconds, memory) = (begun.elapsed().as_secs_f64(), peak_memory());
    Ok(Taken { film, render, regions: regions.len() as u64, seconds, memory, sunlight })
}

/// Lets the system forget the most memory that this process has held: the next peak is the next picture's. Where that is not
/// allowed, a peak stays the largest so far.
fn forget_peak() {
    let _ = std::fs::write("/proc/self/clear_refs", "5");
}
