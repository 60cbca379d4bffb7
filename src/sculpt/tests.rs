//! Sculptures against closed forms, Blender's own surfaces, and themselves.

use super::*;
use crate::progress::Silent;
use crate::rng::{Rng, Stage};
use crate::scene::{Medium, Region};
use crate::voxelise::{Up, voxelise};
use glam::{DAffine3, DMat3, DQuat, DVec2};

mod detail;
mod metaballs;
mod parts;

fn even(shape: Shape) -> Part {
    Part::new(Solid::Shape(shape))
}

fn of(parts: Vec<Part>, detail: Option<Detail>) -> Sculpture {
    Sculpture { parts, detail, tile: None }
}

fn voxels(sculpture: &Sculpture, size: f64) -> VoxelGrid {
    sculpture.voxels(size, &no_meshes, &Silent).unwrap()
}

fn detail(genus: Genus, strength: f64, size: f64) -> Detail {
    Detail { genus, strength, size, octaves: 5, seed: 3 }
}
