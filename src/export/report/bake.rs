//! What the report says about baked light.

use crate::bake::{Bake, Baked, Term};
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
    pub fn of(baked: &Baked) -> Self {
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
        }
    }

    /// The line of the table for people.
    pub(super) fn line(&self) -> String {
        let names: Vec<&str> = self.grids.iter().map(|grid| grid.name.as_str()).collect();
        let scales: Vec<String> = self.parts.iter().map(|part| format!("{:.6}", part.scale)).collect();
        format!("baked     {} ({} W m^-2 sr^-1 a unit), by {} photons\n", names.join(", "), scales.join(", "), self.photons)
    }
}
