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
    }

    /// What a file holds.
    #[derive(Debug)]
    struct Found {
        metadata: Vec<MetaEntry>,
        grids: Vec<GridEntry>,
    }

    unsafe extern "C++" {
        include!("cloudvdb/cpp/vdb_bridge.h");

        fn limit_threads(threads: usize) -> Result<()>;

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
        fn count(self: &Bricks) -> usize;
        /// The smallest and the largest index of active voxels, zeros included; nothing where none is active.
        fn active(self: &Bricks) -> Vec<i32>;
        /// What the grid holds where it holds nothing.
        fn background(self: &Bricks) -> f32;
        /// Copies the bricks from `first` on, as many as there is room for, and frees their samples here: each can be taken once.
        fn take(self: Pin<&mut Bricks>, first: usize, origins: &mut [i32], values: &mut [f32]) -> Result<()>;
    }
}
