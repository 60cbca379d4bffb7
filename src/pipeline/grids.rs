//! From regions to grids.

use super::Job;
use super::account::Clock;
use crate::error::Result;
use crate::export::report::{Grids, Report};
use crate::export::vdb::Voxels;
use crate::import;
use crate::progress::Progress;
use crate::scene::{Region, Scene};

/// Makes the grids, takes along what else a `.vdb` holds, and tells the report.
pub(super) fn make(
    job: &Job,
    scene: &Scene,
    written: &[Region],
    report: &mut Report,
    clock: &mut Clock,
    watch: &dyn Progress,
) -> Result<Voxels> {
    let mut voxels = Voxels::new(scene, written, &job.vdb, watch)?;
    clock.end("voxels");
    if voxels.coarsened {
        report.notes.push(format!(
            "voxels are {} m, coarser than the regions ask for, to stay within --max-voxels {}",
            voxels.voxel_size, job.vdb.max_voxels
        ));
    }
    if import::is_vdb(&job.input) {
        report.notes.extend(voxels.take_along(import::others(&job.input, &job.import)?));
    }
    report.vdb = Some(Grids {
        density_scale: voxels.density_scale,
        voxel_size: voxels.voxel_size,
        coarsened: voxels.coarsened,
        up: job.vdb.up,
        grids: voxels.summary(),
    });
    Ok(voxels)
}
