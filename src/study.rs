//! `cloudvdb study --paper`: the thesis's evaluation (chapter 4) again, beside its own figures, and what its duality saves and loses.
//!
//! Each test makes regions by the duality and takes a picture by the photon integrator, as the main job does with the same
//! settings; its seconds are of both, its memory is the most that the process held meanwhile (the system's high-water mark,
//! set back before each test). The duality is repeated with other seeds, which tell how far a count scatters.

use crate::error::{Error, Result};
use crate::export::report::Render;
use crate::film::Film;
use crate::import::{self, ImportOptions};
use crate::integrate::Integrator;
use crate::integrate::photon::Gathering;
use crate::photon::Model;
use crate::pipeline::check_gather;
use crate::plan::Density;
use crate::progress::{Progress, meet};
use files::{Files, names};
use one::{Given, How, count, take};
use serde::Serialize;
use std::path::PathBuf;
use std::time::Instant;
use thesis::{CUMULUS, SIZE, TESTS, Test};

pub mod accuracy;
mod chart;
pub mod duality;
mod files;
mod journal;
mod one;
mod savings;
mod table;
pub mod thesis;

pub use savings::{Savings, Side};

/// What to study.
#[derive(Debug, Clone)]
pub struct Job {
    /// The thesis's layouts, in any order: of one, two, three, or many regions.
    pub inputs: Vec<PathBuf>,
    /// What is run; `None` is all that the layouts allow.
    pub parts: Option<Vec<Part>>,
    /// The reading of the thesis, of its tests.
    pub model: Model,
    /// Where the cumulus's picture looks for photons; `None` is along beams in the physical model, and by marching else.
    pub gather: Option<Gathering>,
    /// Pixels of the cumulus's picture.
    pub size: [u32; 2],
    /// The seed of the pictures, and the first of the duality.
    pub seed: u64,
    /// Seeds of the duality, one after another.
    pub seeds: u64,
    /// The folder for pictures and tables.
    pub output: Option<PathBuf>,
    /// Whether files in it may be replaced.
    pub overwrite: bool,
}

/// A part of the study.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// A test by its number in tables 3 and 4, or [`CUMULUS`].
    Test(u8),
    /// Research question 2, of each layout of up to three regions.
    Savings,
}

/// What the study found.
#[derive(Debug, Clone, Serialize)]
pub struct Findings {
    /// The reading of the thesis, of its tests.
    pub model: Model,
    /// The first seed.
    pub seed: u64,
    /// Tables 3 and 4, and the cumulus.
    pub tests: Vec<Row>,
    /// Research question 2.
    pub savings: Vec<Savings>,
    /// Seconds in all.
    pub seconds: f64,
}

/// A test, ours beside the thesis's.
#[derive(Debug, Clone, Serialize)]
pub struct Row {
    /// Its number, or `cumulus`.
    pub test: String,
    /// The layout as named.
    pub input: PathBuf,
    /// Regions of the layout.
    pub regions: usize,
    /// Photons to store.
    pub photons: u64,
    /// Photons in an estimate.
    pub estimate: u64,
    /// Where the picture looks for photons.
    pub gather: Gathering,
    /// The thesis's figures.
    pub thesis: Test,
    /// Our seconds, of the duality and the picture.
    pub seconds: f64,
    /// The most memory that the process held meanwhile, bytes.
    pub peak_memory: u64,
    /// Regions created, for each seed.
    pub counts: Vec<u64>,
    /// The mean of `counts`.
    pub mean: f64,
    /// Their standard deviation; absent for one seed.
    pub deviation: Option<f64>,
    /// The picture.
    pub render: Render,
}

/// Runs the study; `told` hears of each line of the tables as it is known.
///
/// # Errors
/// Everything in [`crate::Error`]; nothing is written then.
pub fn study(job: &Job, told: &dyn Fn(&str), progress: &dyn Progress) -> Result<Findings> {
    let begun = Instant::now();
    check_gather(job.gather.unwrap_or_default(), job.model)?;
    progress.begin("import", 1);
    let given = load(&job.inputs, progress)?;
    let parts = chosen(job, &given)?;
    let hashes: Vec<&str> = given.iter().map(|given| given.layout.source_hash.as_str()).collect();
    meet(|| format!("{job:?} {hashes:?}"), progress)?;
    let leads = progress.leads();
    let files = if leads { Files::of(job, &parts)? } else { None };
    let mut findings = Findings { model: job.model, seed: job.seed, tests: Vec::new(), savings: Vec::new(), seconds: 0.0 };
    let mut pictures = Vec::new();
    for (part, given) in parts {
        let films = match part {
            Part::Test(number) => {
                let (row, film) = test(&TESTS[usize::from(number) - 1], given, job, progress)?;
                told(&table::row(&row));
                findings.tests.push(row);
                vec![film]
            }
            Part::Savings => {
                let (savings, films) = savings::compare(given, job, progress)?;
                told(table::savings(&savings).trim_end());
                findings.savings.push(savings);
                films.into()
            }
        };
        pictures.extend(names(part, given).into_iter().zip(films));
    }
    findings.seconds = begun.elapsed().as_secs_f64();
    if let Some(files) = files {
        files.write(&findings, &pictures, progress)?;
    }
    Ok(findings)
}

/// Reads the layouts.
fn load(inputs: &[PathBuf], progress: &dyn Progress) -> Result<Vec<Given>> {
    let mut all: Vec<Given> = Vec::new();
    for input in inputs {
        let given = Given { input: input.clone(), layout: import::load(input, &ImportOptions::default(), progress)? };
        let regions = &given.layout.scene.regions;
        if let Some(region) = regions.iter().find(|r| r.shape.is_endless() || given.layout.scene.voxel_grid().is_some()) {
            return Err(Error::Usage(format!(
                "{}: region {:?} is no ball, and the thesis's tests are of balls: name its scenes, scenes/hura2006_1.gltf and so on",
                input.display(),
                region.name
            )));
        }
        let same = |other: &&Given| other.layout.scene.regions.len().min(4) == regions.len().min(4);
        if let Some(other) = all.iter().find(same) {
            return Err(Error::Usage(format!(
                "{} has {} regions and {} has {}: name one layout for each of the thesis's (of one, two, three and more regions)",
                other.input.display(),
                other.layout.scene.regions.len(),
                input.display(),
                regions.len()
            )));
        }
        all.push(given);
    }
    all.sort_by_key(|given| given.layout.scene.regions.len());
    Ok(all)
}

/// What is run, with its layout, in the order of the tables.
fn chosen<'a>(job: &Job, given: &'a [Given]) -> Result<Vec<(Part, &'a Given)>> {
    let wanted = |part: Part| job.parts.as_ref().is_none_or(|parts| parts.contains(&part));
    let mut all = Vec::new();
    for test in TESTS.iter().filter(|t| wanted(Part::Test(t.number))) {
        match given.iter().find(|g| test.is_of(g.layout.scene.regions.len())) {
            Some(given) => all.push((Part::Test(test.number), given)),
            None if job.parts.is_some() => {
                return Err(Error::Usage(format!(
                    "--tests {}: it is of {}, and none of the layouts is; name it too, as in scenes/hura2006*.gltf",
                    test.name(),
                    if test.number == CUMULUS { "more than three regions".into() } else { format!("{} region(s)", test.regions) }
                )));
            }
            None => {}
        }
    }
    if wanted(Part::Savings) {
        let few = given.iter().filter(|g| g.layout.scene.regions.len() <= 3);
        all.extend(few.map(|given| (Part::Savings, given)));
    }
    if all.is_empty() {
        return Err(Error::Usage("--tests savings: it is of layouts of up to three regions, and none of these is".into()));
    }
    Ok(all)
}

/// One test.
fn test(test: &Test, given: &Given, job: &Job, progress: &dyn Progress) -> Result<(Row, Film)> {
    let beams = test.number == CUMULUS && job.model == Model::Physical;
    let usual = if beams { Gathering::Beam } else { Gathering::March };
    let gather = job.gather.filter(|_| test.number == CUMULUS).unwrap_or(usual);
    let how = How {
        integrator: Integrator::Photon,
        model: job.model,
        gather,
        photons: test.photons,
        estimate: test.estimate,
        size: if test.number == CUMULUS { job.size } else { SIZE },
        spp: thesis::SAMPLES,
        seed: job.seed,
    };
    let taken = take(given, Density::Duality, &how, progress)?;
    let mut counts = vec![taken.regions];
    for i in 1..job.seeds {
        counts.push(count(given, &How { seed: job.seed.wrapping_add(i), ..how }, progress)?);
    }
    let n = counts.len() as f64;
    let mean = counts.iter().sum::<u64>() as f64 / n;
    let square: f64 = counts.iter().map(|&c| (c as f64 - mean).powi(2)).sum();
    let row = Row {
        test: test.name(),
        input: given.input.clone(),
        regions: given.layout.scene.regions.len(),
        photons: test.photons,
        estimate: test.estimate,
        gather,
        thesis: *test,
        seconds: taken.seconds,
        peak_memory: taken.memory,
        mean,
        deviation: (counts.len() > 1).then(|| (square / (n - 1.0)).sqrt()),
        counts,
        render: taken.render,
    };
    Ok((row, taken.film))
}
