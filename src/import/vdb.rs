//! A bare OpenVDB file as a scene: its density grids are regions, its metadata says what cloudvdb knew of media and sun.

use super::{
    Became, Finding, ImportOptions, Layout,
    at::file_error,
    fire::{self, FireSpec},
    medium::{ALBEDO, DEPTH, G},
    mesh::FARTHEST,
};
use crate::{
    Error, Result,
    scene::density::BRICK_VOXELS,
    scene::{BrickGrid, Medium, Region, Scene, Shape, Sun, VoxelGrid},
    vdb::{Carried, FloatGrid, GridInfo, Meta, VdbFile},
};
use glam::DVec3;
use rayon::prelude::*;
use sha2::{Digest, Sha256};
use std::{fmt::Write, io::Read, path::Path, sync::Arc};

/// The name of the grids that are regions, where nobody says another.
pub(super) const DENSITY: &str = "density";
/// The most voxels along a side of the box of active ones: rays find their place in it in single precision.
const LONGEST: i64 = 1 << 17;
/// The most nodes of 64^3 voxels in that box: rays find them by a table of all.
const MOST_NODES: i64 = 1 << 24;
/// Indices are 32-bit, and so are differences of them.
const FARTHEST_INDEX: i64 = 1 << 30;

/// Reads every float grid of the name asked for as a region, and meanwhile the file's hash.
pub(super) fn layout(path: &Path, options: &ImportOptions) -> Result<Layout> {
    let (layout, source_hash) = rayon::join(|| regions(path, options), || hash(path));
    let layout = layout?;
    Ok(Layout { source_hash: source_hash?, ..layout })
}

/// The layout but for its hash.
fn regions(path: &Path, options: &ImportOptions) -> Result<Layout> {
    if options.regions.is_some() || options.mesh_volumes {
        return Err(Error::Usage(format!(
            "{}: --regions and --mesh-volumes pick among meshes, and a .vdb has none; --grid NAME picks its grids",
            path.display()
        )));
    }
    let file = VdbFile::open(path)?;
    let name = name(options);
    let picked = |info: &GridInfo| is_picked(info, name);
    let many = file.grids().iter().filter(|info| picked(info)).count() > 1;
    let facts = Facts::of(file.metadata());
    let (mut scene, mut findings, mut notes) = (Scene::default(), Vec::new(), facts.remarks.clone());
    let mut open = Vec::new();
    for (index, info) in file.grids().iter().enumerate() {
        let mut found = |became, why: String| findings.push(Finding { node: info.name.clone(), became, why });
        if info.name != name {
            found(Became::Ignored, format!("not named {name:?}"));
            continue;
        }
        if !picked(info) {
            found(Became::Ignored, format!("it holds {}, not float", info.value_type));
            continue;
        }
        let Some(grid) = voxels(path, &file, index, info, &mut notes)? else {
            found(Became::Ignored, "every sample is 0".into());
            continue;
        };
        let number = scene.regions.len();
        let scale = scale(info);
        if scale.is_none() {
            open.push(number);
        }
        let medium = Medium::with_albedo(scale.unwrap_or(0.0), facts.albedo.unwrap_or(ALBEDO), facts.g.unwrap_or(G));
        let region = if many { format!("{name}[{number}]") } else { name.into() };
        scene.regions.push(Region { name: region, shape: Shape::Grid(Arc::new(grid)), medium, photons: None });
        let why = if scale.is_some() { "a float grid of that name, with cloudvdb's density_scale" } else { "a float grid of that name" };
        found(Became::Region, why.into());
    }
    if scene.regions.is_empty() {
        return Err(nothing(path, &file, name));
    }
    fill(&mut scene.regions, &open, &facts, options, &mut notes);
    scene.sun = sun(&facts, options, &mut findings, &mut notes);
    let within: Vec<_> =
        scene.regions.iter().filter_map(|r| if let Shape::Grid(grid) = &r.shape { Some(Arc::clone(grid)) } else { None }).collect();
    let embers = fire::embers((path, &file), &options.fire, &within, Ok, &mut notes)?;
    for finding in findings.iter_mut().filter(|f| embers.iter().any(|e| e.name == f.node)) {
        (finding.became, finding.why) = (Became::Flame, "it was named as what shines".into());
    }
    Ok(Layout { scene, sky: None, embers, findings, notes, source_hash: String::new(), volumes: Vec::new() })
}

/// The grids of a `.vdb` that are no regions, to be written beside what becomes of those.
///
/// # Errors
/// [`Error::File`] where the file cannot be read, [`Error::Vdb`] where OpenVDB refuses it.
pub fn others(path: &Path, options: &ImportOptions) -> Result<Carried> {
    Ok(VdbFile::open(path)?.carried(|info| !is_picked(info, name(options))))
}

/// The name of the grids that are regions.
fn name(options: &ImportOptions) -> &str {
    options.grid.as_deref().unwrap_or(DENSITY)
}

/// Whether a grid is a region, or would be one if anything were in it.
pub(super) fn is_picked(info: &GridInfo, name: &str) -> bool {
    info.name == name && info.value_type == "float"
}

/// The error of a file in which no grid of this name holds anything.
fn nothing(path: &Path, file: &VdbFile, name: &str) -> Error {
    if file.grids().iter().any(|info| info.name == name && info.value_type == "float") {
        let reason = format!("the grid {name:?} is empty: no voxel of it is active and other than 0");
        return file_error(path, reason, "Write the file again with something in it, or name another grid with --grid");
    }
    // The sentence that lists the names.
    file.read_float(name).err().unwrap_or_else(|| file_error(path, format!("there is no grid {name:?}"), "Name another with --grid"))
}

/// A grid whose samples can be densities; `None` where all of them are 0.
pub(super) fn voxels(path: &Path, file: &VdbFile, index: usize, info: &GridInfo, notes: &mut Vec<String>) -> Result<Option<VoxelGrid>> {
    let name = &info.name;
    if info.class == "level set" {
        let reason = format!("the grid {name:?} is a level set: its samples are distances to a surface, and no densities");
        return Err(file_error(path, reason, "Convert it to a fog volume first (Houdini: Convert VDB; OpenVDB: sdfToFogVolume)"));
    }
    if let Some(world) = info.world_from_index {
        let m = world.matrix3;
        let volume = m.x_axis.length() * m.y_axis.length() * m.z_axis.length();
        if !world.to_cols_array().iter().all(|v| v.abs() <= FARTHEST) || m.determinant().abs() <= 1e-12 * volume {
            let reason = format!("the transform of grid {name:?} squashes it, or takes it beyond {FARTHEST:e} m");
            return Err(file_error(path, reason, "Give every axis a voxel size other than 0, and resample it"));
        }
    }
    let FloatGrid { mut bricks, active, background } = file.read_whole_at(index)?;
    let Some([min, max]) = active.filter(|_| !bricks.origins.is_empty()) else { return Ok(None) };
    let sides: [i64; 3] = std::array::from_fn(|a| i64::from(max[a]) - i64::from(min[a]) + 1);
    if min.iter().chain(&max).any(|&i| i64::from(i).abs() > FARTHEST_INDEX) {
        let reason = format!("the active voxels of grid {name:?} reach from {min:?} to {max:?}, farther than indices of 2^30");
        return Err(file_error(path, reason, "The file is damaged, or its voxels are far too small: write it again"));
    }
    if sides.iter().any(|&s| s > LONGEST) || sides.iter().map(|s| s / 64 + 2).product::<i64>() > MOST_NODES {
        let [x, y, z] = sides;
        let reason =
            format!("the active voxels of grid {name:?} lie in a box of {x} x {y} x {z} voxels, which is too large to look through");
        return Err(file_error(path, reason, "Remove stray voxels far from the cloud, split the grid, or resample it coarser"));
    }
    if background != 0.0 {
        notes.push(format!("The background of grid {name:?} is {background} and not 0: only its active samples were read as cloud."));
    }
    settle(path, name, &mut bricks, notes)?;
    let grid = VoxelGrid::new(bricks, min, max, false);
    Ok(Some(grid).filter(|grid| grid.integral() > 0.0))
}

/// Refuses samples that are not finite; takes negative ones as 0, and says how many there were.
fn settle(path: &Path, name: &str, bricks: &mut BrickGrid, notes: &mut Vec<String>) -> Result<()> {
    let look = |(mut wild, mut negative, mut lowest): (u64, u64, f32), brick: &mut [f32]| {
        // The bits of floats that are finite and not negative are below those of infinity: most bricks need no second look.
        if brick.iter().fold(0, |most, value| most.max(value.to_bits())) < f32::INFINITY.to_bits() {
            return (wild, negative, lowest);
        }
        for value in brick {
            if !value.is_finite() {
                wild += 1;
            } else if *value < 0.0 {
                negative += 1;
                lowest = lowest.min(*value);
                *value = 0.0;
            }
        }
        (wild, negative, lowest)
    };
    let both = |a: (u64, u64, f32), b: (u64, u64, f32)| (a.0 + b.0, a.1 + b.1, a.2.min(b.2));
    let (wild, negative, lowest) = bricks.values.par_chunks_mut(BRICK_VOXELS).fold(|| (0, 0, 0.0), look).reduce(|| (0, 0, 0.0), both);
    if wild > 0 {
        let reason = format!("{wild} samples of grid {name:?} are not finite (NaN or infinite)");
        return Err(file_error(path, reason, "Mend them where the file was made (in Houdini: a VDB Clip or a Volume Wrangle)"));
    }
    if negative > 0 {
        notes.push(format!(
            "{negative} samples of grid {name:?} are negative (down to {lowest}), and were taken as 0: there is no negative density."
        ));
    }
    Ok(())
}

/// Gives an extinction to the grids that have none.
fn fill(regions: &mut [Region], open: &[usize], facts: &Facts, options: &ImportOptions, notes: &mut Vec<String>) {
    let grids = || open.iter().filter_map(|&i| regions.get(i));
    let Some(thickest) = grids().max_by(|a, b| a.shape.thickness().total_cmp(&b.shape.thickness())) else { return };
    let across = thickest.shape.thickness();
    let sigma_t = DEPTH / across;
    if options.overrides.sigma_t.is_none() {
        notes.push(format!(
            "No extinction is given for {} of {} grids: sigma_t is {sigma_t:.6} per metre for a sample of 1, such that the thickest column, \
             one of {:?}, has optical depth {DEPTH}. Say otherwise with --sigma-t.",
            open.len(),
            regions.len(),
            thickest.name
        ));
    }
    for &i in open {
        if let Some(region) = regions.get_mut(i) {
            region.medium = Medium::with_albedo(sigma_t, facts.albedo.unwrap_or(ALBEDO), region.medium.g);
        }
    }
}

/// The file's sun, or the default one.
fn sun(facts: &Facts, options: &ImportOptions, findings: &mut Vec<Finding>, notes: &mut Vec<String>) -> Sun {
    let usual = Sun::default();
    let mut irradiance = facts.irradiance.unwrap_or(usual.irradiance);
    if facts.direction.is_some() {
        findings.push(Finding { node: "sun_direction".into(), became: Became::Sun, why: "the file's metadata".into() });
    } else if options.fire != FireSpec::default() && options.overrides.sun.is_none() {
        irradiance = [0.0; 3];
        notes.push("No sun is given: none is assumed, what shines is the light. --sun and --irradiance give one.".into());
    } else if options.overrides.sun.is_none() {
        notes.push(
            "No sun is given: one 45 degrees high in the south-west, 1 W/m^2, is assumed. Say otherwise with --sun and --irradiance."
                .into(),
        );
    }
    Sun {
        direction: facts.direction.unwrap_or(usual.direction),
        irradiance,
        angular_diameter: facts.angle.unwrap_or(usual.angular_diameter),
    }
}

/// What cloudvdb wrote about a scene into a file's metadata, where it makes sense.
#[derive(Debug, Default)]
pub(super) struct Facts {
    pub albedo: Option<f64>,
    pub g: Option<f64>,
    direction: Option<DVec3>,
    irradiance: Option<[f64; 3]>,
    angle: Option<f64>,
    /// What makes none.
    pub remarks: Vec<String>,
}

impl Facts {
    pub fn of(all: &[(String, Meta)]) -> Facts {
        let mut facts = Facts::default();
        let mut remarks = Vec::new();
        let mut kept = |key: &str, fine: bool| {
            if !fine {
                remarks.push(format!("The file's metadata {key:?} has no meaning, and was not read."));
            }
            fine
        };
        facts.albedo = metadata(all, "albedo").filter(|a| kept("albedo", (0.0..=1.0).contains(a)));
        facts.g = metadata(all, "g").filter(|g| kept("g", g.abs() < 1.0));
        facts.angle = metadata(all, "sun_angle").filter(|a| kept("sun_angle", (0.0..std::f64::consts::PI).contains(a)));
        let direction = triple(all, "sun_direction").filter(|d| kept("sun_direction", d.is_some())).flatten();
        facts.direction = direction.and_then(|d| DVec3::from_array(d).try_normalize());
        let irradiance = triple(all, "sun_irradiance").filter(|e| kept("sun_irradiance", e.is_some_and(|e| e.iter().all(|&e| e >= 0.0))));
        facts.irradiance = irradiance.flatten();
        facts.remarks = remarks;
        facts
    }
}

/// The extinction of a sample of 1, where cloudvdb wrote it.
pub(super) fn scale(info: &GridInfo) -> Option<f64> {
    metadata(&info.metadata, "density_scale").filter(|&s| s > 0.0)
}

/// A number of the metadata.
fn metadata(all: &[(String, Meta)], key: &str) -> Option<f64> {
    match all.iter().find(|(k, _)| k == key).map(|(_, value)| value)? {
        Meta::Float(value) => Some(*value).filter(|v| v.is_finite()),
        Meta::Int(value) => Some(*value as f64),
        Meta::Text(_) => None,
    }
}

/// Three numbers of the metadata, `None` inside where they are not three finite ones.
fn triple(all: &[(String, Meta)], key: &str) -> Option<Option<[f64; 3]>> {
    let Meta::Text(text) = all.iter().find(|(k, _)| k == key).map(|(_, value)| value)? else { return Some(None) };
    let numbers: Option<Vec<f64>> = text.split_whitespace().map(|n| n.parse().ok().filter(|v: &f64| v.is_finite())).collect();
    Some(numbers.and_then(|n| n.try_into().ok()))
}

/// The SHA-256 of a file's bytes, read in pieces: it may be large.
pub(super) fn hash(path: &Path) -> Result<String> {
    let unreadable = |e: std::io::Error| file_error(path, e.to_string(), "Name a VDB file that can be read");
    let mut file = std::fs::File::open(path).map_err(unreadable)?;
    let (mut hash, mut block) = (Sha256::new(), vec![0u8; 1 << 18]);
    loop {
        match file.read(&mut block).map_err(unreadable)? {
            0 => break,
            read => hash.update(block.get(..read).unwrap_or_default()),
        }
    }
    Ok(hex(hash))
}

/// A hash in hexadecimal digits.
pub(super) fn hex(hash: Sha256) -> String {
    let mut digits = String::with_capacity(64);
    for byte in hash.finalize() {
        // Writing to a string does not fail.
        let _ = write!(digits, "{byte:02x}");
    }
    digits
}
