//! Samples to eight bits: enough to tell, nearly always, on which side of a number a sample is.
//!
//! Much of a flight's time goes by until a sample arrives from memory. A quarter of the bytes stays in nearer caches; what cannot
//! be told from them (levels within two of 255 parts) the sample itself decides, so that every answer is exact.

use crate::scene::density::BRICK_VOXELS;
use glam::IVec3;
use rayon::prelude::*;

/// Every sample as a share of its brick's largest.
#[derive(Debug, Clone, Default)]
pub(super) struct Shares {
    /// Of each brick of the source, a 255th of its largest sample; infinite where so little has no exact parts.
    parts: Vec<f32>,
    /// How many parts a sample is at least; block by block, so that a block's 64 samples share a line of the cache.
    counts: Vec<[u8; BRICK_VOXELS]>,
}

/// Where a sample stands among its brick's counts.
#[inline]
fn place(at: IVec3) -> usize {
    let (block, within) = (at & 4, at & 3);
    (block.x << 6 | block.y << 5 | block.z << 4 | within.x << 4 | within.y << 2 | within.z) as usize
}

impl Shares {
    /// Of all samples, brick by brick, z fastest.
    pub(super) fn new(samples: &[f32]) -> Self {
        let one = |brick: &[f32]| {
            let part = brick.iter().copied().fold(0.0, f32::max) / 255.0;
            let part = if part.is_normal() { part } else { f32::INFINITY };
            let mut counts = [0; BRICK_VOXELS];
            for (i, &sample) in brick.iter().enumerate() {
                let mut count = (sample / part) as u8;
                // Held below the sample as `bounds` computes it, whatever rounding does.
                while count > 0 && f32::from(count) * part > sample {
                    count -= 1;
                }
                counts[place(IVec3::new(i as i32 >> 6, i as i32 >> 3 & 7, i as i32 & 7))] = count;
            }
            (part, counts)
        };
        let (parts, counts) = samples.par_chunks_exact(BRICK_VOXELS).map(one).unzip();
        Shares { parts, counts }
    }

    /// What the sample of a brick at an index is at least (NaN if that is not known), and at most; 0 in bricks that the source
    /// does not have.
    #[inline]
    pub(super) fn bounds(&self, brick: usize, at: IVec3) -> (f32, f32) {
        let (Some(part), Some(counts)) = (self.parts.get(brick), self.counts.get(brick)) else { return (0.0, 0.0) };
        let count = f32::from(counts[place(at)]);
        // Two parts more, not one: what rounding can do to a share is far less than the second.
        (count * part, (count + 2.0) * part)
    }
}

#[cfg(test)]
mod tests;
