//! Paths that are followed for a witness: a sample of their own, evenly started, the sky's light included.

use super::{BATCH_PATHS, Start, Tracer};
use crate::error::Result;
use crate::geom::Ray;
use crate::media::Scratch;
use crate::photon::Witness;
use crate::photon::colour::Colours;
use crate::progress::{Progress, tally};
use crate::rng::Rng;
use glam::Vec3;
use std::ops::Range;
use std::sync::atomic::AtomicU64;

impl Tracer {
    /// Paths in an item of [`Tracer::follow`].
    pub const PATHS: u64 = BATCH_PATHS;

    /// Follows the paths of some items, which start evenly over the silhouette, and tells a witness of every flight; none is stored. What
    /// the witness makes of them are sums, which are those of all ranks afterwards.
    ///
    /// # Errors
    /// [`Error::Interrupted`].
    pub fn follow<W: Witness>(
        &self,
        items: Range<u64>,
        seed: u64,
        (witness, sums): (&W, &[AtomicU64]),
        progress: &dyn Progress,
        told: impl Fn(u64) + Sync,
    ) -> Result<()> {
        let one = |item: u64| drop(self.batch(seed, item, Some(&items), 0, witness, progress));
        tally(items.clone(), one, sums, progress, told)
    }

    /// What all light has for a colour, of luminance 1; `None` where colours ride along.
    pub fn tint(&self) -> Option<Vec3> {
        if let Colours::Even(tint) = self.colours { Some(tint) } else { None }
    }

    /// About the most power that a path has in a channel, before it is divided by their number, W.
    pub fn strongest(&self) -> f64 {
        let (sky, [lamps, flames], air) = (self.share_of_sky(), self.shares_of_near(true), self.share_of_air());
        let rest = (1.0 - lamps - flames) * (1.0 - air);
        let of = |power: f64, share: f64| if power > 0.0 { power / share } else { 0.0 };
        let far = if rest > 0.0 {
            let sky_power = self.sky.as_ref().map_or(0.0, |light| light.power());
            of(self.emitter.base_power(), (1.0 - sky) * rest).max(of(sky_power, sky * rest))
        } else {
            0.0
        };
        let lamps = of(self.lamps.as_ref().map_or(0.0, |light| light.strongest()), lamps * (1.0 - air));
        let flames = of(self.flames.as_ref().map_or(0.0, |light| light.strongest()), flames * (1.0 - air));
        self.colours.most() * far.max(lamps).max(flames).max(self.air_light.map_or(0.0, |light| light.power / air))
    }

    /// The share of paths of [`Tracer::follow`] that start in air.
    fn share_of_air(&self) -> f64 {
        let Some(light) = self.air_light else { return 0.0 };
        let [lamps, flames] = self.near_powers();
        let other = self.emitter.base_power() + self.sky.as_ref().map_or(0.0, |sky| sky.power()) + lamps + flames;
        (light.power / (light.power + other)).clamp(0.1, 0.8)
    }

    /// What lamps and flames send out, W.
    fn near_powers(&self) -> [f64; 2] {
        [self.lamps.as_ref().map_or(0.0, |lamps| lamps.power), self.flames.as_ref().map_or(0.0, |flames| flames.power())]
    }

    /// The shares of the others that start at lamps and in flames: of a sample no kind has few; else all have the same power.
    fn shares_of_near(&self, sample: bool) -> [f64; 2] {
        let near = self.near_powers();
        let sum: f64 = near.iter().sum();
        if sum <= 0.0 {
            return [0.0; 2];
        }
        let sky = if sample { self.sky.as_ref().map_or(0.0, |sky| sky.power()) } else { 0.0 };
        let far = self.emitter.base_power() + sky;
        let share = sum / (sum + far);
        let share = if sample && far > 0.0 { share.clamp(0.2, 0.8) } else { share };
        let first = near[0] / sum;
        let first = if sample && near.iter().all(|&power| power > 0.0) { first.clamp(0.2, 0.8) } else { first };
        [share * first, share * (1.0 - first)]
    }

    /// The share of those that are left that start in the sky.
    fn share_of_sky(&self) -> f64 {
        let Some(sky) = &self.sky else { return 0.0 };
        let sun = self.emitter.base_power();
        if sun > 0.0 { (sky.power() / (sky.power() + sun)).clamp(0.2, 0.8) } else { 1.0 }
    }

    /// Starts a path; in the sky and in air too where it is one of a sample.
    pub(super) fn start(&self, rng: &mut Rng, along: Option<f64>, scratch: &mut Scratch) -> Start {
        let shares = if along.is_some() { (self.share_of_sky(), self.share_of_air()) } else { (0.0, 0.0) };
        if let Some(light) = self.air_light.filter(|_| shares.1 > 0.0 && rng.uniform() < shares.1) {
            let start = light.emit(self, rng, scratch);
            return Start { power: start.power / shares.1, ..start };
        }
        let near = self.shares_of_near(along.is_some());
        if near[0] + near[1] > 0.0 {
            let drawn = rng.uniform();
            let start = match (&self.lamps, &self.flames) {
                (Some(light), _) if drawn < near[0] => Some((light.emit(rng), near[0])),
                (_, Some(light)) if drawn < near[0] + near[1] => Some((light.emit(rng), near[1])),
                _ => None,
            };
            if let Some((start, share)) = start {
                let counted = self.media.entrance(&start.ray, scratch).is_some();
                let tint = if self.tints().is_some() { start.tint } else { Vec3::ONE };
                return Start { power: start.power / (share * (1.0 - shares.1)), tint, counted, ..start };
            }
        }
        let (start, share, tint) = match self.sky.as_ref().filter(|_| shares.0 > 0.0 && rng.uniform() < shares.0) {
            Some(sky) => {
                let start = sky.emit(rng, self.eye.as_ref());
                (start, shares.0, self.tints().map(|tints| tints.sky.unwrap_or(start.tint)))
            }
            None => (self.emitter.emit(rng, &self.surfaces, along), 1.0 - shares.0, self.tints().map(|tints| tints.sun)),
        };
        let upstream = Ray { direction: -start.ray.direction, ..start.ray };
        let clear = self.air.transmittance(&upstream, f32::INFINITY);
        let (power, tint) = match tint {
            Some(tint) => (start.power, tint * clear),
            None => (start.power * f64::from(clear.x), Vec3::ONE),
        };
        Start { power: power / (share * (1.0 - near[0] - near[1]) * (1.0 - shares.1)), tint, ..start }
    }

    /// The area, across the sunlight, over which photons start, m^2.
    pub fn silhouette(&self) -> f64 {
        self.emitter.area()
    }
}
