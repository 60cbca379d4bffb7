//! `CLOUDVDB_metaballs`: metaballs as the add-on writes them, read as spheres of their visible radius for now.

use super::{
    at::At,
    extras::{Fields, describe},
    walk::quaternion,
};
use crate::Result;
use glam::{DAffine3, DMat3, DQuat, DVec3};
use serde_json::{Map, Value};

/// Blender's threshold.
pub(super) const THRESHOLD: f64 = 0.6;
/// Blender's stiffness.
pub(super) const STIFFNESS: f64 = 2.0;

/// The elements of one object.
pub(super) struct Family {
    pub name: Option<String>,
    /// From the unit ball to the node's space, for each element that can be seen.
    pub balls: Vec<DAffine3>,
    /// What was simplified or left out, each a sentence about "it".
    pub remarks: Vec<String>,
}

/// The radius at which a lone element's field, stiffness * (1 - r^2/R^2)^3, is the threshold; `None` where it never is.
pub(super) fn visible_radius(radius: f64, threshold: f64, stiffness: f64) -> Option<f64> {
    let inside = 1.0 - (threshold / stiffness).cbrt();
    (inside > 0.0).then(|| radius * inside.sqrt())
}

/// Reads the extension of a node. Positions are in the node's space (Y up); rotations are (x, y, z, w).
pub(super) fn read(value: &Value, at: At) -> Result<Family> {
    let path = "extensions.CLOUDVDB_metaballs";
    let not_object =
        |found: &Value, path: &str| at.error(path, describe(found), "an object", "Write it as the README says, or leave the extension out");
    let map = value.as_object().ok_or_else(|| not_object(value, path))?;
    let fields = Fields { map, at, path };
    let threshold = fields.number("threshold")?.unwrap_or(THRESHOLD);
    let threshold = fields.at_least_zero("threshold", threshold)?;
    let mut family = Family { name: fields.text("family")?.map(str::to_owned), balls: Vec::new(), remarks: Vec::new() };
    let nothing = Value::Array(Vec::new());
    let elements = map.get("elements").unwrap_or(&nothing);
    let elements = elements.as_array().ok_or_else(|| fields.wrong("elements", describe(elements), "a list of elements".into()))?;
    let (mut negative, mut faint, mut rough) = (0, 0, 0);
    for (i, element) in elements.iter().enumerate() {
        let path = format!("{path}.elements[{i}]");
        let map = element.as_object().ok_or_else(|| not_object(element, &path))?;
        let element = Element::read(map, at, &path)?;
        match visible_radius(element.radius, threshold, element.stiffness) {
            _ if element.negative => negative += 1,
            None => faint += 1,
            Some(visible) => {
                rough += usize::from(element.rough);
                let axes = DMat3::from_quat(element.rotation) * DMat3::from_diagonal(element.size * visible);
                family.balls.push(DAffine3 { matrix3: axes, translation: element.co });
            }
        }
    }
    let mut remark = |count: usize, words: &str| {
        if count > 0 {
            family.remarks.push(format!("{count} of its {} elements {words}", elements.len()));
        }
    };
    remark(negative, "are negative and were left out: metaballs are read as spheres of their visible radius for now");
    remark(faint, "are too soft to be seen alone (stiffness not above the threshold) and were left out");
    remark(rough, "are capsules, planes or cubes, read as balls of their visible radius for now");
    Ok(family)
}

struct Element {
    co: DVec3,
    radius: f64,
    stiffness: f64,
    negative: bool,
    size: DVec3,
    rotation: DQuat,
    /// Whether a ball is a simplification.
    rough: bool,
}

impl Element {
    fn read(map: &Map<String, Value>, at: At, path: &str) -> Result<Element> {
        let fields = Fields { map, at, path };
        let kind = fields.text("type")?.unwrap_or("BALL");
        if !["BALL", "ELLIPSOID", "CAPSULE", "PLANE", "CUBE"].contains(&kind) {
            return Err(fields.wrong("type", format!("{kind:?}"), "one of BALL, ELLIPSOID, CAPSULE, PLANE, CUBE".into()));
        }
        let radius = fields.positive("radius")?.ok_or_else(|| fields.wrong("radius", "missing".into(), "a number above 0".into()))?;
        let ellipsoid = kind == "ELLIPSOID";
        let size = fields.vector("size")?.filter(|_| ellipsoid).unwrap_or([1.0; 3]);
        if !size.iter().all(|&s| s > 0.0 && s <= 1e6) {
            return Err(fields.wrong("size", format!("{size:?}"), "three numbers above 0".into()));
        }
        let co = fields.vector("co")?.unwrap_or([0.0; 3]);
        if !co.iter().all(|c| c.abs() <= super::mesh::FARTHEST) {
            return Err(fields.wrong("co", format!("{co:?}"), "three numbers below 1e15".into()));
        }
        let rotation = match fields.vector("rotation")? {
            Some(xyzw) if ellipsoid => quaternion(xyzw, &format!("{path}.rotation"), at)?,
            _ => DQuat::IDENTITY,
        };
        Ok(Element {
            co: co.into(),
            radius,
            stiffness: fields.positive("stiffness")?.unwrap_or(STIFFNESS),
            negative: fields.flag("negative")?,
            size: size.into(),
            rotation,
            rough: !ellipsoid && kind != "BALL",
        })
    }
}
