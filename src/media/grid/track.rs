//! Collisions by null collisions, and transmittance without error.

use super::walk::{Segment, cell_at};
use super::{Grid, trilinear};
use crate::geom::Ray;
use crate::media::Scratch;
use crate::media::profile::Piece;
use crate::rng::Rng;
use glam::IVec3;
use std::ops::ControlFlow;

/// A transmittance plays roulette each time that it has fallen by so many optical depths, and goes on with this probability.
const FAINT_DEPTH: f64 = 2.0;
const SURVIVAL: f64 = 0.25;

/// Nothing passes an optical depth like this: e^-1000 is 0 in double precision.
const OPAQUE: f64 = 1000.0;

impl Grid {
    /// Flies until a collision, at most to `t_max`, by null collisions: the distance.
    ///
    /// A collision is accepted by one of the eight samples around it, drawn with its weight as probability: the expectation
    /// is the trilinear density, so collisions are distributed as by that, for an eighth of the work.
    pub(in crate::media) fn fly(&self, ray: &Ray, t_max: f32, rng: &mut Rng, scratch: &mut Scratch) -> Option<f32> {
        let mut tau = rng.optical_depth();
        let (mut found, mut tentative, mut violations) = (None, 0, 0);
        self.walk::<false>(ray, t_max, |segment| {
            let sigma = f64::from(segment.majorant) * self.sigma_t;
            let mut at = f64::from(segment.from);
            loop {
                let left = sigma * (f64::from(segment.to) - at);
                if tau >= left {
                    tau -= left;
                    return ControlFlow::Continue(());
                }
                at += tau / sigma;
                tentative += 1;
                if self.accepts(&segment, at as f32, rng, &mut violations) {
                    found = Some(segment.before + at as f32);
                    return ControlFlow::Break(());
                }
                tau = rng.optical_depth();
            }
        });
        scratch.tentative += tentative;
        scratch.violations += violations;
        found
    }

    /// An unbiased estimate of the transmittance over the first `t_max` metres: exact until it has fallen by
    /// [`FAINT_DEPTH`], where what is left begins to play roulette.
    pub(in crate::media) fn transmittance(&self, ray: &Ray, t_max: f32, rng: &mut Rng) -> f64 {
        let (mut depth, mut limit, mut weight) = (0.0, FAINT_DEPTH, 1.0);
        self.walk::<true>(ray, t_max, |segment| {
            depth += self.depth(&segment) * self.sigma_t;
            while depth > limit {
                if rng.uniform() >= SURVIVAL {
                    weight = 0.0;
                    return ControlFlow::Break(());
                }
                weight /= SURVIVAL;
                limit += FAINT_DEPTH;
            }
            ControlFlow::Continue(())
        });
        if weight > 0.0 { weight * (-depth).exp() } else { 0.0 }
    }

    /// The optical depth over the first `t_max` metres, exact but for rounding: along a line trilinear density is a cubic within
    /// each cell, which Simpson's rule integrates without error. No farther than to [`OPAQUE`]: a level ray in a repeated layer has
    /// no end.
    pub(in crate::media) fn optical_depth(&self, ray: &Ray, t_max: f32) -> f64 {
        let mut sum = 0.0;
        self.walk::<true>(ray, t_max, |segment| {
            sum += self.depth(&segment);
            if sum * self.sigma_t < OPAQUE { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        });
        sum * self.sigma_t
    }

    /// Visits the stretches of the first `t_max` metres that are not empty, until their optical depth is `most`: within cells, by the exact
    /// mean, until it is `exact`, and behind that by the means of blocks.
    pub(in crate::media) fn pieces(&self, ray: &Ray, t_max: f32, (exact, most): (f64, f64), mut visit: impl FnMut(Piece)) {
        let mut tell = |at: &Segment, mean: f32, tilt: f32, sum: &mut f64| {
            let sigma = f64::from(mean) * self.sigma_t;
            let (from, to) = (at.before + at.from, at.before + at.to);
            if mean > 0.0 && to > from {
                visit(Piece { from, to, sigma: sigma as f32, tilt, region: self.region });
            }
            *sum += f64::from(at.to - at.from) * sigma;
            if *sum < most { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        };
        let mut sum = 0.0;
        self.walk::<false>(ray, t_max, |block| {
            if sum >= exact {
                return tell(&block, self.mean(block.low), 0.0, &mut sum);
            }
            block.cells(&mut |cell| {
                let densities = self.densities(&cell);
                let mean = simpson(densities);
                // Ends that differ by twice the mean leave nothing at one of them.
                let tilt = if mean > 0.0 { (0.5 * (densities[2] - densities[0]) / mean).clamp(-1.0, 1.0) } else { 0.0 };
                tell(&cell, mean, tilt, &mut sum)
            })
        });
    }

    /// The integral of density along a stretch within one cell, by Simpson's rule.
    #[inline]
    fn depth(&self, segment: &Segment) -> f64 {
        f64::from(segment.to - segment.from) * f64::from(simpson(self.densities(segment)))
    }

    /// Densities at the start, the middle and the end of a stretch within one cell.
    #[inline]
    fn densities(&self, segment: &Segment) -> [f32; 3] {
        let corners = self.corners(segment.low);
        let low = segment.low.as_vec3a();
        let (from, to) = (segment.from, segment.to);
        [from, 0.5 * (from + to), to].map(|t| trilinear(&corners, segment.origin + segment.direction * t - low))
    }

    /// Whether a collision at distance `at` is one by one of the eight samples around it, drawn by its weight.
    #[inline]
    fn accepts(&self, segment: &Segment, at: f32, rng: &mut Rng, violations: &mut u64) -> bool {
        let p = segment.origin + segment.direction * at;
        // Rounding may carry a point out of its block: it is held there, where the majorant is known.
        let base = cell_at(p, segment.low, segment.high);
        let (u, f) = (rng.uniform_vec3(), p - base.as_vec3a());
        let sample = base + IVec3::new((u.x < f.x).into(), (u.y < f.y).into(), (u.z < f.z).into());
        let level = rng.uniform_f32() * segment.majorant;
        let sample = self.unrepeated(sample);
        let Some(brick) = self.brick(sample) else { return false };
        let (least, most) = self.shares.bounds(brick, sample);
        *violations += u64::from(least > segment.majorant);
        if level < least {
            return true;
        }
        if level > most {
            return false;
        }
        let value = self.sample_in(brick, sample);
        *violations += u64::from(value > segment.majorant);
        level < value
    }
}

/// The mean of what is a cubic, by its start, middle and end.
#[inline]
fn simpson([from, middle, to]: [f32; 3]) -> f32 {
    (from + 4.0 * middle + to) * (1.0 / 6.0)
}
