//! Several processes at one run: the same bytes as one, in less time; and what is done of a run, kept for the next start.
//!
//! The thesis planned its simulation for a Linux cluster of 97 nodes with MPI (appendix A). Batches of photons and tiles of pixels are
//! seeded by index, so it does not matter who does which.
//!
//! Every rank runs the same program over the same scene, and makes the same tables and decisions. Ranks meet at the heavy loops
//! ([`crate::progress::share`], [`crate::progress::tally`]), which know of a [`Crew`] and of no MPI:
//!
//! * Rank 0 deals items to whoever asks, fewer as little is left, and does a share itself. Results come back in any order, are kept by
//!   number, and go to every rank, in their order.
//! * What photons leave in voxels is added up where they fly, as whole numbers, in whatever order; ranks then add up their sums, of
//!   bricks that any of them has touched.
//! * Clocks are rank 0's. Rank 0 alone writes files and speaks.
//!
//! What rank 0 has by item can be kept in a file, with or without other ranks: it is what a stopped run goes on from.
//! All of this goes over a [`Wire`], which is MPI, or one rank's that is alone, or in tests channels between threads.
//!
//! # What travels
//!
//! For n ranks, as counted by the report's `together` (bytes that ranks received, all together):
//!
//! | work | bytes by the model | measured, n = 2 | 3 | 4 |
//! | --- | --- | --- | --- | --- |
//! | duality, N photons stored (24 bytes each; each path's count of photons) | 24.6 N (n - 1 + share not traced by rank 0) | 48.2 MB | 92.9 MB | 118.3 MB |
//! | `grid`, V voxels (8 bytes, 5 classes, 16 groups, a ring) | 1280 V (n - 1) | 0.98 GB | | 2.95 GB |
//! | places on surfaces, `grid`, at most 7,000 (116 bytes) | 116 (n - 1 + share not followed by rank 0) | | | |
//! | pixels, P (84 bytes) | 84 P (n - 1 + share not rendered by rank 0) | 9.2 MB | 16.4 MB | 23.2 MB |
//!
//! (`scenes/cumulus.gltf`; N = 1M; V = 716,288 and 1.25M photons, with 320 x 240 pixels; P = 320 x 240. The model says 0.92 and 2.75 GB of voxels
//! alone; the rest is the picture, and the groups' flags.) Messages: 128, 249 and 203 for the photons, 2,189 and 6,355 (n = 4) for the grid, 182, 313
//! and 382 for the pixels. So does the number of photons of `grid` not matter: what travels are sums.
//!
//! Time: a photon of `grid` takes 20 microseconds of a core there (the difference of 1.5M and 0.5M photons), smoothing about 25
//! microseconds a voxel, whatever the photons. At 100M photons on 4 ranks of one thread that is 500 s of photons a rank; a rank receives 0.74 GB
//! in about 1,600 messages, and was in MPI for 6.1 s, with what it waited for others on two cores that all shared: 1.2 %.
//!
//! The duality of `scenes/cumulus.gltf` from 100M stored photons, run whole by 4 ranks of one thread: 8.98 GB to all ranks together (the model
//! says 9.2) in 9,228 messages, 3.7 GB of memory a rank; 85 s of photons and 124 s of regions on two cores that another program used too, 14.8 s of
//! it in MPI, waiting included: 6.9 %. By its bytes alone 2.3 GB a rank are 1.8 s at 10 Gbit/s.
//!
//! # Drawn to 97 nodes
//!
//! Not measured: drawn by the model. Seconds of `grid` with V voxels on n nodes of c cores:
//!
//! ```text
//! T(n) = 20e-6 N / (n c)                       photons: divided
//!      + 25e-6 V / c                           smoothing: each rank does all of it
//!      + 2 * 640 V (n - 1) / n / bandwidth     sums: at most 1280 V a rank, whatever n
//!      + 16 * 2 (n - 1) * parts * latency      the ring's steps; a part is 16 MiB
//! ```
//!
//! With V = 716,288, c = 1 as in the thesis, 125 MB/s and 50 microseconds (gigabit Ethernet):
//!
//! | N | n = 1 | n = 4 | n = 97 | of that, communication |
//! | --- | --- | --- | --- | --- |
//! | 10^8 | 34 min | 8.8 min | 46 s | 16 % |
//! | 10^10 | 56 h | 14 h | 35 min | 0.4 % |
//! | 10^12 | 231 days | 58 days | 2.4 days | 0.004 % |
//!
//! Where it stops:
//!
//! * `grid` stops at smoothing: at 10^8 photons 18 of the 46 s. From 80 ranks on, what every rank does takes longer than its share of photons;
//!   at 10^12 photons from 800,000 on.
//! * The duality and `photon` stop at rank 0's link: every stored photon passes it, 24.6 bytes in, and as many out down a tree. A core
//!   stores 1.5 million photons a second (the difference of 4M and 1M), a gigabit link passes five: three cores. At 100 Gbit/s it is 340. And each rank
//!   holds the map, 24 N bytes: 10^12 photons are 24 TB, which no rank has; `grid` is for those.
//! * That map is not spread over ranks: an estimate takes the sqrt(N) nearest photons, of which each other rank would have to send its own
//!   candidates, 24 sqrt(N) bytes. A picture of 320 x 240 pixels and 64 samples of `scenes/cumulus.gltf` makes 13.1 million estimates (2.66 a
//!   sample; counted at 80 x 60 and 160 x 120, and scaled). From 1M photons that is 314 GB from each other rank, where the whole map is 24 MB
//!   sent once; from 10^9 it is 9.9 TB and 24 GB. So a run asks for memory first, and says so before it traces where there is too little.
//! * Pixels stop late: at 1,000 samples of `path` one takes a core 6 ms, and a gigabit link 0.7 microseconds.
//! * Dealing stops at rank 0's letters: a rank sends one in 20 ms at most or 256 KiB, so 97 ranks send 5,000 a second.

mod deal;
mod ledger;
#[cfg(feature = "mpi")]
mod mpi;
mod sums;
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
    if let Some(team) = TEAM.get() {
        if code != 0 && team.ranks() > 1 {
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
