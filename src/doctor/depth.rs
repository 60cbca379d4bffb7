//! Optical depth: whether anything shows, and how many bounces light needs.

use super::figure::figure;
use super::grid::{Grid, Values};
use super::{Findings, Severity};
use serde::Serialize;

/// Through the thickest column 2 % of the light is taken: nothing shows.
const NOTHING: f64 = 0.02;
/// 18 %: a breath of haze.
const FAINT: f64 = 0.2;
/// What is proposed where it is too thin: a dense smoke.
const SMOKE: f64 = 10.0;
/// What is proposed where it is too thick: a bright cumulus.
const CLOUD: f64 = 40.0;
/// Bounces a unit of optical depth. A white ball of optical depth 8, 32 or 128 across, lit from the side by a sun, had 99, 96 and
/// 94 % of its light in Cycles 4.5 at g 0.85 with twice as many (95, 94 and 98 % at g 0).
const BOUNCES: f64 = 2.0;
/// The most that Cycles allows.
const MOST_BOUNCES: f64 = 1024.0;
/// From here on what bounces are for shows plainly.
const SCATTERING: f64 = 4.0;

/// The optical depth of the thickest column along each of the grid's axes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Depth {
    /// The grid.
    pub grid: String,
    /// The Principled Volume's Density that it is for.
    pub density: f64,
    /// Where that is from: `density_scale`, the file's own, or `default`, Blender's.
    pub density_from: &'static str,
    /// Along the grid's x, y and z.
    pub along: [f64; 3],
    /// What to set Density to.
    pub set_density: f64,
    /// What to set Cycles' Light Paths > Max Bounces > Volume and Total to, at that Density, if the Color is near white.
    pub set_bounces: u32,
}

/// Measures the density, and says what follows; `None` where it cannot be measured.
pub fn judge(grid: &Grid, values: &Values, findings: &mut Findings) -> Option<Depth> {
    let transform = grid.transform.as_ref()?;
    let Some(columns) = values.columns else {
        let says = format!(
            "Tiles of the grid {:?} span more columns of voxels than are looked through: its optical depth is not known.",
            grid.name
        );
        findings.grid(grid, "not-measured", Severity::Hint, says, "Remove tiles far from the cloud, or resample it coarser");
        return None;
    };
    let scale = grid.metadata.get("density_scale").and_then(serde_json::Value::as_f64).filter(|&s| s > 0.0 && s.is_finite());
    let density = scale.unwrap_or(1.0);
    let along: [f64; 3] = std::array::from_fn(|a| density * columns.sum[a] * transform.voxel[a]);
    let (thinnest, thickest) = along.iter().fold((f64::INFINITY, 0.0f64), |(low, high), &t| (low.min(t), high.max(t)));
    if !(thickest > 0.0 && thickest.is_finite()) {
        return None;
    }
    let name = &grid.name;
    let at = format!("the largest value is {}, Density {}", figure(values.highest), figure(density));
    let mut set = density;
    if thickest < FAINT {
        set = round(density * SMOKE / thickest);
        let (severity, shows) = if thickest < NOTHING { (Severity::Problem, "Nothing shows.") } else { (Severity::Hint, "It is faint.") };
        let says = format!(
            "Through its thickest column the grid {name:?} has optical depth {} ({at}): {} of the light is taken. {shows}",
            figure(thickest),
            percent(-(-thickest).exp_m1())
        );
        findings.grid(
            grid,
            "thin",
            severity,
            says,
            format!("Set the Principled Volume's Density to {}: optical depth {SMOKE}", figure(set)),
        );
    } else if thinnest * BOUNCES > MOST_BOUNCES {
        set = round(density * CLOUD / thinnest);
        let says = format!(
            "Along its thinnest axis the grid {name:?} has optical depth {} ({at}). Its light needs some {} bounces, Cycles ends at \
             {MOST_BOUNCES}: it comes out dark, with a hard surface. A cloud has 10 to 100.",
            figure(thinnest),
            figure(thinnest * BOUNCES)
        );
        findings.grid(
            grid,
            "thick",
            Severity::Problem,
            says,
            format!("Set the Principled Volume's Density to {}: optical depth {CLOUD}", figure(set)),
        );
    }
    let bounces = bounces(thinnest * set / density);
    if thinnest >= SCATTERING {
        let says = format!(
            "Light scatters many times at optical depth {}; Cycles' default of 0 volume bounces leaves it dark.",
            figure(thinnest * set / density)
        );
        let fix = format!(
            "Render Properties > Light Paths > Max Bounces: Total and Volume both to {bounces}; Color near white, since each bounce \
             multiplies by it"
        );
        findings.grid(grid, "bounces", Severity::Hint, says, fix);
    }
    let density_from = if scale.is_some() { "density_scale" } else { "default" };
    Some(Depth { grid: name.clone(), density, density_from, along, set_density: set, set_bounces: bounces })
}

/// Bounces for an optical depth, as a power of two from 4 to Cycles' most.
fn bounces(depth: f64) -> u32 {
    ((depth * BOUNCES).ceil().clamp(4.0, MOST_BOUNCES) as u32).next_power_of_two()
}

/// Two significant digits.
fn round(value: f64) -> f64 {
    format!("{value:.1e}").parse().unwrap_or(value)
}

fn percent(share: f64) -> String {
    format!("{} %", figure(100.0 * share))
}
