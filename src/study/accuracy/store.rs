//! The study's folder: pictures that are done, a line for each, and at the end the tables, the plot and the page.

use super::figures::Figures;
use super::{Job, Setting, Stage, page};
use crate::error::{Error, Result};
use crate::export::staged::{Staged, write_bytes};
use crate::film::Film;
use crate::import::sky::read_exr;
use crate::study::chart;
use crate::study::journal::{Head, Journal};
use std::path::{Path, PathBuf};

const LINES: &str = "runs.jsonl";
const PICTURES: &str = "pictures";

/// A picture that is done.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Run {
    /// Its settings.
    #[serde(flatten)]
    pub setting: Setting,
    /// Its seed.
    pub seed: u64,
    /// How long it took.
    pub seconds: f64,
    /// The most memory that the process has held so far, bytes.
    pub peak_memory: u64,
    /// The relative error that it stated itself.
    pub stated: Option<f64>,
}

/// The folder.
pub(super) struct Store {
    folder: PathBuf,
    journal: Journal<Run>,
}

impl Store {
    /// Opens the folder, which is made where it is not there, and reads what it has.
    pub fn open(job: &Job, source: &str, stage: &Stage) -> Result<Self> {
        let head = Head::new(source, &job.import, &stage.view, stage.framed);
        let store = Store { folder: job.output.clone(), journal: Journal::open(&job.output, LINES, &head)? };
        std::fs::create_dir_all(job.output.join(PICTURES)).map_err(|e| Error::Write {
            target: job.output.join(PICTURES),
            reason: format!("cannot be made ({e})"),
            fix: "Check the permissions of the folder above it".into(),
        })?;
        Ok(store)
    }

    fn path(&self, setting: Setting, seed: u64) -> PathBuf {
        let name = super::figures::name(setting.integrator);
        let changed = setting.change.map_or(String::new(), |change| format!("_{}", change.to_string().replace(' ', "-")));
        self.folder.join(PICTURES).join(format!("{name}_{}{changed}_{seed}.exr", setting.work))
    }

    /// A run that is done, with its picture.
    pub fn run(&self, setting: Setting, seed: u64) -> Option<(Run, Vec<[f32; 3]>)> {
        let run = self.journal.done.iter().find(|run| run.setting == setting && run.seed == seed)?;
        Some((run.clone(), self.picture(setting, seed)?))
    }

    /// The picture of a run.
    pub fn picture(&self, setting: Setting, seed: u64) -> Option<Vec<[f32; 3]>> {
        read_exr(&self.path(setting, seed)).ok().map(|(_, _, texels)| texels)
    }

    /// What is missing though it was made.
    pub fn lost(&self, what: &str) -> Error {
        let fix = "Remove the folder, and study again";
        Error::Write { target: self.folder.clone(), reason: format!("{what} is not there any more"), fix: fix.into() }
    }

    /// Keeps a picture.
    pub fn add(&mut self, setting: Setting, seed: u64, seconds: f64, peak_memory: u64, stated: Option<f64>, film: &Film) -> Result<()> {
        let mut staged = Staged::default();
        staged.add(&self.path(setting, seed), |path| exr_of(path, film))?;
        staged.commit(true)?;
        self.journal.add(Run { setting, seed, seconds, peak_memory, stated })
    }

    /// Writes what the study found.
    pub fn write(&self, figures: &Figures) -> Result<()> {
        let drawn = chart::svg(figures);
        let page = page::page(figures, &drawn);
        let files = [
            ("study.csv", figures.csv().into_bytes()),
            ("study.json", figures.json().into_bytes()),
            ("error.svg", drawn.into_bytes()),
            ("error.png", chart::png(figures)),
            ("index.html", page.into_bytes()),
        ];
        let mut staged = Staged::default();
        for (name, bytes) in files.iter().filter(|(_, bytes)| !bytes.is_empty()) {
            staged.add(&self.folder.join(name), |path| write_bytes(path, bytes))?;
        }
        staged.commit(true)
    }
}

/// A picture's light as an EXR of three channels.
fn exr_of(path: &Path, film: &Film) -> Result<()> {
    let pixel = |x: usize, y: usize| {
        let [r, g, b] = film.pixels[y * film.width as usize + x].combined();
        (r, g, b)
    };
    exr::prelude::write_rgb_file(path, film.width as usize, film.height as usize, pixel).map_err(|e| Error::Write {
        target: path.into(),
        reason: e.to_string(),
        fix: "Check the space and the permissions".into(),
    })
}
