//! Photons of flames: from everywhere in them as much as shines there, in all directions, or where only regions matter toward these.

use super::aim::{Aim, Cone};
use super::emit::Start;
use crate::geom::{Bounds, Ray};
use crate::media::Fire;
use crate::rng::Rng;
use crate::sampling::uniform_sphere;
use crate::scene::density::BRICK_VOXELS;
use crate::scene::{Scene, Shape, VoxelGrid, medium::luminance};
use crate::trimesh::TriMesh;
use glam::{DAffine3, DVec3, Vec3};
use std::f64::consts::PI;
use std::sync::Arc;

/// How often a photon goes anywhere where surfaces may send it on, and not toward the regions.
const ANYWHERE: f64 = 0.3;
/// Points drawn in a mesh's box before its middle is taken: of a mesh that fills a thousandth of it one in a million photons.
const MOST_DRAWS: usize = 14_000;

/// The flames of a scene, compiled.
#[derive(Debug, Clone)]
pub(super) struct Flames {
    bodies: Vec<Body>,
    /// Up to and with each body, W.
    powers: Vec<f64>,
    /// Of all, W: the power of a photon that may go anywhere.
    pub(super) power: f64,
    fire: Fire,
    aim: Option<Aim>,
    /// Whether surfaces send light on.
    beside: bool,
    origin: DVec3,
}

/// Where a flame is.
#[derive(Debug, Clone)]
enum Body {
    Ellipsoid(DAffine3),
    Mesh(TriMesh, Bounds),
    /// With the sum of samples up to and with each brick.
    Voxels(Arc<VoxelGrid>, Vec<f64>),
}

impl Flames {
    /// Those of a scene, relative to `origin`; `aim` is the regions' bounding sphere, and `bounces` tells whether surfaces send light on.
    pub fn of(scene: &Scene, origin: DVec3, aim: Option<&Aim>, bounces: bool) -> Option<Self> {
        let (mut bodies, mut powers, mut power) = (Vec::new(), Vec::new(), 0.0);
        for flame in scene.flames.iter().filter(|flame| flame.power() > 0.0) {
            bodies.push(match &flame.shape {
                Shape::Ellipsoid { world_from_unit } => Body::Ellipsoid(*world_from_unit),
                Shape::Mesh(mesh) => Body::Mesh(TriMesh::new(&[mesh], origin), mesh.bounds()),
                Shape::Grid(grid) => Body::Voxels(Arc::clone(grid), sums(grid)),
                // Import refuses these.
                Shape::Slab { .. } => continue,
            });
            power += flame.power();
            powers.push(power);
        }
        let (fire, beside) = (Fire::new(scene, origin), bounces && !scene.surfaces.is_empty());
        (!bodies.is_empty()).then(|| Flames { bodies, powers, power, fire, aim: aim.copied(), beside, origin })
    }

    /// About the largest power of a photon, W.
    pub fn strongest(&self) -> f64 {
        self.power / if self.beside { ANYWHERE } else { 1.0 }
    }

    /// Starts one photon. Its colour is that of the light from there, of luminance 1.
    pub fn emit(&self, rng: &mut Rng) -> Start {
        let drawn = rng.uniform() * self.power;
        let number = self.powers.partition_point(|&sum| sum <= drawn).min(self.bodies.len() - 1);
        let p = (self.bodies[number].sample(rng, self.origin) - self.origin).as_vec3();
        // All flames together are drawn by what they emit as a luminance: so it does not matter which of them this point is of.
        let light = self.fire.at(p);
        let grey = luminance(light.as_dvec3().to_array()) as f32;
        let tint = if grey > 0.0 { light / grey } else { Vec3::ONE };
        let cone = self.aim.and_then(|aim| aim.seen_from(p)).filter(|cone| cone.solid_angle < 4.0 * PI);
        let anywhere = if cone.is_none() || (self.beside && rng.uniform() < ANYWHERE) { Some(uniform_sphere(rng)) } else { None };
        let direction = match (anywhere, &cone) {
            (Some(direction), _) => direction,
            (None, Some(cone)) => cone.sample(rng),
            (None, None) => Vec3::Z,
        };
        // Over the density of all directions alike.
        let density = cone.map_or(1.0, |cone: Cone| {
            let toward = if anywhere.is_none() || cone.holds(direction) { 4.0 * PI / cone.solid_angle } else { 0.0 };
            if self.beside { ANYWHERE + (1.0 - ANYWHERE) * toward } else { toward }
        });
        Start { ray: Ray { origin: p, direction }, power: self.power / density, tint, counted: false, scattered: true, from_air: false }
    }
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
    /// A point in the world, with a density in proportion to what shines there.
    fn sample(&self, rng: &mut Rng, origin: DVec3) -> DVec3 {
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
