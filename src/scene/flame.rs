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

    /// The channels (0 red, 1 green, 2 blue) that tell of flames all there is, each with the colour that its number stands for: the
    /// strongest where all have one colour, whose strongest channel is then 1; else all three.
    pub(crate) fn channels(flames: &[Flame]) -> Vec<(usize, [f64; 3])> {
        let Some(first) = flames.first() else { return Vec::new() };
        let strongest = |rgb: [f64; 3]| (0..3).fold(0, |most, c| if rgb[c] > rgb[most] { c } else { most });
        let main = strongest(first.emission);
        let hue = first.emission.map(|c| c / first.emission[main].max(f64::MIN_POSITIVE));
        let alike = |rgb: [f64; 3]| (0..3).all(|c| (rgb[c] - hue[c] * rgb[main]).abs() <= 1e-9 * rgb[main]);
        if flames.iter().all(|flame| alike(flame.emission)) {
            vec![(main, hue)]
        } else {
            (0..3).map(|c| (c, std::array::from_fn(|i| if i == c { 1.0 } else { 0.0 }))).collect()
        }
    }

    /// A region that takes as much of a channel's light (0 red, 1 green, 2 blue) as this gives: what its emission adds up to along a ray is
    /// that region's optical depth.
    pub(crate) fn as_region(&self, channel: usize) -> Region {
        let medium = Medium::grey(0.0, self.emission[channel], 0.0);
        Region { name: self.name.clone(), shape: self.shape.clone(), medium, photons: None }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DAffine3, DVec3};

    #[test]
    fn one_channel_tells_of_one_colour_and_three_of_several() {
        let flame = |emission: [f64; 3]| {
            let world_from_unit = DAffine3::from_scale(DVec3::ONE);
            Flame { name: "f".into(), shape: Shape::Ellipsoid { world_from_unit }, emission }
        };
        assert!(Flame::channels(&[]).is_empty());
        assert_eq!(Flame::channels(&[flame([1.0, 4.0, 2.0]), flame([0.25, 1.0, 0.5])]), [(1, [0.25, 1.0, 0.5])]);
        let several = Flame::channels(&[flame([1.0, 4.0, 2.0]), flame([1.0, 4.0, 2.1])]);
        assert_eq!(several, [(0, [1.0, 0.0, 0.0]), (1, [0.0, 1.0, 0.0]), (2, [0.0, 0.0, 1.0])]);
    }
}
