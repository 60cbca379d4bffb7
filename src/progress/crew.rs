//! Work that several processes share: items that are seeded by index, so that it never matters who did which.
//!
//! Every rank runs the same program over the same scene. At heavy loops they meet: items are dealt to whoever is free, and what came of
//! them is in everyone's hands afterwards, in the items' order. So all later decisions agree by construction.

use super::{Parcel, Parcels, Progress};
use crate::error::{Error, Result};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};

/// What one item gives, as bytes.
pub type Work<'a> = dyn Fn(u64) -> Vec<u8> + Sync + 'a;
/// Hears of each item's bytes, in the items' order.
pub type Taker<'a> = dyn FnMut(&[u8]) -> Result<()> + 'a;

/// The ranks of a run, of which one leads.
pub trait Crew: Sync {
    /// How many there are.
    fn ranks(&self) -> usize;

    /// Whether this one leads: it alone writes files and speaks.
    fn leads(&self) -> bool;

    /// All ranks say what they work at; a rank that works at something else than the one that leads is an error.
    ///
    /// # Errors
    /// [`Error::Machine`], and [`Error::Write`] where what was done before is of another run.
    fn meet(&self, at: &str, progress: &dyn Progress) -> Result<()>;

    /// Deals items to all ranks, and gives what came of each to every rank, in the items' order. `told` hears how many are done.
    ///
    /// # Errors
    /// [`Error::Interrupted`], and those of `take`.
    fn deal(&self, items: Range<u64>, work: &Work, take: &mut Taker, progress: &dyn Progress, told: &dyn Fn(u64)) -> Result<()>;

    /// Deals items that add to sums, which are whole on every rank afterwards. What was in them before counts once for each rank.
    ///
    /// # Errors
    /// [`Error::Interrupted`].
    fn tally(
        &self,
        items: Range<u64>,
        work: &(dyn Fn(u64) + Sync),
        sums: &[AtomicU64],
        progress: &dyn Progress,
        told: &dyn Fn(u64),
    ) -> Result<()>;

    /// What the rank that leads says: clocks are one rank's own.
    ///
    /// # Errors
    /// [`Error::Interrupted`].
    fn agree(&self, said: &[f64], progress: &dyn Progress) -> Result<Vec<f64>>;

    /// How many of the ranks share this one's host, and so its memory; it is one of them. Every rank has to ask.
    ///
    /// # Errors
    /// [`Error::Interrupted`].
    fn beside(&self, progress: &dyn Progress) -> Result<u64>;

    /// What working together has taken so far, of all ranks; every rank has to ask.
    ///
    /// # Errors
    /// [`Error::Interrupted`].
    fn spent(&self, progress: &dyn Progress) -> Result<Option<Spent>>;
}

/// What working together has taken.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Spent {
    /// Ranks.
    pub ranks: usize,
    /// Bytes that ranks received, all together.
    pub bytes: u64,
    /// Messages and parts of messages to all.
    pub messages: u64,
    /// Seconds a rank was sending, receiving and adding up, in the mean: with what it waited for others meanwhile.
    pub seconds: f64,
}

/// Where several processes work together, says what this one works at.
///
/// # Errors
/// Those of [`Crew::meet`].
pub fn meet(at: impl FnOnce() -> String, progress: &dyn Progress) -> Result<()> {
    progress.crew().map_or(Ok(()), |crew| crew.meet(&at(), progress))
}

/// What came of items, in their order: done by the threads of this process, and by all ranks where there are more. `told` hears how
/// many are done.
///
/// # Errors
/// [`Error::Interrupted`] of a crew; a process that works alone gives what it has, and leaves that to its caller.
pub fn share<T: Parcel>(
    items: Range<u64>,
    work: impl Fn(u64) -> T + Sync,
    progress: &dyn Progress,
    told: impl Fn(u64) + Sync,
) -> Result<Vec<T>> {
    let count = (items.end - items.start) as usize;
    let Some(crew) = progress.crew() else {
        let done = AtomicU64::new(0);
        let one = |i: usize| {
            let out = work(items.start + i as u64);
            if !progress.cancelled() {
                told(done.fetch_add(1, Ordering::Relaxed) + 1);
            }
            out
        };
        return Ok((0..count).into_par_iter().map(one).collect());
    };
    let packed = |item: u64| {
        let mut bytes = Vec::new();
        work(item).pack(&mut bytes);
        bytes
    };
    let mut all = Vec::with_capacity(count);
    let mut take = |bytes: &[u8]| {
        all.push(Parcels(bytes).whole().ok_or_else(garbled)?);
        Ok(())
    };
    crew.deal(items, &packed, &mut take, progress, &told)?;
    Ok(all)
}

/// Does items that add to `sums`, by all ranks where there are more: then `sums` are those of all.
///
/// # Errors
/// [`Error::Interrupted`].
pub fn tally(
    items: Range<u64>,
    work: impl Fn(u64) + Sync,
    sums: &[AtomicU64],
    progress: &dyn Progress,
    told: impl Fn(u64) + Sync,
) -> Result<()> {
    let work = |item: u64| {
        if !progress.cancelled() {
            work(item);
        }
    };
    match progress.crew() {
        Some(crew) => crew.tally(items, &work, sums, progress, &told)?,
        None => items.into_par_iter().for_each(work),
    }
    progress.check()
}

/// What the rank that leads reads off a clock, where there are more than one.
///
/// # Errors
/// [`Error::Interrupted`].
pub fn agreed<const N: usize>(said: [f64; N], progress: &dyn Progress) -> Result<[f64; N]> {
    let Some(crew) = progress.crew() else { return Ok(said) };
    crew.agree(&said, progress)?.try_into().map_err(|_| garbled())
}

/// What another rank, or a checkpoint, says and nobody understands.
fn garbled() -> Error {
    Error::Machine {
        reason: "what came of an item on another rank, or before, cannot be read".into(),
        fix: "Start every rank with the same cloudvdb, and without the checkpoint".into(),
    }
}
