//! A phase function toward one direction, for very many photons.

use crate::scene::Phase;
use glam::Vec3;
use std::f64::consts::PI;

/// A phase function around one direction, in single precision: [`Phase::value`].
#[derive(Debug, Clone, Copy)]
pub(in crate::integrate) struct Lobe {
    axis: Vec3,
    mirrored: bool,
    base: f32,
    slope: f32,
    norm: f32,
    /// What is the same everywhere.
    even: f32,
}

impl Lobe {
    /// The Henyey-Greenstein function of a mean cosine, for light scattered into `outward`.
    pub(in crate::integrate) fn new(g: f64, outward: Vec3) -> Self {
        Lobe::of(Phase::henyey_greenstein(g), outward)
    }

    /// For light scattered into `outward`.
    #[inline]
    pub(in crate::integrate) fn of(Phase { g, part }: Phase, outward: Vec3) -> Self {
        // Mirrored for negative g: then nothing cancels.
        let a = g.abs();
        let norm = part * (1.0 - a) * (1.0 + a) / (4.0 * PI);
        let (base, even) = (((1.0 - a) * (1.0 - a)) as f32, ((1.0 - part) / (4.0 * PI)) as f32);
        Lobe { axis: outward, mirrored: g < 0.0, base, slope: a as f32, norm: norm as f32, even }.toward(outward)
    }

    /// The same around another direction.
    #[inline]
    pub(in crate::integrate) fn toward(self, outward: Vec3) -> Self {
        Lobe { axis: outward * if self.mirrored { -1.0 } else { 1.0 }, ..self }
    }

    /// The largest value there is, in 1/sr.
    pub(in crate::integrate) fn peak(&self) -> f32 {
        self.norm / (self.base * self.base.sqrt()) + self.even
    }

    /// The same, times so much.
    pub(in crate::integrate) fn times(self, factor: f64) -> Self {
        Lobe { norm: self.norm * factor as f32, even: self.even * factor as f32, ..self }
    }

    /// Of light that came in along `inward`, in 1/sr.
    #[inline]
    pub(in crate::integrate) fn value(&self, inward: Vec3) -> f32 {
        // 2 (1 - cos) is the squared distance of the two.
        let base = self.base + self.slope * (inward - self.axis).length_squared();
        self.norm / (base * base.sqrt()) + self.even
    }
}
