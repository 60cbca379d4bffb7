//! The study as one page that needs nothing beside it.

use super::figures::{Cell, Figures, name};
use super::line::GOALS;
use super::plot::unit;
use crate::export::png;
use crate::export::report::{duration, percent};
use crate::film::{Film, Pixel};
use base64::prelude::{BASE64_STANDARD, Engine};

pub(in crate::study) const STYLE: &str = "body{font:16px/1.45 sans-serif;max-width:1000px;margin:2em auto;padding:0 1em;color:#222}\
svg{max-width:100%;height:auto}table{border-collapse:collapse;margin:1em 0}td,th{padding:.25em .8em;text-align:right;border-bottom:1px solid #ddd}\
td,th{white-space:nowrap}td:nth-child(2){white-space:normal}td:first-child,th:first-child{text-align:left}figure{display:inline-block;margin:0 .8em 1em 0}figcaption{font-size:.85em;color:#555}\
img{image-rendering:pixelated;width:300px}";
/// A difference as bright as the picture's mean is full red or blue.
const FULL: f32 = 0.25;

/// Writes the page around the plot.
pub(super) fn page(figures: &Figures, plot: &str) -> String {
    let [width, height] = figures.size;
    let scene = escaped(&figures.scene);
    let mut text = format!(
        "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>{scene}: what accuracy costs</title><style>{STYLE}</style>\
         <h1>{scene}: what accuracy costs</h1><p>{width} x {height} pixels. The reference is the path tracer's, twice {} samples a pixel, \
         known to {} a pixel; that noise is in no figure here. Errors are the root mean square over lit pixels, over their mean. Bars are two \
         standard errors by the scatter of seeds; lines are fits, dashed ones the bias of the last setting. Marks in grey rings are quicker or \
         more exact than every other. Pale marks differ in one setting from those on the lines.</p>{plot}",
        figures.reference_samples,
        percent(figures.reference_noise),
    );
    text += "<h2>Seconds to an error</h2><table><tr><th>integrator</th>";
    GOALS.iter().for_each(|&goal| text += &format!("<th>{}</th>", percent(goal)));
    text += "<th>bias at most work</th></tr>";
    for line in &figures.lines {
        text += &format!("<tr><td>{}</td>", name(line.integrator));
        for seconds in line.to {
            text += &format!("<td>{}</td>", seconds.map_or("never".into(), duration));
        }
        text += &format!("<td>{}</td></tr>", if line.bias > 0.0 { percent(line.bias) } else { "within noise".into() });
    }
    text += "</table>";
    text += &match figures.path_overtakes {
        Some((seconds, error)) => {
            format!("<p>From {} on, at {}, the path tracer is the most exact.</p>", duration(seconds), percent(error))
        }
        None => "<p>Nowhere do these lines say that the path tracer overtakes the others, or it leads from the start.</p>".into(),
    };
    text += "<h2>Every setting</h2><table><tr><th>integrator</th><th>work</th><th>seconds</th><th>error</th><th>noise</th><th>bias</th>\
             <th>stated</th><th>mean</th><th>seeds</th></tr>";
    for (i, cell) in figures.cells.iter().enumerate() {
        let best = if figures.pareto.contains(&i) { " *" } else { "" };
        text += &format!(
            "<tr><td>{}{best}</td><td>{} {}{}</td><td>{:.2}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{:+.2} %</td><td>{}</td></tr>",
            name(cell.setting.integrator),
            cell.setting.work,
            unit(cell.setting.integrator),
            cell.setting.change.map_or(String::new(), |change| format!(", {change}")),
            cell.seconds,
            percent(cell.error()),
            percent(cell.noise_square.sqrt()),
            bias(cell),
            cell.stated.map_or("-".into(), percent),
            100.0 * cell.mean_off,
            cell.seeds,
        );
    }
    text += "</table><p>* no other setting is quicker and more exact.</p>";
    if !figures.others.is_empty() {
        text += "<h2>Others</h2><table><tr><th>picture</th><th>seconds</th><th>error</th><th>mean</th></tr>";
        for o in &figures.others {
            let row = format!("<tr><td>{}</td><td>{:.2}</td><td>{}</td>", escaped(&o.name), o.seconds, percent(o.error));
            text += &(row + &format!("<td>{:+.2} %</td></tr>", 100.0 * o.mean_off));
        }
        text += "</table>";
    }
    text += "<h2>Pictures</h2><p>Each integrator's most work, and what it is off by: red is too bright, blue too dark, full at a quarter of the mean.</p>";
    let shown = |what: &str, pixels: &[[f32; 3]], exposure: f64| {
        let source = picture(pixels, figures.size, exposure);
        source.map_or(String::new(), |data| format!("<figure><img alt=\"{what}\" src=\"{data}\"><figcaption>{what}</figcaption></figure>"))
    };
    let truth = &figures.truth.pixels;
    let mean = truth.iter().map(|t| t[1]).sum::<f32>() / truth.len() as f32;
    let exposure = f64::from((0.35 / mean.max(f32::MIN_POSITIVE)).log2());
    text += &shown("reference", truth, exposure);
    for line in &figures.lines {
        let Some(cell) = figures.cells.iter().rfind(|c| c.setting.integrator == line.integrator && c.setting.change.is_none()) else {
            continue;
        };
        let label = format!("{}, {} {}", name(line.integrator), cell.setting.work, unit(line.integrator));
        let off: Vec<[f32; 3]> = cell.picture.iter().zip(truth).map(|(a, b)| signed((a[1] - b[1]) / mean / FULL)).collect();
        text += &format!("<div>{}{}</div>", shown(&label, &cell.picture, exposure), shown(&format!("{label}: off"), &off, 0.0));
    }
    text + "</html>\n"
}

fn bias(cell: &Cell) -> String {
    if cell.is_off() { percent(cell.bias_square.sqrt()) } else { "within noise".into() }
}

/// From blue by grey to red.
fn signed(x: f32) -> [f32; 3] {
    let x = x.clamp(-1.0, 1.0);
    [0.2 + 0.8 * x.max(0.0) - 0.2 * (-x).max(0.0), 0.2 - 0.2 * x.abs(), 0.2 + 0.8 * (-x).max(0.0) - 0.2 * x.max(0.0)]
}

/// A picture as the source of an `img`.
pub(in crate::study) fn picture(pixels: &[[f32; 3]], [width, height]: [u32; 2], exposure: f64) -> Option<String> {
    let pixel = |&surface: &[f32; 3]| Pixel { surface, opaque: 1.0, ..Pixel::UNKNOWN };
    let film = Film { width, height, pixels: pixels.iter().map(pixel).collect(), sky: true };
    let file = tempfile::NamedTempFile::new().ok()?;
    png::write(file.path(), &film, exposure).ok()?;
    Some(format!("data:image/png;base64,{}", BASE64_STANDARD.encode(std::fs::read(file.path()).ok()?)))
}

pub(in crate::study) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
