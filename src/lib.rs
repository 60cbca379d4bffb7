//! cloudvdb: photon-cloud regions from a layout, written as OpenVDB grids.
#![deny(unsafe_code)]

pub mod error;
pub mod geom;
pub mod import;
pub mod scene;

pub use error::{Error, Result};
