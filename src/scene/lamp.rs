//! Lamps: points and spots of a glTF file, as small discs that face whoever looks.

use super::medium::luminance;
use crate::rng::Rng;
use crate::sampling::around;
use glam::{DVec3, Vec3};
use std::f64::consts::PI;

/// The radius of a lamp about which nobody says one, m: Blender's.
pub const LAMP_RADIUS: f64 = 0.1;
/// The least width of a spot's edge, as a difference of cosines (KHR_lights_punctual).
const EDGE: f64 = 1e-3;
/// The least share of a spot's light that counts when one of several lamps is chosen.
const LEAST: f64 = 0.05;

/// A lamp. It is not seen itself and stands in no light's way. On every straight line that passes its centre within `radius` light starts
/// where the line is nearest to it: so into each direction goes `intensity`, as from a point, and close by light stays finite.
#[derive(Debug, Clone, PartialEq)]
pub struct Lamp {
    /// The node it came from.
    pub name: String,
    /// Its centre in the world, m.
    pub position: DVec3,
    /// m, above 0.
    pub radius: f64,
    /// Radiant intensity, W/sr, RGB; of a spot along its axis.
    pub intensity: [f64; 3],
    /// Of a spot.
    pub spot: Option<Spot>,
}

/// Where a spot shines.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spot {
    /// The axis of its light, unit length.
    pub axis: DVec3,
    /// The cosines of the angles from the axis within which it has its full intensity, and beyond which it has none.
    pub cosines: [f64; 2],
}

/// A straight way to a point of a lamp.
#[derive(Debug, Clone, Copy)]
pub struct Look {
    /// Toward the lamp, unit length.
    pub toward: Vec3,
    /// How far it is, m.
    pub distance: f32,
    /// What arrives that way where nothing is between, over the density with which it was drawn, W m^-2, RGB.
    pub light: Vec3,
}

impl Spot {
    /// The share of the intensity that goes at an angle with that cosine from the axis (KHR_lights_punctual's own falloff).
    fn share(&self, cos: f64) -> f64 {
        let [inner, outer] = self.cosines;
        ((cos - outer) / (inner - outer).max(EDGE)).clamp(0.0, 1.0).powi(2)
    }
}

impl Lamp {
    /// The lamps of a scene, relative to `origin`.
    pub fn all_from(lamps: &[Lamp], origin: DVec3) -> Vec<Lamp> {
        lamps.iter().map(|lamp| Lamp { position: lamp.position - origin, ..lamp.clone() }).collect()
    }

    /// The same in another colour.
    pub fn coloured(&self, of: impl Fn([f64; 3]) -> [f64; 3]) -> Lamp {
        Lamp { intensity: of(self.intensity), ..self.clone() }
    }

    /// The intensity along the axis as one number, W/sr.
    pub fn grey(&self) -> f64 {
        luminance(self.intensity)
    }

    /// The share of the intensity that goes into a direction.
    pub fn share(&self, direction: Vec3) -> f64 {
        self.spot.map_or(1.0, |spot| spot.share(direction.as_dvec3().dot(spot.axis)))
    }

    /// About what it sends to `p`, W m^-2; 0 only where it sends nothing at all.
    fn estimate(&self, p: Vec3) -> f64 {
        let away = p.as_dvec3() - self.position;
        let (far, near) = (away.length(), self.radius);
        let share = self.spot.map_or(1.0, |spot| {
            let wide = if far > near { spot.cosines[1].clamp(-1.0, 1.0).acos() + (near / far).asin() } else { PI };
            let cos = away.dot(spot.axis) / far.max(f64::MIN_POSITIVE);
            // Rounding must not take light away.
            if wide < PI && cos < wide.cos() - 1e-6 { 0.0 } else { spot.share(cos).max(LEAST) }
        });
        self.grey() * share / far.max(near).powi(2)
    }

    /// A look at one of some lamps from `p`: one is chosen by what it may send there, and a point of it evenly by solid angle. `None` where
    /// none sends anything.
    pub fn look(lamps: &[Lamp], p: Vec3, rng: &mut Rng) -> Option<Look> {
        let whole: f64 = lamps.iter().map(|lamp| lamp.estimate(p)).sum();
        if whole <= 0.0 {
            return None;
        }
        let mut left = if lamps.len() > 1 { rng.uniform() * whole } else { 0.0 };
        let chosen = lamps.iter().map(|lamp| (lamp, lamp.estimate(p))).filter(|(_, estimate)| *estimate > 0.0).find(|(_, estimate)| {
            left -= estimate;
            left < 0.0
        });
        let (lamp, estimate) = chosen?;
        let look = lamp.look_from(p, rng);
        Some(Look { light: look.light * (whole / estimate) as f32, ..look })
    }

    /// A look at a point of it, drawn evenly over the cone that it fills: at most over the half of all directions in which it lies.
    fn look_from(&self, p: Vec3, rng: &mut Rng) -> Look {
        let way = self.position - p.as_dvec3();
        let (d2, r2) = (way.length_squared(), self.radius.powi(2));
        let cos_alpha = (1.0 - r2 / d2).max(0.0).sqrt();
        // 1 - cos, small or not.
        let wide = if d2 > r2 { r2 / d2 / (1.0 + cos_alpha) } else { 1.0 };
        let away = rng.uniform() * wide;
        let axis = way.as_vec3().try_normalize().unwrap_or(Vec3::Z);
        let toward = around(axis, (1.0 - away) as f32, (away * (2.0 - away)).max(0.0).sqrt() as f32, rng.uniform_f32());
        // Radiance is intensity over the disc's area; over the density of directions, 1 / (2 pi wide).
        let scale = 2.0 * wide / r2 * self.share(-toward);
        let distance = way.dot(toward.as_dvec3()).max(0.0) as f32;
        Look { toward, distance, light: (DVec3::from_array(self.intensity) * scale).as_vec3() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Stage;
    use crate::stats::Estimate;

    fn lamp(position: DVec3, radius: f64, spot: Option<Spot>) -> Lamp {
        Lamp { name: "lamp".into(), position, radius, intensity: [3.0, 2.0, 1.0], spot }
    }

    fn fluence(lamps: &[Lamp], p: Vec3) -> Estimate {
        let mut rng = Rng::new(1, Stage::Render, 5);
        let n = 40_000;
        let (mut sum, mut squares) = (0.0, 0.0);
        for _ in 0..n {
            let light = Lamp::look(lamps, p, &mut rng).map_or(0.0, |look| f64::from(look.light.y));
            (sum, squares) = (sum + light, squares + light * light);
        }
        let mean = sum / f64::from(n);
        Estimate { value: mean, se: ((squares / f64::from(n) - mean * mean).max(0.0) / f64::from(n)).sqrt() }
    }

    #[test]
    fn from_afar_it_is_a_point_and_close_by_light_stays_finite() {
        let one = [lamp(DVec3::new(1.0, 2.0, 3.0), 0.1, None)];
        let at = |away: f64| fluence(&one, (DVec3::new(1.0, 2.0, 3.0) + DVec3::new(0.6, 0.0, 0.8) * away).as_vec3()).value;
        for away in [1.0f64, 10.0, 1000.0] {
            // Fluence of a disc that faces the point: 2 L (pi) (1 - cos), whose series begins with I / d^2.
            let exact = 2.0 * 2.0 / 0.01 * (1.0 - (1.0 - (0.1 / away).powi(2)).sqrt());
            assert!((at(away) / exact - 1.0).abs() < 1e-3, "{away}");
        }
        assert!((at(1000.0) * 1e6 / 2.0 - 1.0).abs() < 1e-3);
        assert!((at(0.05) / 400.0 - 1.0).abs() < 1e-5 && (at(0.1001) / at(0.0999) - 1.0).abs() < 0.1);
    }

    #[test]
    fn one_of_several_is_chosen_without_bias() {
        let spot = Some(Spot { axis: DVec3::NEG_Z, cosines: [0.9, 0.7] });
        let all = [lamp(DVec3::ZERO, 0.3, None), lamp(DVec3::new(0.0, 0.0, 2.0), 0.1, spot), lamp(DVec3::new(4.0, 0.0, 1.0), 0.01, None)];
        for p in [Vec3::new(1.0, 0.5, 0.2), Vec3::new(0.1, 0.1, 0.1), Vec3::new(1.2, 0.0, 0.9), Vec3::new(1.9, 0.0, 0.3)] {
            let together = fluence(&all, p);
            let apart: Vec<Estimate> = all.iter().map(|one| fluence(std::slice::from_ref(one), p)).collect();
            let sum: f64 = apart.iter().map(|one| one.value).sum();
            let sigma = apart.iter().fold(together.se.powi(2), |sum, one| sum + one.se.powi(2)).sqrt();
            assert!((together.value - sum).abs() < 4.0 * sigma + 1e-4 * sum, "{p}: {} and {sum}, +- {sigma}", together.value);
        }
    }

    #[test]
    fn a_spot_falls_off_as_gltf_has_it() {
        let cosines = [0.3f64.cos(), 0.6f64.cos()];
        let one = lamp(DVec3::ZERO, 0.01, Some(Spot { axis: DVec3::X, cosines }));
        let at = |angle: f64| one.share(DVec3::new(angle.cos(), angle.sin(), 0.0).as_vec3());
        assert_eq!((at(0.0), at(0.29), at(0.61), at(3.0)), (1.0, 1.0, 0.0, 0.0));
        let half = (0.5 * (cosines[0] + cosines[1])).acos();
        assert!((at(half) - 0.25).abs() < 1e-5);
        assert!(fluence(&[one], Vec3::new(0.0, 5.0, 0.0)).value == 0.0);
    }
}
