//! Mixtures for halftones that need more than a dot: averages of 2 x 2 dots in linear light.
//!
//! Problem: no cell is finer than 300 dpi, and a finer picture would alias in cells.
//! Method: dots whose colour is a stack are fixed to it and do not count beside others. Where there are only such, the colours
//! around take their place: a tone must not fade towards an edge because white is beyond it.
//! Cost: 10 ns a dot. Limits: letters in a tone are as coarse as the cells.

use rayon::prelude::*;

use crate::colour::fit::Fit;
use crate::colour::packed::{DRAWN, Key, colour};
use crate::dots::pixels::{Rows, average};
use crate::error::unfitted;
use appearance::gamut::InkMix;
use appearance::weights::WeightMaps;
use halftone::TONE;
use observe::Diagnosis;

/// Dots along each side of an average.
const SIDE: usize = 2;
/// An average of nothing that counts.
const NONE: Key = Key::MAX;

/// The mixtures of the averages, and for each dot the number of the stack that its colour is (`solid`), or [`TONE`].
pub(crate) fn mixed(
    rows: &Rows<'_>,
    dots: (usize, usize),
    fit: Fit,
    solid: impl Fn(Key) -> Option<u8> + Sync,
) -> Result<(InkMix, Vec<u8>), Diagnosis> {
    let mut index = vec![TONE; dots.0 * dots.1];
    let (averages, (wide, high)) = averages(rows, dots, solid, &mut index);
    let channels = fit.channels;
    let mut data = vec![0u16; averages.len() * channels];
    data.par_chunks_mut(channels * wide).enumerate().for_each(|(y, out)| {
        let mut sums = fit.nodes.scratch();
        for (x, out) in out.chunks_exact_mut(channels).enumerate() {
            let mut own = averages[y * wide + x];
            if own == NONE {
                let near = (y.saturating_sub(1)..(y + 2).min(high))
                    .flat_map(|v| (x.saturating_sub(1)..(x + 2).min(wide)).map(move |u| v * wide + u));
                own = near
                    .map(|at| averages[at])
                    .find(|&key| key != NONE)
                    .unwrap_or(crate::colour::packed::WHITE);
            }
            fit.channels_of(colour(own), own & DRAWN > 0, &mut sums, out);
        }
    });
    let maps = WeightMaps::new(wide, high, channels, data).map_err(unfitted)?;
    Ok((InkMix { stacks: fit.stacks, maps, matrix: fit.matrix }, index))
}

/// The averages, row by row, and how many they are along each side; [`NONE`] where nothing counts. Writes what is fixed.
fn averages(
    rows: &Rows<'_>,
    dots: (usize, usize),
    solid: impl Fn(Key) -> Option<u8> + Sync,
    index: &mut [u8],
) -> (Vec<Key>, (usize, usize)) {
    let (wide, high) = (dots.0.div_ceil(SIDE), dots.1.div_ceil(SIDE));
    let mut averages = vec![NONE; wide * high];
    let strips = averages.par_chunks_mut(wide).zip(index.par_chunks_mut(SIDE * dots.0));
    strips.enumerate().for_each(|(y, (out, index))| {
        let mut keys = vec![0; index.len()];
        rows(SIDE * y..(SIDE * (y + 1)).min(dots.1), &mut keys);
        let mut last = (NONE, TONE);
        for (index, &key) in index.iter_mut().zip(&keys) {
            if key != last.0 {
                last = (key, solid(key).unwrap_or(TONE));
            }
            *index = last.1;
        }
        let mut under = Vec::new();
        for (x, out) in out.iter_mut().enumerate() {
            under.clear();
            let columns = SIDE * x..(SIDE * (x + 1)).min(dots.0);
            for (index, keys) in index.chunks_exact(dots.0).zip(keys.chunks_exact(dots.0)) {
                let all = columns.clone().filter(|&x| index[x] == TONE).map(|x| keys[x]);
                under.extend(all);
            }
            if !under.is_empty() {
                *out = average(&under);
            }
        }
    });
    (averages, (wide, high))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::colour::packed::{WHITE, key};

    fn averaged(side: usize, at: impl Fn(usize, usize) -> Key + Sync) -> (Vec<Key>, Vec<u8>) {
        let rows = |rows: std::ops::Range<usize>, out: &mut [Key]| {
            let all = rows.flat_map(|y| (0..side).map(move |x| (x, y)));
            out.iter_mut().zip(all).for_each(|(out, (x, y))| *out = at(x, y));
        };
        let solid = |key: Key| (key == WHITE).then_some(0);
        let mut index = vec![TONE; side * side];
        let (averages, _) = averages(&rows, (side, side), solid, &mut index);
        (averages, index)
    }

    #[test]
    fn averages_are_of_light_not_of_numbers() {
        let (averages, index) =
            averaged(63, |x, y| key(if (x + y) % 2 == 0 { [235; 3] } else { [20; 3] }, false));
        // sRGB of half the light, .831 and .007.
        assert!(averages.chunks(32).take(31).all(|row| row[..31].iter().all(|&k| colour(k) == [173; 3])));
        assert!(index.iter().all(|&dot| dot == TONE));
    }

    #[test]
    fn a_tone_does_not_fade_towards_white_letters() {
        let tone = key([40, 60, 90], true);
        let (averages, index) = averaged(40, |x, _| if x % 13 < 5 { WHITE } else { tone });
        assert!(averages.iter().all(|&found| found == tone || found == NONE));
        for at in 0..40 * 40 {
            let is_white = at % 40 % 13 < 5;
            assert_eq!(index[at], if is_white { 0 } else { TONE });
            assert!(is_white || averages[at / 40 / 2 * 20 + at % 40 / 2] == tone);
        }
    }
}
