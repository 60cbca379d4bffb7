//! Names and types: which grid Blender takes for the density.

use super::grid::Grid;
use super::{Findings, Severity};
use crate::vdb::Unread;
use std::collections::BTreeMap;

/// The name that Blender's Principled Volume looks for unless told otherwise.
pub const DENSITY: &str = "density";

/// The grid that is judged as the density: the first named `density`; else the likeliest of the others.
pub fn chosen(grids: &[Grid]) -> Option<&Grid> {
    let likeliest = || grids.iter().filter_map(|grid| Some((grid, likelihood(grid)?))).rev().max_by_key(|(_, rank)| *rank);
    grids.iter().find(|grid| grid.name == DENSITY).or_else(|| likeliest().map(|(grid, _)| grid))
}

/// How likely a grid is meant as the density; `None` where it cannot be.
fn likelihood(grid: &Grid) -> Option<u32> {
    let values = grid.values.as_ref().filter(|values| values.active_voxels > 0)?;
    let called = grid.name.to_lowercase();
    let usual = ["density", "smoke", "cloud", "soot", "dust"].iter().any(|name| called.contains(name));
    let real = matches!(grid.value_type.as_str(), "float" | "double");
    let fits = !grid.is_level_set() && values.highest > 0.0;
    Some(8 * u32::from(fits) + 4 * u32::from(usual) + 2 * u32::from(real) + u32::from(grid.class == "fog volume"))
}

/// What names and types make wrong.
pub fn judge(grids: &[Grid], findings: &mut Findings) {
    if grids.is_empty() {
        let says = "There is no grid in this file.".to_string();
        return findings.file("no-grid", Severity::Problem, says, "Export it again, with the field that holds the density");
    }
    let density = grids.iter().find(|grid| grid.name == DENSITY);
    if density.is_none() {
        missing(grids, findings);
    }
    let mut times: BTreeMap<&str, usize> = BTreeMap::new();
    grids.iter().for_each(|grid| *times.entry(&grid.name).or_default() += 1);
    for grid in grids {
        if grid.name.is_empty() && density.is_some() {
            let says = "A grid has no name. No shader can show it.".to_string();
            findings.grid(grid, "unnamed", Severity::Hint, says, "Give it a name where it was made, if it is of use");
        }
        let n = times.remove(grid.name.as_str()).unwrap_or(0);
        if n > 1 {
            let severity = if grid.name == DENSITY { Severity::Problem } else { Severity::Hint };
            let says = format!("{n} grids are named {:?}. Blender shows only the first.", grid.name);
            findings.grid(grid, "same-name", severity, says, "Merge them, give each a name of its own, or write each to its own file");
        }
    }
    if let Some(grid) = density {
        kind(grid, findings);
    }
}

/// No grid has the name.
fn missing(grids: &[Grid], findings: &mut Findings) {
    let list: Vec<String> = grids.iter().map(|grid| format!("{:?} ({})", grid.name, grid.value_type)).collect();
    let likely = chosen(grids);
    if let Some(grid) = likely.filter(|grid| grid.name.is_empty()) {
        let says = format!(
            "No grid is named {DENSITY:?}, and the one that may be meant ({}) has no name at all. Blender lists it, but no shader can show \
             it, whatever its Density Attribute.",
            grid.value_type
        );
        let fix = "Name it where it was made (pyopenvdb: grid.name = \"density\"; Houdini: a Name node), and write the file again";
        return findings.grid(grid, "unnamed", Severity::Problem, says, fix);
    }
    let says = format!(
        "No grid is named {DENSITY:?}, which is what Principled Volume looks for; there are: {}. Cycles shows nothing.",
        list.join(", ")
    );
    let fix = match likely {
        Some(grid) => format!("Set the Density Attribute of the Principled Volume to {}, or rename that grid to {DENSITY}", grid.name),
        None => format!("Name the grid that holds the density {DENSITY}, or set the Density Attribute to its name"),
    };
    findings.file("no-density", Severity::Problem, says, fix);
}

/// A type that Blender shows otherwise than a number, or not at all.
fn kind(grid: &Grid, findings: &mut Findings) {
    if grid.unread == Some(Unread::Type) {
        let says = format!("The grid {DENSITY:?} holds {}, which Blender does not show as a volume.", grid.value_type);
        findings.grid(grid, "type", Severity::Problem, says, "Convert it to a float grid (points: rasterise them) and write it again");
    } else if grid.is_vector() {
        let says = format!(
            "The grid {DENSITY:?} holds vectors ({}). Cycles takes the mean of their three numbers for the density.",
            grid.value_type
        );
        findings.grid(grid, "vectors", Severity::Hint, says, "If that is a colour or a velocity, name another grid density");
    }
}
