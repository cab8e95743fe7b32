//! How far passes are apart, read with the eye.
//!
//! Method: a vernier. Below a comb of lines of the first ink, 24 dots from line to line, stands one of the other ink, 25
//! dots from line to line. Where two lines meet is how far the passes are apart, one dot (0.04 mm) for each line from the
//! middle. Each ink is compared across and along the feed, at the top, in the middle and at the bottom of the page, since
//! the sheet is pulled back between passes, and at both sides where there is room, since it may come back askew. Limits: offsets of up to 10 dots (0.4 mm).

use inks::Stack;
use protocol::ink::Ink;
use protocol::paper::Paper;

use super::error::ChartError;
use super::sketch::{LETTER, LINE, Sketch, mm};
use crate::layout::Mm;
use crate::layout::camera::{QUIET, SIDE};
use sheet::DotMap;

/// From line to line in the first ink, in dots.
const PITCH: usize = 24;
/// Lines on each side of the middle: the dots that can be read.
const REACH: usize = 10;
/// Width of a line in dots.
const WIDTH: usize = 8;
/// Length of a line in dots.
const LENGTH: usize = 60;
/// Scale of letters.
const LABEL: usize = 3;

/// Half of the longer comb, from the middle of the first line to the middle of the scale.
const HALF: usize = REACH * (PITCH + 1);
/// Side of a vernier with its figures.
const CELL: usize = 2 * HALF + 160;

/// A vernier of `other` against `first` with the middle of its scale at (x, y): lines across the page's width when `down`.
fn vernier(sketch: &mut Sketch, (x, y): (usize, usize), down: bool, first: &Stack, other: &Stack) {
    let mut line = |along: usize, aside: usize, length: usize, stack: &Stack| {
        let (a, b) = (along - WIDTH / 2, aside);
        let place = if down { (b, a, length, WIDTH) } else { (a, b, WIDTH, length) };
        sketch.fill(place, stack);
    };
    let (middle, side) = if down { (y, x) } else { (x, y) };
    for i in 0..=2 * REACH {
        // Every fifth line is longer, the middle one longest.
        let more = if i == REACH {
            30
        } else if i % 5 == 0 {
            15
        } else {
            0
        };
        line(middle + i * PITCH - REACH * PITCH, side - LENGTH - more, LENGTH + more, first);
        line(middle + i * (PITCH + 1) - HALF, side, LENGTH, other);
    }
}

/// The first ink against each of the others, on the printable area of the paper but for the camera marks above and below.
pub fn registration(inks: &[Ink], paper: Paper) -> Result<DotMap, ChartError> {
    let [first, others @ ..] = inks else { return Err(ChartError::OneInk) };
    if others.is_empty() {
        return Err(ChartError::OneInk);
    }
    let marks = 2 * (SIDE + QUIET);
    let (width, length) = (usize::from(paper.width()), usize::from(paper.length()).saturating_sub(marks));
    let column = CELL + mm(4.0);
    let block = LINE * LABEL + 2 * CELL + mm(4.0);
    let most = (width / column).min(6);
    if others.len() > most || length < 3 * block {
        if most < 1 || length < 3 * block {
            // Whole millimetres, rounded up.
            let needed = |dots: usize| Mm::of_dots(dots as i64).0.ceil() as u32;
            let (width, length) = (needed(column), needed(3 * block + marks));
            return Err(ChartError::Paper { chart: "registration", width, length, paper: paper.name() });
        }
        return Err(ChartError::TooMany { what: "inks beside the first", found: others.len(), most });
    }
    let first = Stack::new([*first]);
    let mut sketch = Sketch::new(width, length);
    let group = others.len() * column - mm(4.0);
    let sides = if 2 * group + mm(4.0) <= width { &[0, width - group][..] } else { &[0] };
    let tops = [0, (length - block) / 2, length - block];
    for (top, side) in tops.into_iter().flat_map(|top| sides.iter().map(move |side| (top, side))) {
        for (i, &other) in others.iter().enumerate() {
            let left = side + i * column;
            let other = Stack::new([other]);
            let label = format!("{first} / {other}");
            sketch.text(left, top, LABEL, &first, &label);
            let (x, y) = (left + CELL / 2, top + LINE * LABEL + CELL / 4);
            vernier(&mut sketch, (x, y), false, &first, &other);
            figures(&mut sketch, (x, y), &first);
            vernier(&mut sketch, (x, y + CELL / 4 + CELL / 2), true, &first, &other);
        }
    }
    Ok(sketch.finish()?)
}

/// What the ends of the scale across mean.
fn figures(sketch: &mut Sketch, (x, y): (usize, usize), stack: &Stack) {
    let top = y.saturating_sub(LENGTH + 30 + LINE * 2);
    sketch.text(x.saturating_sub(REACH * PITCH), top, 2, stack, "-10");
    sketch.text(x - LETTER, top, 2, stack, "0");
    sketch.text_to(x + REACH * PITCH + LETTER * 2, top, 2, stack, "10");
}
