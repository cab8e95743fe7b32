//! Plots of half-angle curves: braille dots for a terminal, SVG for a document.
//!
//! Both show the angle from 0 to 90 degrees on a linear axis and reflectance on a logarithmic one, because foil and paper
//! differ by a factor of a hundred. Values below a millionth of the largest are drawn at that floor.

use inks::{Curve, Uncertainty};
use maths::Maths;
use plotters::prelude::*;
use textplots::{Chart, ColorPlot, LabelBuilder, LabelFormat, Plot, Shape, TickDisplay, TickDisplayBuilder};

/// Why a curve could not be drawn.
#[derive(Debug, thiserror::Error)]
#[error("cannot draw the plot of {title}: {problem}")]
pub struct PlotError {
    /// The plot's title.
    pub title: String,
    /// The error of the drawing library.
    pub problem: String,
}

type Rgb = (u8, u8, u8);

/// Characters across a terminal plot, so that it fits into 80 with the scale beside it, and rows per decade.
/// The scale has a label every four rows.
const TERMINAL: (u32, u32) = (72, 4);
const INKS: [Rgb; 3] = [(224, 64, 64), (48, 168, 80), (72, 112, 240)];

/// The decades that hold some curves: at least three and at most six.
fn decades<'a>(curves: impl Iterator<Item = &'a Curve> + Clone) -> (i32, i32) {
    let values =
        || curves.clone().flat_map(|curve| curve.rgb().iter().flatten().copied()).filter(|v| *v > 0.0);
    let most = values().fold(1e-12, f64::max).logarithm10().ceil() as i32;
    let least = values().fold(f64::MAX, f64::min).logarithm10().floor() as i32;
    (least.clamp(most - 6, most - 3), most)
}

/// Points in degrees and decades, dense enough for any plot.
fn points(curve: &Curve, channel: usize, (least, most): (i32, i32)) -> Vec<(f64, f64)> {
    (0..=720)
        .map(|n| f64::from(n) / 8.0)
        .map(|degrees| {
            let value = curve.at(degrees.to_radians())[channel];
            (degrees, value.max(1e-300).logarithm10().clamp(f64::from(least), f64::from(most)))
        })
        .collect()
}

fn is_grey(curve: &Curve) -> bool {
    curve.rgb().iter().all(|v| (v[0] - v[1]).abs().max((v[2] - v[1]).abs()) <= 0.01 * v[1])
}

/// The curve in braille dots with its scales: one line per channel, or a single line if the channels agree.
pub fn terminal(curve: &Curve, colour: bool) -> String {
    let range = decades(std::iter::once(curve));
    let channels = if is_grey(curve) { 1..2 } else { 0..3 };
    let colour = colour && channels.len() > 1;
    let shapes: Vec<Vec<(f32, f32)>> = channels
        .clone()
        .map(|c| points(curve, c, range).into_iter().map(|(x, y)| (x as f32, y as f32)).collect())
        .collect();
    let lines: Vec<Shape<'_>> = shapes.iter().map(|points| Shape::Lines(points)).collect();
    let inked: Vec<_> =
        lines.iter().zip(channels).map(|(line, channel)| (line, colour.then_some(INKS[channel]))).collect();
    framed(range, &inked)
}

/// Shapes over these decades, with their scales.
fn framed(range: (i32, i32), shapes: &[(&Shape<'_>, Option<Rgb>)]) -> String {
    // A character is two dots wide and four dots high.
    let (width, height) = (TERMINAL.0 * 2, TERMINAL.1 * 4 * range.0.abs_diff(range.1));
    let mut chart = Chart::new_with_y_range(width, height, 0.0, 90.0, range.0 as f32, range.1 as f32);
    let mut chart: &mut Chart<'_> = chart
        .x_label_format(LabelFormat::Custom(Box::new(|degrees| format!("{degrees:.0} deg"))))
        .y_label_format(LabelFormat::Custom(Box::new(|decade| number(10f64.power(f64::from(decade))))))
        .y_tick_display(TickDisplay::Sparse);
    for (shape, colour) in shapes {
        chart = match *colour {
            Some((r, g, b)) => chart.linecolorplot(shape, (r, g, b).into()),
            None => chart.lineplot(shape),
        };
    }
    chart.axis();
    chart.figures();
    chart.to_string()
}

/// The mean of the channels before a change (single dots) and after it (a line) in braille dots, with their scales.
pub fn terminal_change(before: &Curve, after: &Curve) -> String {
    let grey = |curve: &Curve| {
        let mut values = curve.rgb().iter().map(|v| [v.iter().sum::<f64>() / 3.0; 3]);
        Curve::sampled(curve.theta(), |_| values.next().unwrap_or_default())
    };
    let curves = [grey(before), grey(after)];
    let range = decades(curves.iter());
    let [old, new] = [0, 1].map(|i| -> Vec<(f32, f32)> {
        points(&curves[i], 1, range).into_iter().map(|(x, y)| (x as f32, y as f32)).collect()
    });
    // One in eight, so that they stay apart on the terminal.
    let dots: Vec<(f32, f32)> = old.into_iter().step_by(8).collect();
    framed(range, &[(&Shape::Points(&dots), None), (&Shape::Lines(&new), None)])
}

/// A reflectance with at most two significant digits.
fn number(value: f64) -> String {
    let decimals = 1 - value.max(1e-300).logarithm10().floor() as i32;
    if decimals > 5 {
        return format!("{value:.0e}");
    }
    let text = format!("{value:.0$}", decimals.max(0) as usize);
    match text.split_once('.') {
        Some(_) => text.trim_end_matches('0').trim_end_matches('.').into(),
        None => text,
    }
}

/// A curve in a plot of several, with its standard deviation if it has one.
#[derive(Clone, Copy, Debug)]
pub struct Line<'a> {
    /// The curve.
    pub curve: &'a Curve,
    /// Drawn as a band of two standard deviations.
    pub uncertainty: Option<&'a Uncertainty>,
}

/// The curve as an SVG image.
pub fn svg(title: &str, curve: &Curve) -> Result<String, PlotError> {
    compared(title, &[Line { curve, uncertainty: None }])
}

/// Curves in one SVG image: the first as lines, the others dashed.
pub fn compared(title: &str, lines: &[Line<'_>]) -> Result<String, PlotError> {
    let mut text = String::new();
    draw(&mut text, title, lines)
        .map_err(|error| PlotError { title: title.into(), problem: error.to_string() })?;
    Ok(text)
}

fn draw(text: &mut String, title: &str, lines: &[Line<'_>]) -> Result<(), Box<dyn std::error::Error>> {
    let (least, most) = decades(lines.iter().map(|line| line.curve));
    let (low, high) = (10f64.whole_power(least), 10f64.whole_power(most));
    let area = SVGBackend::with_string(text, (720, 480)).into_drawing_area();
    area.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&area)
        .caption(title, ("sans-serif", 18))
        .margin(12)
        .x_label_area_size(44)
        .y_label_area_size(72)
        .build_cartesian_2d(0.0..90.0, (low..high).log_scale())?;
    chart
        .configure_mesh()
        .x_desc("half angle, degrees")
        .y_desc("reflectance, 1/sr")
        .x_label_formatter(&|degrees| format!("{degrees:.0}"))
        .y_label_formatter(&|value| number(*value))
        .x_labels(10)
        .light_line_style(BLACK.mix(0.06))
        .draw()?;
    for (place, line) in lines.iter().enumerate() {
        for (channel, (r, g, b)) in INKS.into_iter().enumerate() {
            let colour = RGBColor(r, g, b);
            if let Some(uncertainty) = line.uncertainty {
                let edge = |by: f64| {
                    let at = move |&theta: &f64| {
                        let value = line.curve.at(theta)[channel] + by * uncertainty.at(theta)[channel];
                        (theta.to_degrees(), value.clamp(low, high))
                    };
                    uncertainty.theta().iter().map(at).collect::<Vec<(f64, f64)>>()
                };
                let mut band = edge(2.0);
                band.extend(edge(-2.0).into_iter().rev());
                chart.draw_series(std::iter::once(Polygon::new(band, colour.mix(0.18).filled())))?;
            }
            let points = points(line.curve, channel, (least, most)).into_iter();
            let points = points.map(|(x, y)| (x, 10f64.power(y)));
            if place == 0 {
                chart.draw_series(LineSeries::new(points, colour.stroke_width(2)))?;
            } else {
                chart.draw_series(DashedLineSeries::new(points, 6, 4, colour.stroke_width(2)))?;
            }
        }
    }
    area.present()?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scale_holds_the_curve_and_no_more_than_six_decades() {
        let level = |v: f64| Curve::new(vec![0.0], vec![[v; 3]]).unwrap();
        let decades = |curve: &Curve| decades(std::iter::once(curve));
        assert_eq!(decades(&level(0.25)), (-3, 0));
        assert_eq!(decades(&level(0.0)), (-15, -12));
        let steep = Curve::new(vec![0.0, 1.0], vec![[30.0; 3], [1e-9; 3]]).unwrap();
        assert_eq!(decades(&steep), (-4, 2));
    }

    #[test]
    fn numbers_are_short() {
        let numbers = [100.0, 12.3, 1.0, 0.1, 0.034, 0.001, 1e-9].map(number);
        assert_eq!(numbers, ["100", "12", "1", "0.1", "0.034", "0.001", "1e-9"]);
    }

    #[test]
    fn any_curve_is_drawn_within_its_frame() {
        for values in [[0.0; 3], [1e300; 3], [1e-300, 1.0, 30.0], [5.0, 0.0, 1e-5]] {
            let curve = Curve::new(vec![0.0, 0.4], vec![values, [0.1; 3]]).unwrap();
            let text = terminal(&curve, false);
            let range = decades(std::iter::once(&curve));
            let rows = TERMINAL.1 * range.0.abs_diff(range.1);
            assert!(text.lines().count() > rows as usize, "{text}");
            assert!(text.contains("90 deg"));
            let level = Curve::new(vec![0.0], vec![[0.1; 3]]).unwrap();
            assert!(terminal_change(&curve, &level).contains("90 deg"));
            let picture = svg("a curve", &curve).unwrap();
            assert!(picture.starts_with("<svg") && picture.contains("a curve") && !picture.contains("NaN"));
            let other = Curve::new(vec![0.0, 1.5], vec![[2.0; 3], [0.01; 3]]).unwrap();
            let line = |curve| Line { curve, uncertainty: None };
            let both = compared("two curves", &[line(&curve), line(&other)]).unwrap();
            // Dashes are drawn as many short lines.
            assert!(both.matches("<polyline").count() > picture.matches("<polyline").count() + 20, "{both}");
        }
    }
}
