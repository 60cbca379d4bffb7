//! Regions: a shape in world space, filled with a homogeneous medium.

use super::{Medium, Mesh, VoxelGrid};
use crate::geom::Bounds;
use glam::{DAffine3, DMat3, DVec2, DVec3};
use std::sync::Arc;

/// A region of participating medium (the thesis's *volume region*).
#[derive(Debug, Clone)]
pub struct Region {
    /// The node it came from, or the region it was synthesised from with a number.
    pub name: String,
    /// Where it is.
    pub shape: Shape,
    /// What fills it.
    pub medium: Medium,
    /// The photons that the duality found in it; `None` for a region of the layout.
    pub photons: Option<u64>,
}

/// The shape of a region, world space.
#[derive(Debug, Clone)]
pub enum Shape {
    /// The image of the unit ball; spheres are ellipsoids of equal axes.
    Ellipsoid {
        /// From the unit ball's space to the world. Not singular.
        world_from_unit: DAffine3,
    },
    /// A horizontal layer without end. Transport sees no edge; grids and photons keep to the tile.
    Slab {
        /// The centre of the tile.
        centre: DVec3,
        /// Half the layer's thickness, m.
        half_height: f64,
        /// Half the extent of the tile in x and y, m: the part that is written.
        half_extent: DVec2,
    },
    /// The inside of a closed mesh, by its winding number.
    Mesh(Arc<Mesh>),
    /// Voxels: the region's medium is that of a sample of 1.
    Grid(Arc<VoxelGrid>),
}

impl Shape {
    /// Whether it goes on horizontally without end: a slab, or a grid that is repeated.
    pub fn is_endless(&self) -> bool {
        match self {
            Shape::Slab { .. } => true,
            Shape::Grid(grid) => grid.periodic,
            _ => false,
        }
    }

    /// A sphere by its centre and radius in metres.
    pub fn sphere(centre: DVec3, radius: f64) -> Self {
        Shape::Ellipsoid { world_from_unit: DAffine3 { matrix3: DMat3::from_diagonal(DVec3::splat(radius)), translation: centre } }
    }

    /// Its centre: of the ellipsoid, of the tile, of the mesh's bounds.
    pub fn centre(&self) -> DVec3 {
        match self {
            Shape::Ellipsoid { world_from_unit } => world_from_unit.translation,
            Shape::Slab { centre, .. } => *centre,
            Shape::Mesh(mesh) => mesh.bounds().centre(),
            Shape::Grid(grid) => grid.bounds().centre(),
        }
    }

    /// Its bounds in the world: a slab's are those of its tile.
    pub fn bounds(&self) -> Bounds {
        match self {
            Shape::Ellipsoid { world_from_unit } => {
                // The extent along a world axis is the length of that row of the matrix.
                let rows = world_from_unit.matrix3.transpose();
                let half = DVec3::new(rows.x_axis.length(), rows.y_axis.length(), rows.z_axis.length());
                Bounds { min: world_from_unit.translation - half, max: world_from_unit.translation + half }
            }
            Shape::Slab { centre, half_height, half_extent } => {
                let half = half_extent.extend(*half_height);
                Bounds { min: *centre - half, max: *centre + half }
            }
            Shape::Mesh(mesh) => mesh.bounds(),
            Shape::Grid(grid) => grid.bounds(),
        }
    }

    /// Its volume in m^3: a slab's is that of its tile, a grid's is weighed by its samples.
    pub fn volume(&self) -> f64 {
        match self {
            Shape::Ellipsoid { world_from_unit } => 4.0 / 3.0 * std::f64::consts::PI * world_from_unit.matrix3.determinant().abs(),
            Shape::Slab { half_height, half_extent, .. } => 8.0 * half_extent.x * half_extent.y * half_height,
            Shape::Mesh(mesh) => mesh.signed_volume().abs(),
            Shape::Grid(grid) => grid.integral(),
        }
    }

    /// The smallest half extent in metres: a sphere's radius, an ellipsoid's shortest half-axis, half a slab's thickness,
    /// half the smallest side of a mesh's bounds, three voxels of a grid (the smallest thing that it can show).
    pub fn smallest_half_extent(&self) -> f64 {
        match self {
            Shape::Ellipsoid { world_from_unit } => smallest_stretch(world_from_unit.matrix3),
            Shape::Slab { half_height, .. } => *half_height,
            Shape::Mesh(mesh) => mesh.bounds().size().min_element() * 0.5,
            Shape::Grid(grid) => 3.0 * grid.voxel_size(),
        }
    }

    /// No straight line is longer within it, m; of a layer without end within its tile, of a grid within its box.
    pub fn longest(&self) -> f64 {
        match self {
            // The norm of the whole matrix bounds its largest singular value.
            Shape::Ellipsoid { world_from_unit: DAffine3 { matrix3, .. } } => {
                let axes = orthogonal(*matrix3).map(|axes| axes.into_iter().fold(0.0, f64::max));
                2.0 * axes.unwrap_or_else(|| DVec3::from_array(matrix3.to_cols_array_2d().map(|c| DVec3::from_array(c).length())).length())
            }
            shape => shape.bounds().size().length(),
        }
    }

    /// The longest way through it along a straight line, roughly, in metres (weighed by its samples where it is a grid): what
    /// "optical depth across" refers to.
    pub fn thickness(&self) -> f64 {
        match self {
            Shape::Slab { half_height, .. } => 2.0 * half_height,
            Shape::Grid(grid) => grid.thickest(),
            _ => 2.0 * (self.volume() * 0.75 / std::f64::consts::PI).cbrt(),
        }
    }
}

/// The lengths of a matrix's columns, if these are orthogonal: its singular values.
fn orthogonal(m: DMat3) -> Option<[f64; 3]> {
    let axes = [m.x_axis, m.y_axis, m.z_axis];
    let lengths = axes.map(|a| a.length());
    let apart = |i: usize| axes[i].dot(axes[(i + 1) % 3]).abs() <= 1e-9 * lengths[i] * lengths[(i + 1) % 3];
    (0..3).all(apart).then_some(lengths)
}

/// The smallest singular value of a 3x3 matrix: 1 / the largest one of its inverse, by power iteration on the Gram matrix.
fn smallest_stretch(m: DMat3) -> f64 {
    if let Some(axes) = orthogonal(m) {
        return axes.into_iter().fold(f64::INFINITY, f64::min);
    }
    let inverse = m.inverse();
    let gram = inverse * inverse.transpose();
    let mut v = DVec3::new(0.61, 0.53, 0.59);
    for _ in 0..64 {
        v = (gram * v).normalize();
    }
    (gram * v).length().sqrt().recip()
}

impl Region {
    /// Its optical mass, sigma_t times volume, in m^2: what the duality keeps.
    pub fn optical_mass(&self) -> f64 {
        self.medium.sigma_t() * self.shape.volume()
    }
}
