//! What comes in: glTF, GLB and OpenVDB files become a [`Scene`], with a line for each node or grid that says what became of it.
//!
//! ```text
//! container ──► json ──► walk ──► gltf ──► Scene + findings
//!                          buffers, accessor ──► mesh ──► fit │
//!                          extras, medium, metaballs, lights ─┤ settle: media, voxels
//!                          vdb ──► volume ────────────────────┘
//! vdb ──────────────────────────────────► Scene + findings
//! ```
//!
//! The file is read with types of our own and not with the `gltf` crate: its validation indexes accessors that do not
//! exist (a panic), its GLB header underflows, and it reads transforms as `f32`. Tests keep it as the twin to agree with.

mod accessor;
pub mod air;
mod at;
mod buffers;
mod build;
mod container;
mod detail;
mod extras;
pub mod fire;
mod fit;
mod gltf;
mod instances;
mod json;
mod lights;
mod linear;
mod medium;
mod mend;
mod mesh;
mod metaballs;
mod region;
mod settle;
pub mod sky;
mod thick;
mod vdb;
mod volume;
mod walk;
mod weld;

use crate::{
    Error, Result,
    progress::Progress,
    scene::{Overrides, Scene},
    sculpt::DetailRequest,
};
use std::path::{Path, PathBuf};

use fire::{Ember, FireSpec};
use sky::SkySpec;
pub use vdb::others;

/// What the user may ask of an import.
#[derive(Debug, Clone, PartialEq)]
pub struct ImportOptions {
    /// `--regions`: only meshes whose node's name, or an ancestor's, matches this pattern (`*` and `?`) become regions by
    /// their form. `None` takes all. What says by its extras or as a metaball that it is a region is one in any case.
    pub regions: Option<String>,
    /// `--mesh-volumes`: closed meshes that are not sphere-like become regions too.
    pub mesh_volumes: bool,
    /// `--grid`: the grids of a `.vdb` that are regions; `None` takes those named `density`.
    pub grid: Option<String>,
    /// What replaces the file's own media, sun and sky.
    pub overrides: Overrides,
    /// `--sky`: the sky in place of the file's, where it is not even.
    pub sky: Option<SkySpec>,
    /// `--emission`, `--temperature`, `--soot`: what of a `.vdb` shines.
    pub fire: FireSpec,
    /// `--detail`: the detail of every region that can have one, in place of what the file says; `Some(None)` takes it away.
    pub detail: Option<Option<DetailRequest>>,
    /// `--voxel-size`: of what becomes voxels, m.
    pub voxel_size: Option<f64>,
    /// `--max-voxels`: the most of them that are active.
    pub max_voxels: u64,
}

impl Default for ImportOptions {
    fn default() -> Self {
        ImportOptions {
            regions: None,
            mesh_volumes: false,
            grid: None,
            overrides: Overrides::default(),
            sky: None,
            fire: FireSpec::default(),
            detail: None,
            voxel_size: None,
            max_voxels: MAX_VOXELS,
        }
    }
}

/// The most active voxels where nobody says another number.
pub const MAX_VOXELS: u64 = 1 << 24;

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
    /// A lamp.
    Lamp,
    /// Something that shines by itself.
    Flame,
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
    /// The sky as the file spells it, which is laid over the scene.
    pub(crate) sky: Option<SkySpec>,
    /// What of it shines.
    pub(crate) embers: Vec<Ember>,
    /// What became of each node, in the order of the file's tree.
    pub findings: Vec<Finding>,
    /// Warnings and assumptions, each a sentence.
    pub notes: Vec<String>,
    /// The SHA-256 of the file's bytes in hexadecimal digits (of the `.gltf` itself where it has buffers of their own). Where
    /// its nodes name VDBs, that of these digits and those of each VDB, in the order of [`Layout::volumes`].
    pub source_hash: String,
    /// The VDBs that its nodes name, each once.
    pub volumes: Vec<PathBuf>,
}

/// Whether a file is an OpenVDB file, by its extension.
pub fn is_vdb(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("vdb"))
}

/// Reads a `.gltf`, `.glb` or `.vdb` file, and replaces what the options override.
///
/// # Errors
///
/// [`Error::File`] where the file cannot be read, is not a sound glTF or VDB, or holds no region at all;
/// [`Error::Node`] where a node, a material or the scene holds something that has no meaning; [`Error::Vdb`] where OpenVDB
/// refuses; [`Error::Scene`] where an override does not fit the scene; [`Error::Usage`] where an option does not fit the file; [`Error::TooManyVoxels`]; [`Error::Interrupted`].
pub fn load(path: &Path, options: &ImportOptions, progress: &dyn Progress) -> Result<Layout> {
    let mut layout = if is_vdb(path) {
        vdb::layout(path, options)?
    } else {
        if let Some(name) = &options.grid {
            let reason = format!(
                "--grid {name} names a grid of a .vdb, and {} is none; its nodes name their grids themselves (extras.cloudvdb.grid)",
                path.display()
            );
            return Err(Error::Usage(reason));
        }
        if options.fire != FireSpec::default() {
            let reason = format!(
                "--emission, --temperature and --soot are for a .vdb, and {} is none; its nodes say how they shine (extras.cloudvdb: emission, temperature, soot)",
                path.display()
            );
            return Err(Error::Usage(reason));
        }
        gltf::layout(path, &container::read(path)?, options, progress)?
    };
    options.overrides.apply(&mut layout.scene).map_err(|e| e.of_file(path))?;
    fire::kindle(&layout.embers, options.overrides.periodic, &mut layout.scene).map_err(|e| e.of_file(path))?;
    // A clear sky goes with the sun that the scene has now.
    let sky = options.sky.as_ref().or(layout.sky.as_ref().filter(|_| options.overrides.sky.is_none()));
    if let Some(sky) = sky {
        sky.lay(&mut layout.scene, &mut layout.notes).map_err(|e| e.of_file(path))?;
    }
    thick::refuse(path, &layout.scene)?;
    Ok(layout)
}
