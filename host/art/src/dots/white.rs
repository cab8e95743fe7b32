//! Where white goes when the art does not draw it.
//!
//! Problem: transparent inks need white beneath them on anything but white paper. What "beneath the art" means depends on the
//! art: the white of an eye may be pure white, and a hole may be intended.
//! Method: [`White`] lists the usual choices. A silhouette is everything that cannot be reached from outside the art
//! through undrawn dots, in steps up, down, left and right. Runs of undrawn dots in each row are joined to the runs they
//! touch in the next row (union-find); all runs joined to the border are outside.
//! Cost: one scan of the bits, and a few bytes a run. Limits: a silhouette leaks through a gap in its outline.

use std::fmt;

use serde::Serialize;

use crate::dots::bitplane;
use sheet::Plane;
use sheet::forest::Forest;

/// Where white goes beneath the art.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum White {
    /// No white at all, not even where the art draws it.
    None,
    /// Under every dot of every ink.
    Under,
    /// Where the picture has the vendor's reserved white, 230,230,230.
    Reserved,
    /// Where the picture is neither pure white nor transparent.
    Opaque,
    /// Everything inside the outline, including holes and white areas.
    Silhouette,
    /// Where the picture is at least half opaque, including pure white.
    Alpha,
}

impl fmt::Display for White {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            White::None => "none",
            White::Under => "under",
            White::Reserved => "reserved",
            White::Opaque => "opaque",
            White::Silhouette => "silhouette",
            White::Alpha => "alpha",
        })
    }
}

/// A stretch of a row on which nothing is drawn.
struct Run {
    from: usize,
    to: usize,
}

/// The plane with everything inside its outlines filled.
pub(crate) fn silhouette(drawn: &Plane) -> Plane {
    let (width, length) = (drawn.width, drawn.length);
    // Run 0 is outside.
    let (mut runs, mut regions) = (vec![Run { from: 0, to: 0 }], Forest::new(1));
    let mut rows = Vec::with_capacity(length + 1);
    for y in 0..length {
        rows.push(runs.len());
        let row = &drawn.bits[y * drawn.stride..][..drawn.stride];
        let mut x = 0;
        while x < width {
            // Eight dots at a time where all are drawn, and below, eight where none is drawn.
            if x.is_multiple_of(8) && row[x / 8] == 0xff {
                x += 8;
                continue;
            }
            if row[x / 8] & 0x80 >> (x % 8) != 0 {
                x += 1;
                continue;
            }
            let from = x;
            while x < width {
                if x.is_multiple_of(8) && row[x / 8] == 0 {
                    x += 8;
                } else if row[x / 8] & 0x80 >> (x % 8) == 0 {
                    x += 1;
                } else {
                    break;
                }
            }
            let to = x.min(width);
            runs.push(Run { from, to });
            let number = regions.add();
            if y == 0 || y + 1 == length || from == 0 || to == width {
                regions.join(0, number);
            }
        }
    }
    rows.push(runs.len());
    for y in 1..length {
        let (mut a, mut b) = (rows[y - 1], rows[y]);
        while a < rows[y] && b < rows[y + 1] {
            if runs[a].from < runs[b].to && runs[b].from < runs[a].to {
                regions.join(a as u32, b as u32);
            }
            if runs[a].to < runs[b].to { a += 1 } else { b += 1 }
        }
    }
    let regions = regions.roots();
    let mut filled = bitplane::full(width, length);
    for (y, row) in filled.bits.chunks_exact_mut(drawn.stride.max(1)).take(length).enumerate() {
        let here = rows[y]..rows[y + 1];
        for (run, _) in runs[here.clone()].iter().zip(&regions[here]).filter(|(_, root)| **root == 0) {
            clear(row, run.from, run.to);
        }
    }
    filled
}

fn clear(row: &mut [u8], from: usize, to: usize) {
    let mut x = from;
    while x < to {
        if x.is_multiple_of(8) && x + 8 <= to {
            row[x / 8] = 0;
            x += 8;
        } else {
            row[x / 8] &= !(0x80 >> (x % 8));
            x += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn plane(width: usize, rows: &[&str]) -> Plane {
        bitplane::from_bytes(width, rows.concat().as_bytes(), |byte| byte == b'#')
    }

    /// Walks from the border step by step.
    fn flooded(drawn: &Plane) -> Vec<bool> {
        let (width, length) = (drawn.width, drawn.length);
        let mut outside = vec![false; width * length];
        let mut stack: Vec<(usize, usize)> = (0..length)
            .flat_map(|y| (0..width).map(move |x| (x, y)))
            .filter(|&(x, y)| x == 0 || y == 0 || x + 1 == width || y + 1 == length)
            .collect();
        while let Some((x, y)) = stack.pop() {
            if outside[y * width + x] || bitplane::at(drawn, x, y) {
                continue;
            }
            outside[y * width + x] = true;
            let steps = [(x.wrapping_sub(1), y), (x + 1, y), (x, y.wrapping_sub(1)), (x, y + 1)];
            stack.extend(steps.into_iter().filter(|&(x, y)| x < width && y < length));
        }
        outside
    }

    #[test]
    fn the_white_of_an_eye_is_inside_and_a_gap_in_the_outline_leaks() {
        let eye = plane(7, &[".......", ".#####.", ".#...#.", ".#.#.#.", ".#...#.", ".#####.", "......."]);
        let filled = silhouette(&eye);
        assert!((2..5).all(|y| (1..6).all(|x| bitplane::at(&filled, x, y))) && filled.dots() == 25);
        let open = plane(7, &[".......", ".##.##.", ".#...#.", ".#.#.#.", ".#...#.", ".#####.", "......."]);
        assert_eq!(silhouette(&open), open);
        // Outlines hold at corners: the walk outside takes no diagonal steps.
        let diamond = plane(5, &["..#..", ".#.#.", "#...#", ".#.#.", "..#.."]);
        assert_eq!(silhouette(&diamond).dots(), 13);
    }

    proptest! {
        #[test]
        fn what_cannot_be_reached_from_the_border_is_filled(
            width in 1usize..70, length in 1usize..40, seed: u32, dense in 20u32..80
        ) {
            let random = |i: usize| (i as u32 ^ seed).wrapping_mul(0x9e37_79b1) >> 11;
            let bytes: Vec<u8> = (0..width * length).map(|i| u8::from(random(i) % 100 < dense)).collect();
            let drawn = bitplane::from_bytes(width, &bytes, |byte| byte == 1);
            let (filled, outside) = (silhouette(&drawn), flooded(&drawn));
            for (dot, outside) in outside.into_iter().enumerate() {
                prop_assert_eq!(bitplane::at(&filled, dot % width, dot / width), !outside, "dot {}", dot);
            }
        }
    }
}
