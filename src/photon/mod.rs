//! Pass 1 of the thesis (3.3.1): photons leave the sun, scatter in the regions and off surfaces, and are stored.

mod aim;
mod air;
mod colour;
pub mod emit;
mod eye;
mod flame;
mod lamp;
pub mod map;
pub mod nearest;
mod rules;
mod similar;
mod sky;
pub mod trace;
mod witness;

pub use colour::Colour;
pub use map::{PhotonMap, PhotonTree};
pub use nearest::{Nearest, Neighbourhood};
pub use similar::SimilarMedia;
pub use trace::{Shot, Tracer};
pub use witness::Witness;

use crate::bvh::Box3;
use glam::Vec3;

/// Which reading of the thesis is followed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Model {
    /// The corrected one: energy is conserved, every stored collision weighs the albedo.
    #[default]
    Physical,
    /// The text to the letter: eq. 17 with ln 0, eq. 19, eq. 25's attenuation, absorbed photons stored at full power.
    Hura2006,
}

/// A stored photon: 24 bytes.
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Photon {
    /// Position relative to the map's origin, m.
    pub position: [f32; 3],
    /// Direction of travel before the collision, packed by [`pack_direction`].
    pub direction: u32,
    /// Power in W, times the albedo in the physical model.
    pub power: f32,
    /// The region that it collided in, and above it the group of its path.
    home: u32,
}

/// Paths are dealt into so many groups: what the groups' sums differ by is the noise of all their photons together,
/// however alike those of one path are.
pub const GROUPS: usize = 16;

/// Bits of [`Photon::home`] that are the region's.
const REGION_BITS: u32 = 28;

impl Photon {
    /// A photon at `position` (relative to the map's origin, m) that travels in `direction` (unit length) with `power` in W,
    /// collides in `region` (of fewer than 2^28) and belongs to path number `path`.
    #[inline]
    pub fn new(position: Vec3, direction: Vec3, power: f32, region: u32, path: usize) -> Self {
        let home = region | ((path % GROUPS) as u32) << REGION_BITS;
        Photon { position: position.to_array(), direction: pack_direction(direction), power, home }
    }

    /// The region that it collided in.
    #[inline]
    pub fn region(&self) -> u32 {
        self.home & ((1 << REGION_BITS) - 1)
    }

    /// The group of its path, below [`GROUPS`].
    #[inline]
    pub fn group(&self) -> usize {
        (self.home >> REGION_BITS) as usize
    }

    /// Whether its position can stand in a tree.
    pub fn is_finite(&self) -> bool {
        self.position.iter().all(|x| x.is_finite())
    }
}

/// The box of photons' positions; turned inside out where there are none.
pub(crate) fn bounds(photons: &[Photon]) -> Box3 {
    let nothing = Box3 { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };
    photons.iter().map(|p| Vec3::from_array(p.position)).fold(nothing, |b, p| Box3 { min: b.min.min(p), max: b.max.max(p) })
}

/// Packs a unit vector into 2 x 16 bits on the octahedron; the error stays below 1e-4 rad.
pub fn pack_direction(d: Vec3) -> u32 {
    let d = d / (d.x.abs() + d.y.abs() + d.z.abs());
    let fold = |a: f32, b: f32| if d.z >= 0.0 { a } else { (1.0 - b.abs()) * 1f32.copysign(a) };
    // Rounds by truncating above zero: `round` is a function call on plain x86-64.
    let quantise = |x: f32| (((x + 1.0) * 32767.0 + 0.5) as i32 - 32767) as u32 & 0xffff;
    quantise(fold(d.x, d.y)) | quantise(fold(d.y, d.x)) << 16
}

/// Undoes [`pack_direction`].
pub fn unpack_direction(bits: u32) -> Vec3 {
    let part = |x: u32| (x as u16 as i16) as f32 / 32767.0;
    let (x, y) = (part(bits), part(bits >> 16));
    let z = 1.0 - x.abs() - y.abs();
    let t = (-z).max(0.0);
    Vec3::new(x - t.copysign(x), y - t.copysign(y), z).normalize()
}

#[cfg(test)]
mod tests;
