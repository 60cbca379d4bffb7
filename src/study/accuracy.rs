//! `cloudvdb study SCENE`: what accuracy costs in time, by integrator and settings, against a reference of the path tracer.
//!
//! Every picture is kept in the folder as it ends, with a line in `runs.jsonl`: a study that was interrupted goes on, and one that is
//! asked for more makes what is missing. The error of a picture is against two independent halves of the reference, a pixel's as
//! (I - A)(I - B), which the reference's own noise leaves unbiased ([`figures`]).

mod against;
mod change;
mod figures;
mod line;
pub(super) mod page;
mod plot;
mod store;

pub use against::{Against, against};
pub use change::Change;
pub use figures::{Cell, Figures};
pub use line::Line;

use crate::error::{Error, Result};
use crate::export::report::peak_memory;
use crate::import::{self, ImportOptions};
use crate::integrate::Integrator;
use crate::photon::Model;
use crate::pipeline::{self, Picture};
use crate::progress::{Progress, agreed, meet};
use crate::regions::Duality;
use crate::scene::{Framed, Scene, View};
use std::borrow::Cow;
use std::path::PathBuf;
use std::time::Instant;
use store::Store;

/// Pixels in a row, and in a quick study.
const WIDE: [u32; 2] = [160, 96];
/// Seeds of each cell.
const SEEDS: [u64; 2] = [4, 3];
/// Samples a pixel of the path tracer; photons of the others.
const SAMPLES: [&[u64]; 2] = [&[4, 16, 64, 256], &[4, 16, 64]];
const PHOTONS: [&[u64]; 2] = [&[30_000, 100_000, 300_000, 1_000_000], &[10_000, 30_000, 100_000]];
/// Samples a pixel of the reference's halves, where nobody says.
const REFERENCE: [u32; 2] = [2048, 384];
/// The seeds of the halves: none that a cell has.
const HALVES: [u64; 2] = [1 << 40, (1 << 40) + 1];
/// Samples a pixel of pictures by photons.
const SPP: u32 = 16;

/// What to study.
#[derive(Debug, Clone)]
pub struct Job {
    /// The scene.
    pub input: PathBuf,
    /// How it is read.
    pub import: ImportOptions,
    /// The camera and the size, where they are not the scene's or the study's.
    pub view: View,
    /// Fewer settings, seeds and pixels.
    pub quick: bool,
    /// Samples a pixel of each half of the reference.
    pub reference: Option<u32>,
    /// The first seed.
    pub seed: u64,
    /// Where pictures, tables and the page go.
    pub output: PathBuf,
    /// Pictures by somebody else, to stand beside.
    pub against: Vec<Against>,
}

/// Settings of one picture but its seed.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Setting {
    /// Which integrator.
    pub integrator: Integrator,
    /// Samples a pixel of `path`, photons of the others.
    pub work: u64,
    /// What else is not as usual.
    pub change: Option<Change>,
}

/// Runs what is not there yet, writes the tables, the plot and the page, and gives the figures; of several ranks one does. `told` gets a
/// line for each picture.
///
/// # Errors
/// Those of the main job; [`Error::Interrupted`], after which the next run goes on; [`Error::Scene`] where no pixel receives light;
/// [`Error::Write`] where the folder holds the study of another scene, or is none.
pub fn study(job: &Job, told: &dyn Fn(&str), progress: &dyn Progress) -> Result<Option<Figures>> {
    let quick = usize::from(job.quick);
    let layout = import::load(&job.input, &job.import, progress)?;
    let view = sized(&job.view, WIDE[quick], &layout.scene).map_err(|e| e.of_file(&job.input))?;
    let framed = view.frame(&layout.scene).map_err(|e| e.of_file(&job.input))?;
    let stage = Stage { scene: &layout.scene, framed: &framed, view };
    meet(|| format!("{job:?} {}", layout.source_hash), progress)?;
    // Of several ranks one keeps the pictures, and the others help to make them.
    let leads = progress.leads();
    let mut store = if leads { Some(Store::open(job, &layout.source_hash, &stage)?) } else { None };
    let spp = job.reference.unwrap_or(REFERENCE[quick]).into();
    let reference = Setting { integrator: Integrator::Path, work: spp, change: None };
    for seed in HALVES {
        stage.take(reference, seed, &mut store, told, progress)?;
    }
    let truth = store.as_ref().map(|store| truth(store, reference, framed.width as usize)).transpose()?;
    let mut cells = Vec::new();
    for (integrator, works) in
        [(Integrator::Path, SAMPLES[quick]), (Integrator::Grid, PHOTONS[quick]), (Integrator::Photon, PHOTONS[quick])]
    {
        // Regions without end are for the path tracer.
        if let Some(reason) = pipeline::gridless(&layout.scene.regions, Model::Physical).filter(|_| integrator != Integrator::Path) {
            told(&format!("{}: {reason}", figures::name(integrator)));
            continue;
        }
        let usual = works.iter().map(|&work| Setting { integrator, work, change: None });
        // The second last: what is usual stands beside it.
        let changed = Change::of(integrator, &layout.scene, works[works.len() - 2], job.quick);
        for setting in usual.chain(changed) {
            for seed in job.seed..job.seed + SEEDS[quick] {
                stage.take(setting, seed, &mut store, told, progress)?;
            }
            if let Some((store, truth)) = store.as_ref().zip(truth.as_ref()) {
                let seeds: Vec<_> = (job.seed..job.seed + SEEDS[quick]).filter_map(|seed| store.run(setting, seed)).collect();
                cells.push(Cell::new(setting, &seeds, truth));
            }
        }
    }
    let Some((store, truth)) = store.zip(truth) else { return Ok(None) };
    let mut others = Vec::new();
    for other in &job.against {
        others.push(against::judge(other, &truth, [framed.width, framed.height])?);
    }
    let figures = Figures::new(job, [framed.width, framed.height], spp, truth, cells, others);
    store.write(&figures)?;
    Ok(Some(figures))
}

/// The reference, from its two halves.
fn truth(store: &Store, reference: Setting, width: usize) -> Result<figures::Truth> {
    let [Some(a), Some(b)] = HALVES.map(|seed| store.picture(reference, seed)) else { return Err(store.lost("the reference")) };
    figures::Truth::new(a, b, width).ok_or_else(|| Error::Scene {
        reason: "no pixel of the reference receives light: there is nothing to be wrong about".into(),
        fix: "Look at the scene first: cloudvdb SCENE -o look.png".into(),
    })
}

/// A view of so many pixels in a row where nobody said how many, and as high as the camera's aspect says.
pub(super) fn sized(view: &View, wide: u32, scene: &Scene) -> Result<View> {
    let framed = view.frame(scene)?;
    let high = (f64::from(wide) * f64::from(framed.height) / f64::from(framed.width)).round().max(1.0);
    Ok(View { size: Some(view.size.unwrap_or([wide, high as u32])), ..*view })
}

/// The scene before the camera.
struct Stage<'a> {
    scene: &'a Scene,
    framed: &'a Framed,
    view: View,
}

impl Stage<'_> {
    /// Takes a picture that is not there yet.
    fn take(&self, setting: Setting, seed: u64, store: &mut Option<Store>, told: &dyn Fn(&str), progress: &dyn Progress) -> Result<()> {
        let there = store.as_ref().is_some_and(|store| store.run(setting, seed).is_some());
        if agreed([f64::from(there)], progress)? == [1.0] {
            return Ok(());
        }
        let scene = match setting.change {
            Some(Change::Voxels(size)) => Cow::Owned(change::voxels(self.scene, size, progress)?),
            _ => Cow::Borrowed(self.scene),
        };
        let path = setting.integrator == Integrator::Path;
        let spp = if path { u32::try_from(setting.work).unwrap_or(u32::MAX) } else { SPP };
        let photons = if path { 0 } else { setting.work };
        let mut picture = Picture { integrator: Some(setting.integrator), spp: Some(spp), view: self.view, ..Picture::default() };
        let mut duality = Duality { seed, ..Duality::default() };
        match setting.change {
            Some(Change::Estimate(n)) => duality.estimate = Some(n),
            Some(Change::Step(step)) => picture.step = step,
            Some(Change::Voxels(_)) | None => {}
        }
        let settings = picture.settings(&scene, self.framed, photons, &duality);
        let begun = Instant::now();
        let (film, render) = pipeline::take(&scene, self.framed, &settings, None, progress)?;
        progress.check()?;
        let seconds = begun.elapsed().as_secs_f64();
        let stated = render.relative_error;
        if let Some(store) = store {
            store.add(setting, seed, seconds, peak_memory(), stated, &film)?;
        }
        let changed = setting.change.map_or(String::new(), |change| format!("  {change}"));
        let name = figures::name(setting.integrator);
        told(&format!("{name} {:>9} seed {:<3} {seconds:8.2} s{changed}", setting.work, seed % HALVES[0]));
        Ok(())
    }
}
