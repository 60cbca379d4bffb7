//! Values: what a renderer cannot use, or shows otherwise than it was meant.

use super::figure::{count, figure};
use super::grid::{Grid, Values};
use super::{Findings, Severity};

/// A volume's Render > Clipping in Blender: Cycles takes voxels of this value and less for empty space.
const CLIPPING: f64 = 1e-3;
/// The largest finite 16-bit float: EEVEE and the Solid view keep values as such (`GPU_R16F` in Blender's source).
const LARGEST_HALF: f64 = 65504.0;
/// What counts as near 0..1.
const USUAL: [f64; 2] = [0.01, 100.0];

/// Looks at the values of the density.
pub fn judge(grid: &Grid, values: &Values, findings: &mut Findings) {
    let name = &grid.name;
    if values.nan + values.infinite > 0 {
        let says = format!(
            "The grid {name:?} holds {} that {} no finite number: {} NaN, {} infinite. Cycles takes NaN as 0 and has \
             holes where values are infinite; others may go black.",
            count(values.nan + values.infinite, "value"),
            if values.nan + values.infinite == 1 { "is" } else { "are" },
            values.nan,
            values.infinite
        );
        let fix = "Replace them by 0 where the file was made (Houdini: a Volume Wrangle with if (!isfinite(@density)) @density = 0;)";
        findings.grid(grid, "not-finite", Severity::Problem, says, fix);
    }
    if values.negative > 0 {
        let says = format!(
            "{} of the grid {name:?} {} negative, down to {}. Cycles takes them as 0.",
            count(values.negative, "value"),
            if values.negative == 1 { "is" } else { "are" },
            figure(values.lowest)
        );
        let fix = "If they are noise of a filter, leave them or clamp them to 0; if many, it may be another field than a density";
        findings.grid(grid, "negative", Severity::Hint, says, fix);
    }
    if values.inactive > 0 {
        let says = format!(
            "{} of the grid {name:?} hold values other than 0. Blender 4.5 shows them where active ones are near, 5.2 does not.",
            count(values.inactive, "inactive voxel")
        );
        let fix = "Activate them if they belong to the cloud (Houdini: VDB Activate; pyopenvdb: accessor.setValueOn), else set them to 0";
        findings.grid(grid, "inactive", Severity::Problem, says, fix);
    }
    if values.background != 0.0 {
        let says = format!(
            "The background of the grid {name:?} is {} and not 0. Blender 4.5 shows a haze of it in blocks around the cloud.",
            figure(values.background)
        );
        let fix = "Set the background to 0 and write it again (pyopenvdb: copyToArray, copyFromArray into FloatGrid(0.0))";
        findings.grid(grid, "background", Severity::Problem, says, fix);
    }
    range(grid, values.highest, findings);
}

/// How far the largest value is from 1.
fn range(grid: &Grid, highest: f64, findings: &mut Findings) {
    let name = &grid.name;
    let most = figure(highest);
    let by = figure(1.0 / highest);
    if highest <= CLIPPING {
        let says = format!(
            "The largest value of the grid {name:?} is {most}. Cycles takes what is not above {CLIPPING} for empty space, whatever the Density: \
             nothing shows."
        );
        let fix = format!("Set Clipping to 0 (Object Data > Render), or multiply the values by {by} and divide the Density by that");
        findings.grid(grid, "clipped", Severity::Problem, says, fix);
    } else if highest > LARGEST_HALF {
        let says = format!(
            "The largest value of the grid {name:?} is {most}. EEVEE and the Solid view keep 16-bit floats, which end at {LARGEST_HALF}."
        );
        findings.grid(grid, "range", Severity::Hint, says, format!("Multiply the values by {by}, and divide the Density by that"));
    } else if !(USUAL[0]..=USUAL[1]).contains(&highest) {
        let says =
            format!("The largest value of the grid {name:?} is {most}, far from 0..1: a Density that suits other clouds does not suit it.");
        findings.grid(
            grid,
            "range",
            Severity::Hint,
            says,
            format!("Multiply the values by {by}, or go by the optical depth to set the Density"),
        );
    }
}
