//! Depths under the surface of a closed mesh, by OpenVDB's mesh-to-volume tool.

use super::{MAX_VOXELS, drain, ffi};
use crate::error::{Error, Result};
use crate::scene::BrickGrid;
use crate::scene::density::BRICK_SIDE;
use glam::{DAffine3, DMat3, DVec3};

/// Indices are 32-bit, and OpenVDB takes differences of them.
const FARTHEST: f64 = (1 << 29) as f64;

/// How deep each sample of a cubic lattice lies under the surface of a closed mesh, in metres: the distance to the nearest
/// triangle, positive inside and negative outside. Sample (0, 0, 0) is at `anchor`, samples are `voxel_size` metres apart.
///
/// Depths are kept to `-exterior..=interior` metres: samples farther outside hold `-exterior`, deeper ones `interior`, which may
/// be infinite for depths of the whole inside. The grid has every brick with a sample above `-exterior`, so outside its bricks
/// depth is `-exterior` and not 0. What is inside is told by the surface and not by the way its triangles face; pieces of
/// surface inside another are dropped. Below about a voxel's thickness a mesh has no inside.
///
/// Most depths are exact to single precision; the worst that tests found is 0.1 voxels, deep inside a sphere or at samples
/// within 0.05 voxels of an edge, which may be taken for the other side. They are the same on any number of threads.
///
/// # Errors
/// [`Error::Scene`] where there is no triangle, a number is not finite, a triangle names a vertex that is not there, a width
/// or the voxel size makes no sense, or more than 2^31 voxels would be needed; or where OpenVDB refuses.
pub fn mesh_distance(
    vertices: &[DVec3],
    triangles: &[[u32; 3]],
    voxel_size: f64,
    anchor: DVec3,
    exterior: f64,
    interior: f64,
) -> Result<BrickGrid> {
    let refused = |reason: String, fix: &str| Error::Scene { reason, fix: fix.into() };
    if !(voxel_size > 0.0 && voxel_size.is_finite() && exterior >= 0.0 && exterior.is_finite() && interior > 0.0 && anchor.is_finite()) {
        let reason =
            format!("distances in voxels of {voxel_size} m at {anchor}, {exterior} m outside and {interior} m inside, make no sense");
        return Err(refused(reason, "Give a voxel size and widths above zero"));
    }
    if triangles.is_empty() {
        return Err(refused("a mesh without triangles has no inside".into(), "Give it a closed surface"));
    }
    let mut points = Vec::with_capacity(vertices.len() * 3);
    for (i, &vertex) in vertices.iter().enumerate() {
        let place = (vertex - anchor) / voxel_size;
        if !place.is_finite() {
            return Err(refused(format!("vertex {i} of a mesh is at {vertex}"), "Correct it in the layout"));
        }
        points.extend(place.to_array());
    }
    let corner = |i: u32| points.get(i as usize * 3..i as usize * 3 + 3).map(DVec3::from_slice);
    let mut corners = Vec::with_capacity(triangles.len());
    for (i, &[a, b, c]) in triangles.iter().enumerate() {
        let Some(((a, b), c)) = corner(a).zip(corner(b)).zip(corner(c)) else {
            let reason = format!("triangle {i} of a mesh names a vertex beyond its {}", vertices.len());
            return Err(refused(reason, "Correct it in the layout"));
        };
        corners.push([a, b, c]);
    }
    let needed = voxels(&corners, exterior / voxel_size, interior / voxel_size);
    if needed > MAX_VOXELS as f64 {
        let reason = format!("a mesh in voxels of {voxel_size} m needs about {needed:.2e} of them, more than {MAX_VOXELS}");
        return Err(refused(reason, "Use larger voxels"));
    }
    // What does not fit into 32 bits is deeper than any mesh: all of the inside.
    let deepest = ((interior / voxel_size) as f32).min(f32::MAX);
    let bricks = ffi::mesh_depth(&points, triangles.as_flattened(), (exterior / voxel_size) as f32, deepest, MAX_VOXELS)
        .map_err(|e| refused(format!("OpenVDB cannot make a volume of a mesh ({})", e.what()), "Use larger voxels"))?;
    let drained = drain(bricks).map_err(|e| refused(format!("OpenVDB's volume of a mesh is lost ({})", e.what()), "Use larger voxels"))?;
    let Some((origins, mut values)) = drained else {
        return Err(refused(format!("about {needed:.2e} voxels do not fit into memory"), "Use larger voxels"));
    };
    for value in &mut values {
        *value = (f64::from(*value) * voxel_size) as f32;
    }
    let world_from_index = DAffine3 { matrix3: DMat3::from_diagonal(DVec3::splat(voxel_size)), translation: anchor };
    Ok(BrickGrid { world_from_index, origins, values })
}

/// About how many voxels the bricks hold, from above: the inside and a band about the surface, at most the whole box. Infinite
/// where indices would not do.
fn voxels(triangles: &[[DVec3; 3]], exterior: f64, interior: f64) -> f64 {
    let (low, high) =
        triangles.iter().flatten().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), &corner| (low.min(corner), high.max(corner)));
    let margin = exterior + f64::from(BRICK_SIDE);
    let farthest = low.abs().max_element().max(high.abs().max_element()) + margin;
    if farthest.is_nan() || farthest > FARTHEST {
        return f64::INFINITY;
    }
    let (mut area, mut volume) = (0.0, 0.0);
    for [a, b, c] in triangles.iter().map(|t| t.map(|v| v - low)) {
        area += 0.5 * (b - a).cross(c - a).length();
        volume += a.dot(b.cross(c)) / 6.0;
    }
    let edge = f64::from(BRICK_SIDE);
    let inward = interior.min((high - low).max_element()).min(edge);
    let shell = volume.abs() + area * (exterior + inward + 2.0 * edge);
    // The band about a surface smaller than itself is a ball.
    (high - low + 2.0 * margin).element_product().min(2.0 * shell + (2.0 * margin + edge).powi(3))
}
