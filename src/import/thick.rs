//! Voxels that no light gets through in any time worth waiting for are refused.

use super::at::file_error;
use crate::error::Result;
use crate::scene::{Region, Scene, Shape};
use std::path::Path;

/// The most optical depth across a voxel. Where density rises from 0 to that within a voxel, a flight takes the root of it in steps; in
/// a cloud it is below 1.
const MOST: f64 = 1e6;

/// Checks a scene whose media are settled.
///
/// # Errors
/// [`crate::Error::File`] with the region, its depth, and what it is made of.
pub(super) fn refuse(path: &Path, scene: &Scene) -> Result<()> {
    match scene.regions.iter().filter_map(|r| Some((r, across(r)?))).find(|(_, depth)| *depth > MOST) {
        None => Ok(()),
        Some((region, depth)) => {
            let reason =
                format!("voxels of region {:?} have optical depths up to {depth:.1e} each (extinction x sample x width)", region.name);
            Err(file_error(path, reason, "Give it less extinction, by --sigma-t or in the file: a cloud's voxels have less than 1"))
        }
    }
}

/// The largest optical depth across a voxel, along its longest side.
fn across(region: &Region) -> Option<f64> {
    let Shape::Grid(grid) = &region.shape else { return None };
    let largest = grid.bricks.values.iter().copied().fold(0.0, f32::max);
    let m = grid.bricks.world_from_index.matrix3;
    let side = [m.x_axis, m.y_axis, m.z_axis].map(|axis| axis.length()).into_iter().fold(0.0, f64::max);
    Some(region.medium.sigma_t_rgb().into_iter().fold(region.medium.sigma_t(), f64::max) * f64::from(largest) * side)
}
