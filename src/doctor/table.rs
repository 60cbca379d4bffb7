//! The report for people.

use super::figure::{count, figure, size};
use super::grid::{Grid, Values};
use super::{Depth, Report, Severity};
use std::fmt::Write;

/// What is in the file, what is wrong with it, and what to do.
pub fn table(report: &Report) -> String {
    let mut text = String::new();
    // Writing to a string does not fail.
    let _ = writeln!(
        text,
        "{}: {}, format {} (OpenVDB {}), {}",
        report.file.display(),
        size(report.bytes as f64),
        report.format.version,
        report.format.library,
        count(report.grids.len() as u64, "grid")
    );
    for grid in &report.grids {
        let _ = writeln!(text, "\n  {:?}  {}", grid.name, kind(grid));
        grid.values.iter().for_each(|values| rows(&mut text, grid, values));
        grid.metadata.iter().for_each(|(key, value)| row(&mut text, &format!("{key} = {value}")));
    }
    if !report.metadata.is_empty() {
        text.push_str("\n  metadata\n");
        report.metadata.iter().for_each(|(key, value)| row(&mut text, &format!("{key} = {value}")));
    }
    report.optical_depth.iter().for_each(|depth| settings(&mut text, depth));
    text.push('\n');
    for finding in &report.findings {
        let mark = if finding.severity == Severity::Problem { "PROBLEM" } else { "hint   " };
        let _ = writeln!(text, "{mark} [{}] {}\n        Fix: {}.", finding.id, finding.says, finding.fix);
    }
    let problems = report.findings.iter().filter(|f| f.severity == Severity::Problem).count() as u64;
    let hints = report.findings.len() as u64 - problems;
    let verdict = if problems == 0 { "healthy".into() } else { count(problems, "problem") };
    let _ = writeln!(text, "{verdict}, {}", count(hints, "hint"));
    text
}

fn row(text: &mut String, what: &str) {
    let _ = writeln!(text, "    {what}");
}

fn kind(grid: &Grid) -> String {
    let packed = if grid.compression.is_empty() { "uncompressed".into() } else { grid.compression.join(" + ") };
    let half = if grid.half { " (16 bits)" } else { "" };
    format!("{}{half}, {}, {packed}, {}", grid.value_type, grid.class, size(grid.bytes as f64))
}

fn rows(text: &mut String, grid: &Grid, values: &Values) {
    let background = if values.background == 0.0 { String::new() } else { format!(", background {}", figure(values.background)) };
    row(
        text,
        &format!(
            "{} in {} and {}, {} in memory",
            count(values.active_voxels, "active voxel"),
            count(values.leaves, "leaf").replace("leafs", "leaves"),
            count(values.tiles, "tile"),
            size(values.memory as f64)
        ),
    );
    let (low, high, mean) = (figure(values.lowest), figure(values.highest), figure(values.mean));
    row(text, &format!("values {low} to {high}, mean {mean}{background}"));
    let Some([x, y, z]) = values.sides() else { return };
    let dense = size(values.dense_bytes);
    let Some((transform, [low, high])) = grid.transform.as_ref().zip(values.world_box) else {
        return row(text, &format!("{x} x {y} x {z} voxels ({dense} dense), in a frustum"));
    };
    let [a, b, c] = transform.voxel.map(figure);
    let edge = if a == b && b == c { a } else { format!("{a} x {b} x {c}") };
    let point = |p: [f64; 3]| p.map(figure).join(", ");
    row(text, &format!("{x} x {y} x {z} voxels of {edge} m ({dense} dense), from ({}) to ({})", point(low), point(high)));
}

fn settings(text: &mut String, depth: &Depth) {
    let [x, y, z] = depth.along.map(figure);
    let from = if depth.density_from == "default" { "Blender's default" } else { "the file's density_scale" };
    let _ = writeln!(text, "\n  optical depth {x}, {y}, {z} along x, y, z at Density {} ({from})", figure(depth.density));
    let _ = writeln!(
        text,
        "  set Density to {}; in Cycles Light Paths > Max Bounces: Total and Volume to {}",
        figure(depth.set_density),
        depth.set_bounces.max(12)
    );
}
