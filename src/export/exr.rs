//! Pictures as OpenEXR.

use crate::error::{Error, Result};
use crate::film::Film;
use std::path::Path;

/// Writes a film to a file, layer by layer.
///
/// # Errors
/// [`Error::Usage`]: this is not there yet.
pub fn write(path: &Path, _: &Film) -> Result<()> {
    Err(Error::Usage(format!("{}: writing .exr is not there yet", path.display())))
}
