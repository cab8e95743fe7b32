//! Lines that hang on wide shapes: the curve between the markers of a plot.
//!
//! Problem: a shape is as wide as its widest place, so that a line with a marker on it is screened all along, and becomes a row of dots.
//! Method: the opening of the shape by the square that tells wide from thin (Serra 1982): what no such square in it covers is
//! thin. Such parts are lines if they are long; short ones are the corners that squares do not reach into. Squares are narrow across a slanting
//! stroke, so its width is found from its chords along a row and a column. What lies amid more of its shape, cut by something else than paper, is
//! ground: between hatching, contours and the strands of hair. Where the shape is mostly lines, small wide parts are where they turn or cross.
//! Cost: 4 ns a dot of wide shapes, 200 ns a stretch of what may be a line. Memory: four bytes a dot of a row, 40 a stretch.
//! Limits: a line is decided apart from its shape only if it is [`LONG`] squares long, and not if the shape is large: the ground
//! between two letters is no line.

use std::collections::{HashMap, HashSet};
use std::ops::Range;

use super::flat::Flat;
use super::shapes::{Run, Shapes, continues};
use sheet::forest::Forest;

/// A line is at least so many times longer than it may be wide.
const LONG: u32 = 3;
/// Lines make at least one in so many dots of their shape. Between letters on a ground are thin parts of it, too: a tenth of it.
const PART: u64 = 6;

/// What is left of a shape that is half lines or more is one of their corners, if it is at most so many times as wide and high as a line may be.
const CORNER: u32 = 3;

/// How far to both sides of a stretch more of its shape is looked for, in widths of a line.
const NEAR: usize = 3;
/// What has so much of its shape in all directions is no line: lines of half of the distance between them have half.
const GROUND: f32 = 0.4;

/// A stretch of a line.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Line {
    /// The run that it is a part of.
    pub run: u32,
    pub row: u32,
    pub start: u32,
    pub end: u32,
}

/// The lines that hang on shapes with a root that `is_wide`. `stroke` is the side of the squares in [`Shapes::cores`], and `is_bare` is asked of
/// colours.
pub(super) fn lines(
    shapes: &Shapes,
    (flat, width): (&Flat, usize),
    stroke: u8,
    is_wide: impl Fn(u32) -> bool,
    is_bare: impl Fn(u8) -> bool,
) -> Vec<Line> {
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
    let (roots, size) = parts.sizes(|a, b| is_thin[a] == is_thin[b]);
    let is_long = |at: usize| is_thin[at] && size[at] >= LONG * u32::from(stroke);
    // Of each long part how many dots are slender, and how many others.
    let mut balance = vec![0i64; found.len()];
    let look = Look { flat, width, stroke: stroke.into() };
    for at in (0..found.len()).filter(|&at| is_long(at)) {
        let part = &found[at];
        let dots = i64::from(part.end - part.start);
        let is_slender = look.is_slender(part, &runs[part.run as usize], &is_bare);
        balance[roots[at] as usize] += if is_slender { dots } else { -dots };
    }
    let is_line = |at: usize| is_long(at) && balance[roots[at] as usize] > 0;
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
    let (_, size) = parts.sizes(|a, b| line[a] == line[b]);
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

    /// For each stretch the root of what it hangs together with of its shape and belongs `together`, and the width or height of that, whichever is
    /// more.
    fn sizes(&self, together: impl Fn(usize, usize) -> bool) -> (Vec<u32>, Vec<u32>) {
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
        let sizes = roots.iter().map(|&root| size(bounds[root as usize])).collect();
        (roots, sizes)
    }
}

/// The width of a slanting stroke from its chords along a row and a column: the height of the right triangle of these.
fn across_slant(row: f32, column: f32) -> f32 {
    row * column / row.hypot(column)
}

/// The shapes among these, by their roots, that are as wide as `stroke` or more across, though no square of it fits in them because they slant: by
/// most of their dots.
pub(super) fn slanting(
    (runs, rows): (&[Run], &[usize]),
    (flat, width): (&Flat, usize),
    stroke: u8,
    takes_part: impl Fn(u32) -> bool,
) -> HashSet<u32> {
    let far = 2 * usize::from(stroke);
    let mut balance: HashMap<u32, i64> = HashMap::new();
    for (y, row) in rows.windows(2).enumerate() {
        for run in runs[row[0]..row[1]].iter().filter(|run| takes_part(run.root)) {
            let middle = y * width + (run.start + run.end) as usize / 2;
            let is_own =
                |at: &usize| flat.index.get(*at).is_some_and(|&dot| continues(flat, run.colour, dot));
            let up = (1..=far.min(y)).map(|step| middle - step * width).take_while(is_own).count();
            let down = (1..=far).map(|step| middle + step * width).take_while(is_own).count();
            let dots = run.end - run.start;
            let is_wide = across_slant(dots as f32, (1 + up + down) as f32) >= f32::from(stroke);
            *balance.entry(run.root).or_default() += if is_wide { 1 } else { -1 } * i64::from(dots);
        }
    }
    balance.into_iter().filter(|&(_, dots)| dots > 0).map(|(root, _)| root).collect()
}

/// What is seen from the middle of a stretch to one side.
#[derive(Default)]
struct Way {
    /// Dots looked at, those that continue its shape, and those up to the first that does not, and that one's colour.
    all: usize,
    own: usize,
    chord: usize,
    beside: Option<u8>,
}

/// The surroundings of stretches.
struct Look<'a> {
    flat: &'a Flat,
    width: usize,
    stroke: usize,
}

impl Look<'_> {
    /// Whether the middle of a stretch of a run is of a line: narrow, and no ground that something else than paper cuts.
    fn is_slender(&self, part: &Line, run: &Run, is_bare: impl Fn(u8) -> bool) -> bool {
        let Look { flat, width, stroke } = self;
        let (x, y) = ((part.start + part.end) as usize / 2, part.row as usize);
        let middle = y * width + x;
        let length = flat.index.len() / width;
        let far = NEAR * stroke;
        // The colours to both ends of a row and of a column, from the middle.
        let ways: [&mut dyn Iterator<Item = usize>; 4] = [
            &mut (1..=far.min(x)).map(|step| middle - step),
            &mut (1..=far.min(width - 1 - x)).map(|step| middle + step),
            &mut (1..=far.min(y)).map(|step| middle - step * width),
            &mut (1..=far.min(length - 1 - y)).map(|step| middle + step * width),
        ];
        let [left, right, up, down] = ways.map(|way| {
            let mut seen = Way::default();
            for colour in way.map(|at| flat.index[at]) {
                let is_own = continues(flat, run.colour, colour);
                seen.all += 1;
                seen.own += usize::from(is_own);
                match seen.beside {
                    None if is_own => seen.chord += 1,
                    None => seen.beside = Some(colour),
                    Some(_) => {}
                }
            }
            seen
        });
        let chord = |a: &Way, b: &Way| (1 + a.chord + b.chord) as f32;
        let share = |a: &Way, b: &Way| (1 + a.own + b.own) as f32 / (1 + a.all + b.all) as f32;
        let is_narrow = across_slant(chord(&left, &right), chord(&up, &down)) < *stroke as f32;
        let beside = || [&left, &right, &up, &down].into_iter().filter_map(|way| way.beside);
        let bare = beside().filter(|&colour| is_bare(colour)).count();
        let drawn = beside().count() - bare;
        let is_ground = share(&left, &right).min(share(&up, &down)) >= GROUND && drawn > bare;
        is_narrow && !is_ground
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kinds::ObjectType;
    use crate::shapes::shapes;

    const SIDE: usize = 80;
    const STROKE: u8 = 9;

    /// The dots of lines in a drawing of the dots that satisfy `is`.
    fn drawn(is: impl Fn(usize, usize) -> bool) -> Vec<bool> {
        drawn_on(0, is)
    }

    /// The same on another ground than paper.
    fn drawn_on(ground: u8, is: impl Fn(usize, usize) -> bool) -> Vec<bool> {
        let index = (0..SIDE * SIDE).map(|at| if is(at % SIDE, at / SIDE) { 2 } else { ground }).collect();
        let colours = vec![
            (ObjectType::Picture, [255; 3]),
            (ObjectType::Picture, [0; 3]),
            (ObjectType::Drawing, [128; 3]),
        ];
        let mut shaped = [false; 256];
        shaped[2] = true;
        let flat = Flat { colours, index };
        let all = shapes(&flat, SIDE, (&shaped, STROKE));
        let mut dots = vec![false; SIDE * SIDE];
        let is_wide = |root: u32| all.runs[root as usize].side >= STROKE;
        for line in lines(&all, (&flat, SIDE), STROKE, is_wide, |colour| colour == 0) {
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

    /// Bars at many angles, to both sides of the limit: a square of nine dots fits in none that slants much.
    #[test]
    fn a_slanting_bar_is_as_wide_as_it_is_across() {
        for degrees in (20..=70).step_by(5) {
            let (sin, cos) = f64::from(degrees).to_radians().sin_cos();
            for (across, is_wide) in [(7.5, false), (8.2, false), (9.8, true), (10.5, true)] {
                let is = |at: usize| {
                    let (x, y) = ((at % SIDE) as f64 - 39.7, (at / SIDE) as f64 - 39.4);
                    (x * sin + y * cos).abs() < across / 2.0 && (x * cos - y * sin).abs() < 36.0
                };
                let index = (0..SIDE * SIDE).map(|at| 2 * u8::from(is(at))).collect();
                let colours = vec![
                    (ObjectType::Picture, [255; 3]),
                    (ObjectType::Picture, [0; 3]),
                    (ObjectType::Drawing, [128; 3]),
                ];
                let flat = Flat { colours, index };
                let mut shaped = [false; 256];
                shaped[2] = true;
                let all = shapes(&flat, SIDE, (&shaped, STROKE));
                let found = slanting((&all.runs, &all.rows), (&flat, SIDE), STROKE, |_| true);
                assert_eq!(found.len(), usize::from(is_wide), "{across} dots across at {degrees} degrees");
            }
        }
    }

    #[test]
    fn the_ground_between_letters_is_no_line() {
        // Stems 40 dots high, six dots apart, on a ground.
        let stem = |x: usize, y: usize| (20..60).contains(&y) && (20..60).contains(&x) && x % 10 < 4;
        assert!(!drawn(|x, y| !stem(x, y)).contains(&true));
    }

    /// A tint between hatching was printed in paper or in its ink. The same between bare lines is lines.
    #[test]
    fn what_is_left_of_a_ground_between_lines_is_ground() {
        let is = |x: usize, y: usize| y < 20 || x % 8 < 5;
        for (between, is_line) in [(0, true), (1, false)] {
            let found = drawn_on(between, is);
            assert_eq!(found[50 * SIDE + 42], is_line, "between lines in colour {between}");
        }
    }

    /// A square of nine dots fits in a ring 9.4 dots wide where it is level or upright, and in a slanting stroke only from 12.7 on.
    #[test]
    fn a_ring_is_one_stroke_all_around() {
        for radius in [33.0f64, 36.0, 38.5] {
            for stroke in [9.4, 9.9, 11.0, 12.5] {
                let is = |x: usize, y: usize| {
                    let far = (x as f64 - 39.5).hypot(y as f64 - 39.5);
                    (radius - stroke..radius).contains(&far)
                };
                assert!(!drawn(is).contains(&true), "{radius}, {stroke}");
            }
        }
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
