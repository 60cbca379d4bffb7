//! `CLOUDVDB_metaballs`: metaballs as the add-on writes them. Nodes of one family are one field, as in Blender.

use super::{
    at::At,
    extras::{Fields, describe},
    walk::{Z_UP, quaternion},
};
use crate::{
    Result,
    sculpt::{Element, ElementKind},
};
use glam::{DAffine3, DQuat, DVec3};
use serde_json::{Map, Value};

/// Blender's threshold.
pub(super) const THRESHOLD: f64 = 0.6;
/// Blender's stiffness.
pub(super) const STIFFNESS: f64 = 2.0;

const KINDS: [(&str, ElementKind); 5] = [
    ("BALL", ElementKind::Ball),
    ("CAPSULE", ElementKind::Capsule),
    ("PLANE", ElementKind::Plane),
    ("ELLIPSOID", ElementKind::Ellipsoid),
    ("CUBE", ElementKind::Cube),
];

/// The elements of one object.
pub(super) struct Balls {
    /// The name of the family that the object belongs to, and its number there: the lowest one's threshold holds for all.
    pub family: String,
    pub number: u64,
    pub threshold: f64,
    pub elements: Vec<Element>,
}

/// Reads the extension of a node that `world` places. Positions are in the node's space (Y up); rotations are (x, y, z, w).
pub(super) fn read(value: &Value, world: &DAffine3, at: At) -> Result<Balls> {
    let path = "extensions.CLOUDVDB_metaballs";
    let not_object =
        |found: &Value, path: &str| at.error(path, describe(found), "an object", "Write it as the README says, or leave the extension out");
    let map = value.as_object().ok_or_else(|| not_object(value, path))?;
    let fields = Fields { map, at, path };
    let threshold = fields.number("threshold")?.unwrap_or(THRESHOLD);
    let threshold = fields.at_least_zero("threshold", threshold)?;
    let name = at.name();
    let (base, number) = split(&name);
    let family = fields.text("family")?.map_or_else(|| base.to_owned(), str::to_owned);
    let nothing = Value::Array(Vec::new());
    let elements = map.get("elements").unwrap_or(&nothing);
    let elements = elements.as_array().ok_or_else(|| fields.wrong("elements", describe(elements), "a list of elements".into()))?;
    let one = |(i, element): (usize, &Value)| {
        let path = format!("{path}.elements[{i}]");
        read_element(element.as_object().ok_or_else(|| not_object(element, &path))?, world, at, &path)
    };
    let elements = elements.iter().enumerate().map(one).collect::<Result<_>>()?;
    Ok(Balls { family, number, threshold, elements })
}

/// A name without the number that Blender appends, and that number; 0 where there is none.
fn split(name: &str) -> (&str, u64) {
    let numbered = name.rsplit_once('.').and_then(|(base, digits)| Some((base, digits.parse().ok()?)));
    numbered.unwrap_or((name, 0))
}

fn read_element(map: &Map<String, Value>, world: &DAffine3, at: At, path: &str) -> Result<Element> {
    let fields = Fields { map, at, path };
    let name = fields.text("type")?.unwrap_or("BALL");
    let names = || KINDS.map(|(name, _)| name).join(", ");
    let kind = super::extras::find(&KINDS, name).ok_or_else(|| fields.wrong("type", format!("{name:?}"), format!("one of {}", names())))?;
    let radius = fields.positive("radius")?.ok_or_else(|| fields.wrong("radius", "missing".into(), "a number above 0".into()))?;
    let size = fields.vector("size")?.unwrap_or([1.0; 3]);
    // An ellipsoid without a width has no inside; the others need none.
    let least = if kind == ElementKind::Ellipsoid { f64::MIN_POSITIVE } else { 0.0 };
    if !size.iter().all(|&s| s >= least && s <= 1e6) {
        let expected = if least > 0.0 { "three numbers above 0 (and at most 1e6)" } else { "three numbers from 0 to 1e6" };
        return Err(fields.wrong("size", format!("{size:?}"), expected.into()));
    }
    let co = fields.vector("co")?.unwrap_or([0.0; 3]);
    if !co.iter().all(|c| c.abs() <= super::mesh::FARTHEST) {
        return Err(fields.wrong("co", format!("{co:?}"), "three numbers below 1e15".into()));
    }
    let rotation = match fields.vector("rotation")? {
        Some(xyzw) => quaternion(xyzw, &format!("{path}.rotation"), at)?,
        None => DQuat::IDENTITY,
    };
    let stiffness = fields.positive("stiffness")?.unwrap_or(STIFFNESS);
    let stiffness = if fields.flag("negative")? { -stiffness } else { stiffness };
    // Kinds are Blender's, whose axes are Z up: its y is our -z, its z our y.
    let [x, y, z] = size;
    let own = DAffine3::from_rotation_translation(rotation, DVec3::from_array(co)) * Z_UP.inverse();
    Ok(Element::new(kind, *world * own, radius, stiffness, DVec3::new(x, z, y)))
}

#[cfg(test)]
mod tests;
