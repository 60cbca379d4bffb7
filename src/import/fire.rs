//! What shines by itself: the emission and the temperatures that nodes and flags give to regions and grids.

use super::{
    medium::Shining,
    vdb::{self, is_picked},
};
use crate::{
    Error, Result,
    scene::{BrickGrid, Flame, Region, Scene, Shape, VoxelGrid, black_body::black_body},
    vdb::VdbFile,
};
use rayon::prelude::*;
use std::{path::Path, sync::Arc};

/// What `--emission`, `--temperature` and `--soot` say of the grids of a `.vdb`.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FireSpec {
    /// A grid's name, and what a sample of 1 emits, W m^-3 sr^-1, RGB.
    pub emission: Option<(String, [f64; 3])>,
    /// A grid's name, and the temperature of a sample of 1, K.
    pub temperature: Option<(String, f64)>,
    /// The absorption coefficient of what glows there, 1/m; `None` takes the medium's own.
    pub soot: Option<f64>,
}

/// What shines, before media are settled: a hot medium emits as much as it absorbs.
#[derive(Debug, Clone)]
pub(crate) struct Ember {
    pub name: String,
    pub shining: Shining,
    pub place: Place,
}

/// Where something shines.
#[derive(Debug, Clone)]
pub(crate) enum Place {
    /// In the region of that number, as much as it is dense.
    Region(usize),
    /// By the samples of a grid; of which densities heat makes glow.
    Grid { grid: Arc<VoxelGrid>, within: Vec<Arc<VoxelGrid>> },
}

/// Reads the grids of a VDB that are to shine; `within` are its densities, `place` moves a grid to where the file stands.
pub(super) fn embers(
    (path, file): (&Path, &VdbFile),
    fire: &FireSpec,
    within: &[Arc<VoxelGrid>],
    place: impl Fn(VoxelGrid) -> Result<VoxelGrid>,
    notes: &mut Vec<String>,
) -> Result<Vec<Ember>> {
    let emission = fire.emission.as_ref().map(|(name, rgb)| (name, Shining { emission: Some(*rgb), ..Shining::default() }));
    let heat = |(name, kelvin)| (name, Shining { temperature: Some(kelvin), soot: fire.soot, ..Shining::default() });
    let heat = fire.temperature.as_ref().map(|(name, kelvin)| heat((name, *kelvin)));
    let mut embers = Vec::new();
    for (name, shining) in emission.into_iter().chain(heat) {
        let mut any = false;
        for (index, info) in file.grids().iter().enumerate().filter(|(_, info)| is_picked(info, name)) {
            any = true;
            if let Some(grid) = vdb::voxels(path, file, index, info, notes)? {
                let place = Place::Grid { grid: Arc::new(place(grid)?), within: within.to_vec() };
                embers.push(Ember { name: name.clone(), shining, place });
            }
        }
        if !any {
            // The sentence that lists the names.
            file.read_float(name)?;
        }
        if embers.is_empty() {
            notes.push(format!("The grid {name:?} is empty: nothing shines."));
        }
    }
    Ok(embers)
}

/// Makes flames of embers, now that media are what they stay, and repeated or not.
///
/// # Errors
/// [`Error::Scene`] where something shines without end.
pub(super) fn kindle(embers: &[Ember], periodic: bool, scene: &mut Scene) -> Result<()> {
    for Ember { name, shining, place } in embers {
        match place {
            Place::Region(number) => {
                let Some(region) = scene.regions.get(*number) else { continue };
                let sigma_a = shining.soot.map_or(region.medium.sigma_a, |soot| [soot; 3]);
                let heat = shining.temperature.map_or([0.0; 3], black_body);
                let emission = shining.emission.unwrap_or([0.0; 3]);
                let emission = std::array::from_fn(|c| emission[c] + sigma_a[c] * heat[c]);
                scene.flames.push(Flame { name: name.clone(), shape: region.shape.clone(), emission });
            }
            Place::Grid { grid, within } => {
                if let Some(emission) = shining.emission {
                    scene.flames.push(Flame { name: name.clone(), shape: Shape::Grid(Arc::clone(grid)), emission });
                }
                if let Some(kelvin) = shining.temperature {
                    let of = |region: &&Region| matches!(&region.shape, Shape::Grid(g) if within.iter().any(|w| same(w, g)));
                    let media: Vec<&Region> = scene.regions.iter().filter(of).collect();
                    let flames = hot(name, grid, kelvin, shining.soot, &media);
                    scene.flames.extend(flames);
                }
            }
        }
    }
    scene.flames.retain(|flame| flame.emission.iter().any(|&e| e > 0.0));
    if let Some(flame) = scene.flames.iter().find(|f| periodic || f.shape.is_endless()) {
        return Err(Error::Scene {
            reason: format!("{:?} shines and goes on without end: its light would have no bound", flame.name),
            fix: "Take its emission or temperature away, or give it an end (no slab, no --periodic)".into(),
        });
    }
    Ok(())
}

/// Whether two grids are one, repeated or not.
fn same(a: &Arc<VoxelGrid>, b: &Arc<VoxelGrid>) -> bool {
    Arc::ptr_eq(a, b) || (a.bricks.origins == b.bricks.origins && a.bricks.values == b.bricks.values)
}

/// What a grid of temperatures emits, sample by sample: its absorption times a black body's radiance (Kirchhoff), in three grids.
fn hot(name: &str, grid: &VoxelGrid, kelvin: f64, soot: Option<f64>, media: &[&Region]) -> Vec<Flame> {
    let side = crate::scene::density::BRICK_VOXELS;
    let sample = |(i, &value): (usize, &f32)| {
        if value <= 0.0 {
            return [0.0; 3];
        }
        let sigma_a = soot.map_or_else(
            || {
                let p = grid.bricks.position(i / side, i % side);
                media.iter().fold([0.0; 3], |sum, region| {
                    let Shape::Grid(density) = &region.shape else { return sum };
                    let density = density.density(p);
                    std::array::from_fn(|c| sum[c] + region.medium.sigma_a[c] * density)
                })
            },
            |soot| [soot; 3],
        );
        if sigma_a == [0.0; 3] {
            return [0.0; 3];
        }
        let light = black_body(kelvin * f64::from(value));
        std::array::from_fn(|c| sigma_a[c] * light[c])
    };
    let samples: Vec<[f64; 3]> = grid.bricks.values.par_iter().enumerate().map(sample).collect();
    let channel = |c: usize| {
        let most = samples.iter().map(|rgb| rgb[c]).fold(0.0, f64::max);
        let values = samples.iter().map(|rgb| (rgb[c] / most) as f32).collect();
        let bricks = || BrickGrid { world_from_index: grid.bricks.world_from_index, origins: grid.bricks.origins.clone(), values };
        let emission = std::array::from_fn(|i| if i == c { most } else { 0.0 });
        let shape = || Shape::Grid(Arc::new(VoxelGrid::new(bricks(), grid.min, grid.max, false)));
        (most > 0.0).then(|| Flame { name: name.to_owned(), shape: shape(), emission })
    };
    (0..3).filter_map(channel).collect()
}
