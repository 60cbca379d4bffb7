//! Media that shine by themselves: flames, embers, lava.

use super::{Medium, Region, Shape, medium::luminance};
use std::f64::consts::PI;

/// Where something shines, and how much. It is nothing that light collides with: that is a region's.
#[derive(Debug, Clone)]
pub struct Flame {
    /// The node or the grid it came from.
    pub name: String,
    /// Where it is; it has an end.
    pub shape: Shape,
    /// The emission coefficient, W m^-3 sr^-1, RGB: of a grid, that of a sample of 1.
    pub emission: [f64; 3],
}

impl Flame {
    /// The emission coefficient as one number: the luminance of its RGB.
    pub fn grey(&self) -> f64 {
        luminance(self.emission)
    }

    /// The power of all its light, W.
    pub fn power(&self) -> f64 {
        4.0 * PI * self.grey() * self.shape.volume()
    }

    /// The same with another colour.
    #[must_use]
    pub fn coloured(&self, of: impl Fn([f64; 3]) -> [f64; 3]) -> Flame {
        Flame { emission: of(self.emission), ..self.clone() }
    }

    /// A region that takes as much of a channel's light (0 red, 1 green, 2 blue) as this gives: what its emission adds up to along a ray is
    /// that region's optical depth.
    pub(crate) fn as_region(&self, channel: usize) -> Region {
        let medium = Medium::grey(0.0, self.emission[channel], 0.0);
        Region { name: self.name.clone(), shape: self.shape.clone(), medium, photons: None }
    }
}
