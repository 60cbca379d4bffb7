//! Items dealt to whoever is free: a rank asks for more before its threads run out; what it gets shrinks as little is left.

use super::team::Team;
use super::wire::Letter;
use crate::error::Result;
use crate::progress::{Progress, Work};
use rayon::Scope;
use std::collections::VecDeque;
use std::ops::Range;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};

/// A rank is granted this part of what it would get were all that is left dealt evenly.
const PART: u64 = 4;
/// And at most so many items.
const MOST: u64 = 4096;
/// Results are sent when they are so many bytes, or so old, or the last.
const ENOUGH: usize = 1 << 18;
const OLD: Duration = Duration::from_millis(20);
/// Between looks at the letters, at least and at most.
const NAPS: [Duration; 2] = [Duration::from_micros(50), Duration::from_millis(2)];

/// Waits that grow while nothing happens.
pub(super) struct Nap(Duration);

impl Nap {
    /// The shortest.
    pub fn new() -> Self {
        Nap(NAPS[0])
    }

    /// The next one.
    pub fn next(&mut self) -> Duration {
        let nap = self.0;
        self.0 = (2 * nap).min(NAPS[1]);
        nap
    }
}

/// Items that nobody does yet.
pub(super) struct Queue {
    ranges: VecDeque<Range<u64>>,
    left: u64,
}

impl Queue {
    /// Those of `items` that are not `done`.
    pub fn new(items: Range<u64>, done: impl Fn(u64) -> bool) -> Self {
        let mut queue = Queue { ranges: VecDeque::new(), left: 0 };
        for item in items.filter(|&item| !done(item)) {
            queue.left += 1;
            match queue.ranges.back_mut() {
                Some(range) if range.end == item => range.end += 1,
                _ => queue.ranges.push_back(item..item + 1),
            }
        }
        queue
    }

    /// The next items for a rank with so many threads.
    pub fn grant(&mut self, threads: u64, ranks: u64) -> Option<Range<u64>> {
        let most = (self.left / (PART * ranks)).clamp(threads.min(MOST), MOST);
        let range = self.ranges.front_mut()?;
        let granted = range.start..range.end.min(range.start + most);
        range.start = granted.end;
        if range.is_empty() {
            self.ranges.pop_front();
        }
        self.left -= granted.end - granted.start;
        Some(granted)
    }
}

/// What came of an item; nothing where doing it panicked.
type Outcome = (u64, Option<Vec<u8>>);

/// Tells what came of an item, whatever becomes of doing it.
struct Slot {
    to: Sender<Outcome>,
    outcome: Outcome,
}

impl Slot {
    fn fill(&mut self, out: Vec<u8>) {
        self.outcome.1 = Some(out);
    }
}

impl Drop for Slot {
    fn drop(&mut self) {
        let _ = self.to.send((self.outcome.0, self.outcome.1.take()));
    }
}

/// The threads of this rank.
struct Hands {
    threads: u64,
    running: u64,
    to: Sender<Outcome>,
    from: Receiver<Outcome>,
}

impl Hands {
    fn new() -> Self {
        let (to, from) = channel();
        Hands { threads: rayon::current_num_threads() as u64, running: 0, to, from }
    }

    fn want(&self) -> bool {
        self.running < 2 * self.threads
    }

    fn begin<'a>(&mut self, items: Range<u64>, scope: &Scope<'a>, work: &'a Work<'a>) {
        for item in items {
            let mut slot = Slot { to: self.to.clone(), outcome: (item, None) };
            scope.spawn(move |_| slot.fill(work(item)));
            self.running += 1;
        }
    }

    /// What is done by now, or within a time.
    fn next(&mut self, within: Duration) -> Option<Outcome> {
        match self.from.recv_timeout(within) {
            Ok(outcome) => {
                self.running -= 1;
                Some(outcome)
            }
            // This rank holds a sender itself.
            Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => None,
        }
    }
}

impl Team {
    /// As rank 0: deals what is in the queue, does a share of it, and has `keep` take what comes back, from whomever and in any order.
    pub(super) fn lead(
        &self,
        meeting: u64,
        mut queue: Queue,
        work: &Work,
        keep: &mut dyn FnMut(u64, Vec<u8>) -> Result<()>,
        progress: &dyn Progress,
    ) -> Result<()> {
        let (ranks, mut left) = (self.wire.size() as u64, queue.left);
        rayon::in_place_scope(|scope| {
            let (mut hands, mut nap) = (Hands::new(), Nap::new());
            while left > 0 {
                while hands.want() {
                    let Some(items) = queue.grant(hands.threads, ranks) else { break };
                    hands.begin(items, scope, work);
                }
                let mut within = nap.next();
                while let Some((item, out)) = hands.next(within) {
                    // What panicked does so again as the scope ends.
                    let Some(out) = out else { return Ok(()) };
                    progress.check()?;
                    keep(item, out)?;
                    left -= 1;
                    (within, nap) = (Duration::ZERO, Nap::new());
                }
                progress.check()?;
                while let Some((rank, letter)) = self.letter() {
                    nap = Nap::new();
                    match letter {
                        Letter::Want { meeting: at, threads } if at == meeting => {
                            if let Some(items) = queue.grant(threads, ranks) {
                                self.send(rank, &Letter::Grant { meeting, items: [items.start, items.end] });
                            }
                        }
                        Letter::Done { meeting: at, out } if at == meeting => {
                            for (item, out) in out {
                                keep(item, out)?;
                                left -= 1;
                            }
                        }
                        // Somebody wanted more than there was in the meeting before.
                        _ => {}
                    }
                }
            }
            (1..self.wire.size()).for_each(|rank| self.send(rank, &Letter::Ended { meeting }));
            Ok(())
        })
    }

    /// As another rank: does what rank 0 grants, until all is done.
    pub(super) fn follow(&self, meeting: u64, work: &Work, progress: &dyn Progress) -> Result<()> {
        rayon::in_place_scope(|scope| {
            let (mut hands, mut nap, mut asked) = (Hands::new(), Nap::new(), false);
            let (mut out, mut bytes, mut since) = (Vec::new(), 0, Instant::now());
            loop {
                if !asked && hands.want() {
                    self.send(0, &Letter::Want { meeting, threads: hands.threads });
                    asked = true;
                }
                while let Some((_, letter)) = self.letter() {
                    nap = Nap::new();
                    match letter {
                        Letter::Grant { items: [first, end], .. } => {
                            asked = false;
                            hands.begin(first..end, scope, work);
                        }
                        Letter::Ended { meeting: at } if at == meeting => return Ok(()),
                        _ => {}
                    }
                }
                let mut within = nap.next();
                while let Some((item, result)) = hands.next(within) {
                    let Some(result) = result else { return Ok(()) };
                    if out.is_empty() {
                        since = Instant::now();
                    }
                    bytes += result.len();
                    out.push((item, result));
                    (within, nap) = (Duration::ZERO, Nap::new());
                }
                // What was left early is nothing.
                progress.check()?;
                if !out.is_empty() && (bytes >= ENOUGH || hands.running == 0 || since.elapsed() >= OLD) {
                    self.send(0, &Letter::Done { meeting, out: std::mem::take(&mut out) });
                    bytes = 0;
                }
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_queue_deals_each_missing_item_once_in_order_and_ever_fewer() {
        let done = |item: u64| (20..30).contains(&item) || item == 5;
        let mut queue = Queue::new(3..1000, done);
        let mut grants = Vec::new();
        while let Some(range) = queue.grant(2, 3) {
            grants.push(range);
        }
        let items: Vec<u64> = grants.iter().cloned().flatten().collect();
        assert_eq!(items, (3..1000).filter(|&item| !done(item)).collect::<Vec<_>>());
        assert_eq!(queue.left, 0);
        let sizes: Vec<u64> = grants.iter().map(|r| r.end - r.start).collect();
        // A twelfth of what is left, but where a range ends; down to one for each thread.
        assert_eq!((sizes[0], *sizes.iter().max().unwrap(), sizes[sizes.len() - 2]), (2, 80, 2));
    }
}
