//! The search for balls: candidates in batches, in an order that threads do not change, until the budget is spent.

use super::{Body, MOST_REGIONS, Points, REFUSALS};
use crate::error::Result;
use crate::photon::{Model, PhotonTree};
use crate::rng::{Rng, Stage};
use glam::DVec3;
use rayon::prelude::*;

/// Candidates that share a stream of random numbers and are looked up together.
const CANDIDATES: usize = 64;

/// An accepted candidate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ball {
    /// World space.
    pub centre: DVec3,
    /// In metres.
    pub radius: f64,
    /// The photons within it.
    pub photons: u64,
}

/// What a search found.
#[derive(Debug)]
pub(super) struct Found {
    pub balls: Vec<Ball>,
    /// Candidates drawn.
    pub candidates: u64,
    /// The budget that is left, m^3; exactly 0 where it was closed.
    pub left: f64,
}

/// What the search of a region goes by.
pub(super) struct Search<'a> {
    /// Where candidates are drawn.
    pub points: Points<'a>,
    /// The region's photons.
    pub tree: &'a PhotonTree,
    /// World position of the photons' origin.
    pub origin: DVec3,
    pub model: Model,
    /// Photons that must lie within the search distance.
    pub estimate: u64,
    /// Extinction of a density of 1, 1/m.
    pub sigma_t: f64,
    /// The budget, m^3 times density.
    pub volume: f64,
    pub seed: u64,
    /// The first of the region's streams of random numbers.
    pub stream: u64,
}

impl Search<'_> {
    /// Searches until the budget is spent, or a rule of [`super`] stops it.
    ///
    /// # Errors
    /// Those of `tell`, which hears of the share that is done.
    pub fn run(&self, body: &impl Body, tell: &dyn Fn(f64) -> Result<()>) -> Result<Found> {
        let mut found = Found { balls: Vec::new(), candidates: 0, left: self.volume };
        let mut refused = 0;
        for batch in 0u64.. {
            tell(1.0 - found.left / self.volume)?;
            let largest = body.largest(self.model, found.left);
            let mut rng = Rng::new(self.seed, Stage::Regions, self.stream | batch);
            let candidates: Vec<(DVec3, f64)> = (0..CANDIDATES)
                .map(|_| {
                    let centre = self.points.draw(&mut rng);
                    (centre, self.distance(body, centre, &mut rng))
                })
                .collect();
            let known: Vec<Option<(Ball, f64)>> = candidates
                .into_par_iter()
                .map(|(centre, d)| {
                    let photons = if d <= largest { self.photons(body, centre, d) } else { return None };
                    let ball = Ball { centre, radius: d, photons };
                    (photons >= self.estimate).then(|| (ball, body.volume(centre, d, found.left)))
                })
                .collect();
            for known in known {
                found.candidates += 1;
                if let Some((ball, volume)) = known.and_then(|(ball, volume)| self.fitted(body, ball, volume, found.left)) {
                    refused = 0;
                    found.left -= volume;
                    found.balls.push(ball);
                    // What rounding leaves of the budget is no region.
                    if found.left <= 1e-9 * self.volume {
                        found.left = 0.0;
                        return Ok(found);
                    }
                    if found.balls.len() as u64 >= MOST_REGIONS {
                        return Ok(found);
                    }
                } else {
                    refused += 1;
                    if refused >= REFUSALS {
                        return Ok(found);
                    }
                }
            }
        }
        unreachable!("the stopping rule ends every search")
    }

    /// Eq. 27: a ball that fits into what is left, as it is; another is discarded to the letter, and shrunk to close the budget
    /// in the physical model. With what it holds, which is something.
    fn fitted(&self, body: &impl Body, ball: Ball, volume: f64, left: f64) -> Option<(Ball, f64)> {
        let (ball, volume) = match self.model {
            _ if volume <= left => (ball, volume),
            Model::Hura2006 => return None,
            Model::Physical => {
                let (radius, volume) = body.shrunk(ball.centre, ball.radius, left);
                (Ball { radius, photons: self.photons(body, ball.centre, radius), ..ball }, volume)
            }
        };
        // One that holds nothing could be made again and again.
        (volume > 0.0).then_some((ball, volume))
    }

    /// Eq. 17 with the extinction at the point: without its ln 0 in the physical model. Infinite where there is none.
    fn distance(&self, body: &impl Body, p: DVec3, rng: &mut Rng) -> f64 {
        let tau = match self.model {
            Model::Physical => rng.optical_depth(),
            Model::Hura2006 => -rng.uniform().ln(),
        };
        match self.sigma_t * body.density(p) {
            sigma_t if sigma_t > 0.0 => tau / sigma_t,
            _ => f64::INFINITY,
        }
    }

    /// The photons within `d` metres of a point, in every image of it.
    fn photons(&self, body: &impl Body, centre: DVec3, d: f64) -> u64 {
        let count = |shift: DVec3| self.tree.count_within((centre + shift - self.origin).as_vec3(), d as f32);
        body.images(centre, d).into_iter().map(count).sum()
    }
}
