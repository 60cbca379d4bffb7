//! The two readings of the thesis, where pass 1 depends on them.

use crate::rng::Rng;
use crate::scene::phase::{sample_eq19, sample_henyey_greenstein};

/// Where the two readings of the thesis differ in pass 1; chosen once a batch.
pub(super) trait Rules {
    /// The optical depth to the next collision.
    fn optical_depth(rng: &mut Rng) -> f64;
    /// What is left of the power after flying that optical depth.
    fn attenuation(tau: f64) -> f64;
    /// The share of the power that is stored at a collision.
    fn stored(albedo: f64) -> f64;
    /// (cos, sin) of the scattering angle.
    fn scatter(g: f64, xi: f64) -> (f64, f64);
}

/// Energy is conserved.
pub(super) struct Physical;

impl Rules for Physical {
    #[inline]
    fn optical_depth(rng: &mut Rng) -> f64 {
        rng.optical_depth()
    }
    #[inline]
    fn attenuation(_: f64) -> f64 {
        1.0
    }
    #[inline]
    fn stored(albedo: f64) -> f64 {
        albedo
    }
    #[inline]
    fn scatter(g: f64, xi: f64) -> (f64, f64) {
        sample_henyey_greenstein(g, xi)
    }
}

/// The text to the letter.
pub(super) struct Hura2006;

impl Rules for Hura2006 {
    fn optical_depth(rng: &mut Rng) -> f64 {
        // Eq. 17 as printed: infinite at xi = 0, so that the photon leaves.
        -rng.uniform().ln()
    }
    fn attenuation(tau: f64) -> f64 {
        (-tau).exp()
    }
    fn stored(_: f64) -> f64 {
        1.0
    }
    fn scatter(g: f64, xi: f64) -> (f64, f64) {
        sample_eq19(g, xi)
    }
}
