//! All that a file holds, value by value: for who asks what is wrong with it.

use super::{GridInfo, Meta, describe, ffi, meta, scan};
use crate::error::Result;
use serde::Serialize;
use std::path::Path;

/// A file, with each of its grids looked through.
#[derive(Debug, Clone)]
pub struct Contents {
    /// The version of the format: 224 since 2016.
    pub version: u32,
    /// The major and the minor version of the OpenVDB that wrote the file.
    pub library: [u32; 2],
    /// The file's own metadata.
    pub metadata: Vec<(String, Meta)>,
    /// The grids, in the file's order.
    pub grids: Vec<GridContents>,
}

/// One grid of a file.
#[derive(Debug, Clone)]
pub struct GridContents {
    /// What the file says about it.
    pub info: GridInfo,
    /// How its values are compressed: `zip` or `blosc`, `active mask`.
    pub compression: Vec<&'static str>,
    /// What it takes of the file, in bytes; an instance takes only its name and transform.
    pub bytes: u64,
    /// What its values are, or why they cannot be read.
    pub exam: std::result::Result<Exam, Unread>,
}

/// Why the values of a grid were not looked at.
#[derive(Debug, Clone, PartialEq)]
pub enum Unread {
    /// Its type is none of numbers, vectors and truth values in OpenVDB's usual tree.
    Type,
    /// It is damaged, in these words.
    Damaged(String),
}

/// What a look at every value of a grid finds. Vectors count by the mean of their three numbers, as Cycles takes them for a density.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Exam {
    /// Active voxels, those in tiles included.
    pub active_voxels: u64,
    /// Bricks of 8 x 8 x 8 voxels.
    pub leaves: u64,
    /// Active tiles: cubes of one value.
    pub tiles: u64,
    /// What the tree takes in memory, in bytes.
    pub memory: u64,
    /// The smallest and the largest index of active voxels, zeros included; `None` where none is active.
    pub index_box: Option<[[i32; 3]; 2]>,
    /// The smallest active value that is finite; 0 where there is none.
    pub lowest: f64,
    /// The largest.
    pub highest: f64,
    /// Their mean.
    pub mean: f64,
    /// Active values that are not a number.
    pub nan: u64,
    /// Active values that are infinite.
    pub infinite: u64,
    /// Active values below 0.
    pub negative: u64,
    /// Values of inactive voxels other than 0 and the background.
    pub inactive: u64,
    /// What the grid says of all space without a voxel or tile.
    pub background: f64,
    /// The columns of voxels along each axis; `None` where tiles span more than can be looked through.
    #[serde(skip)]
    pub columns: Option<Columns>,
}

/// What columns of voxels along the grid's axes hold.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Columns {
    /// The largest sum of active values above 0 over one column, along each axis.
    pub sum: [f64; 3],
    /// The share of columns that begin (end) within a 50th of the extent, at least a voxel, of the lowest (highest) index, along
    /// each axis: 1 where a side is flat.
    pub flat: [[f64; 2]; 3],
}

/// Looks through a file, one grid at a time: the largest of its trees is held in memory.
///
/// # Errors
/// [`crate::Error::File`] when the file cannot be opened, [`crate::Error::Vdb`] when it is not a VDB, damaged outside its trees, or of
/// a format from before 2013. Damaged trees are [`Unread::Damaged`].
pub fn examine(path: &Path) -> Result<Contents> {
    let found = scan(path)?;
    let bytes = path.as_os_str().as_encoded_bytes();
    let look = |entry: &ffi::GridEntry| GridContents {
        info: describe(entry),
        compression: compression(entry.compression),
        bytes: entry.bytes.try_into().unwrap_or(0),
        exam: match entry.checkable {
            true => ffi::examine(bytes, entry).map(exam).map_err(|error| Unread::Damaged(error.what().into())),
            false => Err(Unread::Type),
        },
    };
    Ok(Contents {
        version: found.version,
        library: found.library,
        metadata: found.metadata.iter().map(meta).collect(),
        grids: found.grids.iter().map(look).collect(),
    })
}

/// The names of OpenVDB's flags.
fn compression(flags: u32) -> Vec<&'static str> {
    [(1, "zip"), (4, "blosc"), (2, "active mask")].into_iter().filter(|(flag, _)| flags & flag != 0).map(|(_, name)| name).collect()
}

fn exam(found: ffi::Exam) -> Exam {
    let [x0, x1, y0, y1, z0, z1] = found.flat;
    Exam {
        active_voxels: found.active_voxels,
        leaves: found.leaves,
        tiles: found.tiles,
        memory: found.memory,
        index_box: match *found.active {
            [x0, y0, z0, x1, y1, z1] => Some([[x0, y0, z0], [x1, y1, z1]]),
            _ => None,
        },
        lowest: found.lowest,
        highest: found.highest,
        mean: found.mean,
        nan: found.nan,
        infinite: found.infinite,
        negative: found.negative,
        inactive: found.inactive,
        background: found.background,
        columns: found.measured.then_some(Columns { sum: found.column, flat: [[x0, x1], [y0, y1], [z0, z1]] }),
    }
}
