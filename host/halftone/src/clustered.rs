//! One stack for every dot, in compact cells: the second halftone, beside the walk of the paper.
//!
//! Problem: runs along a walk hold their minimum in area but may be one dot thin, and the walk locks on flat tones.
//! Method: the page is cut into square cells, each as large as its stacks ask for ([`plan`]); each prints one stack, or two
//! in halves that hold them ([`cell`]), chosen ([`choose`]) in error diffusion of the whole vector of stacks ([`error_diffusion`]) on
//! its exact mean mixture ([`field`]). Dots the
//! document gives wholly to one stack are printed as that stack, and no debt crosses them. Strips of [`STRIP`] block
//! rows are diffused at the same time; the page alone decides where they are cut, so the dots do not depend on the
//! number of threads.
//! Cost: about 100 ns a cell of 3 x 3 dots with 8 stacks. Memory: a bit a dot, a byte a pixel of the document, 12 bytes
//! a fragment. Limits: detail finer than a cell is averaged, unless it is solid; a stack's cells have sides of 1, 2, 3, 4,
//! 6 or 8 dots.

mod arrange;
mod border;
pub(super) mod cell;
mod choose;
mod error_diffusion;
mod evenness;
pub(super) mod field;
pub(super) mod mask;
pub(super) mod plan;

use rayon::prelude::*;

use super::dbs::{self, Point};
use super::solids::Solids;
use appearance::gamut::InkMix;
use appearance::wide::wide;
use observe::Observer;

use choose::Metric;
use error_diffusion::{Strip, Target};
use field::Field;
use mask::BLOCK;
use plan::Plan;

/// Block rows in a strip: A4 is six strips that are nearly equal.
const STRIP: usize = 45;

/// Block rows of lead-in: in these, half a percent of a stack far from all others forgets where it began.
const LEAD: usize = 3;

/// Block rows above the page, of which there is one strip.
const ABOVE: usize = 4;

/// Halftones a checked mixture on `width` x `height` dots: a stack of the mixture for each. `minimum` is the smallest
/// cluster of each stack. With a point for each stack, their distances decide which may stand in for another, and `searched` exchanges cells to
/// lessen the error seen ([`dbs`]).
pub(super) fn cells(
    mix: &InkMix,
    (width, height): (usize, usize),
    minimum: &[u16],
    solids: &Solids,
    points: Option<&[Point]>,
    searched: bool,
    observer: &dyn Observer,
) -> Vec<u8> {
    let sizes_of = |&minimum: &u16| [plan::size_of(minimum), plan::halved_size_of(minimum)];
    let mut sizes: Vec<usize> = minimum.iter().flat_map(sizes_of).collect();
    sizes.push(BLOCK);
    sizes.sort_unstable();
    sizes.dedup();
    let field = Field::new(mix, width, height, &sizes, solids);
    let least: Vec<u16> = field.stacks.iter().map(|&q| minimum[usize::from(q)]).collect();
    let points: Option<Vec<Point>> =
        points.map(|points| field.stacks.iter().map(|&q| points[usize::from(q)]).collect());
    let metric = Metric::new(field.lanes, &field.mean(), points.as_deref());
    let mut index = vec![0; width * height];
    observer.begin("halftone", (width * height) as u64);
    let plan = Plan::new(&field, &least, &mut index);
    index.par_chunks_mut(STRIP * BLOCK * width).enumerate().for_each(|(i, rows)| {
        let (first, count) = (i * STRIP, rows.len().div_ceil(BLOCK * width));
        wide(
            #[inline(always)]
            || {
                let mut strip = Strip::new(&field, &plan, &metric, &least);
                if first == 0 {
                    strip.lead_in(ABOVE);
                }
                for row in first.saturating_sub(LEAD)..first {
                    strip.block_row(row, &mut Target { rows: None, top: 0 });
                }
                let mut target = Target { rows: Some(rows), top: first * BLOCK };
                for row in first..first + count {
                    strip.block_row(row, &mut target);
                    observer.advance((width * BLOCK.min(height - row * BLOCK)) as u64);
                }
            },
        );
    });
    plan.print_fragments(&mut index);
    if let Some(points) = points.filter(|_| searched) {
        dbs::search(&field, &plan, &points, &least, &mut index);
    }
    observer.end();
    index
}

#[cfg(test)]
mod tests;
