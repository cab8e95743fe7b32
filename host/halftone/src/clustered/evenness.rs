//! Which blocks of a document are flat.
//!
//! Problem: in flat tones squares look more even than halves of cells, in all others less; but where squares and halves take turns, bands of
//! blocks are seen.
//! Method: a block is flat if no weight differs by more than [`FLAT`], or if more than [`ALIKE`] of its neighbouring pixels are alike, as
//! beside the edge of a tint. A shading with about as many steps has now more and now fewer from block to block. So the mean over the
//! blocks around decides, of those that are about as even (a bilateral filter): not the picture beside a tint.
//! Cost: a look at [`REACH`] blocks each way for each block that varies. Limits: shadings whose mean passes the limit change once.

use appearance::weights::ONE;
use rayon::prelude::*;

/// By how much a weight may differ over a flat block.
pub(super) const FLAT: u16 = ONE / 512;

/// Least share of pixels that are like their neighbours in a flat block that has edges.
const ALIKE: f64 = 3.0 / 4.0;

/// How many blocks each way are looked at, 4 mm, and by how much their shares may differ.
const REACH: usize = 4;
const ABOUT: f64 = 0.15;

/// How even the pixels of a block are.
#[derive(Clone, Copy)]
pub(super) struct Evenness {
    /// By how much the weight of a channel differs at most.
    pub varies: u16,
    /// The share of neighbouring pixels that are alike; 1 if nothing varies.
    pub alike: f64,
}

/// By how much a weight differs over each block of rows of so many; 0 if it is flat.
pub(super) fn varying(blocks: &[Evenness], across: usize) -> Vec<u16> {
    let near = |at: usize, end: usize| at.saturating_sub(REACH)..(at + REACH + 1).min(end);
    let mean = |at: usize| {
        let columns = near(at % across, across);
        let around = near(at / across, blocks.len() / across)
            .flat_map(|row| &blocks[row * across + columns.start..row * across + columns.end]);
        let (mut sum, mut count) = (0.0, 0.0);
        for block in around.filter(|block| (block.alike - blocks[at].alike).abs() <= ABOUT) {
            (sum, count) = (sum + block.alike, count + 1.0);
        }
        sum / count
    };
    let of = |(at, block): (usize, &Evenness)| {
        if block.varies <= FLAT || mean(at) > ALIKE { 0 } else { block.varies }
    };
    blocks.par_iter().enumerate().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const ACROSS: usize = 30;

    fn block(alike: f64) -> Evenness {
        Evenness { varies: 4 * FLAT, alike }
    }

    /// Of a shading with about three steps in four, one block has a few more than another.
    #[test]
    fn a_shading_is_flat_everywhere_or_nowhere() {
        for (alike, flat) in [(0.70, false), (0.80, true)] {
            let blocks: Vec<Evenness> = (0..30 * ACROSS)
                .map(|at| block(alike + 0.06 * f64::from((at / ACROSS * 5 % 3) as u8) - 0.06))
                .collect();
            assert!(
                blocks.iter().any(|block| (block.alike > ALIKE) != flat),
                "some would be otherwise by themselves"
            );
            for (at, varies) in varying(&blocks, ACROSS).into_iter().enumerate() {
                assert_eq!(varies == 0, flat, "{alike} at {at}");
            }
        }
    }

    #[test]
    fn the_edge_of_a_tint_beside_a_picture_is_flat() {
        let blocks: Vec<Evenness> = (0..20 * ACROSS)
            .map(|at| match at % ACROSS {
                0..10 => Evenness { varies: 0, alike: 1.0 },
                10 => block(0.9),
                _ => block(0.05),
            })
            .collect();
        for (at, varies) in varying(&blocks, ACROSS).into_iter().enumerate() {
            assert_eq!(varies == 0, at % ACROSS <= 10, "at {at}");
        }
    }
}
