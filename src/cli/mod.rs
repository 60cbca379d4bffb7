//! The command: arguments to a job, progress to the terminal, results to stdout, errors to stderr.

mod args;
mod doctor;
mod flux;
mod progress;
mod scene;
mod signals;
mod study;

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

/// Runs the command that the process was started with; returns its exit code.
pub fn main() -> u8 {
    let arguments = Arguments::parse();
    match arguments.command {
        Some(Command::Plan(plan)) => finish(show_plan(&plan), ProgressStyle::Bar),
        Some(Command::Flux(arguments)) => {
            let style = arguments.manners.progress;
            finish(flux::run(&arguments), style)
        }
        Some(Command::Study(arguments)) => {
            let style = arguments.manners.progress;
            finish(study::run(&arguments), style)
        }
        Some(Command::Doctor(arguments)) => match doctor::run(&arguments) {
            Ok(healthy) => u8::from(!healthy),
            Err(error) => finish(Err(error), ProgressStyle::Bar),
        },
        Some(Command::Completions { shell }) => {
            let mut text = Vec::new();
            clap_complete::generate(shell, &mut Arguments::command(), "cloudvdb", &mut text);
            finish(print(&text), ProgressStyle::Bar)
        }
        Some(Command::Man) => {
            let mut text = Vec::new();
            let rendered = clap_mangen::Man::new(Arguments::command()).render(&mut text);
            finish(rendered.map_err(stdout_failed).and_then(|()| print(&text)), ProgressStyle::Bar)
        }
        None => {
            let style = arguments.run.manners.progress;
            finish(run(&arguments.run), style)
        }
    }
}

fn run(run: &Run) -> Result<(), Error> {
    let job = run.job()?;
    let watch = watched(&run.manners)?;
    let report = pipeline::run(&job, &watch);
    watch.finish();
    let report = report?;
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

/// What watches a run for the terminal and for signals; and the number of threads.
fn watched(&Manners { threads, progress: style, quiet }: &Manners) -> Result<Watch, Error> {
    if threads == Some(0) {
        return Err(Error::Usage("--threads must be at least 1".into()));
    }
    let watch = Watch::new(style, quiet);
    signals::watch(watch.cancelled_flag(), style)?;
    if let Some(threads) = threads {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build_global();
        pool.map_err(|e| Error::Usage(format!("--threads {threads}: {e}")))?;
        crate::export::vdb::limit_threads(threads);
    }
    Ok(watch)
}

fn show_plan(arguments: &PlanArguments) -> Result<(), Error> {
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

/// Writes data to stdout. A reader that has had enough (`| head`) is no failure.
fn print(bytes: &[u8]) -> Result<(), Error> {
    let mut out = std::io::stdout().lock();
    match out.write_all(bytes).and_then(|()| out.flush()) {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => Err(stdout_failed(e)),
        _ => Ok(()),
    }
}

fn stdout_failed(e: std::io::Error) -> Error {
    Error::Write { target: Path::new("stdout").into(), reason: e.to_string(), fix: "Check where it is sent".into() }
}

/// Words for people; a closed stderr is no reason to fail.
fn say(text: &str) {
    let _ = writeln!(std::io::stderr(), "{text}");
}

/// One JSON line on stderr, for the add-on.
fn event(value: &serde_json::Value) {
    say(&value.to_string());
}

fn finish(result: Result<(), Error>, style: ProgressStyle) -> u8 {
    let Err(error) = result else { return 0 };
    complain(&error, style);
    error.exit_code()
}

fn complain(error: &Error, style: ProgressStyle) {
    match style {
        ProgressStyle::Json => event(&serde_json::json!({"event": "error", "message": error.to_string(), "code": error.exit_code()})),
        ProgressStyle::Bar => say(&format!("cloudvdb: {error}")),
    }
}
