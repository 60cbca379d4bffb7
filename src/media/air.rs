//! Air as rays see it: free flights and transmittance in closed form, layer by layer.

use crate::geom::Ray;
use crate::rng::Rng;
use crate::scene::Air;
use crate::scene::air::{AirLayer, Scattering};
use glam::{DVec3, Vec3};
use smallvec::SmallVec;

/// A layer, compiled for some of the channels.
#[derive(Debug, Clone, Copy)]
pub struct Layer {
    /// Extinction at the base, 1/m.
    sigma_t: f64,
    /// Single-scattering albedo by channel.
    pub albedo: Vec3,
    /// The phase function.
    pub scattering: Scattering,
    base: f64,
    top: f64,
    /// 1 over the scale height; 0 where it is even.
    thinning: f64,
}

/// The air of a scene, for channels with the same extinction; in the local space of the hot loops.
#[derive(Debug, Clone, Default)]
pub struct Atmosphere {
    layers: SmallVec<[Layer; 2]>,
}

/// What of a ray lies in a layer.
#[derive(Debug, Clone, Copy)]
struct Stretch {
    enter: f64,
    length: f64,
    /// Extinction at the lower end, 1/m.
    lowest: f64,
    /// By how much the logarithm of extinction falls per metre of the ray.
    fall: f64,
}

impl Stretch {
    /// The optical depth of its first `length` metres.
    fn depth(&self, length: f64) -> f64 {
        if self.fall == 0.0 {
            return self.lowest * length;
        }
        // From the lower end, where extinction is largest: nothing cancels and nothing overflows.
        let below = if self.fall < 0.0 { (self.fall * (self.length - length)).exp() } else { 1.0 };
        let x = self.fall.abs() * length;
        let mean = if x > 1e-9 { -(-x).exp_m1() / x } else { 1.0 - 0.5 * x };
        self.lowest * below * mean * length
    }

    /// The distance from its beginning at which the optical depth is `tau`; beyond its length where it is thinner.
    fn distance(&self, tau: f64) -> f64 {
        if self.fall == 0.0 || self.fall.abs() * self.length < 1e-9 {
            return tau / self.lowest;
        }
        let first = if self.fall < 0.0 { self.lowest * (self.fall * self.length).exp() } else { self.lowest };
        // 1 - e^(-fall s) = tau fall / first; below 0 the exponential grows.
        let share = tau * self.fall / first;
        if share >= 1.0 { f64::INFINITY } else { -(-share).ln_1p() / self.fall }
    }
}

impl Layer {
    fn new(layer: &AirLayer, origin: DVec3) -> Self {
        let (sigma_t, sigma_s) = (DVec3::from_array(layer.sigma_t()), DVec3::from_array(layer.sigma_s));
        let albedo = DVec3::select(sigma_t.cmpgt(DVec3::ZERO), sigma_s / sigma_t, DVec3::ZERO).as_vec3();
        Layer {
            sigma_t: sigma_t.max_element(),
            albedo,
            scattering: layer.scattering,
            base: layer.base - origin.z,
            top: layer.top - origin.z,
            thinning: layer.scale_height.map_or(0.0, |h| 1.0 / h),
        }
    }

    fn stretch(&self, ray: &Ray, reach: f64) -> Option<Stretch> {
        let (z, slope) = (f64::from(ray.origin.z), f64::from(ray.direction.z));
        let (near, far) = if slope == 0.0 {
            if z < self.base || z > self.top {
                return None;
            }
            (0.0, f64::INFINITY)
        } else {
            let (a, b) = ((self.base - z) / slope, (self.top - z) / slope);
            (a.min(b), a.max(b))
        };
        let (enter, exit) = (near.max(0.0), far.min(reach));
        if enter >= exit {
            return None;
        }
        let lower = if slope < 0.0 && exit.is_finite() { z + slope * exit } else { z + slope * enter };
        let lowest = self.sigma_t * (-(lower - self.base).max(0.0) * self.thinning).exp();
        (lowest > 0.0).then_some(Stretch { enter, length: exit - enter, lowest, fall: slope * self.thinning })
    }

    /// The optical depth of a ray's first `reach` metres.
    pub fn optical_depth(&self, ray: &Ray, reach: f32) -> f64 {
        self.stretch(ray, reach.into()).map_or(0.0, |s| s.depth(s.length))
    }

    /// The distance along a ray at which its optical depth is `tau`; `None` where that is not within its first `reach` metres.
    pub fn distance(&self, ray: &Ray, reach: f32, tau: f64) -> Option<f32> {
        let stretch = self.stretch(ray, reach.into())?;
        let along = stretch.distance(tau);
        (along < stretch.length).then_some((stretch.enter + along) as f32)
    }

    /// Extinction where it is largest, 1/m.
    pub fn densest(&self) -> f64 {
        self.sigma_t
    }

    /// Extinction at a point, 1/m.
    pub fn extinction(&self, p: Vec3) -> f64 {
        self.extinction_at(p.z.into())
    }

    fn extinction_at(&self, z: f64) -> f64 {
        if z < self.base || z > self.top { 0.0 } else { self.sigma_t * (-(z - self.base) * self.thinning).exp() }
    }
}

impl Atmosphere {
    /// Compiles air whose extinction is the same in all channels, relative to `origin` (world space).
    pub fn new(air: &Air, origin: DVec3) -> Self {
        Atmosphere { layers: air.layers().map(|layer| Layer::new(layer, origin)).filter(|layer| layer.sigma_t > 0.0).collect() }
    }

    /// Whether there is none.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.layers.is_empty()
    }

    /// Its layers.
    pub fn layers(&self) -> &[Layer] {
        &self.layers
    }

    /// Flies along a ray, at most `reach` metres, to the first collision with air: the first of the layers' independent Poisson
    /// processes.
    #[inline]
    pub fn fly(&self, ray: &Ray, reach: f32, rng: &mut Rng) -> Option<(f32, &Layer)> {
        let mut first = None;
        let mut reach = reach;
        for layer in &self.layers {
            if let Some(distance) = layer.distance(ray, reach, rng.optical_depth()) {
                (first, reach) = (Some((distance, layer)), distance);
            }
        }
        first
    }

    /// The transmittance of a ray's first `reach` metres.
    #[inline]
    pub fn transmittance(&self, ray: &Ray, reach: f32) -> f64 {
        if self.layers.is_empty() { 1.0 } else { (-self.optical_depth(ray, reach)).exp() }
    }

    /// The optical depth of a ray's first `reach` metres.
    pub fn optical_depth(&self, ray: &Ray, reach: f32) -> f64 {
        self.layers.iter().fold(0.0, |sum, layer| sum + layer.optical_depth(ray, reach))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Stage;

    fn air() -> Atmosphere {
        let grey = Air::clear(-50.0, Some(5000.0)).coloured(|rgb| [rgb[1]; 3]);
        let even = AirLayer {
            sigma_s: [3e-4; 3],
            sigma_a: [1e-4; 3],
            scattering: Scattering::HenyeyGreenstein(0.3),
            base: 100.0,
            top: 700.0,
            scale_height: None,
        };
        Atmosphere::new(&Air::new(grey.layers().copied().chain([even])), DVec3::new(0.0, 0.0, 20.0))
    }

    fn rays() -> impl Iterator<Item = Ray> {
        let mut rng = Rng::new(1, Stage::Render, 0);
        let slopes = [1.0f32, -1.0, 0.3, -0.3, 1e-3, -1e-3, 1e-7, -1e-7, 0.0];
        let heights = [-69.9f32, 0.0, 80.0, 650.0, 3000.0, 20_000.0];
        slopes.into_iter().flat_map(move |z| heights.map(|h| (z, h))).map(move |(z, height)| {
            let direction = crate::sampling::around(Vec3::Z, z, (1.0 - z * z).max(0.0).sqrt(), rng.uniform_f32());
            Ray { origin: Vec3::new(rng.uniform_f32(), 0.0, height), direction }
        })
    }

    /// The slow, obvious twin: extinction summed in small steps.
    #[test]
    fn depths_are_the_integral_of_extinction() {
        let air = air();
        for ray in rays() {
            for reach in [1.0f32, 500.0, 20_000.0] {
                let steps = 40_000;
                let width = f64::from(reach) / f64::from(steps);
                let z = |i: i32| f64::from(ray.origin.z) + f64::from(ray.direction.z) * width * (f64::from(i) + 0.5);
                let slow: f64 = (0..steps).map(|i| air.layers.iter().map(|l| l.extinction_at(z(i))).sum::<f64>()).sum::<f64>() * width;
                let fast = air.optical_depth(&ray, reach);
                // The sum does not know where within a step a layer begins or ends.
                let ends: f64 = air.layers.iter().map(|l| l.sigma_t * width).sum();
                assert!((fast - slow).abs() <= 1e-5 * slow + ends, "{ray:?} over {reach} m: {fast}, not {slow}");
            }
        }
    }

    /// A flight ends where the optical depth is what it was to be; and depth grows on, finite wherever the ray leaves the layers.
    #[test]
    fn flights_spend_their_optical_depth() {
        let air = air();
        for ray in rays() {
            for layer in &air.layers {
                for tau in [1e-12, 1e-3, 0.1, 1.0, 3.0, 40.0] {
                    match layer.distance(&ray, f32::INFINITY, tau) {
                        Some(t) => {
                            let spent = layer.optical_depth(&ray, t);
                            // Distances are in single precision.
                            let rounding = layer.sigma_t * f64::from(t.next_up() - t);
                            assert!((spent - tau).abs() <= 1e-9 * tau + rounding, "{ray:?}: {spent}, not {tau}");
                        }
                        None => assert!(layer.optical_depth(&ray, f32::INFINITY) <= tau * 1.0001),
                    }
                }
                let whole = layer.optical_depth(&ray, f32::INFINITY);
                assert!(!whole.is_nan() && whole >= layer.optical_depth(&ray, 1000.0) * 0.999_999, "{ray:?}: {whole}");
            }
        }
    }
}
