//! Pieces of a fill that lines cut off.
//!
//! Problem: what a grid line or a hatch cuts off of a fill is narrow, but no stroke: printed in a solid it would be a blot beside its own fill.
//! Method: a narrow shape is a piece if beyond a third of its border, across at most [`GAP`] dots that are not bare, there is a wide
//! shape of its colour, or another piece.
//! Cost: some nanoseconds a dot of the borders of narrow shapes. Memory: 8 bytes for each of these. Limits: a frame beside its like is none, if
//! what lies between is bare paper.

use std::collections::HashMap;

use super::flat::Flat;
use super::shapes::{Run, continues};
use sheet::forest::Forest;

/// A line that cuts is at most so many dots wide.
const GAP: usize = 9;

/// The narrow shapes, by their roots, that are pieces. `is_narrow` is asked of the runs, `is_bare` of colours.
pub(super) fn pieces(
    flat: &Flat,
    width: usize,
    (runs, rows): (&[Run], &[usize]),
    is_narrow: impl Fn(&Run) -> bool,
    is_bare: impl Fn(u8) -> bool,
) -> Vec<u32> {
    let colour = |x: usize, y: usize| flat.index[y * width + x];
    let root_at = |x: usize, y: usize| {
        let row = &runs[rows[y]..rows[y + 1]];
        let at = row.partition_point(|run| run.end as usize <= x);
        row.get(at).filter(|run| run.start as usize <= x).map(|run| run.root)
    };
    // The border of each narrow shape, and what lies beyond it there.
    let mut borders: HashMap<u32, (u32, HashMap<u32, u32>)> = HashMap::new();
    for (y, row) in rows.windows(2).enumerate() {
        for run in runs[row[0]..row[1]].iter().filter(|run| is_narrow(run)) {
            let own = run.colour;
            let (border, beyond) = borders.entry(run.root).or_default();
            let mut look = |from: (usize, usize), (right, down): (isize, isize)| {
                let dot = |step: usize| {
                    let step = step as isize;
                    let x = from.0.checked_add_signed(right * step).filter(|&x| x < width)?;
                    let y = from.1.checked_add_signed(down * step).filter(|&y| y + 1 < rows.len())?;
                    Some((x, y))
                };
                if dot(1).is_some_and(|(x, y)| continues(flat, own, colour(x, y))) {
                    return;
                }
                *border += 1;
                let there = (1..=GAP + 1)
                    .map_while(dot)
                    .take_while(|&(x, y)| !is_bare(colour(x, y)))
                    .find(|&(x, y)| continues(flat, own, colour(x, y)));
                if let Some(root) = there.and_then(|(x, y)| root_at(x, y)).filter(|&root| root != run.root) {
                    *beyond.entry(root).or_default() += 1;
                }
            };
            let (first, last) = (run.start as usize, run.end as usize - 1);
            look((first, y), (-1, 0));
            look((last, y), (1, 0));
            for x in first..=last {
                look((x, y), (0, -1));
                look((x, y), (0, 1));
            }
        }
    }
    // Pieces that lead to each other, and to what is wide.
    let numbers: HashMap<u32, u32> = borders.keys().copied().zip(0..).collect();
    let wide = numbers.len() as u32;
    let mut sets = Forest::new(numbers.len() + 1);
    for (root, (border, beyond)) in &borders {
        if 3 * beyond.values().sum::<u32>() >= *border {
            for other in beyond.keys() {
                sets.join(numbers[root], numbers.get(other).copied().unwrap_or(wide));
            }
        }
    }
    let of_wide = sets.root(wide);
    numbers.into_iter().filter(|&(_, number)| sets.root(number) == of_wide).map(|(root, _)| root).collect()
}
