//! Error against time.

use super::figures::{Cell, Figures, name};
use super::line::{GOALS, Line};
use crate::integrate::Integrator;
use crate::study::chart::{COLOURS, Drawn, FONT, Plot, number};
use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

fn colour(integrator: Integrator) -> RGBColor {
    match integrator {
        Integrator::Path => COLOURS[0],
        Integrator::Grid => COLOURS[1],
        Integrator::Photon => COLOURS[2],
    }
}

/// Error against time, both by decades: cells with two standard errors, the lines through them, bias floors, goals, others. Pale marks
/// are cells of which one setting is not as usual.
impl Plot for Figures {
    const SIZE: (u32, u32) = (960, 640);

    fn draw<DB: DrawingBackend>(&self, root: DrawingArea<DB, Shift>) -> Drawn
    where
        DB::ErrorType: 'static,
    {
        draw(self, &root)
    }
}

fn draw<DB: DrawingBackend>(figures: &Figures, root: &DrawingArea<DB, Shift>) -> Drawn
where
    DB::ErrorType: 'static,
{
    let shown: Vec<&Cell> = figures.cells.iter().filter(|c| c.error() > 0.0).collect();
    let times = shown.iter().map(|c| c.seconds).chain(figures.others.iter().map(|o| o.seconds));
    let errors = shown.iter().map(|c| c.error()).chain(figures.others.iter().map(|o| o.error)).filter(|e| *e > 0.0);
    let span = |values: &mut dyn Iterator<Item = f64>| values.fold((f64::INFINITY, 0.0f64), |(low, high), v| (low.min(v), high.max(v)));
    let ((early, late), (low, high)) = (span(&mut times.into_iter()), span(&mut errors.into_iter()));
    let (left, right, bottom, top) = (early / 2.0, late * 6.0, (low / 3.0).min(0.004), high * 2.0);
    root.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(root)
        .caption(format!("{}, {} x {} pixels", figures.scene, figures.size[0], figures.size[1]), (FONT, 22))
        .margin(16)
        .x_label_area_size(52)
        .y_label_area_size(72)
        .build_cartesian_2d((left..right).log_scale(), (bottom..top).log_scale())?;
    chart
        .configure_mesh()
        .x_desc("time of one picture, s")
        .y_desc("error of a pixel, relative RMSE")
        .axis_desc_style((FONT, 18))
        .label_style((FONT, 15))
        .light_line_style(BLACK.mix(0.05))
        .bold_line_style(BLACK.mix(0.15))
        .x_label_formatter(&|x| number(*x))
        .y_label_formatter(&|y| format!("{} %", number(100.0 * y)))
        .draw()?;
    for goal in GOALS.into_iter().filter(|goal| (bottom..top).contains(goal)) {
        chart.draw_series(DashedLineSeries::new([(left, goal), (right, goal)], 3, 5, BLACK.mix(0.4).stroke_width(1)))?;
        let said = format!("{} %", number(100.0 * goal));
        chart.draw_series([Text::new(
            said,
            (right * 0.94, goal * 1.02),
            small(&BLACK.mix(0.6)).pos(Pos::new(HPos::Right, VPos::Bottom)),
        )])?;
    }
    if let Some((when, error)) = figures.path_overtakes.filter(|(when, _)| (left..right).contains(when)) {
        chart.draw_series(DashedLineSeries::new([(when, bottom), (when, error)], 3, 5, colour(Integrator::Path).stroke_width(1)))?;
        let said = "from here on path is the most exact ";
        chart.draw_series([Text::new(
            said,
            (when, bottom * 1.1),
            small(&colour(Integrator::Path)).pos(Pos::new(HPos::Right, VPos::Bottom)),
        )])?;
    }
    let rings = figures.pareto.iter().map(|&i| &figures.cells[i]).filter(|c| c.error() > 0.0);
    chart.draw_series(rings.map(|c| Circle::new((c.seconds, c.error()), 11, BLACK.mix(0.45).stroke_width(1))))?;
    for line in &figures.lines {
        let colour = colour(line.integrator);
        // Room behind it: the letters of who looks at the SVG may be wider than those that are measured.
        let label = format!("{}: noise\u{b2} ~ {}^{}{}", name(line.integrator), unit(line.integrator), power(line), "\u{a0}".repeat(8));
        let at = |i: i32| left * (right / left).powf(f64::from(i) / 200.0);
        let points = (0..=200).filter_map(|i| Some((at(i), line.error(at(i)).filter(|e| (bottom..top).contains(e))?)));
        chart.draw_series(LineSeries::new(points, colour.stroke_width(2)))?.label(label).legend({
            let integrator = line.integrator;
            move |(x, y)| {
                let stroke = PathElement::new([(0, 0), (24, 0)], colour.stroke_width(2));
                EmptyElement::at((x, y)) + stroke + mark(integrator, (12, 0), colour.to_rgba())
            }
        });
        if line.bias > bottom {
            let floor = DashedLineSeries::new([(left, line.bias), (right, line.bias)], 8, 4, colour.stroke_width(1));
            chart.draw_series(floor)?;
            chart.draw_series([Text::new(format!("{}'s bias", name(line.integrator)), (left * 1.1, line.bias * 1.12), small(&colour))])?;
        }
    }
    for cell in &shown {
        let shade = if cell.setting.change.is_some() { 0.35 } else { 1.0 };
        let (colour, at) = (colour(cell.setting.integrator).mix(shade), (cell.seconds, cell.error()));
        let bar = |sign: f64| (cell.square + sign * 2.0 * cell.square_error).max(bottom * bottom).sqrt();
        chart.draw_series([PathElement::new([(at.0, bar(-1.0)), (at.0, bar(1.0))], colour.stroke_width(2))])?;
        chart.draw_series([mark(cell.setting.integrator, at, colour)])?;
    }
    for other in figures.others.iter().filter(|o| o.error > 0.0) {
        chart.draw_series([Cross::new((other.seconds, other.error), 6, COLOURS[3].stroke_width(3))])?;
        chart.draw_series([Text::new(
            other.name.clone(),
            (other.seconds * 1.1, other.error * 1.05),
            (FONT, 15).into_font().color(&COLOURS[3]),
        )])?;
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .label_font((FONT, 16))
        .background_style(WHITE.mix(0.9))
        .border_style(BLACK.mix(0.3))
        .draw()?;
    root.present()?;
    Ok(())
}

/// Small letters.
fn small(colour: &impl Color) -> TextStyle<'static> {
    (FONT, 14).into_font().color(colour)
}

/// An integrator's mark, told apart by its form as well.
fn mark<DB: DrawingBackend, C: Clone + 'static>(integrator: Integrator, at: C, colour: RGBAColor) -> DynElement<'static, DB, C> {
    match integrator {
        Integrator::Path => Circle::new(at, 5, colour.filled()).into_dyn(),
        Integrator::Grid => TriangleMarker::new(at, 7, colour.filled()).into_dyn(),
        Integrator::Photon => Cross::new(at, 5, colour.stroke_width(3)).into_dyn(),
    }
}

/// What a setting's work is counted in.
pub(super) fn unit(integrator: Integrator) -> &'static str {
    if integrator == Integrator::Path { "samples" } else { "photons" }
}

/// The power by which noise falls, with its error where that is known.
fn power(line: &Line) -> String {
    let (fall, digits) = (line.noise_falls, if line.noise_falls_error.is_some_and(|e| e < 0.01) { 3 } else { 2 });
    line.noise_falls_error.map_or(format!("{fall:.2}"), |e| format!("{fall:.digits$} \u{b1} {e:.digits$}"))
}
