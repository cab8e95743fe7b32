//! A measurement as one page: what was used, how well it fits, every curve with its band, and what to photograph again.

use std::fmt::Write as _;
use std::path::Path;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use plotters::prelude::*;
use press::html::{self, escape};

use super::library;
use super::reduce::SampleOrigin;
use crate::MeasureError;
use crate::camera::series::seconds;
use crate::measurement::{MeasuredStack, Measurement};

/// Lines of red, green and blue that can be told apart on white. Any would do.
const COLOURS: [(u8, u8, u8); 3] = [(208, 48, 48), (32, 140, 64), (48, 88, 220)];
/// The largest picture that is put into a page, in bytes: browsers must hold the page as text.
const MOST_PICTURE: u64 = 16 << 20;

/// The page of a measurement's folder: a single HTML file that loads nothing else.
///
/// # Errors
/// A folder that holds no measurement.
pub fn html(folder: &Path) -> Result<String, MeasureError> {
    let measurement = library::read(folder)?;
    let title = format!("Measurement by {}, {}", measurement.by, measurement.when);
    let mut body = String::new();
    // Writing to a string does not fail.
    let _ = write_body(&title, &measurement, folder, &mut body);
    Ok(html::read(&title, "img{border:1px solid #999}", &body))
}

fn write_body(title: &str, m: &Measurement, folder: &Path, page: &mut String) -> std::fmt::Result {
    write!(page, "<h1>{}</h1><p>{}.</p>", escape(title), escape(&m.setup))?;
    if m.again.is_empty() {
        page.push_str("<p class=\"good\">Nothing needs to be photographed again.</p>");
    } else {
        page.push_str("<div class=\"doubtful\"><h2>What to photograph again</h2><ul>");
        m.again.iter().try_for_each(|line| write!(page, "<li>{}", escape(line)))?;
        page.push_str("</ul></div>");
    }
    page.push_str("<h2>Curves</h2><p>Reflectance in 1/sr over the half angle, with bands of two standard deviations. Dotted parts \
        are extrapolated, clipped or blurred. Below: pixels for each sample.</p>");
    for stack in &m.stacks {
        write!(page, "<h3>{}</h3>", escape(&stack.stack))?;
        match (curves(stack), coverage(stack)) {
            (Ok(curves), Ok(coverage)) => {
                let name = &stack.stack;
                page.push_str(&html::drawing(&format!("curves of {name}"), &curves));
                page.push_str(&html::drawing(&format!("pixels for each sample of {name}"), &coverage));
            }
            _ => page.push_str("<p>No plot: the curve has no values.</p>"),
        }
    }
    exposures(m, page)?;
    geometry(m, page)?;
    page.push_str("<h2>Masks and residuals</h2><p>Green pixels took part, red ones were left out, and yellow frames are the card's \
        steps. In the second picture, red is brighter and blue darker than the curve; full colour is 10 %.</p>");
    for i in 1..=m.series.len() {
        for name in [format!("mask-{i}.png"), format!("residuals-{i}.png")] {
            let path = folder.join(&name);
            let small = std::fs::metadata(&path).is_ok_and(|found| found.len() <= MOST_PICTURE);
            if let (true, Ok(bytes)) = (small, std::fs::read(&path)) {
                write!(
                    page,
                    "<p><img alt=\"{name}\" src=\"data:image/png;base64,{}\">",
                    STANDARD.encode(bytes)
                )?;
            }
        }
    }
    Ok(())
}

fn exposures(m: &Measurement, page: &mut String) -> std::fmt::Result {
    for (i, series) in m.series.iter().enumerate() {
        let wide = html::wide(&format!("exposures, lamp {}", i + 1));
        write!(
            page,
            "<h2>Exposures, lamp {}</h2>{wide}<table><tr><th>photograph<th class=n>time<th class=n>f-number<th class=n>ISO\
             <th class=n>true exposure<th class=n>shift, pixels<th class=n>clipped",
            i + 1
        )?;
        for shot in &series.shots {
            let number = |value: Option<f64>| value.map_or_else(String::new, |v| format!("{v}"));
            write!(
                page,
                "<tr><td>{}<td class=n>{}<td class=n>{}<td class=n>{}<td class=n>{:.1} %<td class=n>{:.1}, {:.1}<td class=n>{:.1} %",
                escape(&shot.name),
                seconds(shot.seconds),
                number(shot.aperture),
                number(shot.iso),
                100.0 * shot.ratio,
                shot.shift[0],
                shot.shift[1],
                100.0 * shot.clipped
            )?;
        }
        let [bright, dark] =
            series.card.deviation.map(|d| d.map(|v| format!("{:+.1} %", 100.0 * v)).join(", "));
        let balance = series.card.scale.map(|k| format!("{:.3}", k / series.card.scale[1])).join(", ");
        write!(
            page,
            "</table></div><p>Grey card: the brightest step is off by {bright}, the darkest by {dark} (red, green, blue); white balance {balance}.</p>"
        )?;
    }
    Ok(())
}

fn geometry(m: &Measurement, page: &mut String) -> std::fmt::Result {
    let g = &m.geometry;
    let used = if g.solved {
        "The curves use the corrected measures."
    } else {
        "The setup is exact, so the curves use its measures."
    };
    let wide = html::wide("geometry");
    write!(
        page,
        "<h2>Geometry</h2><p>{used} Pixels of the same half angle differ by {:.1} % (by {:.1} % with the measures of the setup \
         file).</p>{wide}<table><tr><th>measure<th class=n>correction<th class=n>tolerance<th class=n>uncertain by<th>unit",
        100.0 * g.misfit,
        100.0 * g.misfit_before
    )?;
    for row in &g.measures {
        write!(
            page,
            "<tr><td class=words>{}<td class=n>{:+.2}<td class=n>{:.2}<td class=n>{:.2}<td>{}",
            escape(&row.name),
            row.by,
            row.tolerance,
            row.sigma,
            escape(&row.unit)
        )?;
    }
    page.push_str("</table></div>");
    if let Some(radius) = g.radius_mm {
        write!(page, "<p>Radius of the can: {radius:.2} mm.</p>")?;
    }
    for (i, [x, y, z]) in g.lights_mm.iter().enumerate() {
        write!(page, "<p>Lamp {}: {x:.1}, {y:.1}, {z:.1} mm.</p>", i + 1)?;
    }
    Ok(())
}

type Drawn = Result<String, Box<dyn std::error::Error>>;

/// The curves of a stack over the square root of the angle, where its samples are evenly spaced.
fn curves(stack: &MeasuredStack) -> Drawn {
    let values = || stack.rows.iter().flat_map(|row| row.rgb).filter(|v| *v > 0.0 && v.is_finite());
    let (least, most) = (values().fold(f64::MAX, f64::min), values().fold(0.0, f64::max));
    if most <= 0.0 || stack.rows.is_empty() {
        return Err("no values".into());
    }
    let (low, high) = ((0.6 * least).max(1e-6 * most), 1.7 * most);
    let mut text = String::new();
    {
        let area = SVGBackend::with_string(&mut text, (900, 420)).into_drawing_area();
        let mut chart = ChartBuilder::on(&area)
            .margin(8)
            .x_label_area_size(40)
            .y_label_area_size(70)
            .build_cartesian_2d(0.0..90f64.sqrt(), (low..high).log_scale())?;
        chart
            .configure_mesh()
            .x_desc("half angle, degrees")
            .y_desc("reflectance, 1/sr")
            .x_labels(12)
            .x_label_formatter(&|root| format!("{:.0}", root * root))
            .y_label_formatter(&|v| format!("{v:.3}"))
            .light_line_style(BLACK.mix(0.05))
            .draw()?;
        for (c, (r, g, b)) in COLOURS.into_iter().enumerate() {
            let colour = RGBColor(r, g, b);
            let point = |row: &super::reduce::CurveRow, by: f64| {
                (row.theta_deg.sqrt(), (row.rgb[c] + by * row.sigma[c]).clamp(low, high))
            };
            let band = stack.rows.iter().map(|row| point(row, 2.0));
            let band: Vec<(f64, f64)> =
                band.chain(stack.rows.iter().rev().map(|row| point(row, -2.0))).collect();
            chart.draw_series(std::iter::once(Polygon::new(band, colour.mix(0.18).filled())))?;
            for part in stack.rows.windows(2) {
                let sure = part.iter().all(|row| row.kind == SampleOrigin::Measured);
                let line: Vec<(f64, f64)> = part.iter().map(|row| point(row, 0.0)).collect();
                if sure {
                    chart.draw_series(LineSeries::new(line, colour.stroke_width(2)))?;
                } else {
                    chart.draw_series(line.into_iter().map(|at| Circle::new(at, 2, colour.filled())))?;
                }
            }
        }
        area.present()?;
    }
    Ok(text)
}

/// How many pixels each sample is from.
fn coverage(stack: &MeasuredStack) -> Drawn {
    let most = stack.rows.iter().map(|row| row.pixels).max().unwrap_or(0).max(10) as f64;
    let mut text = String::new();
    {
        let area = SVGBackend::with_string(&mut text, (900, 130)).into_drawing_area();
        let mut chart = ChartBuilder::on(&area)
            .margin(8)
            .x_label_area_size(20)
            .y_label_area_size(70)
            .build_cartesian_2d(0.0..90f64.sqrt(), (0.8..2.0 * most).log_scale())?;
        chart
            .configure_mesh()
            .disable_mesh()
            .y_desc("pixels")
            .y_labels(4)
            .x_labels(12)
            .x_label_formatter(&|root| format!("{:.0}", root * root))
            .y_label_formatter(&|v| format!("{v:.0}"))
            .draw()?;
        let half = 0.45 * 90f64.sqrt() / stack.rows.len() as f64;
        chart.draw_series(stack.rows.iter().filter(|row| row.pixels > 0).map(|row| {
            let (x, top) = (row.theta_deg.sqrt(), row.pixels as f64);
            let colour = if row.kind == SampleOrigin::Measured {
                RGBColor(90, 90, 90)
            } else {
                RGBColor(230, 150, 40)
            };
            Rectangle::new([(x - half, 0.8), (x + half, top)], colour.filled())
        }))?;
        area.present()?;
    }
    Ok(text)
}
