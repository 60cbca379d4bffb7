//! What comes in: glTF and GLB files become a [`Scene`], with a line for each node that says what became of it.
//!
//! ```text
//! container ──► json ──► walk ──► gltf ──► Scene + findings
//!                          buffers, accessor ──► mesh ──► fit │
//!                          extras, medium, metaballs, lights ─┘
//! ```
//!
//! The file is read with types of our own and not with the `gltf` crate: its validation indexes accessors that do not
//! exist (a panic), its GLB header underflows, and it reads transforms as `f32`. Tests keep it as the twin to agree with.

mod accessor;
mod at;
mod buffers;
mod build;
mod container;
mod extras;
mod fit;
mod gltf;
mod instances;
mod json;
mod lights;
mod linear;
mod medium;
mod mesh;
mod metaballs;
mod region;
mod walk;
mod weld;

use crate::{Result, scene::Scene};
use std::path::Path;

/// What the user may ask of an import.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ImportOptions {
    /// `--regions`: only meshes whose node's name, or an ancestor's, matches this pattern (`*` and `?`) become regions by
    /// their form. `None` takes all. What says by its extras or as a metaball that it is a region is one in any case.
    pub regions: Option<String>,
    /// `--mesh-volumes`: closed meshes that are not sphere-like become regions too.
    pub mesh_volumes: bool,
}

/// What became of a node.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Became {
    /// One or more regions of participating medium.
    Region,
    /// A Lambertian surface.
    Surface,
    /// The sun.
    Sun,
    /// The camera.
    Camera,
    /// Nothing.
    Ignored,
}

/// What became of one node, and why.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Finding {
    /// The node's name; an instance's has its number behind it: `Cloud[3]`.
    pub node: String,
    /// What it became.
    pub became: Became,
    /// Why, in words that follow "because".
    pub why: String,
}

/// A file, read.
#[derive(Debug, Clone)]
pub struct Layout {
    /// What light will travel through: Z up, metres.
    pub scene: Scene,
    /// What became of each node, in the order of the file's tree.
    pub findings: Vec<Finding>,
    /// Warnings and assumptions, each a sentence.
    pub notes: Vec<String>,
    /// The SHA-256 of the file's bytes in hexadecimal digits (of the `.gltf` itself where it has buffers of their own).
    pub source_hash: String,
}

/// Reads a `.gltf` or `.glb` file.
///
/// # Errors
///
/// [`crate::Error::File`] where the file cannot be read, is not a sound glTF, or holds no region at all;
/// [`crate::Error::Node`] where a node, a material or the scene holds something that has no meaning.
pub fn load(path: &Path, options: &ImportOptions) -> Result<Layout> {
    let document = container::read(path)?;
    gltf::layout(path, &document, options)
}
