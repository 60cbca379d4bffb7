//! From regions to grids.

use super::Job;
use crate::bake::{Bake, Baked};
use crate::error::{Error, Result};
use crate::export::emission::EmissionGrid;
use crate::export::report::{Grids, Report};
use crate::export::vdb::{VdbOptions, Voxels};
use crate::import;
use crate::integrate::SourceFunction;
use crate::plan::{Density, Plan};
use crate::progress::Progress;
use crate::scene::{Region, Scene};
use crate::vdb::Meta;

/// How often voxels are made wider until the file is small enough.
const ATTEMPTS: u32 = 8;
/// By how much more than the sizes say, so that the next attempt fits.
const SPARE: f64 = 1.02;

/// Makes the grids, with what else a `.vdb` holds and the light of a bake, and tells the report.
pub(super) fn make(
    job: &Job,
    scene: &Scene,
    written: &[Region],
    light: Option<(Bake, &SourceFunction)>,
    metadata: &[(String, Meta)],
    report: &mut Report,
    watch: &dyn Progress,
) -> Result<Voxels> {
    let mut options = job.vdb.clone();
    let mut attempts = 1;
    let (voxels, notes) = loop {
        let (voxels, notes) = once(job, scene, written, light, &options, watch)?;
        let Some(most) = job.bake.most_bytes else { break (voxels, notes) };
        let bytes = voxels.bytes(options.half, metadata)?;
        if bytes <= most {
            break (voxels, notes);
        }
        if attempts == ATTEMPTS {
            let reason = format!(
                "the VDB of {} still has {:.2} MB with voxels of {:.3} m",
                job.input.display(),
                bytes as f64 / 1e6,
                voxels.voxel_size
            );
            return Err(Error::Scene { reason, fix: "Give --max-mb more, or write fewer grids".into() });
        }
        attempts += 1;
        options.voxel_size = Some(voxels.voxel_size * (SPARE * (bytes as f64 / most as f64).cbrt()));
    };
    if attempts > 1 {
        report.notes.push(format!("voxels are {} m, so that the file is within --max-mb", voxels.voxel_size));
    }
    if voxels.coarsened {
        report.notes.push(format!(
            "voxels are {} m, coarser than the regions ask for, to stay within --max-voxels {}",
            voxels.voxel_size, job.vdb.max_voxels
        ));
    }
    report.notes.extend(notes);
    report.vdb = Some(Grids {
        density_scale: voxels.density_scale,
        voxel_size: voxels.voxel_size,
        coarsened: voxels.coarsened,
        up: job.vdb.up,
        grids: voxels.summary(),
        emission: voxels.emission().iter().map(EmissionGrid::summary).collect(),
    });
    Ok(voxels)
}

/// The grids, and sentences about what is left out.
fn once(
    job: &Job,
    scene: &Scene,
    written: &[Region],
    light: Option<(Bake, &SourceFunction)>,
    options: &VdbOptions,
    watch: &dyn Progress,
) -> Result<(Voxels, Vec<String>)> {
    let mut voxels = Voxels::new(scene, written, options, watch)?;
    if !scene.flames.is_empty() {
        let shown = Plan::for_scene(scene, Density::Source).scene(scene).into_owned();
        voxels.burn(&shown.flames, options.max_voxels, watch)?;
    }
    if let Some(((bake, source), density)) = light.zip(voxels.density()) {
        let baked = Baked::new(bake, source, density, voxels.turned(), watch)?;
        voxels.shine(baked);
    }
    let notes = if import::is_vdb(&job.input) { voxels.take_along(import::others(&job.input, &job.import)?) } else { Vec::new() };
    Ok((voxels, notes))
}
