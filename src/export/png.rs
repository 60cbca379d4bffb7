//! Pictures as PNG.

use crate::error::{Error, Result};
use crate::film::Film;
use std::path::Path;

/// Writes a tone-mapped preview of a film to a file, `exposure` stops brighter.
///
/// # Errors
/// [`Error::Usage`]: this is not there yet.
pub fn write(path: &Path, _: &Film, _exposure: f64) -> Result<()> {
    Err(Error::Usage(format!("{}: writing .png is not there yet", path.display())))
}
