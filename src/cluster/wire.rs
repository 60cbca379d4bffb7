//! What carries words between ranks: letters from one to one, and two things that all do at once.

/// What carries words between ranks. The one that leads has rank 0.
pub trait Wire: Send + Sync {
    /// This rank.
    fn rank(&self) -> usize;

    /// How many there are.
    fn size(&self) -> usize;

    /// Sends a letter. Letters from one rank to another arrive in their order.
    fn send(&self, to: usize, letter: &[u8]);

    /// A letter that has arrived, with its sender's rank.
    fn letter(&self) -> Option<(usize, Vec<u8>)>;

    /// What rank 0 has becomes what all have: every rank calls this, with as many bytes.
    fn spread(&self, bytes: &mut [u8]);

    /// What all have becomes its sum, modulo 2^64: every rank calls this, with as many numbers.
    fn add(&self, numbers: &mut [u64]);

    /// The name of this rank's host.
    fn host(&self) -> String {
        "this host".into()
    }

    /// Leaves the others, all of whom do so.
    fn part(&self) {}

    /// Ends the processes of all ranks, where this can.
    fn end_all(&self, _code: u8) {}
}

/// One rank, which has nobody to write to.
#[derive(Debug)]
pub struct Solo;

impl Wire for Solo {
    fn rank(&self) -> usize {
        0
    }

    fn size(&self) -> usize {
        1
    }

    fn send(&self, _: usize, _: &[u8]) {}

    fn letter(&self) -> Option<(usize, Vec<u8>)> {
        None
    }

    fn spread(&self, _: &mut [u8]) {}

    fn add(&self, _: &mut [u64]) {}
}

/// What ranks write to each other. A meeting's number tells letters of the last one from those of this.
#[derive(Debug, PartialEq)]
pub enum Letter {
    /// To rank 0: this rank's threads want items.
    Want {
        /// The meeting.
        meeting: u64,
        /// Threads of the rank.
        threads: u64,
    },
    /// From rank 0: these items are yours.
    Grant {
        /// The meeting.
        meeting: u64,
        /// The first item, and the one behind the last.
        items: [u64; 2],
    },
    /// To rank 0: what came of some items.
    Done {
        /// The meeting.
        meeting: u64,
        /// Each item's number and bytes.
        out: Vec<(u64, Vec<u8>)>,
    },
    /// From rank 0: all items are done.
    Ended {
        /// The meeting.
        meeting: u64,
    },
    /// From rank 0: come to what all do at once.
    Come,
    /// From rank 0: the run is over, and well.
    Over,
}

impl Letter {
    /// As bytes.
    pub fn bytes(&self) -> Vec<u8> {
        let mut out = Vec::new();
        let (kind, numbers): (u64, [u64; 3]) = match self {
            Letter::Want { meeting, threads } => (0, [*meeting, *threads, 0]),
            Letter::Grant { meeting, items } => (1, [*meeting, items[0], items[1]]),
            Letter::Done { meeting, .. } => (2, [*meeting, 0, 0]),
            Letter::Ended { meeting } => (3, [*meeting, 0, 0]),
            Letter::Come => (4, [0; 3]),
            Letter::Over => (5, [0; 3]),
        };
        [kind].iter().chain(&numbers).for_each(|n| out.extend(n.to_le_bytes()));
        if let Letter::Done { out: items, .. } = self {
            for (item, bytes) in items {
                out.extend(item.to_le_bytes());
                out.extend((bytes.len() as u64).to_le_bytes());
                out.extend(bytes);
            }
        }
        out
    }

    /// Reads one; `None` where it is none.
    pub fn read(bytes: &[u8]) -> Option<Letter> {
        let mut rest = bytes;
        let mut number = || -> Option<u64> {
            let (first, others) = rest.split_at_checked(8)?;
            rest = others;
            Some(u64::from_le_bytes(first.try_into().ok()?))
        };
        let (kind, meeting, a, b) = (number()?, number()?, number()?, number()?);
        match kind {
            0 => Some(Letter::Want { meeting, threads: a }),
            1 => Some(Letter::Grant { meeting, items: [a, b] }),
            2 => {
                let mut out = Vec::new();
                while !rest.is_empty() {
                    let (head, others) = rest.split_at_checked(16)?;
                    let (item, length) = head.split_at(8);
                    let length = usize::try_from(u64::from_le_bytes(length.try_into().ok()?)).ok()?;
                    let (bytes, others) = others.split_at_checked(length)?;
                    out.push((u64::from_le_bytes(item.try_into().ok()?), bytes.to_vec()));
                    rest = others;
                }
                Some(Letter::Done { meeting, out })
            }
            3 => Some(Letter::Ended { meeting }),
            4 => Some(Letter::Come),
            5 => Some(Letter::Over),
            _ => None,
        }
    }
}
