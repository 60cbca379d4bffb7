//! Several processes at one run: the same bytes as one, in less time; and what is done of a run, kept for the next start.
//!
//! The thesis planned its simulation for a Linux cluster of 97 nodes with MPI (appendix A).

mod deal;
mod ledger;
#[cfg(feature = "mpi")]
mod mpi;
mod team;
mod wire;

use crate::error::{Error, Result};
use crate::progress::{Crew, Silent};
use std::path::Path;
use std::sync::OnceLock;
pub use team::Team;
pub use wire::{Letter, Solo, Wire};

/// Those who work at this process's run, where it is not alone.
static TEAM: OnceLock<Team> = OnceLock::new();

/// Joins the ranks that `mpirun` started together, where it did; before anything else is done.
pub fn join() {
    #[cfg(feature = "mpi")]
    if let Some(wire) = mpi::Mpi::join() {
        TEAM.get_or_init(|| Team::new(Box::new(wire)));
    }
}

/// Who works at the run together, all by the same program: `None` for one process that keeps no checkpoint.
///
/// # Errors
/// [`Error::Machine`] where ranks were started by different programs.
pub fn team(checkpoint: Option<&Path>) -> Result<Option<&'static Team>> {
    if TEAM.get().is_none() && checkpoint.is_none() {
        return Ok(None);
    }
    let team = TEAM.get_or_init(|| Team::new(Box::new(Solo)));
    if team.ranks() > 1 {
        let program = std::fs::read("/proc/self/exe").unwrap_or_else(|_| env!("CARGO_PKG_VERSION").into());
        team.same(&program, "run another cloudvdb", "Start every rank with the same one: build it once, and copy it", &Silent)?;
    }
    if let Some(file) = checkpoint {
        team.keep_in(file);
    }
    Ok(Some(team))
}

/// Whether this process writes files and speaks: of several ranks one does.
pub fn leads() -> bool {
    TEAM.get().is_none_or(Crew::leads)
}

/// How a rank that does not lead is named before what it has to say.
pub fn name() -> String {
    TEAM.get().filter(|team| !team.leads()).map_or(String::new(), |team| format!("rank {} on {}: ", team.wire.rank(), team.wire.host()))
}

/// The checkpoint that the run is kept in.
pub fn checkpoint() -> Option<&'static Path> {
    TEAM.get().and_then(Team::kept_in)
}

/// The end of this process's run: with 0 all ranks part; with another code all of them end.
pub fn leave(code: u8) -> u8 {
    if let Some(team) = TEAM.get().filter(|team| team.ranks() > 1) {
        if code != 0 {
            team.wire.end_all(code);
        }
        // Nothing stops them that would not end the process.
        let _ = team.part(&Silent);
        team.wire.part();
    }
    code
}

/// What another rank or a checkpoint says and nobody understands.
fn unreadable() -> Error {
    Error::Machine {
        reason: "another rank, or a checkpoint, says what cannot be read".into(),
        fix: "Start every rank with the same cloudvdb, and without the checkpoint".into(),
    }
}

#[cfg(test)]
mod tests;
