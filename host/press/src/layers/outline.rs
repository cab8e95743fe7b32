//! Letters and lines in colours that no stack prints: which of their dots are fixed, and to what.
//!
//! Problem: a halftone of clusters is coarser than a letter's strokes, so a screened letter loses its outline.
//! Method: by colour, kind and width of their [shapes](super::shapes). A shape is thin if no square of [`STROKE`] dots a side ([`LETTER`]
//! for text and for what is as small as a letter) fits in it. Thin shapes that have more ink than paper are printed in the nearest solid,
//! and so are the [lines](super::lines) that hang on wide ones. Wide ones keep their rim, all dots beside another shape, in that solid
//! and are screened inside; so do thin shapes with more paper than ink, which a solid would make too dark. Of pale lines of [`HAIR`] dots or
//! less only the middle is printed, one dot wide: screened they were dashes, and the palest had no dot. Soft edges, which lie between colours, and wide pale
//! shapes are screened as they are: their edge is exact, because the halftone does not cross it.
//! What a shape lies on ([`grounds`](super::grounds)) counts, too. One that lies on its own solid, by half of its border or more, would vanish in it. Such a thin shape is printed in the next
//! solid or in paper; such a wide one has its rim in the next solid or none. A thin shape with more paper than ink that lies on ink, by nearly
//! all of its border, is printed in paper: a rim of ink would be drawn within white letters, and screened they are ragged.
//! Letters of a word are all thin or all wide ([`words`](super::words)), also where they were drawn as outlines. What of the ground lies
//! inside letters is as wide as the ground ([`counters`](super::counters)).
//! Cost: 5 ns a dot of such shapes, 0.3 ns of others. Memory: 44 bytes a run of a row, 20 bytes a run where solids may meet. Limits:
//! widths are measured with squares, so a slanting stroke counts as thinner than it is.

use rayon::prelude::*;

use super::counters::counters;
use super::flat::{Flat, TONE};
use super::grounds::{Grounds, Lies, PAPER, has_ink, lies};
use super::kinds::Kind;
use super::lines::lines;
use super::shapes::{Run, joined, shapes};
use super::treatments::{Shape, Treatment};
use super::words::{self, Letter};

/// A thin line is narrower than this many dots: about three clusters of eight dots.
const STROKE: u8 = 9;
/// A pale line at most so many dots wide has less than a cluster in each of its dots along it.
const HAIR: u8 = 4;
/// The strokes of thin letters are narrower than this many dots, 1 mm: those of bold text of 14 points are up to 22 wide.
const LETTER: u8 = 24;

/// A drawing at most so many dots wide and high, 5 mm, is as small as a letter: text that was made outlines, a module of a QR code.
const SMALL: u32 = 118;

/// For each dot the stack it is fixed to, or [`TONE`]. `treatments` has one for each colour.
pub(super) fn fixed(flat: &Flat, width: usize, treatments: &[Treatment]) -> Vec<u8> {
    let of = |colour: u8| treatments.get(usize::from(colour)).copied();
    let stack: [u8; 256] = std::array::from_fn(|colour| match of(colour as u8) {
        Some(Treatment::Solid(stack)) => stack,
        _ => TONE,
    });
    let shaped: [bool; 256] =
        std::array::from_fn(|colour| matches!(of(colour as u8), Some(Treatment::Shape { .. })));
    let mut fixed = vec![TONE; flat.index.len()];
    fixed.par_chunks_mut(width).zip(flat.index.par_chunks(width)).for_each(|(fixed, row)| {
        fixed.iter_mut().zip(row).for_each(|(fixed, &colour)| *fixed = stack[usize::from(colour)]);
    });
    if !shaped.contains(&true) {
        return fixed;
    }
    let shapes = shapes(flat, width, (&shaped, STROKE));
    let (runs, rows) = (&shapes.runs, &shapes.rows);
    let grounds = Grounds::of(flat, width, treatments, (runs, rows));
    let small = letters(flat, (runs, rows));
    // A small drawing in a colour unlike all stacks would be a blot of another colour.
    let is_like = |run: &Run| match of(run.colour) {
        Some(Treatment::Shape(shape)) => shape.near || !shape.dark || is_text(flat, run),
        _ => true,
    };
    let is_letter: Vec<bool> = runs.iter().zip(&small).map(|(run, &small)| small && is_like(run)).collect();
    let is_thin =
        |root: u32| runs[root as usize].side < if is_letter[root as usize] { LETTER } else { STROKE };
    let is_counter = counters(flat, (runs, rows), u32::from(2 * LETTER), is_thin);
    let takes_part = |root: u32| is_letter[root as usize] && !is_counter[root as usize];
    let words = Words::of(flat, (runs, rows), takes_part);
    let is_thin = |root: u32| !is_counter[root as usize] && words.thin(root).unwrap_or_else(|| is_thin(root));
    let is_pale = |colour: u8| matches!(of(colour), Some(Treatment::Shape(shape)) if !shape.dark);
    let takes_part = |run: &Run| is_pale(run.colour) && is_thin(run.root);
    let lies = lies(flat, width, treatments, (runs, rows), takes_part);
    let solid = |root: u32, shape: &Shape| {
        if lies.get(&root) == Some(&Lies::OnInk) {
            return Some(PAPER);
        }
        grounds.as_ref().map_or(Some(shape.solids[0]), |grounds| grounds.solid(root, shape))
    };
    fixed.par_chunks_mut(width).enumerate().for_each(|(y, fixed)| {
        for run in &runs[rows[y]..rows[y + 1]] {
            let root = run.root;
            let Some(Treatment::Shape(shape)) = of(run.colour) else { continue };
            let (thin, first, is_small) = (is_thin(root), shape.solids[0], small[root as usize]);
            let (start, end) = (run.start as usize, run.end as usize);
            match solid(root, &shape) {
                Some(solid) if thin && (shape.dark || solid != first) => fixed[start..end].fill(solid),
                Some(solid) if solid > PAPER && (shape.dark || thin) => {
                    let side = runs[root as usize].side;
                    let is_hairline = !shape.dark && side <= HAIR && !is_letter[root as usize];
                    let (kind, _) = flat.colours[usize::from(run.colour)];
                    if !shape.dark && kind != Kind::Text && lies.get(&root) != Some(&Lies::OnOneColour) {
                        continue;
                    }
                    for (x, dot) in (start..).zip(&mut fixed[start..end]) {
                        if is_hairline {
                            *dot = if is_ridge(flat, width, (x, y)) { solid } else { PAPER };
                        } else if at_the_rim(flat, width, (x, y), |beside| {
                            is_small || needs_rim(&shape, of(beside))
                        }) {
                            *dot = solid;
                        }
                    }
                }
                _ => {}
            }
        }
    });
    let is_wide = |root: u32| !is_letter[root as usize] && !is_thin(root);
    for line in lines(&shapes, width, STROKE, is_wide) {
        let run = &runs[line.run as usize];
        let Some(Treatment::Shape(shape)) = of(run.colour) else { continue };
        if let Some(solid) = solid(run.root, &shape).filter(|&solid| shape.dark || solid != shape.solids[0]) {
            let row = line.row as usize * width;
            fixed[row + line.start as usize..row + line.end as usize].fill(solid);
        }
    }
    fixed
}

/// Letters that are decided by the word they belong to.
struct Words {
    /// For each run, the number of the letter it is the root of, or [`NO_LETTER`]. Empty if there is none.
    letter: Vec<u32>,
    /// For each letter, whether it is thin.
    thin: Vec<bool>,
}

const NO_LETTER: u32 = u32::MAX;

impl Words {
    fn of(flat: &Flat, (runs, rows): (&[Run], &[usize]), is_letter: impl Fn(u32) -> bool) -> Words {
        let takes_part = |root: u32| is_letter(root) && words::takes_part(runs[root as usize].side, LETTER);
        let (mut letter, mut letters) = (Vec::new(), Vec::<Letter>::new());
        for (y, row) in rows.windows(2).enumerate() {
            for run in &runs[row[0]..row[1]] {
                if !takes_part(run.root) {
                    continue;
                }
                let root = &runs[run.root as usize];
                if letter.is_empty() {
                    letter = vec![NO_LETTER; runs.len()];
                }
                let number = &mut letter[run.root as usize];
                let y = y as u32;
                if *number == NO_LETTER {
                    *number = letters.len() as u32;
                    let bounds = [run.start, y, run.end, y + 1];
                    letters.push(Letter { colour: root.colour, bounds, side: root.side, dots: 0 });
                }
                let found = &mut letters[*number as usize];
                let [left, _, right, bottom] = &mut found.bounds;
                (*left, *right, *bottom) = ((*left).min(run.start), (*right).max(run.end), y + 1);
                found.dots += run.end - run.start;
            }
        }
        let thin = words::thin(&letters, LETTER, |a, b| joined(flat, a, b));
        Words { letter, thin }
    }

    /// Whether the word of the shape with this root is thin; `None` for a shape that is decided by itself.
    fn thin(&self, root: u32) -> Option<bool> {
        self.letter.get(root as usize).and_then(|&number| self.thin.get(number as usize)).copied()
    }
}

fn is_text(flat: &Flat, run: &Run) -> bool {
    flat.colours[usize::from(run.colour)].0 == Kind::Text
}

/// For each run that is the root of a shape, whether the shape is text or as small as a letter.
fn letters(flat: &Flat, (runs, rows): (&[Run], &[usize])) -> Vec<bool> {
    let mut bounds = vec![[u32::MAX, 0, u32::MAX, 0]; runs.len()];
    for (y, row) in (0u32..).zip(rows.windows(2)) {
        for run in &runs[row[0]..row[1]] {
            let [left, right, top, bottom] = &mut bounds[run.root as usize];
            (*left, *right) = ((*left).min(run.start), (*right).max(run.end));
            (*top, *bottom) = ((*top).min(y), y + 1);
        }
    }
    let is_small = |[left, right, top, bottom]: [u32; 4]| {
        right - left.min(right) <= SMALL && bottom - top.min(bottom) <= SMALL
    };
    runs.iter().zip(bounds).map(|(run, bounds)| is_text(flat, run) || is_small(bounds)).collect()
}

/// Whether one of the four dots beside a dot is outside the art, or of another shape and `needs` a rim.
fn at_the_rim(flat: &Flat, width: usize, (x, y): (usize, usize), needs: impl Fn(u8) -> bool) -> bool {
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
fn needs_rim(shape: &Shape, beside: Option<Treatment>) -> bool {
    match beside {
        Some(Treatment::Solid(stack)) if stack != PAPER => {
            shape.mixed.checked_shr(stack.into()).unwrap_or(1) & 1 == 1
        }
        beside => !has_ink(beside),
    }
}

/// Whether a dot of a hairline is midway across it. Where lines cross all dots are.
fn is_ridge(flat: &Flat, width: usize, at: (usize, usize)) -> bool {
    let most = 3 * usize::from(HAIR);
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

#[cfg(test)]
mod tests {
    use super::*;

    const DARK: Treatment =
        Treatment::Shape(Shape { solids: [7, 5, 0, 0], dark: true, near: true, mixed: 1 << 7, rank: 9 });
    const LIGHT: Treatment =
        Treatment::Shape(Shape { solids: [7, 0, 0, 0], dark: false, near: true, mixed: 1 << 7, rank: 9 });

    /// Paper, black, then a colour of this kind with this treatment, at all dots that satisfy `is`.
    fn drawn(
        (width, length): (usize, usize),
        kind: Kind,
        treatment: Treatment,
        is: impl Fn(usize, usize) -> bool,
    ) -> Vec<u8> {
        let colours = vec![(Kind::Picture, [255; 3]), (Kind::Picture, [0; 3]), (kind, [128; 3])];
        let index = (0..width * length).map(|at| 2 * u8::from(is(at % width, at / width))).collect();
        fixed(&Flat { colours, index }, width, &[Treatment::Solid(0), Treatment::Solid(1), treatment])
    }

    /// White letters in a dark bar would have rims of ink, and beside paper they would vanish without.
    #[test]
    fn a_pale_stroke_on_ink_is_paper_and_beside_paper_keeps_its_rim() {
        let colours = vec![
            (Kind::Picture, [255; 3]),
            (Kind::Picture, [0; 3]),
            (Kind::Text, [235; 3]),
            (Kind::Drawing, [60; 3]),
        ];
        for (bar, fill) in [(0..60, Some(PAPER)), (10..60, None), (0..0, None)] {
            let index = (0..60 * 50).map(|at| match (at % 60, at / 60) {
                (20..27, 4..40) => 2,
                (x, _) if bar.contains(&x) || bar.start == 10 && x > 23 => 3,
                _ => 0,
            });
            let index: Vec<u8> = if bar.start == 10 {
                // The left half of the stroke's border is paper.
                index
                    .enumerate()
                    .map(|(at, colour)| if colour == 3 && at % 60 < 23 { 0 } else { colour })
                    .collect()
            } else {
                index.collect()
            };
            let flat = Flat { colours: colours.clone(), index };
            let fixed = fixed(&flat, 60, &[Treatment::Solid(0), Treatment::Solid(1), LIGHT, DARK]);
            let (middle, rim) = (fixed[20 * 60 + 23], fixed[20 * 60 + 20]);
            assert_eq!((middle, rim), fill.map_or((TONE, 7), |stack| (stack, stack)), "{bar:?}");
        }
    }

    #[test]
    fn a_thin_stroke_is_solid_and_a_wide_one_keeps_its_rim() {
        // A drawing no larger than a letter is one.
        let small = SMALL as usize;
        for (kind, most, long) in [
            (Kind::Text, LETTER, 50),
            (Kind::Drawing, LETTER, small),
            (Kind::Text, LETTER, small + 1),
            (Kind::Drawing, STROKE, small + 1),
        ] {
            let most = usize::from(most);
            for (wide, solid) in [(most - 1, true), (most, false)] {
                let inside = |x: usize| (5..5 + wide).contains(&x);
                let fixed = drawn((60, long), kind, DARK, |x, _| inside(x));
                for (at, &stack) in fixed.iter().enumerate() {
                    let (x, y) = (at % 60, at / 60);
                    let rim = x == 5 || x == 4 + wide || y == 0 || y + 1 == long;
                    let wanted = if !inside(x) {
                        0
                    } else if solid || rim {
                        7
                    } else {
                        TONE
                    };
                    assert_eq!(stack, wanted, "{kind:?}, {wide} wide, at {x}, {y}");
                }
            }
        }
    }

    /// A small drawing in a colour unlike all stacks is none of them: grey enclaves of a map were black.
    #[test]
    fn a_small_drawing_unlike_its_solid_is_screened_within_its_rim() {
        let unlike =
            Treatment::Shape(Shape { solids: [7, 5, 0, 0], dark: true, near: false, mixed: 1 << 7, rank: 9 });
        let cut =
            |kind| drawn((60, 50), kind, unlike, |x, _| (5..17).contains(&x))[25 * 60..26 * 60].to_vec();
        let (drawing, text) = (cut(Kind::Drawing), cut(Kind::Text));
        assert_eq!([4, 5, 6, 15, 16, 17].map(|x| drawing[x]), [0, 7, TONE, TONE, 7, 0]);
        assert_eq!([4, 5, 6, 15, 16, 17].map(|x| text[x]), [0, 7, 7, 7, 7, 0]);
    }

    /// Beside inks a rim would be a line of a third colour; beside a stack of its own mixture it keeps the edge.
    #[test]
    fn a_wide_shape_has_its_rim_beside_paper_and_what_would_fray_its_edge() {
        for (beside, rim) in [
            (Treatment::Solid(PAPER), true),
            (Treatment::Solid(4), false),
            (Treatment::Solid(3), true),
            (LIGHT, true),
            (DARK, false),
        ] {
            let colours = vec![
                (Kind::Picture, [255; 3]),
                (Kind::Picture, [0; 3]),
                (Kind::Drawing, [128; 3]),
                (Kind::Drawing, [60; 3]),
            ];
            let index = (0..300 * 200).map(|at| if at % 300 < 150 { 2 } else { 3 }).collect();
            let own = Treatment::Shape(Shape {
                solids: [7, 5, 0, 0],
                dark: true,
                near: true,
                mixed: 1 << 3,
                rank: 9,
            });
            let flat = Flat { colours, index };
            let fixed = fixed(&flat, 300, &[Treatment::Solid(0), Treatment::Solid(1), own, beside]);
            let row = &fixed[100 * 300..101 * 300];
            assert_eq!([row[148], row[149]], [TONE, if rim { 7 } else { TONE }], "{beside:?}");
        }
    }

    #[test]
    fn letters_of_a_word_are_printed_alike() {
        let limit = usize::from(LETTER);
        // An O as wide as the limit, and letters that are a little thinner; then a word of which most is wide.
        for (widths, solid) in [
            ([limit, limit - 1, limit - 2, limit - 3], true),
            ([limit - 1, limit, limit + 1, limit + 2], false),
        ] {
            let stroke = |x: usize| (x % 60 < widths[x / 60 % 4]).then_some(x / 60);
            let fixed = drawn((240, 60), Kind::Text, DARK, |x, _| stroke(x).is_some());
            for x in (0..240).filter(|&x| stroke(x).is_some()) {
                let rim = x % 60 == 0 || x % 60 + 1 == widths[x / 60];
                assert_eq!(fixed[30 * 240 + x], if solid || rim { 7 } else { TONE }, "{widths:?} at {x}");
            }
            // Lines are decided by themselves.
            let lines = drawn((240, SMALL as usize + 1), Kind::Drawing, DARK, |x, _| {
                x % 60 < usize::from(STROKE) - x / 60 % 2
            });
            assert_eq!((lines[30 * 240 + 4], lines[30 * 240 + 64]), (TONE, 7));
        }
    }

    #[test]
    fn a_pale_letter_keeps_its_rim_and_a_pale_hairline_its_edge() {
        let long = SMALL as usize + 1;
        let cut = |kind, long, wide: usize| {
            drawn((20, long), kind, LIGHT, |x, _| (5..5 + wide).contains(&x))[20..40].to_vec()
        };
        let rim = [0, 7, TONE, TONE, TONE, TONE, 7, 0];
        for (kind, long) in [(Kind::Text, 20), (Kind::Drawing, 20), (Kind::Drawing, long)] {
            assert_eq!(cut(kind, long, 6)[4..12], rim, "{kind:?}, {long}");
        }
        assert_eq!(cut(Kind::Drawing, long, 12)[4..8], [0, TONE, TONE, TONE], "a wide one is a tint");
        for (wide, middle) in (1..=usize::from(HAIR)).zip([5, 5, 6, 6]) {
            let line = cut(Kind::Drawing, long, wide);
            let printed: Vec<usize> = (0..20).filter(|&x| line[x] != 0).collect();
            assert!(printed == [middle] && line[middle] == 7, "{wide}: {printed:?}");
        }
        // A cross is whole.
        let cross = drawn((long, long), Kind::Drawing, LIGHT, |x, y| x / 2 == 30 || y / 2 == 20);
        let row = |y: usize| (0..long).filter(|x| cross[y * long + x] == 7).count();
        assert_eq!([row(39), row(40), row(41)], [1, long, 2]);
        // On a shading, and on a tint that is like it, it is no line.
        for (ground, beside) in [(255, TONE), (3, TONE)] {
            let colours = vec![
                (Kind::Picture, [255; 3]),
                (Kind::Picture, [0; 3]),
                (Kind::Drawing, [230; 3]),
                (Kind::Drawing, [238; 3]),
            ];
            let index =
                (0..20 * long).map(|at| if (5..7).contains(&(at % 20)) { 2 } else { ground }).collect();
            let flat = Flat { colours, index };
            let fixed = fixed(&flat, 20, &[Treatment::Solid(0), Treatment::Solid(1), LIGHT, LIGHT]);
            assert_eq!(fixed[24..28], [beside, TONE, TONE, beside], "{ground}");
        }
        // A soft edge lies beside ink.
        let colours = vec![
            (Kind::Picture, [255; 3]),
            (Kind::Picture, [0; 3]),
            (Kind::Drawing, [230; 3]),
            (Kind::Drawing, [60; 3]),
        ];
        let index = (0..40 * long).map(|at| [3, 3, 2, 2, 0].get(at % 40 / 2).copied().unwrap_or(0)).collect();
        let flat = Flat { colours, index };
        let fixed = fixed(&flat, 40, &[Treatment::Solid(0), Treatment::Solid(1), LIGHT, Treatment::Solid(5)]);
        assert_eq!(fixed[400..409], [5, 5, 5, 5, TONE, TONE, TONE, TONE, 0]);
    }

    /// Whatever its slope, what is left of a pale hairline is one line, each dot of which touches the next. It is as long as what was drawn.
    #[test]
    fn a_pale_hairline_has_no_gap() {
        const SIDE: usize = 200;
        for degrees in (0..180).step_by(7) {
            let (sin, cos) = f64::from(degrees).to_radians().sin_cos();
            let inside = |x: usize, y: usize| {
                let (x, y) = (x as f64 + 0.5 - SIDE as f64 / 2.0, y as f64 + 0.5 - SIDE as f64 / 2.0);
                (x * sin - y * cos).abs() < 1.5 && (x * cos + y * sin).abs() < 90.0
            };
            let fixed = drawn((SIDE, SIDE), Kind::Drawing, LIGHT, inside);
            let dots: Vec<usize> = (0..SIDE * SIDE).filter(|&at| fixed[at] == 7).collect();
            let middle = |&&at: &&usize| (at % SIDE).abs_diff(SIDE / 2) + (at / SIDE).abs_diff(SIDE / 2);
            let first = *dots.iter().min_by_key(middle).unwrap();
            let (mut seen, mut next) = (vec![first], vec![first]);
            while let Some(at) = next.pop() {
                for &other in &dots {
                    let near =
                        (at % SIDE).abs_diff(other % SIDE) <= 1 && (at / SIDE).abs_diff(other / SIDE) <= 1;
                    if near && !seen.contains(&other) {
                        seen.push(other);
                        next.push(other);
                    }
                }
            }
            let along = |at: &usize| (at % SIDE) as f64 * cos + (at / SIDE) as f64 * sin;
            let (from, to) =
                seen.iter().map(along).fold((f64::MAX, f64::MIN), |(a, b), v| (a.min(v), b.max(v)));
            assert!(to - from > 172.0, "{degrees}: {from} to {to}");
            let drawn = (0..SIDE * SIDE).filter(|&at| inside(at % SIDE, at / SIDE)).count();
            assert!(3 * dots.len() <= 2 * drawn, "{degrees}: {} of {drawn}", dots.len());
        }
    }

    /// A letter of treatment [`DARK`] or [`LIGHT`] on a ground that is printed so, `share` of its border on it and the rest on paper.
    fn on_a_ground(letter: Treatment, wide: usize, ground: Treatment, share: f64) -> Vec<u8> {
        let colours = vec![
            (Kind::Picture, [255; 3]),
            (Kind::Picture, [0; 3]),
            (Kind::Text, [128; 3]),
            (Kind::Drawing, [60; 3]),
        ];
        let index = (0..60 * 60)
            .map(|at| match (at % 60, at / 60) {
                (x, y) if (20..20 + wide).contains(&x) && (10..50).contains(&y) => 2,
                (_, y) if (y as f64) < 10.0 + 40.0 * share => 3,
                _ => 0,
            })
            .collect();
        fixed(&Flat { colours, index }, 60, &[Treatment::Solid(0), Treatment::Solid(1), letter, ground])
    }

    #[test]
    fn what_lies_on_its_own_solid_is_printed_in_the_next() {
        let at = |fixed: &[u8], x: usize| fixed[30 * 60 + x];
        // Thin: in the next stack, or in paper.
        let letter = on_a_ground(DARK, 6, Treatment::Solid(7), 1.0);
        assert_eq!([19, 20, 25, 26].map(|x| at(&letter, x)), [7, 5, 5, 7]);
        let pale = on_a_ground(LIGHT, 6, Treatment::Solid(7), 1.0);
        assert_eq!([19, 20, 25, 26].map(|x| at(&pale, x)), [7, 0, 0, 7]);
        // Wide: its rim is in the next, or there is none.
        let wide = on_a_ground(DARK, 30, Treatment::Solid(7), 1.0);
        assert_eq!([19, 20, 21, 48, 49, 50].map(|x| at(&wide, x)), [7, 5, TONE, TONE, 5, 7]);
        let pale = on_a_ground(LIGHT, 30, Treatment::Solid(7), 1.0);
        assert_eq!([19, 20, 49, 50].map(|x| at(&pale, x)), [7, TONE, TONE, 7]);
        // On another solid, or where its solid is only beside a small part of it, nothing changes.
        let other = on_a_ground(DARK, 6, Treatment::Solid(4), 1.0);
        assert_eq!([19, 20, 25, 26].map(|x| at(&other, x)), [4, 7, 7, 4]);
        let partly = on_a_ground(DARK, 6, Treatment::Solid(7), 0.2);
        assert_eq!(partly[15 * 60 + 22], 7);
        assert_eq!(at(&partly, 22), 7);
        // Of two shapes the nearer to the solid keeps it.
        let ground = |rank| {
            Treatment::Shape(Shape { solids: [7, 0, 0, 0], dark: true, near: true, mixed: 1 << 7, rank })
        };
        assert_eq!(at(&on_a_ground(DARK, 6, ground(3), 1.0), 22), 5);
        assert_eq!(at(&on_a_ground(DARK, 6, ground(12), 1.0), 22), 7);
    }

    #[test]
    fn the_bands_of_a_shading_are_one_wide_shape() {
        // Bands of three dots, each a little lighter.
        let mut colours = vec![(Kind::Picture, [255; 3]), (Kind::Picture, [0; 3])];
        colours.extend((0..20).map(|step| (Kind::Drawing, [40 + 4 * step; 3])));
        let index = (0..60 * 40).map(|at| 2 + (at % 60 / 3) as u8).collect();
        let mut treatments = vec![Treatment::Solid(0), Treatment::Solid(1)];
        treatments.extend([DARK; 20]);
        let fixed = fixed(&Flat { colours, index }, 60, &treatments);
        for (at, &stack) in fixed.iter().enumerate() {
            let rim = at % 60 == 0 || at % 60 == 59 || at / 60 == 0 || at / 60 == 39;
            assert_eq!(stack, if rim { 7 } else { TONE });
        }
    }
}
