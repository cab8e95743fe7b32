//! Counters: the ground inside letters.
//!
//! Problem: what an o encloses is as small as a letter, and would be printed solid amid a ground that is screened.
//! Method: a thin shape is a counter if most of its rows have one wide shape in its colour on both sides within a stroke's reach. Between two bars of a
//! code there are two.
//! Cost: a look at a few runs for each run of a thin shape.
//! Limits: a small shape in the colour of a wide one near it on both sides is taken for a part of it.

use super::flat::Flat;
use super::shapes::{Run, joined};

/// For each run that is the root of a shape, whether the shape is a counter: `reach` dots away on both sides lies the ground.
pub(super) fn counters(
    flat: &Flat,
    (runs, rows): (&[Run], &[usize]),
    reach: u32,
    is_thin: impl Fn(u32) -> bool,
) -> Vec<bool> {
    // Rows in which a shape has the ground on both sides, less those in which it has not.
    let mut balance = vec![0i32; runs.len()];
    for row in rows.windows(2) {
        let row = &runs[row[0]..row[1]];
        for (at, run) in row.iter().enumerate().filter(|(_, run)| is_thin(run.root)) {
            let is_ground = |other: &&Run| joined(flat, run.colour, other.colour) && !is_thin(other.root);
            let before = row[..at].iter().rev().take_while(|other| other.end + reach >= run.start);
            let behind = || row[at + 1..].iter().take_while(|other| run.end + reach >= other.start);
            let both = before.filter(is_ground).any(|other| behind().any(|own| own.root == other.root));
            balance[run.root as usize] += if both { 1 } else { -1 };
        }
    }
    balance.into_iter().map(|rows| rows > 0).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kinds::ObjectType;
    use crate::shapes::shapes;

    /// The colours of dots as characters say: `#` is a letter, others are a tint, and a blank is paper.
    fn found(rows: &[&str], reach: u32) -> Vec<char> {
        let width = rows[0].len();
        let index: Vec<u8> = rows
            .concat()
            .bytes()
            .map(|b| match b {
                b' ' => 0,
                b'#' => 1,
                _ => 2,
            })
            .collect();
        let colours = vec![
            (ObjectType::Picture, [255; 3]),
            (ObjectType::Picture, [0; 3]),
            (ObjectType::Drawing, [128; 3]),
        ];
        let flat = Flat { colours, index };
        let mut shaped = [false; 256];
        shaped[2] = true;
        let all = shapes(&flat, width, (&shaped, 4));
        let is_counter =
            counters(&flat, (&all.runs, &all.rows), reach, |root| all.runs[root as usize].side < 4);
        let mut letters: Vec<char> = Vec::new();
        for (row, ends) in rows.iter().zip(all.rows.windows(2)) {
            for run in all.runs[ends[0]..ends[1]].iter().filter(|run| is_counter[run.root as usize]) {
                letters.extend(row[run.start as usize..run.end as usize].chars());
            }
        }
        letters.sort_unstable();
        letters.dedup();
        letters
    }

    #[test]
    fn the_ground_inside_letters_is_ground() {
        let rows = [
            "gggggggggggggggggggggggggggggggggggggg    ",
            "gggg####ggg#####gggggg#######ggggggggg    ",
            "gggg#aa#ggg#bb##gggggg#     #ggggggggg dd ",
            "gggg#aa#ggg#bb##gggggg# cc  #ggggggggg dd ",
            "gggg####ggg##b##gggggg#     #ggggggggg    ",
            "ggggggggggg#####gggggg#######ggggggggg    ",
            "gggggggggggggggggggggggggggggggggggggg    ",
            "gggggggggggggggggggggggggggggggggggggg    ",
        ];
        assert_eq!(found(&rows, 4), ['a', 'b', 'c']);
        // Beyond reach, nothing tells c from a small drawing; and d has the ground on one side alone.
        assert_eq!(found(&rows, 2), ['a', 'b']);
        // Bars of a code.
        let rows = ["gggg  a  ggggg  b ggg"; 4];
        assert!(found(&[&["                     "], &rows[..]].concat(), 4).is_empty());
    }
}
