//! `cloudvdb flux`: where the light goes.

use super::args::{DensityArgument, Manners, ProgressStyle};
use super::scene::SceneArguments;
use super::values::count;
use super::{event, print, say, watched};
use crate::error::Error;
use crate::pipeline::{BalanceJob, balance};
use clap::Args;
use std::path::PathBuf;

/// The arguments of `flux`.
#[derive(Debug, Args)]
pub struct FluxArguments {
    /// The scene: .gltf, .glb or .vdb
    pub input: PathBuf,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
    /// Which medium is looked at: the regions of the file as they are, or those that the duality makes
    #[arg(long, value_enum, default_value_t = DensityArgument::Source)]
    pub density: DensityArgument,
    /// Photons to emit (10k, 1M and 1e6 are numbers too)
    #[arg(long, value_name = "N", default_value = "1M", value_parser = count)]
    pub photons: u64,
    /// The seed: the same seed gives the same figures, on any number of threads
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
    /// Threads, progress, quiet.
    #[command(flatten)]
    pub manners: Manners,
    /// What is in the scene.
    #[command(flatten)]
    pub scene: SceneArguments,
}

/// Looks where the light of a scene goes, and prints it.
pub fn run(arguments: &FluxArguments) -> Result<(), Error> {
    if arguments.photons == 0 {
        return Err(Error::Usage("--photons must be at least 1".into()));
    }
    let watch = watched(&arguments.manners, false, None)?;
    let job = BalanceJob {
        input: arguments.input.clone(),
        import: arguments.scene.import(),
        density: arguments.density.into(),
        photons: arguments.photons,
        seed: arguments.seed,
    };
    let result = balance(&job, &watch);
    watch.finish();
    let balance = result?;
    match arguments.manners.progress {
        _ if arguments.manners.quiet => {}
        ProgressStyle::Json => event(&serde_json::json!({"event": "done", "seconds": balance.seconds, "notes": balance.notes})),
        ProgressStyle::Bar => balance.notes.iter().for_each(|note| say(&format!("note: {note}"))),
    }
    print(if arguments.json { balance.json() + "\n" } else { balance.table() }.as_bytes())
}
