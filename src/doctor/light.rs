//! Light that was baked into a file: what it holds for.

use super::{Findings, Grid, Severity};

/// The metadata by which a grid of light is known.
const SCALE: &str = "light_scale";

/// Says what baked light does not follow.
pub(super) fn judge(grids: &[Grid], findings: &mut Findings) {
    let light: Vec<&Grid> = grids.iter().filter(|grid| grid.metadata.contains_key(SCALE)).collect();
    let Some(first) = light.first() else { return };
    let view = light.iter().all(|grid| grid.name.starts_with("light") && !grid.name.contains(|c: char| c.is_ascii_digit()));
    let whose = if view { "the camera or the mean over all directions that it was baked for, and for " } else { "" };
    findings.grid(
        first,
        "baked-light",
        Severity::Hint,
        format!(
            "The light of the cloud is in {} ({}). It holds for {whose}the sun, the sky, the density and the size that it was baked with; a Principled Volume alone does not show it.",
            if light.len() == 1 { "a grid".into() } else { format!("{} grids", light.len()) },
            light.iter().map(|grid| grid.name.as_str()).collect::<Vec<_>>().join(", ")
        ),
        "Show it by the material of the .blend.py that cloudvdb writes beside it, or of the add-on. A brighter or darker light is a factor of that material's group; after moving the sun, changing Density or scaling the object, bake again, or set its node \"Live\" to 1",
    );
}
