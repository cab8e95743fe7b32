//! The ramp between two stacks: figure 2 of the 2009 paper, and clusters of every size for a scanner.
//!
//! Problem: how far ink spreads beyond its dots, and how small a cluster may be before it comes off, differ from ribbon to ribbon and
//! from paper to paper. Method: below the ramp stand two rows of patches, clusters of the first stack in the second and the other way
//! round, 1 to [`MOST`] dots each, at about the same tone. Solid strips of both stacks lie above and below everything, so
//! that uneven light can be divided out. [`Parts`] says where everything is; `foilpress measure ramp` reads it.
//! Limits: clusters stand apart from each other; what a halftone does between them is seen in the ramp alone.

use inks::{Library, Stack};
use observe::Observer;
use protocol::ink::Kind;

use super::error::ChartError;
use super::sketch::{LINE, Sketch, mm};
use super::steps::{LABEL, pen, two};
use halftone::Method;
use sheet::{Area, DotMap};

/// Dots of the largest clusters.
pub const MOST: usize = 24;
/// Shares along a ramp: finer than an eye sees.
const STEPS: usize = 1024;
/// Width of the chart in millimetres.
const WIDTH: f64 = 150.0;
/// Height of a solid strip in dots: 2.5 mm.
const STRIP: usize = 60;
/// Sides of a patch of clusters in dots: 6 mm.
const PATCH: (usize, usize) = (147, 142);
/// Scale of the figures above the patches, and their height with the space below.
const FIGURE: usize = 2;
const FIGURES: usize = FIGURE * LINE + 10;
/// From cluster to cluster, relative to the side of a square of as many dots: a ninth is covered.
const APART: f64 = 3.0;
/// The smallest clusters of foil: 3 x 3 dots.
const FOIL: usize = 9;

/// Where the parts of the chart are, in dots from its top left corner.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Parts {
    /// The ramp: all of the first stack at its left.
    pub ramp: Area,
    /// Solid strips of the first and of the second stack.
    pub solids: [Vec<Area>; 2],
    /// Clusters of the first stack in the second, and of the second in the first: 1, 2, 3 to [`MOST`] dots.
    pub clusters: [Vec<Area>; 2],
    /// The whole chart: width and length.
    pub size: (usize, usize),
}

/// Where everything is.
pub fn parts() -> Parts {
    let width = mm(WIDTH);
    let mut solids = [Vec::new(), Vec::new()];
    let mut top = LINE * LABEL + mm(1.5);
    let mut strips = |top: &mut usize| {
        for strips in &mut solids {
            strips.push(Area { left: 0, top: *top, width, length: STRIP });
            *top += STRIP;
        }
    };
    strips(&mut top);
    let ramp = Area { left: 0, top, width, length: mm(30.0) };
    // The scale stands below the ramp.
    top += ramp.length + mm(4.5) + LINE * 3 + mm(2.0);
    strips(&mut top);
    let mut row = |top: &mut usize| {
        *top += FIGURES + 10;
        let patch = |i: usize| Area { left: i * PATCH.0, top: *top, width: PATCH.0, length: PATCH.1 };
        let patches = (0..MOST).map(patch).collect();
        *top += PATCH.1;
        strips(top);
        patches
    };
    let clusters = [row(&mut top), row(&mut top)];
    let board = top + mm(10.0);
    Parts { ramp, solids, clusters, size: (width, board + 6 * mm(10.0)) }
}

/// The smallest clusters of a stack that are tried: smaller ones of foil are not printed (the rule `foil-speckle`), and their patches
/// stay empty.
fn least(stack: &Stack) -> usize {
    if stack.layers().iter().any(|ink| ink.kind() == Kind::Foil) { FOIL } else { 1 }
}

/// The dots of a cluster as (column, row): nearly a square.
fn cluster(dots: usize) -> impl Iterator<Item = (usize, usize)> {
    let side = (1..).find(|side| side * side >= dots).unwrap_or(1);
    (0..dots).map(move |i| (i % side, i / side))
}

/// Figure 2: all of `a` at the left, all of `b` at the right, 150 mm apart; below it clusters of either, and a checkerboard to cut
/// out and hold so that the ramp reflects it.
///
/// # Errors
/// Two stacks that are the same; what a halftone refuses.
pub fn ramp(
    a: &Stack,
    b: &Stack,
    method: Method,
    library: &Library,
    observer: &dyn Observer,
) -> Result<DotMap, ChartError> {
    two("ramp", a, b)?;
    let parts = parts();
    let (width, length) = parts.size;
    let pen = pen(&[a, b]);
    let mut sketch = Sketch::new(width, length);
    sketch.text(0, 0, LABEL, &pen, &a.to_string());
    sketch.text_to(width, 0, LABEL, &pen, &b.to_string());
    let shares: Vec<f64> = (0..STEPS).map(|i| 1.0 - (i as f64 + 0.5) / STEPS as f64).collect();
    let place = |area: &Area| (area.left, area.top, area.width, area.length);
    sketch.halftone(place(&parts.ramp), [a, b], &shares, method.into(), library, observer)?;
    let foot = parts.ramp.top + parts.ramp.length + mm(1.0);
    for tenth in 0..=10 {
        let x = (width - 6) * tenth / 10;
        sketch.fill((x, foot, 6, if tenth % 5 == 0 { mm(3.0) } else { mm(1.5) }), &pen);
    }
    sketch.text(0, foot + mm(3.5), 3, &pen, "100 %");
    sketch.text_to(width, foot + mm(3.5), 3, &pen, "0 %");
    for (strips, stack) in parts.solids.iter().zip([a, b]) {
        strips.iter().for_each(|strip| sketch.fill(place(strip), stack));
    }
    for (row, (stack, ground)) in parts.clusters.iter().zip([(a, b), (b, a)]) {
        for (dots, patch) in (1..).zip(row) {
            sketch.fill(place(patch), ground);
            sketch.text(patch.left, patch.top - FIGURES, FIGURE, &pen, &dots.to_string());
            if dots < least(stack) {
                continue;
            }
            let pitch = (APART * (dots as f64).sqrt()).round().max(APART) as usize;
            let cluster: Vec<(usize, usize)> = cluster(dots).collect();
            let inside =
                |start: usize, side: usize| (start + pitch / 3..start + side - pitch / 3).step_by(pitch);
            for y in inside(patch.top, patch.length - pitch / 2) {
                for x in inside(patch.left, patch.width - pitch / 2) {
                    cluster.iter().for_each(|(dx, dy)| sketch.fill((x + dx, y + dy, 1, 1), stack));
                }
            }
        }
    }
    let square = mm(10.0);
    for row in 0..6 {
        for column in (row % 2..width.div_ceil(square)).step_by(2) {
            sketch.fill((column * square, length - (6 - row) * square, square, square), &pen);
        }
    }
    Ok(sketch.finish()?)
}
