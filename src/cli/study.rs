//! `cloudvdb study`: what accuracy costs in a scene; and the thesis's evaluation again.

use super::args::{GatherArgument, Manners, ModelArgument, ProgressStyle};
use super::scene::SceneArguments;
use super::{event, print, say, watched};
use crate::error::Error;
use crate::import::ImportOptions;
use crate::scene::View;
use crate::study::accuracy::{self, Against, against};
use crate::study::duality;
use crate::study::thesis::CUMULUS;
use crate::study::{Job, Part, study};
use clap::Args;
use std::path::PathBuf;

/// Pixels of the cumulus of --paper, for which the thesis gives no size.
const CUMULUS_SIZE: [u32; 2] = [320, 240];

/// The arguments of `study`.
#[derive(Debug, Args)]
pub struct StudyArguments {
    /// A scene; with --paper the thesis's layouts, in any order: scenes/hura2006*.gltf
    #[arg(required = true, value_name = "SCENE")]
    pub inputs: Vec<PathBuf>,
    /// The thesis's tables 3 and 4 and its second research question, beside its own figures
    #[arg(long)]
    pub paper: bool,
    /// How far the regions that the duality makes are from the layout: mass, what passes along lines, radiance, by photons and placement
    #[arg(long, conflicts_with_all = ["paper", "against", "reference"])]
    pub duality: bool,
    /// Fewer settings, seeds and pixels: under two minutes for most scenes
    #[arg(long, conflicts_with = "paper")]
    pub quick: bool,
    /// A picture by somebody else, with what it took: cycles.exr:58.5:Cycles; repeats
    #[arg(long, value_name = "EXR:SECONDS[:NAME]", value_parser = against, conflicts_with = "paper")]
    pub against: Vec<Against>,
    /// Samples a pixel of each half of the reference [default: 2048, quick 384]
    #[arg(long, value_name = "N", conflicts_with = "paper", value_parser = clap::value_parser!(u32).range(2..=1_000_000))]
    pub reference: Option<u32>,
    /// With --paper, what to run: 1 to 9, cumulus, savings [default: all that the layouts allow]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = part)]
    pub tests: Option<Vec<Part>>,
    /// How the thesis's tests are read: corrected, or to the letter
    #[arg(long, value_enum, default_value_t = ModelArgument::Hura2006)]
    pub model: ModelArgument,
    /// Where the cumulus's picture looks for photons [default: march; with --model physical, beam]
    #[arg(long, value_enum)]
    pub gather: Option<GatherArgument>,
    /// Seeds for which regions are counted, from --seed on
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u64).range(1..=10_000))]
    pub seeds: u64,
    /// The seed: the same seed gives the same counts and pictures, on any number of threads
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
    /// A folder for the pictures, tables and the page; it is made where it is not there, and a study of a scene that was begun in it goes on
    #[arg(short, long, value_name = "FOLDER")]
    pub output: Option<PathBuf>,
    /// Replace files that exist
    #[arg(long)]
    pub overwrite: bool,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
    /// The scene, its light and its camera.
    #[command(flatten)]
    pub scene: SceneArguments,
    /// Threads, progress, quiet.
    #[command(flatten)]
    pub manners: Manners,
}

/// Runs the study, and prints its tables.
pub fn run(arguments: &StudyArguments) -> Result<(), Error> {
    if !arguments.paper {
        return accuracy(arguments);
    }
    let View { position, target, xfov, .. } = arguments.scene.view();
    if arguments.scene.import() != ImportOptions::default() || position.is_some() || target.is_some() || xfov.is_some() {
        return Err(Error::Usage(
            "--paper takes the thesis's layouts as they are: leave out what changes the scene, its light or its camera".into(),
        ));
    }
    let watch = watched(&arguments.manners, false, None)?;
    let job = Job {
        inputs: arguments.inputs.clone(),
        parts: arguments.tests.clone(),
        model: arguments.model.into(),
        gather: arguments.gather.map(Into::into),
        size: arguments.scene.size.unwrap_or(CUMULUS_SIZE),
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

/// What accuracy costs in a scene, or what the duality changes of it.
fn accuracy(arguments: &StudyArguments) -> Result<(), Error> {
    let ([input], Some(output)) = (&arguments.inputs[..], &arguments.output) else {
        let reason = "a study is of one scene and goes into a folder: cloudvdb study scene.glb -o study/; with --paper it is of the thesis's layouts";
        return Err(Error::Usage(reason.into()));
    };
    let watch = watched(&arguments.manners, false, None)?;
    let told = |line: &str| {
        watch.finish();
        match arguments.manners.progress {
            _ if arguments.manners.quiet => {}
            ProgressStyle::Json => event(&serde_json::json!({"event": "line", "text": line})),
            ProgressStyle::Bar => say(line),
        }
    };
    let (input, import, view, output) = (input.clone(), arguments.scene.import(), arguments.scene.view(), output.clone());
    let StudyArguments { quick, reference, seed, .. } = *arguments;
    let (json, table, page) = if arguments.duality {
        let result = duality::study(&duality::Job { input, import, view, quick, seed, output: output.clone() }, &told, &watch);
        watch.finish();
        let Some(findings) = result? else { return Ok(()) };
        (findings.json(), findings.table(), output.join("duality.html"))
    } else {
        let against = arguments.against.clone();
        let job = accuracy::Job { input, import, view, quick, reference, seed, output: output.clone(), against };
        let result = accuracy::study(&job, &told, &watch);
        watch.finish();
        let Some(figures) = result? else { return Ok(()) };
        (figures.json(), figures.table(), output.join("index.html"))
    };
    print(if arguments.json { json } else { format!("{table}wrote {}\n", page.display()) }.as_bytes())
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
