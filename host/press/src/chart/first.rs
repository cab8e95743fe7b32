//! The first sheet of a printer, and a strip that shows the state of each cartridge and of the head.
//!
//! Problem: a new set-up should be tried with as little ribbon as possible, and a fault of the head or a tired ribbon is hard to tell
//! from a fault of the art.
//! Method: the head travels across the sheet and prints bands of 10 mm; ribbon runs as far as there are dots in a band. So all is narrow.
//! [`first()`] prints four bars, 5 mm wide, one below the other, which a ruler checks. [`heads`] prints a strip for each ink, higher than a
//! band: an area, each row of dots by itself, and a fine chequer. Cost: some 5 mm of ribbon, and some 30 mm for each strip. Limits: what is
//! wrong is for the eye to see; a foil does not stick to bare paper.
//! Source: owners' advice that a printer that has rested prints faintly for some sheets; the first job of another project: black, one pass, four
//! marks, less than 2 kB.

use inks::Stack;
use protocol::ink::Ink;
use protocol::paper::{LEFT, Paper};

use super::error::ChartError;
use super::sketch::{Sketch, mm};
use crate::layout::Mm;
use sheet::DotMap;

/// Width of a bar, in millimetres.
pub const WIDE: f64 = 5.0;
/// Where the first bar or strip begins, in millimetres from the left and the top edge of the sheet.
pub const PLACE: (f64, f64) = (20.0, 30.0);
/// From bar to bar, in millimetres.
pub const APART: f64 = 3.0;
/// How many bars there are.
pub const BARS: usize = 4;

/// Height of a bar, in millimetres.
const HIGH: f64 = 1.0;

/// Height of a strip, in millimetres: the head prints 10 mm at once.
const STRIP: f64 = 12.0;
/// From strip to strip, in millimetres.
const STRIPS: f64 = 15.0;
/// Width of each of the three parts of a strip, in millimetres.
const PART: f64 = 3.0;
/// Room for the name of an ink, in millimetres.
const LABEL: f64 = 7.0;
/// Each row of dots is printed in one of so many columns, so that no other is near it.
const COLUMNS: usize = 8;

/// A blank chart and the corner of its first mark, if the paper has room for so much from there.
fn blank(
    chart: &'static str,
    paper: Paper,
    (width, length): (f64, f64),
) -> Result<(Sketch, usize, usize), ChartError> {
    let own = (usize::from(paper.width()), usize::from(paper.length()));
    let x = mm(PLACE.0) - usize::from(LEFT);
    let y = mm(PLACE.1) - usize::from(paper.top()).min(mm(PLACE.1));
    let room = (x + mm(width), y + mm(length));
    if own.0 < room.0 || own.1 < room.1 {
        let needed = |dots: usize| Mm::of_dots(dots as i64).0.ceil() as u32;
        let (width, length) = (needed(room.0), needed(room.1));
        return Err(ChartError::Paper { chart, width, length, paper: paper.name() });
    }
    Ok((Sketch::new(own.0, own.1), x, y))
}

/// The first sheet, as large as the printable area of the paper.
///
/// # Errors
/// A paper that is too small.
pub fn first(ink: Ink, paper: Paper) -> Result<DotMap, ChartError> {
    let (mut sketch, x, y) = blank("first", paper, (WIDE, APART * (BARS - 1) as f64 + HIGH))?;
    let ink = Stack::new([ink]);
    for bar in 0..BARS {
        sketch.fill((x, y + mm(APART * bar as f64), mm(WIDE), mm(HIGH)), &ink);
    }
    Ok(sketch.finish()?)
}

/// A strip for each ink, as large as the printable area of the paper.
///
/// # Errors
/// A paper that is too small for so many.
pub fn heads(inks: &[Ink], paper: Paper) -> Result<DotMap, ChartError> {
    let (mut sketch, x, y) = blank("heads", paper, (3.0 * PART + LABEL, STRIPS * inks.len() as f64))?;
    let (part, high) = (mm(PART), mm(STRIP));
    for (at, ink) in inks.iter().enumerate() {
        let (stack, top) = (Stack::new([*ink]), y + mm(STRIPS * at as f64));
        sketch.text(x + 3 * part + mm(1.0), top, 1, &stack, ink.name());
        sketch.fill((x, top, part, high), &stack);
        let column = part / COLUMNS;
        for row in 0..high {
            sketch.fill((x + part + row % COLUMNS * column, top + row, column, 1), &stack);
            for x in (x + 2 * part + 4 * (row / 4 % 2)..x + 3 * part).step_by(8) {
                sketch.fill((x, top + row, 4, 1), &stack);
            }
        }
    }
    Ok(sketch.finish()?)
}
