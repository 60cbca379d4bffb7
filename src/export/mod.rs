//! What goes out: VDB grids, pictures, glTF of regions, the report; all files at once or none.

pub mod blend;
pub mod emission;
pub mod exr;
pub mod glb;
mod lattice;
pub mod png;
pub mod report;
pub mod staged;
pub mod vdb;
