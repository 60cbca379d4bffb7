//! What goes out: VDB grids, glTF of regions, the report; all files at once or none.

pub mod glb;
pub mod report;
pub mod staged;
pub mod vdb;
pub mod voxelise;
