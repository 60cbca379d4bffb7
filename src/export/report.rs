//! The report: what was found, planned, done and written, with seconds and errors. JSON, and a table for people.

use super::emission::EmissionSummary;
use super::vdb::GridSummary;
use crate::error::Result;
use crate::import::{Became, Finding};
use crate::photon::trace::{FATES, Fate};
use crate::photon::{Model, Shot};
use crate::plan::{Density, Effect, Plan};
use crate::progress::Spent;
use crate::regions::{Placement, Source};
use crate::scene::Overrides;
use crate::stats::Estimate;
use crate::voxelise::Up;
use serde::Serialize;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

mod bake;
mod render;

pub use bake::BakeReport;
pub use render::{Expected, Level, Render, percent};

/// Everything a run says about itself.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// The program's version.
    pub cloudvdb: &'static str,
    /// The input as named.
    pub input: PathBuf,
    /// SHA-256 of the input.
    pub source_hash: String,
    /// The settings that make the same bytes again.
    pub settings: Settings,
    /// What the file held, by name, and what became of it.
    pub found: Vec<Finding>,
    /// Assumptions and warnings, in sentences.
    pub notes: Vec<String>,
    /// The effects, on or off, and why.
    pub plan: Plan,
    /// How many regions there were and are.
    pub regions: Regions,
    /// Optical mass, the integral of sigma_t over space, m^2.
    pub optical_mass: Mass,
    /// Pass 1; absent where no photon was traced.
    pub photons: Option<Photons>,
    /// Where the power that met the regions went; absent where no photon was traced.
    pub energy: Option<Energy>,
    /// The statistical error of what was written; absent where nothing is random.
    pub error: Option<Errors>,
    /// The grids; absent where none was written.
    pub vdb: Option<Grids>,
    /// Light beside the density; absent where none was baked.
    pub bake: Option<BakeReport>,
    /// The picture; absent where none was taken.
    pub render: Option<Render>,
    /// What ranks took to work together; absent where one process worked alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub together: Option<Spent>,
    /// Seconds by stage.
    pub stages: Vec<Stage>,
    /// Seconds in all.
    pub seconds: f64,
    /// The most memory held at once, in bytes.
    pub peak_memory: u64,
    /// The files that were written.
    pub outputs: Vec<PathBuf>,
}

/// The settings of a run.
#[derive(Debug, Clone, Serialize)]
pub struct Settings {
    /// Which medium is written.
    pub density: Density,
    /// Which reading of the thesis.
    pub model: Model,
    /// Where candidates for regions are drawn.
    pub placement: Placement,
    /// Photons to be stored.
    pub photons: u64,
    /// Photons that must lie within the search distance; absent: the square root of a region's photons.
    pub estimate: Option<u64>,
    /// The seed.
    pub seed: u64,
    /// The grids of a `.vdb` that are regions; absent: those named `density`.
    pub grid: Option<String>,
    /// What replaced the file's own media, sun and sky.
    pub overrides: Overrides,
}

/// Regions before and after.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Regions {
    /// In the layout.
    pub source: usize,
    /// Made by the duality.
    pub synthesised: usize,
    /// The share of the new regions' volume outside the regions they came from.
    pub sticking_out: f64,
    /// The duality, region by region.
    pub sources: Vec<Source>,
}

/// Optical masses in m^2.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct Mass {
    /// Of the layout.
    pub source: f64,
    /// Of the regions that are written.
    pub written: f64,
    /// Missing, where the duality's stopping rule ended it early.
    pub missing: f64,
}

/// Counts of pass 1.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Photons {
    /// Emitted.
    pub emitted: u64,
    /// Stored in the map.
    pub stored: u64,
    /// Collisions traced.
    pub collisions: u64,
    /// Collisions a photon, in the mean.
    pub collisions_per_photon: f64,
}

/// The energy balance, as shares of the power that was aimed at the regions or that surfaces sent toward them.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Energy {
    /// Absorbed in regions.
    pub absorbed_medium: Estimate,
    /// Absorbed by surfaces.
    pub absorbed_surface: Estimate,
    /// Left the scene.
    pub escaped: Estimate,
    /// Lost to the thesis's eq. 25; only with `--model hura2006`.
    pub attenuated: Estimate,
    /// Cut after a million collisions.
    pub truncated: Estimate,
    /// What chance took at surfaces and did not give back; zero within its error.
    pub roulette: Estimate,
    /// All of the above less 1.
    pub imbalance: f64,
}

/// How wrong what was written may be.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Errors {
    /// The relative standard error of the photon density that decided each region, 1 / sqrt(n): the mean over regions.
    pub photon_density: f64,
    /// The share of sunlight that crosses the layout without a collision.
    pub sunlight_through_layout: Estimate,
    /// The share that crosses the regions written: the difference is what random placement changes.
    pub sunlight_through_regions: Estimate,
    /// The relative shortfall of optical mass.
    pub optical_mass: f64,
    /// Photons that would halve `photon_density`.
    pub photons_for_half: u64,
    /// About how many seconds that would take.
    pub seconds_for_half: f64,
}

/// The grids of the VDB.
#[derive(Debug, Clone, Serialize)]
pub struct Grids {
    /// 1/m for a sample of 1: Blender's Principled Volume Density.
    pub density_scale: f64,
    /// The shortest edge of a voxel, in metres.
    pub voxel_size: f64,
    /// Whether `--max-voxels` made the voxels coarser than they would be.
    pub coarsened: bool,
    /// Which axis is up.
    pub up: Up,
    /// The grids.
    pub grids: Vec<GridSummary>,
    /// Those of what shines by itself.
    pub emission: Vec<EmissionSummary>,
}

/// One stage.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Stage {
    /// Its name.
    pub stage: &'static str,
    /// How long it took.
    pub seconds: f64,
}

impl Photons {
    /// The counts of a finished pass 1.
    pub fn of(shot: &Shot) -> Self {
        let stored = shot.map.len();
        Photons {
            emitted: shot.emitted,
            stored,
            collisions: shot.collisions,
            collisions_per_photon: shot.collisions as f64 / shot.traced.max(1) as f64,
        }
    }
}

impl Energy {
    /// The balance of a finished pass 1.
    pub fn of(shot: &Shot) -> Self {
        let share = |fate: Fate| shot.energy.ratio(fate as usize);
        let sum: f64 = (0..FATES).map(|i| shot.energy.ratio(i).value).sum();
        Energy {
            absorbed_medium: share(Fate::AbsorbedMedium),
            absorbed_surface: share(Fate::AbsorbedSurface),
            escaped: share(Fate::Escaped),
            attenuated: share(Fate::Attenuated),
            truncated: share(Fate::Truncated),
            roulette: share(Fate::Roulette),
            imbalance: sum - 1.0,
        }
    }
}

impl Report {
    /// Writes the report as JSON.
    ///
    /// # Errors
    /// [`crate::Error::Write`].
    pub fn write(&self, path: &Path) -> Result<()> {
        super::staged::write_bytes(path, (self.json() + "\n").as_bytes())
    }

    /// The report as JSON.
    pub fn json(&self) -> String {
        serde_json::to_string_pretty(self).unwrap_or_default()
    }

    /// The report as a table for people; `verbose` names everything that was found and every effect.
    pub fn table(&self, verbose: bool) -> String {
        let mut t = String::new();
        let count = |b: Became| self.found.iter().filter(|f| f.became == b).count();
        // Writing to a String cannot fail.
        let _ = writeln!(
            t,
            "{}: {} regions, {} surfaces, {} ignored",
            self.input.display(),
            count(Became::Region),
            count(Became::Surface),
            count(Became::Ignored)
        );
        if verbose {
            for f in &self.found {
                let _ = writeln!(t, "  {} -> {}: {}", f.node, format!("{:?}", f.became).to_lowercase(), f.why);
            }
            t += &plan_table(&self.plan);
        }
        for note in &self.notes {
            let _ = writeln!(t, "note: {note}");
        }
        if let Some(p) = &self.photons {
            let _ = writeln!(t, "photons   {} emitted, {} stored, {:.1} collisions each", p.emitted, p.stored, p.collisions_per_photon);
        }
        if let Some(e) = &self.energy {
            let part = |e: Estimate| format!("{:.2} +- {:.2} %", 100.0 * e.value, 100.0 * e.se);
            let _ = write!(
                t,
                "energy    {} absorbed, {} by surfaces, {} escaped",
                part(e.absorbed_medium),
                part(e.absorbed_surface),
                part(e.escaped)
            );
            for (rest, words) in [(e.attenuated, "lost to eq. 25"), (e.truncated, "cut after a million collisions")] {
                if rest.value > 0.0 {
                    let _ = write!(t, ", {} {words}", part(rest));
                }
            }
            t.push('\n');
        }
        if self.photons.is_some() {
            let r = &self.regions;
            let _ = writeln!(
                t,
                "regions   {} from {} of the layout; {:.1} % of their volume sticks out",
                r.synthesised,
                r.source,
                100.0 * r.sticking_out
            );
        }
        if let Some(v) = &self.vdb {
            let voxels: u64 = v.grids.iter().map(|g| g.active_voxels).sum();
            let _ = writeln!(
                t,
                "grid      {voxels} voxels of {:.4} m{}; in Blender set Density to {}",
                v.voxel_size,
                if v.coarsened { " (coarsened to fit --max-voxels)" } else { "" },
                significant(v.density_scale)
            );
            for grid in &v.emission {
                let [r, g, b] = grid.tint.map(significant);
                let scale = significant(grid.scale);
                let _ = writeln!(t, "shines    {}: {scale} W m^-3 sr^-1 a unit, of the colour {r}, {g}, {b}", grid.name);
            }
        }
        if let Some(e) = &self.error {
            let _ = writeln!(
                t,
                "error     {:.1} % in the photon density of a region, {:.2} % of the optical mass missing; {} photons{} would halve the first in about {}",
                100.0 * e.photon_density,
                100.0 * e.optical_mass,
                e.photons_for_half,
                self.settings.estimate.map_or(String::new(), |n| format!(" with --estimate {}", 4 * n)),
                duration(e.seconds_for_half)
            );
            let through = |e: Estimate| format!("{:.2} +- {:.2} %", 100.0 * e.value, 100.0 * e.se);
            let _ = writeln!(
                t,
                "sunlight  {} passes the layout, {} the regions written",
                through(e.sunlight_through_layout),
                through(e.sunlight_through_regions)
            );
        }
        if let Some(bake) = &self.bake {
            t += &bake.line();
        }
        if let Some(r) = &self.render {
            t += &r.line();
        }
        let stages: Vec<String> = self.stages.iter().map(|s| format!("{} {:.2}", s.stage, s.seconds)).collect();
        let _ = writeln!(t, "time      {:.2} s ({}), {:.0} MB", self.seconds, stages.join(", "), self.peak_memory as f64 / 1e6);
        for output in &self.outputs {
            let _ = writeln!(t, "wrote {}", output.display());
        }
        if let Some(r) = &self.render {
            t += &r.cost();
        }
        t
    }
}

/// The plan as a table for people.
pub fn plan_table(plan: &Plan) -> String {
    let name = |n| serde_json::to_value(n).ok().and_then(|v| v.as_str().map(String::from)).unwrap_or_default();
    plan.effects
        .iter()
        .map(|e| format!("  {:<20} {:<4} {}{}\n", name(e.name), if e.on { "on" } else { "off" }, e.reason, bound(e)))
        .collect()
}

fn bound(effect: &Effect) -> String {
    match effect.bound {
        bound if bound <= 0.0 => String::new(),
        bound if bound < 1.0 => format!(" (leaving it out changes at most {:.2} %)", 100.0 * bound),
        _ => " (leaving it out may change everything)".into(),
    }
}

/// Four significant digits.
fn significant(x: f64) -> String {
    let rounded: f64 = format!("{x:.3e}").parse().unwrap_or(x);
    rounded.to_string()
}

/// Seconds for people: about two digits, in a unit that fits.
pub fn duration(seconds: f64) -> String {
    match seconds {
        ..10.0 => format!("{seconds:.1} s"),
        ..100.0 => format!("{seconds:.0} s"),
        ..6000.0 => format!("{:.0} min", seconds / 60.0),
        ..172_800.0 => format!("{:.0} h", seconds / 3600.0),
        _ => format!("{:.0} days", seconds / 86400.0),
    }
}

/// The most memory this process has held, in bytes, where the system says so.
pub fn peak_memory() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let kilobytes = status.lines().find_map(|l| l.strip_prefix("VmHWM:")).and_then(|l| l.split_whitespace().next()?.parse::<u64>().ok());
    kilobytes.unwrap_or(0) * 1024
}
