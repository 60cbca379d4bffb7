//! OpenVDB files: writing brick grids as fog volumes, and reading float grids back.
//!
//! The library is Debian's libopenvdb 10, behind the `cxx` bridge of `ffi`; a brick of a [`BrickGrid`] is a leaf of its trees.
//! What is read may come from anywhere: sizes in a file are checked before memory is taken or written for them,
//! and a file that is cut short or damaged is an error.

mod carry;
mod exam;
mod ffi;
mod mesh;

use std::fs::OpenOptions;
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use glam::{DAffine3, DMat3, DVec3};
use sha2::{Digest, Sha256};

use crate::error::{Error, Result};
use crate::room;
use crate::scene::density::{BRICK_SIDE, BRICK_VOXELS, BrickGrid};

pub use carry::Carried;
pub use exam::{Columns, Contents, Exam, GridContents, Unread, examine};
pub use mesh::mesh_distance;

/// The most voxels that a grid may expand to when it is read (8 GiB of samples).
const MAX_VOXELS: u64 = 1 << 31;
/// Bricks that leave the tree at a time (8 MB).
const TAKEN: usize = 1 << 12;
/// The largest finite half float.
const MAX_HALF: f32 = 65504.0;

/// One value of metadata.
#[derive(Debug, Clone, PartialEq)]
pub enum Meta {
    /// Text; values of types not listed here (vectors, matrices) are read as OpenVDB prints them.
    Text(String),
    /// A whole number; truth values are read as 0 or 1.
    Int(i64),
    /// A number.
    Float(f64),
}

/// A grid to write: class fog volume, background 0. Samples that are exactly 0 are inactive, bricks of one value become tiles.
#[derive(Debug, Clone, Copy)]
pub struct GridOut<'a> {
    /// The grid's name: `density`.
    pub name: &'a str,
    /// The samples and the transform.
    pub bricks: &'a BrickGrid,
    /// Whether samples are stored as 16-bit floats (11 significant bits, at most 65504).
    pub half: bool,
    /// Metadata of this grid. OpenVDB's own keys (`name`, `class`, `is_saved_as_half_float`, `file_...`) are refused.
    pub metadata: &'a [(String, Meta)],
}

/// A float grid that was read.
#[derive(Debug, Clone, PartialEq)]
pub struct FloatGrid {
    /// Its active samples, and 0 where none is active.
    pub bricks: BrickGrid,
    /// The smallest and the largest index of the active voxels, active zeros included; `None` where no voxel is active.
    pub active: Option<[[i32; 3]; 2]>,
    /// The value that the file gives to all space without a voxel or a tile.
    pub background: f32,
}

/// What a file says about one of its grids.
#[derive(Debug, Clone, PartialEq)]
pub struct GridInfo {
    /// The name, without the number that OpenVDB appends where several grids share one.
    pub name: String,
    /// The type of a sample: `float`, `vec3s`, `bool`; the whole name of the type for trees of an unusual shape.
    pub value_type: String,
    /// `fog volume`, `level set`, `staggered vector field` or `unknown`.
    pub class: String,
    /// From index space to the world; `None` when the transform is not affine (a frustum).
    pub world_from_index: Option<DAffine3>,
    /// The number of active voxels, those in tiles included; 0 for other than float grids where the file does not say.
    pub active_voxels: u64,
    /// Whether samples are stored as 16-bit floats.
    pub saved_as_half: bool,
    /// The grid's metadata, without OpenVDB's own keys.
    pub metadata: Vec<(String, Meta)>,
}

/// Writes grids and the file's own metadata to `path`, compressed by blosc and by masks of active voxels.
///
/// The file is written in place: callers that must not leave half a file write beside the target and rename.
///
/// # Errors
/// [`Error::Write`] when the target cannot be made, the disk is full, or a grid holds what a VDB cannot say: samples that are
/// not finite or too large for half floats, bricks that are not sorted, a transform that squashes space, keys that are
/// OpenVDB's own. [`Error::Vdb`] when OpenVDB refuses.
pub fn write(path: &Path, grids: &[GridOut], metadata: &[(String, Meta)]) -> Result<()> {
    write_beside(path, grids, &Carried::default(), metadata)
}

/// As [`write()`], with grids of another file behind.
///
/// # Errors
/// As [`write()`]; and [`Error::File`] of the other file, where a grid of it is damaged.
pub fn write_beside(path: &Path, grids: &[GridOut], others: &Carried, metadata: &[(String, Meta)]) -> Result<()> {
    let vdb = |error: cxx::Exception| Error::Vdb { file: path.into(), message: error.what().into() };
    let mut draft = ffi::new_draft().map_err(vdb)?;
    for grid in grids {
        check(grid).map_err(|(reason, fix)| Error::Write {
            target: path.into(),
            reason: format!("grid \"{}\": {reason}", grid.name),
            fix: fix.into(),
        })?;
        let matrix = grid.bricks.world_from_index.to_cols_array();
        let origins = grid.bricks.origins.as_flattened();
        draft.pin_mut().add(grid.name, grid.half, &matrix, origins, &grid.bricks.values, &entries(grid.metadata)).map_err(vdb)?;
    }
    others.add(&mut draft)?;
    match draft.save(path.as_os_str().as_encoded_bytes(), &entries(metadata)).map_err(vdb)? {
        0 => stamp(path).map_err(|e| unwritable(path, &e)),
        code => Err(unwritable(path, &std::io::Error::from_raw_os_error(code))),
    }
}

fn unwritable(path: &Path, error: &std::io::Error) -> Error {
    Error::Write { target: path.into(), reason: error.to_string(), fix: "Name a directory that exists, can be written and has room".into() }
}

/// Keeps OpenVDB's own threads to so many, from now on.
pub fn limit_threads(threads: usize) {
    // Only memory could be wanting, and then OpenVDB uses all cores.
    let _ = ffi::limit_threads(threads);
}

/// Calls `last` when the process aborts, in place of what the system would do; it must take no memory, and end the process.
pub fn on_abort(last: fn()) {
    ffi::on_abort(last);
}

/// Where the file's UUID stands in its header, 36 bytes of text: behind the magic number, two versions and a flag.
const UUID_AT: usize = 21;

/// Replaces the UUID, which OpenVDB draws at random, by one made of the content: equal grids make equal files.
fn stamp(path: &Path) -> std::io::Result<()> {
    let mut file = OpenOptions::new().read(true).write(true).open(path)?;
    if !file.metadata()?.is_file() {
        return Ok(());
    }
    let (mut hash, mut block, mut at) = (Sha256::new(), vec![0u8; 1 << 16], 0usize);
    loop {
        let read = file.read(&mut block)?;
        if read == 0 {
            break;
        }
        // The header lies whole within the first block.
        let from = if at == 0 { (UUID_AT + 36).min(read) } else { 0 };
        hash.update(&block[from..read]);
        at += read;
    }
    let digits: String = hash.finalize()[..16].iter().map(|b| format!("{b:02x}")).collect();
    // Version 8 of RFC 9562: bits of the maker's own choosing.
    let uuid = format!("{}-{}-8{}-a{}-{}", &digits[..8], &digits[8..12], &digits[13..16], &digits[17..20], &digits[20..]);
    file.seek(SeekFrom::Start(UUID_AT as u64))?;
    file.write_all(uuid.as_bytes())
}

/// What is wrong with a grid, and the fix.
fn check(grid: &GridOut) -> std::result::Result<(), (String, &'static str)> {
    const OURS: &str = "This is a fault of cloudvdb, please report it";
    let bricks = grid.bricks;
    if bricks.values.len() != bricks.origins.len() * BRICK_VOXELS {
        return Err((format!("{} bricks with {} samples", bricks.origins.len(), bricks.values.len()), OURS));
    }
    if let Some(origin) = bricks.origins.iter().find(|origin| origin.iter().any(|i| i % BRICK_SIDE != 0)) {
        return Err((format!("the brick at {origin:?} is not at a multiple of {BRICK_SIDE}"), OURS));
    }
    if let Some(pair) = bricks.origins.windows(2).find(|pair| pair[0] >= pair[1]) {
        return Err((format!("the brick at {:?} follows the one at {:?}", pair[1], pair[0]), OURS));
    }
    let transform = bricks.world_from_index;
    if !transform.is_finite() || transform.matrix3.determinant() == 0.0 {
        return Err((format!("its transform {transform:?} cannot be inverted"), "Give every axis a scale other than zero"));
    }
    // The bits of a float without its sign sort as its magnitude does, infinities and NaN last.
    let largest = f32::from_bits(bricks.values.iter().fold(0, |most, v| most.max(v.to_bits() & 0x7fff_ffff)));
    if !largest.is_finite() {
        return Err(("a sample is not a finite number".into(), "Check the density and the voxel size"));
    }
    if grid.half && largest > MAX_HALF {
        return Err((format!("the largest sample is {largest}, half floats end at {MAX_HALF}"), "Use --float32"));
    }
    match grid.metadata.iter().find(|(key, _)| is_reserved(key)) {
        Some((key, _)) => Err((format!("the metadata \"{key}\" belongs to OpenVDB"), "Choose another name for it")),
        None => Ok(()),
    }
}

/// Whether OpenVDB itself writes this key of a grid's metadata.
fn is_reserved(key: &str) -> bool {
    matches!(key, "name" | "class" | "is_saved_as_half_float") || key.starts_with("file_")
}

fn entries(metadata: &[(String, Meta)]) -> Vec<ffi::MetaEntry> {
    let entry = |(key, value): &(String, Meta)| {
        let (kind, text, whole, real) = match value {
            Meta::Text(text) => (ffi::MetaKind::Text, text.clone(), 0, 0.0),
            Meta::Int(whole) => (ffi::MetaKind::Int, String::new(), *whole, 0.0),
            Meta::Float(real) => (ffi::MetaKind::Float, String::new(), 0, *real),
        };
        ffi::MetaEntry { key: key.clone(), kind, text, whole, real }
    };
    metadata.iter().map(entry).collect()
}

fn meta(entry: &ffi::MetaEntry) -> (String, Meta) {
    let value = match entry.kind {
        ffi::MetaKind::Text => Meta::Text(entry.text.clone()),
        ffi::MetaKind::Int => Meta::Int(entry.whole),
        _ => Meta::Float(entry.real),
    };
    (entry.key.clone(), value)
}

/// What a file says of itself, without samples (where it has an index).
fn scan(path: &Path) -> Result<ffi::Found> {
    let unreadable = |reason: String| Error::File { file: path.into(), reason, fix: "Name a VDB file that can be read".into() };
    let kind = std::fs::File::open(path).and_then(|file| file.metadata()).map_err(|error| unreadable(error.to_string()))?;
    if !kind.is_file() {
        return Err(unreadable("this is not a file".into()));
    }
    ffi::scan(path.as_os_str().as_encoded_bytes()).map_err(|error| Error::Vdb { file: path.into(), message: error.what().into() })
}

/// A VDB file whose table of contents was read.
#[derive(Debug)]
pub struct VdbFile {
    path: PathBuf,
    entries: Vec<ffi::GridEntry>,
    grids: Vec<GridInfo>,
    metadata: Vec<(String, Meta)>,
}

impl VdbFile {
    /// Reads a file's metadata and what it says about its grids, but (where it has an index) no samples.
    ///
    /// # Errors
    /// [`Error::File`] when the file cannot be opened, [`Error::Vdb`] when it is not a VDB, damaged, or of a format from before 2013.
    pub fn open(path: &Path) -> Result<Self> {
        let vdb = |error: cxx::Exception| Error::Vdb { file: path.into(), message: error.what().into() };
        let bytes = path.as_os_str().as_encoded_bytes();
        let found = scan(path)?;
        let mut grids = Vec::with_capacity(found.grids.len());
        for entry in &found.grids {
            let mut info = describe(entry);
            if info.active_voxels == 0 {
                info.active_voxels = ffi::count_active(bytes, entry).map_err(vdb)?;
            }
            grids.push(info);
        }
        Ok(Self { path: path.into(), entries: found.grids, grids, metadata: found.metadata.iter().map(meta).collect() })
    }

    /// The file's grids, in its order.
    pub fn grids(&self) -> &[GridInfo] {
        &self.grids
    }

    /// The file's own metadata.
    pub fn metadata(&self) -> &[(String, Meta)] {
        &self.metadata
    }

    /// Reads the first float grid of this name. Active values are read, tiles expanded, inactive values taken as 0,
    /// bricks without a sample other than 0 dropped. Samples are as the file has them, also such as are not finite.
    ///
    /// # Errors
    /// [`Error::File`] when no grid has this name, or it is no float grid with an affine transform; [`Error::Vdb`] when the tree is
    /// damaged, or expands to more than 2^31 voxels.
    pub fn read_float(&self, name: &str) -> Result<BrickGrid> {
        let named = |info: &&GridInfo| info.name == name;
        let index = self.grids.iter().position(|info| named(&info) && info.value_type == "float");
        if let Some(index) = index.or_else(|| self.grids.iter().position(|info| named(&info))) {
            return self.read_float_at(index);
        }
        let names: Vec<_> = self.grids.iter().map(|info| format!("\"{}\" ({})", info.name, info.value_type)).collect();
        let there = if names.is_empty() { "no grid at all".into() } else { names.join(", ") };
        Err(self.refused(format!("there is no grid \"{name}\" in this file, which has {there}"), "Name one of these with --grid"))
    }

    /// Reads grid `index` of [`VdbFile::grids`], as [`VdbFile::read_float`] does: for files in which several grids share a name.
    ///
    /// # Errors
    /// As [`VdbFile::read_float`].
    pub fn read_float_at(&self, index: usize) -> Result<BrickGrid> {
        self.read_whole_at(index).map(|grid| grid.bricks)
    }

    /// As [`VdbFile::read_float_at`], with what the samples do not say. The tree is gone when this returns, and never held whole
    /// beside the bricks.
    ///
    /// # Errors
    /// As [`VdbFile::read_float`].
    pub fn read_whole_at(&self, index: usize) -> Result<FloatGrid> {
        let Some((info, entry)) = self.grids.get(index).zip(self.entries.get(index)) else {
            return Err(self.refused(format!("there is no grid {index}, only {}", self.grids.len()), "Name a grid with --grid"));
        };
        if info.value_type != "float" {
            let floats: Vec<_> = self.grids.iter().filter(|i| i.value_type == "float").map(|i| format!("\"{}\"", i.name)).collect();
            let there = if floats.is_empty() { "has no float grid".into() } else { format!("has the float grids {}", floats.join(", ")) };
            let reason = format!("the grid \"{}\" holds {} and not float; the file {there}", info.name, info.value_type);
            return Err(self.refused(reason, "Name a float grid with --grid"));
        }
        let Some(world_from_index) = info.world_from_index else {
            return Err(self.refused(format!("the transform of grid \"{}\" is not affine", info.name), "Resample it to a box of voxels"));
        };
        let vdb = |error: cxx::Exception| Error::Vdb { file: self.path.clone(), message: error.what().into() };
        let bricks = ffi::load(self.path.as_os_str().as_encoded_bytes(), entry, MAX_VOXELS).map_err(vdb)?;
        let active = match *bricks.active() {
            [x0, y0, z0, x1, y1, z1] => Some([[x0, y0, z0], [x1, y1, z1]]),
            _ => None,
        };
        let (count, background) = (bricks.count(), bricks.background());
        let needed = (count * BRICK_VOXELS * size_of::<f32>()) as u64;
        if let Some(reason) = room::missing(needed, room::free()) {
            return Err(self.refused(format!("the grid \"{}\" {reason}", info.name), "Free memory, or resample it coarser"));
        }
        let Some(mut drained) = drain(bricks).map_err(vdb)? else {
            return Err(self.refused(format!("{count} bricks of the grid \"{}\" do not fit into memory", info.name), "Resample it coarser"));
        };
        trim(&mut drained);
        let (origins, values) = drained;
        Ok(FloatGrid { bricks: BrickGrid { world_from_index, origins, values }, active, background })
    }

    fn refused(&self, reason: String, fix: &str) -> Error {
        Error::File { file: self.path.clone(), reason, fix: fix.into() }
    }
}

/// Origins of bricks, and their samples.
type Drained = (Vec<[i32; 3]>, Vec<f32>);

/// The origins and samples of all bricks, which leave the tree; `None` where memory does not hold them.
fn drain(mut bricks: cxx::UniquePtr<ffi::Bricks>) -> std::result::Result<Option<Drained>, cxx::Exception> {
    let mut origins = vec![[0; 3]; bricks.count()];
    let mut values = Vec::new();
    if values.try_reserve_exact(origins.len() * BRICK_VOXELS).is_err() {
        return Ok(None);
    }
    for (i, origins) in origins.chunks_mut(TAKEN).enumerate() {
        let first = values.len();
        values.resize(first + origins.len() * BRICK_VOXELS, 0.0);
        bricks.pin_mut().take(i * TAKEN, origins.as_flattened_mut(), &mut values[first..])?;
    }
    Ok(Some((origins, values)))
}

/// Drops bricks without a sample other than 0.
fn trim((origins, values): &mut Drained) {
    let full = |brick: &[f32]| brick.iter().any(|&v| v != 0.0);
    let kept: Vec<usize> = values.chunks(BRICK_VOXELS).enumerate().filter(|(_, brick)| full(brick)).map(|(i, _)| i).collect();
    if kept.len() == origins.len() {
        return;
    }
    for (to, &from) in kept.iter().enumerate() {
        origins[to] = origins[from];
        values.copy_within(from * BRICK_VOXELS..(from + 1) * BRICK_VOXELS, to * BRICK_VOXELS);
    }
    origins.truncate(kept.len());
    values.truncate(kept.len() * BRICK_VOXELS);
}

/// What the descriptor and the metadata of a grid say.
fn describe(entry: &ffi::GridEntry) -> GridInfo {
    let all: Vec<_> = entry.metadata.iter().map(meta).collect();
    let get = |key: &str| all.iter().find(|(k, _)| k == key).map(|(_, value)| value.clone());
    let m = &entry.matrix;
    let column = |i: usize| DVec3::new(m[3 * i], m[3 * i + 1], m[3 * i + 2]);
    let affine = DAffine3 { matrix3: DMat3::from_cols(column(0), column(1), column(2)), translation: column(3) };
    let usual = entry.type_name.strip_prefix("Tree_").and_then(|rest| rest.strip_suffix("_5_4_3"));
    GridInfo {
        // OpenVDB makes names unique by a record separator and a number.
        name: entry.unique_name.split('\u{1e}').next().unwrap_or_default().into(),
        value_type: usual.unwrap_or(&entry.type_name).into(),
        class: match get("class") {
            Some(Meta::Text(class)) => class,
            _ => "unknown".into(),
        },
        world_from_index: entry.linear.then_some(affine),
        active_voxels: match get("file_voxel_count") {
            Some(Meta::Int(count)) => count.try_into().unwrap_or(0),
            _ => 0,
        },
        saved_as_half: entry.half,
        metadata: all.into_iter().filter(|(key, _)| !is_reserved(key)).collect(),
    }
}
