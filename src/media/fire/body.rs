//! Where flames are: points of them, drawn by what shines there.

use crate::geom::Bounds;
use crate::rng::Rng;
use crate::sampling::uniform_sphere;
use crate::scene::density::BRICK_VOXELS;
use crate::scene::{Shape, VoxelGrid};
use crate::trimesh::TriMesh;
use glam::{DAffine3, DVec3};
use std::sync::Arc;

/// Points drawn in a mesh's box before its middle is taken: of a mesh that fills a thousandth of it one in a million points.
const MOST_DRAWS: usize = 14_000;

/// Where a flame is.
#[derive(Debug, Clone)]
pub(super) enum Body {
    Ellipsoid(DAffine3),
    Mesh(TriMesh, Bounds),
    /// With the sum of samples up to and with each brick.
    Voxels(Arc<VoxelGrid>, Vec<f64>),
}

/// The sum of samples up to and with each brick.
fn sums(grid: &VoxelGrid) -> Vec<f64> {
    let brick = |brick: &[f32]| brick.iter().map(|&v| f64::from(v)).sum::<f64>();
    let add = |sum: &mut f64, samples: &[f32]| {
        *sum += brick(samples);
        Some(*sum)
    };
    grid.bricks.values.chunks(BRICK_VOXELS).scan(0.0, add).collect()
}

impl Body {
    /// That of a shape which has an end, relative to `origin`.
    pub fn of(shape: &Shape, origin: DVec3) -> Option<Self> {
        Some(match shape {
            Shape::Ellipsoid { world_from_unit } => Body::Ellipsoid(*world_from_unit),
            Shape::Mesh(mesh) => Body::Mesh(TriMesh::new(&[mesh], origin), mesh.bounds()),
            Shape::Grid(grid) => Body::Voxels(Arc::clone(grid), sums(grid)),
            // Import refuses these.
            Shape::Slab { .. } => return None,
        })
    }

    /// A point in the world, with a density in proportion to what shines there.
    pub fn sample(&self, rng: &mut Rng, origin: DVec3) -> DVec3 {
        match self {
            Body::Ellipsoid(world_from_unit) => {
                let p = uniform_sphere(rng).as_dvec3() * rng.uniform().cbrt();
                world_from_unit.transform_point3(p)
            }
            Body::Mesh(mesh, bounds) => {
                let mut draw = || bounds.min + bounds.size() * DVec3::new(rng.uniform(), rng.uniform(), rng.uniform());
                (0..MOST_DRAWS).map(|_| draw()).find(|p| mesh.holds((*p - origin).as_vec3())).unwrap_or_else(|| bounds.centre())
            }
            Body::Voxels(grid, sums) => {
                let drawn = rng.uniform() * sums.last().copied().unwrap_or(0.0);
                let brick = sums.partition_point(|&sum| sum <= drawn).min(sums.len() - 1);
                let mut left = drawn - if brick > 0 { sums[brick - 1] } else { 0.0 };
                let samples = grid.bricks.brick(brick);
                let voxel = samples.iter().position(|&sample| {
                    left -= f64::from(sample);
                    left < 0.0
                });
                // Rounding may leave something: then it is the last that shines.
                let voxel = voxel.or_else(|| samples.iter().rposition(|&s| s > 0.0)).unwrap_or(0) as i32;
                let at = DVec3::from_array(grid.bricks.origins[brick].map(f64::from))
                    + DVec3::new(f64::from(voxel >> 6), f64::from(voxel >> 3 & 7), f64::from(voxel & 7));
                // Between samples density is trilinear: a tent about each.
                let mut tent = || rng.uniform() - rng.uniform();
                grid.bricks.world_from_index.transform_point3(at + DVec3::new(tent(), tent(), tent()))
            }
        }
    }
}
