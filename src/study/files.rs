//! What a study writes into its folder.

use super::one::Given;
use super::thesis::CUMULUS;
use super::{Findings, Job, Part};
use crate::error::{Error, Result};
use crate::export::png;
use crate::export::staged::{Staged, write_bytes};
use crate::film::Film;
use crate::progress::Progress;
use std::path::{Path, PathBuf};

/// The names of a part's pictures.
pub(super) fn names(part: Part, given: &Given) -> Vec<String> {
    match part {
        Part::Test(CUMULUS) => vec!["cumulus.png".into()],
        Part::Test(number) => vec![format!("test{number}.png")],
        Part::Savings => {
            let regions = given.layout.scene.regions.len();
            ["source", "duality", "reference"].map(|name| format!("savings{regions}_{name}.png")).into()
        }
    }
}

/// The files of a study, all of them or none.
pub(super) struct Files<'a> {
    folder: &'a Path,
    overwrite: bool,
}

/// The names of the tables.
const TABLES: [&str; 3] = ["tests.csv", "savings.csv", "study.json"];

impl<'a> Files<'a> {
    /// Looks at the folder before any work is done.
    pub fn of(job: &'a Job, parts: &[(Part, &Given)]) -> Result<Option<Self>> {
        let Some(folder) = &job.output else { return Ok(None) };
        let files = Files { folder, overwrite: job.overwrite };
        let wrong = |reason: &str, fix: &str| Err(Error::Write { target: folder.clone(), reason: reason.into(), fix: fix.into() });
        if !folder.exists() {
            let above = folder.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
            return if above.is_dir() { Ok(Some(files)) } else { wrong("the folder above it is not there", "Make it first") };
        }
        if !folder.is_dir() {
            return wrong("is a file, and a study is written into a folder", "Name a folder: -o study/");
        }
        let names = parts.iter().flat_map(|&(part, given)| names(part, given));
        let targets: Vec<PathBuf> = names.chain(TABLES.map(String::from)).map(|name| folder.join(name)).collect();
        Staged::check(&targets, job.overwrite)?;
        Ok(Some(files))
    }

    /// Writes all of them, and the folder where it is not there.
    pub fn write(&self, findings: &Findings, pictures: &[(String, Film)], progress: &dyn Progress) -> Result<()> {
        let folder = self.folder;
        let made = !folder.exists();
        let failed = |e: std::io::Error| Error::Write {
            target: folder.into(),
            reason: format!("cannot be made ({e})"),
            fix: "Check the permissions of the folder above it".into(),
        };
        if made {
            std::fs::create_dir(folder).map_err(failed)?;
        }
        let written = self.stage(findings, pictures).and_then(|staged| {
            progress.check()?;
            staged.commit(self.overwrite)
        });
        if made && written.is_err() {
            // Only an empty folder goes.
            let _ = std::fs::remove_dir(folder);
        }
        written
    }

    fn stage(&self, findings: &Findings, pictures: &[(String, Film)]) -> Result<Staged> {
        let mut staged = Staged::default();
        for (name, film) in pictures {
            staged.add(&self.folder.join(name), |path| png::write(path, film, 0.0))?;
        }
        let tables = [findings.tests_csv(), findings.savings_csv(), findings.json() + "\n"];
        for (name, text) in TABLES.iter().zip(tables) {
            staged.add(&self.folder.join(name), |path| write_bytes(path, text.as_bytes()))?;
        }
        Ok(staged)
    }
}
