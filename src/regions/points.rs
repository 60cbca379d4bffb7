//! Where candidates are drawn, and what of a shape lies where.

use super::Placement;
use crate::geom::Bounds;
use crate::photon::Photon;
use crate::rng::Rng;
use crate::sampling::unit_ball;
use crate::scene::{BrickGrid, Mesh, Region, Shape};
use crate::trimesh::TriMesh;
use glam::{DVec3, Vec3};

/// Where candidates come from.
pub(super) enum Points<'a> {
    Photons(&'a [Photon], DVec3),
    Ball(&'a glam::DAffine3),
    Box(Bounds, Option<Inside>),
    Voxels(&'a BrickGrid, Vec<u64>),
}

impl<'a> Points<'a> {
    pub(super) fn new(region: &'a Region, photons: &'a [Photon], origin: DVec3, placement: Placement) -> Self {
        match (placement, &region.shape) {
            (Placement::Importance, _) => Points::Photons(photons, origin),
            (_, Shape::Ellipsoid { world_from_unit }) => Points::Ball(world_from_unit),
            (_, Shape::Slab { .. }) => Points::Box(region.shape.bounds(), None),
            (_, Shape::Mesh(_)) => Points::Box(region.shape.bounds(), Inside::new(&region.shape)),
            (_, Shape::Grid(grid)) => Points::Voxels(&grid.bricks, filled(&grid.bricks)),
        }
    }

    pub(super) fn draw(&self, rng: &mut Rng) -> DVec3 {
        match self {
            Points::Photons(photons, origin) => {
                let i = ((rng.uniform() * photons.len() as f64) as usize).min(photons.len() - 1);
                *origin + Vec3::from_array(photons[i].position).as_dvec3()
            }
            Points::Ball(world_from_unit) => world_from_unit.transform_point3(unit_ball([rng.uniform(), rng.uniform(), rng.uniform()])),
            Points::Box(bounds, inside) => loop {
                let p = bounds.min + bounds.size() * DVec3::new(rng.uniform(), rng.uniform(), rng.uniform());
                if inside.as_ref().is_none_or(|i| i.holds(p)) {
                    return p;
                }
            },
            Points::Voxels(bricks, until) => {
                let whole = until.last().copied().unwrap_or(0);
                let number = ((rng.uniform() * whole as f64) as u64).min(whole.saturating_sub(1));
                let brick = until.partition_point(|&end| end <= number);
                let before = if brick == 0 { 0 } else { until[brick - 1] };
                let nth = bricks.brick(brick).iter().enumerate().filter(|v| *v.1 > 0.0).nth((number - before) as usize);
                let within = DVec3::new(rng.uniform(), rng.uniform(), rng.uniform()) - 0.5;
                let centre = bricks.position(brick, nth.map_or(0, |(voxel, _)| voxel));
                centre + bricks.world_from_index.matrix3 * within
            }
        }
    }
}

/// How many samples are above zero up to the end of each brick.
fn filled(bricks: &BrickGrid) -> Vec<u64> {
    let mut until = 0;
    let count = |values: &[f32]| values.iter().filter(|&&v| v > 0.0).count() as u64;
    (0..bricks.origins.len())
        .map(|brick| {
            until += count(bricks.brick(brick));
            until
        })
        .collect()
}

/// Whether points lie in a shape.
pub(super) enum Inside {
    Unit(glam::DAffine3),
    Layer(f64, f64),
    Mesh(TriMesh, DVec3),
}

impl Inside {
    /// `None` for a grid: what is made of one has no outside.
    pub(super) fn new(shape: &Shape) -> Option<Self> {
        Some(match shape {
            Shape::Ellipsoid { world_from_unit } => Inside::Unit(world_from_unit.inverse()),
            Shape::Slab { centre, half_height, .. } => Inside::Layer(centre.z, *half_height),
            Shape::Grid(_) => return None,
            Shape::Mesh(mesh) => {
                let mesh: &Mesh = mesh;
                let origin = mesh.bounds().centre();
                Inside::Mesh(TriMesh::new(&[mesh], origin), origin)
            }
        })
    }

    pub(super) fn holds(&self, p: DVec3) -> bool {
        match self {
            Inside::Unit(unit_from_world) => unit_from_world.transform_point3(p).length_squared() <= 1.0,
            Inside::Layer(z, half) => (p.z - z).abs() <= *half,
            Inside::Mesh(mesh, origin) => mesh.holds((p - origin).as_vec3()),
        }
    }
}

/// The new regions' volume outside the region they came from, by 32 points in each, and their whole volume, m^3.
pub(super) fn sticking_out(source: &Region, made: &[Region], mut rng: Rng) -> (f64, f64) {
    let Some(inside) = Inside::new(&source.shape) else { return (0.0, 0.0) };
    let (mut out, mut whole) = (0.0, 0.0);
    for region in made {
        let Shape::Ellipsoid { world_from_unit } = &region.shape else { continue };
        let outside = (0..32).filter(|_| {
            let p = world_from_unit.transform_point3(unit_ball([rng.uniform(), rng.uniform(), rng.uniform()]));
            !inside.holds(p)
        });
        out += outside.count() as f64 / 32.0 * region.shape.volume();
        whole += region.shape.volume();
    }
    (out, whole)
}
