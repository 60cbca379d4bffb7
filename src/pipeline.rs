//! The main job on one page: a layout in; photons, regions, voxels; files out.

use crate::error::{Error, Result};
use crate::export::glb;
use crate::export::report::{Grids, Report};
use crate::export::staged::Staged;
use crate::export::vdb::{VdbOptions, Voxels};
use crate::import::{self, ImportOptions};
use crate::photon::Tracer;
use crate::plan::{Density, Plan};
use crate::progress::Progress;
use crate::regions::{Duality, synthesise};
use crate::scene::Region;
use account::{Clock, closed, light, metadata, opening};
use std::path::{Path, PathBuf};

mod account;

/// What a file is, by its extension.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// OpenVDB grids.
    Vdb,
    /// The report.
    Json,
    /// Regions as glTF.
    Glb,
}

impl Format {
    /// The format of a target.
    ///
    /// # Errors
    /// [`Error::Usage`] that lists what can be written.
    pub fn of(path: &Path) -> Result<Format> {
        match path.extension().and_then(|e| e.to_str()).map(str::to_lowercase).as_deref() {
            Some("vdb") => Ok(Format::Vdb),
            Some("json") => Ok(Format::Json),
            Some("glb") => Ok(Format::Glb),
            _ => Err(Error::Usage(format!(
                "-o {}: the extension says what is written, and must be .vdb (grids), .json (the report) or .glb (the regions as spheres)",
                path.display()
            ))),
        }
    }
}

/// One run: what to read, what to do, what to write.
#[derive(Debug, Clone)]
pub struct Job {
    /// The layout.
    pub input: PathBuf,
    /// The targets.
    pub outputs: Vec<PathBuf>,
    /// Whether targets may be replaced.
    pub overwrite: bool,
    /// Which nodes are regions.
    pub import: ImportOptions,
    /// Which medium is written.
    pub density: Density,
    /// Photons to be stored.
    pub photons: u64,
    /// How regions are synthesised, with the model and the seed of everything.
    pub duality: Duality,
    /// How grids are written.
    pub vdb: VdbOptions,
    /// Stop before any photon is traced, and write nothing.
    pub dry_run: bool,
}

/// Runs a job: import, plan, photons, regions, voxels, files.
///
/// # Errors
/// Everything in [`Error`]; nothing is written then.
pub fn run(job: &Job, progress: &dyn Progress) -> Result<Report> {
    let mut clock = Clock::start();
    let formats = job.outputs.iter().map(|o| Format::of(o)).collect::<Result<Vec<_>>>()?;
    Staged::check(&job.outputs, job.overwrite)?;
    if let Some(same) = job.outputs.iter().find(|o| o.canonicalize().is_ok_and(|o| job.input.canonicalize().is_ok_and(|i| i == o))) {
        return Err(Error::Usage(format!("-o {} is the layout itself: name another file", same.display())));
    }
    progress.begin("import", 1);
    let layout = import::load(&job.input, &job.import)?;
    let plan = Plan::for_scene(&layout.scene, job.density);
    clock.end("import");
    let mut report = opening(job, &layout, &plan);
    if job.dry_run {
        return Ok(closed(report, clock));
    }

    let written = match job.density {
        Density::Source => layout.scene.regions.clone(),
        Density::Duality => {
            let tracer = Tracer::new(&layout.scene, &plan, job.duality.model);
            let shot = tracer.fill(job.photons, job.duality.seed, progress).map_err(|e| e.of_file(&job.input))?;
            clock.end("photons");
            let synthesis = synthesise(&layout.scene, &shot.map, &job.duality, progress)?;
            clock.end("regions");
            light(&mut report, job, &layout, &tracer, &shot, &synthesis, &clock).map_err(|e| e.of_file(&job.input))?;
            synthesis.regions
        }
    };
    report.optical_mass.written = written.iter().map(Region::optical_mass).sum();

    let mut staged = Staged::default();
    if formats.contains(&Format::Vdb) {
        let voxels = Voxels::new(&layout.scene, &written, &job.vdb, progress)?;
        clock.end("voxels");
        if voxels.coarsened {
            let note = format!(
                "voxels are {} m, coarser than the regions ask for, to stay within --max-voxels {}",
                voxels.voxel_size, job.vdb.max_voxels
            );
            report.notes.push(note);
        }
        report.vdb = Some(Grids {
            density_scale: voxels.density_scale,
            voxel_size: voxels.voxel_size,
            coarsened: voxels.coarsened,
            up: job.vdb.up,
            grids: voxels.summary(),
        });
        progress.begin("vdb", 1);
        for target in of(Format::Vdb, &job.outputs, &formats) {
            staged.add(target, |path| voxels.write(path, job.vdb.half, &metadata(job, &layout, &report)))?;
        }
        clock.end("vdb");
    }
    for target in of(Format::Glb, &job.outputs, &formats) {
        staged.add(target, |path| glb::write(path, &layout.scene, &written))?;
    }
    report.outputs.clone_from(&job.outputs);
    let report = closed(report, clock);
    for target in of(Format::Json, &job.outputs, &formats) {
        staged.add(target, |path| report.write(path))?;
    }
    progress.check()?;
    staged.commit()?;
    Ok(report)
}

fn of<'a>(format: Format, outputs: &'a [PathBuf], formats: &'a [Format]) -> impl Iterator<Item = &'a PathBuf> {
    outputs.iter().zip(formats).filter(move |(_, f)| **f == format).map(|(o, _)| o)
}
