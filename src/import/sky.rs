//! The sky as files and flags spell it: radiance, a gradient, a clear day, or the name of an image.

use super::{
    at::At,
    extras::{Fields, describe},
    volume::named,
};
use crate::{
    Error, Result,
    scene::{Dome, Scene, Sky},
};
use serde_json::{Map, Value};
use std::path::{Path, PathBuf};
use std::sync::Arc;

const KEY: &str = "extras.cloudvdb.sky";
const CLEAR: &str = "clear";
/// Texels that are read at most: 16,384 x 8,192.
const LARGEST: usize = 1 << 27;
/// Of images that are wider, columns and rows are averaged.
const WIDEST: usize = 2048;

/// A sky as it is spelt.
#[derive(Debug, Clone, PartialEq)]
pub enum SkySpec {
    /// One that needs no file.
    Made(Sky),
    /// An image (`.exr`, `.hdr`) that covers all directions by latitude and longitude.
    Image {
        /// Where it is.
        path: PathBuf,
        /// What its pixels are multiplied by for radiance in W m^-2 sr^-1, RGB.
        strength: [f64; 3],
        /// By how much it is turned about the vertical, rad, against the clock from above.
        turn: f64,
    },
}

impl SkySpec {
    /// Lays the sky over a scene, and says what it is.
    ///
    /// # Errors
    /// [`Error::File`] where an image cannot be read; [`Error::Scene`] where it does not go with the scene's sun.
    pub(super) fn lay(&self, scene: &mut Scene, notes: &mut Vec<String>) -> Result<()> {
        let sky = match self {
            SkySpec::Made(sky) => sky.clone(),
            SkySpec::Image { path, strength, turn } => Sky::Image { dome: Arc::new(image(path, notes)?), strength: *strength, turn: *turn },
        };
        let fix = "Raise the sun, or name another sky";
        sky.lay(scene).map_err(|reason| Error::Scene { reason, fix: fix.into() })?;
        if let Some(dome) = &scene.dome {
            let [r, g, b] = scene.sky;
            notes.push(format!(
                "The sky's mean radiance is {r:.4}, {g:.4}, {b:.4} W/m^2/sr; its brightest spot has {:.1} times as much.",
                dome.contrast()
            ));
        }
        Ok(())
    }
}

/// Columns, rows and texels of the first layer of an EXR image that has R, G and B.
///
/// # Errors
/// Why it cannot be read.
pub fn read_exr(path: &Path) -> std::result::Result<(usize, usize, Vec<[f32; 3]>), String> {
    let unreadable = |error: exr::error::Error| format!("it cannot be read as an EXR image ({error})");
    let about = exr::meta::MetaData::read_from_file(path, false).map_err(unreadable)?;
    about.headers.iter().try_for_each(|header| small_enough(header.layer_size.width(), header.layer_size.height()))?;
    let picture = exr::prelude::read_first_rgba_layer_from_file(
        path,
        |size, _| (size.width(), vec![[0.0f32; 3]; size.area()]),
        |(width, texels), at, (r, g, b, _): (f32, f32, f32, f32)| texels[at.y() * *width + at.x()] = [r, g, b],
    );
    let layer = picture.map_err(unreadable)?.layer_data;
    Ok((layer.size.width(), layer.size.height(), layer.channel_data.pixels.1))
}

fn small_enough(width: usize, height: usize) -> std::result::Result<(), String> {
    let fits = width.checked_mul(height).is_some_and(|area| area <= LARGEST);
    if fits { Ok(()) } else { Err(format!("its {width} x {height} pixels are more than {LARGEST}")) }
}

/// Columns, rows and texels of a Radiance image.
fn read_hdr(path: &Path) -> std::result::Result<(usize, usize, Vec<[f32; 3]>), String> {
    let unreadable = |error: std::io::Error| format!("it cannot be read as an HDR image ({error})");
    let file = std::io::BufReader::new(std::fs::File::open(path).map_err(unreadable)?);
    let loader = radiant::Loader::new(file).map_err(unreadable)?;
    small_enough(loader.width, loader.height)?;
    let picture = loader.load_image().map_err(unreadable)?;
    // The crate takes mantissas over 255, Radiance means 256.
    let texels = picture.data.iter().map(|texel| [texel.r, texel.g, texel.b].map(|c| c * (255.0 / 256.0))).collect();
    Ok((picture.width, picture.height, texels))
}

/// Reads an image of a sky.
fn image(path: &Path, notes: &mut Vec<String>) -> Result<Dome> {
    let fix = "Name an EXR or HDR image of the whole sky, twice as wide as high";
    let wrong = |reason: String| Error::File { file: path.to_owned(), reason, fix: fix.into() };
    let ending = path.extension().map(|e| e.to_ascii_lowercase());
    let (width, height, mut texels) = match ending.as_ref().and_then(|e| e.to_str()) {
        Some("exr") => read_exr(path).map_err(wrong)?,
        Some("hdr") => read_hdr(path).map_err(wrong)?,
        _ => return Err(wrong("it is no .exr and no .hdr file".into())),
    };
    let bad = |v: &f32| !(*v >= 0.0 && v.is_finite());
    let odd = texels.iter().filter(|t| t.iter().any(bad)).count();
    if odd > 0 {
        notes.push(format!("{}: {odd} pixels are below zero or no numbers; they are taken as black.", path.display()));
        texels.iter_mut().flatten().filter(|v| bad(v)).for_each(|v| *v = 0.0);
    }
    if width != 2 * height {
        notes.push(format!("{}: {width} x {height} pixels; an image of all directions is twice as wide as high.", path.display()));
    }
    let step = width.div_ceil(WIDEST).max(1);
    let (width, height, texels) = if step > 1 { coarser(width, height, &texels, step) } else { (width, height, texels) };
    Dome::new(width, height, texels).ok_or_else(|| wrong("no pixel of it is above 0".into()))
}

/// The means of blocks of `step` texels a side; what is left over at the right and at the bottom makes smaller blocks.
fn coarser(width: usize, height: usize, texels: &[[f32; 3]], step: usize) -> (usize, usize, Vec<[f32; 3]>) {
    let (across, down) = (width.div_ceil(step), height.div_ceil(step));
    let block = |i: usize| {
        let (x0, y0) = (i % across * step, i / across * step);
        let (mut sum, mut count) = ([0.0f32; 3], 0.0);
        for y in y0..(y0 + step).min(height) {
            for texel in &texels[y * width + x0..y * width + (x0 + step).min(width)] {
                sum = std::array::from_fn(|c| sum[c] + texel[c]);
                count += 1.0;
            }
        }
        sum.map(|s| s / count)
    };
    (across, down, (0..across * down).map(block).collect())
}

/// Reads the value of the scene's key `sky`; images are named from the folder of `file`.
pub(super) fn read(value: &Value, at: At, notes: &mut Vec<String>) -> Result<SkySpec> {
    let fields = |map| Fields { map, at, path: KEY };
    match value {
        Value::Number(_) | Value::Array(_) => {
            let map = Map::from_iter([("sky".to_owned(), value.clone())]);
            let fields = Fields { map: &map, at, path: "extras.cloudvdb" };
            Ok(SkySpec::Made(Sky::Even(radiance(&fields, "sky")?.unwrap_or_default())))
        }
        Value::String(word) => one(&fields(&Map::from_iter([("preset".to_owned(), Value::from(word.as_str()))])), notes),
        Value::Object(map) => one(&fields(map), notes),
        other => Err(at.error(
            KEY,
            describe(other),
            "a radiance, \"clear\", or an object with a preset, with zenith and horizon, or with an image",
            "Correct it in the custom property of the scene and export again",
        )),
    }
}

fn radiance(fields: &Fields, key: &str) -> Result<Option<[f64; 3]>> {
    let rgb = fields.rgb(key)?;
    rgb.iter().flatten().try_for_each(|&v| fields.at_least_zero(key, v).map(drop))?;
    Ok(rgb)
}

fn one(fields: &Fields, notes: &mut Vec<String>) -> Result<SkySpec> {
    let strength = radiance(fields, "strength")?;
    if let Some(spelt) = fields.text("image")? {
        fields.unknown(&[&["image", "strength", "turn"]], notes);
        let path = named(fields.at.file, spelt, fields.at, ("extras.cloudvdb.sky.image", "the path of an EXR or HDR image"))?;
        let turn = fields.number("turn")?.unwrap_or(0.0).to_radians();
        return Ok(SkySpec::Image { path, strength: strength.unwrap_or([1.0; 3]), turn });
    }
    if let (Some(zenith), horizon) = (radiance(fields, "zenith")?, radiance(fields, "horizon")?) {
        fields.unknown(&[&["zenith", "horizon", "ground"]], notes);
        let horizon = horizon.ok_or_else(|| fields.wrong("horizon", "missing".into(), "a radiance, beside that of the zenith".into()))?;
        return Ok(SkySpec::Made(Sky::Gradient { zenith, horizon, ground: radiance(fields, "ground")?.unwrap_or(horizon) }));
    }
    match fields.text("preset")? {
        Some(CLEAR) => {
            fields.unknown(&[&["preset", "turbidity", "albedo", "strength"]], notes);
            let turbidity = fields.number("turbidity")?.unwrap_or(3.0);
            if !(1.0..=10.0).contains(&turbidity) {
                return Err(fields.wrong("turbidity", turbidity.to_string(), "a number from 1 (none but air) to 10 (haze)".into()));
            }
            let albedo = fields.rgb("albedo")?.unwrap_or([0.2; 3]);
            if albedo.iter().any(|a| !(0.0..=1.0).contains(a)) {
                return Err(fields.wrong("albedo", format!("{albedo:?}"), "numbers from 0 to 1".into()));
            }
            let strength = strength.map_or(1.0, crate::scene::medium::luminance);
            Ok(SkySpec::Made(Sky::Clear { turbidity, albedo, strength }))
        }
        found => {
            let said = found.map_or("missing".into(), |word| format!("{word:?}"));
            Err(fields.wrong("preset", said, format!("{CLEAR}; or zenith and horizon, or an image")))
        }
    }
}

/// A sky as a flag spells it: radiance as one number or R,G,B; two or three of them with `+` between, from the zenith to the horizon and
/// the ground; `clear` with options as in `clear:turbidity=4`; or an image, as in `studio.exr:strength=2,turn=90`.
///
/// # Errors
/// The sentence that says what is wrong.
pub fn spelt(text: &str) -> std::result::Result<SkySpec, String> {
    let number = |part: &str| part.trim().parse::<f64>().ok();
    let rgb = |part: &str| {
        let numbers: Option<Vec<f64>> = part.split(',').map(number).collect();
        match numbers.as_deref() {
            Some(&[one]) => Some([one; 3]),
            Some(&[r, g, b]) => Some([r, g, b]),
            _ => None,
        }
    };
    if let Some(colours) = text.split('+').map(rgb).collect::<Option<Vec<_>>>() {
        if colours.iter().flatten().any(|&v| !(v >= 0.0 && v.is_finite())) {
            return Err(format!("{text:?} is not made of numbers from 0 up"));
        }
        return match colours[..] {
            [even] => Ok(SkySpec::Made(Sky::Even(even))),
            [zenith, horizon] => Ok(SkySpec::Made(Sky::Gradient { zenith, horizon, ground: horizon })),
            [zenith, horizon, ground] => Ok(SkySpec::Made(Sky::Gradient { zenith, horizon, ground })),
            _ => Err(format!("{text:?} has more than a zenith, a horizon and a ground")),
        };
    }
    // Options are behind the last colon, if it has any behind it.
    let (name, options) = match text.rsplit_once(':') {
        Some((name, options)) if options.contains('=') => (name, options),
        _ => (text, ""),
    };
    let mut map = Map::new();
    for option in options.split(',').filter(|option| !option.is_empty()) {
        let number = option.split_once('=').and_then(|(key, value)| Some((key.trim(), number(value)?)));
        let Some((key, number)) = number else { return Err(format!("{option:?} is not an option such as strength=2")) };
        map.insert(key.to_owned(), Value::from(number));
    }
    if name == CLEAR {
        map.insert("preset".into(), Value::from(name));
    } else if Path::new(name).extension().is_some_and(|e| e.eq_ignore_ascii_case("exr") || e.eq_ignore_ascii_case("hdr")) {
        map.insert("image".into(), Value::from(name));
    } else {
        return Err(format!("{text:?} is not a radiance such as 0.1,0.2,0.4, a gradient ZENITH+HORIZON, clear, or an .exr or .hdr image"));
    }
    let at = At { file: Path::new("--sky"), kind: "scene", index: 0, name: None };
    let mut notes = Vec::new();
    let sky = read(&Value::Object(map), at, &mut notes).map_err(|error| match error {
        Error::Node { field, found, expected, .. } => {
            format!("{} is {found}, expected {expected}", field.trim_start_matches(KEY).trim_start_matches('.'))
        }
        other => other.to_string(),
    })?;
    match notes.is_empty() {
        true => Ok(sky),
        false => {
            Err(format!("{text:?} has options that mean nothing here; images have strength and turn, clear turbidity, albedo and strength"))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn json(value: Value) -> Result<SkySpec> {
        read(&value, At { file: Path::new("scene.gltf"), kind: "scene", index: 0, name: None }, &mut Vec::new())
    }

    #[test]
    fn files_and_flags_say_the_same() {
        use serde_json::json as value;
        for (flag, file) in [
            ("0.5", value!(0.5)),
            ("0.1,0.2,0.4", value!([0.1, 0.2, 0.4])),
            ("0.1,0.2,0.4+1", value!({"zenith": [0.1, 0.2, 0.4], "horizon": 1})),
            ("0.1+0.2+0.3", value!({"zenith": 0.1, "horizon": 0.2, "ground": 0.3})),
            ("clear", value!("clear")),
            ("clear:turbidity=5,strength=2", value!({"preset": "clear", "turbidity": 5, "strength": 2})),
        ] {
            assert_eq!(spelt(flag).unwrap(), json(file).unwrap(), "{flag}");
        }
    }

    #[test]
    fn what_is_no_sky_is_said_to_be_none() {
        for wrong in ["blue", "-1", "0.1+x", "1+2+3+4", "clear:turbidity=20", "clear:turn=3", "clear:strength=x", "nowhere.exr", "nan"] {
            let error = spelt(wrong).unwrap_err();
            println!("{wrong}: {error}");
            assert!(error.len() > 20, "{wrong}: {error}");
        }
        for wrong in [serde_json::json!({"zenith": 1}), serde_json::json!(true), serde_json::json!({"image": ""}), serde_json::json!({})] {
            let error = json(wrong).unwrap_err().to_string();
            assert!(error.contains("extras.cloudvdb.sky"), "{error}");
        }
    }

    #[test]
    fn images_are_read_as_they_lie_and_wide_ones_averaged() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sky.exr");
        exr::prelude::write_rgb_file(&path, 64, 32, |x, y| if x < 32 { (1.0f32, 2.0, y as f32) } else { (3.0, f32::NAN, -1.0) }).unwrap();
        let mut notes = Vec::new();
        let dome = image(&path, &mut notes).unwrap();
        assert_eq!((dome.size(), notes.len()), ([64, 32], 1));
        assert_eq!(dome.radiance(glam::Vec3::Y).to_array()[..2], [1.0, 2.0]);
        assert_eq!(dome.radiance(glam::Vec3::NEG_Y).to_array(), [3.0, 0.0, 0.0]);
        let (width, height, texels) = coarser(5, 3, &(0..15).map(|i| [i as f32; 3]).collect::<Vec<_>>(), 2);
        assert_eq!((width, height, texels[0], texels[5]), (3, 2, [3.0; 3], [14.0; 3]));
        // Flat RGBE: mantissas over 256 times two to the exponent less 128.
        let flat = folder.path().join("sky.hdr");
        let head = |size: &str| format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n{size}\n").into_bytes();
        std::fs::write(&flat, [head("-Y 1 +X 2"), vec![128, 64, 32, 130, 128, 128, 128, 129]].concat()).unwrap();
        let (width, height, texels) = read_hdr(&flat).unwrap();
        assert_eq!((width, height), (2, 1));
        for (found, meant) in texels.iter().flatten().zip([2.0, 1.0, 0.5, 1.0, 1.0, 1.0]) {
            assert!((found / meant - 1.0f32).abs() < 1e-6, "{texels:?}");
        }
        std::fs::write(&flat, head("-Y 4000000000 +X 4000000000")).unwrap();
        assert!(image(&flat, &mut notes).unwrap_err().to_string().contains("are more than"));
        std::fs::write(&flat, head("-Y 64 +X 128")).unwrap();
        assert!(image(&flat, &mut notes).unwrap_err().to_string().contains("cannot be read as an HDR image"));
        std::fs::write(&path, b"no image").unwrap();
        assert!(image(&path, &mut notes).unwrap_err().to_string().contains("cannot be read as an EXR image"));
    }
}
