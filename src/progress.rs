//! How the core tells how far it is, learns that it should stop, and who works at it.

use crate::error::{Error, Result};

mod crew;
mod parcel;

pub use crew::{Crew, Spent, Taker, Work, agreed, meet, share, tally};
pub use parcel::{Parcel, Parcels, put};

/// Watches the stages of a run. The core prints nothing and reads no clock: whoever runs it does.
pub trait Progress: Sync {
    /// A stage begins; it will count to `total`.
    fn begin(&self, stage: &'static str, total: u64);
    /// The stage has come to `done` of its total.
    fn at(&self, done: u64);
    /// Whether the run should stop as soon as it can.
    fn cancelled(&self) -> bool;
    /// Whether what is done of a picture when it is [`Progress::cancelled`] is wanted.
    fn keeps(&self) -> bool {
        false
    }
    /// Who works at the run together; `None` where one process works at it alone.
    fn crew(&self) -> Option<&dyn Crew> {
        None
    }
    /// Whether this process writes files and speaks: the one that works alone, or that leads those who work together.
    fn leads(&self) -> bool {
        self.crew().is_none_or(Crew::leads)
    }
    /// A forecast: the relative error that the picture will have, and how many seconds it takes from now on.
    fn expects(&self, _error: f64, _seconds: f64) {}

    /// [`Error::Interrupted`] once the run should stop.
    ///
    /// # Errors
    /// When [`Progress::cancelled`] says so.
    fn check(&self) -> Result<()> {
        if self.cancelled() { Err(Error::Interrupted) } else { Ok(()) }
    }
}

/// Watches nothing and never stops anything.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Progress for Silent {
    fn begin(&self, _: &'static str, _: u64) {}
    fn at(&self, _: u64) {}
    fn cancelled(&self) -> bool {
        false
    }
}
