//! From regions to light beside their voxels.

use super::Job;
use crate::bake::{Bake, Beside, judge};
use crate::error::Result;
use crate::export::report::{BakeReport, Report};
use crate::export::vdb::Voxels;
use crate::integrate::{SourceFunction, SourceSettings};
use crate::plan::{Density, Plan};
use crate::progress::Progress;
use crate::scene::{Air, Framed, Scene};
use glam::DAffine3;
use std::borrow::Cow;

/// What is baked, and how large the file may be.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Baking {
    /// The light that goes beside the density, if any does.
    pub light: Option<Bake>,
    /// Whether it is compared with the path tracer's pictures.
    pub checked: bool,
    /// The most that the VDB may have, bytes.
    pub most_bytes: Option<u64>,
}

/// The scene that a bake is of: without air, which Blender's volume is not in either.
pub(super) fn without_air<'a>(job: &Job, scene: &'a Scene, notes: &mut Vec<String>) -> Cow<'a, Scene> {
    if scene.air.is_empty() || job.bake.light.is_none() {
        return Cow::Borrowed(scene);
    }
    notes.push("the light is baked as without the atmosphere: in Blender, add air of your own (a volume around the scene)".into());
    Cow::Owned(Scene { air: Air::default(), ..scene.clone() })
}

/// Follows the light of a scene with the run's regions.
pub(super) fn follow(job: &Job, bake: Bake, scene: &Scene, framed: &Framed, watch: &dyn Progress) -> Result<SourceFunction> {
    let plan = Plan::for_scene(scene, Density::Source);
    let settings = SourceSettings { photons: job.photons, memory: job.picture.voxel_memory(), seed: job.duality.seed };
    SourceFunction::new(scene, &plan, bake.kept(&framed.camera), &settings, watch)
}

/// Compares the light beside the density with the truth, where that is asked for, and tells the report.
pub(super) fn check(job: &Job, voxels: &Voxels, scene: &Scene, framed: &Framed, report: &mut Report, watch: &dyn Progress) -> Result<()> {
    let Some((baked, density)) = voxels.light().zip(voxels.density()) else { return Ok(()) };
    let back = voxels.turned().map_or(DAffine3::IDENTITY, |turn| turn.inverse());
    let flames = voxels.emission().iter().map(|grid| grid.as_flame(back)).collect();
    let beside = Beside { density, density_scale: voxels.density_scale, flames, turned: voxels.turned() };
    let view = (&framed.camera, f64::from(framed.width) / f64::from(framed.height), job.duality.seed);
    let errors = if job.bake.checked { judge(baked, beside, scene, view, watch)? } else { Vec::new() };
    report.bake = Some(BakeReport::of(baked, errors));
    Ok(())
}
