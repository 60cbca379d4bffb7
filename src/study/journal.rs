//! What a study has done so far: a line of JSON for each thing that ended, after one that says of what. Interrupted, it goes on.

use crate::error::{Error, Result};
use crate::import::ImportOptions;
use crate::scene::{Framed, View};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::io::Write;
use std::path::{Path, PathBuf};

/// What the lines are of: a scene as it was read and looked at.
#[derive(PartialEq, Serialize, Deserialize)]
pub(super) struct Head {
    scene: String,
    said: String,
    size: [u32; 2],
}

impl Head {
    /// Of a file by its hash, and what flags said.
    pub fn new(source_hash: &str, import: &ImportOptions, view: &View, framed: &Framed) -> Self {
        Head { scene: source_hash.into(), said: format!("{import:?} {view:?}"), size: [framed.width, framed.height] }
    }
}

/// The lines of a file in a study's folder.
pub(super) struct Journal<T> {
    path: PathBuf,
    /// What is done.
    pub done: Vec<T>,
}

impl<T: Serialize + DeserializeOwned> Journal<T> {
    /// Opens the journal of that name in a folder, which is made where it is not there.
    ///
    /// # Errors
    /// [`Error::Write`] where the folder is none, or the journal is of something else than `head` says.
    pub fn open(folder: &Path, name: &str, head: &Head) -> Result<Self> {
        let wrong = |reason: String, fix: &str| Err(Error::Write { target: folder.into(), reason, fix: fix.into() });
        if folder.exists() && !folder.is_dir() {
            return wrong("is a file, and a study is written into a folder".into(), "Name a folder: -o study/");
        }
        if let Err(e) = std::fs::create_dir_all(folder) {
            return wrong(format!("cannot be made ({e})"), "Check the permissions of the folder above it");
        }
        let mut journal = Journal { path: folder.join(name), done: Vec::new() };
        let text = std::fs::read_to_string(&journal.path).unwrap_or_default();
        let mut lines = text.lines();
        match lines.next().map(serde_json::from_str::<Head>) {
            None => journal.append(head)?,
            Some(Ok(known)) if known == *head => {}
            Some(_) => {
                return wrong(
                    "holds the study of another scene, or of the same with other flags or another size".into(),
                    "Name another folder, or remove this one",
                );
            }
        }
        // A line that was cut is work that is done again.
        journal.done = lines.filter_map(|line| serde_json::from_str(line).ok()).collect();
        if !text.is_empty() && !text.ends_with('\n') {
            journal.put("\n")?;
        }
        Ok(journal)
    }

    /// Keeps what has ended.
    pub fn add(&mut self, entry: T) -> Result<()> {
        self.append(&entry)?;
        self.done.push(entry);
        Ok(())
    }

    fn put(&self, text: &str) -> Result<()> {
        let written = std::fs::OpenOptions::new().create(true).append(true).open(&self.path);
        written.and_then(|mut file| file.write_all(text.as_bytes())).map_err(|e| self.failed(&e))
    }

    fn append(&self, line: &impl Serialize) -> Result<()> {
        let text = serde_json::to_string(line).map_err(|e| self.failed(&e))?;
        self.put(&(text + "\n"))
    }

    fn failed(&self, error: &dyn std::fmt::Display) -> Error {
        Error::Write {
            target: self.path.clone(),
            reason: format!("cannot be written ({error})"),
            fix: "Check the space and the permissions".into(),
        }
    }
}
