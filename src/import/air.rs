//! Air as files and flags spell it: presets, and layers of any medium.

use super::{
    at::At,
    extras::{Fields, describe},
    medium::{Filling, MediumSpec},
};
use crate::{
    Error, Result,
    scene::{
        Air, Medium,
        air::{AirLayer, MOST_LAYERS, SCALE_HEIGHTS, Scattering, VISIBLE},
    },
};
use serde_json::{Map, Value};
use std::path::Path;

const PRESET_KEYS: [&str; 3] = ["preset", "visibility", "base"];
const LAYER_KEYS: [&str; 4] = ["visibility", "base", "top", "scale_height"];
const MEDIUM_KEYS: [&str; 6] = ["preset", "sigma_s", "sigma_a", "sigma_t", "albedo", "g"];
/// The only preset words that are no media.
const CLEAR: &str = "clear";
const RAYLEIGH: &str = "rayleigh";

/// Reads the value of the scene's key `atmosphere`: a word, an object, or a list of them.
pub(super) fn read(value: &Value, at: At, notes: &mut Vec<String>) -> Result<Air> {
    let items = if let Value::Array(items) = value { items.as_slice() } else { std::slice::from_ref(value) };
    let mut layers = Vec::new();
    for item in items {
        let map = match item {
            Value::Object(map) => map.clone(),
            Value::String(word) => Map::from_iter([("preset".to_owned(), Value::from(word.as_str()))]),
            other => return Err(wrong(at, describe(other), "a word such as \"clear\", an object, or a list of these".into())),
        };
        layers.extend(one(&Fields { map: &map, at, path: "extras.cloudvdb.atmosphere" }, notes)?);
    }
    if layers.len() > MOST_LAYERS {
        return Err(wrong(at, format!("{} layers", layers.len()), format!("at most {MOST_LAYERS} (\"clear\" is two)")));
    }
    Ok(Air::new(layers))
}

fn wrong(at: At, found: String, expected: String) -> Error {
    at.error("extras.cloudvdb.atmosphere", found, expected, "Correct it in the custom property of the scene and export again")
}

/// The layers that one object says.
fn one(fields: &Fields, notes: &mut Vec<String>) -> Result<Vec<AirLayer>> {
    let visibility = fields.positive("visibility")?;
    let base = fields.number("base")?.unwrap_or(0.0);
    match fields.text("preset")? {
        Some("none") => Ok(Vec::new()),
        Some(word @ (CLEAR | RAYLEIGH)) => {
            fields.unknown(&[&PRESET_KEYS], notes);
            let mut layers = vec![AirLayer::molecules(base)];
            if word == CLEAR {
                layers.push(AirLayer::aerosol(base, visibility));
            }
            Ok(layers)
        }
        Some(word) if Medium::preset(word).is_none() => {
            let expected = format!("none, {CLEAR}, {RAYLEIGH}, or a medium: {}", Medium::PRESETS.join(", "));
            Err(fields.wrong("preset", format!("{word:?}"), expected))
        }
        _ => {
            fields.unknown(&[&LAYER_KEYS, &MEDIUM_KEYS], notes);
            layer(fields, visibility, base).map(|layer| vec![layer])
        }
    }
}

/// A layer of a medium.
fn layer(fields: &Fields, visibility: Option<f64>, base: f64) -> Result<AirLayer> {
    let (top, scale_height) = (fields.number("top")?, fields.positive("scale_height")?);
    let end = match (top, scale_height) {
        (Some(top), _) if top > base => top,
        (Some(top), _) => return Err(fields.wrong("top", top.to_string(), format!("a height above the base, {base}"))),
        (None, Some(height)) => base + SCALE_HEIGHTS * height,
        (None, None) => {
            let expected = "a height in metres, or a scale_height: even air without end would let no sunlight in";
            return Err(fields.wrong("top", "missing".into(), expected.into()));
        }
    };
    let spec = MediumSpec::read(fields)?;
    let places = [MediumSpec::known(visibility.map(|_| 1.0), None, None), spec];
    let Some(mut medium) = Filling::new(&places).medium() else {
        return Err(fields.wrong("sigma_t", "missing".into(), "an extinction per metre, a preset, or a visibility in metres".into()));
    };
    if let Some(visibility) = visibility {
        let scale = VISIBLE / visibility / medium.sigma_t().max(f64::MIN_POSITIVE);
        (medium.sigma_s, medium.sigma_a) = (medium.sigma_s.map(|s| s * scale), medium.sigma_a.map(|s| s * scale));
    }
    let scattering = Scattering::HenyeyGreenstein(medium.g);
    Ok(AirLayer { sigma_s: medium.sigma_s, sigma_a: medium.sigma_a, scattering, base, top: end, scale_height })
}

/// Air as a flag spells it: a word, with options behind it as in `clear:visibility=20000`, and several with `+` between them.
///
/// # Errors
/// The sentence that says what is wrong.
pub fn spelt(text: &str) -> std::result::Result<Air, String> {
    let mut items = Vec::new();
    for part in text.split('+') {
        let (word, options) = part.split_once(':').unwrap_or((part, ""));
        let mut map = Map::from_iter([("preset".to_owned(), Value::from(word.trim()))]);
        for option in options.split(',').filter(|option| !option.is_empty()) {
            let number = option.split_once('=').and_then(|(key, value)| Some((key.trim(), value.trim().parse::<f64>().ok()?)));
            let Some((key, number)) = number else { return Err(format!("{option:?} is not an option such as visibility=20000")) };
            map.insert(key.to_owned(), Value::from(number));
        }
        items.push(Value::Object(map));
    }
    let at = At { file: Path::new("--atmosphere"), kind: "scene", index: 0, name: None };
    let mut notes = Vec::new();
    let air = read(&Value::Array(items), at, &mut notes).map_err(|error| match error {
        Error::Node { field, found, expected, .. } => {
            let key = field.trim_start_matches("extras.cloudvdb.atmosphere").trim_start_matches('.');
            if key.is_empty() { format!("found {found}, expected {expected}") } else { format!("{key} is {found}, expected {expected}") }
        }
        other => other.to_string(),
    })?;
    let known = || format!("it knows {}, and of a medium {} too", PRESET_KEYS[1..].join(" and "), LAYER_KEYS[2..].join(", "));
    if notes.is_empty() { Ok(air) } else { Err(format!("an option of {text:?} means nothing: {}", known())) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_and_options_make_layers() {
        assert_eq!(spelt("clear"), Ok(Air::clear(0.0, None)));
        assert_eq!(spelt("clear:visibility=20000,base=-3"), Ok(Air::clear(-3.0, Some(20_000.0))));
        assert_eq!(spelt("none"), Ok(Air::default()));
        let both = spelt("rayleigh+haze:visibility=3912,top=800").unwrap();
        let layers: Vec<_> = both.layers().collect();
        assert_eq!(layers.len(), 2);
        assert!((layers[1].sigma_t()[0] - 1e-3).abs() < 1e-12 && layers[1].top == 800.0 && layers[1].scale_height.is_none());
        assert!((layers[1].sigma_s[1] / layers[1].sigma_t()[1] - 0.95).abs() < 1e-12);
        let thins = spelt("haze:sigma_t=0.002,scale_height=100,g=0.2").unwrap();
        assert_eq!(thins.layers().next().map(|l| (l.top, l.scattering)), Some((3000.0, Scattering::HenyeyGreenstein(0.2))));
    }

    #[test]
    fn what_has_no_meaning_is_refused_with_its_reason() {
        for (text, part) in [
            ("fog", "clear"),
            ("haze", "top"),
            ("haze:top=-3", "above the base"),
            ("clear:visibility", "visibility=20000"),
            ("clear:visibility=0", "above 0"),
            ("clear:top=3", "means nothing"),
            ("clear+clear+haze:top=9", "at most 4"),
            ("haze:top=9,albedo=2", "albedo"),
            ("", "clear"),
        ] {
            let error = spelt(text).unwrap_err();
            assert!(error.contains(part), "{text:?}: {error}");
        }
    }
}
