//! Every way in which a run can fail, each with the sentence the user reads.
//!
//! A message names what is wrong (file, node, field), why, and what to do about it.

use std::path::PathBuf;

/// The result of anything in this crate that can fail.
pub type Result<T> = std::result::Result<T, Error>;

/// One way in which a run can fail. `Display` is the sentence that the user reads.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A file that cannot be read, or is not what it claims to be.
    #[error("{}: {reason}. {fix}", file.display())]
    File {
        /// The file as the user named it.
        file: PathBuf,
        /// What is wrong with it.
        reason: String,
        /// What the user can do about it.
        fix: String,
    },
    /// A node (or the scene, or a material) of a file holds something that has no meaning.
    #[error("{}: {node}: {field} is {found}, expected {expected}. {fix}", file.display())]
    Node {
        /// The file as the user named it.
        file: PathBuf,
        /// The node's name, quoted and with its kind: `node "Cloud"`.
        node: String,
        /// The field that is wrong.
        field: String,
        /// What it holds.
        found: String,
        /// What it may hold.
        expected: String,
        /// What the user can do about it.
        fix: String,
    },
    /// The scene is readable, but light cannot do in it what was asked for.
    #[error("{reason}. {fix}")]
    Scene {
        /// What is missing, with the figure that decided.
        reason: String,
        /// What the user can do about it.
        fix: String,
    },
    /// A grid with more voxels than allowed.
    #[error(
        "a voxel size of {voxel_size} m needs about {voxels:.3e} voxels, more than --max-voxels {max_voxels}. \
         Use --voxel-size {fitting} or larger, or raise --max-voxels"
    )]
    TooManyVoxels {
        /// The voxel size that was asked for, in metres.
        voxel_size: f64,
        /// About how many active voxels it would take.
        voxels: f64,
        /// The number that is allowed.
        max_voxels: u64,
        /// The smallest voxel size that fits, in metres.
        fitting: f64,
    },
    /// A target that cannot be written.
    #[error("{}: {reason}. {fix}", target.display())]
    Write {
        /// The target as the user named it.
        target: PathBuf,
        /// What went wrong.
        reason: String,
        /// What the user can do about it.
        fix: String,
    },
    /// OpenVDB itself refused, with its own words.
    #[error("{}: OpenVDB says: {message}", file.display())]
    Vdb {
        /// The file that was read or written.
        file: PathBuf,
        /// OpenVDB's message.
        message: String,
    },
    /// What the machine does not give: memory, threads.
    #[error("{reason}. {fix}")]
    Machine {
        /// What is wanting.
        reason: String,
        /// What the user can do about it.
        fix: String,
    },
    /// Flags that make no sense together; exit code 2.
    #[error("{0}")]
    Usage(String),
    /// Stopped by Ctrl-C or a signal; exit code 130. Nothing was written.
    #[error("interrupted; nothing was written")]
    Interrupted,
    /// Stopped by Ctrl-C or a signal when the files were in their places already; exit code 130.
    #[error("interrupted after the files were written")]
    InterruptedLate,
}

impl Error {
    /// The same error, naming the file whose scene it is about.
    pub fn of_file(self, file: &std::path::Path) -> Error {
        match self {
            Error::Scene { reason, fix } => Error::Scene { reason: format!("{}: {reason}", file.display()), fix },
            other => other,
        }
    }

    /// The process's exit code: 1 failed, 2 usage, 130 interrupted.
    pub fn exit_code(&self) -> u8 {
        match self {
            Error::Usage(_) => 2,
            Error::Interrupted | Error::InterruptedLate => 130,
            _ => 1,
        }
    }
}
