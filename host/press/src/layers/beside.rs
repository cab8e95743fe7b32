//! What lies beside a dot of a shape.
//!
//! Problem: whether a dot is at the edge of its shape, midway across a line, or between two inks.
//! Method: steps along the row and the column, at most so many, until the shape ends. Cost: 2 ns a step. Limits: a slanting line is cut
//! along its row or its column, whichever is shorter.

use super::flat::Flat;
use super::grounds::{PAPER, has_ink};
use super::shapes::joined;
use super::treatments::{Shape, Treatment};

/// Whether one of the four dots beside a dot is outside the art, or of another shape and `needs` a rim.
pub(super) fn at_the_rim(
    flat: &Flat,
    width: usize,
    (x, y): (usize, usize),
    needs: impl Fn(u8) -> bool,
) -> bool {
    let beside = |(right, down): (isize, isize)| {
        let x = x.checked_add_signed(right).filter(|&x| x < width)?;
        flat.index.get(y.checked_add_signed(down)? * width + x).copied()
    };
    [(-1, 0), (1, 0), (0, -1), (0, 1)]
        .into_iter()
        .any(|way| reach(flat, width, (x, y), way, 1) == 0 && beside(way).is_none_or(&needs))
}

/// Whether a shape has a rim beside what is printed so. Between inks it would be a line of a third colour; but where the stack beside it is
/// one of its mixture, clusters of that would hang on the edge.
pub(super) fn needs_rim(shape: &Shape, beside: Option<Treatment>) -> bool {
    match beside {
        Some(Treatment::Solid(stack)) if stack != PAPER => {
            shape.mixed.checked_shr(stack.into()).unwrap_or(1) & 1 == 1
        }
        beside => !has_ink(beside),
    }
}

/// The colours on both sides of a dot of a thin shape, the way across that is shorter; `None` outside the art.
pub(super) fn across(flat: &Flat, width: usize, (x, y): (usize, usize), most: usize) -> [Option<u8>; 2] {
    let ways = [[(-1, 0), (1, 0)], [(0, -1), (0, 1)]];
    let steps = ways.map(|ways| ways.map(|way| reach(flat, width, (x, y), way, most)));
    let shorter = usize::from(steps[1].iter().sum::<usize>() < steps[0].iter().sum());
    std::array::from_fn(|side| {
        let ((right, down), steps) = (ways[shorter][side], steps[shorter][side] as isize + 1);
        let x = x.checked_add_signed(right * steps).filter(|&x| x < width)?;
        flat.index.get(y.checked_add_signed(down * steps)? * width + x).copied()
    })
}

/// Whether what is beside a line is ink or bare paper; `None` if it is a tint, a shading or outside the art.
pub(super) fn is_ink_or_paper(beside: Option<Treatment>) -> Option<bool> {
    match beside {
        Some(Treatment::Solid(PAPER)) => Some(false),
        _ => has_ink(beside).then_some(true),
    }
}

/// Whether a dot of a hairline is midway across it. Where lines cross all dots are.
pub(super) fn is_ridge(flat: &Flat, width: usize, at: (usize, usize), most: usize) -> bool {
    let [left, right, above, below] =
        [(-1, 0), (1, 0), (0, -1), (0, 1)].map(|way| reach(flat, width, at, way, most));
    let (across, down) = (left + 1 + right, above + 1 + below);
    let midway = [left == (across - 1) / 2, above == (down - 1) / 2];
    match (across > most, down > most) {
        (true, true) => true,
        // A slanting line is cut unevenly.
        _ if across.abs_diff(down) <= 2 => midway.contains(&true),
        _ => midway[usize::from(across > down)],
    }
}

/// How many dots of the same shape follow a dot one way, so many at most.
fn reach(
    flat: &Flat,
    width: usize,
    (x, y): (usize, usize),
    (right, down): (isize, isize),
    most: usize,
) -> usize {
    let own = flat.index[y * width + x];
    let is_own = |step: usize| {
        let step = step as isize;
        let x = x.checked_add_signed(right * step).filter(|&x| x < width)?;
        let colour = *flat.index.get(y.checked_add_signed(down * step)? * width + x)?;
        (usize::from(colour) < flat.colours.len() && (colour == own || joined(flat, own, colour)))
            .then_some(())
    };
    (1..=most).take_while(|&step| is_own(step).is_some()).count()
}
