//! Lines for a cutting plotter, as a drawing in millimetres.
//!
//! Problem: what is printed is cut out on another machine, which has to find the print on the sheet.
//! Method: each path of the art is written once for each copy, where that copy lies on the sheet of paper, beside the middles of the
//! registration marks that are printed. Cost: the length of the paths. Limits: one colour, hairlines; a plotter that reads other marks
//! needs them in the art. Sideways the sheet itself lies 1 mm more or less to one side in the printer, so a plotter that does not look
//! for the marks cuts that much beside.

use std::fmt::Write as _;
use std::path::Path;

use anyhow::{Result, bail};
use art::{Artwork, CutPath};
use press::layout::{self, Layout, paper};

/// Millimetres in a dot.
const MM: f64 = 25.4 / 600.0;

/// How far the lines of a mark's cross reach from its middle, in millimetres.
const CROSS: f64 = 2.5;

/// The drawing of the art's lines on the sheet.
///
/// # Errors
/// Art without such lines, or with areas of dots instead.
pub fn drawing(art: &Artwork, layout: &Layout, to: &Path) -> Result<String> {
    let Some(paths) = art.cut_paths() else {
        bail!("what is for the cutter has too many dots to be lines; draw it as strokes or plain areas");
    };
    if paths.is_empty() {
        bail!(
            "{} is not written: the art has nothing for a cutter; draw its lines in a spot colour or layer named CutContour",
            to.display()
        );
    }
    let places = layout::places(art.width, art.length, layout)?;
    let (width, height) = paper::sheet_mm(layout.paper);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}mm\" height=\"{height}mm\" viewBox=\"0 0 {width} {height}\" \
         fill=\"none\" stroke-width=\"0.1\">\n"
    );
    svg.push_str("<g id=\"registration\" stroke=\"#000\">\n");
    for (x, y) in places.marks {
        let (left, right, top, bottom) = (x - CROSS, x + CROSS, y - CROSS, y + CROSS);
        writeln!(svg, "<path d=\"M{left:.3} {y:.3}H{right:.3}M{x:.3} {top:.3}V{bottom:.3}\"/>")?;
    }
    svg.push_str("</g>\n<g id=\"CutContour\" stroke=\"#f0f\">\n");
    for corner in places.copies {
        for path in &paths {
            writeln!(svg, "<path d=\"{}\"/>", outline(path, corner, art, layout.mirror))?;
        }
    }
    svg.push_str("</g>\n</svg>\n");
    Ok(svg)
}

/// A path of the art on the sheet.
fn outline(path: &CutPath, (left, top): (f64, f64), art: &Artwork, mirror: bool) -> String {
    let across = art.across.max(1) as f64;
    let mut text = String::new();
    for (at, &(x, y)) in path.points.iter().enumerate() {
        let x = if mirror { art.width as f64 - x } else { x };
        let step = if at == 0 { 'M' } else { 'L' };
        // Writing to a string does not fail.
        let _ = write!(text, "{step}{:.3} {:.3}", left + x / across * MM, top + y * MM);
    }
    if path.closed {
        text.push('Z');
    }
    text
}
