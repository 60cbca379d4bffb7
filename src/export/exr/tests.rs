use super::*;
use crate::film::NOTHING;
use exr::prelude::{FlatImage, FlatSamples, ReadChannels, ReadLayers};
use std::collections::BTreeMap;

/// A film whose every number is another one.
fn film(width: u32, height: u32, sky: bool) -> Film {
    let pixel = |i: u32| {
        let value = |k: u32| (i * 17 + k) as f32 * 0.37e-3;
        let colour = |k: u32| [value(3 * k), value(3 * k + 1), value(3 * k + 2)];
        Pixel {
            volume_direct: colour(0),
            volume_indirect: colour(1),
            surface: colour(2),
            environment: colour(3),
            standard_error: colour(4),
            photon_noise: value(17),
            bias: value(18),
            transmittance: 1.0 / (1.0 + value(15)),
            opaque: (i % 3) as f32 / 2.0,
            depth: if i.is_multiple_of(5) { NOTHING } else { 1.0 + value(16) },
        }
    };
    Film { width, height, pixels: (0..width * height).map(pixel).collect(), sky }
}

fn read(bytes: &[u8]) -> FlatImage {
    exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))
        .unwrap()
}

fn channels_of(image: &FlatImage) -> BTreeMap<String, Vec<f32>> {
    let [layer] = image.layer_data.as_slice() else { panic!("more than one part") };
    let samples = |samples: &FlatSamples| match samples {
        FlatSamples::F32(values) => values.clone(),
        _ => panic!("not 32-bit float"),
    };
    layer.channel_data.list.iter().map(|c| (c.name.to_string(), samples(&c.sample_data))).collect()
}

#[test]
fn every_channel_comes_back_exactly() {
    for sky in [false, true] {
        // More rows than a block of ZIP has, and not a multiple of it.
        let film = film(23, 37, sky);
        let mut found = channels_of(&read(&encode(&film, true).unwrap()));
        let mut is = |name: &str, value: &dyn Fn(&Pixel) -> f32| {
            let values = found.remove(name).unwrap_or_else(|| panic!("no {name}"));
            assert_eq!(values, film.pixels.iter().map(value).collect::<Vec<f32>>(), "{name}");
        };
        for (c, name) in ["R", "G", "B"].into_iter().enumerate() {
            is(name, &|p| p.combined()[c]);
            is(&format!("VolumeDir.{name}"), &|p| p.volume_direct[c]);
            is(&format!("VolumeInd.{name}"), &|p| p.volume_indirect[c]);
            is(&format!("Surface.{name}"), &|p| p.surface[c]);
            is(&format!("Env.{name}"), &|p| p.environment[c]);
            is(&format!("StandardError.{name}"), &|p| p.standard_error[c]);
        }
        is("A", &|p| if sky { 1.0 } else { p.coverage() });
        is("Transmittance.X", &|p| p.transmittance);
        is("Depth.Z", &|p| p.depth);
        assert!(found.is_empty(), "{:?}", found.keys());
    }
}

#[test]
fn the_header_says_what_it_is() {
    let image = read(&encode(&film(4, 3, true), true).unwrap());
    let layer = &image.layer_data[0];
    assert_eq!(layer.attributes.software_name.as_ref().unwrap().to_string(), SOFTWARE);
    assert!(layer.attributes.comments.as_ref().unwrap().to_string().contains("one sigma"));
    assert!(COMMENT.len() < 256);
    assert_eq!(layer.attributes.layer_name, None);
    assert_eq!((image.attributes.pixel_aspect, image.attributes.chromaticities), (1.0, Some(REC_709)));
    assert_eq!((layer.size, image.attributes.display_window), (Vec2(4, 3), IntegerBounds::from_dimensions((4, 3))));
    assert_eq!(layer.encoding.compression, Compression::ZIP16);
}

#[test]
fn the_same_film_gives_the_same_bytes_on_any_number_of_threads() {
    let film = film(40, 300, false);
    let once = encode(&film, true).unwrap();
    assert!(once == encode(&film, true).unwrap() && once == encode(&film, false).unwrap());
}

#[test]
fn what_is_not_finite_is_written_as_it_is() {
    let mut film = film(2, 1, false);
    film.pixels[0].surface = [f32::NAN, f32::INFINITY, -1.0];
    let found = channels_of(&read(&encode(&film, true).unwrap()));
    assert!(found["R"][0].is_nan() && found["Surface.G"][0] == f32::INFINITY && found["Surface.B"][0] == -1.0);
}

#[test]
fn what_cannot_be_written_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let says = |path: &Path, film: &Film| match super::write(path, film) {
        Err(error @ Error::Write { .. }) => error.to_string(),
        other => panic!("{other:?}"),
    };
    let none = folder.path().join("none.exr");
    assert!(says(&none, &Film { width: 0, height: 3, pixels: vec![], sky: false }).contains("0 x 3 pixels cannot be written"));
    assert!(!none.exists());
    assert!(says(&folder.path().join("no/x.exr"), &film(2, 2, false)).contains("cannot be written (No such file"));
    assert!(says(Path::new("/dev/full"), &film(2, 2, false)).contains("No space left"));
    super::write(&folder.path().join("x.exr"), &film(2, 2, false)).unwrap();
}
