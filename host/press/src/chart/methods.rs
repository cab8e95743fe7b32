//! The halftones side by side: the same ramp and flat patches by each method.

use inks::{Library, Stack};
use protocol::ink::Kind;

use super::error::ChartError;
use super::sketch::{LINE, Sketch, mm};
use super::steps::{LABEL, pen, two};
use crate::halftone::Method;
use crate::sheet::DotMap;
use observe::Observer;

/// Shares of the flat patches: those where patterns and bands show most.
const FLAT: [f64; 4] = [0.02, 0.1, 0.3, 0.5];
/// Shares along a ramp.
const STEPS: usize = 1024;

/// From all of `a` to all of `b`, and flat mixtures of both, by each method in a column of its own. Single dots are left
/// out unless both stacks are of process inks.
pub fn halftones(
    a: &Stack,
    b: &Stack,
    library: &Library,
    observer: &dyn Observer,
) -> Result<DotMap, ChartError> {
    two("halftone chart", a, b)?;
    let process = |stack: &Stack| stack.layers().iter().all(|ink| ink.kind() == Kind::Process);
    let mut methods = vec![("walk", Method::Walk), ("cells", Method::Cells), ("best", Method::Best)];
    if process(a) && process(b) {
        methods.push(("blue", Method::Blue));
    }
    let (patch, gap, line) = ((mm(40.0), mm(15.0)), mm(4.0), LINE * LABEL);
    let (column, row) = (patch.0 + gap, line + mm(1.0) + patch.1 + mm(2.0));
    let pen = pen(&[a, b]);
    let mut sketch = Sketch::new(methods.len() * column - gap, line + mm(2.0) + (1 + FLAT.len()) * row);
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
