//! What the studies' plots share: colours, letters, numbers; and from a plot to SVG and PNG.

use crate::export::png;
use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::register_font;

/// Colours that the colour-blind tell apart (Okabe and Ito 2008).
pub(super) const COLOURS: [RGBColor; 4] = [RGBColor(0, 114, 178), RGBColor(213, 94, 0), RGBColor(0, 158, 115), RGBColor(204, 121, 167)];
/// What the plots' letters are called; an SVG takes the reader's own, a PNG those that come with [`epaint_default_fonts`].
pub(super) const FONT: &str = "sans-serif";

/// Drawn, or why not.
pub(super) type Drawn = Result<(), Box<dyn std::error::Error>>;

/// Something that can be drawn.
pub(super) trait Plot {
    /// Its pixels.
    const SIZE: (u32, u32);

    /// Draws it.
    fn draw<DB: DrawingBackend>(&self, root: DrawingArea<DB, Shift>) -> Drawn
    where
        DB::ErrorType: 'static;
}

/// A plot as SVG; nothing where it cannot be drawn, which is no reason to lose a study.
pub(super) fn svg<P: Plot>(plot: &P) -> String {
    let mut text = String::new();
    let drawn = letters().and_then(|()| plot.draw(SVGBackend::with_string(&mut text, P::SIZE).into_drawing_area()));
    if drawn.is_ok() { text } else { String::new() }
}

/// A plot as the bytes of a PNG; nothing where it cannot be drawn.
pub(super) fn png<P: Plot>(plot: &P) -> Vec<u8> {
    let (width, height) = P::SIZE;
    let mut pixels = vec![0; 3 * width as usize * height as usize];
    let drawn = letters().and_then(|()| plot.draw(BitMapBackend::with_buffer(&mut pixels, P::SIZE).into_drawing_area()));
    drawn.and_then(|()| Ok(png::encode(width, height, &pixels)?)).unwrap_or_default()
}

fn letters() -> Drawn {
    register_font(FONT, FontStyle::Normal, epaint_default_fonts::UBUNTU_LIGHT).map_err(|_| "the letters cannot be read".into())
}

/// A number with as many digits as it needs.
pub(super) fn number(x: f64) -> String {
    match x {
        1e6.. => format!("{}M", x / 1e6),
        1e4.. => format!("{}k", x / 1e3),
        10.0.. => format!("{x:.0}"),
        _ => format!("{x:.3}").trim_end_matches('0').trim_end_matches('.').to_string(),
    }
}
