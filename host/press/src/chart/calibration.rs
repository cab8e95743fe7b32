//! Where one printer starts and how far it feeds, to be measured with a ruler.
//!
//! Two crosses, one below the other. Where the first one is from the edges of the sheet gives the offset, how far the second
//! is from it the feed: row `r` of the stream lands at `top + offset + feed r`.

use inks::Stack;
use protocol::ink::Ink;
use protocol::paper::{LEFT, Paper};

use super::error::ChartError;
use super::sketch::{Sketch, mm};
use crate::layout::{Mm, Point, Profile};
use sheet::DotMap;

/// Where the middle of the first cross belongs, in millimetres from the left and the top edge of the sheet.
const CROSS: (f64, f64) = (20.0, 30.0);
/// From the first cross to the second, in millimetres.
const DISTANCE: f64 = 200.0;
/// The top margin of the papers that are long enough, in millimetres.
const TOP: f64 = 284.0 * 25.4 / 600.0;

/// Arms of a cross, and its width, in millimetres.
const ARM: f64 = 7.0;
const LINE: f64 = 0.2;

/// The chart, as large as the printable area of the paper, in one ink. `next` are lines that say what to do with the two
/// measurements; they are printed below the instructions.
///
/// # Errors
/// A paper that is too small.
pub fn calibration(ink: Ink, paper: Paper, next: &[&str]) -> Result<DotMap, ChartError> {
    let (width, length) = (usize::from(paper.width()), usize::from(paper.length()));
    let at = (mm(CROSS.0) - usize::from(LEFT), mm(CROSS.1) - usize::from(paper.top()).min(mm(CROSS.1)));
    let room = (mm(110.0), at.1 + mm(DISTANCE) + mm(ARM));
    if width < room.0 || length < room.1 {
        let needed = |dots: usize| Mm::of_dots(dots as i64).0.ceil() as u32;
        let (width, length) = (needed(room.0), needed(room.1));
        return Err(ChartError::Paper { chart: "calibration", width, length, paper: paper.name() });
    }
    let ink = Stack::new([ink]);
    let mut sketch = Sketch::new(width, length);
    let (arm, line) = (mm(ARM), mm(LINE));
    for y in [at.1, at.1 + mm(DISTANCE)] {
        sketch.fill((at.0 - arm, y - line / 2, 2 * arm, line), &ink);
        sketch.fill((at.0 - line / 2, y - arm, line, 2 * arm), &ink);
    }
    let words = [
        "1. Measure to the middle of the upper cross:".to_string(),
        format!("   from the left edge of the sheet ({:.1} mm)", CROSS.0),
        format!("   from the top edge ({:.1} mm)", CROSS.1),
        format!("2. From cross to cross ({DISTANCE:.1} mm)"),
    ];
    for (i, words) in words.iter().map(String::as_str).chain(next.iter().copied()).enumerate() {
        sketch.text(at.0 + mm(15.0), at.1 + mm(10.0) + i * mm(5.0), 4, &ink, words);
    }
    Ok(sketch.finish()?)
}

/// The profile of the printer whose crosses were measured there.
pub fn profile(cross: Point, distance: Option<Mm>) -> Profile {
    let feed = distance.map_or(1.0, |distance| distance.0 / DISTANCE);
    let row = CROSS.1 - TOP;
    // Thousandths of a millimetre are more than any ruler tells.
    let round = |mm: f64| (mm * 1e3).round() / 1e3;
    let offset = [round(cross.0.0 - CROSS.0), round(cross.1.0 - TOP - feed * row)];
    Profile { offset_mm: offset, feed, ..Profile::default() }
}
