//! What air sends toward the camera besides sunlight that scattered once: light of clouds, of the ground, of the sky, of other air. It is
//! smooth, so it is followed by paths from few places in the camera's view, and looked up between them.

use super::field::{Found, Groups, grey};
use crate::error::Result;
use crate::geom::Ray;
use crate::integrate::lens::Lens;
use crate::integrate::path::PathTracer;
use crate::media::Scratch;
use crate::photon::GROUPS;
use crate::progress::{Progress, share};
use crate::rng::{Rng, Stage};
use crate::sampling::around;
use crate::scene::air::MOST_LAYERS;
use glam::{UVec3, Vec3};

/// Places along the picture's longer side, and along each ray; their distances grow by a factor.
const ACROSS: f32 = 28.0;
const ALONG: u32 = 20;
/// The nearest, over the scene's size, and the farthest, in mean free paths and over the scene's size.
const NEAREST: f32 = 0.02;
const FARTHEST: (f64, [f32; 2]) = (4.0, [1.0, 200.0]);
/// Photons for which one path is followed.
const PHOTONS_A_PATH: u64 = 4;

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
    /// Paths of each group, place and layer.
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
    /// Places for a camera and a scene of some size, which are dark yet.
    pub(super) fn new(tracer: &PathTracer, lens: Lens, [width, height]: [u32; 2], size: f32, seed: u64) -> Self {
        let pixels = [width as f32, height as f32];
        let apart = pixels[0].max(pixels[1]) / ACROSS;
        let count = |pixels: f32| (pixels / apart).ceil().max(1.0) as u32 + 1;
        let air = &tracer.bands[0].air;
        let densest: f64 = air.layers().iter().map(|layer| layer.sigma_t().max_element()).sum();
        let farthest = ((FARTHEST.0 / densest) as f32).clamp(size * FARTHEST.1[0], size * FARTHEST.1[1]);
        let nearest = (size * NEAREST).min(farthest * 0.5);
        let size = UVec3::new(count(pixels[0]), count(pixels[1]), ALONG);
        let step = (farthest / nearest).ln() / (ALONG - 1) as f32;
        Glow { lens, pixels, size, nearest, step, seed, paths: 0, light: Vec::new() }
    }

    /// Follows as many paths as so many photons are worth.
    ///
    /// # Errors
    /// [`crate::Error::Interrupted`].
    pub(super) fn brighten(&mut self, tracer: &PathTracer, photons: u64, progress: &dyn Progress) -> Result<()> {
        let places = self.size.element_product();
        self.paths = (photons / (PHOTONS_A_PATH * u64::from(places) * GROUPS as u64)).max(1);
        progress.begin("air", places.into());
        let one = |place: u64| {
            let mut rng = Rng::new(self.seed, Stage::Air, place);
            if progress.cancelled() { None } else { self.follow(tracer, place as u32, &mut rng, &mut Scratch::default()) }
        };
        self.light = share(0..u64::from(places), one, progress, |done| progress.at(done))?;
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
        for (layer, sums) in band.air.layers().iter().zip(&mut out) {
            for sum in &mut sums.groups {
                for _ in 0..self.paths {
                    let (cos, sin) = layer.scattering.sample(rng.uniform());
                    let direction = around(view.direction, cos as f32, sin as f32, rng.uniform_f32());
                    let ray = Ray { origin: view.at(distance), direction };
                    let light: Vec3 = tracer.radiance(band, ray, f32::INFINITY, rng, scratch).light.iter().sum();
                    *sum += grey(light);
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
