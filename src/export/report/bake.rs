//! What the report says about baked light.

use crate::bake::{Bake, BakeError, Baked, Term};
use crate::integrate::Part;
use serde::Serialize;

/// Light beside the density.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BakeReport {
    /// What of its directions.
    pub bake: Bake,
    /// The lights: what a sample of 1 stands for, and its colour.
    pub parts: Vec<Part>,
    /// The mean cosine of sunlight that scattered once.
    pub g: f64,
    /// The mean cosine of each light's lobe about the sun; 0 without one.
    pub lobes: Vec<f64>,
    /// Photons that were followed.
    pub photons: u64,
    /// The grids.
    pub grids: Vec<LightSummary>,
    /// How far its picture is off the path tracer's: from the camera, and from two others; empty where nobody looked.
    pub errors: Vec<BakeError>,
}

/// A grid of light.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LightSummary {
    /// Its name.
    pub name: String,
    /// What it holds.
    pub term: Term,
    /// Of which light, from 0.
    pub part: usize,
    /// Samples that are not zero.
    pub active_voxels: u64,
}

impl BakeReport {
    /// The account of what was baked.
    pub fn of(baked: &Baked, errors: Vec<BakeError>) -> Self {
        let one = |grid: &crate::bake::LightGrid| LightSummary {
            name: grid.name.clone(),
            term: grid.term,
            part: grid.part,
            active_voxels: grid.bricks.active_voxels(),
        };
        BakeReport {
            bake: baked.bake,
            parts: baked.parts.clone(),
            g: baked.mean_cosine,
            lobes: baked.lobes.clone(),
            photons: baked.photons,
            grids: baked.grids.iter().map(one).collect(),
            errors,
        }
    }

    /// The line of the table for people.
    pub(super) fn line(&self) -> String {
        let names: Vec<&str> = self.grids.iter().map(|grid| grid.name.as_str()).collect();
        let scales: Vec<String> = self.parts.iter().map(|part| format!("{:.6}", part.scale)).collect();
        let off: Vec<String> = self
            .errors
            .iter()
            .map(|e| {
                let whose = if e.turned == 0.0 { "from its camera".into() } else { format!("turned by {:.0} degrees", e.turned) };
                format!("{whose} {:+.1} +- {:.1} % in the mean, {:.1} % in blocks", 100.0 * e.mean, 100.0 * e.mean_se, 100.0 * e.rms)
            })
            .collect();
        let off = if off.is_empty() { String::new() } else { format!("off       {}\n", off.join("; ")) };
        format!("baked     {} ({} W m^-2 sr^-1 a unit), by {} photons\n{off}", names.join(", "), scales.join(", "), self.photons)
    }
}
