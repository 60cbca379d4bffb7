//! Files, from outside the crate: layouts and volumes that come in, volumes that go out.
#![allow(clippy::unwrap_used, clippy::panic)]

mod import;
#[path = "../support/mod.rs"]
mod support;
mod vdb_mesh;
mod vdb_roundtrip;
mod vdb_scenes;
