//! Voxel grids written in their own lattice: where all regions are samples on one, nothing is resampled.

use crate::error::Result;
use crate::progress::Progress;
use crate::scene::density::{BRICK_SIDE, BRICK_VOXELS};
use crate::scene::{BrickGrid, Region, Shape, VoxelGrid};
use crate::voxelise::Up;
use glam::{DAffine3, DMat3, DVec3};
use rayon::prelude::*;
use std::sync::Arc;

/// How far a sample may lie from one of the other lattice, in samples: what single precision leaves of a transform.
const ASTRAY: f64 = 1e-3;
/// How far two lengths of a voxel's edge may differ and be the same, relatively.
const SAME: f64 = 1e-6;
/// Indices are 32-bit, and so are differences of them.
const FARTHEST_INDEX: f64 = (1 << 30) as f64;

/// A grid that is ready to be written.
#[derive(Debug, Clone)]
pub enum Ready {
    /// Made for the file.
    Own(BrickGrid),
    /// A region's own samples, as they were read.
    Shared(Arc<VoxelGrid>),
}

impl Ready {
    /// The samples.
    pub fn bricks(&self) -> &BrickGrid {
        match self {
            Ready::Own(bricks) => bricks,
            Ready::Shared(grid) => &grid.bricks,
        }
    }
}

/// A region's samples on the lattice of the first region.
struct Layer<'a> {
    grid: &'a Arc<VoxelGrid>,
    /// What a sample is multiplied by.
    weight: f64,
    /// What is added to its index.
    shift: [i32; 3],
}

/// The regions' extinction in units of `density_scale` per metre, in the lattice of their own samples; and the shortest edge of a
/// voxel, m. `None` where not all are voxel grids on one lattice, where voxels of another size are `asked` for, or where more
/// than `max_voxels` would be active.
///
/// # Errors
/// [`crate::Error::Interrupted`].
pub fn merge(
    regions: &[Region],
    asked: Option<f64>,
    max_voxels: u64,
    density_scale: f64,
    up: Up,
    progress: &dyn Progress,
) -> Result<Option<(Ready, f64)>> {
    let Some(layers) = layers(regions, density_scale) else { return Ok(None) };
    let Some(first) = layers.first().map(|layer| layer.grid) else { return Ok(None) };
    let world = first.bricks.world_from_index;
    let edges = [world.matrix3.x_axis, world.matrix3.y_axis, world.matrix3.z_axis].map(DVec3::length);
    if asked.is_some_and(|size| edges.iter().any(|edge| (edge - size).abs() > SAME * size)) {
        return Ok(None);
    }
    let whole = matches!(layers.as_slice(), [only] if only.weight == 1.0);
    let ready = if whole && up == Up::Z {
        Ready::Shared(Arc::clone(first))
    } else if whole {
        Ready::Own(BrickGrid { world_from_index: turned(world, up), ..first.bricks.clone() })
    } else {
        Ready::Own(sum(&layers, turned(world, up), progress)?)
    };
    let fits = ready.bricks().active_voxels() <= max_voxels;
    Ok(fits.then(|| (ready, first.voxel_size())))
}

/// What turns the world until this axis is up; `None` where it is.
pub fn turn(up: Up) -> Option<DAffine3> {
    match up {
        Up::Z => None,
        // (x, y, z) -> (x, z, -y): what was up along z is up along y.
        Up::Y => Some(DAffine3::from_mat3(DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y))),
    }
}

/// The transform with this axis up.
fn turned(world: DAffine3, up: Up) -> DAffine3 {
    turn(up).map_or(world, |turn| turn * world)
}

/// The regions' grids on the lattice of the first; `None` where one is no grid, or lies between its samples.
fn layers(regions: &[Region], density_scale: f64) -> Option<Vec<Layer<'_>>> {
    let grids: Option<Vec<_>> =
        regions.iter().map(|region| if let Shape::Grid(grid) = &region.shape { Some((grid, region)) } else { None }).collect();
    let grids = grids?;
    let to_index = grids.first()?.0.bricks.world_from_index.inverse();
    let mut layers = Vec::with_capacity(grids.len());
    for (grid, region) in grids {
        let across = to_index * grid.bricks.world_from_index;
        // Where the first of its samples comes to lie; the others must follow.
        let shift = (across.transform_point3(corner(grid, 0)) - corner(grid, 0)).round();
        let stays = (0..8).map(|i| corner(grid, i)).all(|c| {
            (across.transform_point3(c) - shift - c).abs().max_element() < ASTRAY && (c + shift).abs().max_element() < FARTHEST_INDEX
        });
        if !stays {
            return None;
        }
        let weight = if density_scale > 0.0 { region.medium.sigma_t() / density_scale } else { 0.0 };
        layers.push(Layer { grid, weight, shift: shift.as_ivec3().to_array() });
    }
    Some(layers)
}

/// A corner of the box of the samples that count, as an index.
fn corner(grid: &VoxelGrid, i: usize) -> DVec3 {
    DVec3::from_array(std::array::from_fn(|a| f64::from(if i >> a & 1 == 1 { grid.max[a] } else { grid.min[a] })))
}

/// The weighted sum of the layers.
fn sum(layers: &[Layer], world_from_index: DAffine3, progress: &dyn Progress) -> Result<BrickGrid> {
    // A brick of the sum, and which brick of which layer meets it.
    let mut meetings: Vec<([i32; 3], u32, u32)> = Vec::new();
    for (l, layer) in layers.iter().enumerate().filter(|(_, layer)| layer.weight > 0.0) {
        let within = layer.shift.map(|s| s.rem_euclid(BRICK_SIDE));
        for (b, origin) in layer.grid.bricks.origins.iter().enumerate() {
            let first: [i32; 3] = std::array::from_fn(|a| origin[a] + layer.shift[a] - within[a]);
            for i in 0..8usize {
                let next: [bool; 3] = std::array::from_fn(|a| i >> a & 1 == 1);
                // A brick that is not shifted by whole bricks meets the next along that axis too.
                if (0..3).all(|a| !next[a] || within[a] > 0) {
                    let at = std::array::from_fn(|a| first[a] + if next[a] { BRICK_SIDE } else { 0 });
                    meetings.push((at, l as u32, b as u32));
                }
            }
        }
    }
    progress.check()?;
    meetings.par_sort_unstable();
    let groups: Vec<&[([i32; 3], u32, u32)]> = meetings.chunk_by(|a, b| a.0 == b.0).collect();
    let filled: Vec<Option<Box<[f32; BRICK_VOXELS]>>> = groups
        .par_iter()
        .map(|group| {
            let mut total = [0.0f64; BRICK_VOXELS];
            for &(at, l, b) in *group {
                add(&layers[l as usize], b as usize, at, &mut total);
            }
            total.iter().any(|&v| v > 0.0).then(|| Box::new(total.map(|v| v as f32)))
        })
        .collect();
    progress.check()?;
    let mut grid = BrickGrid { world_from_index, origins: Vec::new(), values: Vec::new() };
    for (group, values) in groups.iter().zip(filled) {
        if let Some(values) = values {
            grid.origins.push(group[0].0);
            grid.values.extend_from_slice(&values[..]);
        }
    }
    Ok(grid)
}

/// Adds what brick `b` of a layer has within the brick at `at`.
fn add(layer: &Layer, b: usize, at: [i32; 3], total: &mut [f64; BRICK_VOXELS]) {
    let origin = layer.grid.bricks.origins[b];
    let samples = layer.grid.bricks.brick(b);
    let off: [i32; 3] = std::array::from_fn(|a| origin[a] + layer.shift[a] - at[a]);
    let along = |a: usize| off[a].max(0)..(off[a] + BRICK_SIDE).min(BRICK_SIDE);
    for x in along(0) {
        for y in along(1) {
            for z in along(2) {
                let (to, from) = (x << 6 | y << 3 | z, (x - off[0]) << 6 | (y - off[1]) << 3 | (z - off[2]));
                total[to as usize] += layer.weight * f64::from(samples[from as usize]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;
    use crate::scene::Medium;

    /// Samples that differ, from index `min` on.
    fn grid(world_from_index: DAffine3, min: [i32; 3], seed: u32) -> VoxelGrid {
        let origins: Vec<[i32; 3]> = vec![min, [min[0], min[1], min[2] + 16], [min[0] + 8, min[1], min[2]]];
        let values = (0..3 * BRICK_VOXELS as u32).map(|i| ((i * 31 + seed) % 97) as f32 / 7.0).collect();
        let max = [min[0] + 15, min[1] + 7, min[2] + 23];
        VoxelGrid::new(BrickGrid { world_from_index, origins, values }, min, max, false)
    }

    fn region(grid: VoxelGrid, sigma_t: f64) -> Region {
        Region { name: "r".into(), shape: Shape::Grid(Arc::new(grid)), medium: Medium::with_albedo(sigma_t, 0.9, 0.5), photons: None }
    }

    fn merged(regions: &[Region], asked: Option<f64>, up: Up) -> Option<(Ready, f64)> {
        let scale = regions.iter().map(|r| r.medium.sigma_t()).fold(0.0, f64::max);
        merge(regions, asked, 1 << 20, scale, up, &Silent).unwrap()
    }

    /// Rotated, and other voxels along each axis.
    fn leaning() -> DAffine3 {
        let turn = glam::DQuat::from_euler(glam::EulerRot::XYZ, 0.4, -0.7, 1.1);
        DAffine3::from_scale_rotation_translation(DVec3::new(0.1, 0.25, 0.4), turn, DVec3::new(5e3, -7e3, 3.3))
    }

    #[test]
    fn one_grid_is_its_own_samples_and_no_copy() {
        let far = 1 << 20;
        let one = [region(grid(leaning(), [far, -far, 8], 0), 3.0)];
        let Shape::Grid(own) = &one[0].shape else { panic!() };
        let (ready, edge) = merged(&one, None, Up::Z).unwrap();
        assert!(matches!(&ready, Ready::Shared(grid) if Arc::ptr_eq(grid, own)) && (edge - 0.1).abs() < 1e-12);
        let (ready, _) = merged(&one, None, Up::Y).unwrap();
        assert_eq!(ready.bricks().values, own.bricks.values);
        let (z, y) = (own.bricks.position(1, 77), ready.bricks().position(1, 77));
        assert!((y - DVec3::new(z.x, z.z, -z.y)).length() < 1e-9);
        // Voxels of 0.1 m are not these, which are so along one axis only.
        assert!(merged(&one, Some(0.1), Up::Z).is_none());
        let cubes = [region(grid(DAffine3::from_scale(DVec3::splat(0.1)), [0; 3], 0), 3.0)];
        assert!(merged(&cubes, Some(0.1), Up::Z).is_some() && merged(&cubes, Some(0.2), Up::Z).is_none());
        assert!(merge(&cubes, None, 100, 3.0, Up::Z, &Silent).unwrap().is_none(), "too many voxels");
    }

    #[test]
    fn grids_on_one_lattice_add_wherever_their_indices_begin() {
        for shift in [[0, 0, 0], [8, -16, 0], [3, -5, 8], [-1, 7, 13]] {
            let moved = leaning() * DAffine3::from_translation(DVec3::from_array(shift.map(f64::from)));
            let (a, b) = (grid(leaning(), [0, -8, 16], 0), grid(moved, [-8, 0, 16], 40));
            let (ready, _) = merged(&[region(a.clone(), 2.0), region(b.clone(), 1.0)], None, Up::Z).unwrap();
            let sum = ready.bricks();
            assert!(sum.origins.is_sorted() && sum.origins.windows(2).all(|w| w[0] != w[1]));
            assert!((sum.integral() - (a.integral() + 0.5 * b.integral())).abs() < 1e-6 * sum.integral());
            for x in -20..30 {
                for (y, z) in (-20..20).flat_map(|y| (0..60).map(move |z| (y, z))) {
                    let there = [x - shift[0], y - shift[1], z - shift[2]];
                    let expected = a.sample([x, y, z]) + 0.5 * b.sample(there);
                    assert!((sum.at([x, y, z]) - expected).abs() < 1e-5, "{shift:?} {x} {y} {z}");
                }
            }
        }
    }

    #[test]
    fn other_lattices_and_other_shapes_are_left_to_resampling() {
        let a = || region(grid(leaning(), [0; 3], 0), 2.0);
        let between = leaning() * DAffine3::from_translation(DVec3::new(0.5, 0.0, 0.0));
        let finer = leaning() * DAffine3::from_scale(DVec3::new(1.0, 1.0, 0.999));
        for other in [between, finer] {
            assert!(merged(&[a(), region(grid(other, [0; 3], 0), 2.0)], None, Up::Z).is_none());
        }
        let ball = Region { shape: Shape::sphere(DVec3::ZERO, 1.0), ..a() };
        assert!(merged(&[a(), ball], None, Up::Z).is_none() && merged(&[], None, Up::Z).is_none());
    }
}
