//! Numbered files: Blender counts the digits at the end of a name.

use super::{Findings, Severity};
use std::collections::BTreeSet;
use std::path::Path;

/// Where the runs of digits are in a name.
fn runs(stem: &str) -> Vec<(usize, usize)> {
    let bytes = stem.as_bytes();
    let digit = |i: usize| bytes.get(i).is_some_and(u8::is_ascii_digit);
    let starts = (0..bytes.len()).filter(|&i| digit(i) && (i == 0 || !digit(i - 1)));
    starts.map(|start| (start, (start..).find(|&i| !digit(i)).unwrap_or(bytes.len()))).collect()
}

/// Whether a file of the folder is named alike but for a next or last number in this run.
fn has_neighbour(stem: &str, (start, end): (usize, usize), names: &BTreeSet<String>) -> bool {
    let (before, digits, after) = (&stem[..start], &stem[start..end], &stem[end..]);
    let Ok(number) = digits.parse::<u64>() else { return false };
    let width = digits.len();
    let there = |number: u64| names.contains(&format!("{before}{number:0width$}{after}"));
    number.checked_add(1).is_some_and(there) || number.checked_sub(1).is_some_and(there)
}

/// The name that Blender would count, and the number of digits in the middle; `None` where nothing is to be said.
pub fn better(stem: &str, names: &BTreeSet<String>) -> Option<(String, String)> {
    let runs = runs(stem);
    // The digits at the end are what Blender counts.
    if runs.last().is_some_and(|run| run.1 == stem.len() && has_neighbour(stem, *run, names)) {
        return None;
    }
    // v2 is a version, and no frame.
    let version = |start: usize| stem[..start].ends_with(['v', 'V']);
    let &(start, end) = runs.iter().rev().find(|run| run.1 < stem.len() && !version(run.0) && has_neighbour(stem, **run, names))?;
    let digits = &stem[start..end];
    let rest = format!("{}_{}", stem[..start].trim_end_matches(['_', '.', '-', ' ']), stem[end..].trim_start_matches(['_', '.', '-', ' ']));
    Some((format!("{}.{digits}.vdb", rest.trim_matches('_')), digits.into()))
}

/// Looks for the file's neighbours in its folder.
pub fn judge(path: &Path, findings: &mut Findings) {
    let Some(stem) = path.file_stem().and_then(|stem| stem.to_str()) else { return };
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    let stem_of = |entry: std::fs::DirEntry| {
        let path = entry.path();
        let vdb = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("vdb"));
        path.file_stem().and_then(|stem| stem.to_str()).filter(|_| vdb).map(String::from)
    };
    let names: BTreeSet<String> = entries.filter_map(|entry| stem_of(entry.ok()?)).collect();
    if let Some((name, digits)) = better(stem, &names) {
        let says = format!(
            "The files beside it are numbered where this one has {digits}, in the middle of the name. Blender counts only digits at the end of a \
             name: the sequence stands still, or falls into single files."
        );
        let fix = format!("Rename them so that the number comes last, {name}, and import them again, all at once");
        findings.file("digits-not-last", Severity::Problem, says, fix);
    }
}
