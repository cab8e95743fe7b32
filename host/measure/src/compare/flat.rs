//! The part of the sheet that is compared: pictures laid flat on it, and means over spots of it.
//!
//! Problem: figures must not depend on single dots, nor on how sharp the camera is. A mean over a square has hard sides, and every blur
//! carries light of the dots beside it across: on a print that is as predicted this alone looks like an error of 1 to 2 %.
//! Method: spots. They stand a millimetre apart, and the weight of each falls from 1 in its middle to 0 a millimetre away, across and
//! down (a mean over a square, twice). What carries light out on one side brings as much in on the other, so a blur of
//! s mm changes a spot in proportion to s², not s. What is left of it is in the weights too: a spot of the prediction is blurred
//! as the photograph is ([`super::blur`]).
//! Weights are integrated exactly over dots and over pixels of documents. Cost: one read of all dots. Limits: the outermost half millimetre
//! counts little; beyond its sides a document goes on as it ends.

use appearance::factor::Factored;
use appearance::weights::ONE;
use rayon::prelude::*;
use sheet::Area;

/// Distance of spots in mm, and the width of each at half its height, so that they cover the sheet evenly
/// (decisions/marks-and-photographs.md).
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

    /// The share of each basis or stack in every spot of these rows, spot by spot, as many values each as there are bases or stacks.
    /// `blur` is the standard deviation of what carries light across and down, in mm.
    pub(crate) fn shares(&self, of: &Covering<'_>, blur: [f64; 2], rows: &[usize]) -> Vec<f32> {
        let ([width, height], channels) = match of {
            Covering::Factored(factored) => {
                ([factored.maps.width(), factored.maps.height()], factored.maps.channels())
            }
            Covering::Dots { area, stacks, .. } => ([area.width, area.length], *stacks),
        };
        let add = |x: i64, y: i64, part: f32, out: &mut [f32]| match of {
            Covering::Factored(factored) => {
                let (x, y) = (x.clamp(0, width as i64 - 1), y.clamp(0, height as i64 - 1));
                let weights = factored.maps.at(y as usize * width + x as usize);
                let part = part / f32::from(ONE);
                out.iter_mut().zip(weights).for_each(|(out, &w)| *out += part * f32::from(w));
            }
            Covering::Dots { area, at, .. } => {
                out[usize::from(at(area.left as i64 + x, area.top as i64 + y))] += part;
            }
        };
        let across = self.spots()[0];
        let blurred = |c: usize| blur[c] * self.squares[c] as f64 / self.size[c];
        let (columns, lines) =
            (covers(self.squares[0], width, blurred(0)), covers(self.squares[1], height, blurred(1)));
        let mut all = vec![0.0; across * rows.len() * channels];
        all.par_chunks_exact_mut(across * channels).zip(rows).for_each(|(line, row)| {
            for (y, down) in lines[*row].iter() {
                for (out, column) in line.chunks_exact_mut(channels).zip(&columns) {
                    column.iter().for_each(|(x, across)| add(x, y, across * down, out));
                }
            }
        });
        all
    }

    /// All rows of spots.
    pub(crate) fn rows(&self) -> Vec<usize> {
        (0..self.spots()[1]).collect()
    }
}

/// What covers a window.
pub(crate) enum Covering<'a> {
    /// A document, as large as the window.
    Factored(&'a Factored),
    /// Dots of a sheet, of which an area is as large as the window, and more lie around it.
    Dots {
        /// The window, in dots of the sheet.
        area: Area,
        /// How many stacks there are.
        stacks: usize,
        /// The stack of a dot, which may lie beyond the sheet.
        at: &'a (dyn Fn(i64, i64) -> u8 + Sync),
    },
}

/// The places that a spot covers along one side, with the share of each; all shares together are 1.
struct Covered {
    first: i64,
    shares: Vec<f32>,
}

impl Covered {
    fn iter(&self) -> impl Iterator<Item = (i64, f32)> {
        (self.first..).zip(self.shares.iter().copied())
    }
}

/// What each spot covers of a side of so many squares, which is divided into `places`, through a normal blur of `blur` squares.
fn covers(squares: usize, places: usize, blur: f64) -> Vec<Covered> {
    let (squares, places) = (squares as i64, places as i64);
    // The spot is the second difference of |t| / 2, so its weight up to t is that of the integral of the blurred ramp.
    let ramp = |t: f64| {
        if blur < 1e-6 {
            return 0.5 * t.max(0.0).powi(2);
        }
        let z = (t / blur).clamp(-8.0, 8.0);
        let density = (-0.5 * z * z).exp() / (2.0 * std::f64::consts::PI).sqrt();
        0.5 * ((t * t + blur * blur) * normal(z) + t * blur * density)
    };
    let reach = 1.0 + 3.0 * blur;
    let up_to = |t: f64| ramp(t + 1.0) - 2.0 * ramp(t) + ramp(t - 1.0);
    let spot = |k: i64| {
        let place = |t: f64| t * places as f64 / squares as f64;
        let (first, end) = (place(k as f64 - reach).floor() as i64, place(k as f64 + reach).ceil() as i64);
        let edge = |place: i64| up_to((place * squares) as f64 / places as f64 - k as f64);
        let whole = edge(end) - edge(first);
        Covered { first, shares: (first..end).map(|at| ((edge(at + 1) - edge(at)) / whole) as f32).collect() }
    };
    (1..squares).map(spot).collect()
}

/// The normal distribution (Abramowitz and Stegun 26.2.17, within 7.5e-8).
fn normal(z: f64) -> f64 {
    let k = 1.0 / (1.0 + 0.231_641_9 * z.abs());
    let series = k
        * (0.319_381_53
            + k * (-0.356_563_782 + k * (1.781_477_937 + k * (-1.821_255_978 + k * 1.330_274_429))));
    let above = (-0.5 * z * z).exp() / (2.0 * std::f64::consts::PI).sqrt() * series;
    if z > 0.0 { 1.0 - above } else { above }
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
            let found = window.shares(&Covering::Factored(&factored), [0.0; 2], &window.rows());
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

    /// By brute force: a spot's weight at dots that a normal distribution moves about.
    #[test]
    fn a_blur_carries_shares_across() {
        let (window, places) = (ComparedArea::new([0.0; 2], [4.0, 2.0], 1.0), [96i64, 48]);
        let blur = [0.2, 0.35];
        let area = Area { left: 0, top: 0, width: 96, length: 48 };
        let dark = |x: i64, y: i64| u8::from(x < 43 && y > 20);
        let found = window.shares(&Covering::Dots { area, stacks: 2, at: &dark }, blur, &window.rows());
        for (i, found) in found.chunks_exact(2).enumerate() {
            let part = |c: usize, first: i64| {
                let (mut sum, mut whole, middle) = (0.0, 0.0, [i as f64 + 1.0, 1.0][c]);
                for k in 0..3000 {
                    let t = f64::from(k) / 1500.0 - 1.0;
                    for j in -40..=40 {
                        let z = f64::from(j) / 10.0;
                        let weight = (1.0 - t.abs()) * (-0.5 * z * z).exp();
                        let dot = ((middle + t + blur[c] * z) * places[c] as f64 / window.size[c]).floor();
                        whole += weight;
                        sum += if (dot as i64) < first { weight } else { 0.0 };
                    }
                }
                sum / whole
            };
            let want = part(0, 43) * (1.0 - part(1, 21));
            assert!((f64::from(found[1]) - want).abs() < 0.002, "{i}: {} {want}", found[1]);
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
