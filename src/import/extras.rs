//! `extras.cloudvdb`: what an artist says about a node, a material or the scene.

use super::{
    air,
    at::At,
    detail::{self, Asked},
    medium::MediumSpec,
    sky::{self, SkySpec},
};
use crate::{
    Result,
    scene::{Air, Medium},
};
use serde_json::{Map, Value};
use std::borrow::Cow;

/// What a node says that it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ShapeKind {
    Sphere,
    Metaball,
    Slab,
    Mesh,
    Ignore,
    Surface,
    Vdb,
}

impl ShapeKind {
    pub const NAMES: [(&str, ShapeKind); 7] = [
        ("sphere", ShapeKind::Sphere),
        ("metaball", ShapeKind::Metaball),
        ("slab", ShapeKind::Slab),
        ("mesh", ShapeKind::Mesh),
        ("ignore", ShapeKind::Ignore),
        ("surface", ShapeKind::Surface),
        ("vdb", ShapeKind::Vdb),
    ];
}

/// `extras.cloudvdb` of a node or a material.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Spec {
    pub shape: Option<ShapeKind>,
    pub radius: Option<f64>,
    pub half_height: Option<f64>,
    pub threshold: Option<f64>,
    pub stiffness: Option<f64>,
    /// The VDB that it names, as it is spelt.
    pub file: Option<String>,
    /// The name of that VDB's grid.
    pub grid: Option<String>,
    /// The names of its grids that shine: by what they emit, and by their heat.
    pub emission_grid: Option<String>,
    pub temperature_grid: Option<String>,
    /// The depth over which density rises from the boundary inward, m of the world.
    pub falloff: Option<f64>,
    /// The radius of the lamp that the node is, m of the world.
    pub lamp_radius: Option<f64>,
    pub detail: Option<Asked>,
    pub medium: MediumSpec,
}

impl Spec {
    /// Whether it names grids that shine in place of the region itself.
    pub fn names_fire(&self) -> bool {
        self.emission_grid.is_some() || self.temperature_grid.is_some()
    }
}

/// `extras.cloudvdb` of the scene.
#[derive(Debug, Clone, Default)]
pub(super) struct SceneSpec {
    pub medium: MediumSpec,
    pub sun_angle: Option<f64>,
    pub sky: Option<SkySpec>,
    pub detail: Option<Asked>,
    pub air: Option<Air>,
}

const SHAPE_KEYS: [&str; 12] = [
    "shape",
    "radius",
    "half_height",
    "threshold",
    "stiffness",
    "file",
    "grid",
    "emission_grid",
    "temperature_grid",
    "falloff",
    "detail",
    "lamp_radius",
];
const MEDIUM_KEYS: [&str; 9] = ["preset", "sigma_s", "sigma_a", "sigma_t", "albedo", "g", "emission", "temperature", "soot"];
/// Keys that `-o regions.glb` writes for people, and that say nothing about the scene.
const WRITTEN_KEYS: [&str; 1] = ["photons"];

/// Reads a node's or a material's extras. Keys that mean nothing become notes.
pub(super) fn spec(extras: Option<&Value>, at: At, notes: &mut Vec<String>) -> Result<Option<Spec>> {
    let Some(value) = extras.and_then(|extras| extras.get("cloudvdb")) else { return Ok(None) };
    let map = object(value, at)?;
    let fields = Fields { map: &map, at, path: "extras.cloudvdb" };
    fields.unknown(&[&SHAPE_KEYS, &MEDIUM_KEYS, &WRITTEN_KEYS], notes);
    let shape = match fields.text("shape")? {
        Some(name) => Some(find(&ShapeKind::NAMES, name).ok_or_else(|| {
            let names: Vec<&str> = ShapeKind::NAMES.iter().map(|(name, _)| *name).collect();
            fields.wrong("shape", format!("{name:?}"), format!("one of {}", names.join(", ")))
        })?),
        None => None,
    };
    let threshold = fields.number("threshold")?.map(|v| fields.at_least_zero("threshold", v)).transpose()?;
    Ok(Some(Spec {
        shape,
        radius: fields.positive("radius")?,
        half_height: fields.positive("half_height")?,
        threshold,
        stiffness: fields.positive("stiffness")?,
        file: fields.text("file")?.map(str::to_owned),
        grid: fields.text("grid")?.map(str::to_owned),
        emission_grid: fields.text("emission_grid")?.map(str::to_owned),
        temperature_grid: fields.text("temperature_grid")?.map(str::to_owned),
        falloff: fields.positive("falloff")?,
        lamp_radius: fields.positive("lamp_radius")?,
        detail: detail::read(&fields)?,
        medium: MediumSpec::read(&fields)?,
    }))
}

/// Reads the scene's extras.
pub(super) fn scene_spec(extras: Option<&Value>, at: At, notes: &mut Vec<String>) -> Result<SceneSpec> {
    let Some(value) = extras.and_then(|extras| extras.get("cloudvdb")) else { return Ok(SceneSpec::default()) };
    let map = object(value, at)?;
    let fields = Fields { map: &map, at, path: "extras.cloudvdb" };
    fields.unknown(&[&["medium", "sun_angle", "sky", "atmosphere", "detail"]], notes);
    let medium = match map.get("medium") {
        Some(value) => {
            let map = object(value, at)?;
            let fields = Fields { map: &map, at, path: "extras.cloudvdb.medium" };
            fields.unknown(&[&MEDIUM_KEYS], notes);
            MediumSpec::read(&fields)?
        }
        None => MediumSpec::default(),
    };
    let sun_angle = match fields.number("sun_angle")? {
        Some(angle) if (0.0..std::f64::consts::PI).contains(&angle) => Some(angle),
        Some(angle) => return Err(fields.wrong("sun_angle", angle.to_string(), "an angle in radians from 0 to below pi".into())),
        None => None,
    };
    let sky = map.get("sky").map(|value| sky::read(value, at, notes)).transpose()?;
    let air = map.get("atmosphere").map(|value| air::read(value, at, notes)).transpose()?;
    Ok(SceneSpec { medium, sun_angle, sky, detail: detail::read(&fields)?, air })
}

pub(super) fn find<T: Copy>(names: &[(&str, T)], name: &str) -> Option<T> {
    names.iter().find(|(known, _)| *known == name).map(|&(_, value)| value)
}

/// The object in a value. A string may hold JSON, as typed in Blender's custom properties, or the bare name of a shape
/// or a preset.
fn object<'v>(value: &'v Value, at: At) -> Result<Cow<'v, Map<String, Value>>> {
    match value {
        Value::Object(map) => Ok(Cow::Borrowed(map)),
        Value::String(text) => {
            let word = text.trim();
            let key = match word {
                _ if find(&ShapeKind::NAMES, word).is_some() => Some("shape"),
                _ if Medium::preset(word).is_some() => Some("preset"),
                _ => None,
            };
            if let Some(key) = key {
                return Ok(Cow::Owned(Map::from_iter([(key.to_owned(), Value::from(word))])));
            }
            match serde_json::from_str(word) {
                Ok(Value::Object(map)) => Ok(Cow::Owned(map)),
                Ok(_) => Err(not_object(at, format!("the string {}", clip(word)))),
                Err(error) => Err(not_object(at, format!("the string {}, which is not JSON ({error})", clip(word)))),
            }
        }
        other => Err(not_object(at, describe(other))),
    }
}

fn not_object(at: At, found: String) -> crate::Error {
    at.error(
        "extras.cloudvdb",
        found,
        r#"an object such as {"shape": "sphere", "radius": 1.0}"#,
        "Write it so in the custom property `cloudvdb`",
    )
}

fn clip(text: &str) -> String {
    let short: String = text.chars().take(60).collect();
    if short.len() < text.len() { format!("{short:?}...") } else { format!("{short:?}") }
}

/// A JSON value as a sentence shows it.
pub(super) fn describe(value: &Value) -> String {
    match value {
        Value::Null => "null (NaN or infinite?)".into(),
        Value::String(text) => format!("the string {}", clip(text)),
        Value::Array(items) => format!("a list of {}", items.len()),
        Value::Object(_) => "an object".into(),
        Value::Bool(_) | Value::Number(_) => value.to_string(),
    }
}

/// Typed access to the fields of an object.
pub(super) struct Fields<'a> {
    pub map: &'a Map<String, Value>,
    pub at: At<'a>,
    /// Where the object is: `extras.cloudvdb`.
    pub path: &'a str,
}

impl Fields<'_> {
    pub fn wrong(&self, key: &str, found: String, expected: String) -> crate::Error {
        let fix = "Correct it in the custom properties and export again with them (extras)";
        self.at.error(format!("{}.{key}", self.path), found, expected, fix)
    }

    pub fn number(&self, key: &str) -> Result<Option<f64>> {
        match self.map.get(key) {
            None => Ok(None),
            Some(value) => match value.as_f64().filter(|v| v.is_finite()) {
                Some(number) => Ok(Some(number)),
                None => Err(self.wrong(key, describe(value), "a finite number".into())),
            },
        }
    }

    pub fn positive(&self, key: &str) -> Result<Option<f64>> {
        match self.number(key)? {
            Some(v) if !(v > 0.0 && v <= super::mesh::FARTHEST) => {
                Err(self.wrong(key, v.to_string(), "a number above 0 (and below 1e15)".into()))
            }
            other => Ok(other),
        }
    }

    pub fn at_least_zero(&self, key: &str, v: f64) -> Result<f64> {
        if v >= 0.0 && v.is_finite() { Ok(v) } else { Err(self.wrong(key, v.to_string(), "a number not below 0".into())) }
    }

    pub fn text(&self, key: &str) -> Result<Option<&str>> {
        match self.map.get(key) {
            None => Ok(None),
            Some(Value::String(text)) => Ok(Some(text)),
            Some(other) => Err(self.wrong(key, describe(other), "a string".into())),
        }
    }

    pub fn flag(&self, key: &str) -> Result<bool> {
        match self.map.get(key) {
            None => Ok(false),
            Some(Value::Bool(flag)) => Ok(*flag),
            Some(other) => Err(self.wrong(key, describe(other), "true or false".into())),
        }
    }

    /// `N` finite numbers.
    pub fn vector<const N: usize>(&self, key: &str) -> Result<Option<[f64; N]>> {
        let Some(value) = self.map.get(key) else { return Ok(None) };
        let numbers = value.as_array().map(|items| items.iter().filter_map(Value::as_f64).filter(|v| v.is_finite()).collect::<Vec<f64>>());
        match numbers.and_then(|numbers| numbers.try_into().ok()) {
            Some(vector) if value.as_array().is_some_and(|items| items.len() == N) => Ok(Some(vector)),
            _ => Err(self.wrong(key, describe(value), format!("{N} finite numbers"))),
        }
    }

    /// A number for all three channels, or three.
    pub fn rgb(&self, key: &str) -> Result<Option<[f64; 3]>> {
        if self.map.get(key).is_some_and(Value::is_array) {
            return self.vector(key);
        }
        match self.map.get(key) {
            Some(value) if !value.is_number() => Err(self.wrong(key, describe(value), "a number or [r, g, b]".into())),
            _ => Ok(self.number(key)?.map(|v| [v; 3])),
        }
    }

    pub fn unknown(&self, known: &[&[&str]], notes: &mut Vec<String>) {
        for key in self.map.keys().filter(|key| !known.iter().any(|list| list.contains(&key.as_str()))) {
            let keys: Vec<&str> = known.iter().flat_map(|list| list.iter().copied()).collect();
            notes.push(format!("{}: {}.{key} means nothing and was not read (known: {}).", self.at, self.path, keys.join(", ")));
        }
    }
}
