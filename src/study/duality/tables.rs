//! What the study of the duality found: for the terminal, as CSV, JSON, and a page.

use super::measure::{DEPTH_SQUARE, IN_PLACE, INSIDE, NAMES, RADIANCE_SQUARE, TRANSMITTANCE, TRANSMITTANCE_SQUARE, UNCOVERED};
use super::{Cell, Findings, Run, Setting};
use crate::regions::Placement;
use crate::stats::Estimate;
use crate::study::accuracy::page::{STYLE, escaped, picture};

/// A figure of a cell in words.
type Words = fn(&[Estimate; NAMES.len()]) -> String;

/// What is shown of a cell.
const COLUMNS: [(&str, Words); 8] = [
    ("mass", |f| share(f[0])),
    ("uncovered", |f| share(f[UNCOVERED])),
    ("in place", |f| share(f[IN_PLACE])),
    ("sticks out", |f| share(Estimate { value: 1.0 - f[INSIDE].value, ..f[INSIDE] })),
    ("light passing", |f| format!("{:.1} % for {:.1} %", 100.0 * f[TRANSMITTANCE[1]].value, 100.0 * f[TRANSMITTANCE[0]].value)),
    ("transmittance", |f| root(f[TRANSMITTANCE_SQUARE])),
    ("optical depth", |f| root(f[DEPTH_SQUARE])),
    ("radiance", |f| root(f[RADIANCE_SQUARE])),
];

fn share(e: Estimate) -> String {
    format!("{:.1} +- {:.1} %", 100.0 * e.value, 100.0 * e.se)
}

/// The root of a mean square, with the error that follows.
fn root(e: Estimate) -> String {
    if e.value <= 0.0 {
        return "below noise".into();
    }
    let value = e.value.sqrt();
    share(Estimate { value, se: 0.5 * e.se / value })
}

fn named(setting: &Setting) -> [String; 4] {
    let placement = if setting.placement == Placement::Uniform { "uniform" } else { "importance" };
    let estimate = setting.estimate.map_or("root".into(), |n| n.to_string());
    [placement.into(), setting.photons.to_string(), estimate, setting.layers.to_string()]
}

/// A synthesis as it ends.
pub(super) fn line(run: &Run) -> String {
    let [placement, photons, estimate, layers] = named(&run.setting);
    let found = run.figures.map_or("no region comes out".into(), |f| format!("{:5.1} % uncovered", 100.0 * f[UNCOVERED]));
    format!("{placement:<11}{photons:>9} photons, {estimate:>4} in an estimate, layers {layers}, seed {:<3}{found}", run.seed)
}

impl Findings {
    /// For the terminal.
    pub fn table(&self) -> String {
        let mut text = format!("{:<11}{:>9}{:>9}{:>7}", "placement", "photons", "estimate", "layers");
        COLUMNS.iter().for_each(|(name, _)| text += &format!("{name:>19}"));
        text.push('\n');
        for cell in &self.cells {
            let [placement, photons, estimate, layers] = named(&cell.setting);
            text += &format!("{placement:<11}{photons:>9}{estimate:>9}{layers:>7}");
            match &cell.figures {
                Some(figures) => COLUMNS.iter().for_each(|(_, of)| text += &format!("{:>19}", of(figures))),
                None => text += "  no region comes out",
            }
            text.push('\n');
        }
        text
    }

    /// As JSON.
    pub fn json(&self) -> String {
        serde_json::to_string_pretty(self).unwrap_or_default() + "\n"
    }

    /// A line for each cell; squares are as they were estimated, and may be below zero.
    pub fn csv(&self) -> String {
        let mut text = String::from("placement,photons,estimate,layers,seeds,seconds,regions");
        NAMES.iter().for_each(|name| text += &format!(",{name},{name}_error"));
        text.push('\n');
        for Cell { setting, seeds, seconds, regions, figures } in &self.cells {
            text += &format!("{},{seeds},{seconds:.3},{regions:.1}", named(setting).join(","));
            match figures {
                Some(figures) => figures.iter().for_each(|e| text += &format!(",{:.6},{:.6}", e.value, e.se)),
                None => text += &",".repeat(2 * NAMES.len()),
            }
            text.push('\n');
        }
        text
    }
}

/// One page that needs nothing beside it.
pub(super) fn page(findings: &Findings, plot: &str) -> String {
    let scene = escaped(&findings.scene);
    let mut text = format!(
        "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>{scene}: the duality</title><style>{STYLE}table{{font-size:.72em}}td{{white-space:nowrap}}</style>\
         <h1>{scene}: what the duality changes</h1>{plot}<p>The new regions have the layout's optical mass, at other places. <i>Uncovered</i> is \
         what of that mass lay where no new region is: of balls at random places with the volume of what they stand for 1/e, more where they \
         stick out of it; photons do not change that. Dualities that share the extinction (each with a part of it) close it. <i>In place</i> is \
         what of the mass is where it was; transmittance, optical depth and radiance are root mean squares of differences along {} random \
         lines through the layout, and of pixels; the noise of pictures is in none of them. +- is one standard error by seeds.</p><table><tr>\
         <th>placement</th><th>photons</th><th>estimate</th><th>layers</th>",
        super::measure::LINES
    );
    COLUMNS.iter().for_each(|(name, _)| text += &format!("<th>{name}</th>"));
    text += "</tr>";
    for cell in &findings.cells {
        text += "<tr>";
        named(&cell.setting).iter().for_each(|word| text += &format!("<td>{word}</td>"));
        match &cell.figures {
            Some(figures) => COLUMNS.iter().for_each(|(_, of)| text += &format!("<td>{}</td>", of(figures))),
            None => text += &format!("<td colspan=\"{}\">no region comes out</td>", COLUMNS.len()),
        }
        text += "</tr>";
    }
    text += "</table>";
    let mean = findings.pictures[0].1.iter().map(|t| t[1]).sum::<f32>() / findings.pictures[0].1.len() as f32;
    let exposure = f64::from((0.35 / mean.max(f32::MIN_POSITIVE)).log2());
    for (name, pixels) in &findings.pictures {
        let source = picture(pixels, findings.size, exposure).unwrap_or_default();
        text += &format!("<figure><img alt=\"{name}\" src=\"{source}\"><figcaption>{name}</figcaption></figure>");
    }
    text + "</html>\n"
}
