//! The file as a whole: read, judged, sorted.

use super::depth::{self, Depth};
use super::figure::count;
use super::grid::{Grid, metadata};
use super::{Findings, Report, Severity, VERSION, light, names, place, sequence, values};
use crate::error::{Error, Result};
use crate::vdb::{self, Unread};
use serde::Serialize;
use std::path::Path;

/// The version of the format since OpenVDB 4 (2016).
const CURRENT: u32 = 224;

/// What wrote a file.
#[derive(Debug, Clone, Serialize)]
pub struct Format {
    /// The version of the format: 224 since 2016.
    pub version: u32,
    /// The OpenVDB that wrote it: `10.0`.
    pub library: String,
}

/// Looks through a VDB and says what would make it look wrong or empty in Blender.
///
/// The largest of its trees is held in memory. The folder it is in is read too, for files numbered alike.
///
/// # Errors
/// [`Error::File`] when the file cannot be opened, is no VDB, is damaged outside its trees, or of a format from before 2013.
pub fn examine(path: &Path) -> Result<Report> {
    let refused = |error| match error {
        Error::Vdb { file, message } => Error::File {
            file,
            reason: format!("this is no VDB that can be read: {message}"),
            fix: "Copy or download it again; else export it again from where it was made".into(),
        },
        other => other,
    };
    let contents = vdb::examine(path).map_err(refused)?;
    let grids: Vec<Grid> = contents.grids.into_iter().map(Grid::of).collect();
    let mut findings = Findings::default();
    if contents.version < CURRENT {
        findings.file(
            "old-format",
            Severity::Hint,
            format!(
                "The format's version is {}, from before 2016; now it is {CURRENT}. Blender reads it, small readers may not.",
                contents.version
            ),
            "Save it again with any program of today",
        );
    }
    sequence::judge(path, &mut findings);
    light::judge(&grids, &mut findings);
    let optical_depth = judge(&grids, &mut findings);
    findings.all.sort_by_key(|finding| finding.severity == Severity::Hint);
    Ok(Report {
        doctor: VERSION,
        cloudvdb: env!("CARGO_PKG_VERSION"),
        file: path.into(),
        bytes: std::fs::metadata(path).map_or(0, |data| data.len()),
        format: Format { version: contents.version, library: format!("{}.{}", contents.library[0], contents.library[1]) },
        metadata: metadata(&contents.metadata),
        healthy: findings.all.iter().all(|finding| finding.severity == Severity::Hint),
        grids,
        optical_depth,
        findings: findings.all,
    })
}

/// Judges the grids; says how deep the density is.
pub(super) fn judge(grids: &[Grid], findings: &mut Findings) -> Option<Depth> {
    for grid in grids {
        if let Some(Unread::Damaged(why)) = &grid.unread {
            let says = format!("The grid {:?} cannot be read: {why}. Blender may show nothing, or stop.", grid.name);
            findings.grid(grid, "damaged", Severity::Problem, says, "Copy or download the file again; else export it again");
        }
    }
    names::judge(grids, findings);
    let grid = names::chosen(grids)?;
    let values = grid.values.as_ref()?;
    if values.active_voxels == 0 || (values.highest <= 0.0 && values.nan + values.infinite == 0) {
        let what = match values.active_voxels {
            0 if values.inactive > 0 => {
                format!("no voxel is active, though {} other than 0", count(values.inactive, "inactive voxel"))
            }
            0 => "no voxel is active".into(),
            n => format!("of {} the largest is {}", count(n, "active value"), values.highest),
        };
        let fix = "Export it again with something in it: check the frame, the resolution and which field was written";
        findings.grid(grid, "empty", Severity::Problem, format!("The grid {:?} is empty: {what}. Nothing shows.", grid.name), fix);
        return None;
    }
    place::judge(grid, values, findings);
    if grid.is_level_set() {
        let says = format!(
            "The grid {:?} is a level set: its values are distances to a surface, {} to {} m. Blender takes them for densities and shows a \
             thin shell outside the surface.",
            grid.name,
            super::figure::figure(values.lowest),
            super::figure::figure(values.highest)
        );
        let fix = "Convert it to a fog volume: Houdini's Convert VDB, OpenVDB's sdfToFogVolume; or in Blender make a mesh of it (an empty \
                   mesh object with the modifier Volume to Mesh, Threshold 0), and of that a volume (Mesh to Volume)";
        findings.grid(grid, "level-set", Severity::Problem, says, fix);
        return None;
    }
    values::judge(grid, values, findings);
    depth::judge(grid, values, findings)
}
