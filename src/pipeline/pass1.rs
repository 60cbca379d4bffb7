//! Pass 1 and the duality of a scene, and whether anything came of it.

use super::account::Clock;
use crate::error::{Error, Result};
use crate::photon::{Model, PhotonMap, Shot, Tracer};
use crate::plan::{Density, Plan};
use crate::progress::Progress;
use crate::regions::{Duality, Synthesis, synthesise};
use crate::scene::{Region, Scene, Shape};

/// Fewer photons than this say nothing about where light scatters.
const FEWEST: u64 = 100;

/// What pass 1 leaves.
pub struct Pass1 {
    /// What traced the photons.
    pub tracer: Tracer,
    /// The stored photons, and what they took.
    pub shot: Shot,
    /// The regions made of them.
    pub synthesis: Synthesis,
}

impl Pass1 {
    /// Traces `photons` and makes regions of them.
    ///
    /// # Errors
    /// [`Error::Interrupted`], and [`Error::Scene`] where light finds no region, or no region comes out.
    pub fn of(scene: &Scene, photons: u64, duality: &Duality, clock: &mut Clock, progress: &dyn Progress) -> Result<Self> {
        let tracer = Tracer::new(scene, &Plan::for_scene(scene, Density::Duality), duality.model);
        let shot = tracer.fill(photons, duality.seed, progress)?;
        clock.end("photons");
        let synthesis = synthesise(scene, &shot.map, duality, progress)?;
        clock.end("regions");
        if synthesis.regions.is_empty() || shot.map.len() < FEWEST.min(photons) {
            return Err(too_thin(scene, &shot, &synthesis));
        }
        Ok(Pass1 { tracer, shot, synthesis })
    }

    /// The regions; and the photons that light them where the model takes those of pass 1, as the text does.
    pub fn regions(self, model: Model) -> (Vec<Region>, Option<PhotonMap>) {
        (self.synthesis.regions, (model == Model::Hura2006).then_some(self.shot.map))
    }
}

/// Why no region could be made, and what would do.
fn too_thin(scene: &Scene, shot: &Shot, synthesis: &Synthesis) -> Error {
    let thickest = scene
        .regions
        .iter()
        .max_by(|a, b| (a.medium.sigma_t() * a.shape.thickness()).total_cmp(&(b.medium.sigma_t() * b.shape.thickness())));
    let Some(region) = thickest else {
        return Error::Scene { reason: "there is no region".into(), fix: "Add one".into() };
    };
    let (sigma, across) = (region.medium.sigma_t(), region.shape.thickness());
    if region.medium.albedo() == 0.0 {
        return Error::Scene {
            reason: format!("{} absorbs all light: no photon scatters", region.name),
            fix: "Give it a sigma_s (or an albedo) above zero".into(),
        };
    }
    let (stored, wanted) = synthesis.sources.iter().map(|s| (s.photons, s.estimate)).max().unwrap_or_default();
    let reason = match shot.map.len() {
        n if n < FEWEST => format!(
            "only {n} of {} photons are stored, because hardly any scatters twice: the thickest region, {}, has optical depth {:.3e} across",
            shot.emitted,
            region.name,
            sigma * across
        ),
        _ => format!(
            "no region came out: the fullest one holds {stored} photons, but nowhere do {wanted} of them lie within a free path ({:.3e} m; {} has optical depth {:.3} across)",
            free_path(region),
            region.name,
            sigma * across
        ),
    };
    Error::Scene {
        reason,
        fix: format!(
            "A sigma_t of {:.4} per metre would give it optical depth 40 (a cloud); more --photons or a smaller --estimate may also help",
            40.0 / across
        ),
    }
}

/// The free path where a region is dense, m.
fn free_path(region: &Region) -> f64 {
    match &region.shape {
        Shape::Grid(grid) => grid.breadth() / (region.medium.sigma_t() * grid.thickest()),
        _ => 1.0 / region.medium.sigma_t(),
    }
}
