//! `cloudvdb flux`: a scene in; where its light goes out.

use super::account::Clock;
use super::pass1::Pass1;
use crate::error::Result;
use crate::import::{self, ImportOptions};
use crate::integrate::flux::{self, Flux};
use crate::plan::{Density, Plan};
use crate::progress::{Progress, meet};
use crate::regions::Duality;
use crate::stats::Estimate;
use serde::Serialize;
use std::fmt::Write as _;
use std::path::PathBuf;
use std::time::Instant;

/// What to look at, and how hard.
#[derive(Debug, Clone)]
pub struct BalanceJob {
    /// The scene.
    pub input: PathBuf,
    /// How it is read.
    pub import: ImportOptions,
    /// Whether its regions are looked at, or those that the duality makes of them.
    pub density: Density,
    /// Photons to emit.
    pub photons: u64,
    /// The seed.
    pub seed: u64,
}

/// The energy balance of a scene.
#[derive(Debug, Clone, Serialize)]
pub struct Balance {
    /// The shares, which add up to 1.
    #[serde(flatten)]
    pub flux: Flux,
    /// The input as named.
    pub input: PathBuf,
    /// Assumptions and warnings, in sentences.
    pub notes: Vec<String>,
    /// Seconds in all.
    pub seconds: f64,
}

/// Photons that the duality stores on its way: the main job's default.
const STORED: u64 = 1_000_000;

/// Reads a scene and tells where its light goes.
///
/// # Errors
/// Everything in [`crate::Error`] but what is about writing.
pub fn balance(job: &BalanceJob, progress: &dyn Progress) -> Result<Balance> {
    let begun = Instant::now();
    progress.begin("import", 1);
    let mut scene = import::load(&job.input, &job.import, progress)?;
    meet(|| format!("{job:?} {}", scene.source_hash), progress)?;
    let named = |e: crate::Error| e.of_file(&job.input);
    if job.density == Density::Duality {
        let duality = Duality { seed: job.seed, ..Duality::default() };
        let pass1 = Pass1::of(&scene.scene, STORED, &duality, &mut Clock::start(), progress).map_err(named)?;
        scene.scene.regions = pass1.synthesis.regions;
    }
    let plan = Plan::for_scene(&scene.scene, Density::Source);
    if !scene.scene.air.is_empty() {
        scene.notes.push("the balance is that of regions and surfaces alone: the atmosphere is left out".into());
    }
    let flux = flux::flux(&scene.scene, &plan, job.photons, job.seed, progress).map_err(named)?;
    Ok(Balance { flux, input: job.input.clone(), notes: scene.notes, seconds: begun.elapsed().as_secs_f64() })
}

impl Balance {
    /// As JSON.
    pub fn json(&self) -> String {
        serde_json::to_string_pretty(self).unwrap_or_default()
    }

    /// As a table for people, without the notes.
    pub fn table(&self) -> String {
        let f = &self.flux;
        let shares = [
            ("up", f.up),
            ("down, direct", f.down_direct),
            ("down, diffuse", f.down_diffuse),
            ("absorbed in media", f.absorbed_medium),
            ("absorbed by surfaces", f.absorbed_surface),
        ];
        let mut t = format!("{}: of the sunlight that meets the media\n", self.input.display());
        // Writing to a String cannot fail.
        for (name, Estimate { value, se }) in shares {
            let _ = writeln!(t, "  {name:<22}{:>9.4} +- {:.4} %", 100.0 * value, 100.0 * se);
        }
        let sum: f64 = shares.iter().map(|(_, e)| e.value).sum();
        let _ = writeln!(t, "  {:<22}{:>9.4} %", "sum", 100.0 * sum);
        let _ = writeln!(t, "  {:<22}{:>9.4} +- {:.4} m^2", "of an area of", f.area.value, f.area.se);
        let (path, count) = (f.mean_path_length, f.mean_scatterings);
        let _ = writeln!(t, "  {:<22}{:>9.4} +- {:.4} m", "mean path length", path.value, path.se);
        let _ = writeln!(t, "  {:<22}{:>9.4} +- {:.4}", "mean scatterings", count.value, count.se);
        let _ = writeln!(t, "  {} photons, {} collisions, {:.2} s", f.photons, f.collisions, self.seconds);
        if f.truncated > 0 {
            let _ = writeln!(t, "  {} paths were cut after very many collisions, and count as absorbed in media", f.truncated);
        }
        t
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_balance_reads_as_a_table_and_as_json() {
        let share = |value| Estimate { value, se: 0.001 };
        let flux = Flux {
            area: share(2.0),
            up: share(0.5),
            down_direct: share(0.125),
            down_diffuse: share(0.25),
            absorbed_medium: share(0.125),
            absorbed_surface: share(0.0),
            mean_path_length: share(12.0),
            mean_scatterings: share(3.0),
            photons: 10,
            collisions: 30,
            truncated: 0,
        };
        let balance = Balance { flux, input: "a.vdb".into(), notes: vec!["n".into()], seconds: 1.0 };
        let table = balance.table();
        assert!(
            table.contains("50.0000 +- 0.1000 %")
                && table.contains("100.0000 %")
                && table.contains("2.0000 +- 0.0010 m^2")
                && !table.contains("cut"),
            "{table}"
        );
        let json: serde_json::Value = serde_json::from_str(&balance.json()).unwrap();
        assert_eq!((&json["up"]["value"], &json["down_direct"]["se"]), (&0.5.into(), &0.001.into()));
        assert_eq!((&json["photons"], &json["input"], &json["notes"][0]), (&10.into(), &"a.vdb".into(), &"n".into()));
    }
}
