//! What is written, by the targets' extensions; and whether the job makes sense at all.

use super::Job;
use crate::error::{Error, Result};
use crate::export::staged::Staged;
use crate::import;
use crate::plan::Density;
use std::path::{Path, PathBuf};

/// What a file is, by its extension.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// OpenVDB grids.
    Vdb,
    /// The report.
    Json,
    /// Regions as glTF.
    Glb,
    /// A picture, in layers, linear.
    Exr,
    /// A picture to look at.
    Png,
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
            Some("exr") => Ok(Format::Exr),
            Some("png") => Ok(Format::Png),
            _ => Err(Error::Usage(format!(
                "-o {}: the extension says what is written, and must be .vdb (grids), .exr or .png (a picture), .json (the report) or .glb (the regions as spheres)",
                path.display()
            ))),
        }
    }
}

/// The targets of a run with their formats.
pub(super) struct Targets<'a>(Vec<(&'a PathBuf, Format)>);

impl<'a> Targets<'a> {
    /// Looks at what is to be read and written, before any work is done.
    ///
    /// # Errors
    /// [`Error::Usage`] where a target is the input, or what it asks for is not there; [`Error::Write`] as [`Staged::check`].
    pub fn of(job: &'a Job) -> Result<Self> {
        let formats = job.outputs.iter().map(|o| Format::of(o).map(|format| (o, format))).collect::<Result<Vec<_>>>()?;
        check_density(&job.input, job.density)?;
        if let Some((target, _)) = formats.iter().find(|(_, f)| *f == Format::Glb && import::is_vdb(&job.input)) {
            return Err(Error::Usage(format!(
                "-o {}: the grids of a .vdb are no regions that glTF can hold: write .vdb",
                target.display()
            )));
        }
        Staged::check(&job.outputs, job.overwrite)?;
        if let Some(same) = job.outputs.iter().find(|o| o.canonicalize().is_ok_and(|o| job.input.canonicalize().is_ok_and(|i| i == o))) {
            return Err(Error::Usage(format!("-o {} is the layout itself: name another file", same.display())));
        }
        Ok(Targets(formats))
    }

    /// The targets of a format.
    pub fn each(&self, format: Format) -> impl Iterator<Item = &'a PathBuf> {
        self.0.iter().filter(move |(_, f)| *f == format).map(|(target, _)| *target)
    }

    /// Whether any target has a format.
    pub fn any(&self, format: Format) -> bool {
        self.each(format).next().is_some()
    }
}

/// Refuses the duality of an input that has none yet.
///
/// # Errors
/// [`Error::Usage`].
pub fn check_density(input: &Path, density: Density) -> Result<()> {
    if density == Density::Duality && import::is_vdb(input) {
        return Err(Error::Usage(format!("{}: the duality of voxel grids is not there yet: use --density source", input.display())));
    }
    Ok(())
}

/// The density of an input for which nobody says one: the duality of a layout, a VDB as it is.
pub fn usual_density(input: &Path) -> Density {
    if import::is_vdb(input) { Density::Source } else { Density::Duality }
}
