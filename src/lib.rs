//! cloudvdb: photon-cloud regions from a layout, written as OpenVDB grids; and pictures of clouds, with their error.
//!
//! A layout (spheres, slabs, closed meshes in a glTF file) is lit by a sun; photons are traced through it; where they
//! scatter more than once and lie close together, new regions are made (the duality); these are written as voxels. The
//! method is Joseph Hura's, *Ray tracing clouds using a stochastic photon-particle duality* (2006), "the thesis" below.
//!
//! ```text
//! .gltf .glb ──import──► Scene ──► Plan ──► photons ──► PhotonMap ──► regions ──voxelise──► density ──► .vdb
//! .vdb ──────────┘         │                                             │
//!                          └──────────── --density source ──────────────►┼──────────────────────────► .glb
//!                                                                        │
//!                                                                        ├──integrate──► Film ──► .exr .png
//!                                                                        │     ├──► flux: up, down, absorbed
//!                                                                        │     └──bake──► light ──► .vdb, .blend.py
//!                                         what was found, done, wrong ───┴──────────────────────────► .json
//! ```
//!
//! [`pipeline::run`] is that picture in code, and the page to read first. The parts, in its order:
//!
//! | module | what it does |
//! | --- | --- |
//! | [`import`] | glTF and VDB files to a [`scene::Scene`], with a line for each node or grid that says what became of it |
//! | [`scene`] | what is in the scene: regions with their media, surfaces, the sun, a camera |
//! | [`plan`] | which effects are simulated, which not, and why |
//! | [`media`] | the regions as rays see them: free flights and optical depths, in closed form and through voxels |
//! | [`photon`] | pass 1: photons leave the sun, scatter, and are stored |
//! | [`regions`] | the duality: new regions out of stored photons |
//! | [`integrate`] | what a camera sees of a scene: by unbiased path tracing, or by the thesis's pass 2; where the energy goes |
//! | [`bake`] | light beside the density: what absorbs and emits looks like what scatters |
//! | [`film`] | what each pixel receives, by the way it came, with its standard error |
//! | [`sculpt`] | metaballs, soft meshes, turbulent detail: what varies within itself, made into voxels |
//! | [`voxelise`] | regions to voxels, their optical mass kept |
//! | [`export`] | OpenVDB grids, regions as glTF, pictures, the report |
//! | [`vdb`] | OpenVDB behind a safe interface; the only unsafe code is its bridge |
//! | [`doctor`] | what would make a VDB look wrong or empty in Blender, and the fix |
//! | [`study`] | the thesis's evaluation again, its tables beside ours |
//! | [`cluster`] | several processes at one run, by MPI; what is done of a run, kept for the next start |
//! | [`cli`] | arguments, progress, signals, exit codes |
//! | [`errata`] | no code: where the thesis is wrong, what it costs, and the experiments that show it |
//!
//! The core (everything but `import`, `export`, `vdb`, `doctor`, `pipeline`, `study`, `cluster` and `cli`) opens no file and prints nothing; it tells
//! how far it is, and learns that it should stop, by [`progress::Progress`].
//!
//! # From the thesis's equations to functions
//!
//! [`photon::Model`] chooses between two readings: `Physical` (the default) corrects what `Hura2006` follows to the
//! letter. In pass 1 they differ in the private trait `photon::rules::Rules`.
//!
//! | equation | what it says | where it is |
//! | --- | --- | --- |
//! | 1 | sigma_t = sigma_a + sigma_s | [`scene::Medium::sigma_t`] |
//! | 3, 4 | optical depth and transmittance | [`media::Media::optical_depth`] (and e^-tau of it in [`photon::Tracer::sunlight_through`]) |
//! | 7 | the Henyey-Greenstein phase function | [`scene::phase::henyey_greenstein`] |
//! | 17 | the distance to the next collision | [`rng::Rng::optical_depth`], spent by [`media::Media::fly`]; with its ln 0 in `Rules for Hura2006` |
//! | 18 | roulette: scattered or absorbed | [`photon::Tracer::fill`] (its private `path`) |
//! | 19 | the angle of scattering | [`scene::phase::sample_henyey_greenstein`]; to the letter [`scene::phase::sample_eq19`] |
//! | 20 to 23, 30 | the volume radiance estimate: n nearest photons over their ball | private: `integrate::photon::gather::Gather::scattered`, over [`photon::Nearest`] |
//! | 24 | single and multiple scattering apart | the two halves of `integrate::photon::march`: sunlight that scattered once is looked at, the rest is stored |
//! | 25 | attenuation of a photon in flight | `Rules::attenuation`: 1 in the physical model, which has spent it by eq. 17 |
//! | 26 | diffuse reflection off a surface | [`sampling::cosine_hemisphere`] |
//! | 27 | new regions up to the old one's volume | [`regions::synthesise`] |
//! | 28, 29, 31 | marching through regions | `integrate::photon::march`, in the limit of short steps: no bias by the step |
//!
//! The same in pass 2: the models differ in what lights the regions, in how an estimate is normed, and in how a ray crosses
//! regions that overlap ([`integrate::photon`]). Each trap of the text has its figures in [`errata`]. The reference integrator
//! follows light itself and not the thesis. Of the phase functions only eq. 7 is used: eqs 5 and 6 are not normalised in the
//! thesis, and eq. 5 is eq. 7 at g = 0.
//!
//! # Conventions
//!
//! Right-handed, Z up, metres; extinction in 1/m, irradiance in W m^-2. Directions are those of propagation. World
//! transforms are `f64`, the hot loops `f32` about the scene's centre, sums `f64`. Random numbers come from a stream for
//! each (seed, stage, item), never for a thread: the same input gives the same bytes on any number of threads.
#![deny(unsafe_code)]
#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod bake;
pub mod bvh;
pub mod cli;
pub mod cluster;
pub mod doctor;
pub mod errata;
pub mod error;
pub mod export;
pub mod film;
pub mod geom;
pub mod import;
pub mod integrate;
pub mod media;
pub mod photon;
pub mod pipeline;
pub mod plan;
pub mod progress;
pub mod regions;
pub mod rng;
mod room;
pub mod sampling;
pub mod scene;
pub mod sculpt;
pub mod stats;
pub mod study;
pub mod trimesh;
pub mod vdb;
pub mod voxelise;

pub use error::{Error, Result};
