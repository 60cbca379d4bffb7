//! Ctrl-C, SIGTERM and SIGHUP: the run is asked to stop; if it cannot at once, the process ends anyway, leaving no partial file.

use super::args::ProgressStyle;
use super::complain;
use crate::error::Error;
use crate::export::staged;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGXFSZ};
use signal_hook::iterator::Signals;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// The time that a stage has to notice: some calls (OpenVDB writing, a tree being built) cannot be interrupted.
const GRACE: Duration = Duration::from_millis(100);

/// Watches for signals from now on.
pub fn watch(cancelled: Arc<AtomicBool>, style: ProgressStyle) -> Result<(), Error> {
    let mut signals =
        Signals::new([SIGINT, SIGTERM, SIGHUP, SIGXFSZ]).map_err(|e| Error::Usage(format!("signals cannot be watched: {e}")))?;
    std::thread::spawn(move || {
        for signal in signals.forever() {
            // A file over the limit: the write that asked for it fails, and says so.
            if signal == SIGXFSZ {
                continue;
            }
            cancelled.store(true, Ordering::Relaxed);
            std::thread::sleep(GRACE);
            // Whatever still runs holds nothing but temporary files.
            if staged::abandon() {
                complain(&Error::Interrupted, style);
                signal_hook::low_level::exit(130);
            }
        }
    });
    Ok(())
}
