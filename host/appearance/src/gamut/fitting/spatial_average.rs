//! Clamped pixels moved so that the print comes nearer where an eye averages, not pixel by pixel.
//!
//! Problem: clamping leaves out what no mixture reaches, at each pixel by itself. An eye averages over a
//! spot of many pixels, and neighbours that could make up for a pixel do not.
//! Method: reflectance adds, so document and print are averaged over the eye's spot, with the window of the
//! comparison that a report states: [1 2 1] (x) [1 2 1] over cells of 3/8 of the spot's side. What the
//! average of the print misses, in cube roots, where the metric is Euclidean, is added to the targets of
//! its pixels, and they are fitted anew from their mixtures. A second sweep adds what is missed still. A
//! pixel that would hardly move keeps its clamped mixture bit for bit, and a flat material keeps it anyhow:
//! a target moved away from the gamut has the same nearest mixture.
//! Cost: two more fits of each pixel that moves; three rows of the space for each cell, of which there are
//! at most 131072, so that the window of a large document with coarse pixels is wider than the eye's.
//! Limits: two sweeps, so not the optimum; each pixel by itself comes out farther from the document, by a
//! few percent; documents whose pixels are as large as the spot stay as they are.

use maths::Maths;
use observe::Observer;
use rayon::prelude::*;

use super::clamp::Clamped;
use super::refit::{Solver, in_pixel};
use crate::gamut::candidates::Candidates;
use crate::gamut::error::GamutError;
use crate::materials::Materials;
use crate::solve::Target;
use crate::weights::{ONE, quantise};

/// Sweeps, as measured in decisions/what-the-eye-averages.md: a third lowers the difference by another
/// percent of itself and takes pixels farther away.
const SWEEPS: u32 = 2;
/// The shift, in distance, below which a pixel stays bit for bit, for nobody sees it
/// (decisions/what-the-eye-averages.md).
const FELT: f64 = 0.002;
/// The most cells: their rows then take 160 MB.
const MOST_CELLS: usize = 1 << 17;
/// The smallest spot in pixels over which there is anything to average: below it a spot is not much more than
/// the pixel itself, which clamping fits already.
const LEAST: f64 = 2.0;

/// Moves clamped pixels of a document, of which `spot` pixels make a side of the square that the eye
/// averages over. Returns the share of pixels that keep their clamped mixture.
pub(crate) fn match_averages(
    candidates: &Candidates,
    pixels: &dyn Materials,
    clamped: &mut Clamped,
    spot: f64,
    observer: &dyn Observer,
) -> Result<f64, GamutError> {
    if spot.is_nan() || spot < LEAST {
        return Ok(1.0);
    }
    observer.begin("fitting what the eye averages", u64::from(SWEEPS) + 1);
    let cells = Cells::new(pixels.width(), pixels.height(), spot);
    let wanted = cells.wanted(candidates, pixels)?;
    observer.advance(1);
    let mut shift = vec![0f32; wanted.len()];
    let mut moves = vec![false; clamped.distance.len()];
    for sweep in 1..=SWEEPS {
        cells.add_missed(candidates, &clamped.shares, &wanted, &mut shift);
        let pass = Pass { first: sweep == 1, last: sweep == SWEEPS };
        cells.fit(candidates, pixels, clamped, &shift, &mut moves, pass)?;
        observer.advance(1);
    }
    observer.end();
    Ok(moves.iter().filter(|&&moves| !moves).count() as f64 / moves.len() as f64)
}

/// Which of the sweeps this is.
#[derive(Clone, Copy)]
struct Pass {
    /// It decides which pixels move.
    first: bool,
    /// It leaves out small weights and notes distances.
    last: bool,
}

/// A document in square cells, those at its right and lower edge cut off.
struct Cells {
    width: usize,
    height: usize,
    /// Pixels along a side.
    side: usize,
    across: usize,
    down: usize,
}

impl Cells {
    fn new(width: usize, height: usize, spot: f64) -> Cells {
        // The square root, rounded up.
        let few = ((width * height).div_ceil(MOST_CELLS).max(1) - 1).isqrt() + 1;
        let side = ((spot * 3.0 / 8.0).round() as usize).clamp(1, width.max(height).max(1)).max(few);
        Cells { width, height, side, across: width.div_ceil(side), down: height.div_ceil(side) }
    }

    /// For each cell, the sums of `n` numbers a pixel, and the number of pixels.
    fn sums(&self, n: usize, read: impl Fn(usize, &mut [f32]) + Sync) -> Vec<f32> {
        let line = self.across * (n + 1);
        let mut sums = vec![0f32; line * self.down];
        sums.par_chunks_mut(line).enumerate().for_each(|(row, sums)| {
            let mut numbers = vec![0f32; n];
            for y in row * self.side..((row + 1) * self.side).min(self.height) {
                for x in 0..self.width {
                    read(y * self.width + x, &mut numbers);
                    let sums = &mut sums[x / self.side * (n + 1)..][..n + 1];
                    sums.iter_mut().zip(&numbers).for_each(|(sum, v)| *sum += v);
                    sums[n] += 1.0;
                }
            }
        });
        sums
    }

    /// Means over the window around a cell, from the sums of cells.
    fn mean(&self, sums: &[f32], cell: usize, out: &mut [f64]) {
        let n = out.len();
        let (row, column) = (cell / self.across, cell % self.across);
        out.fill(0.0);
        let mut count = 0.0;
        for y in row.saturating_sub(1)..(row + 2).min(self.down) {
            for x in column.saturating_sub(1)..(column + 2).min(self.across) {
                let tap = if y == row { 2.0 } else { 1.0 } * if x == column { 2.0 } else { 1.0 };
                let sums = &sums[(y * self.across + x) * (n + 1)..][..n + 1];
                out.iter_mut().zip(sums).for_each(|(out, &v)| *out += tap * f64::from(v));
                count += tap * f64::from(sums[n]);
            }
        }
        out.iter_mut().for_each(|out| *out /= count);
    }

    /// Cube roots of the mean radiance of the document around each cell.
    fn wanted(&self, candidates: &Candidates, pixels: &dyn Materials) -> Result<Vec<f32>, GamutError> {
        let n = pixels.space().columns();
        let sums = self.sums(n, |pixel, row| pixels.reflectance(pixel, row));
        let hull = &candidates.priced;
        let m = hull.metric().len();
        let mut roots = vec![0f32; self.across * self.down * m];
        roots.par_chunks_exact_mut(m).enumerate().try_for_each_init(
            || (vec![0.0; n], Target::default()),
            |(mean, target), (cell, roots)| {
                self.mean(&sums, cell, mean);
                let corner = (cell / self.across * self.width + cell % self.across) * self.side;
                hull.aim(mean.iter().copied(), target).map_err(in_pixel(corner, self.width))?;
                roots.iter_mut().zip(target.roots()).for_each(|(root, &r)| *root = r as f32);
                Ok::<_, GamutError>(())
            },
        )?;
        Ok(roots)
    }

    /// Adds what the mean of the print around each cell misses.
    fn add_missed(&self, candidates: &Candidates, shares: &[u16], wanted: &[f32], shift: &mut [f32]) {
        let k = candidates.len();
        let sums = self.sums(k, |pixel, out| {
            out.iter_mut().zip(&shares[pixel * k..]).for_each(|(out, &share)| *out = f32::from(share));
        });
        let hull = &candidates.priced;
        let m = hull.metric().len();
        shift.par_chunks_exact_mut(m).zip(wanted.par_chunks_exact(m)).enumerate().for_each_init(
            || (vec![0.0; k], vec![0.0; m]),
            |(weights, seen), (cell, (shift, wanted))| {
                self.mean(&sums, cell, weights);
                weights.iter_mut().for_each(|w| *w /= f64::from(ONE));
                hull.roots(weights, seen);
                for ((shift, wanted), seen) in shift.iter_mut().zip(wanted).zip(&*seen) {
                    *shift += wanted - *seen as f32;
                }
            },
        );
    }

    /// Fits the pixels that move to their targets moved by the shift around them.
    fn fit(
        &self,
        candidates: &Candidates,
        pixels: &dyn Materials,
        clamped: &mut Clamped,
        shift: &[f32],
        moves: &mut [bool],
        pass: Pass,
    ) -> Result<(), GamutError> {
        let (k, length) = (candidates.len(), self.side * self.width);
        let shares = clamped.shares.par_chunks_mut(length * k);
        let seen = clamped.distance.par_chunks_mut(length).zip(clamped.light.par_chunks_mut(length));
        let rows = shares.zip(seen).zip(moves.par_chunks_mut(length)).enumerate();
        rows.try_for_each(|(row, ((shares, (distance, light)), moves))| {
            let mut solver = Solver::new(candidates, pixels);
            for (i, shares) in shares.chunks_exact_mut(k).enumerate() {
                if !pass.first && !moves[i] {
                    continue;
                }
                let pixel = row * length + i;
                self.read(shift, pixel, &mut solver.shift);
                if pass.first {
                    let columns = solver.shift.iter().zip(candidates.priced.metric());
                    moves[i] = columns.map(|(s, w)| (s * w).squared()).sum::<f64>() > FELT * FELT;
                    if !moves[i] {
                        continue;
                    }
                }
                solver.aim(pixel).map_err(in_pixel(pixel, self.width))?;
                solver.start(shares);
                solver.solve(1.0, pass.last).map_err(in_pixel(pixel, self.width))?;
                quantise(&solver.weights, shares);
                if pass.last {
                    distance[i] = solver.compare() as f32;
                    light[i] = solver.light() as f32;
                }
            }
            Ok(())
        })
    }

    /// The vector at a pixel, between those of the cells around it.
    fn read(&self, cells: &[f32], pixel: usize, out: &mut [f64]) {
        let between = |at: usize, count: usize| {
            let place = (at as f64 + 0.5) / self.side as f64 - 0.5;
            let place = place.clamp(0.0, (count - 1) as f64);
            let near = (place as usize).min(count - 1);
            [(near, 1.0 - place.fract()), ((near + 1).min(count - 1), place.fract())]
        };
        out.fill(0.0);
        for (y, v) in between(pixel / self.width, self.down) {
            for (x, u) in between(pixel % self.width, self.across) {
                let values = &cells[(y * self.across + x) * out.len()..][..out.len()];
                out.iter_mut().zip(values).for_each(|(out, &value)| *out += u * v * f64::from(value));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::{Space, Table};
    use crate::gamut::Printable;
    use crate::gamut::fitting::clamp;
    use inks::Stack;
    use observe::Silent;

    /// Grey materials, one level a pixel.
    struct Greys(Space, usize, Vec<f32>);

    impl Materials for Greys {
        fn width(&self) -> usize {
            self.1
        }
        fn height(&self) -> usize {
            self.2.len() / self.1
        }
        fn space(&self) -> &Space {
            &self.0
        }
        fn reflectance(&self, pixel: usize, out: &mut [f32]) {
            out.fill(self.2[pixel]);
        }
    }

    /// Greys from .1 to .5 can be printed.
    fn candidates(space: &Space) -> Candidates {
        let stacks: Vec<Stack> = ["substrate", "K"].map(|stack| stack.parse().unwrap()).to_vec();
        let mut curves = Table::new(space.columns());
        [0.5, 0.1].iter().for_each(|&level| curves.push(&vec![level; space.columns()]));
        // Without light, so that what is in the gamut is met and no grain is weighed against it.
        Candidates::new(space, &Printable::new(stacks, curves), 0.0).unwrap()
    }

    fn levels(clamped: &Clamped) -> Vec<f64> {
        clamped
            .shares
            .chunks(2)
            .map(|w| (0.5 * f64::from(w[0]) + 0.1 * f64::from(w[1])) / f64::from(ONE))
            .collect()
    }

    /// Mean difference from the document within squares, inside the document, counted without cells.
    fn missed(document: &Greys, levels: &[f64], side: usize) -> f64 {
        let (width, height) = (document.width(), document.height());
        let (mut sum, mut count) = (0.0, 0);
        for top in side..height - 2 * side {
            for left in side..width - 2 * side {
                let square = (0..side * side).map(|i| (top + i / side) * width + left + i % side);
                let apart: f64 = square.map(|p| levels[p] - f64::from(document.2[p])).sum();
                sum += (apart / (side * side) as f64).powi(2);
                count += 1;
            }
        }
        (sum / f64::from(count)).sqrt()
    }

    #[test]
    fn neighbours_make_up_for_what_a_pixel_cannot_be() {
        let space = Space::half_angle(8);
        // .04 cannot be printed and becomes .1; its neighbours of .3 have room.
        let level = |i: usize| if (i % 40 + i / 40).is_multiple_of(2) { 0.04 } else { 0.3 };
        let document = Greys(space.clone(), 40, (0..40 * 40).map(level).collect());
        let candidates = candidates(&space);
        let mut clamped = clamp::map(&candidates, &document, &Silent).unwrap();
        let before = missed(&document, &levels(&clamped), 8);
        assert!((before - 0.03).abs() < 1e-3, "{before}");
        let kept = match_averages(&candidates, &document, &mut clamped, 8.0, &Silent).unwrap();
        let after = missed(&document, &levels(&clamped), 8);
        assert!(kept == 0.0 && after < 0.6 * before, "{kept} {after} {before}");
        // The distances are those of the mixtures.
        for (i, level) in levels(&clamped).into_iter().enumerate().take(80) {
            let row = |v: f64| vec![v; space.columns()];
            let d = space.distance(&row(level), &row(f64::from(document.2[i])));
            assert!((d - f64::from(clamped.distance[i])).abs() < 1e-4, "{i}: {d} {}", clamped.distance[i]);
        }
    }

    #[test]
    fn what_fits_or_has_no_neighbours_stays_bit_for_bit() {
        let space = Space::half_angle(8);
        let candidates = candidates(&space);
        let ramp = |i: usize| 0.15 + 0.3 * (i % 23) as f32 / 23.0;
        for (name, levels, spot) in [
            ("in the gamut", (0..23 * 17).map(ramp).collect::<Vec<_>>(), 8.0),
            ("flat and beyond it", vec![0.8; 23 * 17], 8.0),
            ("pixels as large as the spot", (0..23 * 17).map(|i| 3.0 * ramp(i)).collect(), 1.5),
        ] {
            let document = Greys(space.clone(), 23, levels);
            let mut moved = clamp::map(&candidates, &document, &Silent).unwrap();
            let before = moved.shares.clone();
            match_averages(&candidates, &document, &mut moved, spot, &Silent).unwrap();
            assert_eq!(moved.shares, before, "{name}");
        }
    }

    #[test]
    fn a_window_has_the_taps_of_the_comparison_and_keeps_the_sum_at_edges() {
        let cells = Cells::new(7, 5, 8.0 / 3.0);
        assert_eq!((cells.side, cells.across, cells.down), (1, 7, 5));
        let sums = cells.sums(1, |pixel, out| out[0] = if pixel == 2 * 7 + 3 { 16.0 } else { 0.0 });
        let at = |cell: usize| {
            let mut out = [0.0];
            cells.mean(&sums, cell, &mut out);
            out[0]
        };
        assert_eq!([at(2 * 7 + 3), at(2 * 7 + 2), at(7 + 2)], [4.0, 2.0, 1.0]);
        let flat = Cells::new(11, 13, 8.0);
        let sums = flat.sums(2, |_, out| out.copy_from_slice(&[3.0, 5.0]));
        for cell in 0..flat.across * flat.down {
            let mut out = [0.0; 2];
            flat.mean(&sums, cell, &mut out);
            assert!((out[0] - 3.0).abs() < 1e-6 && (out[1] - 5.0).abs() < 1e-6, "{out:?}");
        }
        // Never more cells than there may be.
        let large = Cells::new(1600, 2300, 2.0);
        assert!(large.across * large.down <= MOST_CELLS + large.across + large.down, "{}", large.side);
    }
}
