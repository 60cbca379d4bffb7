//! One picture of the study by the photon integrator, timed and weighed; and the duality alone, for other seeds.

use crate::error::{Error, Result};
use crate::export::report::{Render, peak_memory};
use crate::film::Film;
use crate::import::Layout;
use crate::integrate::photon::{Gathering, PhotonSettings};
use crate::integrate::{self, Integrator, RenderSettings};
use crate::photon::{Model, PhotonMap, Tracer};
use crate::pipeline::lit;
use crate::plan::{Density, Plan};
use crate::progress::Progress;
use crate::regions::{Duality, synthesise};
use crate::scene::{Region, View};
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

/// The duality of a layout: the photons of pass 1 and the regions made of them.
fn duality(given: &Given, how: &How, progress: &dyn Progress) -> Result<(Tracer, PhotonMap, Vec<Region>)> {
    let named = |e: Error| e.of_file(&given.input);
    let scene = &given.layout.scene;
    let tracer = Tracer::new(scene, &Plan::for_scene(scene, Density::Duality), how.model);
    let shot = tracer.fill(how.photons, how.seed, progress).map_err(named)?;
    let duality = Duality { model: how.model, estimate: Some(how.estimate), seed: how.seed, ..Duality::default() };
    let regions = synthesise(scene, &shot.map, &duality, progress)?.regions;
    if regions.is_empty() {
        return Err(named(Error::Scene {
            reason: "the duality makes no region of it: hardly any light scatters twice".into(),
            fix: "Name the thesis's scenes, scenes/hura2006_1.gltf and so on, or a denser layout".into(),
        }));
    }
    Ok((tracer, shot.map, regions))
}

/// How many regions the duality makes with another seed.
pub(super) fn count(given: &Given, how: &How, progress: &dyn Progress) -> Result<u64> {
    Ok(duality(given, how, progress)?.2.len() as u64)
}

/// Takes a picture of a layout, or of the regions that the duality makes of it: what the main job does with the same settings.
pub(super) fn take(given: &Given, density: Density, how: &How, progress: &dyn Progress) -> Result<Taken> {
    let scene = &given.layout.scene;
    forget_peak();
    let begun = Instant::now();
    let (regions, pass1, sunlight) = match density {
        Density::Source => (scene.regions.clone(), None, None),
        Density::Duality => {
            let (tracer, map, regions) = duality(given, how, progress)?;
            let (before, after) = tracer.sunlight_through(&regions, how.seed);
            // To the letter, the photons that made the regions also light them.
            (regions, (how.model == Model::Hura2006).then_some(map), Some([before, after]))
        }
    };
    let scene = lit(scene, &regions, density);
    let view = View { size: Some(how.size), ..View::default() };
    let framed = view.frame(&given.layout.scene).map_err(|e| e.of_file(&given.input))?;
    let photon = PhotonSettings {
        model: how.model,
        gather: how.gather,
        photons: how.photons,
        estimate: Some(how.estimate),
        shadow_rays: super::thesis::SAMPLES,
        ..PhotonSettings::default()
    };
    let [width, height] = how.size;
    let settings = RenderSettings { integrator: how.integrator, width, height, spp: how.spp, seed: how.seed, photon };
    let plan = Plan::for_scene(&scene, Density::Source);
    let started = Instant::now();
    let rendering = integrate::render(&scene, &plan, &framed.camera, &settings, pass1, progress)?;
    let render = Render::of(&settings, &rendering, started.elapsed().as_secs_f64());
    let (seconds, memory) = (begun.elapsed().as_secs_f64(), peak_memory());
    Ok(Taken { film: rendering.film, render, regions: regions.len() as u64, seconds, memory, sunlight })
}

/// Lets the system forget the most memory that this process has held: the next peak is the next picture's. Where that is not
/// allowed, a peak stays the largest so far.
fn forget_peak() {
    let _ = std::fs::write("/proc/self/clear_refs", "5");
}
