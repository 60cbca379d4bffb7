//! The command: arguments to a job, progress to the terminal, results to stdout, errors to stderr.

mod args;
mod doctor;
mod flux;
mod progress;
mod scene;
mod signals;
mod study;
mod values;

use crate::cluster;
use crate::error::Error;
use crate::export::report::plan_table;
use crate::import;
use crate::pipeline;
use crate::plan::Plan;
use crate::progress::Silent;
use args::{Arguments, Command, Manners, PlanArguments, ProgressStyle, Run};
use clap::{CommandFactory, Parser};
use progress::Watch;
use std::io::Write;
use std::path::Path;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

/// How long a rank waits for the one that leads to speak first.
const PATIENCE: Duration = Duration::from_secs(2);

/// Runs the command that the process was started with; returns its exit code.
pub fn main() -> u8 {
    cluster::join();
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(refusal) => {
            if cluster::leads() {
                let _ = refusal.print();
            }
            return cluster::leave(refusal.exit_code() as u8);
        }
    };
    let style = arguments.progress();
    if let Err(error) = signals::prepare(style) {
        return finish(Err(error), style);
    }
    match arguments.command {
        // What takes no time is for one rank.
        Some(Command::Plan(_) | Command::Doctor(_) | Command::Completions { .. } | Command::Man) if !cluster::leads() => cluster::leave(0),
        Some(Command::Plan(plan)) => finish(show_plan(&plan), style),
        Some(Command::Flux(arguments)) => finish(flux::run(&arguments), style),
        Some(Command::Study(arguments)) => finish(study::run(&arguments), style),
        Some(Command::Doctor(arguments)) => match doctor::run(&arguments) {
            Ok(healthy) => cluster::leave(u8::from(!healthy)),
            Err(error) => finish(Err(error), style),
        },
        Some(Command::Completions { shell }) => {
            let mut text = Vec::new();
            clap_complete::generate(shell, &mut Arguments::command(), "cloudvdb", &mut text);
            finish(print(&text), style)
        }
        Some(Command::Man) => {
            let mut text = Vec::new();
            let rendered = clap_mangen::Man::new(Arguments::command()).render(&mut text);
            finish(rendered.map_err(stdout_failed).and_then(|()| print(&text)), style)
        }
        None => finish(run(&arguments.run), style),
    }
}

/// What the words behind `cloudvdb` ask for, understood as far as that goes without doing it; the words that refuse it, else.
///
/// # Errors
/// What would be told, whatever is wrong.
#[cfg(any(test, fuzzing))]
pub fn understand(words: impl Iterator<Item = std::ffi::OsString>) -> Result<(), String> {
    let whole = std::iter::once("cloudvdb".into()).chain(words);
    let arguments = Arguments::try_parse_from(whole).map_err(|refusal| refusal.render().to_string())?;
    match &arguments.command {
        None => arguments.run.job().map(drop).map_err(|error| error.to_string()),
        Some(_) => Ok(()),
    }
}

fn run(run: &Run) -> Result<(), Error> {
    let job = run.job()?;
    let watch = watched(&run.manners, run.keep_partial, run.checkpoint.as_deref())?;
    let report = pipeline::run(&job, &watch);
    watch.finish();
    let report = report?;
    watch.over()?;
    if run.json {
        print((report.json() + "\n").as_bytes())?;
    }
    match run.manners.progress {
        _ if run.manners.quiet => {}
        ProgressStyle::Json => {
            event(&serde_json::json!({"event": "done", "seconds": report.seconds, "outputs": report.outputs, "notes": report.notes}))
        }
        ProgressStyle::Bar => say(report.table(run.verbose).trim_end()),
    }
    Ok(())
}

/// What watches a run for the terminal and for signals, which may have it `keep` what is done; the number of threads; and who works at
/// it, with the file that keeps what is done.
fn watched(&Manners { threads, progress: style, quiet }: &Manners, keep: bool, checkpoint: Option<&Path>) -> Result<Watch, Error> {
    if threads == Some(0) {
        return Err(Error::Usage("--threads must be at least 1".into()));
    }
    let team = cluster::team(checkpoint)?;
    if keep && team.is_some() {
        let reason = "--keep-partial is for one process, whose picture is stopped at one moment: leave it out; --checkpoint keeps what ranks have done";
        return Err(Error::Usage(reason.into()));
    }
    let watch = Watch::new(style, quiet || !cluster::leads(), keep, team);
    signals::watch(watch.cancelled_flag(), style, keep)?;
    start(threads)?;
    if let Some(threads) = threads {
        crate::export::vdb::limit_threads(threads);
    }
    Ok(watch)
}

/// Starts so many threads, or one for each core, before anything asks for them and cannot say that they are not to be had.
fn start(threads: Option<usize>) -> Result<(), Error> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.unwrap_or(0)).build_global();
    pool.map_err(|e| Error::Machine {
        reason: format!("threads cannot be started ({e})"),
        fix: "Use fewer --threads, free memory, or raise the limits of memory and of processes (ulimit -v, ulimit -u)".into(),
    })
}

fn show_plan(arguments: &PlanArguments) -> Result<(), Error> {
    start(None)?;
    let layout = import::load(&arguments.input, &arguments.scene.import(), &Silent)?;
    let plan = Plan::for_scene(&layout.scene, arguments.density.into());
    let text = if arguments.json {
        serde_json::to_string_pretty(&plan).unwrap_or_default()
    } else {
        format!(
            "{}: {} regions, {} surfaces\n{}",
            arguments.input.display(),
            layout.scene.regions.len(),
            layout.scene.surfaces.len(),
            plan_table(&plan).trim_end()
        )
    };
    print((text + "\n").as_bytes())
}

/// Writes data to stdout, once however many ranks there are. A reader that has had enough (`| head`) is no failure.
fn print(bytes: &[u8]) -> Result<(), Error> {
    if !cluster::leads() {
        return Ok(());
    }
    let mut out = std::io::stdout().lock();
    match out.write_all(bytes).and_then(|()| out.flush()) {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => Err(stdout_failed(e)),
        _ => Ok(()),
    }
}

fn stdout_failed(e: std::io::Error) -> Error {
    Error::Write { target: Path::new("stdout").into(), reason: e.to_string(), fix: "Check where it is sent".into() }
}

/// Words for people, once however many ranks there are.
fn say(text: &str) {
    if cluster::leads() {
        cry(text);
    }
}

/// Words that are heard from any rank; a closed stderr is no reason to fail.
fn cry(text: &str) {
    let _ = writeln!(std::io::stderr(), "{text}");
}

/// One JSON line on stderr, for the add-on.
fn event(value: &serde_json::Value) {
    say(&value.to_string());
}

fn finish(result: Result<(), Error>, style: ProgressStyle) -> u8 {
    let Err(error) = result else { return cluster::leave(0) };
    if !cluster::leads() {
        // Most likely the rank that leads says so itself, and ends this one meanwhile.
        std::thread::sleep(PATIENCE);
        cry(&words(&error, style));
    }
    complain(&error, style);
    cluster::leave(error.exit_code())
}

/// Says why the process ends; once, whoever ends it.
fn complain(error: &Error, style: ProgressStyle) {
    static SAID: Mutex<bool> = Mutex::new(false);
    let mut said = SAID.lock().unwrap_or_else(PoisonError::into_inner);
    if !*said {
        *said = true;
        say(&words(error, style));
        if let (Error::Interrupted, Some(file)) = (error, cluster::checkpoint()) {
            say(&format!("cloudvdb: the same command goes on from {}", file.display()));
        }
    }
}

/// An error as it is told.
fn words(error: &Error, style: ProgressStyle) -> String {
    match style {
        ProgressStyle::Json => {
            serde_json::json!({"event": "error", "message": cluster::name() + &error.to_string(), "code": error.exit_code()}).to_string()
        }
        ProgressStyle::Bar => format!("cloudvdb: {}{error}", cluster::name()),
    }
}

#[cfg(test)]
mod tests;
