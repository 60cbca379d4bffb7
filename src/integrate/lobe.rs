//! A phase function toward one direction, for very many photons.

use glam::Vec3;
use std::f64::consts::PI;

/// The Henyey-Greenstein function around one direction, in single precision: [`crate::scene::phase::henyey_greenstein`].
#[derive(Debug, Clone, Copy)]
pub(in crate::integrate) struct Lobe {
    axis: Vec3,
    mirrored: bool,
    base: f32,
    slope: f32,
    norm: f32,
}

impl Lobe {
    /// For light scattered into `outward`.
    pub(in crate::integrate) fn new(g: f64, outward: Vec3) -> Self {
        // Mirrored for negative g: then nothing cancels.
        let a = g.abs();
        let norm = (1.0 - a) * (1.0 + a) / (4.0 * PI);
        Lobe { axis: outward, mirrored: g < 0.0, base: ((1.0 - a) * (1.0 - a)) as f32, slope: a as f32, norm: norm as f32 }.toward(outward)
    }

    /// The same around another direction.
    #[inline]
    pub(in crate::integrate) fn toward(self, outward: Vec3) -> Self {
        Lobe { axis: outward * if self.mirrored { -1.0 } else { 1.0 }, ..self }
    }

    /// The largest value there is, in 1/sr.
    pub(in crate::integrate) fn peak(&self) -> f32 {
        self.norm / (self.base * self.base.sqrt())
    }

    /// Of light that came in along `inward`, in 1/sr.
    #[inline]
    pub(in crate::integrate) fn value(&self, inward: Vec3) -> f32 {
        // 2 (1 - cos) is the squared distance of the two.
        let base = self.base + self.slope * (inward - self.axis).length_squared();
        self.norm / (base * base.sqrt())
    }
}
