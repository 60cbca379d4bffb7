//! What a search needs to know of the region that it analyses.

use crate::photon::Model;
use crate::scene::Shape;
use glam::DVec3;
use smallvec::{SmallVec, smallvec};
use std::f64::consts::PI;

/// A region as its search sees it. Volumes are in m^3, weighed by density.
pub(super) trait Body: Sync {
    /// The density at a point of the world: 1 where the region's own medium is.
    fn density(&self, p: DVec3) -> f64;

    /// No ball of a larger radius is looked at, m; `left` of the budget is to be spent.
    fn largest(&self, model: Model, left: f64) -> f64;

    /// What a ball of radius `d` metres holds; anything above `enough` where it holds more than that.
    fn volume(&self, centre: DVec3, d: f64, enough: f64) -> f64;

    /// The radius, at most `d`, at which a ball holds `volume` and no more, m; and what it holds then.
    fn shrunk(&self, centre: DVec3, d: f64, volume: f64) -> (f64, f64);

    /// By how much to shift a ball for all its images that the region's photons can lie in, m.
    fn images(&self, centre: DVec3, d: f64) -> SmallVec<[DVec3; 4]>;
}

/// An even region, whose balls stick out of it as they are.
pub(super) struct Even {
    /// A ball larger than the region it refines could only be the region again, elsewhere.
    largest: f64,
}

impl Even {
    pub fn new(shape: &Shape) -> Self {
        Even { largest: 0.5 * shape.thickness() }
    }
}

impl Body for Even {
    fn density(&self, _: DVec3) -> f64 {
        1.0
    }

    fn largest(&self, model: Model, left: f64) -> f64 {
        match model {
            Model::Physical => self.largest,
            // What cannot fit need not be counted; rounding is left to the search.
            Model::Hura2006 => (left * 0.75 / PI).cbrt() * (1.0 + 1e-9),
        }
    }

    fn volume(&self, _: DVec3, d: f64, _: f64) -> f64 {
        4.0 / 3.0 * PI * d.powi(3)
    }

    fn shrunk(&self, centre: DVec3, _: f64, volume: f64) -> (f64, f64) {
        let d = (volume * 0.75 / PI).cbrt();
        (d, self.volume(centre, d, f64::INFINITY))
    }

    fn images(&self, _: DVec3, _: f64) -> SmallVec<[DVec3; 4]> {
        smallvec![DVec3::ZERO]
    }
}
