//! What air sends toward the camera besides sunlight that scattered once: light of clouds, of the ground, of the sky, of other air. It is
//! smooth, so it is followed by paths from few places in the camera's view, and looked up between them. Each place is an unbiased estimate; what
//! light bends between places is a bias, which falls as photons, and places with them, grow.

use super::field::{Found, Groups, grey};
use crate::error::Result;
use crate::geom::Ray;
use crate::integrate::lens::{Lens, View};
use crate::integrate::path::PathTracer;
use crate::media::{Scratch, air::Layer};
use crate::photon::GROUPS;
use crate::progress::{Progress, share};
use crate::rng::{Rng, Stage};
use crate::sampling::around;
use crate::scene::air::MOST_LAYERS;
use glam::{UVec3, Vec3};

/// Places along the picture's longer side, for [`USUAL`] photons, and so many times as many along each ray: between them light is smooth, and
/// few places have many paths. With more photons there are more, by their eighth root. Along a ray, distances grow by a factor.
const PLACES: f64 = 10.0;
const ALONG: f64 = 1.6;
const USUAL: f64 = 50_000.0;
const MOST: f64 = 4.0;
/// Before the nearest and before the farthest are these shares of the collisions with air along the rays of a picture.
const ENDS: [f64; 2] = [0.01, 0.99];
/// Paths of each group and place at least; and photons for which one path is followed.
const LEAST_PATHS: u64 = 5;
const PHOTONS_A_PATH: u64 = 1;

/// Light at places in the camera's view.
#[derive(Debug)]
pub(super) struct Glow {
    lens: Lens,
    pixels: [f32; 2],
    size: UVec3,
    nearest: f32,
    /// By how much the logarithm of the distance grows from place to place.
    step: f32,
    seed: u64,
    /// Paths of each group and place that each layer draws.
    paths: u64,
    /// Of each place, by layers; none where surfaces hide it.
    light: Vec<Option<[Sums; MOST_LAYERS]>>,
}

/// Radiance as a sum over paths, W m^-2 sr^-1: its luminance by groups, and the channels of all.
#[derive(Debug, Clone, Copy, Default, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct Sums {
    groups: Groups,
    rgb: Vec3,
}

impl Glow {
    /// Places for a camera and so many photons; they are dark yet. `None` where the camera sees no air.
    pub(super) fn new(tracer: &PathTracer, lens: Lens, [width, height]: [u32; 2], photons: u64, seed: u64) -> Option<Self> {
        let pixels = [width as f32, height as f32];
        let places = PLACES * (photons as f64 / USUAL).powf(0.125).clamp(1.0, MOST);
        let apart = pixels[0].max(pixels[1]) / places as f32;
        let count = |pixels: f32| (pixels / apart).ceil().max(1.0) as u32 + 1;
        let across = [count(pixels[0]), count(pixels[1])];
        let views = (0..across[0] * across[1]).map(|place| {
            let at = [place % across[0], place / across[0]];
            let share = |i: usize| pixels[i] * at[i] as f32 / (across[i] - 1) as f32;
            lens.view(share(0), share(1))
        });
        let [nearest, farthest] = ends(tracer, views)?;
        let along = (ALONG * places).ceil() as u32;
        let size = UVec3::new(across[0], across[1], along);
        let step = (farthest / nearest).ln() / (along - 1) as f32;
        Some(Glow { lens, pixels, size, nearest, step, seed, paths: 0, light: Vec::new() })
    }

    /// Follows as many paths as so many photons are worth.
    ///
    /// # Errors
    /// [`crate::Error::Interrupted`].
    pub(super) fn brighten(&mut self, tracer: &PathTracer, photons: u64, progress: &dyn Progress) -> Result<()> {
        let places = self.size.element_product();
        let (places, layers) = (u64::from(places), tracer.bands[0].air.layers().len() as u64);
        let paths = (photons / (PHOTONS_A_PATH * places * GROUPS as u64)).max(LEAST_PATHS);
        self.paths = paths.div_ceil(layers.max(1));
        progress.begin("air", places);
        let one = |place: u64| {
            let mut rng = Rng::new(self.seed, Stage::Air, place);
            if progress.cancelled() { None } else { self.follow(tracer, place as u32, &mut rng, &mut Scratch::default()) }
        };
        self.light = share(0..places, one, progress, |done| progress.at(done))?;
        progress.check()
    }

    /// The light at one place, by layers and groups, of all its paths.
    fn follow(&self, tracer: &PathTracer, place: u32, rng: &mut Rng, scratch: &mut Scratch) -> Option<[Sums; MOST_LAYERS]> {
        let at = UVec3::new(place % self.size.x, place / self.size.x % self.size.y, place / (self.size.x * self.size.y));
        let share = |at: u32, size: u32| at as f32 / (size - 1) as f32;
        let view = self.lens.view(self.pixels[0] * share(at.x, self.size.x), self.pixels[1] * share(at.y, self.size.y)).ray;
        let distance = self.nearest * (self.step * at.z as f32).exp();
        if !tracer.surfaces.is_empty() && tracer.surfaces.nearest(&view, distance).is_some() {
            return None;
        }
        let band = &tracer.bands[0];
        let mut out = [Sums::default(); MOST_LAYERS];
        let layers = band.air.layers();
        let count = layers.len() as u64;
        for group in 0..GROUPS {
            for i in 0..self.paths * count {
                // Each layer draws as many directions as the others, evenly; what all find counts for each by the balance heuristic.
                let along = ((i / count) as f64 + rng.uniform()) / self.paths as f64;
                let (cos, sin) = layers[(i % count) as usize].scattering.sample(along);
                let direction = around(view.direction, cos as f32, sin as f32, rng.uniform_f32());
                let ray = Ray { origin: view.at(distance), direction };
                let light: Vec3 = tracer.radiance(band, ray, f32::INFINITY, rng, scratch).light.iter().sum();
                let sent = |layer: &Layer| layer.scattering.value(1.0 - cos);
                let all: f64 = layers.iter().map(sent).sum();
                for (layer, sums) in layers.iter().zip(&mut out) {
                    let light = light * (sent(layer) / all) as f32;
                    sums.groups[group] += grey(light);
                    sums.rgb += light;
                }
            }
        }
        Some(out)
    }

    /// Adds `share`, by channel, of the light that a layer sends back along a camera ray from a distance, per unit of optical depth and of
    /// albedo.
    pub(super) fn sent(&self, ray: &Ray, distance: f32, layer: usize, share: Vec3, into: &mut Found) {
        let [x, y] = self.lens.pixel(ray.direction);
        let z = (distance / self.nearest).max(1e-30).ln() / self.step;
        let last = (self.size - 1).as_vec3();
        let at = (Vec3::new(x / self.pixels[0], y / self.pixels[1], z / last.z) * last).clamp(Vec3::ZERO, last);
        let cell = at.floor().min((last - 1.0).max(Vec3::ZERO));
        let (f, cell) = (at - cell, cell.as_uvec3());
        let (mut whole, mut found) = (0.0, [(0.0, 0usize); 8]);
        for (i, found) in (0..8u32).zip(&mut found) {
            let bit = UVec3::new(i & 1, i >> 1 & 1, i >> 2 & 1);
            let weight = Vec3::select(bit.cmpeq(UVec3::ONE), f, 1.0 - f).element_product();
            let corner = (cell + bit).min(self.size - 1);
            let place = ((corner.z * self.size.y + corner.y) * self.size.x + corner.x) as usize;
            if self.light[place].is_some() {
                whole += weight;
                *found = (weight, place);
            }
        }
        if whole <= 0.0 {
            return;
        }
        let each = share / (whole * (self.paths * GROUPS as u64) as f32);
        let of_grey = grey(each);
        for (weight, place) in found.into_iter().filter(|f| f.0 > 0.0) {
            let Some(light) = self.light[place].map(|light| light[layer]) else { continue };
            into.groups.iter_mut().zip(light.groups).for_each(|(sum, light)| *sum += of_grey * weight * light);
            into.rgb += each * weight * light.rgb;
        }
    }
}

/// Between which distances camera rays meet air, but for a little before and behind; `None` where they meet none.
fn ends(tracer: &PathTracer, views: impl Iterator<Item = View>) -> Option<[f32; 2]> {
    let air = &tracer.bands[0].air;
    let reach = |view: &View| tracer.surfaces.nearest(&view.ray, view.reach).map_or(view.reach, |hit| hit.t);
    let rays: Vec<(Ray, f32)> = views.map(|view| (view.ray, reach(&view))).collect();
    let one = |ray: &Ray, distance: f32| -(-air.optical_depth(ray, distance).element_sum() / 3.0).exp_m1();
    let chance = |distance: f32| rays.iter().map(|(ray, reach)| one(ray, reach.min(distance))).sum::<f64>();
    let whole = chance(f32::INFINITY);
    let end = |share: f64| {
        // Powers of two of a metre; any distance is between them.
        let (mut low, mut high) = (-60.0f32, 60.0f32);
        for _ in 0..20 {
            let middle = 0.5 * (low + high);
            *(if chance(middle.exp2()) < share * whole { &mut low } else { &mut high }) = middle;
        }
        high.exp2()
    };
    (whole > 0.0).then(|| ENDS.map(end))
}
