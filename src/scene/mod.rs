//! What is in the scene: regions of participating media, Lambertian surfaces, the sun, a camera.
//!
//! Everything here is a description in world space: right-handed, Z up, metres, `f64`. The hot loops work on
//! [`Media`](crate::media::Media) and [`TriMesh`](crate::trimesh::TriMesh), compiled from it, recentred and in `f32`.

pub mod air;
pub mod black_body;
pub mod camera;
pub mod density;
pub mod dome;
pub mod effect;
pub mod flame;
pub mod lamp;
pub mod light;
pub mod medium;
pub mod mesh;
pub mod overrides;
pub mod phase;
pub mod region;
pub mod similar;
pub mod sky;
pub mod surface;
pub mod view;
pub mod voxels;

pub use air::Air;
pub use camera::Camera;
pub use density::BrickGrid;
pub use dome::Dome;
pub use effect::Wishes;
pub use flame::Flame;
pub use lamp::{Lamp, Spot};
pub use light::Sun;
pub use medium::Medium;
pub use mesh::Mesh;
pub use overrides::Overrides;
pub use phase::Phase;
pub use region::{Region, Shape};
pub use similar::Similar;
pub use sky::Sky;
pub use surface::Surface;
pub use view::{Framed, View};
pub use voxels::VoxelGrid;

use crate::geom::Bounds;
use glam::DVec3;
use medium::luminance;
use std::sync::Arc;

/// A whole scene in world space (Z up, metres).
#[derive(Debug, Clone, Default)]
pub struct Scene {
    /// The regions of participating media. Where they overlap, extinction adds.
    pub regions: Vec<Region>,
    /// The Lambertian surfaces.
    pub surfaces: Vec<Surface>,
    /// The only light of the thesis.
    pub sun: Sun,
    /// The lamps.
    pub lamps: Vec<Lamp>,
    /// What shines by itself, wherever it is.
    pub flames: Vec<Flame>,
    /// The sky's radiance, W m^-2 sr^-1, RGB: the same from all directions, or the mean of the dome.
    pub sky: [f64; 3],
    /// The sky's radiance by direction, where it is not the same from all.
    pub dome: Option<Arc<Dome>>,
    /// The air around regions and surfaces.
    pub air: Air,
    /// The camera, where the file has one.
    pub camera: Option<Camera>,
    /// What a user wishes of its effects.
    pub wishes: Wishes,
}

impl Scene {
    /// The name of a region that is a voxel grid, where there is one.
    pub fn voxel_grid(&self) -> Option<&str> {
        self.regions.iter().find(|region| matches!(region.shape, Shape::Grid(_))).map(|region| region.name.as_str())
    }

    /// The colours of the lights that are not the sky's, each with a luminance of 1: sun, lamps, flames.
    pub fn tints(&self) -> impl Iterator<Item = DVec3> {
        let near = self.lamps.iter().map(|lamp| lamp.intensity).chain(self.flames.iter().map(|flame| flame.emission));
        let all = std::iter::once(self.sun.irradiance).chain(near);
        all.filter(|&rgb| luminance(rgb) > 0.0).map(|rgb| DVec3::from_array(rgb) / luminance(rgb))
    }

    /// Whether anything but the sky gives light.
    pub fn is_lit(&self) -> bool {
        self.tints().next().is_some()
    }

    /// The bounds of all regions; empty without one.
    pub fn region_bounds(&self) -> Bounds {
        self.regions.iter().fold(Bounds::EMPTY, |all, region| all.union(region.shape.bounds()))
    }

    /// The bounds of everything that light can collide with in regions.
    pub fn region_support(&self) -> Bounds {
        let one = |region: &Region| if let Shape::Grid(grid) = &region.shape { grid.support() } else { region.shape.bounds() };
        self.regions.iter().fold(Bounds::EMPTY, |all, region| all.union(one(region)))
    }

    /// The mean of what regions have, by their optical mass; 0 without any.
    pub fn mean(&self, of: impl Fn(&Region) -> f64) -> f64 {
        self.regions.iter().map(|r| of(r) * r.optical_mass()).sum::<f64>() / self.optical_mass().max(f64::MIN_POSITIVE)
    }

    /// The optical mass of all regions, the integral of sigma_t over space, in m^2.
    pub fn optical_mass(&self) -> f64 {
        self.regions.iter().map(Region::optical_mass).sum()
    }
}
