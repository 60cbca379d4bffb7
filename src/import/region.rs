//! Shapes out of nodes.

use super::{at::At, mesh::Summary};
use crate::{Result, geom::Bounds, scene::Shape};
use glam::{DAffine3, DMat3, DVec2, DVec3};

const APPLY: &str = "Apply the scale in Blender (Ctrl-A > Scale) and export again";

/// How far the vertical of a slab may lean.
const LEAN: f64 = 1e-3;
/// Half the extent of a slab's tile, in half heights, where no mesh says it.
const TILE: f64 = 4.0;

/// Refuses a scale of zero.
pub(super) fn check_zero(world: &DAffine3, at: At) -> Result<()> {
    let m = world.matrix3;
    let axes = DVec3::new(m.x_axis.length(), m.y_axis.length(), m.z_axis.length());
    let (least, most) = (axes.min_element(), axes.max_element());
    let flat = m.determinant().abs() <= 1e-12 * axes.element_product();
    if least <= 1e-9 * most || most <= 1e-12 || flat {
        let found = format!("zero along an axis (in the world: {}, {} and {})", axes.x, axes.y, axes.z);
        return Err(at.error(
            "scale",
            found,
            "a scale other than 0",
            "Give it (and its parents) a scale in Blender, then apply it (Ctrl-A > Scale)",
        ));
    }
    Ok(())
}

/// Refuses a scale of zero or one that mirrors.
pub(super) fn check_scale(world: &DAffine3, at: At) -> Result<()> {
    check_zero(world, at)?;
    if world.matrix3.determinant() < 0.0 {
        return Err(at.error("scale", "mirrored (an odd number of negative factors, its parents' included)", "positive factors", APPLY));
    }
    Ok(())
}

/// A ball of the node's space in the world.
pub(super) fn ball(world: &DAffine3, centre: DVec3, radius: f64) -> Shape {
    ellipsoid(world, DAffine3 { matrix3: DMat3::from_diagonal(DVec3::splat(radius)), translation: centre })
}

/// An ellipsoid of the node's space in the world.
pub(super) fn ellipsoid(world: &DAffine3, node_from_unit: DAffine3) -> Shape {
    Shape::Ellipsoid { world_from_unit: *world * node_from_unit }
}

/// A horizontal layer. The node's vertical is its local y (glTF's up).
pub(super) fn slab(world: &DAffine3, mesh: Option<&Summary>, half_height: Option<f64>, at: At) -> Result<Shape> {
    let up = world.matrix3.y_axis;
    if up.truncate().length() > LEAN * up.length() {
        let degrees = (up.z.abs() / up.length()).clamp(0.0, 1.0).acos().to_degrees();
        let fix = "Turn the slab about the vertical only (a slab is a horizontal layer without end)";
        return Err(at.error("rotation of the slab", format!("tilted by {degrees:.2} degrees"), "no tilt", fix));
    }
    let bounds = mesh.map(|mesh| mesh.bounds).filter(|bounds| !bounds.is_empty());
    let local = half_height.or(bounds.map(|bounds| bounds.size().y * 0.5)).filter(|&h| h > 0.0).ok_or_else(|| {
        let fix = "Add \"half_height\" to the custom property `cloudvdb`, or give the mesh a height";
        at.error("extras.cloudvdb.half_height", "missing, and no mesh tells it", "half the thickness of the slab", fix)
    })?;
    let half_height = local * up.length();
    let wide = bounds.map(|bounds| (world.transform_point3(bounds.centre()), world_size(world, bounds)));
    let (centre, size) = wide.filter(|(_, size)| size.x > 0.0 && size.y > 0.0).unwrap_or_else(|| {
        let centre = bounds.map_or(DVec3::ZERO, |bounds| bounds.centre());
        (world.transform_point3(centre), DVec3::splat(2.0 * TILE * half_height))
    });
    Ok(Shape::Slab { centre, half_height, half_extent: DVec2::new(size.x, size.y) * 0.5 })
}

/// The size in the world of the box that holds a box of the node's space.
fn world_size(world: &DAffine3, bounds: Bounds) -> DVec3 {
    let (m, size) = (world.matrix3, bounds.size());
    m.x_axis.abs() * size.x + m.y_axis.abs() * size.y + m.z_axis.abs() * size.z
}
