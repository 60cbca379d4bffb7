//! The ranks of a run, whatever carries their words: how they meet.

use super::deal::{Nap, Queue};
use super::ledger::Ledger;
use super::sums::{packed, unpacked};
use super::unreadable;
use super::wire::{Letter, Wire};
use crate::error::{Error, Result};
use crate::progress::{Crew, Progress, Spent, Taker, Work};
use sha2::{Digest, Sha256};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::Instant;

/// What all do at once is done in parts of about so many bytes: no rank holds more twice.
pub(super) const SEGMENT: usize = 1 << 24;
/// The number of what is kept of a meeting that is one thing and no items.
const WHOLE: u64 = 0;

/// The ranks of a run, as one of them sees them.
pub struct Team {
    pub(super) wire: Box<dyn Wire>,
    checkpoint: OnceLock<PathBuf>,
    ledger: Mutex<Option<Ledger>>,
    /// Meetings so far: the same on every rank.
    met: AtomicU64,
    bytes: AtomicU64,
    messages: AtomicU64,
    nanoseconds: AtomicU64,
}

impl Team {
    /// Joined by a wire.
    pub fn new(wire: Box<dyn Wire>) -> Self {
        let zero = || AtomicU64::new(0);
        Team {
            wire,
            checkpoint: OnceLock::new(),
            ledger: Mutex::new(None),
            met: zero(),
            bytes: zero(),
            messages: zero(),
            nanoseconds: zero(),
        }
    }

    /// What will be done is kept in a file. Said once, and by every rank.
    pub fn keep_in(&self, file: &Path) {
        self.checkpoint.get_or_init(|| file.into());
    }

    /// Where what is done is kept.
    pub fn kept_in(&self) -> Option<&Path> {
        self.checkpoint.get().map(PathBuf::as_path)
    }

    /// Makes sure that every rank has the same as rank 0.
    ///
    /// # Errors
    /// [`Error::Machine`], on every rank.
    pub fn same(&self, of: &[u8], what: &str, fix: &str, progress: &dyn Progress) -> Result<()> {
        let digest: [u8; 32] = Sha256::digest(of).into();
        let theirs = self.hear(digest.to_vec(), progress)?;
        let mut others = [u64::from(theirs != digest)];
        self.add(&mut others);
        match others[0] {
            0 => Ok(()),
            n => Err(Error::Machine { reason: format!("{n} of {} ranks {what} than rank 0", self.wire.size()), fix: fix.into() }),
        }
    }

    /// The run is over, and well: the checkpoint is not needed any more.
    ///
    /// # Errors
    /// [`Error::Write`] where it cannot be removed.
    pub fn over(&self) -> Result<()> {
        self.ledger().take().map_or(Ok(()), Ledger::remove)
    }

    fn ledger(&self) -> MutexGuard<'_, Option<Ledger>> {
        self.ledger.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn timed<T>(&self, bytes: u64, messages: u64, act: impl FnOnce() -> T) -> T {
        let begun = Instant::now();
        let out = act();
        self.nanoseconds.fetch_add(begun.elapsed().as_nanos() as u64, Ordering::Relaxed);
        self.bytes.fetch_add(bytes, Ordering::Relaxed);
        self.messages.fetch_add(messages, Ordering::Relaxed);
        out
    }

    pub(super) fn send(&self, to: usize, letter: &Letter) {
        let bytes = letter.bytes();
        self.timed(0, 0, || self.wire.send(to, &bytes));
    }

    /// A letter that has arrived and can be read.
    pub(super) fn letter(&self) -> Option<(usize, Letter)> {
        let begun = Instant::now();
        let (rank, bytes) = self.wire.letter()?;
        self.timed(bytes.len() as u64, 1, || ());
        self.nanoseconds.fetch_add(begun.elapsed().as_nanos() as u64, Ordering::Relaxed);
        Letter::read(&bytes).map(|letter| (rank, letter))
    }

    fn spread(&self, bytes: &mut [u8]) {
        let received = if self.leads() { 0 } else { bytes.len() as u64 };
        self.timed(received, 1, || self.wire.spread(bytes));
    }

    pub(super) fn add(&self, numbers: &mut [u64]) {
        // A ring sends every number around it twice.
        let ranks = self.wire.size() as u64;
        self.timed(16 * numbers.len() as u64 * (ranks - 1) / ranks, 1, || self.wire.add(numbers));
    }

    /// All ranks come to what they do at once, without keeping a core busy while they wait for the one that leads.
    pub(super) fn come(&self, progress: &dyn Progress) -> Result<()> {
        if self.leads() {
            (1..self.wire.size()).for_each(|rank| self.send(rank, &Letter::Come));
            return Ok(());
        }
        self.await_letter(&Letter::Come, progress)
    }

    /// Rank 0 tells that the run is over, and well; others wait for it.
    ///
    /// # Errors
    /// [`Error::Interrupted`].
    pub fn part(&self, progress: &dyn Progress) -> Result<()> {
        if self.leads() {
            (1..self.wire.size()).for_each(|rank| self.send(rank, &Letter::Over));
            return Ok(());
        }
        self.await_letter(&Letter::Over, progress)
    }

    fn await_letter(&self, awaited: &Letter, progress: &dyn Progress) -> Result<()> {
        let mut nap = Nap::new();
        loop {
            match self.letter() {
                Some((_, letter)) if letter == *awaited => return Ok(()),
                Some(_) => {}
                None => std::thread::sleep(nap.next()),
            }
            progress.check()?;
        }
    }

    /// What rank 0 has.
    fn hear(&self, bytes: Vec<u8>, progress: &dyn Progress) -> Result<Vec<u8>> {
        if self.wire.size() == 1 {
            return Ok(bytes);
        }
        self.come(progress)?;
        let mut length = (bytes.len() as u64).to_le_bytes();
        self.spread(&mut length);
        let mut heard = bytes;
        heard.resize(usize::try_from(u64::from_le_bytes(length)).map_err(|_| unreadable())?, 0);
        heard.chunks_mut(SEGMENT).for_each(|part| self.spread(part));
        Ok(heard)
    }

    /// Rank 0's results, in their order, for every rank's `take`.
    fn hand_out(&self, results: Vec<Vec<u8>>, take: &mut Taker) -> Result<()> {
        let (alone, mut segment) = (self.wire.size() == 1, Vec::new());
        let send = |segment: &mut Vec<u8>| {
            self.spread(&mut (segment.len() as u64).to_le_bytes());
            self.spread(segment);
            segment.clear();
        };
        for bytes in results {
            take(&bytes)?;
            if !alone {
                segment.extend((bytes.len() as u64).to_le_bytes());
                segment.extend(&bytes);
                if segment.len() >= SEGMENT {
                    send(&mut segment);
                }
            }
        }
        if !segment.is_empty() {
            send(&mut segment);
        }
        if !alone {
            self.spread(&mut 0u64.to_le_bytes());
        }
        Ok(())
    }

    /// What rank 0 hands out.
    fn receive(&self, take: &mut Taker) -> Result<()> {
        loop {
            let mut length = [0; 8];
            self.spread(&mut length);
            let mut segment = vec![0; usize::try_from(u64::from_le_bytes(length)).map_err(|_| unreadable())?];
            if segment.is_empty() {
                return Ok(());
            }
            self.spread(&mut segment);
            let mut rest = &segment[..];
            while let Some((length, others)) = rest.split_first_chunk() {
                let length = usize::try_from(u64::from_le_bytes(*length)).map_err(|_| unreadable())?;
                let (bytes, others) = others.split_at_checked(length).ok_or_else(unreadable)?;
                take(bytes)?;
                rest = others;
            }
        }
    }

    fn next_meeting(&self) -> u64 {
        self.met.fetch_add(1, Ordering::Relaxed)
    }
}

impl Crew for Team {
    fn ranks(&self) -> usize {
        self.wire.size()
    }

    fn leads(&self) -> bool {
        self.wire.rank() == 0
    }

    fn meet(&self, at: &str, progress: &dyn Progress) -> Result<()> {
        let fix = "Give every host the same files, and start every rank by the same command";
        self.same(at.as_bytes(), "read another scene, or were given other settings,", fix, progress)?;
        if let Some(file) = self.checkpoint.get().filter(|_| self.leads()) {
            *self.ledger() = Some(Ledger::open(file, Sha256::digest(at.as_bytes()).into())?);
        }
        Ok(())
    }

    fn deal(&self, items: Range<u64>, work: &Work, take: &mut Taker, progress: &dyn Progress, told: &dyn Fn(u64)) -> Result<()> {
        let meeting = self.next_meeting();
        if !self.leads() {
            self.follow(meeting, work, progress)?;
            return self.receive(take);
        }
        let mut results: Vec<Option<Vec<u8>>> = vec![None; (items.end - items.start) as usize];
        let place = |item: u64| item.checked_sub(items.start).and_then(|i| usize::try_from(i).ok());
        if let Some(ledger) = self.ledger().as_mut() {
            for (item, bytes) in ledger.known(meeting)? {
                if let Some(result) = place(item).and_then(|i| results.get_mut(i)) {
                    *result = Some(bytes);
                }
            }
        }
        let queue = Queue::new(items.clone(), |item| results[(item - items.start) as usize].is_some());
        let mut done = results.iter().flatten().count() as u64;
        let mut keep = |item: u64, bytes: Vec<u8>| {
            if let Some(ledger) = self.ledger().as_mut() {
                ledger.note(meeting, item, &bytes)?;
            }
            if let Some(result) = place(item).and_then(|i| results.get_mut(i)) {
                *result = Some(bytes);
            }
            done += 1;
            told(done);
            Ok(())
        };
        self.lead(meeting, queue, work, &mut keep, progress)?;
        self.hand_out(results.into_iter().flatten().collect(), take)
    }

    fn tally(
        &self,
        items: Range<u64>,
        work: &(dyn Fn(u64) + Sync),
        sums: &[AtomicU64],
        progress: &dyn Progress,
        told: &dyn Fn(u64),
    ) -> Result<()> {
        let meeting = self.next_meeting();
        if self.checkpoint.get().is_some() {
            let known = self.ledger().as_mut().map_or(Ok(Vec::new()), |ledger| ledger.known(meeting))?;
            let known = known.into_iter().next().map(|(_, bytes)| bytes);
            if self.hear(vec![known.is_some().into()], progress)? == [1] {
                return unpacked(&self.hear(known.unwrap_or_default(), progress)?, sums);
            }
        }
        let work = |item: u64| {
            work(item);
            Vec::new()
        };
        if self.leads() {
            let mut done = 0;
            let mut keep = |_, _| {
                done += 1;
                told(done);
                Ok(())
            };
            self.lead(meeting, Queue::new(items, |_| false), &work, &mut keep, progress)?;
        } else {
            self.follow(meeting, &work, progress)?;
        }
        self.reduce(sums, progress)?;
        match self.ledger().as_mut() {
            Some(ledger) => ledger.note(meeting, WHOLE, &packed(sums)),
            None => Ok(()),
        }
    }

    fn agree(&self, said: &[f64], progress: &dyn Progress) -> Result<Vec<f64>> {
        let heard = self.hear(bytemuck::cast_slice(said).to_vec(), progress)?;
        Ok(heard.chunks_exact(8).map(bytemuck::pod_read_unaligned).collect())
    }

    fn beside(&self, progress: &dyn Progress) -> Result<u64> {
        let name = Sha256::digest(self.wire.host());
        let own = name.iter().take(8).fold(0, |sum, &byte| sum << 8 | u64::from(byte));
        let mut hosts = vec![0; self.wire.size()];
        hosts[self.wire.rank()] = own;
        self.come(progress)?;
        self.add(&mut hosts);
        Ok(hosts.iter().filter(|&&host| host == own).count() as u64)
    }

    fn spent(&self, progress: &dyn Progress) -> Result<Option<Spent>> {
        let ranks = self.wire.size();
        if ranks == 1 {
            return Ok(None);
        }
        self.come(progress)?;
        let mut sums = [&self.bytes, &self.messages, &self.nanoseconds].map(|n| n.load(Ordering::Relaxed));
        self.wire.add(&mut sums);
        Ok(Some(Spent { ranks, bytes: sums[0], messages: sums[1], seconds: sums[2] as f64 * 1e-9 / ranks as f64 }))
    }
}
