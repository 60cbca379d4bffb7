//! `cloudvdb doctor`: why a VDB looks wrong in Blender, and the fix.

use super::print;
use crate::doctor::examine;
use crate::error::Error;
use clap::Args;
use std::path::PathBuf;

/// The arguments of `doctor`.
#[derive(Debug, Args)]
pub struct DoctorArguments {
    /// A .vdb, from anyone
    pub input: PathBuf,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// Looks through a VDB and prints what it found; says whether the file is healthy.
pub fn run(arguments: &DoctorArguments) -> Result<bool, Error> {
    let report = examine(&arguments.input)?;
    print(if arguments.json { report.json() + "\n" } else { report.table() }.as_bytes())?;
    Ok(report.healthy)
}
