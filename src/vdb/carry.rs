//! Grids of a file that go into another one as they are: their values, states, metadata and transforms are OpenVDB's own copies.

use super::{GridInfo, VdbFile, ffi};
use crate::error::{Error, Result};
use glam::DAffine3;
use std::path::PathBuf;

/// Grids of one file, to be written into another beside what is new there ([`super::write_beside`]). Nothing of their trees is in
/// memory before.
#[derive(Debug, Clone, Default)]
pub struct Carried {
    path: PathBuf,
    grids: Vec<(GridInfo, ffi::GridEntry)>,
    turn: Option<DAffine3>,
}

impl VdbFile {
    /// The grids for which `keep` holds, as they are in the file.
    pub fn carried(self, keep: impl Fn(&GridInfo) -> bool) -> Carried {
        let grids = self.grids.into_iter().zip(self.entries).filter(|(info, _)| keep(info)).collect();
        Carried { path: self.path, grids, turn: None }
    }
}

impl Carried {
    /// Those that can be written beside grids of these names, turned by `turn` after their own transforms; and for each that is
    /// left out, or is not turned whole, a sentence that says so.
    pub fn beside(mut self, names: &[&str], turn: Option<DAffine3>) -> (Self, Vec<String>) {
        let mut notes = Vec::new();
        self.turn = turn;
        self.grids.retain(|(info, entry)| {
            let who = format!("The file's grid {:?} ({})", info.name, info.value_type);
            if let Some(why) = obstacle(info, entry, names) {
                notes.push(format!("{who} is left out of what is written: {why}."));
                return false;
            }
            if turn.is_some() && info.value_type.starts_with("vec") {
                notes.push(format!("{who} is turned as a whole, but its vectors are as the file has them: Z up."));
            }
            true
        });
        (self, notes)
    }

    /// Adds the grids to those that wait.
    pub(super) fn add(&self, draft: &mut cxx::UniquePtr<ffi::Draft>) -> Result<()> {
        let turn = self.turn.map(|turn| turn.to_cols_array());
        let turn = turn.as_ref().map_or(&[][..], |turn| turn);
        for (info, entry) in &self.grids {
            draft.pin_mut().carry(self.path.as_os_str().as_encoded_bytes(), entry, turn).map_err(|error| Error::File {
                file: self.path.clone(),
                reason: format!("its grid {:?}, which would be written again as it is, cannot be read: {}", info.name, error.what()),
                fix: "Write the file again, or without that grid".into(),
            })?;
        }
        Ok(())
    }
}

/// Why a grid cannot be carried, in words that follow a colon.
fn obstacle(info: &GridInfo, entry: &ffi::GridEntry, names: &[&str]) -> Option<&'static str> {
    if names.contains(&info.name.as_str()) {
        Some("a new grid has its name")
    } else if !entry.checkable {
        Some("only trees of numbers, vectors and truth values, in OpenVDB's usual shape, are copied")
    } else if entry.tree_at < 0 {
        Some("its transform is of an unknown kind, or it is an instance of a grid that is not there")
    } else {
        None
    }
}
