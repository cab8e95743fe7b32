//! The part of the sheet that is compared: pictures laid flat on it, and means over spots of it.
//!
//! Problem: figures must not depend on single dots, nor on how sharp the camera is. A mean over a square has hard sides, and every blur
//! carries light of the dots beside it across: on a print that is as predicted this alone looks like an error of 1 to 2 %.
//! Method: spots. They stand a millimetre apart, and the weight of each falls from 1 in its middle to 0 a millimetre away, across and
//! down (a mean over a square, twice). What carries light out on one side brings as much in on the other, so a blur of
//! s mm changes a spot in proportion to s², not s: by a tenth for a camera with 9 pixels a mm.
//! Weights are integrated exactly over dots and over pixels of documents. Cost: one read of all dots. Limits: the outermost half millimetre
//! counts little.

use press::preview::Source;
use rayon::prelude::*;

use appearance::weights::ONE;

/// Distance of spots in mm, and the width of each at half its height.
const APART: f64 = 1.0;
/// The most pixels along a side of a window.
const LONGEST: f64 = 1000.0;

/// The part of the sheet that is compared, in spots and in pixels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ComparedArea {
    /// Its middle and its size in mm of the sheet's frame.
    pub(crate) middle: [f64; 2],
    pub(crate) size: [f64; 2],
    /// Squares of a millimetre across and down, 2 or more. Spots stand on the corners between them.
    pub(crate) squares: [usize; 2],
    pub(crate) width: usize,
    pub(crate) height: usize,
}

impl ComparedArea {
    /// A window with about `pixels` pixels a millimetre.
    pub(crate) fn new(middle: [f64; 2], size: [f64; 2], pixels: f64) -> ComparedArea {
        let squares = size.map(|side| (side / APART).round().max(2.0) as usize);
        let most = (LONGEST / squares[0].max(squares[1]) as f64).floor().max(1.0);
        let fine = pixels.round().clamp(1.0, most.min(8.0)) as usize;
        let [width, height] = squares.map(|count| count * fine);
        ComparedArea { middle, size, squares, width, height }
    }

    /// A place of the picture (pixels from its top left corner) in mm of the sheet's frame.
    pub(crate) fn place(&self, x: f64, y: f64) -> [f64; 2] {
        self.at(x / self.width as f64, y / self.height as f64)
    }

    /// A place from the top left corner, 0 to 1, in mm of the sheet's frame.
    pub(crate) fn at(&self, u: f64, v: f64) -> [f64; 2] {
        [self.middle[0] + (u - 0.5) * self.size[0], self.middle[1] + (0.5 - v) * self.size[1]]
    }

    /// Spots across and down.
    pub(crate) fn spots(&self) -> [usize; 2] {
        self.squares.map(|count| count - 1)
    }

    /// The middle of a spot, counted row by row.
    pub(crate) fn spot(&self, i: usize) -> [f64; 2] {
        let ([across, _], [columns, rows]) = (self.spots(), self.squares);
        self.at((i % across + 1) as f64 / columns as f64, (i / across + 1) as f64 / rows as f64)
    }

    /// The share of each basis or stack of a source in every spot, spot by spot, as many values each as there are bases or stacks.
    /// The source is as large as the window. `None` for a document that is not factored.
    pub(crate) fn shares(&self, source: &Source<'_>) -> Option<Vec<f32>> {
        let (width, height) = source.size();
        let channels = match source {
            Source::Document(_) => return None,
            Source::Factored(factored) => factored.maps.channels(),
            Source::Print { dots, .. } => dots.stacks().len(),
        };
        let add = |x: usize, y: usize, part: f32, out: &mut [f32]| match source {
            Source::Document(_) => (),
            Source::Factored(factored) => {
                let weights = factored.maps.at(y * width + x);
                let part = part / f32::from(ONE);
                out.iter_mut().zip(weights).for_each(|(out, &w)| *out += part * f32::from(w));
            }
            Source::Print { dots, area, .. } => {
                let stack = dots.index()[(area.top + y) * dots.width() + area.left + x];
                out[usize::from(stack)] += part;
            }
        };
        let ([across, down], [columns, rows]) = (self.spots(), self.squares);
        let (columns, rows) = (covers(columns, width), covers(rows, height));
        let mut all = vec![0.0; across * down * channels];
        all.par_chunks_exact_mut(across * channels).zip(&rows).for_each(|(line, row)| {
            for (y, down) in row.iter() {
                for (out, column) in line.chunks_exact_mut(channels).zip(&columns) {
                    column.iter().for_each(|(x, across)| add(x, y, across * down, out));
                }
            }
        });
        Some(all)
    }
}

/// The places that a spot covers along one side, with the share of each; all shares together are 1.
struct Covered {
    first: usize,
    shares: Vec<f32>,
}

impl Covered {
    fn iter(&self) -> impl Iterator<Item = (usize, f32)> {
        (self.first..).zip(self.shares.iter().copied())
    }
}

/// What each spot covers of a side of so many squares, which is divided into `places`.
fn covers(squares: usize, places: usize) -> Vec<Covered> {
    // A spot's weight up to a distance from its middle, in squares.
    let up_to = |t: f64| {
        let t = t.clamp(-1.0, 1.0);
        if t < 0.0 { 0.5 * (1.0 + t).powi(2) } else { 1.0 - 0.5 * (1.0 - t).powi(2) }
    };
    let spot = |k: usize| {
        let (first, end) = ((k - 1) * places / squares, ((k + 1) * places).div_ceil(squares));
        let edge = |place: usize| up_to((place * squares) as f64 / places as f64 - k as f64);
        Covered { first, shares: (first..end).map(|at| (edge(at + 1) - edge(at)) as f32).collect() }
    };
    (1..squares).map(spot).collect()
}

/// A picture of a window.
#[derive(Clone, Debug)]
pub(crate) struct Flat {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) rgb: Vec<[f32; 3]>,
    /// Whether a pixel was seen, and not full.
    pub(crate) known: Vec<bool>,
}

impl Flat {
    pub(crate) fn new(width: usize, height: usize) -> Flat {
        Flat { width, height, rgb: vec![[0.0; 3]; width * height], known: vec![true; width * height] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use appearance::brdf::{Space, Table};
    use appearance::factor::Factored;
    use appearance::weights::WeightMaps;

    /// By brute force: the weight of a spot at 16 x 16 places of every pixel, whether pixels are larger than spots or smaller.
    #[test]
    fn shares_are_weighted_means() {
        for ([width, height], squares) in
            [([1, 1], [2, 2]), ([7, 40], [5, 3]), ([39, 2], [8, 7]), ([24, 24], [3, 6])]
        {
            let value = |i: usize| (i * 7919 + 17) as u16 % (ONE + 1);
            let data = (0..width * height).flat_map(|i| [value(i), ONE - value(i)]).collect();
            let mut bases = Table::new(12);
            (0..2).for_each(|_| bases.push(&[0.1; 12]));
            let maps = WeightMaps::new(width, height, 2, data).unwrap();
            let factored = Factored { space: Space::half_angle(4), bases, maps };
            let window = ComparedArea::new([3.0, -4.0], squares.map(|n| n as f64), 1.0);
            let found = window.shares(&Source::Factored(&factored)).unwrap();
            let [across, down] = window.spots();
            assert_eq!(found.len(), across * down * 2);
            let off = |k: usize, side: usize, n: usize, spot: usize| {
                (k as f64 + 0.5) / (16 * side) as f64 * n as f64 - (spot + 1) as f64
            };
            for (i, found) in found.chunks_exact(2).enumerate() {
                let (mut sum, mut whole) = (0.0, 0.0);
                for (y, x) in (0..16 * height).flat_map(|y| (0..16 * width).map(move |x| (y, x))) {
                    let off = [off(x, width, squares[0], i % across), off(y, height, squares[1], i / across)];
                    let weight = off.iter().map(|t| (1.0 - t.abs()).max(0.0)).product::<f64>();
                    sum += weight * f64::from(value(y / 16 * width + x / 16)) / f64::from(ONE);
                    whole += weight;
                }
                assert!((f64::from(found[0]) - sum / whole).abs() < 0.003, "{} {}", found[0], sum / whole);
                assert!((found[0] + found[1] - 1.0).abs() < 1e-5);
            }
        }
    }

    #[test]
    fn spots_are_counted_from_the_top_left() {
        let window = ComparedArea::new([1.0, 2.0], [4.0, 3.0], 5.0);
        assert_eq!((window.squares, window.width, window.height), ([4, 3], 20, 15));
        assert_eq!(window.spot(0), [0.0, 2.5]);
        assert_eq!(window.spot(5), [2.0, 1.5]);
        assert_eq!(window.place(20.0, 15.0), [3.0, 0.5]);
    }
}
