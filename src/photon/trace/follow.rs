//! Paths that are followed for a witness: a sample of their own, evenly started, the sky's light included.

use super::{BATCH_PATHS, Start, Tracer};
use crate::error::Result;
use crate::photon::Witness;
use crate::progress::Progress;
use crate::rng::Rng;
use rayon::prelude::*;
use std::ops::Range;

impl Tracer {
    /// Paths in an item of [`Tracer::follow`].
    pub const PATHS: u64 = BATCH_PATHS;

    /// Follows the paths of some items, which start evenly over the silhouette, and tells a witness of every flight; none is stored.
    ///
    /// # Errors
    /// [`Error::Interrupted`].
    pub fn follow<W: Witness>(&self, items: Range<u64>, seed: u64, witness: &W, progress: &dyn Progress) -> Result<()> {
        items.clone().into_par_iter().for_each(|item| {
            if !progress.cancelled() {
                self.batch(seed, item, Some(&items), 0, witness, progress);
            }
        });
        progress.check()
    }

    /// About the most power that a path starts with, before it is divided by their number, W.
    pub fn strongest(&self) -> f64 {
        let share = self.share_of_sky();
        let sun = if share < 1.0 { self.emitter.base_power() / (1.0 - share) } else { 0.0 };
        sun.max(self.sky.map_or(0.0, |sky| sky.power() / share))
    }

    /// The share of paths of [`Tracer::follow`] that start in the sky.
    fn share_of_sky(&self) -> f64 {
        let Some(sky) = &self.sky else { return 0.0 };
        let sun = self.emitter.base_power();
        if sun > 0.0 { (sky.power() / (sky.power() + sun)).clamp(0.2, 0.8) } else { 1.0 }
    }

    /// Starts a path; in the sky too where it is one of a sample.
    pub(super) fn start(&self, rng: &mut Rng, along: Option<f64>) -> Start {
        let share = if along.is_some() { self.share_of_sky() } else { 0.0 };
        if let Some(sky) = self.sky.filter(|_| share > 0.0 && rng.uniform() < share) {
            let start = sky.emit(rng);
            return Start { power: start.power / share, ..start };
        }
        let start = self.emitter.emit(rng, &self.surfaces, along);
        Start { power: start.power / (1.0 - share), ..start }
    }

    /// The area, across the sunlight, over which photons start, m^2.
    pub fn silhouette(&self) -> f64 {
        self.emitter.area()
    }
}
