//! The sun.

use glam::DVec3;

/// The sun: a uniform disc at infinity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sun {
    /// Unit vector in which its light travels (from the sun into the scene), world space.
    pub direction: DVec3,
    /// Irradiance on a plane perpendicular to `direction`, W m^-2, RGB.
    pub irradiance: [f64; 3],
    /// The angular diameter of the disc in radians; zero is a point at infinity.
    pub angular_diameter: f64,
}

/// The sun's mean angular diameter seen from the Earth, in radians.
pub const SUN_ANGLE: f64 = 0.00918;

impl Sun {
    /// Whether it gives any light.
    pub fn shines(&self) -> bool {
        self.irradiance.iter().any(|&e| e > 0.0)
    }

    /// The irradiance as one number: the luminance of its RGB.
    pub fn grey_irradiance(&self) -> f64 {
        super::medium::luminance(self.irradiance)
    }
}

impl Default for Sun {
    /// 45 degrees high in the south-west (-X, -Y), 1 W m^-2, the real sun's disc.
    fn default() -> Self {
        Sun { direction: DVec3::new(0.5, 0.5, -std::f64::consts::FRAC_1_SQRT_2), irradiance: [1.0; 3], angular_diameter: SUN_ANGLE }
    }
}
