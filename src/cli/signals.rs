//! Ctrl-C, SIGTERM and SIGHUP: the run is asked to stop; if it cannot at once, the process ends anyway, leaving no partial file.
//! And what ends a process by itself: a file over the limit, memory that is not there.

use super::args::ProgressStyle;
use super::{complain, cry, words};
use crate::error::Error;
use crate::export::staged;
use crate::export::vdb::on_abort;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGXFSZ};
use signal_hook::iterator::Signals;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::Duration;

/// The time that a stage has to notice: some calls (OpenVDB writing, a tree being built) cannot be interrupted.
const GRACE: Duration = Duration::from_millis(100);
/// The time that the end has: for its sentence to be taken by whoever reads stderr, and for files to be removed.
const PATIENCE: Duration = Duration::from_millis(500);

/// What is said when the process aborts; made before, because then there may be no memory for words.
static LAST_WORDS: OnceLock<String> = OnceLock::new();

/// Makes the ends that nobody asked for end with a sentence, from now on.
pub fn prepare(style: ProgressStyle) -> Result<(), Error> {
    // A file over the limit: the write that asked for it fails, and says so.
    signal_hook::flag::register(SIGXFSZ, Arc::default()).map_err(unwatched)?;
    let aborted = Error::Machine {
        reason: "the run was aborted, most likely because there was no more memory; no file is half written".into(),
        fix: "Free memory, raise its limit (ulimit -v), or ask for less: fewer --photons, a larger --voxel-size, a smaller --size".into(),
    };
    LAST_WORDS.get_or_init(|| words(&aborted, style));
    on_abort(aborting);
    Ok(())
}

/// Runs within the call that aborts, Rust's for memory or C++'s for an exception that nothing can catch.
fn aborting() {
    static BEGUN: AtomicBool = AtomicBool::new(false);
    if BEGUN.swap(true, Ordering::SeqCst) {
        // Another thread is at it, and ends the process; or this one was, and aborted again.
        std::thread::sleep(PATIENCE);
    } else {
        staged::abandon_at_once();
    }
    LAST_WORDS.get().into_iter().for_each(|text| cry(text));
    signal_hook::low_level::exit(1);
}

/// Watches for signals from now on. To `keep` is to leave the run to its end after the first one.
pub fn watch(cancelled: Arc<AtomicBool>, style: ProgressStyle, keep: bool) -> Result<(), Error> {
    let mut signals = Signals::new([SIGINT, SIGTERM, SIGHUP]).map_err(unwatched)?;
    let watching = std::thread::Builder::new().spawn(move || {
        if signals.forever().next().is_none() {
            return;
        }
        cancelled.store(true, Ordering::Relaxed);
        if keep && signals.forever().next().is_none() {
            return;
        }
        std::thread::sleep(GRACE);
        // Whatever still runs holds nothing but temporary files.
        staged::abandon(|written| {
            // Where no thread is to be had, a reader that does not read is waited for.
            let _ = std::thread::Builder::new().spawn(unheard);
            complain(if written { &Error::InterruptedLate } else { &Error::Interrupted }, style);
        });
        signal_hook::low_level::exit(130);
    });
    watching.map_err(unwatched).map(drop)
}

/// Ends the process though its last sentence has not been taken.
fn unheard() {
    std::thread::sleep(PATIENCE);
    signal_hook::low_level::exit(130);
}

fn unwatched(e: std::io::Error) -> Error {
    Error::Machine {
        reason: format!("signals cannot be watched ({e})"),
        fix: "Free memory, or raise the limits of memory and of processes (ulimit -v, ulimit -u)".into(),
    }
}
