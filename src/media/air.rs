//! Air as rays see it: free flights and transmittance in closed form, layer by layer.

use crate::geom::Ray;
use crate::rng::Rng;
use crate::scene::Air;
use crate::scene::air::{AirLayer, Scattering};
use glam::{DVec3, Vec3};
use smallvec::SmallVec;

/// A layer, compiled.
#[derive(Debug, Clone, Copy)]
pub struct Layer {
    /// Extinction at the base by channel, 1/m.
    sigma_t: DVec3,
    /// Single-scattering albedo by channel.
    pub albedo: Vec3,
    /// The phase function.
    pub scattering: Scattering,
    base: f64,
    top: f64,
    /// 1 over the scale height; 0 where it is even.
    thinning: f64,
}

/// The air of a scene, in the local space of the hot loops.
#[derive(Debug, Clone, Default)]
pub struct Atmosphere {
    layers: SmallVec<[Layer; 2]>,
    /// Whether the channels differ in extinction.
    coloured: bool,
}

/// A path's way through air of several colours. One channel draws all its flights, and what it brings in each channel counts by the
/// balance heuristic over the three that could have drawn them (hero wavelengths; Wilkie et al. 2014): the channels' noise is alike, and no
/// weight is above 3.
#[derive(Debug, Clone, Copy)]
pub struct Spectrum {
    /// The channel that draws.
    hero: usize,
    /// How likely each channel would have been to draw the flights so far, over the mean of the three.
    weight: Vec3,
}

impl Spectrum {
    /// A path's beginning: its channel is drawn, where they differ.
    #[inline]
    pub fn draw(air: &Atmosphere, rng: &mut Rng) -> Self {
        let hero = if air.coloured { ((rng.uniform_f32() * 3.0) as usize).min(2) } else { 0 };
        Spectrum { hero, weight: Vec3::ONE }
    }

    /// The channel that draws.
    #[inline]
    pub fn hero(&self) -> usize {
        self.hero
    }

    /// Takes note of a flight of `reach` metres along a ray that ended `within` a layer's collision or by something else; and gives the
    /// factor by channel that this puts on what the path brings.
    #[inline]
    pub fn flown(&mut self, air: &Atmosphere, ray: &Ray, reach: f32, within: Option<&Layer>) -> Vec3 {
        if !air.coloured {
            return Vec3::ONE;
        }
        let depth = air.optical_depth(ray, reach);
        let mut chance = (DVec3::splat(depth[self.hero]) - depth).map(f64::exp);
        if let Some(layer) = within {
            chance *= layer.sigma_t / layer.sigma_t[self.hero];
        }
        let weight = self.weight.as_dvec3() * chance;
        let weight = (weight * (3.0 / weight.element_sum())).as_vec3();
        let factor = Vec3::select(self.weight.cmpgt(Vec3::ZERO), weight / self.weight, Vec3::ZERO);
        self.weight = weight;
        factor
    }
}

/// What of a ray lies in a layer.
#[derive(Debug, Clone, Copy)]
struct Stretch {
    enter: f64,
    length: f64,
    /// The density at the lower end, over that at the base.
    lowest: f64,
    /// By how much the logarithm of the density falls per metre of the ray.
    fall: f64,
}

impl Stretch {
    /// How many metres at the base's density its first `length` metres are worth.
    fn column(&self, length: f64) -> f64 {
        if self.fall == 0.0 {
            return self.lowest * length;
        }
        // From the lower end, where the density is largest: nothing cancels and nothing overflows.
        let below = if self.fall < 0.0 { (self.fall * (self.length - length)).exp() } else { 1.0 };
        let x = self.fall.abs() * length;
        let mean = if x > 1e-9 { -(-x).exp_m1() / x } else { 1.0 - 0.5 * x };
        self.lowest * below * mean * length
    }

    /// The distance from its beginning that is worth so many metres at the base; beyond its length where all of it is worth less.
    fn distance(&self, column: f64) -> f64 {
        if self.fall == 0.0 || self.fall.abs() * self.length < 1e-9 {
            return column / self.lowest;
        }
        let first = if self.fall < 0.0 { self.lowest * (self.fall * self.length).exp() } else { self.lowest };
        // 1 - e^(-fall s) = column fall / first; below 0 the exponential grows.
        let share = column * self.fall / first;
        if share >= 1.0 { f64::INFINITY } else { -(-share).ln_1p() / self.fall }
    }
}

impl Layer {
    fn new(layer: &AirLayer, origin: DVec3) -> Self {
        let (sigma_t, sigma_s) = (DVec3::from_array(layer.sigma_t()), DVec3::from_array(layer.sigma_s));
        let albedo = DVec3::select(sigma_t.cmpgt(DVec3::ZERO), sigma_s / sigma_t, DVec3::ZERO).as_vec3();
        Layer {
            sigma_t,
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
        let lowest = (-(lower - self.base).max(0.0) * self.thinning).exp();
        (lowest > 0.0).then_some(Stretch { enter, length: exit - enter, lowest, fall: slope * self.thinning })
    }

    /// How many metres at its base's density a ray's first `reach` metres are worth: times [`Layer::sigma_t`] their optical depth.
    pub fn column(&self, ray: &Ray, reach: f32) -> f64 {
        self.stretch(ray, reach.into()).map_or(0.0, |s| s.column(s.length))
    }

    /// The optical depth of a ray's first `reach` metres, by channel.
    pub fn optical_depth(&self, ray: &Ray, reach: f32) -> DVec3 {
        let column = self.column(ray, reach);
        // A channel without extinction has none along an endless ray either.
        DVec3::select(self.sigma_t.cmpgt(DVec3::ZERO), self.sigma_t * column, DVec3::ZERO)
    }

    /// The distance along a ray whose [`Layer::column`] is `column`; `None` where that is not within its first `reach` metres.
    pub fn distance(&self, ray: &Ray, reach: f32, column: f64) -> Option<f32> {
        let stretch = self.stretch(ray, reach.into())?;
        let along = stretch.distance(column);
        (along < stretch.length).then_some((stretch.enter + along) as f32)
    }

    /// Extinction at the base, where it is largest, by channel, 1/m.
    pub fn sigma_t(&self) -> DVec3 {
        self.sigma_t
    }

    /// Extinction at a point, by channel, 1/m.
    pub fn extinction(&self, p: Vec3) -> DVec3 {
        self.sigma_t * self.density(p.z.into())
    }

    /// The density at a height, over that at the base.
    fn density(&self, z: f64) -> f64 {
        if z < self.base || z > self.top { 0.0 } else { (-(z - self.base) * self.thinning).exp() }
    }
}

impl Atmosphere {
    /// Compiles air, relative to `origin` (world space).
    pub fn new(air: &Air, origin: DVec3) -> Self {
        let layers: SmallVec<[Layer; 2]> =
            air.layers().map(|layer| Layer::new(layer, origin)).filter(|layer| layer.sigma_t.max_element() > 0.0).collect();
        let grey = |layer: &Layer| (layer.sigma_t - layer.sigma_t.x).abs().max_element() <= 1e-12 * layer.sigma_t.x;
        Atmosphere { coloured: !layers.iter().all(grey), layers }
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

    /// Flies along a ray, at most `reach` metres, to the first collision with air in the channel that draws: the first of the layers'
    /// independent Poisson processes.
    #[inline]
    pub fn fly(&self, ray: &Ray, reach: f32, spectrum: &Spectrum, rng: &mut Rng) -> Option<(f32, &Layer)> {
        let mut first = None;
        let mut reach = reach;
        for layer in &self.layers {
            if let Some(distance) = layer.distance(ray, reach, rng.optical_depth() / layer.sigma_t[spectrum.hero]) {
                (first, reach) = (Some((distance, layer)), distance);
            }
        }
        first
    }

    /// The transmittance of a ray's first `reach` metres, by channel.
    #[inline]
    pub fn transmittance(&self, ray: &Ray, reach: f32) -> Vec3 {
        if self.layers.is_empty() {
            return Vec3::ONE;
        }
        let depth = self.optical_depth(ray, reach);
        if self.coloured { depth.map(|d| (-d).exp()).as_vec3() } else { Vec3::splat((-depth.x).exp() as f32) }
    }

    /// The optical depth of a ray's first `reach` metres, by channel.
    pub fn optical_depth(&self, ray: &Ray, reach: f32) -> DVec3 {
        self.layers.iter().fold(DVec3::ZERO, |sum, layer| sum + layer.optical_depth(ray, reach))
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
                let sigma_t = |i: i32| air.layers.iter().map(|l| l.sigma_t.x * l.density(z(i))).sum::<f64>();
                let slow: f64 = (0..steps).map(sigma_t).sum::<f64>() * width;
                let fast = air.optical_depth(&ray, reach).x;
                // The sum does not know where within a step a layer begins or ends.
                let ends: f64 = air.layers.iter().map(|l| l.sigma_t.x * width).sum();
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
                    match layer.distance(&ray, f32::INFINITY, tau / layer.sigma_t.x) {
                        Some(t) => {
                            let spent = layer.optical_depth(&ray, t).x;
                            // Distances are in single precision.
                            let rounding = layer.sigma_t.x * f64::from(t.next_up() - t);
                            assert!((spent - tau).abs() <= 1e-9 * tau + rounding, "{ray:?}: {spent}, not {tau}");
                        }
                        None => assert!(layer.optical_depth(&ray, f32::INFINITY).x <= tau * 1.0001),
                    }
                }
                let whole = layer.optical_depth(&ray, f32::INFINITY).x;
                assert!(!whole.is_nan() && whole >= layer.optical_depth(&ray, 1000.0).x * 0.999_999, "{ray:?}: {whole}");
            }
        }
    }
}
