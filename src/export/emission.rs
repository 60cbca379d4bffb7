//! What shines by itself, in voxels beside the density: a material in Blender adds it to what the medium does with other light.

use super::lattice::{Ready, merge};
use crate::error::Result;
use crate::progress::Progress;
use crate::scene::{BrickGrid, Flame, Region, Shape, VoxelGrid};
use crate::vdb::Meta;
use crate::voxelise::{Up, voxel_size, voxelise};
use glam::{DAffine3, DVec3};
use serde::Serialize;
use std::sync::Arc;

/// How far two voxels' edges may differ and be the same, relatively.
const SAME: f64 = 1e-6;

/// A grid of what shines.
#[derive(Debug, Clone)]
pub struct EmissionGrid {
    /// Its name in the file.
    pub name: &'static str,
    /// What a sample of 1 emits, W m^-3 sr^-1, in the strongest channel.
    pub scale: f64,
    /// Its colour: linear RGB, the strongest channel 1.
    pub tint: [f64; 3],
    samples: Ready,
}

/// What the report says of it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EmissionSummary {
    /// The grid's name.
    pub name: &'static str,
    /// What a sample of 1 emits, W m^-3 sr^-1, in the strongest channel: an Emission node's Strength.
    pub scale: f64,
    /// Its colour, linear RGB.
    pub tint: [f64; 3],
    /// Samples that are not zero.
    pub active_voxels: u64,
}

impl EmissionGrid {
    /// The grids of flames, one where all have the same colour, else one a channel: in voxels as those of `density`, which are of that
    /// `size` (m), and in their own lattice where that has such voxels.
    ///
    /// # Errors
    /// [`crate::Error::TooManyVoxels`], [`crate::Error::Interrupted`].
    pub fn of(
        flames: &[Flame],
        (density, size): (&BrickGrid, f64),
        max_voxels: u64,
        up: Up,
        progress: &dyn Progress,
    ) -> Result<Vec<EmissionGrid>> {
        let channels = Flame::channels(flames);
        let one = channels.len() == 1;
        let mut grids = Vec::new();
        for (channel, tint) in channels {
            let bright = flames.iter().filter(|flame| flame.emission[channel] > 0.0);
            let scale = bright.clone().map(|flame| flame.emission[channel] * peak(&flame.shape)).fold(0.0, f64::max);
            let regions: Vec<Region> = bright.map(|flame| flame.as_region(channel)).collect();
            if scale <= 0.0 {
                continue;
            }
            let own = merge(&regions, None, max_voxels, scale, up, progress)?.map(|(ready, _)| ready);
            let samples = match own.filter(|own| alike(own.bricks(), density)) {
                Some(own) => own,
                None => {
                    voxel_size(&regions, Some(size), max_voxels)?;
                    Ready::Own(voxelise(&regions, size, scale, up, progress)?)
                }
            };
            let name = if one { "emission" } else { ["emission_red", "emission_green", "emission_blue"][channel] };
            grids.push(EmissionGrid { name, scale, tint, samples });
        }
        Ok(grids)
    }

    /// The samples.
    pub fn bricks(&self) -> &BrickGrid {
        self.samples.bricks()
    }

    /// What the grid says of itself.
    pub fn metadata(&self) -> Vec<(String, Meta)> {
        let [r, g, b] = self.tint;
        vec![
            ("emission".into(), Meta::Text("what shines by itself".into())),
            ("unit".into(), Meta::Text("emission_scale W m^-3 sr^-1".into())),
            ("emission_scale".into(), Meta::Float(self.scale)),
            ("emission_tint".into(), Meta::Text(format!("{r} {g} {b}"))),
        ]
    }

    /// What the report says of it.
    pub fn summary(&self) -> EmissionSummary {
        EmissionSummary { name: self.name, scale: self.scale, tint: self.tint, active_voxels: self.bricks().active_voxels() }
    }

    /// The flame that a reader of the file sees, of a world that `back` turns to the scene's.
    pub fn as_flame(&self, back: DAffine3) -> Flame {
        let bricks = self.bricks();
        let bricks = BrickGrid { world_from_index: back * bricks.world_from_index, ..bricks.clone() };
        let (low, high) = bricks.extent();
        let shape = Shape::Grid(Arc::new(VoxelGrid::new(bricks, low, high, false)));
        Flame { name: self.name.into(), shape, emission: self.tint.map(|c| c * self.scale) }
    }
}

/// The largest sample of a shape.
fn peak(shape: &Shape) -> f64 {
    match shape {
        Shape::Grid(grid) => grid.bricks.values.iter().copied().fold(0.0f32, f32::max).into(),
        _ => 1.0,
    }
}

/// Whether two grids have the same voxels, wherever they lie.
fn alike(a: &BrickGrid, b: &BrickGrid) -> bool {
    let edges = |grid: &BrickGrid| {
        [grid.world_from_index.matrix3.x_axis, grid.world_from_index.matrix3.y_axis, grid.world_from_index.matrix3.z_axis]
    };
    edges(a).iter().zip(edges(b)).all(|(a, b): (&DVec3, DVec3)| (*a - b).length() <= SAME * b.length())
}
