//! The main job on one page: a layout or a VDB in; photons, regions, voxels, a picture; files out.

use crate::error::Result;
use crate::export::report::Report;
use crate::export::staged::Staged;
use crate::export::vdb::VdbOptions;
use crate::export::{blend, exr, glb, png};
use crate::import::{self, ImportOptions};
use crate::plan::{Density, Plan};
use crate::progress::{Progress, agreed};
use crate::regions::Duality;
use crate::scene::Region;
use account::{closed, light, metadata, opening};
use format::Targets;
use std::path::PathBuf;

mod account;
mod bake;
mod balance;
mod crew;
mod format;
mod grids;
mod held;
mod pass1;
mod picture;

pub use account::Clock;
pub use bake::Baking;
pub use balance::{Balance, BalanceJob, balance};
pub use format::{Format, check_gather, usual_density};
pub use pass1::Pass1;
pub use picture::{Goal, Picture, gridless, lit, take, take_to};

/// One run: what to read, what to do, what to write.
#[derive(Debug, Clone)]
pub struct Job {
    /// The layout, or the VDB.
    pub input: PathBuf,
    /// The targets.
    pub outputs: Vec<PathBuf>,
    /// Whether targets may be replaced.
    pub overwrite: bool,
    /// Which nodes or grids are regions, and what replaces the file's own media and light.
    pub import: ImportOptions,
    /// Which medium is written and rendered.
    pub density: Density,
    /// Photons to be stored.
    pub photons: u64,
    /// How regions are synthesised, with the model and the seed of everything.
    pub duality: Duality,
    /// How grids are written.
    pub vdb: VdbOptions,
    /// Which light goes beside the density.
    pub bake: Baking,
    /// How pictures are taken.
    pub picture: Picture,
    /// Stop before any photon is traced, and write nothing.
    pub dry_run: bool,
}

/// Runs a job: import, plan, photons, regions, voxels, picture, files.
///
/// # Errors
/// Everything in [`crate::Error`]; nothing is written then.
pub fn run(job: &Job, progress: &dyn Progress) -> Result<Report> {
    let mut clock = Clock::start();
    let writes = progress.leads();
    let targets = Targets::of(job, writes)?;
    progress.begin("import", 1);
    let layout = import::load(&job.input, &job.import, progress)?;
    targets.check(job, &layout)?;
    crew::meet(job, &layout, progress)?;
    let plan = Plan::for_scene(&layout.scene, job.density);
    clock.end("import");
    let mut report = opening(job, &layout, &plan);
    let picture = targets.any(Format::Exr) || targets.any(Format::Png);
    let framed = if picture || targets.any(Format::Blend) || job.bake.light.is_some() {
        let framed = job.picture.view.frame(&layout.scene).map_err(|e| e.of_file(&job.input))?;
        report.notes.extend(framed.notes.iter().cloned());
        Some(framed)
    } else {
        None
    };
    if !layout.scene.flames.is_empty() && targets.any(Format::Glb) {
        report.notes.push("what shines by itself is in pictures and grids: the .glb has none of it".into());
    }
    if job.dry_run {
        return Ok(closed(report, clock));
    }
    held::check(job, picture, progress)?;

    let (written, pass1) = match job.density {
        Density::Source => (layout.scene.regions.clone(), None),
        Density::Duality => {
            let pass1 = Pass1::of(&layout.scene, job.photons, &job.duality, &mut clock, progress).map_err(|e| e.of_file(&job.input))?;
            light(&mut report, job, &layout.scene, &pass1, &clock);
            pass1.regions(job.duality.model)
        }
    };
    report.optical_mass.written = written.iter().map(Region::optical_mass).sum();

    let scene = lit(&layout.scene, &written, job.density);
    let mut staged = Staged::by(writes);
    let mut kept = false;
    // Ranks that write nothing need voxels for what they do together: the light of a bake, and its check.
    if targets.any(Format::Vdb) && (writes || job.bake.light.is_some()) {
        let scene = bake::without_air(job, &scene, &mut report.notes);
        let source = match job.bake.light.zip(framed.as_ref()) {
            Some((bake, framed)) => Some((bake, bake::follow(job, bake, &scene, framed, progress)?)),
            None => None,
        };
        if source.is_some() {
            clock.end("light");
        }
        let light = source.as_ref().map(|(bake, source)| (*bake, source));
        let mut metadata = metadata(job, &layout, &report);
        let voxels = grids::make(job, &layout.scene, &written, light, &metadata, &mut report, progress)?;
        clock.end("voxels");
        if let Some(framed) = &framed {
            bake::check(job, &voxels, &scene, framed, &mut report, progress)?;
            account::light_error(&mut metadata, &report);
        }
        if source.is_some() {
            clock.end("check");
        }
        progress.begin("vdb", 1);
        for target in targets.each(Format::Vdb) {
            staged.add(target, |path| voxels.write(path, job.vdb.half, &metadata))?;
        }
        for (target, framed) in targets.each(Format::Blend).zip(&framed) {
            let vdb = targets.each(Format::Vdb).next().map_or(target.as_path(), |vdb| vdb);
            staged.add(target, |path| blend::write(path, &blend::Setup { target, vdb, scene: &scene, framed, voxels: &voxels }))?;
        }
        clock.end("vdb");
    }
    for target in targets.each(Format::Glb) {
        staged.add(target, |path| glb::write(path, &layout.scene, &written))?;
    }
    if let Some(framed) = framed.filter(|_| picture) {
        let settings = job.picture.settings(&scene, &framed, job.photons, &job.duality);
        let Picture { error, seconds, .. } = job.picture;
        let (film, render) = if error.is_some() || seconds.is_some() {
            let [elapsed] = agreed([clock.elapsed()], progress)?;
            let goal = Goal { error, seconds: seconds.map(|seconds| seconds - elapsed) };
            let taking = take_to(&goal, &scene, &framed, &settings, progress)?;
            report.notes.extend(taking.notes);
            (taking.film, taking.render)
        } else {
            take(&scene, &framed, &settings, pass1, progress)?
        };
        report.notes.extend(job.picture.notes(&scene, job.duality.model));
        report.notes.extend(render.finished.map(account::cut_short));
        kept = render.finished.is_some();
        report.render = Some(render);
        clock.end("render");
        for target in targets.each(Format::Exr) {
            staged.add(target, |path| exr::write(path, &film))?;
        }
        for target in targets.each(Format::Png) {
            staged.add(target, |path| png::write(path, &film, job.picture.exposure))?;
        }
    }
    report.outputs.clone_from(&job.outputs);
    report.together = crew::spent(progress)?;
    let report = closed(report, clock);
    for target in targets.each(Format::Json) {
        staged.add(target, |path| report.write(path))?;
    }
    if !kept {
        progress.check()?;
    }
    staged.commit(job.overwrite)?;
    Ok(report)
}
