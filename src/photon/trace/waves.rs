//! Waves of batches, traced ahead by all ranks where there are more: what a wave is decides when tracing ends, and is the same for any
//! number of ranks; how far ahead they work is not.

use super::{Batch, FATES, Tracer};
use crate::error::Result;
use crate::photon::Photon;
use crate::photon::witness::Store;
use crate::progress::{Parcel, Parcels, Progress, put, share};
use std::collections::VecDeque;
use std::ops::Range;

/// Photons that ranks may be expected to store before they meet.
const AHEAD_PHOTONS: u64 = 1 << 22;
/// And the most batches.
const AHEAD_BATCHES: u64 = 1 << 16;

/// The batches of a tracer, in order.
pub(super) struct Waves<'a> {
    tracer: &'a Tracer,
    seed: u64,
    wanted: u64,
    progress: &'a dyn Progress,
    /// Those that were traced ahead.
    ahead: VecDeque<Batch>,
}

impl<'a> Waves<'a> {
    /// Before the first.
    pub fn new(tracer: &'a Tracer, seed: u64, wanted: u64, progress: &'a dyn Progress) -> Self {
        Waves { tracer, seed, wanted, progress, ahead: VecDeque::new() }
    }

    /// The batches of some items, which follow those of the wave before: `stored` photons are known of, and a batch is expected to store
    /// so many.
    pub fn wave(&mut self, items: Range<u64>, stored: u64, expected: u64) -> Result<Vec<Batch>> {
        let count = items.end - items.start;
        let known = self.ahead.len() as u64;
        if known < count {
            let worth = match self.progress.crew() {
                Some(_) => (AHEAD_PHOTONS.min(self.wanted.saturating_sub(stored)) / expected + 1).min(AHEAD_BATCHES),
                None => count,
            };
            let from = items.start + known;
            let one = |item: u64| self.tracer.batch(self.seed, item, None, self.wanted, &Store, self.progress);
            let told = |done: u64| {
                if self.progress.crew().is_some() {
                    self.progress.at((stored + (known + done) * expected).min(self.wanted));
                }
            };
            let traced = share(from..items.start + count.max(worth), one, self.progress, told)?;
            self.ahead.extend(traced);
        }
        Ok(self.ahead.drain(..count as usize).collect())
    }
}

impl Parcel for Batch {
    fn pack(&self, into: &mut Vec<u8>) {
        put(&self.photons, into);
        put(&self.ends, into);
        put(&self.fates, into);
        put(&[self.power], into);
        put(&[self.collisions, self.interrupted.into()], into);
    }

    fn unpack(from: &mut Parcels) -> Option<Self> {
        let (photons, ends): (Vec<Photon>, Vec<u32>) = (from.take()?, from.take()?);
        let (fates, [power]): ([f64; FATES], [f64; 1]) = (from.some()?, from.some()?);
        let [collisions, interrupted] = from.some::<u64, 2>()?;
        Some(Batch { photons, ends, fates, power, collisions, interrupted: interrupted != 0 })
    }
}
