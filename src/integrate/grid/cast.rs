//! What media send to the surfaces that the camera sees: clouds' light on the ground. It is smooth, but what comes from one direction is
//! not, as a cloud that the sun shines through is far brighter than the rest; so many directions are followed from few places in the
//! camera's view, and looked up between them (irradiance caching: Ward, Rubinstein, Clear 1988). Near what sends or hides light, and where
//! surfaces bend or end, nothing is looked up.

use super::field::{Found, Groups, grey};
use super::{Channel, Room};
use crate::error::Result;
use crate::integrate::lens::Lens;
use crate::photon::GROUPS;
use crate::progress::{Progress, share};
use crate::rng::{Rng, Stage};
use crate::trimesh::Hit;
use glam::{UVec2, Vec2, Vec3};

/// Places along the picture's longer side, at most one a pixel.
const ACROSS: f32 = 96.0;
/// Photons for which one direction is followed.
const PHOTONS_A_WAY: u64 = 1;
/// How far a place may be, over the harmonic mean of the distances from which its light comes; and off the plane of the surface, over the
/// distance; and the cosine of the angle between the normals.
const NEAR: f32 = 0.5;
const OFF_PLANE: f32 = 0.1;
const ALIKE: f32 = 0.98;
/// What a point may be off by rounding, over its coordinates.
const ROUNDING: f32 = 1e-5;
/// By how much light bends between places, over what it differs by and their distance over that of what sends it.
const BEND: f32 = 0.25;
/// The share of the weights of the places around that must be of use.
const ENOUGH: f32 = 0.5;

/// Light on surfaces at places in the camera's view.
#[derive(Debug)]
pub(super) struct Cast {
    lens: Lens,
    pixels: Vec2,
    size: UVec2,
    seed: u64,
    /// None where the camera sees no surface, or one that is black.
    places: Vec<Option<Place>>,
}

/// What a white surface sends out of the light of media, W m^-2 sr^-1: its luminance by groups, and all together by channel.
#[derive(Debug, Clone, Copy, Default, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct Place {
    groups: Groups,
    rgb: Vec3,
    doubt: f32,
    position: Vec3,
    normal: Vec3,
    /// One over the distance from which light comes or at which it is hidden, 1/m.
    nearness: f32,
}

impl Cast {
    /// Places for a picture, which are dark yet.
    pub(super) fn new(lens: Lens, [width, height]: [u32; 2], seed: u64) -> Self {
        let pixels = Vec2::new(width as f32, height as f32);
        let size = (pixels / (pixels.max_element() / ACROSS).max(1.0)).ceil().max(Vec2::ONE).as_uvec2() + 1;
        Cast { lens, pixels, size, seed, places: Vec::new() }
    }

    /// Follows as many directions as so many photons are worth, through a channel that is lit.
    ///
    /// # Errors
    /// [`crate::Error::Interrupted`].
    pub(super) fn brighten(&mut self, channel: &Channel, photons: u64, progress: &dyn Progress) -> Result<()> {
        let places = u64::from(self.size.element_product());
        let ways = (photons / (PHOTONS_A_WAY * places * GROUPS as u64)).max(1);
        progress.begin("surfaces", places);
        let one = |place: u64| if progress.cancelled() { None } else { self.follow(channel, place, ways) };
        self.places = share(0..places, one, progress, |done| progress.at(done))?;
        progress.check()
    }

    /// The light at one place, by so many directions of each group.
    fn follow(&self, channel: &Channel, number: u64, ways: u64) -> Option<Place> {
        let at = UVec2::new(number as u32 % self.size.x, number as u32 / self.size.x).as_vec2() / (self.size - 1).as_vec2() * self.pixels;
        let view = self.lens.view(at.x, at.y);
        let hit = channel.tracer.surfaces.nearest(&view.ray, view.reach)?;
        if channel.tracer.albedos[hit.owner as usize] == Vec3::ZERO {
            return None;
        }
        let mut place = Place { position: hit.off(&view.ray), normal: hit.normal, ..Place::default() };
        let (mut rng, mut room) = (Rng::new(self.seed, Stage::Cast, number), Room::default());
        let each = 1.0 / (ways * GROUPS as u64) as f32;
        let (mut of_photons, mut whole, mut near) = (Groups::default(), 0.0, [0.0f32; 2]);
        for group in 0..GROUPS {
            for _ in 0..ways {
                let arrival = channel.cast_on(place.position, hit.normal, &mut rng, &mut room);
                let light: Vec3 = each * arrival.light.iter().sum::<Vec3>();
                place.groups[group] += grey(light);
                place.rgb += light;
                place.doubt += each * grey(arrival.doubt);
                of_photons.iter_mut().zip(arrival.groups).for_each(|(sum, group)| *sum += each * grey(group));
                let (far, chance) = (arrival.depth.0 as f32, arrival.depth.1 as f32);
                if far > 0.0 {
                    near = [near[0] + grey(light) * chance / far, near[1] + each * chance * chance / far];
                }
                whole += grey(light);
            }
        }
        // Groups of directions differ as directions do; to that comes what groups of photons differ by, in all directions alike.
        let mean = of_photons.iter().sum::<f32>() / GROUPS as f32;
        place.groups.iter_mut().zip(of_photons).for_each(|(sum, photons)| *sum += photons - mean);
        place.nearness = near[1].max(if whole > 0.0 { near[0] / whole } else { 0.0 });
        Some(place)
    }

    /// What a white surface sends out at a point, where the places around it tell.
    pub(super) fn on(&self, p: Vec3, hit: &Hit) -> Option<Found> {
        let last = (self.size - 1).as_vec2();
        let at = Vec2::from_array(self.lens.pixel(p - self.lens.position())) / self.pixels * last;
        if !(at.cmpge(Vec2::splat(-0.5)).all() && at.cmple(last + 0.5).all()) {
            return None;
        }
        let at = at.clamp(Vec2::ZERO, last);
        let cell = at.floor().min(last - 1.0);
        let (f, cell) = (at - cell, cell.as_uvec2());
        let (mut near, mut whole) = ([(0.0, None); 4], 0.0);
        for (i, near) in (0..).zip(&mut near) {
            let bit = UVec2::new(i & 1, i >> 1);
            let weight = Vec2::select(bit.cmpeq(UVec2::ONE), f, 1.0 - f).element_product();
            let corner = cell + bit;
            let place = self.places[(corner.y * self.size.x + corner.x) as usize].as_ref();
            if let Some(place) = place.filter(|place| weight > 0.0 && place.tells(p, hit)) {
                (*near, whole) = ((weight, Some(place)), whole + weight);
            }
        }
        if whole < ENOUGH {
            return None;
        }
        let near = || near.iter().filter_map(|&(weight, place)| Some((weight / whole, place?)));
        let mut found = Found::default();
        for (weight, place) in near() {
            found.groups.iter_mut().zip(place.groups).for_each(|(sum, light)| *sum += weight * light);
            found.rgb += weight * place.rgb;
            found.doubt += weight * place.doubt;
        }
        // What bends between places is less than what differs, by about the ratio of their distance to that of what sends the light.
        let light = grey(found.rgb);
        found.doubt += near().map(|(weight, place)| weight * BEND * place.far(p) * (grey(place.rgb) - light).abs()).sum::<f32>();
        Some(found)
    }
}

impl Place {
    /// The distance of a point, over that from which light comes.
    fn far(&self, p: Vec3) -> f32 {
        p.distance(self.position) * self.nearness
    }

    /// Whether light here is about that at a point of a surface.
    fn tells(&self, p: Vec3, hit: &Hit) -> bool {
        let way = p - self.position;
        let off = OFF_PLANE * way.length() + ROUNDING * p.abs().max_element();
        self.normal.dot(hit.normal) > ALIKE && self.far(p) < NEAR && way.dot(hit.normal).abs() <= off
    }
}
