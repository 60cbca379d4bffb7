//! Nodes that name a VDB: its grids are regions, placed by the node.

use super::{
    Became,
    at::At,
    buffers::scheme,
    build::Builder,
    fire::{self, FireSpec},
    gltf::Thing,
    medium::MediumSpec,
    mesh::FARTHEST,
    region,
    vdb::{self, DENSITY, Facts},
    walk::Z_UP,
};
use crate::{
    Error, Result,
    scene::{BrickGrid, Shape, VoxelGrid},
    sculpt::Solid,
    vdb::{GridInfo, VdbFile},
};
use glam::DAffine3;
use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

const FILE: &str = "extras.cloudvdb.file";
const GRID: &str = "extras.cloudvdb.grid";

impl Builder<'_> {
    /// Makes regions of the float grids of the node's VDB that have the name it says.
    pub fn volume(&mut self, thing: &Thing) -> Result<()> {
        let Thing { at, world, spec, .. } = *thing;
        if thing.mesh.is_some() {
            let fix = "Put it on an object of its own: a volume, or an empty";
            return Err(at.error("extras.cloudvdb.shape", "\"vdb\" on a node with a mesh", "a node without one", fix));
        }
        region::check_zero(&world, at)?;
        let spelt = spec.file.as_deref().unwrap_or_default();
        let path = named(self.file, spelt, at, (FILE, "the path of an OpenVDB file"))?;
        let of_node = |error: Error| at_node(error, spelt, at);
        let file = VdbFile::open(&path).map_err(of_node)?;
        let name = spec.grid.as_deref().unwrap_or(DENSITY);
        let picked: Vec<(usize, &GridInfo)> =
            file.grids().iter().enumerate().filter(|(_, info)| info.name == name && info.value_type == "float").collect();
        if picked.is_empty() {
            return Err(no_grid(&file, name, spelt, at));
        }
        let facts = Facts::of(file.metadata());
        let mut remarks = facts.remarks.clone();
        let mut found = Vec::new();
        for (index, info) in picked {
            if let Some(grid) = vdb::voxels(&path, &file, index, info, &mut remarks).map_err(of_node)? {
                found.push((Arc::new(placed(grid, &world, at)?), MediumSpec::known(vdb::scale(info), facts.albedo, facts.g)));
            }
        }
        self.notes.extend(remarks.into_iter().map(|remark| format!("{at}, {spelt:?}: {remark}")));
        if found.is_empty() {
            let fix = "Write the VDB again with something in it, or name another of its grids";
            return Err(at.error(GRID, format!("{name:?}, which is empty in {spelt:?}"), "a grid with active voxels other than 0", fix));
        }
        let within: Vec<Arc<VoxelGrid>> = found.iter().map(|(grid, _)| Arc::clone(grid)).collect();
        let shining = self.shining(spec);
        let fire = FireSpec {
            emission: spec.emission_grid.clone().zip(shining.emission),
            temperature: spec.temperature_grid.clone().zip(shining.temperature),
            soot: shining.soot,
        };
        let lacks = |grid: &Option<String>, value: bool| grid.is_some() && !value;
        if lacks(&spec.emission_grid, shining.emission.is_some()) {
            return Err(unsaid("emission", at));
        }
        if lacks(&spec.temperature_grid, shining.temperature.is_some()) {
            return Err(unsaid("temperature", at));
        }
        let mut embers = fire::embers((&path, &file), &fire, &within, |grid| placed(grid, &world, at), &mut self.notes).map_err(of_node)?;
        embers.iter_mut().for_each(|ember| ember.name = at.name());
        self.embers.extend(embers);
        let many = found.len() > 1;
        for (number, (grid, medium)) in found.into_iter().enumerate() {
            let region = if many { format!("{}[{number}]", at.name()) } else { at.name() };
            self.region(region, Solid::Shape(Shape::Grid(grid)), spec, &medium);
        }
        if !self.volumes.iter().any(|(known, _)| *known == path) {
            let hash = vdb::hash(&path).map_err(of_node)?;
            self.volumes.push((path, hash));
        }
        self.found(at.name(), Became::Region, format!("its extras name the VDB {spelt:?}, grid {name:?}"));
        Ok(())
    }
}

/// The error of a node that names a grid which shines, and not how much.
fn unsaid(key: &str, at: At) -> Error {
    let fix = format!("Add \"{key}\" to the custom property `cloudvdb`: what a sample of 1 of that grid stands for");
    at.error(format!("extras.cloudvdb.{key}"), "missing, though a grid is named for it", "a number above 0", fix)
}

/// The path of a file that a glTF file names: relative ones begin in its folder. With the key that names it, and what it is.
pub(super) fn named(layout: &Path, spelt: &str, at: At, (key, what): (&str, &str)) -> Result<PathBuf> {
    let wrong = |found: String, fix: &str| Err(at.error(key, found, format!("{what}, from the folder of the glTF file"), fix));
    if spelt.trim().is_empty() {
        return wrong("missing".into(), "Name the file in the custom property `cloudvdb`, as in \"file\": \"smoke.vdb\"");
    }
    if let Some(scheme) = scheme(spelt).filter(|scheme| scheme.len() > 1) {
        return wrong(format!("{spelt:?}, a URL ({scheme}:)"), "Copy the file beside the glTF file and name it by its path");
    }
    if spelt.starts_with("//") {
        let fix = "Name it from the folder of the glTF file, without the slashes";
        return wrong(format!("{spelt:?}, a path from the folder of a .blend file"), fix);
    }
    let path = layout.parent().unwrap_or(Path::new("")).join(spelt);
    match std::fs::metadata(&path) {
        Ok(about) if about.is_file() => Ok(path),
        Ok(_) => wrong(format!("{spelt:?}, which is no file"), "Name the file itself"),
        Err(error) => wrong(
            format!("{spelt:?}, which cannot be read as {} ({error})", path.display()),
            "Put the file there, or name it by its path from there",
        ),
    }
}

/// An error of the VDB as one of the node that names it.
fn at_node(error: Error, spelt: &str, at: At) -> Error {
    const WHAT: &str = "an OpenVDB file with a grid of densities";
    match error {
        Error::File { reason, fix, .. } => at.error(FILE, format!("{spelt:?}: {reason}"), WHAT, fix),
        Error::Vdb { message, .. } => {
            at.error(FILE, format!("{spelt:?}, of which OpenVDB says: {message}"), WHAT, "Name another, or write it again")
        }
        other => other,
    }
}

fn no_grid(file: &VdbFile, name: &str, spelt: &str, at: At) -> Error {
    let grids: Vec<String> = file.grids().iter().map(|info| format!("{:?} ({})", info.name, info.value_type)).collect();
    let there = if grids.is_empty() { "no grid at all".into() } else { grids.join(", ") };
    let found = format!("{name:?}, and {spelt:?} has {there}");
    at.error(GRID, found, "the name of a float grid in that file", "Say \"grid\": \"...\" in the custom property `cloudvdb`")
}

/// The grid where the node puts it. A VDB lies in Blender's object space, Z up, and a node's own space is Y up.
fn placed(grid: VoxelGrid, world: &DAffine3, at: At) -> Result<VoxelGrid> {
    let VoxelGrid { bricks, min, max, .. } = grid;
    let world_from_index = *world * Z_UP.inverse() * bricks.world_from_index;
    if !world_from_index.to_cols_array().iter().all(|v| v.abs() <= FARTHEST) {
        let found = format!("such that its grid is beyond {FARTHEST:e} m");
        return Err(at.error("world transform", found, "finite", "Correct the scales and locations of it and of its parents"));
    }
    Ok(VoxelGrid::new(BrickGrid { world_from_index, ..bricks }, min, max, false))
}
