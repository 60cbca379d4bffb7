//! What a run says about itself: the report's parts, the file's metadata, seconds by stage.

use super::Job;
use super::pass1::Pass1;
use crate::export::report::{self, Energy, Errors, Mass, Photons, Regions, Report, Settings, Stage};
use crate::import::Layout;
use crate::plan::Plan;
use crate::regions::Duality;
use crate::scene::Scene;
use crate::vdb::Meta;
use std::time::Instant;

/// What the report says before anything is traced.
pub(super) fn opening(job: &Job, layout: &Layout, plan: &Plan) -> Report {
    let Duality { model, placement, estimate, seed } = job.duality;
    Report {
        cloudvdb: env!("CARGO_PKG_VERSION"),
        input: job.input.clone(),
        source_hash: layout.source_hash.clone(),
        settings: Settings {
            density: job.density,
            model,
            placement,
            photons: job.photons,
            estimate,
            seed,
            grid: job.import.grid.clone(),
            overrides: job.import.overrides,
        },
        found: layout.findings.clone(),
        notes: layout.notes.iter().cloned().chain(grain(&layout.scene)).collect(),
        plan: plan.clone(),
        regions: Regions { source: layout.scene.regions.len(), ..Regions::default() },
        optical_mass: Mass { source: layout.scene.optical_mass(), ..Mass::default() },
        photons: None,
        energy: None,
        error: None,
        vdb: None,
        bake: None,
        render: None,
        together: None,
        stages: Vec::new(),
        seconds: 0.0,
        peak_memory: 0,
        outputs: Vec::new(),
    }
}

/// What pass 1 and the duality add to the report.
pub(super) fn light(report: &mut Report, job: &Job, scene: &Scene, pass1: &Pass1, clock: &Clock) {
    let Pass1 { tracer, shot, synthesis } = pass1;
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
        let (thickest, emitted, stored) = (thickest(scene), shot.emitted, shot.map.len());
        let why = if thickest < 1.0 {
            format!("its thickest region has optical depth {thickest:.3}. Are its units right? A cloud has 10 and more")
        } else {
            "few photons met a region: the layout is sparse".into()
        };
        report.notes.push(format!("{emitted} emitted photons left only {stored} of the {} asked for: {why}", job.photons));
    }
    report.photons = Some(Photons::of(shot));
    report.energy = Some(Energy::of(shot));
    // A grid is made of as many balls as were accepted in it.
    let balls: u64 = synthesis.sources.iter().map(|s| s.regions).sum();
    let weighted: f64 = synthesis.sources.iter().map(|s| s.regions as f64 / (s.estimate as f64).sqrt()).sum();
    let (before, after) = tracer.sunlight_through(&synthesis.regions, job.duality.seed);
    // A search distance holds n photons where N are stored: n must grow fourfold, and with it N.
    let grow = if job.duality.estimate.is_some() { 4 } else { 16 };
    report.error = Some(Errors {
        photon_density: weighted / balls as f64,
        sunlight_through_layout: before,
        sunlight_through_regions: after,
        optical_mass: shortfall,
        photons_for_half: grow * shot.map.len(),
        seconds_for_half: grow as f64 * clock.elapsed(),
    });
    report.regions.synthesised = balls as usize;
    report.regions.sticking_out = synthesis.sticking_out;
    report.regions.sources.clone_from(&synthesis.sources);
}

/// A warning where positions in single precision cannot tell two collisions apart: the free path against their grain.
fn grain(scene: &Scene) -> Option<String> {
    let bounds = scene.region_bounds();
    let grain = bounds.size().max_element() * 0.5 * f64::from(f32::EPSILON);
    let densest = scene.regions.iter().max_by(|a, b| a.medium.sigma_t().total_cmp(&b.medium.sigma_t()))?;
    let path = 1.0 / densest.medium.sigma_t();
    (path < 16.0 * grain).then(|| {
        format!(
            "the free path in {:?} is {path:.1e} m, and positions in a scene of this size are known to {grain:.1e} m: photons stick there, and its absorption is too high. Lower its sigma_t, or make the scene smaller",
            densest.name
        )
    })
}

/// The optical depth across the region that is thickest by it.
fn thickest(scene: &Scene) -> f64 {
    scene.regions.iter().map(|r| r.medium.sigma_t() * r.shape.thickness()).fold(0.0, f64::max)
}

/// What is said of a picture that was interrupted.
pub(super) fn cut_short(done: f64) -> String {
    format!(
        "interrupted: {:.0} % of the pixels were done, and the others are from a quicker picture; the stated errors are those of each",
        100.0 * done
    )
}

/// What a file with light says of that light's error: by how much blocks of its picture differ from the path tracer's, from its camera.
/// The room for it is there before, because the file may have to fit a size.
pub(super) fn light_error(metadata: &mut [(String, Meta)], report: &Report) {
    let error = report.bake.as_ref().and_then(|bake| bake.errors.first());
    if let Some((error, (_, value))) = error.zip(metadata.iter_mut().find(|(key, _)| key == LIGHT_ERROR)) {
        *value = Meta::Float(error.rms);
    }
}

const LIGHT_ERROR: &str = "light_error";

/// What the file says about itself.
pub(super) fn metadata(job: &Job, layout: &Layout, report: &Report) -> Vec<(String, Meta)> {
    let text = |key: &str, value: String| (key.to_string(), Meta::Text(value));
    let number = |key: &str, value: f64| (key.to_string(), Meta::Float(value));
    let scene = &layout.scene;
    let sun = scene.sun;
    let name = |v: serde_json::Result<serde_json::Value>| v.ok().and_then(|v| v.as_str().map(String::from)).unwrap_or_default();
    vec![
        text("creator", concat!("cloudvdb ", env!("CARGO_PKG_VERSION")).into()),
        text("cloudvdb_version", env!("CARGO_PKG_VERSION").into()),
        text("cloudvdb_density", name(serde_json::to_value(job.density))),
        text("cloudvdb_model", name(serde_json::to_value(job.duality.model))),
        ("cloudvdb_seed".into(), Meta::Int(job.duality.seed as i64)),
        ("cloudvdb_photons".into(), Meta::Int(report.photons.map_or(0, |p| p.stored) as i64)),
        number("sigma_t", scene.mean(|r| r.medium.sigma_t())),
        number("albedo", scene.mean(|r| r.medium.albedo())),
        number("g", scene.mean(|r| r.medium.g)),
        text("sun_direction", format!("{} {} {}", sun.direction.x, sun.direction.y, sun.direction.z)),
        text("sun_irradiance", format!("{} {} {}", sun.irradiance[0], sun.irradiance[1], sun.irradiance[2])),
        number("sun_angle", sun.angular_diameter),
        text("source_hash", layout.source_hash.clone()),
    ]
    .into_iter()
    .chain(report.error.map(|error| number("photon_density_error", error.photon_density)))
    .chain(job.bake.light.filter(|_| job.bake.checked).map(|_| number(LIGHT_ERROR, 0.0)))
    .collect()
}

/// The report with its seconds and its memory.
pub(super) fn closed(mut report: Report, clock: Clock) -> Report {
    report.seconds = clock.elapsed();
    report.stages = clock.stages;
    report.peak_memory = report::peak_memory();
    report
}

/// Seconds by stage.
pub struct Clock {
    start: Instant,
    last: Instant,
    stages: Vec<Stage>,
}

impl Clock {
    /// From now on.
    pub fn start() -> Self {
        Clock { start: Instant::now(), last: Instant::now(), stages: Vec::new() }
    }

    pub(super) fn end(&mut self, stage: &'static str) {
        self.stages.push(Stage { stage, seconds: self.last.elapsed().as_secs_f64() });
        self.last = Instant::now();
    }

    pub(super) fn elapsed(&self) -> f64 {
        self.start.elapsed().as_secs_f64()
    }
}
