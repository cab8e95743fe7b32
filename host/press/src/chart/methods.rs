//! The halftones side by side: the same ramp, flat patches and 6-point text by each of them.
//!
//! Method: a column for each halftone. Stacks of process inks have a column for tables of clusters of several sizes, of which the machine
//! decides by what holds; others have the halftones with cells of their own.

use inks::{Library, Stack};
use protocol::ink::Kind;

use super::error::ChartError;
use super::sketch::{LINE, Screen, Sketch, mm};
use super::steps::{LABEL, pen, two};
use halftone::Method;
use observe::Observer;
use sheet::DotMap;

/// Shares of the flat patches, from where dots are lost to where holes close.
const FLAT: [f64; 8] = [0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 0.9];
/// Shares of the text.
const TEXT: [f64; 3] = [0.2, 0.5, 0.8];
/// What it says: letters with narrow counters and thin diagonals.
const WORDS: &str = "Bagdad, 6835\nmeasure axioms";
/// Minimum clusters of the tables: Gaussians of about 1.5, 2.2, 2.5 and 3.0 dots.
const TABLES: [(&str, u16); 4] = [("fine 2", 2), ("fine 4", 4), ("fine 5", 5), ("fine 7", 7)];
/// Shares along a ramp.
const STEPS: usize = 1024;

/// The halftones of the chart, and its lengths in dots.
struct Columns {
    screens: Vec<(&'static str, Screen)>,
    patch: (usize, usize),
    line: usize,
    column: usize,
    row: usize,
    size: (usize, usize),
}

fn columns(a: &Stack, b: &Stack) -> Columns {
    let process = |stack: &Stack| stack.layers().iter().all(|ink| ink.kind() == Kind::Process);
    let screens: Vec<(&str, Screen)> = match process(a) && process(b) {
        true => TABLES
            .map(|(name, minimum)| (name, Screen { method: Method::Fine, minimum: Some(minimum) }))
            .into_iter()
            .chain([("blue", Method::Blue.into()), ("cells", Method::Cells.into())])
            .collect(),
        false => vec![
            ("walk", Method::Walk.into()),
            ("cells", Method::Cells.into()),
            ("best", Method::Best.into()),
        ],
    };
    let (patch, gap, line) = ((mm(30.0), mm(10.0)), mm(2.0), LINE * LABEL);
    let (column, row) = (patch.0 + gap, LINE * SMALL + mm(1.0) + patch.1 + mm(2.0));
    let size = (screens.len() * column - gap, line + mm(2.0) + (1 + FLAT.len() + TEXT.len()) * row);
    Columns { screens, patch, line, column, row, size }
}

/// Scale of the labels of patches.
const SMALL: usize = 3;

/// Width and length in dots of [`halftones`] of these stacks.
pub fn size_of_halftones(a: &Stack, b: &Stack) -> (usize, usize) {
    columns(a, b).size
}

/// From all of `a` to all of `b`, flat mixtures of both, and text in mixtures, by each halftone in a column of its own.
pub fn halftones(
    a: &Stack,
    b: &Stack,
    library: &Library,
    observer: &dyn Observer,
) -> Result<DotMap, ChartError> {
    two("halftone chart", a, b)?;
    let Columns { screens, patch, line, column, row, size } = columns(a, b);
    let pen = pen(&[a, b]);
    let mut sketch = Sketch::new(size.0, size.1);
    let ramp: Vec<f64> = (0..STEPS).map(|i| 1.0 - (i as f64 + 0.5) / STEPS as f64).collect();
    for (i, (name, screen)) in screens.into_iter().enumerate() {
        let x = i * column;
        sketch.text(x, 0, LABEL, &pen, name);
        let percent = |share: f64| format!("{a} {:.0} %", 100.0 * share);
        let rows = std::iter::once((format!("{a} to {b}"), ramp.clone()))
            .chain(FLAT.map(|share| (percent(share), vec![share])))
            .chain(TEXT.map(|share| (percent(share), vec![share])));
        for (j, (label, shares)) in rows.enumerate() {
            let y = line + mm(2.0) + j * row;
            sketch.text(x, y, SMALL, &pen, &label);
            let place = (x, y + LINE * SMALL + mm(1.0), patch.0, patch.1);
            match j > FLAT.len() {
                false => sketch.halftone(place, [a, b], &shares, screen, library, observer)?,
                true => {
                    sketch.halftoned_text(place, [a, b], shares[0], screen, WORDS, (library, observer))?;
                }
            }
        }
    }
    Ok(sketch.finish()?)
}
