//! The picture as OpenEXR: what each kind of light brings, how opaque and how far each pixel is, and how exact.
//!
//! One part, 32-bit float, ZIP. The sum of the light is in the plain channels `R`, `G`, `B` and `A`, which every reader shows;
//! the rest are layers by OpenEXR's convention, with the names that Cycles gives its passes where it has them:
//!
//! | channels | what | in Blender |
//! | --- | --- | --- |
//! | `R` `G` `B` `A` | all light, W m^-2 sr^-1, linear Rec. 709, associated with its alpha ([`Film::alpha`]) | Combined |
//! | `VolumeDir.R` `.G` `.B` | [`Pixel::volume_direct`] | VolumeDir |
//! | `VolumeInd.R` `.G` `.B` | [`Pixel::volume_indirect`] | VolumeInd |
//! | `Surface.R` `.G` `.B` | [`Pixel::surface`]; Cycles has it in parts | Surface |
//! | `Env.R` `.G` `.B` | [`Pixel::environment`] | Env |
//! | `StandardError.R` `.G` `.B` | [`Pixel::standard_error`], of the sum | StandardError |
//! | `Transmittance.X` | [`Pixel::transmittance`] | Transmittance |
//! | `Depth.Z` | [`Pixel::depth`], m; 1e10 where there is nothing | Depth |
//!
//! Cycles puts its view layer's name before all that (`ViewLayer.Combined.R`), so that readers that know the plain names alone
//! find nothing. Without it Blender has one layer without a name, whose passes are at hand in the compositor at once;
//! with both, it would show the plain channels, and hide the passes in a second layer.

use super::staged::write_bytes;
use crate::error::{Error, Result};
use crate::film::{Film, Pixel};
use exr::block::lines::LineRefMut;
use exr::image::write::samples::{SamplesWriter, WritableSamples};
use exr::math::RoundingMode;
use exr::meta::attribute::{Chromaticities, LevelMode, LineOrder, SampleType};
use exr::meta::header::Header;
use exr::prelude::{
    AnyChannel, AnyChannels, Blocks, Compression, Encoding, Image, IntegerBounds, Layer, LayerAttributes, Text, Vec2, WritableImage,
};
use std::io::Cursor;
use std::path::Path;

const SOFTWARE: &str = concat!("cloudvdb ", env!("CARGO_PKG_VERSION"));
/// At most 255 characters: ffmpeg reads no file with a longer text.
const COMMENT: &str = "W m^-2 sr^-1, linear Rec. 709. RGB = VolumeDir + VolumeInd + Surface + Env. StandardError: one sigma of that \
    sum from its samples; 2 in 3 pixels lie within it. Transmittance: share unscattered. Depth: m along the camera's axis.";
/// Rec. 709's primaries and its white, D65, in CIE xy.
const REC_709: Chromaticities =
    Chromaticities { red: Vec2(0.64, 0.33), green: Vec2(0.3, 0.6), blue: Vec2(0.15, 0.06), white: Vec2(0.3127, 0.329) };

/// Writes a film as multi-layer OpenEXR. The same film gives the same bytes.
///
/// # Errors
/// [`Error::Write`], also for a film without pixels.
pub fn write(path: &Path, film: &Film) -> Result<()> {
    // One thread was asked for: the compressor shall not start others.
    let bytes = encode(film, rayon::current_num_threads() > 1).map_err(|reason| Error::Write {
        target: path.into(),
        reason: format!("a picture of {} x {} pixels cannot be written as OpenEXR ({reason})", film.width, film.height),
        fix: "Choose another size".into(),
    })?;
    write_bytes(path, &bytes)
}

/// A film as OpenEXR, in memory.
fn encode(film: &Film, parallel: bool) -> std::result::Result<Vec<u8>, String> {
    if film.pixels.is_empty() || film.pixels.len() != film.width as usize * film.height as usize {
        return Err(format!("it holds {}", film.pixels.len()));
    }
    let size = Vec2(film.width as usize, film.height as usize);
    let attributes =
        LayerAttributes { software_name: Some(Text::from(SOFTWARE)), comments: Some(Text::from(COMMENT)), ..LayerAttributes::default() };
    let encoding = Encoding { compression: Compression::ZIP16, blocks: Blocks::ScanLines, line_order: LineOrder::Increasing };
    let mut image = Image::from_layer(Layer::new(size, attributes, encoding, AnyChannels::sort(channels(film).collect())));
    image.attributes.display_window = IntegerBounds::from_dimensions(size);
    image.attributes.chromaticities = Some(REC_709);
    let mut bytes = Cursor::new(Vec::new());
    let writer = image.write();
    let writer = if parallel { writer } else { writer.non_parallel() };
    writer.to_buffered(&mut bytes).map_err(|e| e.to_string())?;
    Ok(bytes.into_inner())
}

type Colour = fn(&Pixel) -> [f32; 3];
type Value = fn(&Film, &Pixel) -> f32;

/// Where a channel finds its values.
#[derive(Clone, Copy)]
enum Get {
    /// One component of a colour.
    Colour(Colour, usize),
    Value(Value),
}

/// A channel, read off the film as it is written: no copy is made.
#[derive(Clone, Copy)]
struct Samples<'a> {
    film: &'a Film,
    get: Get,
}

fn channels(film: &Film) -> impl Iterator<Item = AnyChannel<Samples<'_>>> {
    const COLOURS: [(&str, Colour); 6] = [
        ("", Pixel::combined),
        ("VolumeDir.", |p| p.volume_direct),
        ("VolumeInd.", |p| p.volume_indirect),
        ("Surface.", |p| p.surface),
        ("Env.", |p| p.environment),
        ("StandardError.", |p| p.standard_error),
    ];
    const VALUES: [(&str, Value); 3] = [("A", Film::alpha), ("Transmittance.X", |_, p| p.transmittance), ("Depth.Z", |_, p| p.depth)];
    let colours = COLOURS.into_iter().flat_map(|(layer, get)| {
        ["R", "G", "B"].into_iter().enumerate().map(move |(c, name)| (format!("{layer}{name}"), Get::Colour(get, c)))
    });
    let values = VALUES.into_iter().map(|(name, get)| (name.to_string(), Get::Value(get)));
    colours.chain(values).map(move |(name, get)| AnyChannel::new(name.as_str(), Samples { film, get }))
}

impl<'a> WritableSamples<'_> for Samples<'a> {
    type Writer = Samples<'a>;

    fn sample_type(&self) -> SampleType {
        SampleType::F32
    }

    fn infer_level_modes(&self) -> (LevelMode, RoundingMode) {
        (LevelMode::Singular, RoundingMode::Down)
    }

    fn create_samples_writer(&self, _: &Header) -> Samples<'a> {
        *self
    }
}

impl SamplesWriter for Samples<'_> {
    fn extract_line(&self, line: LineRefMut<'_>) {
        let Vec2(x, y) = line.location.position;
        let row = &self.film.pixels[y * self.film.width as usize + x..][..line.location.sample_count];
        // It goes to memory of the right size, and cannot fail.
        let _ = line.write_samples(|i| match self.get {
            Get::Colour(get, c) => get(&row[i])[c],
            Get::Value(get) => get(self.film, &row[i]),
        });
    }
}

#[cfg(test)]
mod tests;
