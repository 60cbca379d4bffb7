//! The picture as PNG: a preview, with the tones that Blender would show it in.
//!
//! 8 bits, sRGB, opaque: where there is no sky, the cloud stands before black. Colours are associated with their alpha, so
//! that is what they are without it; PNG's own alpha is not associated, and viewers put white, grey or a chequerboard behind
//! it, where a cloud's soft edges look wrong. Whoever composes takes the EXR.

use super::staged::write_bytes;
use crate::error::{Error, Result};
use crate::film::{Film, tone};
use rayon::prelude::*;
use std::path::Path;

/// Writes a film as PNG by [`tone::agx`], brighter by `exposure` stops. The same film gives the same bytes.
///
/// What is not finite, or negative, is shown as [`tone::agx`] says.
///
/// # Errors
/// [`Error::Write`], also for a film without pixels.
pub fn write(path: &Path, film: &Film, exposure: f64) -> Result<()> {
    let bytes = shown(film, exposure).map_err(|reason| Error::Write {
        target: path.into(),
        reason: format!("a picture of {} x {} pixels cannot be written as PNG ({reason})", film.width, film.height),
        fix: "Choose another size".into(),
    })?;
    write_bytes(path, &bytes)
}

/// A film as PNG, in memory.
fn shown(film: &Film, exposure: f64) -> std::result::Result<Vec<u8>, png::EncodingError> {
    let gain = exposure.exp2();
    let byte = |c: f64| (c * 255.0).round() as u8;
    let shown: Vec<[u8; 3]> = film.pixels.par_iter().map(|p| tone::agx(p.combined().map(|c| f64::from(c) * gain)).map(byte)).collect();
    encode(film.width, film.height, shown.as_flattened())
}

/// Pixels of three bytes, sRGB, as PNG, in memory.
///
/// # Errors
/// Where there is no pixel.
pub fn encode(width: u32, height: u32, pixels: &[u8]) -> std::result::Result<Vec<u8>, png::EncodingError> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(pixels)?;
    writer.finish()?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::Pixel;
    use std::io::Cursor;

    fn film(width: u32, height: u32, light: impl Fn(u32) -> [f32; 3]) -> Film {
        let pixel = |i| Pixel { surface: light(i), transmittance: 1.0, ..Pixel::default() };
        Film { width, height, pixels: (0..width * height).map(pixel).collect(), sky: false }
    }

    fn decode(bytes: &[u8]) -> Vec<u8> {
        let mut reader = png::Decoder::new(Cursor::new(bytes)).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut pixels).unwrap();
        assert_eq!((info.color_type, info.bit_depth), (png::ColorType::Rgb, png::BitDepth::Eight));
        assert_eq!(reader.info().srgb, Some(png::SrgbRenderingIntent::Perceptual));
        pixels
    }

    #[test]
    fn pixels_come_back_where_they_were() {
        let film = film(7, 5, |i| [0.02 * i as f32, 0.18, 0.5 / (1.0 + i as f32)]);
        let expected: Vec<u8> = film
            .pixels
            .iter()
            .flat_map(|p| tone::agx(p.combined().map(|c| 2.0 * f64::from(c))).map(|c| (c * 255.0).round() as u8))
            .collect();
        assert_eq!(decode(&shown(&film, 1.0).unwrap()), expected);
        assert_eq!(shown(&film, 1.0).unwrap(), shown(&film, 1.0).unwrap());
    }

    #[test]
    fn black_grey_and_white_are_shown_as_such_and_exposure_counts_in_stops() {
        let level = |light: f32, stops: f64| decode(&shown(&film(1, 1, |_| [light; 3]), stops).unwrap());
        assert_eq!(level(0.0, 20.0), [0; 3]);
        assert_eq!(level(0.18, 0.0), [118; 3]);
        assert_eq!(level(0.18 / 8.0, 3.0), [118; 3]);
        assert_eq!(level(1e6, 0.0), [255; 3]);
        assert_eq!(level(0.0, 1e9), [0; 3]);
    }

    #[test]
    fn what_is_no_light_is_neither_white_nor_an_end() {
        let odd = [f32::NAN, f32::NEG_INFINITY, -1.0, f32::INFINITY, f32::MAX];
        let shown = decode(&shown(&film(5, 1, |i| [odd[i as usize]; 3]), 0.0).unwrap());
        assert_eq!(shown, [[0; 3], [0; 3], [0; 3], [255; 3], [255; 3]].as_flattened());
    }

    #[test]
    fn what_cannot_be_written_is_said() {
        let says = |path: &Path, film: &Film| match write(path, film, 0.0) {
            Err(error @ Error::Write { .. }) => error.to_string(),
            other => panic!("{other:?}"),
        };
        assert!(says(Path::new("/nowhere/x.png"), &film(0, 0, |_| [0.0; 3])).contains("0 x 0 pixels cannot be written as PNG"));
        assert!(says(Path::new("/nowhere/x.png"), &film(1, 1, |_| [0.0; 3])).contains("No such file"));
        assert!(says(Path::new("/dev/full"), &film(1, 1, |_| [0.0; 3])).contains("No space left"));
    }
}
