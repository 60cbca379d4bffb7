//! How much of each voxel a shape covers.

use super::{Lattice, Up};
use crate::geom::{Bounds, Ray};
use crate::scene::density::{BRICK_SIDE, BRICK_VOXELS};
use crate::scene::{Mesh, Shape, VoxelGrid};
use crate::trimesh::TriMesh;
use glam::{DAffine3, DMat3, DVec3, IVec3, Vec3};
use std::sync::Arc;

/// What is smaller than this share of a voxel slips between any number of lines: its mass goes where its bounds are.
const CRUMB: f64 = 1.0 / 3.0;

/// A shape on its way into voxels; bounds in the same space.
pub struct Cover {
    solid: Solid,
    /// Its bounds.
    pub bounds: Bounds,
    /// Lines a voxel along x and y.
    lines: i32,
}

enum Solid {
    Ellipsoid {
        from_unit: DAffine3,
        to_unit: DAffine3,
        reach: f64,
    },
    /// Its bounds, of which this share is covered.
    Box(f64),
    Mesh {
        mesh: Mesh,
        triangles: TriMesh,
    },
    /// Samples, and the way from the lattice's index space to the world.
    Grid(Arc<VoxelGrid>, DAffine3),
}

impl Cover {
    /// A shape in the world, turned so that `up` points up.
    pub fn new(shape: &Shape, up: Up) -> Self {
        let turn = match up {
            Up::Z => DMat3::IDENTITY,
            // (x, y, z) -> (x, z, -y): what was up along z is up along y.
            Up::Y => DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y),
        };
        let turned = |b: Bounds| Bounds::EMPTY.include(turn * b.min).include(turn * b.max);
        match shape {
            Shape::Ellipsoid { world_from_unit } => Cover::ellipsoid(DAffine3::from_mat3(turn) * *world_from_unit),
            Shape::Slab { .. } => Cover { solid: Solid::Box(1.0), bounds: turned(shape.bounds()), lines: 1 },
            Shape::Grid(grid) => {
                // Density reaches half a voxel beyond the bounds; but what is beyond a tile is the next tile's.
                let (mut bounds, tile) = (grid.support(), grid.bounds());
                if grid.periodic {
                    bounds = Bounds { min: tile.min.with_z(bounds.min.z), max: tile.max.with_z(bounds.max.z) };
                }
                Cover { solid: Solid::Grid(Arc::clone(grid), DAffine3::from_mat3(turn.transpose())), bounds: turned(bounds), lines: 2 }
            }
            Shape::Mesh(mesh) => {
                let mesh = Mesh { vertices: mesh.vertices.iter().map(|&v| turn * v).collect(), triangles: mesh.triangles.clone() };
                Cover { bounds: mesh.bounds(), solid: Solid::Mesh { mesh, triangles: TriMesh::default() }, lines: 4 }
            }
        }
    }

    fn ellipsoid(from_unit: DAffine3) -> Self {
        let shape = Shape::Ellipsoid { world_from_unit: from_unit };
        let to_unit = from_unit.inverse();
        // How far, in unit space, a corner of a brick can be from its centre (used in index space).
        let m = to_unit.matrix3;
        let half = f64::from(BRICK_SIDE) * 0.5;
        let reach = half * (m.x_axis.length() + m.y_axis.length() + m.z_axis.length());
        // At least 16 lines across the smallest half extent: the integral then holds to a few parts in ten thousand.
        let lines = (16.0 / shape.smallest_half_extent()).ceil().clamp(4.0, 96.0) as i32;
        Cover { bounds: shape.bounds(), solid: Solid::Ellipsoid { from_unit, to_unit, reach }, lines }
    }

    /// The same shape in index space, where voxel (i, j, k) fills [i, i + 1] x [j, j + 1] x [k, k + 1].
    pub fn into_index(self, lattice: &Lattice) -> Self {
        let (anchor, step) = (lattice.anchor, lattice.step);
        let bounds = Bounds { min: lattice.index(self.bounds.min), max: lattice.index(self.bounds.max) };
        match self.solid {
            Solid::Ellipsoid { from_unit, .. } => {
                let from_unit = DAffine3::from_scale(step.recip()) * DAffine3::from_translation(-anchor) * from_unit;
                let size = bounds.size();
                if size.max_element() < CRUMB {
                    let share = 4.0 / 3.0 * std::f64::consts::PI * from_unit.matrix3.determinant().abs() / size.element_product();
                    return Cover { solid: Solid::Box(share), bounds, lines: 1 };
                }
                Cover::ellipsoid(from_unit)
            }
            Solid::Box(share) => Cover { solid: Solid::Box(share), bounds, lines: 1 },
            Solid::Grid(grid, turn) => {
                let world = turn * DAffine3::from_translation(anchor) * DAffine3::from_scale(step);
                // As many points a voxel as it has samples along an edge, and where the lattices agree the samples themselves.
                let lines = (step.max_element() / grid.voxel_size()).ceil().clamp(1.0, 16.0) as i32;
                Cover { solid: Solid::Grid(grid, world), bounds, lines }
            }
            Solid::Mesh { mut mesh, .. } => {
                mesh.vertices.iter_mut().for_each(|v| *v = lattice.index(*v));
                let triangles = TriMesh::new(&[&mesh], bounds.centre());
                let lines = (32.0 / bounds.size().min_element()).ceil().clamp(4.0, 96.0) as i32;
                Cover { bounds, lines, solid: Solid::Mesh { mesh: Mesh::default(), triangles } }
            }
        }
    }

    fn unit_distance(&self, origin: IVec3) -> Option<(f64, f64)> {
        let Solid::Ellipsoid { to_unit, reach, .. } = &self.solid else { return None };
        let centre = origin.as_dvec3() + f64::from(BRICK_SIDE) * 0.5;
        Some((to_unit.transform_point3(centre).length(), *reach))
    }

    /// Whether it may meet the brick at this origin.
    pub fn meets(&self, origin: IVec3) -> bool {
        self.unit_distance(origin).is_none_or(|(distance, reach)| distance <= 1.0 + reach)
    }

    /// Adds `weight` times the covered share of each voxel of the brick.
    pub fn cover(&self, origin: IVec3, weight: f64, sum: &mut [f64; BRICK_VOXELS]) {
        if self.unit_distance(origin).is_some_and(|(distance, reach)| distance + reach <= 1.0) {
            sum.iter_mut().for_each(|v| *v += weight);
            return;
        }
        let base = origin.as_dvec3();
        if let Solid::Grid(grid, world) = &self.solid {
            let (k, share) = (self.lines, weight / f64::from(self.lines.pow(3)));
            for (voxel, value) in sum.iter_mut().enumerate() {
                let corner = base + DVec3::new((voxel >> 6) as f64, (voxel >> 3 & 7) as f64, (voxel & 7) as f64);
                // One look instead of up to 4096: of a cloud that lies scattered most of the box is empty.
                if k > 1 && nothing_in(grid, world, corner) {
                    continue;
                }
                for i in 0..k.pow(3) {
                    let part = (DVec3::new(f64::from(i / k / k), f64::from(i / k % k), f64::from(i % k)) + 0.5) / f64::from(k);
                    let p = corner + part;
                    let beside = (p.cmplt(self.bounds.min) | p.cmpge(self.bounds.max)).any();
                    *value += if beside { 0.0 } else { share * grid.density(world.transform_point3(p)) };
                }
            }
            return;
        }
        let mut crossings = Vec::new();
        for x in 0..BRICK_SIDE {
            for y in 0..BRICK_SIDE {
                let column = &mut sum[(x as usize) << 6 | (y as usize) << 3..][..8];
                if let Solid::Box(share) = self.solid {
                    let area = overlap(base.x + f64::from(x), self.bounds.min.x, self.bounds.max.x)
                        * overlap(base.y + f64::from(y), self.bounds.min.y, self.bounds.max.y);
                    add(column, weight * share * area, self.bounds.min.z - base.z, self.bounds.max.z - base.z);
                    continue;
                }
                // A small shape touches few lines of a voxel: those outside its bounds are skipped.
                let range = |from: f64, low: f64, high: f64| {
                    let k = f64::from(self.lines);
                    let line = |v: f64| ((v - from) * k).clamp(0.0, k) as i32;
                    line(low)..(line(high) + 1).min(self.lines)
                };
                let share = weight / f64::from(self.lines * self.lines);
                for i in range(base.x + f64::from(x), self.bounds.min.x, self.bounds.max.x) {
                    for j in range(base.y + f64::from(y), self.bounds.min.y, self.bounds.max.y) {
                        let at = |c: i32, i: i32| f64::from(c) + (f64::from(i) + 0.5) / f64::from(self.lines);
                        let p = base + DVec3::new(at(x, i), at(y, j), 0.0);
                        match &self.solid {
                            Solid::Ellipsoid { to_unit, .. } => {
                                if let Some((from, to)) = vertical(to_unit, p) {
                                    add(column, share, from, to);
                                }
                            }
                            Solid::Mesh { triangles, .. } => {
                                let below = DVec3::new(p.x, p.y, self.bounds.min.z - 1.0) - self.bounds.centre();
                                let ray = Ray { origin: below.as_vec3(), direction: Vec3::Z };
                                let shift = self.bounds.min.z - 1.0 - base.z;
                                triangles.inside(&ray, &mut crossings, |from, to| {
                                    add(column, share, f64::from(from) + shift, f64::from(to) + shift)
                                });
                            }
                            Solid::Box(_) | Solid::Grid(..) => {}
                        }
                    }
                }
            }
        }
    }
}

/// Whether no brick of the grid reaches into the voxel at `corner`, which `world` takes to the world.
fn nothing_in(grid: &VoxelGrid, world: &DAffine3, corner: DVec3) -> bool {
    if grid.periodic {
        return false;
    }
    let to_index = grid.bricks.world_from_index.inverse() * *world;
    let near = (0..8usize).fold(Bounds::EMPTY, |near, i| {
        let end = DVec3::new((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2) as f64);
        near.include(to_index.transform_point3(corner + end))
    });
    // Density between samples is made of the next ones on either side.
    let brick = |p: DVec3| (p.floor() / f64::from(BRICK_SIDE)).floor().as_ivec3();
    let (from, to) = (brick(near.min), brick(near.max + 1.0));
    let origins = &grid.bricks.origins;
    // Where the voxel spans more bricks than there are, each of those is looked at instead.
    if (to - from).as_dvec3().max_element().powi(3) > origins.len() as f64 {
        let (from, to) = (from.as_dvec3() * f64::from(BRICK_SIDE), to.as_dvec3() * f64::from(BRICK_SIDE));
        return !origins.iter().map(|&o| IVec3::from_array(o).as_dvec3()).any(|o| o.cmpge(from).all() && o.cmple(to).all());
    }
    let held = |x, y, z| origins.binary_search(&(IVec3::new(x, y, z) * BRICK_SIDE).to_array()).is_ok();
    !(from.x..=to.x).any(|x| (from.y..=to.y).any(|y| (from.z..=to.z).any(|z| held(x, y, z))))
}

/// Where the vertical line through `p` is inside the unit ball's image, along z from `p`.
fn vertical(to_unit: &DAffine3, p: DVec3) -> Option<(f64, f64)> {
    let (o, d) = (to_unit.transform_point3(p), to_unit.matrix3.z_axis);
    let a = d.length_squared();
    let middle = -o.dot(d) / a;
    let v = (o + d * middle).length();
    let discriminant = (1.0 + v) * (1.0 - v) / a;
    (discriminant > 0.0).then(|| (middle - discriminant.sqrt(), middle + discriminant.sqrt()))
}

/// How much of [from, from + 1] lies in [low, high].
pub fn overlap(from: f64, low: f64, high: f64) -> f64 {
    ((from + 1.0).min(high) - from.max(low)).max(0.0)
}

/// Adds `weight` times the overlap of [from, to] with each of the 8 voxels of a column that starts at 0.
pub fn add(column: &mut [f64], weight: f64, from: f64, to: f64) {
    let (from, to) = (from.max(0.0), to.min(8.0));
    if from >= to {
        return;
    }
    let (first, last) = (from as usize, (to.ceil() as usize - 1).min(7));
    for (z, value) in column.iter_mut().enumerate().take(last + 1).skip(first) {
        *value += weight * overlap(z as f64, from, to);
    }
}
