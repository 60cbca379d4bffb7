//! Random numbers: MT19937-64 streams, one for each (seed, stage, item).
//!
//! The thesis asks for the Mersenne Twister (3.3). An *item* is a fixed batch of photons or candidates, never a
//! thread: the same seed gives the same bytes on any number of threads.

use rand_mt::Mt64;

/// What a stream is for; part of its key, so that stages never share numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// Pass 1: emission and tracing of photons.
    Photons = 1,
    /// The duality: candidates for regions.
    Regions = 2,
    /// Rays of sunlight that measure what was made.
    Sunlight = 3,
    /// Camera rays.
    Render = 4,
    /// Photons of an energy balance.
    Flux = 5,
    /// Pass 2's own photons.
    Gather = 6,
    /// Paths that tell what air sends.
    Air = 7,
    /// Ways that tell what surfaces get from media.
    Cast = 8,
}

/// A stream of uniform random numbers.
#[derive(Debug, Clone)]
pub struct Rng(Mt64);

impl Rng {
    /// The stream of one item of one stage.
    pub fn new(seed: u64, stage: Stage, item: u64) -> Self {
        Rng(Mt64::new_with_key([seed, stage as u64, item]))
    }

    /// A uniform number in [0, 1) with 53 random bits.
    #[inline]
    pub fn uniform(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// 64 random bits.
    #[inline]
    pub fn bits(&mut self) -> u64 {
        self.0.next_u64()
    }

    /// A uniform number in [0, 1) in single precision (24 random bits).
    #[inline]
    pub fn uniform_f32(&mut self) -> f32 {
        (self.0.next_u64() >> 40) as f32 * (1.0 / (1u64 << 24) as f32)
    }

    /// Three uniform numbers in [0, 1), 21 random bits each.
    #[inline]
    pub fn uniform_vec3(&mut self) -> glam::Vec3 {
        let bits = self.0.next_u64();
        let part = |shift: u32| (bits >> shift & 0x1f_ffff) as f32 * (1.0 / (1u32 << 21) as f32);
        glam::Vec3::new(part(43), part(22), part(1))
    }

    /// An optical depth from the exponential distribution, -ln(1 - xi): eq. 17 without its ln 0.
    ///
    /// 1 - xi is exact for 53-bit xi, so this equals `-ln_1p(-xi)` at a third of its cost.
    #[inline]
    pub fn optical_depth(&mut self) -> f64 {
        -(1.0 - self.uniform()).ln()
    }
}
