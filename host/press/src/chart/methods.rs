//! The halftones side by side: the same ramp and flat patches by each method.

use inks::{Library, Stack};
use protocol::ink::Kind;

use super::error::ChartError;
use super::sketch::{LINE, Sketch, mm};
use super::steps::{LABEL, pen, two};
use halftone::Method;
use observe::Observer;
use sheet::DotMap;

/// Shares of the flat patches: those where patterns and bands show most.
const FLAT: [f64; 4] = [0.02, 0.1, 0.3, 0.5];
/// Shares along a ramp.
const STEPS: usize = 1024;

/// The methods of the chart, and its lengths in dots.
struct Columns {
    methods: Vec<(&'static str, Method)>,
    patch: (usize, usize),
    line: usize,
    column: usize,
    row: usize,
    size: (usize, usize),
}

fn columns(a: &Stack, b: &Stack) -> Columns {
    let process = |stack: &Stack| stack.layers().iter().all(|ink| ink.kind() == Kind::Process);
    let mut methods = vec![("walk", Method::Walk), ("cells", Method::Cells), ("best", Method::Best)];
    if process(a) && process(b) {
        methods.push(("blue", Method::Blue));
    }
    let (patch, gap, line) = ((mm(40.0), mm(15.0)), mm(4.0), LINE * LABEL);
    let (column, row) = (patch.0 + gap, line + mm(1.0) + patch.1 + mm(2.0));
    let size = (methods.len() * column - gap, line + mm(2.0) + (1 + FLAT.len()) * row);
    Columns { methods, patch, line, column, row, size }
}

/// Width and length in dots of [`halftones`] of these stacks.
pub fn size_of_halftones(a: &Stack, b: &Stack) -> (usize, usize) {
    columns(a, b).size
}

/// From all of `a` to all of `b`, and flat mixtures of both, by each method in a column of its own. Single dots are left
/// out unless both stacks are of process inks.
pub fn halftones(
    a: &Stack,
    b: &Stack,
    library: &Library,
    observer: &dyn Observer,
) -> Result<DotMap, ChartError> {
    two("halftone chart", a, b)?;
    let Columns { methods, patch, line, column, row, size } = columns(a, b);
    let pen = pen(&[a, b]);
    let mut sketch = Sketch::new(size.0, size.1);
    let ramp: Vec<f64> = (0..STEPS).map(|i| 1.0 - (i as f64 + 0.5) / STEPS as f64).collect();
    for (i, (name, method)) in methods.into_iter().enumerate() {
        let x = i * column;
        sketch.text(x, 0, LABEL, &pen, name);
        let rows = std::iter::once((format!("{a} to {b}"), ramp.clone()))
            .chain(FLAT.map(|share| (format!("{a} {:.0} %", 100.0 * share), vec![share])));
        for (j, (label, shares)) in rows.enumerate() {
            let y = line + mm(2.0) + j * row;
            sketch.text(x, y, 3, &pen, &label);
            let place = (x, y + line + mm(1.0), patch.0, patch.1);
            sketch.halftone(place, [a, b], &shares, method, library, observer)?;
        }
    }
    Ok(sketch.finish()?)
}
