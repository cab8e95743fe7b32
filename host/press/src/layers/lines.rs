//! Lines that hang on wide shapes: the curve between the markers of a plot.
//!
//! Problem: a shape is as wide as its widest place, so that a line with a marker on it is screened all along, and becomes a row of dots.
//! Method: the opening of the shape by the square that tells wide from thin (Serra 1982): what no such square in it covers is
//! thin. Such parts are lines if they are long; short ones are the corners that squares do not reach into. Where the shape is mostly lines, small
//! wide parts are where they turn or cross.
//! Cost: 4 ns a dot of wide shapes. Memory: four bytes a dot of a row, 40 a stretch.
//! Limits: a line is decided apart from its shape only if it is [`LONG`] squares long, and not if the shape is large: the ground
//! between two letters is no line.

use std::ops::Range;

use super::shapes::{Run, Shapes};
use crate::forest::Forest;

/// A line is at least so many times longer than it may be wide.
const LONG: u32 = 3;
/// Lines make at least one in so many dots of their shape. Between letters on a ground are thin parts of it, too: a tenth of it.
const PART: u64 = 6;

/// What is left of a shape that is half lines or more is one of their corners, if it is at most so many times as wide and high as a line may be.
const CORNER: u32 = 3;

/// A stretch of a line.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Line {
    /// The run that it is a part of.
    pub run: u32,
    pub row: u32,
    pub start: u32,
    pub end: u32,
}

/// The lines that hang on shapes with a root that `is_wide`. `stroke` is the side of the squares in [`Shapes::cores`].
pub(super) fn lines(shapes: &Shapes, width: usize, stroke: u8, is_wide: impl Fn(u32) -> bool) -> Vec<Line> {
    let Shapes { runs, rows, cores } = shapes;
    let mut cores = cores.iter().rev().peekable();
    // For each column the first row that a square which ends in this row or beneath it covers.
    let mut covered = vec![u32::MAX; width];
    let (mut found, mut is_thin) = (Vec::new(), Vec::new());
    for (y, row) in rows.windows(2).enumerate().rev() {
        while let Some(core) = cores.next_if(|core| core.run as usize >= row[0]) {
            let start = core.start + 1 - u32::from(stroke);
            covered[start as usize..core.end as usize].fill(y as u32 + 1 - u32::from(stroke));
        }
        for (at, run) in
            (row[0]..row[1]).zip(&runs[row[0]..row[1]]).rev().filter(|(_, run)| is_wide(run.root))
        {
            let mut end = run.end;
            let dots = &covered[run.start as usize..run.end as usize];
            for part in dots.chunk_by(|&a, &b| (a > y as u32) == (b > y as u32)).rev() {
                let start = end - part.len() as u32;
                found.push(Line { run: at as u32, row: y as u32, start, end });
                is_thin.push(part[0] > y as u32);
                end = start;
            }
        }
    }
    found.reverse();
    is_thin.reverse();
    let parts = Parts { all: &found, runs, width };
    let size = parts.sizes(|a, b| is_thin[a] == is_thin[b]);
    let is_line = |at: usize| is_thin[at] && size[at] >= LONG * u32::from(stroke);
    // How many dots of each shape are of lines, and how many it has.
    let mut dots = vec![[0u64; 2]; runs.len()];
    for (at, part) in found.iter().enumerate() {
        let [of_lines, all] = &mut dots[parts.shape(at)];
        let own = u64::from(part.end - part.start);
        *all += own;
        *of_lines += if is_line(at) { own } else { 0 };
    }
    let mut line: Vec<bool> = (0..found.len())
        .map(|at| {
            let [of_lines, all] = dots[parts.shape(at)];
            is_line(at) && PART * of_lines >= all
        })
        .collect();
    // Where lines meet or turn, squares fit between them.
    let size = parts.sizes(|a, b| line[a] == line[b]);
    for at in 0..found.len() {
        let [of_lines, all] = dots[parts.shape(at)];
        line[at] |= 2 * of_lines >= all && size[at] <= CORNER * u32::from(stroke);
    }
    let mut line = line.into_iter();
    found.retain(|_| line.next() == Some(true));
    found
}

/// Stretches of shapes, in order.
struct Parts<'a> {
    all: &'a [Line],
    runs: &'a [Run],
    width: usize,
}

impl Parts<'_> {
    /// The root of the shape that a stretch is of.
    fn shape(&self, at: usize) -> usize {
        self.runs[self.all[at].run as usize].root as usize
    }

    /// For each stretch the width or height, whichever is more, of what it hangs together with of its shape and belongs `together`.
    fn sizes(&self, together: impl Fn(usize, usize) -> bool) -> Vec<u32> {
        let place = |part: &Line| {
            let row = part.row as usize * self.width;
            row + part.start as usize..row + part.end as usize
        };
        let places: Vec<Range<usize>> = self.all.iter().map(place).collect();
        let is_one = |a: usize, b: usize| self.shape(a) == self.shape(b) && together(a, b);
        let roots = Forest::of_stretches(&places, self.width, is_one).roots();
        let mut bounds = vec![[u32::MAX, u32::MAX, 0, 0]; self.all.len()];
        for (part, &root) in self.all.iter().zip(&roots) {
            let [left, top, right, bottom] = &mut bounds[root as usize];
            (*left, *right) = ((*left).min(part.start), (*right).max(part.end));
            (*top, *bottom) = ((*top).min(part.row), part.row + 1);
        }
        let size = |[left, top, right, bottom]: [u32; 4]| (right - left).max(bottom - top);
        roots.into_iter().map(|root| size(bounds[root as usize])).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layers::flat::Flat;
    use crate::layers::kinds::Kind;
    use crate::layers::shapes::shapes;

    const SIDE: usize = 80;
    const STROKE: u8 = 9;

    /// The dots of lines in a drawing of the dots that satisfy `is`.
    fn drawn(is: impl Fn(usize, usize) -> bool) -> Vec<bool> {
        let index = (0..SIDE * SIDE).map(|at| 2 * u8::from(is(at % SIDE, at / SIDE))).collect();
        let colours = vec![(Kind::Picture, [255; 3]), (Kind::Picture, [0; 3]), (Kind::Drawing, [128; 3])];
        let mut shaped = [false; 256];
        shaped[2] = true;
        let all = shapes(&Flat { colours, index }, SIDE, (&shaped, STROKE));
        let mut dots = vec![false; SIDE * SIDE];
        for line in lines(&all, SIDE, STROKE, |root| all.runs[root as usize].side >= STROKE) {
            let row = line.row as usize * SIDE;
            dots[row + line.start as usize..row + line.end as usize].fill(true);
        }
        dots
    }

    #[test]
    fn a_line_is_told_from_the_marker_on_it() {
        for (wide, long, is_line) in
            [(8, 27, true), (9, 27, false), (8, 26, false), (3, 40, true), (1, 40, false)]
        {
            let marker = |x: usize, y: usize| x < 20 && (20..40).contains(&y);
            let line = |x: usize, y: usize| (20..20 + long).contains(&x) && (30..30 + wide).contains(&y);
            let found = drawn(|x, y| marker(x, y) || line(x, y));
            for (at, &found) in found.iter().enumerate() {
                let (x, y) = (at % SIDE, at / SIDE);
                assert_eq!(found, is_line && line(x, y), "{wide} wide, {long} long, at {x}, {y}");
            }
        }
    }

    /// A zigzag and a cross: squares fit where lines turn and where they cross, and are of the lines.
    #[test]
    fn corners_and_crossings_are_of_the_lines() {
        let zigzag = |x: usize, y: usize| {
            let place = (x % 40).abs_diff(20) * 3 - (x % 40).abs_diff(20) / 4;
            (4..76).contains(&x) && (place..place + 23).contains(&y)
        };
        let cross = |x: usize, y: usize| x.abs_diff(y) <= 5 || (x + y).abs_diff(80) <= 5;
        for is in [&zigzag as &dyn Fn(usize, usize) -> bool, &cross] {
            let found = drawn(is);
            for (at, &found) in found.iter().enumerate() {
                assert_eq!(found, is(at % SIDE, at / SIDE), "at {}, {}", at % SIDE, at / SIDE);
            }
        }
    }

    #[test]
    fn the_ground_between_letters_is_no_line() {
        // Stems 40 dots high, six dots apart, on a ground.
        let stem = |x: usize, y: usize| (20..60).contains(&y) && (20..60).contains(&x) && x % 10 < 4;
        assert!(!drawn(|x, y| !stem(x, y)).contains(&true));
    }

    #[test]
    fn wide_shapes_of_any_form_have_no_lines() {
        let far = |x: usize, y: usize| (x as f64 - 40.0).hypot(y as f64 - 40.0);
        assert!(!drawn(|x, y| far(x, y) < 30.0).contains(&true), "disc");
        assert!(!drawn(|x, y| (12.0..30.0).contains(&far(x, y))).contains(&true), "ring");
        assert!(!drawn(|x, y| x > 10 && y > 10 && x + y < 60).contains(&true), "triangle");
        assert!(!drawn(|x, y| (y * 3).abs_diff(x) < 30).contains(&true), "slanting band");
    }
}
