//! What shines by itself, as rays see it.

use super::{Media, Profile, Scratch};
use crate::geom::Ray;
use crate::scene::{Region, Scene};
use glam::{DVec3, Vec3};

/// All flames of a scene, compiled: as media whose extinction is what they emit, W m^-3 sr^-1.
#[derive(Debug, Clone, Default)]
pub struct Fire {
    /// One where all have the same colour, which stands beside it; else a channel each.
    parts: Vec<(Media, Vec3)>,
}

impl Fire {
    /// The flames of a scene, relative to `origin`.
    pub fn new(scene: &Scene, origin: DVec3) -> Self {
        let Some(first) = scene.flames.first() else { return Fire::default() };
        let strongest = |rgb: [f64; 3]| (0..3).fold(0, |most, c| if rgb[c] > rgb[most] { c } else { most });
        let main = strongest(first.emission);
        let hue = DVec3::from_array(first.emission) / first.emission[main].max(f64::MIN_POSITIVE);
        let alike = |rgb: [f64; 3]| (DVec3::from_array(rgb) - hue * rgb[main]).abs().max_element() <= 1e-9 * rgb[main];
        let channel = |c: usize| {
            let regions: Vec<Region> = scene.flames.iter().filter(|f| f.emission[c] > 0.0).map(|f| f.as_region(c)).collect();
            Media::new(&regions, origin)
        };
        let parts = if scene.flames.iter().all(|f| alike(f.emission)) {
            vec![(channel(main), hue.as_vec3())]
        } else {
            (0..3).map(|c| (channel(c), Vec3::AXES[c])).collect()
        };
        Fire { parts }
    }

    /// Whether nothing shines.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.parts.is_empty()
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
            media.profile(ray, reach, f64::INFINITY, scratch, &mut profile);
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
            media.profile(ray, reach, f64::INFINITY, scratch, own);
            let mut sum = Vec3::ZERO;
            before.pass(own, |sent, at| sum += weight(at) * sent as f32);
            sum * *colour
        };
        self.parts.iter().map(one).sum()
    }
}
