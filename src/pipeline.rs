//! The main job on one page: a layout in; photons, regions, voxels; files out.

use crate::error::{Error, Result};
use crate::export::glb;
use crate::export::report::{self, Energy, Errors, Grids, Mass, Photons, Regions, Report, Settings, Stage};
use crate::export::staged::Staged;
use crate::export::vdb::{VdbOptions, Voxels};
use crate::import::{self, ImportOptions, Layout};
use crate::photon::{Shot, Tracer};
use crate::plan::{Density, Plan};
use crate::progress::Progress;
use crate::regions::{Duality, Synthesis, synthesise};
use crate::scene::Region;
use crate::vdb::Meta;
use std::path::{Path, PathBuf};
use std::time::Instant;

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
            let shot = tracer.fill(job.photons, job.duality.seed, progress)?;
            clock.end("photons");
            let synthesis = synthesise(&layout.scene, &shot.map, &job.duality, progress)?;
            clock.end("regions");
            light(&mut report, job, &layout, &tracer, &shot, &synthesis, &clock)?;
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
                "voxels are {} m, coarser than a third of the smallest region's half extent, to stay within --max-voxels {}",
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

/// What the report says before anything is traced.
fn opening(job: &Job, layout: &Layout, plan: &Plan) -> Report {
    let Duality { model, placement, estimate, seed } = job.duality;
    Report {
        cloudvdb: env!("CARGO_PKG_VERSION"),
        input: job.input.clone(),
        source_hash: layout.source_hash.clone(),
        settings: Settings { density: job.density, model, placement, photons: job.photons, estimate, seed },
        found: layout.findings.clone(),
        notes: layout.notes.clone(),
        plan: plan.clone(),
        regions: Regions { source: layout.scene.regions.len(), ..Regions::default() },
        optical_mass: Mass { source: layout.scene.optical_mass(), ..Mass::default() },
        photons: None,
        energy: None,
        error: None,
        vdb: None,
        stages: Vec::new(),
        seconds: 0.0,
        peak_memory: 0,
        outputs: Vec::new(),
    }
}

/// What pass 1 and the duality add to the report.
fn light(
    report: &mut Report,
    job: &Job,
    layout: &Layout,
    tracer: &Tracer,
    shot: &Shot,
    synthesis: &Synthesis,
    clock: &Clock,
) -> Result<()> {
    let scene = &layout.scene;
    if synthesis.regions.is_empty() {
        return Err(too_thin(scene, shot, synthesis));
    }
    let made: f64 = synthesis.sources.iter().map(|s| s.synthesised).sum();
    report.optical_mass.missing = report.optical_mass.source - made;
    let shortfall = report.optical_mass.missing / report.optical_mass.source;
    if shortfall > 1e-6 {
        let hungry: Vec<&str> = synthesis.sources.iter().filter(|s| s.synthesised < 0.999 * s.mass).map(|s| s.name.as_str()).collect();
        report.notes.push(format!(
            "{:.1} % of the optical mass is missing: in {} of {} regions ({}{}) too few places have enough photons within a free path; nothing was scaled to hide it. More --photons, or a smaller --estimate, fills them",
            100.0 * shortfall,
            hungry.len(),
            synthesis.sources.len(),
            hungry.iter().take(3).copied().collect::<Vec<_>>().join(", "),
            if hungry.len() > 3 { ", ..." } else { "" }
        ));
    }
    if shot.map.len() < job.photons {
        report.notes.push(format!(
            "the scene is so thin that {} emitted photons left only {} of the {} asked for",
            shot.emitted,
            shot.map.len(),
            job.photons
        ));
    }
    report.photons = Some(Photons::of(shot));
    report.energy = Some(Energy::of(shot));
    let weighted: f64 = synthesis.sources.iter().map(|s| s.regions as f64 / (s.estimate as f64).sqrt()).sum();
    let (before, after) = tracer.sunlight_through(&synthesis.regions, job.duality.seed);
    // A search distance holds n photons where N are stored: n must grow fourfold, and with it N.
    let grow = if job.duality.estimate.is_some() { 4 } else { 16 };
    report.error = Some(Errors {
        photon_density: weighted / synthesis.regions.len() as f64,
        sunlight_through_layout: before,
        sunlight_through_regions: after,
        optical_mass: shortfall,
        photons_for_half: grow * job.photons,
        seconds_for_half: grow as f64 * clock.elapsed(),
    });
    report.regions.synthesised = synthesis.regions.len();
    report.regions.sticking_out = synthesis.sticking_out;
    report.regions.sources.clone_from(&synthesis.sources);
    Ok(())
}

/// Why no region could be made, and what would do.
fn too_thin(scene: &crate::scene::Scene, shot: &Shot, synthesis: &Synthesis) -> Error {
    let thickest = scene
        .regions
        .iter()
        .max_by(|a, b| (a.medium.sigma_t() * a.shape.thickness()).total_cmp(&(b.medium.sigma_t() * b.shape.thickness())));
    let Some(region) = thickest else {
        return Error::Scene { reason: "there is no region".into(), fix: "Add one".into() };
    };
    let (sigma, across) = (region.medium.sigma_t(), region.shape.thickness());
    let (stored, wanted) = synthesis.sources.iter().map(|s| (s.photons, s.estimate)).max().unwrap_or_default();
    let reason = match shot.map.len() {
        0 => format!("no photon scatters twice: the thickest region, {}, has optical depth {:.3e} across", region.name, sigma * across),
        _ => format!(
            "no region came out: the fullest one holds {stored} photons, but nowhere do {wanted} of them lie within a free path ({:.3e} m; {} has optical depth {:.3} across)",
            1.0 / sigma,
            region.name,
            sigma * across
        ),
    };
    Error::Scene {
        reason,
        fix: format!(
            "A sigma_t of {:.4} per metre would give it optical depth 40 (a cloud); more --photons or a smaller --estimate may also help",
            40.0 / across
        ),
    }
}

/// What the file says about itself.
fn metadata(job: &Job, layout: &Layout, report: &Report) -> Vec<(String, Meta)> {
    let text = |key: &str, value: String| (key.to_string(), Meta::Text(value));
    let number = |key: &str, value: f64| (key.to_string(), Meta::Float(value));
    let scene = &layout.scene;
    let mass = scene.optical_mass().max(f64::MIN_POSITIVE);
    let mean = |f: fn(&Region) -> f64| scene.regions.iter().map(|r| f(r) * r.optical_mass()).sum::<f64>() / mass;
    let sun = scene.sun;
    let name = |v: serde_json::Result<serde_json::Value>| v.ok().and_then(|v| v.as_str().map(String::from)).unwrap_or_default();
    vec![
        text("creator", concat!("cloudvdb ", env!("CARGO_PKG_VERSION")).into()),
        text("cloudvdb_version", env!("CARGO_PKG_VERSION").into()),
        text("cloudvdb_density", name(serde_json::to_value(job.density))),
        text("cloudvdb_model", name(serde_json::to_value(job.duality.model))),
        ("cloudvdb_seed".into(), Meta::Int(job.duality.seed as i64)),
        ("cloudvdb_photons".into(), Meta::Int(report.photons.map_or(0, |p| p.stored) as i64)),
        number("sigma_t", mean(|r| r.medium.sigma_t())),
        number("albedo", mean(|r| r.medium.albedo())),
        number("g", mean(|r| r.medium.g)),
        text("sun_direction", format!("{} {} {}", sun.direction.x, sun.direction.y, sun.direction.z)),
        text("sun_irradiance", format!("{} {} {}", sun.irradiance[0], sun.irradiance[1], sun.irradiance[2])),
        number("sun_angle", sun.angular_diameter),
        text("source_hash", layout.source_hash.clone()),
    ]
}

fn closed(mut report: Report, clock: Clock) -> Report {
    report.seconds = clock.elapsed();
    report.stages = clock.stages;
    report.peak_memory = report::peak_memory();
    report
}

/// Seconds by stage.
struct Clock {
    start: Instant,
    last: Instant,
    stages: Vec<Stage>,
}

impl Clock {
    fn start() -> Self {
        Clock { start: Instant::now(), last: Instant::now(), stages: Vec::new() }
    }

    fn end(&mut self, stage: &'static str) {
        self.stages.push(Stage { stage, seconds: self.last.elapsed().as_secs_f64() });
        self.last = Instant::now();
    }

    fn elapsed(&self) -> f64 {
        self.start.elapsed().as_secs_f64()
    }
}
