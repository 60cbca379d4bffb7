//! The `cxx` bridge to `cpp/`: the only unsafe code of this crate. Slices across the boundary, every call that can fail a `Result`.
#![allow(unsafe_code, missing_docs, clippy::missing_safety_doc)]

pub use bridge::*;

#[cxx::bridge(namespace = "cloudvdb")]
mod bridge {
    /// What a value of metadata is.
    #[derive(Debug, Clone)]
    enum MetaKind {
        Text,
        Int,
        Float,
    }

    /// One named value of metadata; `kind` says which of the three fields counts.
    #[derive(Debug, Clone)]
    struct MetaEntry {
        key: String,
        kind: MetaKind,
        text: String,
        whole: i64,
        real: f64,
    }

    /// A grid of a file, as its descriptor, metadata and transform say.
    #[derive(Debug, Clone)]
    struct GridEntry {
        unique_name: String,
        type_name: String,
        half: bool,
        linear: bool,
        /// Columns of the affine matrix: three of the linear part, then the translation.
        matrix: [f64; 12],
        metadata: Vec<MetaEntry>,
        /// Where the metadata begins.
        metadata_at: i64,
        /// Where the tree begins, or -1 if the transform before it cannot be read, or an instance refers to a grid that is not there.
        tree_at: i64,
        tree_half: bool,
        compression: u32,
        /// Whether the tree has the usual shape, and values of a fixed size.
        checkable: bool,
        /// What the grid takes of the file.
        bytes: i64,
    }

    /// What a file holds.
    #[derive(Debug)]
    struct Found {
        metadata: Vec<MetaEntry>,
        grids: Vec<GridEntry>,
        /// The format's version, and the major and minor version of the OpenVDB that wrote it.
        version: u32,
        library: [u32; 2],
    }

    /// What a look at every value of a grid finds; vectors count by their mean.
    #[derive(Debug, Clone)]
    struct Exam {
        /// Voxels and tiles that are active; of tiles all voxels.
        active_voxels: u64,
        leaves: u64,
        tiles: u64,
        /// Of the tree, in bytes.
        memory: u64,
        /// The smallest and the largest index of active voxels; nothing where none is active.
        active: Vec<i32>,
        /// Of active values that are finite; 0 where there are none.
        lowest: f64,
        highest: f64,
        mean: f64,
        /// Active values.
        nan: u64,
        infinite: u64,
        negative: u64,
        /// Inactive values other than 0 and the background.
        inactive: u64,
        background: f64,
        /// Whether `column` and `flat` are known: tiles may span more than can be looked through.
        measured: bool,
        /// The largest sum of active values above 0 over a column of voxels, along each axis.
        column: [f64; 3],
        /// The share of columns that end within a 50th of the extent (at least a voxel) of the outermost: -x, +x, -y, +y, -z, +z.
        flat: [f64; 6],
    }

    unsafe extern "C++" {
        include!("cloudvdb/cpp/vdb_bridge.h");

        fn limit_threads(threads: usize) -> Result<()>;
        /// Calls `last` when the process aborts.
        fn on_abort(last: fn());

        type Draft;
        fn new_draft() -> Result<UniquePtr<Draft>>;
        fn add(
            self: Pin<&mut Draft>,
            name: &str,
            half: bool,
            world_from_index: &[f64],
            origins: &[i32],
            values: &[f32],
            metadata: &[MetaEntry],
        ) -> Result<()>;
        /// Adds a grid of a file as it is; its transform is followed by `turn` (columns, as [`GridEntry::matrix`]) where that is not
        /// empty.
        fn carry(self: Pin<&mut Draft>, path: &[u8], grid: &GridEntry, turn: &[f64]) -> Result<()>;
        /// Returns 0, or the errno of the write that failed.
        fn save(self: &Draft, path: &[u8], metadata: &[MetaEntry]) -> Result<i32>;

        type Bricks;
        fn scan(path: &[u8]) -> Result<Found>;
        fn load(path: &[u8], grid: &GridEntry, max_voxels: u64) -> Result<UniquePtr<Bricks>>;
        /// How deep each sample lies under the surface of a closed mesh, in voxels: `points` are positions in index space, three
        /// numbers each. At most `exterior` outside and `interior` inside; bricks that lie farther outside are left out.
        fn mesh_depth(points: &[f64], triangles: &[u32], exterior: f32, interior: f32, max_voxels: u64) -> Result<UniquePtr<Bricks>>;
        fn count_active(path: &[u8], grid: &GridEntry) -> Result<u64>;
        /// Looks at every value of a grid that is checkable.
        fn examine(path: &[u8], grid: &GridEntry) -> Result<Exam>;
        fn count(self: &Bricks) -> usize;
        /// The smallest and the largest index of active voxels, zeros included; nothing where none is active.
        fn active(self: &Bricks) -> Vec<i32>;
        /// What the grid holds where it holds nothing.
        fn background(self: &Bricks) -> f32;
        /// Copies the bricks from `first` on, as many as there is room for, and frees their samples here: each can be taken once.
        fn take(self: Pin<&mut Bricks>, first: usize, origins: &mut [i32], values: &mut [f32]) -> Result<()>;
    }
}
