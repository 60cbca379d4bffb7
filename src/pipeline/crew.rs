//! What ranks of a run have to agree on, beside the work itself.

use super::Job;
use crate::error::Result;
use crate::import::Layout;
use crate::progress::{self, Progress, Spent};
use std::path::PathBuf;

/// All ranks say what they work at: the same version, scene and settings. Where files go, and under which name, is nobody's matter; which
/// files there are says what is to be done.
pub(super) fn meet(job: &Job, layout: &Layout, progress: &dyn Progress) -> Result<()> {
    let kinds = job.outputs.iter().map(|o| PathBuf::from(o.extension().unwrap_or_default())).collect();
    let settings = Job { input: PathBuf::new(), outputs: kinds, overwrite: false, ..job.clone() };
    let (version, scene) = (env!("CARGO_PKG_VERSION"), &layout.scene);
    progress::meet(|| format!("{version} {} {settings:?} {:?}", layout.source_hash, scene.optical_mass()), progress)
}

/// What working together has taken.
pub(super) fn spent(progress: &dyn Progress) -> Result<Option<Spent>> {
    progress.crew().map_or(Ok(None), |crew| crew.spent(progress))
}
