//! Regions to voxels: partial coverage at boundaries, so that the integral of the grid is the regions' optical mass.
//!
//! Each voxel gets the share of it that a region covers: exact along z (the interval of a line inside the shape), by
//! k x k lines a voxel across it. Overlaps add.

use crate::error::{Error, Result};
use crate::geom::{Bounds, Ray};
use crate::progress::Progress;
use crate::scene::density::{BRICK_SIDE, BRICK_VOXELS};
use crate::scene::{BrickGrid, Mesh, Region, Shape, VoxelGrid};
use crate::trimesh::TriMesh;
use glam::{DAffine3, DMat3, DVec3, IVec3, Vec3};
use rayon::prelude::*;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// A brick's smallest index and its samples.
type Brick = ([i32; 3], Box<[f32; BRICK_VOXELS]>);

/// Which axis points up in the written grid.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Up {
    /// Blender's.
    #[default]
    Z,
    /// Houdini's, Unreal's, USD's.
    Y,
}

/// The regions' extinction in units of `density_scale` per metre, in voxels of `voxel_size` metres.
///
/// # Errors
/// [`Error::Interrupted`].
pub fn voxelise(regions: &[Region], voxel_size: f64, density_scale: f64, up: Up, progress: &dyn Progress) -> Result<BrickGrid> {
    let shapes: Vec<Voxels> = regions.iter().map(|r| Voxels::new(&r.shape, up)).collect();
    let bounds = shapes.iter().fold(Bounds::EMPTY, |b, s| b.union(s.bounds));
    // The lattice starts at a whole brick near the scene, so that indices stay small wherever the scene is.
    let brick = voxel_size * f64::from(BRICK_SIDE);
    let anchor = if bounds.is_empty() { DVec3::ZERO } else { (bounds.min / brick).floor() * brick };
    let shapes: Vec<Voxels> = shapes.into_iter().map(|s| s.into_index(anchor, voxel_size)).collect();
    let mut touched: Vec<([i32; 3], u32)> = Vec::new();
    for (i, shape) in shapes.iter().enumerate() {
        progress.check()?;
        shape.bricks(|origin| touched.push((origin, i as u32)));
    }
    touched.sort_unstable();
    let groups: Vec<&[([i32; 3], u32)]> = touched.chunk_by(|a, b| a.0 == b.0).collect();
    progress.begin("voxels", groups.len() as u64);
    let done = AtomicU64::new(0);
    let filled: Vec<Option<Brick>> = groups
        .par_iter()
        .map(|group| {
            if progress.cancelled() {
                return None;
            }
            let origin = group[0].0;
            let mut sum = [0.0f64; BRICK_VOXELS];
            for &(_, i) in *group {
                let weight = regions[i as usize].medium.sigma_t() / density_scale;
                shapes[i as usize].cover(origin, weight, &mut sum);
            }
            let count = done.fetch_add(1, Ordering::Relaxed);
            if count.is_multiple_of(256) {
                progress.at(count);
            }
            sum.iter().any(|&v| v > 0.0).then(|| (origin, Box::new(sum.map(|v| v as f32))))
        })
        .collect();
    progress.check()?;
    let mut grid = BrickGrid {
        world_from_index: DAffine3 { matrix3: DMat3::from_diagonal(DVec3::splat(voxel_size)), translation: anchor + 0.5 * voxel_size },
        origins: Vec::new(),
        values: Vec::new(),
    };
    for (origin, values) in filled.into_iter().flatten() {
        grid.origins.push(origin);
        grid.values.extend_from_slice(&values[..]);
    }
    Ok(grid)
}

/// A voxel size for these regions: `asked`, or a third of the smallest half extent or 1/128 of the longest side, whichever is
/// finer, coarsened where more than `max_voxels` would be active. The second value says whether it was coarsened.
///
/// # Errors
/// [`Error::TooManyVoxels`] where `asked` does not fit.
pub fn voxel_size(regions: &[Region], asked: Option<f64>, max_voxels: u64) -> Result<(f64, bool)> {
    let smallest = regions.iter().map(|r| r.shape.smallest_half_extent()).fold(f64::INFINITY, f64::min);
    let longest = regions.iter().fold(Bounds::EMPTY, |b, r| b.union(r.shape.bounds())).size().max_element();
    let finest = (smallest / 3.0).min(longest / 128.0);
    let size = asked.unwrap_or(finest);
    let needed = active_voxels(regions, size);
    if needed <= max_voxels as f64 {
        return Ok((size, false));
    }
    let (mut low, mut high) = (size, size * 2.0);
    while active_voxels(regions, high) > max_voxels as f64 && high < f64::MAX / 2.0 {
        (low, high) = (high, high * 2.0);
    }
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if active_voxels(regions, middle) > max_voxels as f64 { low = middle } else { high = middle }
    }
    let fitting = round_up(high);
    match asked {
        Some(voxel_size) => Err(Error::TooManyVoxels { voxel_size, voxels: needed, max_voxels, fitting }),
        None => Ok((fitting, true)),
    }
}

/// About how many voxels of that size would be active: each region's volume grown by half a voxel, at most the whole bounds.
fn active_voxels(regions: &[Region], size: f64) -> f64 {
    let grown = |s: DVec3| (s / size + 1.0).element_product();
    let one = |shape: &Shape| match shape {
        Shape::Ellipsoid { .. } => grown(shape.bounds().size()).min(shape.volume() / size.powi(3) + surface_voxels(shape, size)),
        _ => grown(shape.bounds().size()),
    };
    let bounds = regions.iter().fold(Bounds::EMPTY, |b, r| b.union(r.shape.bounds()));
    // Indices are 32-bit.
    if bounds.size().max_element() / size > f64::from(1 << 30) {
        return f64::INFINITY;
    }
    regions.iter().map(|r| one(&r.shape)).sum::<f64>().min(grown(bounds.size()))
}

/// The voxels that an ellipsoid's surface adds to its volume, about.
fn surface_voxels(shape: &Shape, size: f64) -> f64 {
    let half = shape.bounds().size() * 0.5 / size;
    std::f64::consts::PI * 4.0 / 3.0 * ((half + 0.5).element_product() - half.element_product()) + 1.0
}

/// To three significant digits, upward.
fn round_up(x: f64) -> f64 {
    let unit = 10f64.powi(x.log10().floor() as i32 - 2);
    // Through text, so that the number prints as short as it is.
    format!("{:.2e}", (x / unit).ceil() * unit).parse().unwrap_or(x)
}

/// What is smaller than this share of a voxel slips between any number of lines: its mass goes where its bounds are.
const CRUMB: f64 = 1.0 / 3.0;

/// A shape on its way into voxels; bounds in the same space.
struct Voxels {
    solid: Solid,
    bounds: Bounds,
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

impl Voxels {
    fn new(shape: &Shape, up: Up) -> Self {
        let turn = match up {
            Up::Z => DMat3::IDENTITY,
            // (x, y, z) -> (x, z, -y): what was up along z is up along y.
            Up::Y => DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y),
        };
        let turned = |b: Bounds| Bounds::EMPTY.include(turn * b.min).include(turn * b.max);
        match shape {
            Shape::Ellipsoid { world_from_unit } => Voxels::ellipsoid(DAffine3::from_mat3(turn) * *world_from_unit),
            Shape::Slab { .. } => Voxels { solid: Solid::Box(1.0), bounds: turned(shape.bounds()), lines: 1 },
            Shape::Grid(grid) => Voxels {
                solid: Solid::Grid(Arc::clone(grid), DAffine3::from_mat3(turn.transpose())),
                bounds: turned(shape.bounds()),
                lines: 2,
            },
            Shape::Mesh(mesh) => {
                let mesh = Mesh { vertices: mesh.vertices.iter().map(|&v| turn * v).collect(), triangles: mesh.triangles.clone() };
                Voxels { bounds: mesh.bounds(), solid: Solid::Mesh { mesh, triangles: TriMesh::default() }, lines: 4 }
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
        Voxels { bounds: shape.bounds(), solid: Solid::Ellipsoid { from_unit, to_unit, reach }, lines }
    }

    /// The same shape in index space, where voxel (i, j, k) fills [i, i + 1] x [j, j + 1] x [k, k + 1].
    fn into_index(self, anchor: DVec3, size: f64) -> Self {
        let index = |p: DVec3| (p - anchor) / size;
        let bounds = Bounds { min: index(self.bounds.min), max: index(self.bounds.max) };
        match self.solid {
            Solid::Ellipsoid { from_unit, .. } => {
                let from_unit = DAffine3 { matrix3: from_unit.matrix3 * size.recip(), translation: index(from_unit.translation) };
                let size = bounds.size();
                if size.max_element() < CRUMB {
                    let share = 4.0 / 3.0 * std::f64::consts::PI * from_unit.matrix3.determinant().abs() / size.element_product();
                    return Voxels { solid: Solid::Box(share), bounds, lines: 1 };
                }
                Voxels::ellipsoid(from_unit)
            }
            Solid::Box(share) => Voxels { solid: Solid::Box(share), bounds, lines: 1 },
            Solid::Grid(grid, turn) => {
                let world = turn * DAffine3::from_translation(anchor) * DAffine3::from_scale(DVec3::splat(size));
                // As many points a voxel as it has samples along an edge, and where the lattices agree the samples themselves.
                let lines = (size / grid.voxel_size()).ceil().clamp(1.0, 16.0) as i32;
                Voxels { solid: Solid::Grid(grid, world), bounds: Bounds { min: bounds.min - 1.0, max: bounds.max + 1.0 }, lines }
            }
            Solid::Mesh { mut mesh, .. } => {
                mesh.vertices.iter_mut().for_each(|v| *v = index(*v));
                let triangles = TriMesh::new(&[&mesh], bounds.centre());
                let lines = (32.0 / bounds.size().min_element()).ceil().clamp(4.0, 96.0) as i32;
                Voxels { bounds, lines, solid: Solid::Mesh { mesh: Mesh::default(), triangles } }
            }
        }
    }

    /// The origins of all bricks that the bounds meet.
    fn bricks(&self, mut visit: impl FnMut([i32; 3])) {
        let side = f64::from(BRICK_SIDE);
        let (from, to) = ((self.bounds.min / side).floor().as_ivec3(), (self.bounds.max / side).floor().as_ivec3());
        for x in from.x..=to.x {
            for y in from.y..=to.y {
                for z in from.z..=to.z {
                    let origin = IVec3::new(x, y, z) * BRICK_SIDE;
                    if self.meets(origin) {
                        visit(origin.to_array());
                    }
                }
            }
        }
    }

    fn unit_distance(&self, origin: IVec3) -> Option<(f64, f64)> {
        let Solid::Ellipsoid { to_unit, reach, .. } = &self.solid else { return None };
        let centre = origin.as_dvec3() + f64::from(BRICK_SIDE) * 0.5;
        Some((to_unit.transform_point3(centre).length(), *reach))
    }

    fn meets(&self, origin: IVec3) -> bool {
        self.unit_distance(origin).is_none_or(|(distance, reach)| distance <= 1.0 + reach)
    }

    /// Adds `weight` times the covered share of each voxel of the brick.
    fn cover(&self, origin: [i32; 3], weight: f64, sum: &mut [f64; BRICK_VOXELS]) {
        let origin = IVec3::from_array(origin);
        if self.unit_distance(origin).is_some_and(|(distance, reach)| distance + reach <= 1.0) {
            sum.iter_mut().for_each(|v| *v += weight);
            return;
        }
        let base = origin.as_dvec3();
        if let Solid::Grid(grid, world) = &self.solid {
            let (k, share) = (self.lines, weight / f64::from(self.lines.pow(3)));
            for (voxel, value) in sum.iter_mut().enumerate() {
                let corner = base + DVec3::new((voxel >> 6) as f64, (voxel >> 3 & 7) as f64, (voxel & 7) as f64);
                for i in 0..k.pow(3) {
                    let part = (DVec3::new(f64::from(i / k / k), f64::from(i / k % k), f64::from(i % k)) + 0.5) / f64::from(k);
                    *value += share * grid.density(world.transform_point3(corner + part));
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
fn overlap(from: f64, low: f64, high: f64) -> f64 {
    ((from + 1.0).min(high) - from.max(low)).max(0.0)
}

/// Adds `weight` times the overlap of [from, to] with each of the 8 voxels of a column that starts at 0.
fn add(column: &mut [f64], weight: f64, from: f64, to: f64) {
    let (from, to) = (from.max(0.0), to.min(8.0));
    if from >= to {
        return;
    }
    let (first, last) = (from as usize, (to.ceil() as usize - 1).min(7));
    for (z, value) in column.iter_mut().enumerate().take(last + 1).skip(first) {
        *value += weight * overlap(z as f64, from, to);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;
    use crate::scene::Medium;
    use glam::{DQuat, DVec2};

    fn region(shape: Shape, sigma_t: f64) -> Region {
        Region { name: String::new(), shape, medium: Medium::with_albedo(sigma_t, 1.0, 0.0), photons: None }
    }

    fn shapes() -> Vec<(&'static str, Region)> {
        let turned =
            DMat3::from_quat(DQuat::from_rotation_x(0.7) * DQuat::from_rotation_z(0.4)) * DMat3::from_diagonal(DVec3::new(1.0, 0.4, 0.7));
        let tetra = Mesh {
            vertices: [[0.0, 0.0, 0.0], [1.1, 0.1, 0.0], [0.2, 1.3, 0.1], [0.1, 0.2, 0.9]].map(DVec3::from_array).to_vec(),
            triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]],
        };
        vec![
            ("sphere", region(Shape::sphere(DVec3::new(0.3, -7.1, 2.2), 1.0), 3.0)),
            ("ellipsoid", region(Shape::Ellipsoid { world_from_unit: DAffine3 { matrix3: turned, translation: DVec3::splat(5.0) } }, 2.0)),
            ("slab", region(Shape::Slab { centre: DVec3::new(0.2, 0.1, 0.4), half_height: 0.33, half_extent: DVec2::new(1.0, 1.7) }, 4.0)),
            ("mesh", region(Shape::Mesh(std::sync::Arc::new(tetra)), 5.0)),
            ("far away", region(Shape::sphere(DVec3::splat(1e7), 1.0), 3.0)),
        ]
    }

    #[test]
    fn the_integral_is_the_optical_mass_at_every_voxel_size() {
        for (name, region) in shapes() {
            for size in [0.5, 0.2, 0.07] {
                for up in [Up::Z, Up::Y] {
                    let grid = voxelise(std::slice::from_ref(&region), size, 2.0, up, &Silent).unwrap();
                    let ratio = grid.integral() * 2.0 / region.optical_mass();
                    assert!((ratio - 1.0).abs() < 2e-3, "{name} at {size}: {ratio}");
                    assert!(grid.values.iter().all(|&v| (0.0..=region.medium.sigma_t() as f32 / 2.0 * 1.000_01).contains(&v)));
                }
            }
        }
    }

    #[test]
    fn the_centroid_is_the_shapes_own() {
        for (name, region) in shapes().into_iter().filter(|s| s.0 != "mesh") {
            for (up, centre) in [
                (Up::Z, region.shape.centre()),
                (Up::Y, {
                    let c = region.shape.centre();
                    DVec3::new(c.x, c.z, -c.y)
                }),
            ] {
                let grid = voxelise(std::slice::from_ref(&region), 0.2, 1.0, up, &Silent).unwrap();
                let mut sum = DVec3::ZERO;
                for (i, &value) in grid.values.iter().enumerate() {
                    sum += (grid.position(i / BRICK_VOXELS, i % BRICK_VOXELS) - centre) * f64::from(value);
                }
                let offset = sum * grid.voxel_volume() / region.optical_mass();
                assert!(offset.length() < 0.01, "{name}: {offset}");
            }
        }
    }

    #[test]
    fn coverage_equals_counting_points() {
        // The slow twin: 20^3 points a voxel, inside or not.
        let region = region(Shape::sphere(DVec3::new(0.31, 0.12, 0.53), 0.9), 1.0);
        let grid = voxelise(std::slice::from_ref(&region), 0.3, 1.0, Up::Z, &Silent).unwrap();
        for (i, &value) in grid.values.iter().enumerate() {
            let centre = grid.position(i / BRICK_VOXELS, i % BRICK_VOXELS);
            let n = 20;
            let inside = (0..n * n * n).filter(|j| {
                let at = |k: i32| (f64::from(k) + 0.5) / f64::from(n) - 0.5;
                let p = centre + DVec3::new(at(j % n), at(j / n % n), at(j / n / n)) * 0.3;
                (p - region.shape.centre()).length() < 0.9
            });
            let share = inside.count() as f64 / f64::from(n * n * n);
            assert!((share - f64::from(value)).abs() < 0.02, "{share} {value}");
        }
    }

    #[test]
    fn overlaps_add() {
        let parts: Vec<Region> = shapes().into_iter().take(4).map(|s| s.1).collect();
        let whole: f64 = parts.iter().map(Region::optical_mass).sum();
        let doubled: Vec<Region> = parts.iter().chain(&parts).cloned().collect();
        let grid = voxelise(&doubled, 0.11, 1.0, Up::Z, &Silent).unwrap();
        assert!((grid.integral() / (2.0 * whole) - 1.0).abs() < 2e-3);
        assert!(grid.origins.is_sorted());
    }

    #[test]
    fn the_voxel_size_fits_or_is_refused_with_one_that_does() {
        let regions = vec![region(Shape::sphere(DVec3::ZERO, 1.0), 1.0)];
        assert_eq!(voxel_size(&regions, None, 1 << 24).unwrap(), (2.0 / 128.0, false));
        let (coarse, coarsened) = voxel_size(&regions, None, 40).unwrap();
        assert!(coarsened && active_voxels(&regions, coarse) <= 40.0);
        let Err(Error::TooManyVoxels { fitting, .. }) = voxel_size(&regions, Some(0.001), 100_000) else { panic!() };
        assert_eq!(voxel_size(&regions, Some(fitting), 100_000).unwrap(), (fitting, false));
        let grid = voxelise(&regions, fitting, 1.0, Up::Z, &Silent).unwrap();
        assert!(grid.active_voxels() <= 110_000 && grid.active_voxels() > 60_000, "{}", grid.active_voxels());
    }
}
