//! Letters of one word are printed alike: all solid, or all screened.
//!
//! Problem: a letter is thin or wide by its widest stroke ([`outline`](super::outline)). Where strokes are about as wide as the
//! limit, an O is wider than it and the letters after it are not, and one word is printed in two colours.
//! Method: letters belong together if they are of one colour, near each other, and alike in the width of their strokes. Letters
//! that belong together are thin if most of their dots are of thin letters. Only letters with strokes from half to twice the
//! limit take part: all others are far from it, and so is everything of their fonts.
//! Cost: each such letter is compared with those that end at most a word's space left of it; nothing on pages without them.
//! Limits: a page as Ghostscript tags it knows letters but no words, so near lines of one size are decided together, too, and
//! letters that are spaced more widely than words are decided by themselves.

use std::ops::Range;

use super::flat::Flat;
use super::shapes::{Run, joined};
use sheet::forest::Forest;

/// Letters that are decided by the word they belong to.
pub(super) struct Words {
    /// For each run, the number of the letter it is the root of, or [`NO_LETTER`]. Empty if there is none.
    letter: Vec<u32>,
    /// For each letter, whether it is thin, and how many letters are beside each other there.
    thin: Vec<(bool, usize)>,
}

const NO_LETTER: u32 = u32::MAX;

impl Words {
    /// The words of letters with strokes from so many dots to so many; of `limit` dots or more they are wide.
    pub(super) fn of(
        flat: &Flat,
        (runs, rows): (&[Run], &[usize]),
        (sides, limit): (Range<u8>, u8),
        is_letter: impl Fn(u32) -> bool,
    ) -> Words {
        let is_near = |root: u32| is_letter(root) && sides.contains(&runs[root as usize].side);
        let (mut letter, mut letters) = (Vec::new(), Vec::<Letter>::new());
        for (y, row) in rows.windows(2).enumerate() {
            for run in &runs[row[0]..row[1]] {
                if !is_near(run.root) {
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
        let thin = thin(&letters, limit, |a, b| joined(flat, a, b));
        Words { letter, thin }
    }

    /// Whether the word of the shape with this root is thin; `None` for a shape that is decided by itself.
    pub(super) fn thin(&self, root: u32) -> Option<bool> {
        self.word(root).map(|(thin, _)| thin)
    }

    /// The same where at least so many letters are beside each other.
    pub(super) fn thin_in_a_word_of(&self, least: usize, root: u32) -> Option<bool> {
        self.word(root).filter(|&(_, letters)| letters >= least).map(|(thin, _)| thin)
    }

    fn word(&self, root: u32) -> Option<(bool, usize)> {
        self.letter.get(root as usize).and_then(|&number| self.thin.get(number as usize)).copied()
    }
}

/// A letter whose strokes are near the limit.
#[derive(Clone, Copy, Debug)]
struct Letter {
    /// The number of its colour.
    pub colour: u8,
    /// Left, top, right and bottom in dots; right and bottom are beyond it.
    pub bounds: [u32; 4],
    /// Side of the largest square that fits in its strokes.
    pub side: u8,
    /// How many dots it has.
    pub dots: u32,
}

/// Letters with strokes from `limit / RANGE` to `limit * RANGE` can be in words that have letters on both sides of the limit: within a
/// font, the largest squares in strokes differ by less.
const RANGE: u8 = 2;
/// The space between two words is at most so many strokes of a letter: 4.2 in regular Helvetica, 3 in Times, 2 in bold text.
const SPACE: u32 = 5;
/// That between two letters of a word.
const BESIDE: u32 = 2;

/// The strokes of letters that are decided together with others.
pub(super) const fn near(limit: u8) -> Range<u8> {
    limit / RANGE..limit.saturating_mul(RANGE)
}

/// For each letter, whether it is printed as a thin one, under `limit` dots wide, and how many
/// letters are beside each other there, one after the other. `joined` says whether two colours may be one.
fn thin(letters: &[Letter], limit: u8, joined: impl Fn(u8, u8) -> bool) -> Vec<(bool, usize)> {
    let mut order: Vec<usize> = (0..letters.len()).collect();
    order.sort_by_key(|&at| letters[at].bounds[0]);
    let [mut words, mut rows] = [(); 2].map(|()| Forest::new(letters.len()));
    let mut open: Vec<usize> = Vec::new();
    for &at in &order {
        let letter = &letters[at];
        let most = SPACE * 2 * u32::from(limit);
        open.retain(|&other| letters[other].bounds[2] + most > letter.bounds[0]);
        for &other in &open {
            let near = Some(&letters[other]).filter(|other| joined(letter.colour, other.colour));
            if near.is_some_and(|near| belong_together(letter, near, [SPACE; 2])) {
                words.join(at as u32, other as u32);
            }
            if near.is_some_and(|near| belong_together(letter, near, [BESIDE, 0])) {
                rows.join(at as u32, other as u32);
            }
        }
        open.push(at);
    }
    let (mut thin_dots, mut count) = (vec![0i64; letters.len()], vec![0; letters.len()]);
    let (words, rows) = (words.roots(), rows.roots());
    for ((letter, &word), &row) in letters.iter().zip(&words).zip(&rows) {
        thin_dots[word as usize] += if letter.side < limit { 1 } else { -1 } * i64::from(letter.dots);
        count[row as usize] += 1;
    }
    words.iter().zip(rows).map(|(&word, row)| (thin_dots[word as usize] > 0, count[row as usize])).collect()
}

/// Whether two letters are at most so many strokes apart, across and down, and their strokes alike: within a half; or they begin and end in the same
/// rows, as bars of a code do.
fn belong_together(a: &Letter, b: &Letter, space: [u32; 2]) -> bool {
    let (thinner, wider) = (u32::from(a.side.min(b.side)), u32::from(a.side.max(b.side)));
    let gap = |low: usize, high: usize| {
        a.bounds[low].max(b.bounds[low]).saturating_sub(a.bounds[high].min(b.bounds[high]))
    };
    let are_bars = (1..=3).step_by(2).all(|side| a.bounds[side].abs_diff(b.bounds[side]) <= 1);
    (2 * wider <= 3 * thinner || are_bars) && gap(0, 2) <= space[0] * wider && gap(1, 3) <= space[1] * wider
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMIT: u8 = 24;

    fn letter(left: u32, top: u32, side: u8) -> Letter {
        Letter { colour: 2, bounds: [left, top, left + 100, top + 140], side, dots: 6000 }
    }

    fn decided(letters: &[Letter]) -> Vec<bool> {
        thin(letters, LIMIT, |a, b| a == b).into_iter().map(|(thin, _)| thin).collect()
    }

    #[test]
    fn a_word_is_what_most_of_its_dots_are() {
        let word = |sides: [u8; 4]| {
            let letters = (0..4).map(|at| letter(120 * at, 0, sides[at as usize]));
            decided(&letters.collect::<Vec<_>>())
        };
        assert_eq!(word([25, 22, 21, 23]), [true; 4]);
        assert_eq!(word([25, 26, 21, 25]), [false; 4]);
        assert_eq!(word([20, 21, 22, 23]), [true; 4]);
        assert_eq!(word([24, 25, 26, 27]), [false; 4]);
        // The order in which they are found does not matter.
        let backwards: Vec<Letter> =
            (0..4).rev().map(|at| letter(120 * at, 0, [25, 22, 21, 23][at as usize])).collect();
        assert_eq!(decided(&backwards), [true; 4]);
    }

    #[test]
    fn letters_beside_each_other_are_a_row_and_arrows_in_a_field_are_none() {
        let rows = |across: u32, down: u32| {
            let letters: Vec<Letter> = (0..4).map(|at| letter((100 + across) * at, down * at, 12)).collect();
            thin(&letters, LIMIT, |a, b| a == b).into_iter().map(|(_, row)| row).collect::<Vec<_>>()
        };
        assert_eq!(rows(24, 0), [4; 4]);
        assert_eq!(rows(25, 0), [1; 4]);
        assert_eq!(rows(10, 141), [1; 4]);
    }

    #[test]
    fn a_word_ends_at_a_wide_space_another_colour_and_another_size() {
        // A word's space apart, on one line and on two, and a dot more.
        let apart = |across: u32, down: u32| {
            decided(&[letter(0, 0, 24), letter(100 + across, 0, 20), letter(0, 140 + down, 20)])
        };
        assert_eq!(apart(120, 120), [true; 3]);
        assert_eq!(apart(121, 120), [false, true, false]);
        assert_eq!(apart(120, 121), [false, false, true]);
        // Bars of a code have strokes of one to four modules.
        let bar = |left: u32, side: u8| Letter {
            bounds: [left, 9, left + u32::from(side), 99],
            side,
            ..letter(0, 0, side)
        };
        assert_eq!(decided(&[bar(0, 18), bar(24, 6), bar(36, 24), bar(66, 6)]), [true; 4]);
        let mut other = letter(110, 0, 20);
        other.colour = 3;
        assert_eq!(decided(&[letter(0, 0, 25), other]), [false, true]);
        // An initial beside text of half its size.
        let mut initial = letter(0, 0, 40);
        (initial.dots, initial.bounds[3]) = (60_000, 280);
        assert_eq!(decided(&[initial, letter(110, 0, 20)]), [false, true]);
        assert_eq!(near(LIMIT), 12..48);
    }
}
