//! What lies beside a dot of a shape.
//!
//! Problem: whether a dot is at the edge of its shape, midway across a line, or between two inks.
//! Method: steps along the row and the column, at most so many, until the shape ends. Cost: 2 ns a step. Limits: a slanting line is cut
//! along its row or its column, whichever is shorter.

use super::flat::{Flat, similar};
use super::grounds::{PAPER, has_ink};
use super::shapes::continues;
use super::treatments::{Shape, Treatment};

/// Whether one of the four dots beside a dot is outside the art, or of another shape and `needs` a rim.
pub(super) fn at_the_rim(flat: &Flat, width: usize, at: (usize, usize), needs: impl Fn(u8) -> bool) -> bool {
    [(-1, 0), (1, 0), (0, -1), (0, 1)]
        .into_iter()
        .any(|way| reach(flat, width, at, way, 1) == 0 && beyond(flat, width, at, way, 0).is_none_or(&needs))
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

/// Pale lines that lie on several colours: borders of a table whose rows are tinted in turns, wires of a dartboard.
pub(super) struct PaleLines<'a> {
    pub flat: &'a Flat,
    pub width: usize,
    /// One for each colour.
    pub treatments: &'a [Treatment],
}

impl PaleLines<'_> {
    /// Whether a dot of such a line of this side has ink: between inks it has none; between ink and paper the edge to the paper has, if the line is
    /// no `hair`, which may be a soft edge; between paler colours it is a line like any other. `None` if it is a tone.
    pub fn has_ink(&self, at: (usize, usize), side: u8, hair: u8) -> Option<bool> {
        let sides = self.across(at, 2 * usize::from(side) + 1);
        let is_line = sides.iter().all(|&side| self.is_paler(side, at));
        let is_rim = || at_the_rim(self.flat, self.width, at, |beside| !has_ink(self.of(beside)));
        match sides.map(|side| side.and_then(|side| is_ink_or_paper(self.of(side)))) {
            [Some(true), Some(true)] => Some(false),
            [Some(a), Some(b)] if a != b && side > hair => Some(is_rim()),
            _ if is_line && side <= hair => Some(is_ridge(self.flat, self.width, at, hair)),
            _ if is_line => is_rim().then_some(true),
            _ => None,
        }
    }

    fn of(&self, colour: u8) -> Option<Treatment> {
        self.treatments.get(usize::from(colour)).copied()
    }

    /// The colours on both sides of a dot, the way across that is shorter; `None` outside the art. Where the line is longer both ways it is its own.
    fn across(&self, (x, y): (usize, usize), most: usize) -> [Option<u8>; 2] {
        let ways = [[(-1, 0), (1, 0)], [(0, -1), (0, 1)]];
        let steps = ways.map(|ways| ways.map(|way| reach(self.flat, self.width, (x, y), way, most)));
        let shorter = usize::from(steps[1].iter().sum::<usize>() < steps[0].iter().sum());
        std::array::from_fn(|side| {
            beyond(self.flat, self.width, (x, y), ways[shorter][side], steps[shorter][side])
        })
    }

    /// Whether what is beside a dot is a flat colour without ink that is plainly lighter than it.
    fn is_paler(&self, beside: Option<u8>, (x, y): (usize, usize)) -> bool {
        let colour = |of: u8| self.flat.colours.get(usize::from(of)).map(|&(_, colour)| colour);
        let own = colour(self.flat.index[y * self.width + x]);
        let Some((beside, own)) =
            beside.filter(|&beside| !has_ink(self.of(beside))).and_then(colour).zip(own)
        else {
            return false;
        };
        let light = |colour: [u8; 3]| colour.map(u32::from).iter().sum::<u32>();
        !similar(beside, own) && light(beside) > light(own)
    }
}

/// Whether what is beside a line is ink or bare paper; `None` if it is a tint or a shading.
fn is_ink_or_paper(beside: Option<Treatment>) -> Option<bool> {
    match beside {
        Some(Treatment::Solid(PAPER)) => Some(false),
        _ => has_ink(beside).then_some(true),
    }
}

/// Whether a dot of a line at most a `hair` wide is midway across it. Where lines cross all dots are.
pub(super) fn is_ridge(flat: &Flat, width: usize, at: (usize, usize), hair: u8) -> bool {
    let most = 3 * usize::from(hair);
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

/// The colour behind so many dots one way; `None` outside the art.
fn beyond(
    flat: &Flat,
    width: usize,
    (x, y): (usize, usize),
    (right, down): (isize, isize),
    steps: usize,
) -> Option<u8> {
    let steps = steps as isize + 1;
    let x = x.checked_add_signed(right * steps).filter(|&x| x < width)?;
    flat.index.get(y.checked_add_signed(down * steps)? * width + x).copied()
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
        continues(flat, own, colour).then_some(())
    };
    (1..=most).take_while(|&step| is_own(step).is_some()).count()
}
