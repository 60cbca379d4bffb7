//! Sums that ranks add up, of which most may be 0.

use super::team::{SEGMENT, Team};
use super::unreadable;
use crate::error::Result;
use crate::progress::Progress;
use std::sync::atomic::{AtomicU64, Ordering};

/// Sums are sent in bricks of so many, where any of them is not 0.
const BRICK: usize = 512;

impl Team {
    /// Adds up what ranks have, in bricks that any of them has touched.
    pub(super) fn reduce(&self, sums: &[AtomicU64], progress: &dyn Progress) -> Result<()> {
        if self.wire.size() == 1 {
            return Ok(());
        }
        self.come(progress)?;
        let mut touched = touched(sums);
        self.add(&mut touched);
        let bricks: Vec<&[AtomicU64]> = sums.chunks(BRICK).zip(&touched).filter(|(_, n)| **n > 0).map(|(brick, _)| brick).collect();
        for part in bricks.chunks(SEGMENT / (8 * BRICK)) {
            let mut numbers: Vec<u64> = part.iter().flat_map(|brick| brick.iter()).map(|n| n.load(Ordering::Relaxed)).collect();
            self.add(&mut numbers);
            part.iter().flat_map(|brick| brick.iter()).zip(numbers).for_each(|(sum, n)| sum.store(n, Ordering::Relaxed));
        }
        Ok(())
    }
}

/// Which bricks hold anything: 1 or 0.
fn touched(sums: &[AtomicU64]) -> Vec<u64> {
    sums.chunks(BRICK).map(|brick| u64::from(brick.iter().any(|n| n.load(Ordering::Relaxed) != 0))).collect()
}

/// The bricks that hold anything, each behind its number.
pub(super) fn packed(sums: &[AtomicU64]) -> Vec<u8> {
    let mut out = Vec::new();
    for (number, brick) in (0u64..).zip(sums.chunks(BRICK)).filter(|(_, b)| b.iter().any(|n| n.load(Ordering::Relaxed) != 0)) {
        out.extend(number.to_le_bytes());
        brick.iter().for_each(|n| out.extend(n.load(Ordering::Relaxed).to_le_bytes()));
    }
    out
}

/// Sets sums to what was [`packed`] of others like them.
pub(super) fn unpacked(mut bytes: &[u8], sums: &[AtomicU64]) -> Result<()> {
    sums.iter().for_each(|n| n.store(0, Ordering::Relaxed));
    while let Some((number, rest)) = bytes.split_first_chunk() {
        let first = u64::from_le_bytes(*number).checked_mul(BRICK as u64).and_then(|n| usize::try_from(n).ok()).ok_or_else(unreadable)?;
        let brick = sums.get(first..sums.len().min(first.saturating_add(BRICK))).ok_or_else(unreadable)?;
        let (numbers, rest) = rest.split_at_checked(8 * brick.len()).ok_or_else(unreadable)?;
        let numbers = numbers.as_chunks::<8>().0.iter().map(|n| u64::from_le_bytes(*n));
        brick.iter().zip(numbers).for_each(|(sum, n)| sum.store(n, Ordering::Relaxed));
        bytes = rest;
    }
    if bytes.is_empty() { Ok(()) } else { Err(unreadable()) }
}
