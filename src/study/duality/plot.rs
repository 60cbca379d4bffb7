//! What stays uncovered, and what that does, as SVG.

use super::measure::{DEPTH_SQUARE, RADIANCE_SQUARE, TRANSMITTANCE_SQUARE, UNCOVERED};
use super::{Cell, Findings, Setting};
use crate::regions::Placement;
use crate::study::chart::{COLOURS, Drawn, FONT, Plot, number};
use plotters::coord::Shift;
use plotters::prelude::*;

/// One line of a chart: its name, and where it goes with two standard errors.
struct Curve {
    name: String,
    colour: RGBColor,
    mark: usize,
    points: Vec<(f64, f64, f64)>,
}

/// What stays uncovered by photons, and what more layers make of it.
impl Plot for Findings {
    const SIZE: (u32, u32) = (1120, 520);

    fn draw<DB: DrawingBackend>(&self, root: DrawingArea<DB, Shift>) -> Drawn
    where
        DB::ErrorType: 'static,
    {
        root.fill(&WHITE)?;
        let root = root.titled(&format!("{}: the duality's regions and the layout", self.scene), (FONT, 22))?;
        let halves = root.split_evenly((1, 2));
        let [left, right] = &halves[..] else { return Ok(()) };
        chart(left, "photons stored", "share of the optical mass left uncovered", &by_photons(self), &[(-1f64).exp()])?;
        chart(right, "dualities that share the extinction (100k photons each)", "of the layout's", &by_layers(self), &[])?;
        root.present()?;
        Ok(())
    }
}

fn curve(findings: &Findings, name: String, number: usize, of: impl Fn(&Cell) -> Option<(f64, f64, f64)>) -> Curve {
    Curve { name, colour: COLOURS[number % 4], mark: number, points: findings.cells.iter().filter_map(of).collect() }
}

/// A curve for each placement and number in an estimate.
fn by_photons(findings: &Findings) -> Vec<Curve> {
    let kinds = |s: &Setting| (s.placement, s.estimate);
    let mut known: Vec<(Placement, Option<u64>)> = Vec::new();
    for cell in findings.cells.iter().filter(|c| !known.contains(&kinds(&c.setting))).collect::<Vec<_>>() {
        if !known.contains(&kinds(&cell.setting)) {
            known.push(kinds(&cell.setting));
        }
    }
    // The two placements first, as they are by default: they have a colour each.
    known.sort_by_key(|kind| kind.1);
    let one = |(number, &(placement, estimate)): (usize, &(Placement, Option<u64>))| {
        let words = if placement == Placement::Uniform { "uniform" } else { "importance" };
        let name = estimate.map_or(format!("{words}, root of the photons"), |n| format!("{words}, {n} in an estimate"));
        curve(findings, name, number, |c| {
            let figures = c.figures.filter(|_| c.setting.layers == 1 && kinds(&c.setting) == (placement, estimate))?;
            Some((c.setting.photons as f64, figures[UNCOVERED].value, 2.0 * figures[UNCOVERED].se))
        })
    };
    known.iter().enumerate().map(one).collect()
}

/// What stays uncovered, and the differences that are left, by dualities laid over each other.
fn by_layers(findings: &Findings) -> Vec<Curve> {
    let usual = |c: &Cell| c.setting.placement == Placement::Uniform && c.setting.estimate.is_none() && c.setting.photons == 100_000;
    let root = |e: crate::stats::Estimate| (e.value > 0.0).then(|| (e.value.sqrt(), e.se / e.value.sqrt()));
    let of = |name: &str, number: usize, figure: usize| {
        curve(findings, name.into(), number, |c| {
            let estimate = c.figures.filter(|_| usual(c))?[figure];
            let (value, bar) = if figure == UNCOVERED { (estimate.value, 2.0 * estimate.se) } else { root(estimate)? };
            Some((c.setting.layers as f64, value, bar))
        })
    };
    vec![
        of("uncovered", 0, UNCOVERED),
        of("transmittance of a line, RMS", 1, TRANSMITTANCE_SQUARE),
        of("optical depth of a line, relative RMS", 2, DEPTH_SQUARE),
        of("radiance of a pixel, relative RMS", 3, RADIANCE_SQUARE),
    ]
}

fn chart<DB: DrawingBackend>(area: &DrawingArea<DB, Shift>, x: &str, y: &str, curves: &[Curve], levels: &[f64]) -> Drawn
where
    DB::ErrorType: 'static,
{
    let all = || curves.iter().flat_map(|c| c.points.iter()).filter(|p| p.1 > 0.0);
    let span = |of: fn(&(f64, f64, f64)) -> f64| all().map(of).fold((f64::INFINITY, 0.0f64), |(a, b), v| (a.min(v), b.max(v)));
    let ((left, right), (low, high)) = (span(|p| p.0), span(|p| p.1));
    if left > right {
        return Ok(());
    }
    let (left, right, low) = (left / 1.4, right * 1.4, levels.iter().fold(low, |a, &b| a.min(b)));
    // By whole decades, which have numbers; room above for the names.
    let decade = |x: f64| 10f64.powf(x);
    let (bottom, top) = (decade((low / 1.1).log10().floor()), decade(high.log10().ceil()).max(high * (high / low).max(2.0).powf(0.7)));
    let mut chart = ChartBuilder::on(area)
        .margin(12)
        .x_label_area_size(48)
        .y_label_area_size(72)
        .build_cartesian_2d((left..right).log_scale(), (bottom..top).log_scale())?;
    chart
        .configure_mesh()
        .x_desc(x)
        .y_desc(y)
        .x_labels(5)
        .axis_desc_style((FONT, 16))
        .label_style((FONT, 14))
        .light_line_style(BLACK.mix(0.05))
        .bold_line_style(BLACK.mix(0.15))
        .x_label_formatter(&|x| number(*x))
        .y_label_formatter(&|y| format!("{} %", number(100.0 * y)))
        .draw()?;
    for &level in levels {
        chart.draw_series(DashedLineSeries::new([(left, level), (right, level)], 6, 4, BLACK.mix(0.6).stroke_width(1)))?;
        chart.draw_series([Text::new("1/e, balls at random", (left * 1.05, level * 0.985), (FONT, 14).into_font())])?;
    }
    for curve in curves {
        let colour = curve.colour;
        let lines = LineSeries::new(curve.points.iter().map(|p| (p.0, p.1)), colour.stroke_width(if curve.mark < 4 { 2 } else { 1 }));
        let mark = curve.mark;
        chart.draw_series(lines)?.label(curve.name.clone()).legend(move |(x, y)| {
            let line = EmptyElement::at((x, y)) + PathElement::new([(0, 0), (24, 0)], colour.stroke_width(2));
            line + Circle::new((12, 0), if mark.is_multiple_of(2) { 4 } else { 2 }, colour.filled())
        });
        for &(x, y, bar) in &curve.points {
            chart.draw_series([PathElement::new([(x, (y - bar).max(bottom)), (x, y + bar)], colour.stroke_width(1))])?;
            match curve.mark % 4 {
                0 => drop(chart.draw_series([Circle::new((x, y), 4, colour.filled())])?),
                1 => drop(chart.draw_series([TriangleMarker::new((x, y), 6, colour.filled())])?),
                2 => drop(chart.draw_series([Cross::new((x, y), 4, colour.stroke_width(2))])?),
                _ => drop(chart.draw_series([Circle::new((x, y), 5, colour.stroke_width(2))])?),
            }
        }
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .label_font((FONT, 14))
        .background_style(WHITE.mix(0.9))
        .border_style(BLACK.mix(0.3))
        .draw()?;
    Ok(())
}
