//! Turbulent detail as files spell it: a genus, or an object with one.

use super::extras::{Fields, describe, find};
use crate::{
    Result,
    sculpt::{DetailRequest, Genus, MOST_OCTAVES, MOST_STRENGTH},
};
use serde_json::Value;

/// What is asked for: a detail, or expressly none.
pub(super) type Asked = Option<DetailRequest>;

/// Reads the field `detail`; `None` where it is not there.
pub(super) fn read(parent: &Fields) -> Result<Option<Asked>> {
    let Some(value) = parent.map.get("detail") else { return Ok(None) };
    let names = || Genus::NAMES.map(|(name, _)| name).join(", ");
    let genus = |fields: &Fields, key: &str, name: &str| {
        find(&Genus::NAMES, name).ok_or_else(|| fields.wrong(key, format!("{name:?}"), format!("none, or one of {}", names())))
    };
    let map = match value {
        Value::String(name) if name == "none" => return Ok(Some(None)),
        Value::String(name) => return Ok(Some(Some(DetailRequest::new(genus(parent, "detail", name)?)))),
        Value::Object(map) => map,
        other => return Err(parent.wrong("detail", describe(other), format!("none, one of {}, or an object with a genus", names()))),
    };
    let path = format!("{}.detail", parent.path);
    let fields = Fields { map, at: parent.at, path: &path };
    let name = fields.text("genus")?.ok_or_else(|| fields.wrong("genus", "missing".into(), format!("one of {}", names())))?;
    let whole = |key: &str, least: u32, most: u32| match fields.number(key)? {
        Some(n) if n.fract() == 0.0 && n >= f64::from(least) && n <= f64::from(most) => Ok(Some(n as u32)),
        Some(n) => Err(fields.wrong(key, n.to_string(), format!("a whole number from {least} to {most}"))),
        None => Ok(None),
    };
    let mut detail = DetailRequest::new(genus(&fields, "genus", name)?);
    if let Some(strength) = fields.number("strength")? {
        if !(0.0..=MOST_STRENGTH).contains(&strength) {
            return Err(fields.wrong("strength", strength.to_string(), format!("a number from 0 to {MOST_STRENGTH}")));
        }
        detail.strength = strength;
    }
    detail.size = fields.positive("size")?;
    detail.octaves = whole("octaves", 1, MOST_OCTAVES)?.unwrap_or(detail.octaves);
    detail.seed = whole("seed", 0, u32::MAX)?.unwrap_or(detail.seed);
    Ok(Some(Some(detail)))
}
