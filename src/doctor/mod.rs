//! What would make a VDB look wrong or empty in Blender, and the fix: `cloudvdb doctor`.
//!
//! Every limit here was tried in Blender 4.5 and 5.2 (with Cycles), or is read off Blender's source where it says so; the
//! tests in `tests/python/test_doctor.py` try them again. One grid is judged as the density: the first that is named `density`,
//! because Blender shows that, or the one that was most likely meant ([`chosen`]).
//!
//! **Optical depth** is that of the thickest column of voxels along each of the grid's own axes: Density of the Principled Volume x sum
//! of the active values above 0 x length of a voxel along that axis in metres of the world, with the object's scale at 1.
//! Density is the file's `density_scale` where cloudvdb wrote one, else Blender's default, 1.

mod depth;
mod figure;
mod file;
mod grid;
mod light;
mod names;
mod place;
mod sequence;
mod table;
mod values;

pub use depth::Depth;
pub use file::{Format, examine};
pub use grid::{Grid, Transform, Values};
pub use names::chosen;

use serde::Serialize;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// The version of the JSON document. It rises where a key changes its meaning or goes; keys and ids may be added without.
pub const VERSION: u32 = 1;

/// How bad it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// Blender shows the file wrong, in part or not at all.
    Problem,
    /// Worth knowing; Blender shows the file, or a setting has to follow from it.
    Hint,
}

/// One thing that was found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    /// Its name, which stays: `no-density`.
    pub id: &'static str,
    /// How bad it is.
    pub severity: Severity,
    /// The grid it is about; absent where it is the file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub grid: Option<String>,
    /// What is wrong, in a sentence with the figure that decided.
    pub says: String,
    /// What to do about it.
    pub fix: String,
}

/// All about a file.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// The version of this document, [`VERSION`].
    pub doctor: u32,
    /// The program's version.
    pub cloudvdb: &'static str,
    /// The file as named.
    pub file: PathBuf,
    /// Its size.
    pub bytes: u64,
    /// What wrote it.
    pub format: Format,
    /// Its own metadata.
    pub metadata: BTreeMap<String, serde_json::Value>,
    /// Its grids, in its order.
    pub grids: Vec<Grid>,
    /// The optical depth of the grid that was judged; absent where it cannot be said.
    pub optical_depth: Option<Depth>,
    /// Problems first.
    pub findings: Vec<Finding>,
    /// Whether no finding is a problem.
    pub healthy: bool,
}

impl Report {
    /// The document, indented.
    pub fn json(&self) -> String {
        // Nothing in it can fail: keys are text, and numbers that are not finite become null.
        serde_json::to_string_pretty(self).unwrap_or_default()
    }

    /// The same for people.
    pub fn table(&self) -> String {
        table::table(self)
    }
}

/// Where findings gather.
#[derive(Debug, Default)]
struct Findings {
    all: Vec<Finding>,
}

impl Findings {
    /// Adds one that is about the file.
    fn file(&mut self, id: &'static str, severity: Severity, says: String, fix: impl Into<String>) {
        self.all.push(Finding { id, severity, grid: None, says, fix: fix.into() });
    }

    /// Adds one that is about a grid.
    fn grid(&mut self, grid: &Grid, id: &'static str, severity: Severity, says: String, fix: impl Into<String>) {
        self.all.push(Finding { id, severity, grid: Some(grid.name.clone()), says, fix: fix.into() });
    }
}

#[cfg(test)]
mod tests;
