//! `cloudvdb study`: the thesis's evaluation again.

use super::args::{GatherArgument, Manners, ModelArgument, ProgressStyle};
use super::scene::size;
use super::{event, print, say, watched};
use crate::error::Error;
use crate::study::thesis::CUMULUS;
use crate::study::{Job, Part, study};
use clap::Args;
use std::path::PathBuf;

/// The arguments of `study`.
#[derive(Debug, Args)]
pub struct StudyArguments {
    /// The thesis's layouts, in any order: scenes/hura2006*.gltf
    #[arg(required = true, value_name = "LAYOUT")]
    pub inputs: Vec<PathBuf>,
    /// The thesis's tables 3 and 4 and its second research question, beside its own figures
    #[arg(long)]
    pub paper: bool,
    /// What to run: 1 to 9, cumulus, savings [default: all that the layouts allow]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = part)]
    pub tests: Option<Vec<Part>>,
    /// How the thesis's tests are read: corrected, or to the letter
    #[arg(long, value_enum, default_value_t = ModelArgument::Hura2006)]
    pub model: ModelArgument,
    /// Where the cumulus's picture looks for photons [default: march; with --model physical, beam]
    #[arg(long, value_enum)]
    pub gather: Option<GatherArgument>,
    /// Pixels of the cumulus's picture, for which the thesis gives no size
    #[arg(long, value_name = "WxH", value_parser = size, default_value = "320x240")]
    pub size: [u32; 2],
    /// Seeds for which regions are counted, from --seed on
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u64).range(1..=10_000))]
    pub seeds: u64,
    /// The seed: the same seed gives the same counts and pictures, on any number of threads
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
    /// A folder for the pictures and tables; it is made where it is not there
    #[arg(short, long, value_name = "FOLDER")]
    pub output: Option<PathBuf>,
    /// Replace files that exist
    #[arg(long)]
    pub overwrite: bool,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
    /// Threads, progress, quiet.
    #[command(flatten)]
    pub manners: Manners,
}

/// Runs the study, and prints its tables.
pub fn run(arguments: &StudyArguments) -> Result<(), Error> {
    if !arguments.paper {
        return Err(Error::Usage("say which study: --paper, the thesis's own, is the only one so far".into()));
    }
    let watch = watched(&arguments.manners, false)?;
    let job = Job {
        inputs: arguments.inputs.clone(),
        parts: arguments.tests.clone(),
        model: arguments.model.into(),
        gather: arguments.gather.map(Into::into),
        size: arguments.size,
        seed: arguments.seed,
        seeds: arguments.seeds,
        output: arguments.output.clone(),
        overwrite: arguments.overwrite,
    };
    let told = |line: &str| {
        watch.finish();
        match arguments.manners.progress {
            _ if arguments.manners.quiet => {}
            ProgressStyle::Json => event(&serde_json::json!({"event": "line", "text": line})),
            ProgressStyle::Bar => say(line),
        }
    };
    let result = study(&job, &told, &watch);
    watch.finish();
    let findings = result?;
    if arguments.manners.progress == ProgressStyle::Json && !arguments.manners.quiet {
        event(&serde_json::json!({"event": "done", "seconds": findings.seconds}));
    }
    print(if arguments.json { findings.json() + "\n" } else { findings.table() }.as_bytes())
}

/// A part of the study by its name.
fn part(text: &str) -> Result<Part, String> {
    match text.trim() {
        "cumulus" => Ok(Part::Test(CUMULUS)),
        "savings" => Ok(Part::Savings),
        number => {
            let number = number.parse().ok().filter(|n| (1..CUMULUS).contains(n));
            number.map(Part::Test).ok_or_else(|| format!("{text:?} is none of 1 to 9, cumulus, savings"))
        }
    }
}
