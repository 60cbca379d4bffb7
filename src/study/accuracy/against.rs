//! Somebody else's picture of the same scene, beside ours.

use super::figures::Truth;
use crate::error::{Error, Result};
use crate::import::sky::read_exr;
use std::path::PathBuf;

/// A picture, what it took, and what it is called.
#[derive(Debug, Clone, PartialEq)]
pub struct Against {
    /// An EXR of the study's size.
    pub path: PathBuf,
    /// What it took, s.
    pub seconds: f64,
    /// Its name in the plot.
    pub name: String,
}

/// How far it is off.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Other {
    /// Its name.
    pub name: String,
    /// What it took, s.
    pub seconds: f64,
    /// The relative RMSE against the reference.
    pub error: f64,
    /// Its mean over the reference's, less 1.
    pub mean_off: f64,
}

/// Reads `FILE.exr:SECONDS` or `FILE.exr:SECONDS:NAME`.
///
/// # Errors
/// The sentence that says what is wrong.
pub fn against(text: &str) -> std::result::Result<Against, String> {
    let wrong = || format!("{text:?} is not a picture and its seconds, such as cycles.exr:58.5 or cycles.exr:58.5:Cycles");
    let mut parts = text.splitn(3, ':');
    let (path, seconds) = (parts.next().ok_or_else(wrong)?, parts.next().ok_or_else(wrong)?);
    let seconds = seconds.trim_end_matches('s').parse::<f64>().ok().filter(|s| *s > 0.0 && s.is_finite()).ok_or_else(wrong)?;
    let path = PathBuf::from(path);
    let stem = || path.file_stem().map(|stem| stem.to_string_lossy().into_owned());
    let name = parts.next().map(String::from).or_else(stem).ok_or_else(wrong)?;
    Ok(Against { path, seconds, name })
}

/// How far a picture is off.
pub(super) fn judge(other: &Against, truth: &Truth, size: [u32; 2]) -> Result<Other> {
    let wrong = |reason: String, fix: &str| Error::File { file: other.path.clone(), reason, fix: fix.into() };
    let (width, height, texels) = read_exr(&other.path).map_err(|reason| wrong(reason, "Name an EXR image"))?;
    if [width, height] != size.map(|s| s as usize) {
        let reason = format!("it has {width} x {height} pixels, and the study {} x {}", size[0], size[1]);
        return Err(wrong(reason, "Render it in the study's size, or study in its own (--size)"));
    }
    let (square, mean) = truth.off(&texels);
    Ok(Other { name: other.name.clone(), seconds: other.seconds, error: square.max(0.0).sqrt(), mean_off: mean - 1.0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_is_named_with_its_seconds() {
        let found = against("a/cycles.exr:58.5s").unwrap();
        assert_eq!(found, Against { path: "a/cycles.exr".into(), seconds: 58.5, name: "cycles".into() });
        assert_eq!(against("c.exr:3:Cycles 5.2: OIDN").unwrap().name, "Cycles 5.2: OIDN");
        for wrong in ["c.exr", "c.exr:", "c.exr:0", "c.exr:-1", "c.exr:nan", "c.exr:Cycles"] {
            assert!(against(wrong).is_err(), "{wrong}");
        }
    }
}
