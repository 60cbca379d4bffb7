//! `cloudvdb study SCENE --duality`: how far what the duality makes is from the layout that it is made of, by photons, photons in an
//! estimate, and placement.
//!
//! Balls of the layout's volume at random centres overlap: of a place that c of them cover on average, e^-c stays uncovered,
//! whatever the number of photons. What closes that is more balls of thinner medium: k dualities by k seeds, each with 1/k of the
//! extinction, have the same optical mass together, and leave about the k-th power of it ([`Setting::layers`]).
//!
//! Every run is measured at the same points and along the same lines ([`measure`]), and is a line in `duality.jsonl` as it ends.

mod measure;
mod plot;
mod tables;

use super::accuracy::sized;
use super::chart;
use super::journal::{Head, Journal};
use crate::error::{Error, Result};
use crate::export::staged::{Staged, write_bytes};
use crate::import::{self, ImportOptions};
use crate::integrate::Integrator;
use crate::photon::Model;
use crate::pipeline::{self, Clock, Pass1, Picture, lit};
use crate::plan::Density;
use crate::progress::{Progress, agreed, meet};
use crate::regions::{Duality, Placement};
use crate::scene::{Framed, Medium, Region, Scene, View};
use crate::stats::Estimate;
use measure::{FIGURES, Truth};
use std::path::PathBuf;
use std::time::Instant;

/// Pixels in a row, and in a quick study.
const WIDE: [u32; 2] = [128, 64];
/// Seeds of each setting.
const SEEDS: [u64; 2] = [4, 3];
/// Samples a pixel of each half of the layout's picture, and of the regions'.
const SAMPLES: [(u32, u32); 2] = [(256, 32), (128, 16)];
/// Photons, and photons in an estimate, beside what the command takes where nobody says.
const PHOTONS: [&[u64]; 2] = [&[10_000, 100_000, 1_000_000], &[10_000, 100_000]];
const ESTIMATES: [&[u64]; 2] = [&[10, 100], &[10]];
/// Dualities that share the extinction.
const LAYERS: [&[u64]; 2] = [&[2, 4, 8], &[2, 4]];

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
    /// The first seed.
    pub seed: u64,
    /// Where the tables, the plot and the page go.
    pub output: PathBuf,
}

/// Settings of the duality but its seed.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Setting {
    /// Where candidates are drawn.
    pub placement: Placement,
    /// Photons stored.
    pub photons: u64,
    /// Photons in an estimate; absent for the square root of a region's.
    pub estimate: Option<u64>,
    /// Dualities that share the extinction: 1 is the thesis's.
    pub layers: u64,
}

/// One synthesis, in figures.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
struct Run {
    #[serde(flatten)]
    setting: Setting,
    seed: u64,
    /// Of the synthesis alone.
    seconds: f64,
    regions: u64,
    /// By [`measure::NAMES`]; absent where no region came out.
    figures: Option<[f64; FIGURES]>,
}

/// All seeds of a setting.
#[derive(Debug, Clone, serde::Serialize)]
pub struct Cell {
    /// The setting.
    #[serde(flatten)]
    pub setting: Setting,
    /// Seeds by which something came out.
    pub seeds: usize,
    /// The mean over seeds of a synthesis's seconds, and of its regions.
    pub seconds: f64,
    /// New regions, the mean over seeds.
    pub regions: f64,
    /// By [`measure::NAMES`], the mean over seeds with its standard error; absent where no region came out.
    pub figures: Option<[Estimate; FIGURES]>,
}

/// What the study found.
#[derive(Debug, Clone, serde::Serialize)]
pub struct Findings {
    /// The scene's file.
    pub scene: String,
    /// Pixels.
    pub size: [u32; 2],
    /// What the entries of each cell's `figures` are.
    pub names: [&'static str; FIGURES],
    /// By setting.
    pub cells: Vec<Cell>,
    /// Pictures of the layout, of its regions, and of the most layers, RGB.
    #[serde(skip)]
    pictures: Vec<(String, Vec<[f32; 3]>)>,
}

/// What is looked at: one thing is changed at a time.
fn settings(quick: usize) -> Vec<Setting> {
    let mut all = Vec::new();
    for placement in [Placement::Uniform, Placement::Importance] {
        for &photons in PHOTONS[quick] {
            for estimate in std::iter::once(None).chain(ESTIMATES[quick].iter().map(|&n| Some(n))) {
                all.push(Setting { placement, photons, estimate, layers: 1 });
            }
        }
        let usual = Setting { placement, photons: 100_000, estimate: None, layers: 1 };
        all.extend(LAYERS[quick].iter().map(|&layers| Setting { layers, ..usual }));
    }
    all
}

/// Measures what is not measured yet, writes the tables, the plot and the page, and gives what it found; of several ranks one does. `told`
/// gets a line for each synthesis.
///
/// # Errors
/// Those of the main job; [`Error::Interrupted`], after which the next run goes on; [`Error::Scene`] where a region goes on without end, or
/// no pixel receives light; [`Error::Write`] where the folder holds the study of another scene, or is none.
pub fn study(job: &Job, told: &dyn Fn(&str), progress: &dyn Progress) -> Result<Option<Findings>> {
    let quick = usize::from(job.quick);
    let layout = import::load(&job.input, &job.import, progress)?;
    let scene = &layout.scene;
    if let Some(region) = scene.regions.iter().find(|r| r.shape.is_endless()) {
        return Err(Error::Scene {
            reason: format!("region {:?} goes on without end, and its new regions do not: there is nothing to compare", region.name),
            fix: "Study a layout of balls, meshes or grids".into(),
        });
    }
    let view = sized(&job.view, WIDE[quick], scene).map_err(|e| e.of_file(&job.input))?;
    let framed = view.frame(scene).map_err(|e| e.of_file(&job.input))?;
    meet(|| format!("{job:?} {}", layout.source_hash), progress)?;
    // Of several ranks one keeps what is measured, and the others help to measure.
    let leads = progress.leads();
    let head = Head::new(&layout.source_hash, &job.import, &view, &framed);
    let mut journal: Option<Journal<Run>> = if leads { Some(Journal::open(&job.output, "duality.jsonl", &head)?) } else { None };
    let stage = Stage { scene, framed: &framed, view, spp: SAMPLES[quick] };
    let truth = Truth::new(&stage, progress)?;
    let mut cells = Vec::new();
    for setting in settings(quick) {
        for seed in job.seed..job.seed + SEEDS[quick] {
            let there = journal.as_ref().is_some_and(|j| j.done.iter().any(|run| run.setting == setting && run.seed == seed));
            if agreed([f64::from(there)], progress)? == [1.0] {
                continue;
            }
            let run = stage.run(setting, seed, &truth, progress).map_err(|e| e.of_file(&job.input))?;
            told(&tables::line(&run));
            if let Some(journal) = &mut journal {
                journal.add(run)?;
            }
        }
        let mine = |run: &&Run| run.setting == setting && (job.seed..job.seed + SEEDS[quick]).contains(&run.seed);
        if let Some(journal) = &journal {
            cells.push(Cell::new(setting, &journal.done.iter().filter(mine).collect::<Vec<_>>()));
        }
    }
    let mut pictures = vec![("the layout".into(), truth.picture.clone())];
    for layers in [1, LAYERS[quick][LAYERS[quick].len() - 1]] {
        let setting = Setting { placement: Placement::Uniform, photons: 100_000, estimate: None, layers };
        if let Some((regions, _)) = stage.synthesise(setting, job.seed, progress)? {
            pictures
                .push((format!("{layers} duality(s) of {}k photons", setting.photons / 1000), stage.take(&regions, job.seed, progress)?));
        }
    }
    if !leads {
        return Ok(None);
    }
    let name = job.input.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let findings = Findings { scene: name, size: [framed.width, framed.height], names: measure::NAMES, cells, pictures };
    let drawn = chart::svg(&findings);
    let page = tables::page(&findings, &drawn);
    let files = [
        ("duality.csv", findings.csv().into_bytes()),
        ("duality.json", findings.json().into_bytes()),
        ("duality.svg", drawn.into_bytes()),
        ("duality.png", chart::png(&findings)),
        ("duality.html", page.into_bytes()),
    ];
    let mut staged = Staged::default();
    for (name, bytes) in files.iter().filter(|(_, bytes)| !bytes.is_empty()) {
        staged.add(&job.output.join(name), |path| write_bytes(path, bytes))?;
    }
    staged.commit(true)?;
    Ok(Some(findings))
}

/// The scene before the camera.
struct Stage<'a> {
    scene: &'a Scene,
    framed: &'a Framed,
    view: View,
    spp: (u32, u32),
}

impl Stage<'_> {
    /// The regions of a setting, and the optical mass that they should have and have; `None` where none came out.
    fn synthesise(&self, setting: Setting, seed: u64, progress: &dyn Progress) -> Result<Option<(Vec<Region>, f64)>> {
        let (mut regions, mut made) = (Vec::new(), 0.0);
        for layer in 0..setting.layers {
            let seed = seed * 1000 + layer;
            let duality = Duality { model: Model::Physical, placement: setting.placement, estimate: setting.estimate, seed };
            let pass1 = match Pass1::of(self.scene, setting.photons, &duality, &mut Clock::start(), progress) {
                Err(Error::Scene { .. }) => return Ok(None),
                pass1 => pass1?,
            };
            made += pass1.synthesis.sources.iter().map(|s| s.synthesised).sum::<f64>() / setting.layers as f64;
            regions.extend(pass1.synthesis.regions.into_iter().map(|r| thinned(r, setting.layers as f64)));
        }
        Ok(Some((regions, made / self.scene.optical_mass())))
    }

    fn run(&self, setting: Setting, seed: u64, truth: &Truth, progress: &dyn Progress) -> Result<Run> {
        let begun = Instant::now();
        let synthesised = self.synthesise(setting, seed, progress)?;
        let seconds = begun.elapsed().as_secs_f64();
        let (mut regions, mut figures) = (0, None);
        if let Some((made, mass)) = synthesised {
            regions = made.len() as u64;
            // Two pictures of other random numbers than any that made the regions, or that the layout's have.
            let halves = [self.take(&made, 2 * seed + 1, progress)?, self.take(&made, 2 * seed + 2, progress)?];
            figures = Some(truth.judge(&made, mass, &halves));
        }
        Ok(Run { setting, seed, seconds, regions, figures })
    }

    /// The path tracer's picture of regions in place of the layout's, W m^-2 sr^-1.
    fn take(&self, regions: &[Region], seed: u64, progress: &dyn Progress) -> Result<Vec<[f32; 3]>> {
        self.picture(&lit(self.scene, regions, Density::Duality), self.spp.1, seed, progress)
    }

    fn picture(&self, scene: &Scene, spp: u32, seed: u64, progress: &dyn Progress) -> Result<Vec<[f32; 3]>> {
        let picture = Picture { integrator: Some(Integrator::Path), spp: Some(spp), view: self.view, ..Picture::default() };
        let settings = picture.settings(scene, self.framed, 0, &Duality { seed, ..Duality::default() });
        let (film, _) = pipeline::take(scene, self.framed, &settings, None, progress)?;
        progress.check()?;
        Ok(film.pixels.iter().map(|p| p.combined()).collect())
    }
}

/// A region with 1/k of its extinction.
fn thinned(region: Region, k: f64) -> Region {
    let Medium { sigma_s, sigma_a, g } = region.medium;
    Region { medium: Medium { sigma_s: sigma_s.map(|s| s / k), sigma_a: sigma_a.map(|s| s / k), g }, ..region }
}

impl Cell {
    fn new(setting: Setting, runs: &[&Run]) -> Self {
        let some: Vec<[f64; FIGURES]> = runs.iter().filter_map(|run| run.figures).collect();
        let n = some.len() as f64;
        let of = |i: usize| {
            let value = some.iter().map(|f| f[i]).sum::<f64>() / n;
            let scatter: f64 = some.iter().map(|f| (f[i] - value).powi(2)).sum();
            Estimate { value, se: if n > 1.0 { (scatter / (n - 1.0) / n).sqrt() } else { 0.0 } }
        };
        let mean = |of: fn(&Run) -> f64| runs.iter().map(|run| of(run)).sum::<f64>() / runs.len() as f64;
        Cell {
            setting,
            seeds: some.len(),
            seconds: mean(|run| run.seconds),
            regions: mean(|run| run.regions as f64),
            figures: (!some.is_empty()).then(|| std::array::from_fn(of)),
        }
    }
}
