//! What shines by itself, as rays see it.

use super::{Media, Profile, Scratch};
use crate::geom::{Bounds, Ray};
use crate::rng::Rng;
use crate::scene::medium::luminance;
use crate::scene::{Flame, Region, Scene};
use body::Body;
use glam::{DVec3, Vec3};

mod body;

/// Surfaces look at flames that are farther than this part of their size, and find what is nearer by chance.
const NEAR: f32 = 0.25;
/// What scatters looks at flames where it is outside so many times the ball around them all.
const OUTSIDE: f32 = 1.5;

/// All flames of a scene, compiled: as media whose extinction is what they emit, W m^-3 sr^-1.
#[derive(Debug, Clone, Default)]
pub struct Fire {
    /// One where all have the same colour, which stands beside it; else a channel each.
    parts: Vec<(Media, Vec3)>,
    bodies: Vec<Body>,
    /// Up to and with each body, W.
    powers: Vec<f64>,
    /// The ball around all, and how large they are, by their power, m.
    centre: Vec3,
    radius: f32,
    size: f32,
    origin: DVec3,
}

impl Fire {
    /// The flames of a scene, relative to `origin`.
    pub fn new(scene: &Scene, origin: DVec3) -> Self {
        if scene.flames.is_empty() {
            return Fire::default();
        }
        let channel = |c: usize| {
            let regions: Vec<Region> = scene.flames.iter().filter(|f| f.emission[c] > 0.0).map(|f| f.as_region(c)).collect();
            Media::new(&regions, origin)
        };
        let channels = Flame::channels(&scene.flames);
        let parts = channels.into_iter().map(|(c, colour)| (channel(c), DVec3::from_array(colour).as_vec3())).collect();
        let (mut bodies, mut powers, mut power, mut size) = (Vec::new(), Vec::new(), 0.0, 0.0);
        for flame in scene.flames.iter().filter(|flame| flame.power() > 0.0) {
            let Some(body) = Body::of(&flame.shape, origin) else { continue };
            power += flame.power();
            size += flame.power() * 0.5 * flame.shape.bounds().size().length();
            bodies.push(body);
            powers.push(power);
        }
        let bounds = scene.flames.iter().fold(Bounds::EMPTY, |all, flame| all.union(flame.shape.bounds()));
        let centre = (bounds.centre() - origin).as_vec3();
        let radius = 0.5 * bounds.size().length() as f32;
        Fire { parts, bodies, powers, centre, radius, size: (size / power.max(f64::MIN_POSITIVE)) as f32, origin }
    }

    /// What all of it sends out, W, as a luminance.
    pub fn power(&self) -> f64 {
        self.powers.last().copied().unwrap_or(0.0)
    }

    /// A point of it, drawn by what shines there as a luminance, and the colour of that, of luminance 1.
    pub fn sample(&self, rng: &mut Rng) -> (Vec3, Vec3) {
        let drawn = rng.uniform() * self.power();
        let number = self.powers.partition_point(|&sum| sum <= drawn).min(self.bodies.len() - 1);
        let p = (self.bodies[number].sample(rng, self.origin) - self.origin).as_vec3();
        // All bodies together are drawn by what they emit: so it does not matter which of them this point is of.
        let light = self.at(p);
        let grey = luminance(light.as_dvec3().to_array()) as f32;
        (p, if grey > 0.0 { light / grey } else { Vec3::ONE })
    }

    /// Within what distance a flight from a surface finds flames itself, m; those beyond are looked at.
    pub fn near_surface(&self) -> f32 {
        if self.is_empty() { f32::INFINITY } else { NEAR * self.size }
    }

    /// The same of a flight from where light scatters; without end where nothing shines.
    pub fn near(&self, p: Vec3) -> f32 {
        if !self.is_empty() && self.centre.distance(p) > OUTSIDE * self.radius { 0.0 } else { f32::INFINITY }
    }

    /// Whether nothing shines.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.bodies.is_empty()
    }

    /// The emission coefficient at a point, W m^-3 sr^-1.
    pub fn at(&self, p: Vec3) -> Vec3 {
        self.parts.iter().map(|(media, colour)| *colour * media.extinction(p) as f32).sum()
    }

    /// What the ray's first `reach` metres send to its origin where nothing takes any of it, W m^-2 sr^-1. Of a flight whose end is
    /// drawn by the extinction on the way it is an unbiased estimate of what arrives.
    pub fn along(&self, ray: &Ray, reach: f32, scratch: &mut Scratch) -> Vec3 {
        self.parts.iter().map(|(media, colour)| *colour * media.optical_depth(ray, reach, scratch) as f32).sum()
    }

    /// The same where what happens on the way has a weight, by channel, at each distance: it is taken at one point for each colour, drawn
    /// by `pick` in [0, 1) in proportion to what is sent from there.
    pub fn weighed(
        &self,
        ray: &Ray,
        reach: f32,
        mut pick: impl FnMut() -> f64,
        weight: impl Fn(f32) -> Vec3,
        scratch: &mut Scratch,
    ) -> Vec3 {
        let mut profile = Profile::default();
        let one = |(media, colour): &(Media, Vec3)| {
            media.profile(ray, reach, (f64::INFINITY, f64::INFINITY), scratch, &mut profile);
            let whole = profile.depth();
            if whole > 0.0 { *colour * weight(profile.distance(pick() * whole, &mut 0)) * whole as f32 } else { Vec3::ZERO }
        };
        self.parts.iter().map(one).sum()
    }

    /// What of that arrives past the extinction of `before`, and past what `weight` lets pass from each distance: exact but for the changes
    /// of emission and extinction within a voxel. `own` is room for it.
    pub fn seen(
        &self,
        ray: &Ray,
        reach: f32,
        before: &Profile,
        weight: impl Fn(f32) -> Vec3,
        scratch: &mut Scratch,
        own: &mut Profile,
    ) -> Vec3 {
        let one = |(media, colour): &(Media, Vec3)| {
            media.profile(ray, reach, (f64::INFINITY, f64::INFINITY), scratch, own);
            let mut sum = Vec3::ZERO;
            before.pass(own, |sent, at| sum += weight(at) * sent as f32);
            sum * *colour
        };
        self.parts.iter().map(one).sum()
    }
}
