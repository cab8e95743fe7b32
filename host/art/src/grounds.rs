//! What the shapes of colours that no stack prints lie on.
//!
//! Problem: a letter vanishes in a ground that is printed as its solid, a rim of ink spoils a white letter on ink, and a soft edge is no line.
//! Method: of each shape the dots beside it that are of other shapes are counted, by the stacks that they are printed as ([`Grounds`])
//! or by their colours ([`lies`], [`steps`]).
//! Cost: 2 ns a dot of shapes, twice where solids may meet and there are pale shapes. Limits: contact is that of four neighbours.

use std::collections::{HashMap, HashSet};
use std::ops::RangeInclusive;

use super::flat::{Flat, INKED, is_tone, similar};
use super::kinds::ObjectType;
use super::looks::{Looks, Seen, is_faint, is_hidden};
use super::shapes::{Run, continues};
use super::softened::along;
use super::treatments::{CHOICES, Shape, Treatment};

/// The least share of the border of what lies on ink, and of what lies on another colour.
const ON_INK: f64 = 7.0 / 8.0;
const ON_ONE: f64 = 3.0 / 4.0;

/// What is a shape's ground is at least one in so many dots of its border.
const PART: u32 = 8;

/// Where between the colours on both sides of it a step of a shading lies.
const MIDST: RangeInclusive<f32> = 0.1..=0.9;

/// The stack without ink.
pub(super) const PAPER: u8 = 0;

/// What a pale shape lies on.
#[derive(PartialEq, Eq)]
pub(super) enum Lies {
    /// On ink, by nearly all of its border.
    OnInk,
    /// On one paler colour, or one that is as pale, by most of it.
    OnOneColour,
    /// Between colours, as a soft edge does, or on one that is like it, as a ripple.
    Between,
}

/// Whether most of what is printed so is ink. A shading or a picture is none of these.
pub(super) fn has_ink(treatment: Option<Treatment>) -> bool {
    match treatment {
        Some(Treatment::Solid(stack)) => stack != PAPER,
        Some(Treatment::Shape(shape)) => shape.dark,
        None => false,
    }
}

/// What shapes lie on, by their roots. Only runs that take part are looked at.
pub(super) fn lies(
    flat: &Flat,
    width: usize,
    treatments: &[Treatment],
    (runs, rows): (&[Run], &[usize]),
    takes_part: impl Fn(&Run) -> bool,
) -> HashMap<u32, Lies> {
    let borders = borders(flat, width, (runs, rows), takes_part);
    // Of what is not tagged as text it is not known whether it is a part of the tone beside it.
    let has_ink = |beside: u8, kind: ObjectType| match beside {
        INKED => kind == ObjectType::Text,
        colour => has_ink(treatments.get(usize::from(colour)).copied()),
    };
    let judge = |root: u32, border: HashMap<u8, u32>| {
        let all: u32 = border.values().sum();
        let (kind, own) = flat.colours[usize::from(runs[root as usize].colour)];
        let (inked, pale): (Vec<_>, Vec<_>) =
            border.into_iter().partition(|&(beside, _)| has_ink(beside, kind));
        let inked: u32 = inked.iter().map(|&(_, dots)| dots).sum();
        // Beside what filters sharpened there are ripples in all tints. What is no colour is a shading or a picture.
        let is_ripple = |&(beside, _): &(u8, u32)| {
            let is_like = |&(_, colour): &(ObjectType, [u8; 3])| similar(colour, own);
            treatments.get(usize::from(beside)) != Some(&Treatment::Solid(PAPER))
                && flat.colours.get(usize::from(beside)).is_none_or(is_like)
        };
        let most = pale.iter().filter(|beside| !is_ripple(beside)).map(|&(_, dots)| dots).max().unwrap_or(0);
        if inked > 0 && f64::from(inked) >= ON_INK * f64::from(all) {
            Lies::OnInk
        } else if f64::from(most) >= ON_ONE * f64::from(all) {
            Lies::OnOneColour
        } else {
            Lies::Between
        }
    };
    borders.into_iter().map(|(root, border)| (root, judge(root, border))).collect()
}

/// The roots of shapes that are a step of a shading: of two colours that each make up a quarter or more of their border, one is lighter and one
/// darker, and their own lies on the line between them. Only runs that take part are looked at.
pub(super) fn steps(
    flat: &Flat,
    width: usize,
    (runs, rows): (&[Run], &[usize]),
    takes_part: impl Fn(&Run) -> bool,
) -> HashSet<u32> {
    let borders = borders(flat, width, (runs, rows), takes_part);
    let is_step = |root: u32, border: &HashMap<u8, u32>| {
        let all: u32 = border.values().sum();
        let own = flat.colours[usize::from(runs[root as usize].colour)].1;
        let large = border.iter().filter(|&(_, &dots)| 4 * dots >= all);
        let large: Vec<[u8; 3]> =
            large.filter_map(|(&beside, _)| Some(flat.colours.get(usize::from(beside))?.1)).collect();
        large.iter().enumerate().any(|(at, &from)| {
            large[at + 1..]
                .iter()
                .any(|&to| along(own, from, to).is_some_and(|(share, _)| MIDST.contains(&share)))
        })
    };
    borders.iter().filter(|&(&root, border)| is_step(root, border)).map(|(&root, _)| root).collect()
}

/// Of the border of the shape that a run is the root of, the dots of other shapes.
#[derive(Clone, Default)]
struct Border {
    all: u32,
    /// Those that are printed as each of its stacks.
    stacks: [u32; CHOICES],
    /// Those in colours that it hardly differs from, and those that nobody can tell from it.
    faint: u32,
    hidden: u32,
    contrast: Contrast,
}

/// Of the border of a shape, or of all shapes of its colour on the same grounds.
#[derive(Clone, Copy, Default)]
struct Contrast {
    all: u32,
    /// The dots on which each of its stacks would not be seen as the shape's colour, and those on which not even faintly.
    faint_on: [u32; CHOICES],
    lost_on: [u32; CHOICES],
}

impl Contrast {
    fn add(&mut self, other: &Contrast) {
        self.all += other.all;
        for at in 0..CHOICES {
            self.faint_on[at] += other.faint_on[at];
            self.lost_on[at] += other.lost_on[at];
        }
    }

    /// Whether a stack is seen on one part of the border, and not on another.
    fn is_mixed(&self) -> bool {
        self.faint_on.iter().any(|dots| (1..self.all).contains(dots))
    }
}

/// The bits of a pair of colours: one for each stack that the other is printed as, one for each that would not be seen on it as asked, one for
/// each that would be lost, and whether the colours hardly differ, or not at all.
const WEAK: usize = CHOICES;
const LOST: usize = 2 * CHOICES;
const FAINT: u16 = 1 << (3 * CHOICES);
const HIDDEN: u16 = FAINT << 1;

/// What shapes lie on, where one of them may lie on its own solid.
pub(super) struct Grounds {
    border: Vec<Border>,
}

impl Grounds {
    /// Counts the borders; `None` if every colour can be told from all others as its nearest stack.
    pub(super) fn of(
        flat: &Flat,
        width: usize,
        (treatments, looks): (&[Treatment], &Looks<'_>),
        (runs, rows): (&[Run], &[usize]),
    ) -> Option<Grounds> {
        let shape = |colour: u8| match treatments.get(usize::from(colour)) {
            Some(Treatment::Shape(shape)) => Some(shape),
            _ => None,
        };
        // The stacks of a shape that dots of another colour are printed as, a bit each.
        let meet = |shape: &Shape, beside: u8| -> u16 {
            let (stack, yields) = match treatments.get(usize::from(beside)) {
                Some(&Treatment::Solid(stack)) => (stack, true),
                Some(Treatment::Shape(other)) => (other.solids[0], other.dark && other.rank < shape.rank),
                None => return 0,
            };
            let same = shape.solids.iter().enumerate().filter(|&(_, &solid)| yields && solid == stack);
            same.fold(0, |bits, (at, _)| bits | 1 << at)
        };
        let colour = |of: u8| flat.colours.get(usize::from(of)).map(|&(_, colour)| colour);
        let met: Vec<u16> = (0..=255u8)
            .flat_map(|own| (0..=255u8).map(move |beside| (own, beside)))
            .map(|(own, beside)| {
                let Some(shape) = shape(own).filter(|_| own != beside && !continues(flat, own, beside))
                else {
                    return 0;
                };
                let Some((a, b)) = colour(own).zip(colour(beside)) else { return 0 };
                let bits =
                    meet(shape, beside) | unseen(shape.solids.map(|stack| looks.seen(own, beside, stack)));
                match bits {
                    _ if is_hidden(a, b) => bits | FAINT | HIDDEN,
                    0 => 0,
                    bits if is_faint(a, b) => bits | FAINT,
                    bits => bits,
                }
            })
            .collect();
        if !looks.has_tones() && met.iter().all(|bits| bits & (1 | 1 << WEAK | HIDDEN) == 0) {
            return None;
        }
        let on_tone = |own: u8, at: usize| -> u16 {
            let Some(shape) = shape(own) else { return 0 };
            let Some((seen, tone)) = looks.seen_on_tone(own, at, shape.solids) else { return 0 };
            let bits = unseen(seen);
            let is_faint = bits != 0 && colour(own).is_some_and(|own| is_faint(own, tone));
            bits | if is_faint { FAINT } else { 0 }
        };
        let mut border = vec![Border::default(); runs.len()];
        each_beside(flat, width, (runs, rows), |run, at| {
            let Border { all, stacks, faint, hidden, contrast } = &mut border[run.root as usize];
            *all += 1;
            contrast.all += 1;
            let bits = match flat.index[at] {
                beside if is_tone(beside) => on_tone(run.colour, at),
                beside => met[256 * usize::from(run.colour) + usize::from(beside)],
            };
            *faint += u32::from(bits & FAINT != 0);
            *hidden += u32::from(bits & HIDDEN != 0);
            let count = |counts: &mut [u32; CHOICES], first: usize| {
                counts
                    .iter_mut()
                    .enumerate()
                    .for_each(|(at, dots)| *dots += u32::from(bits >> (first + at) & 1));
            };
            count(stacks, 0);
            count(&mut contrast.faint_on, WEAK);
            count(&mut contrast.lost_on, LOST);
        });
        judge_alike(flat, width, (runs, rows), &mut border);
        Some(Grounds { border })
    }

    /// The solid of a shape: the nearest that it does not lie on, and, if it `stands` for the colour alone, that is seen as it; if the shape hardly
    /// differs from what it lies on, only of the mild ones, and none if nobody can tell them apart.
    pub(super) fn solid(&self, root: u32, shape: &Shape, stands: bool) -> Option<u8> {
        let Border { all, stacks, faint, hidden, contrast } = &self.border[root as usize];
        let all = (*all).max(1);
        if 2 * hidden >= all {
            return None;
        }
        let allowed = if 2 * faint >= all { shape.mild } else { u8::MAX };
        let free = || (0..CHOICES).filter(|&at| allowed >> at & 1 == 1 && 2 * stacks[at] < all);
        let seen = match stands {
            true => {
                let fewer = |dots: &[u32; CHOICES]| free().find(|&at| 2 * dots[at] < contrast.all.max(1));
                fewer(&contrast.faint_on).or_else(|| fewer(&contrast.lost_on))
            }
            false => free().next(),
        };
        seen.map(|at| shape.solids[at])
    }
}

/// Shapes of one colour that lie on the same grounds have the contrast of all of them: of letters with a shadow half lie on white and half on the
/// shadow, some a little more and some a little less.
fn judge_alike(flat: &Flat, width: usize, (runs, rows): (&[Run], &[usize]), border: &mut [Border]) {
    let is_mixed: Vec<bool> = border.iter().map(|border| border.contrast.is_mixed()).collect();
    if !is_mixed.contains(&true) {
        return;
    }
    let mut alike: HashMap<(u8, Vec<u8>), (Contrast, Vec<u32>)> = HashMap::new();
    for (root, beside) in borders(flat, width, (runs, rows), |run| is_mixed[run.root as usize]) {
        let Border { all, contrast, .. } = &border[root as usize];
        let large = beside.into_iter().filter(|&(_, dots)| PART * dots >= *all).map(|(colour, _)| colour);
        let mut grounds: Vec<u8> = large.collect();
        grounds.sort_unstable();
        let (sum, roots) = alike.entry((runs[root as usize].colour, grounds)).or_default();
        sum.add(contrast);
        roots.push(root);
    }
    for (sum, roots) in alike.into_values() {
        roots.into_iter().for_each(|root| border[root as usize].contrast = sum);
    }
}

/// The bits of what is not seen as asked, and of what is lost.
fn unseen(seen: [Seen; CHOICES]) -> u16 {
    seen.into_iter().enumerate().fold(0, |bits, (at, seen)| match seen {
        Seen::AsAsked => bits,
        Seen::Faintly => bits | 1 << (WEAK + at),
        Seen::Otherwise => bits | 1 << (WEAK + at) | 1 << (LOST + at),
    })
}

/// Of shapes, by their roots, how many dots of each colour lie beside them. Only runs that take part are looked at.
fn borders(
    flat: &Flat,
    width: usize,
    shapes: (&[Run], &[usize]),
    takes_part: impl Fn(&Run) -> bool,
) -> HashMap<u32, HashMap<u8, u32>> {
    let mut borders: HashMap<u32, HashMap<u8, u32>> = HashMap::new();
    each_beside(flat, width, shapes, |run, at| {
        if takes_part(run) {
            *borders.entry(run.root).or_default().entry(flat.index[at]).or_default() += 1;
        }
    });
    borders
}

/// Calls `with` for each dot that is beside a run, and of another shape, with its number.
fn each_beside(
    flat: &Flat,
    width: usize,
    (runs, rows): (&[Run], &[usize]),
    mut with: impl FnMut(&Run, usize),
) {
    for (y, row) in rows.windows(2).enumerate() {
        for run in &runs[row[0]..row[1]] {
            let (start, end, line) = (run.start as usize, run.end as usize, y * width);
            let ends = [start.checked_sub(1), (end < width).then_some(end)];
            let lines = [y.checked_sub(1), (y + 2 < rows.len()).then_some(y + 1)];
            let ends = ends.into_iter().flatten().map(|x| line + x);
            let upright = lines.into_iter().flatten().flat_map(|y| y * width + start..y * width + end);
            for at in ends.chain(upright) {
                let beside = flat.index[at];
                if beside != run.colour && !continues(flat, run.colour, beside) {
                    with(run, at);
                }
            }
        }
    }
}
