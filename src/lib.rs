//! cloudvdb: photon-cloud regions from a layout, written as OpenVDB grids.
#![deny(unsafe_code)]
#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod bvh;
pub mod cli;
pub mod error;
pub mod export;
pub mod geom;
pub mod import;
pub mod media;
pub mod photon;
pub mod pipeline;
pub mod plan;
pub mod progress;
pub mod regions;
pub mod rng;
pub mod sampling;
pub mod scene;
pub mod stats;
pub mod trimesh;
pub mod vdb;

pub use error::{Error, Result};
