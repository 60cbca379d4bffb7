//! From regions to light beside their voxels.

use super::Job;
use crate::bake::{Bake, Baked};
use crate::error::Result;
use crate::export::report::{BakeReport, Report};
use crate::export::vdb::Voxels;
use crate::integrate::{SourceFunction, SourceSettings};
use crate::plan::{Density, Plan};
use crate::progress::Progress;
use crate::scene::{Framed, Scene};

/// What is baked, and how large the file may be.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Baking {
    /// The light that goes beside the density, if any does.
    pub light: Option<Bake>,
    /// The most that the VDB may have, bytes.
    pub most_bytes: Option<u64>,
}

/// Follows the light of a scene with the run's regions.
pub(super) fn follow(job: &Job, bake: Bake, scene: &Scene, framed: &Framed, watch: &dyn Progress) -> Result<SourceFunction> {
    let plan = Plan::for_scene(scene, Density::Source);
    let settings = SourceSettings { photons: job.photons, memory: job.picture.memory, seed: job.duality.seed };
    SourceFunction::new(scene, &plan, bake.kept(&framed.camera), &settings, watch)
}

/// Puts light beside the density, and tells the report.
pub(super) fn shine(bake: Bake, source: &SourceFunction, voxels: &mut Voxels, report: &mut Report, watch: &dyn Progress) -> Result<()> {
    let Some(density) = voxels.density() else { return Ok(()) };
    let baked = Baked::new(bake, source, density, voxels.turned(), watch)?;
    report.bake = Some(BakeReport::of(&baked));
    voxels.shine(baked);
    Ok(())
}
