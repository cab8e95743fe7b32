//! The mean weights over the footprints of pixels.
//!
//! Problem: a pixel sees more than one place of a weight map, or less, and weights are what a frame reads most of.
//! Method: trilinear (Williams 1983). The value is a line between two levels of the pyramid, so each level has a share, which
//! falls to nothing one level further. For each level that a block of pixels needs, places and fractions are found in lanes
//! over the pixels; then the weights of four places a pixel are mixed in lanes over the curves.
//! A pixel that sees few printed dots looks at the dots instead: the mean of sixteen places of it up to two dots a pixel, as in the
//! page, and of two places a dot in both directions where the map has fewer places than that. What dot gain takes from a dot is
//! what it takes from the mean around, in proportion to the flat bodies.
//! Cost: for each pixel four places of two levels. Limits: alike in all directions, so a sheet seen at a grazing angle is
//! soft across.

use crate::lit::{Dots, LANES, Level, Lit};
use crate::ray::{BLOCK, Hits, Values, greater, lesser};

/// 2^23: numbers below it that were added to it are integers, in the lowest bits of their sum.
const INTEGERS: f32 = 8_388_608.0;

/// The four places of a grid around each pixel of a block.
pub(crate) struct Corners {
    /// The one at the top left.
    pub first: [u32; BLOCK],
    /// How far the pixel is on the way to the next one across and down, 0 to 1.
    pub parts: [Values; 2],
    /// From the first to the next one across, and down.
    pub next: [usize; 2],
}

impl Default for Corners {
    fn default() -> Corners {
        Corners { first: [0; BLOCK], parts: [[0.0; BLOCK]; 2], next: [0; 2] }
    }
}

impl Corners {
    /// Those of a grid of `width` x `height` values, row by row, of which each stands in the middle of its part of the sheet, or,
    /// with `edges`, of which the outermost stand on the sheet's edges.
    #[inline(always)]
    pub fn find(&mut self, [u, v]: &[Values; 2], width: usize, height: usize, edges: bool) {
        self.next = [usize::from(width > 1), if height > 1 { width } else { 0 }];
        // A value's number is a line of the place. The last pair of values reaches to the edge.
        let line = |side: usize| {
            let (most, last) = ((side - 1) as f32, side.saturating_sub(2) as f32);
            if edges { (most, 0.0, most, last) } else { (side as f32, 0.5, most, last) }
        };
        let (across, down) = (line(width), line(height));
        let split = |at: f32, (scale, off, most, last): (f32, f32, f32, f32)| {
            let at = greater(lesser(at * scale - off, most), 0.0);
            let low = lesser(floor(at), last);
            (integer(low), at - low)
        };
        for i in 0..BLOCK {
            let ((x, right), (y, below)) = (split(u[i], across), split(v[i], down));
            self.first[i] = y.wrapping_mul(width as u32).wrapping_add(x);
            (self.parts[0][i], self.parts[1][i]) = (right, below);
        }
    }
}

/// For each pixel of a block the weight of every curve.
pub(crate) struct Weights {
    corners: Corners,
    shares: Values,
    /// What pixels read from the map: 0 for none.
    read: Values,
    /// At how many places across and down pixels look at the dots: 0 for none.
    sides: [u32; BLOCK],
    /// As many groups of lanes a pixel as the curves take.
    pub values: Vec<[f32; LANES]>,
}

impl Weights {
    /// Memory for weights of this `stride`.
    pub fn new(stride: usize) -> Weights {
        Weights {
            corners: Corners::default(),
            shares: [0.0; BLOCK],
            read: [0.0; BLOCK],
            sides: [0; BLOCK],
            values: vec![[0.0; LANES]; BLOCK * stride / LANES],
        }
    }

    /// Reads the weights of all pixels that the sheet covers.
    #[inline(always)]
    pub fn read(&mut self, lit: &Lit, hits: &Hits) {
        self.read = hits.covered;
        let Some(dots) = &lit.dots else { return self.mean(lit, hits) };
        self.sides = dots.sides(hits);
        if lit.bodies.is_empty() {
            for i in 0..BLOCK {
                self.read[i] = if self.sides[i] > 0 { 0.0 } else { self.read[i] };
            }
        }
        self.mean(lit, hits);
        self.look(lit, dots, hits);
    }

    /// Reads the mean weights from the map.
    #[inline(always)]
    fn mean(&mut self, lit: &Lit, hits: &Hits) {
        let groups = lit.stride / LANES;
        let last = (lit.levels.len() - 1) as f32;
        // A level below the first needed one and above the last has no share in any pixel.
        let (mut first, mut end) = (u32::MAX, 0);
        for i in 0..BLOCK {
            let level = integer(floor(lesser(hits.level[i], last)));
            let seen = self.read[i] > 0.0;
            first = first.min(if seen { level } else { u32::MAX });
            end = end.max(if seen { level + 2 } else { 0 });
        }
        self.values.fill([0.0; LANES]);
        let end = (end as usize).min(lit.levels.len());
        for number in first as usize..end {
            for i in 0..BLOCK {
                let share = 1.0 - (lesser(hits.level[i], last) - number as f32).abs();
                self.shares[i] = if self.read[i] > 0.0 { share } else { 0.0 };
            }
            let level = &lit.levels[number];
            self.corners.find(&hits.place, level.width, level.height, false);
            self.add(level, groups);
        }
    }

    /// Adds the share of one level.
    #[inline(always)]
    fn add(&mut self, level: &Level, groups: usize) {
        let [across, down] = self.corners.next.map(|next| next * groups);
        let all = level.weights.as_chunks::<LANES>().0;
        for (i, out) in self.values.chunks_exact_mut(groups).enumerate() {
            let share = self.shares[i];
            if share > 0.0 {
                let (right, below) = (self.corners.parts[0][i], self.corners.parts[1][i]);
                let top = &all[self.corners.first[i] as usize * groups..];
                let bottom = &top[down..];
                let (a, b) = (&top[..groups], &top[across..][..groups]);
                let (c, d) = (&bottom[..groups], &bottom[across..][..groups]);
                for (k, out) in out.iter_mut().enumerate() {
                    // Copies, because the compiler has to know that what is written is not read again.
                    let (a, b, c, d, mut sum) = (a[k], b[k], c[k], d[k], *out);
                    for l in 0..LANES {
                        let (top, bottom) = (a[l] + right * (b[l] - a[l]), c[l] + right * (d[l] - c[l]));
                        sum[l] += share * (top + below * (bottom - top));
                    }
                    *out = sum;
                }
            }
        }
    }
}

impl Weights {
    /// Makes the weights of pixels from the dots that they look at.
    fn look(&mut self, lit: &Lit, dots: &Dots, hits: &Hits) {
        let groups = lit.stride / LANES;
        for (i, out) in self.values.chunks_exact_mut(groups).enumerate() {
            let side = self.sides[i];
            if side == 0 {
                continue;
            }
            let out = out.as_flattened_mut();
            let known = lit.bodies.len();
            let around = bodies(out, &lit.bodies);
            let lost = lit.bodies.first().map(|_| [out[known], out[known + 1], out[known + 2]]);
            out.fill(0.0);
            let part = 1.0 / (side * side) as f32;
            dots.each(hits, i, side, |curve| out[usize::from(curve)] += part);
            if let Some(lost) = lost {
                let here = bodies(out, &lit.bodies);
                for c in 0..3 {
                    out[known + c] = if around[c] > 0.0 { here[c] * (lost[c] / around[c]) } else { 0.0 };
                }
            }
        }
    }
}

/// The flat body of a mixture.
fn bodies(weights: &[f32], bodies: &[[f32; 3]]) -> [f32; 3] {
    let mut sum = [0.0; 3];
    for (w, body) in weights.iter().zip(bodies) {
        (0..3).for_each(|c| sum[c] += w * body[c]);
    }
    sum
}

impl Dots {
    /// For each pixel of a block, at how many places across and down it looks at the dots; 0 if it sees too many of them.
    #[inline(always)]
    fn sides(&self, hits: &Hits) -> [u32; BLOCK] {
        let mut sides = [0; BLOCK];
        for (i, side) in sides.iter_mut().enumerate() {
            let square = |step: &[Values; 2]| {
                let (across, down) = (step[0][i] * self.density[0], step[1][i] * self.density[1]);
                across * across + down * down
            };
            let dots = greater(square(&hits.steps[0]), square(&hits.steps[1])).sqrt();
            // Not so where it is no number, at silhouettes.
            let few = (hits.covered[i] > 0.0) & (dots < self.few);
            let places = if dots < 2.0 { 4 } else { 2 * integer(floor(lesser(dots, 100.0)) + 1.0) };
            *side = if few { places } else { 0 };
        }
        sides
    }

    /// Calls `each` with the curve of the dot at `side` x `side` places of a pixel.
    fn each(&self, hits: &Hits, i: usize, side: u32, mut each: impl FnMut(u8)) {
        let step = |n: usize| {
            let [right, up] = &hits.steps[n];
            [right[i] * self.density[0], -up[i] * self.density[1]]
        };
        let (across, down) = (step(0), step(1));
        let middle = [hits.place[0][i] * self.width as f32, hits.place[1][i] * self.height as f32];
        let part = |n: u32| (n as f32 + 0.5) / side as f32 - 0.5;
        let place = |at: f32, side: usize| greater(lesser(at, (side - 1) as f32), 0.0) as usize;
        for (y, x) in (0..side).flat_map(|y| (0..side).map(move |x| (y, x))) {
            let at = |c: usize| middle[c] + part(x) * across[c] + part(y) * down[c];
            let (column, row) = (place(at(0), self.width), place(at(1), self.height));
            each(self.curves[row * self.width + column]);
        }
    }
}

/// The greatest integer up to a number from 0 to 2^22. Unlike [`f32::floor`] it is no call anywhere.
#[inline(always)]
pub(crate) fn floor(x: f32) -> f32 {
    let nearest = (x + INTEGERS) - INTEGERS;
    if nearest > x { nearest - 1.0 } else { nearest }
}

/// An integer from 0 to 2^22.
#[inline(always)]
pub(crate) fn integer(x: f32) -> u32 {
    (x + INTEGERS).to_bits() & 0x007f_ffff
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lit::pyramid;
    use proptest::prelude::*;

    /// Noise on `width` x `height` places of two groups of curves.
    fn lit(width: usize, height: usize) -> Lit {
        let stride = 2 * LANES;
        let noise = |i: usize| (i.wrapping_mul(2_654_435_761) >> 9 & 0xffff) as f32 / 65536.0;
        let weights = (0..width * height * stride).map(noise).collect();
        let levels = pyramid(Level { width, height, weights }, stride);
        Lit { size: [0.1, 0.1], curves: Vec::new(), stride, levels, dots: None, bodies: Vec::new() }
    }

    /// The weight of curve `k`, by the formula of Williams in f64.
    fn by_hand(lit: &Lit, u: f64, v: f64, level: f64, k: usize) -> f64 {
        let level = level.min((lit.levels.len() - 1) as f64);
        let within = |number: usize| {
            let level = &lit.levels[number];
            let place = |at: f64, side: usize| (at * side as f64 - 0.5).clamp(0.0, (side - 1) as f64);
            let (x, y) = (place(u, level.width), place(v, level.height));
            let mut sum = 0.0;
            for (px, py) in [(x.floor(), y.floor()), (x.floor(), y.floor() + 1.0)]
                .into_iter()
                .flat_map(|(px, py)| [(px, py), (px + 1.0, py)])
            {
                let part = (1.0 - (x - px).abs()) * (1.0 - (y - py).abs());
                let place =
                    (py as usize).min(level.height - 1) * level.width + (px as usize).min(level.width - 1);
                sum += part * f64::from(level.weights[place * lit.stride + k]);
            }
            sum
        };
        let (low, part) = (level as usize, level.fract());
        let high = (low + 1).min(lit.levels.len() - 1);
        (1.0 - part) * within(low) + part * within(high)
    }

    proptest! {
        #![proptest_config(testing::cases(100))]

        #[test]
        fn weights_are_the_formula_of_williams(
            pixels in prop::collection::vec((0.0f32..=1.0, 0.0f32..=1.0, 0.0f32..10.0, any::<bool>()), BLOCK),
            flat in prop::option::of(0.0f32..9.0),
            side in 0..3usize,
        ) {
            let lit = lit([96, 32, 1][side], [64, 1, 1][side]);
            let mut hits = Hits::default();
            for (i, &(u, v, level, covered)) in pixels.iter().enumerate() {
                (hits.place[0][i], hits.place[1][i]) = (u, v);
                hits.level[i] = flat.unwrap_or(level);
                hits.covered[i] = f32::from(covered);
            }
            let mut weights = Weights::new(lit.stride);
            weights.read(&lit, &hits);
            for (i, &(u, v, _, covered)) in pixels.iter().enumerate() {
                for k in 0..lit.stride {
                    let found = f64::from(weights.values.as_flattened()[i * lit.stride + k]);
                    let expected = by_hand(&lit, f64::from(u), f64::from(v), f64::from(hits.level[i]), k);
                    let expected = if covered { expected } else { 0.0 };
                    prop_assert!((found - expected).abs() < 3e-5, "{} {}: {}, not {}", i, k, found, expected);
                }
            }
        }
    }

    #[test]
    fn integers_are_those_of_the_language() {
        let mut x = 0.0f32;
        while x < 4_194_304.0 {
            for x in [x, x.next_up(), x.next_down().max(0.0)] {
                assert_eq!((floor(x), integer(floor(x))), (x.floor(), x as u32), "{x}");
            }
            x = if x < 40.0 { x + 0.5 } else { (x * 1.01).ceil() };
        }
    }
}
