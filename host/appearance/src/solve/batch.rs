//! Least squares on the simplex for many pixels of a document, eight at a time.
//!
//! Problem: [`Simplex`](super::Simplex) spends most of its time waiting for itself. Substitutions over supports of three to eight
//! points are chains of dependent operations, and each pixel factors its own.
//! Method: the same active set, with pixels sorted by support. Eight pixels with one support share its factor
//! ([`Supports`]), and each operation of a substitution is done for all of them. Then the gradient of each says whether it is
//! solved, or which point joins; a weight that would become negative says which one leaves. So pixels move from support to
//! support, until none is left. Each begins with the weights that are known of it, or with the best of a few mixtures: the single
//! points, and solutions for pixels that were chosen in advance. A pixel whose support has no factor, or that visits too many, is solved by [`Simplex`](super::Simplex) from
//! where it is.
//! Cost: `O(n p)` a visit and `O(n + s p)` for the start, with s mixtures to start from. Limits: gains by pixels that have supports in
//! common; with hundreds of different ones it is no faster than one at a time.
//! The result for a pixel depends on the matrix, what it starts from and the pixel alone, not on its neighbours or the
//! width of vectors.
//! Source: Van Benthem & Keenan 2004 for pixels sorted by support.

use std::collections::VecDeque;

use super::gram::Gram;
use super::simplex::{Certificate, Simplex, SimplexError, TOLERANCE};
use super::supports::{MOST_POINTS, Support, Supports, row};
use crate::wide::wide;

/// Pixels that share each operation: two of the widest vectors that are used.
const LANES: usize = 8;
type Lane = [f64; LANES];

/// Pixels that are sorted at a time: few enough for the second cache with 57 points, enough to fill the lanes.
const BATCH: usize = 2048;
/// The most mixtures to start from, beside the single points: enough, for 64 pixels of rusty metal have 14 to
/// 18 different supports.
const MOST_STARTS: usize = 64;
/// Supports that are kept from batch to batch: eighty times as many as a document needs
/// (decisions/gauss-newton-on-the-simplex.md), so that memory stays bounded.
const MOST_SUPPORTS: usize = 8192;
/// Visits before a pixel is left to the solver of one pixel: nearly twice as many as any of rusty metal has needed.
const MOST_VISITS: u16 = 60;

/// A mixture to start from.
#[derive(Clone, Debug)]
struct Start {
    support: u32,
    weights: Vec<(u32, f64)>,
    /// `1/2 a'Ga`.
    quadratic: f64,
}

/// The solver for one matrix, and its workspace. Each thread needs its own: a clone.
#[derive(Clone, Debug)]
pub struct SimplexBatch {
    gram: Gram,
    /// The rows of the matrix in chunks of a lane; the last is filled up with zeros.
    rows: Vec<Lane>,
    starts: Vec<Start>,
    supports: Supports,
    /// How many supports, from the first, belong to the starts.
    permanent: usize,
    /// The pixels that wait at each support, and the supports where some do, in turn.
    waiting: Vec<Vec<u32>>,
    turn: VecDeque<u32>,
    /// Per pixel of the batch: the error that is only rounding, and the visits so far.
    tolerance: Vec<f64>,
    visits: Vec<u16>,
    /// Pixels that one at a time has to solve.
    hard: Vec<u32>,
    products: Vec<Lane>,
    solution: Vec<Lane>,
    gradient: Vec<Lane>,
    simplex: Simplex,
}

/// What a visit says about a pixel.
enum Verdict {
    /// Solved, with this gap.
    Done(f64),
    /// To be looked at with this point added or removed.
    Toggle(u32),
    Hard,
}

impl SimplexBatch {
    /// A solver. `typical` are the inner products (one per row of the matrix each) of some pixels whose solutions are to be
    /// starts: a few dozen from all over the document.
    ///
    /// # Errors
    /// If `typical` does not consist of rows of that length, or something is not finite.
    pub fn new(gram: &Gram, typical: &[f64]) -> Result<SimplexBatch, SimplexError> {
        let n = gram.len();
        let chunks = n.div_ceil(LANES);
        let mut rows = vec![[0.0; LANES]; n * chunks];
        for i in 0..n {
            for (j, &product) in gram.row(i).iter().enumerate() {
                rows[i * chunks + j / LANES][j % LANES] = product;
            }
        }
        let mut lanes = SimplexBatch {
            gram: gram.clone(),
            rows,
            starts: Vec::new(),
            supports: Supports::default(),
            permanent: 0,
            waiting: Vec::new(),
            turn: VecDeque::new(),
            tolerance: vec![0.0; BATCH],
            visits: vec![0; BATCH],
            hard: Vec::new(),
            products: vec![[0.0; LANES]; n],
            solution: vec![[0.0; LANES]; MOST_POINTS],
            gradient: vec![[0.0; LANES]; chunks],
            simplex: Simplex::new(),
        };
        for k in 0..n {
            lanes.start(&[(k as u32, 1.0)]);
        }
        lanes.permanent = lanes.supports.len();
        let mut solutions = vec![0.0; typical.len()];
        lanes.solve(typical, &mut solutions)?;
        lanes.supports.truncate(lanes.permanent);
        for solution in solutions.chunks_exact(n) {
            if lanes.starts.len() >= n + MOST_STARTS {
                break;
            }
            let weights = solution.iter().enumerate().filter(|(_, w)| **w > 0.0);
            let weights: Vec<(u32, f64)> = weights.map(|(k, &w)| (k as u32, w)).collect();
            lanes.start(&weights);
        }
        lanes.permanent = lanes.supports.len();
        Ok(lanes)
    }

    /// Adds a mixture to start from, if its support is new and has a factor.
    fn start(&mut self, weights: &[(u32, f64)]) {
        let known = self.supports.len();
        let points = weights.iter().map(|&(k, _)| k).collect();
        let Some(support) = self.supports.index_of(&self.gram, points).filter(|&new| new as usize == known)
        else {
            return;
        };
        let mut quadratic = 0.0;
        for &(i, a) in weights {
            for &(j, b) in weights {
                quadratic += 0.5 * a * b * self.gram.row(i as usize)[j as usize];
            }
        }
        self.starts.push(Start { support, weights: weights.to_vec(), quadratic });
    }

    /// Minimises `1/2 a'Ga - h'a` over the simplex for many h. `h` has the inner products of one pixel after the other, and `a`
    /// receives their weights; both have one value per row of the matrix for each pixel.
    ///
    /// Returns the largest gap, and the steps of all pixels together.
    ///
    /// # Errors
    /// If the lengths disagree or are no multiple of the number of rows, or something is not finite. Then `a` holds no
    /// solutions.
    pub fn solve(&mut self, h: &[f64], a: &mut [f64]) -> Result<Certificate, SimplexError> {
        a.fill(0.0);
        self.solve_from(h, a)
    }

    /// The same where `a` holds weights that are nearly right, such as those for a matrix a little different: a pixel with weights that
    /// are not negative and sum to one starts from their support.
    ///
    /// # Errors
    /// Those of [`SimplexBatch::solve`].
    pub fn solve_from(&mut self, h: &[f64], a: &mut [f64]) -> Result<Certificate, SimplexError> {
        let n = self.gram.len();
        if n == 0 || h.len() != a.len() || !h.len().is_multiple_of(n) {
            return Err(SimplexError::Size { points: n, products: h.len(), weights: a.len() });
        }
        let mut total = Certificate { gap: 0.0, steps: 0 };
        for (h, a) in h.chunks(BATCH * n).zip(a.chunks_mut(BATCH * n)) {
            if self.supports.len() > MOST_SUPPORTS {
                self.supports.truncate(self.permanent);
                self.waiting.truncate(self.permanent);
            }
            let certificate = self.batch(h, a)?;
            total.gap = total.gap.max(certificate.gap);
            total.steps = total.steps.saturating_add(certificate.steps);
        }
        Ok(total)
    }

    fn batch(&mut self, h: &[f64], a: &mut [f64]) -> Result<Certificate, SimplexError> {
        wide(
            #[inline(always)]
            || self.batch_plainly(h, a),
        )
    }

    #[inline(always)]
    fn batch_plainly(&mut self, h: &[f64], a: &mut [f64]) -> Result<Certificate, SimplexError> {
        let n = self.gram.len();
        self.hard.clear();
        self.begin(h, a)?;
        let mut total = Certificate { gap: 0.0, steps: 0 };
        let mut pixels = Vec::new();
        let mut verdicts = Vec::new();
        while let Some(number) = self.turn.pop_front() {
            std::mem::swap(&mut pixels, &mut self.waiting[number as usize]);
            verdicts.clear();
            for group in pixels.chunks(LANES) {
                self.visit(number, group, h, a, &mut verdicts);
            }
            total.steps = total.steps.saturating_add(pixels.len() as u32);
            for (&pixel, verdict) in pixels.iter().zip(&verdicts) {
                match *verdict {
                    Verdict::Done(gap) => total.gap = total.gap.max(gap),
                    Verdict::Toggle(k) => match self.supports.toggled(&self.gram, number, k) {
                        Some(next) => self.wait(next, pixel),
                        None => self.hard.push(pixel),
                    },
                    Verdict::Hard => self.hard.push(pixel),
                }
            }
            pixels.clear();
        }
        for &pixel in &self.hard {
            let at = pixel as usize * n;
            // Without what it has learned from other pixels, so that the result is the same without them.
            self.simplex.forget();
            let certificate = self.simplex.solve(&self.gram, &h[at..][..n], &mut a[at..][..n])?;
            total.gap = total.gap.max(certificate.gap);
            total.steps = total.steps.saturating_add(certificate.steps);
        }
        Ok(total)
    }

    /// Puts each pixel where it starts.
    #[inline(always)]
    fn begin(&mut self, h: &[f64], a: &mut [f64]) -> Result<(), SimplexError> {
        let n = self.gram.len();
        let largest = self.gram.largest();
        for (i, (h, a)) in h.chunks(LANES * n).zip(a.chunks_mut(LANES * n)).enumerate() {
            let filled = h.len() / n;
            let mut scale = [largest; LANES];
            let mut finite = [0.0; LANES];
            for lane in 0..LANES {
                let h = &h[lane.min(filled - 1) * n..][..n];
                self.products.iter_mut().zip(h).for_each(|(products, &h)| products[lane] = h);
            }
            for products in &self.products {
                for lane in 0..LANES {
                    let size = products[lane].abs();
                    scale[lane] = if size > scale[lane] { size } else { scale[lane] };
                    // Infinite and undefined numbers times zero are undefined, and stay so.
                    finite[lane] += 0.0 * size;
                }
            }
            if finite.iter().any(|f| f.is_nan()) {
                self.turn.iter().for_each(|&number| self.waiting[number as usize].clear());
                self.turn.clear();
                return Err(SimplexError::NotFinite);
            }
            let mut least = [f64::INFINITY; LANES];
            let mut best = [0u64; LANES];
            for (s, start) in self.starts.iter().enumerate() {
                let mut value = [start.quadratic; LANES];
                for &(k, w) in &start.weights {
                    let products = &self.products[k as usize];
                    for lane in 0..LANES {
                        value[lane] -= w * products[lane];
                    }
                }
                for lane in 0..LANES {
                    let lower = value[lane] < least[lane];
                    least[lane] = if lower { value[lane] } else { least[lane] };
                    best[lane] = if lower { s as u64 } else { best[lane] };
                }
            }
            for (lane, a) in a.chunks_exact_mut(n).enumerate() {
                let pixel = i * LANES + lane;
                self.tolerance[pixel] = 2.0 * TOLERANCE * scale[lane];
                self.visits[pixel] = 0;
                if let Some(support) = self.known(a) {
                    self.wait(support, pixel as u32);
                    continue;
                }
                a.fill(0.0);
                match self.starts.get(best[lane] as usize) {
                    Some(start) => {
                        start.weights.iter().for_each(|&(k, w)| a[k as usize] = w);
                        self.wait(start.support, pixel as u32);
                    }
                    None => self.hard.push(pixel as u32),
                }
            }
        }
        Ok(())
    }

    /// The support of weights on the simplex, if it has a factor.
    fn known(&mut self, a: &[f64]) -> Option<u32> {
        let sum: f64 = a.iter().sum();
        if !(1.0 - 1e-9..=1.0 + 1e-9).contains(&sum) || a.iter().any(|&a| a < 0.0) {
            return None;
        }
        let points = (0..).zip(a).filter(|(_, a)| **a > 0.0).map(|(k, _)| k).collect();
        self.supports.index_of(&self.gram, points)
    }

    /// Has a pixel wait at a support.
    #[inline(always)]
    fn wait(&mut self, number: u32, pixel: u32) {
        if self.waiting.len() <= number as usize {
            self.waiting.resize_with(number as usize + 1, Vec::new);
        }
        let waiting = &mut self.waiting[number as usize];
        if waiting.is_empty() {
            self.turn.push_back(number);
        }
        waiting.push(pixel);
    }

    /// Moves up to eight pixels to the optimum on their support, or as far as their weights allow.
    #[inline(always)]
    fn visit(&mut self, number: u32, group: &[u32], h: &[f64], a: &mut [f64], verdicts: &mut Vec<Verdict>) {
        let n = self.gram.len();
        let support = self.supports.get(number);
        let p = support.points.len();
        let y = &mut self.solution[..p];
        for (y, &k) in y.iter_mut().zip(&support.points) {
            for lane in 0..LANES {
                let pixel = group[lane.min(group.len() - 1)] as usize;
                y[lane] = h[pixel * n + k as usize];
            }
        }
        optimum(support, y);
        let mut least = y[0];
        for y in &*y {
            for lane in 0..LANES {
                least[lane] = if y[lane] < least[lane] { y[lane] } else { least[lane] };
            }
        }
        for (lane, &pixel) in group.iter().enumerate() {
            let pixel = pixel as usize;
            let (h, a) = (&h[pixel * n..][..n], &mut a[pixel * n..][..n]);
            self.visits[pixel] += 1;
            let verdict = if self.visits[pixel] > MOST_VISITS {
                Verdict::Hard
            } else if least[lane] > 0.0 {
                let (verdict, gap) = price(&self.rows, support, y, lane, h, &mut self.gradient);
                support.points.iter().zip(&*y).for_each(|(&k, y)| a[k as usize] = y[lane]);
                if gap <= self.tolerance[pixel] {
                    Verdict::Done(gap.max(0.0))
                } else if gap.is_finite() && !support.points.contains(&verdict) {
                    Verdict::Toggle(verdict)
                } else {
                    Verdict::Hard
                }
            } else if least[lane].is_finite() {
                Verdict::Toggle(support.points[retreat(support, y, lane, a)])
            } else {
                Verdict::Hard
            };
            verdicts.push(verdict);
        }
    }
}

/// Solves on a support: `y` has the inner products and receives the weights, which sum to 1 and may be negative.
#[inline(always)]
fn optimum(support: &Support, y: &mut [Lane]) {
    let p = y.len();
    // (G + shift) y = h + level, with the level that makes the sum 1.
    let mut sum = [0.0; LANES];
    for i in 0..p {
        let row = row(&support.factor, i);
        let mut value = y[i];
        for (y, l) in y[..i].iter().zip(row) {
            for lane in 0..LANES {
                value[lane] -= l * y[lane];
            }
        }
        for lane in 0..LANES {
            value[lane] *= row[i];
            sum[lane] += value[lane] * support.ones[i];
        }
        y[i] = value;
    }
    let level = sum.map(|sum| (1.0 - sum) * support.per_ones);
    for (y, one) in y.iter_mut().zip(&support.ones) {
        for lane in 0..LANES {
            y[lane] += level[lane] * one;
        }
    }
    let mut sum = [0.0; LANES];
    for i in (0..p).rev() {
        let row = row(&support.factor, i);
        let (before, rest) = y.split_at_mut(i);
        let value = &mut rest[0];
        for lane in 0..LANES {
            value[lane] *= row[i];
            sum[lane] += value[lane];
        }
        for (y, l) in before.iter_mut().zip(row) {
            for lane in 0..LANES {
                y[lane] -= l * value[lane];
            }
        }
    }
    // Rounding may have changed the sum.
    let scale = sum.map(|sum| 1.0 / sum);
    for y in y {
        for lane in 0..LANES {
            y[lane] *= scale[lane];
        }
    }
}

/// The point with the least gradient at the weights of one lane, and the gap.
#[inline(always)]
fn price(
    rows: &[Lane],
    support: &Support,
    y: &[Lane],
    lane: usize,
    h: &[f64],
    gradient: &mut [Lane],
) -> (u32, f64) {
    let chunks = gradient.len();
    let mut least = [f64::INFINITY; LANES];
    for (c, (sums, h)) in gradient.iter_mut().zip(h.chunks(LANES)).enumerate() {
        // Where there is no point, the gradient stays as large as numbers go.
        let mut sum = [f64::MAX; LANES];
        match <&Lane>::try_from(h) {
            Ok(h) => (0..LANES).for_each(|x| sum[x] = -h[x]),
            Err(_) => sum.iter_mut().zip(h).for_each(|(sum, h)| *sum = -h),
        }
        for (&k, y) in support.points.iter().zip(y) {
            let row = &rows[k as usize * chunks + c];
            for x in 0..LANES {
                sum[x] += y[lane] * row[x];
            }
        }
        for x in 0..LANES {
            least[x] = if sum[x] < least[x] { sum[x] } else { least[x] };
        }
        *sums = sum;
    }
    let slope = |k: usize| gradient[k / LANES][k % LANES];
    let mut level = 0.0;
    for (&k, y) in support.points.iter().zip(y) {
        level += y[lane] * slope(k as usize);
    }
    let least = least.iter().copied().fold(f64::INFINITY, f64::min);
    let joining = gradient.as_flattened().iter().position(|&slope| slope == least);
    // Without a least one, numbers have overflowed.
    joining.map_or((0, f64::NAN), |k| (k as u32, level - least))
}

/// Moves the weights `a` toward the optimum of one lane until the first is zero; returns its position in the support.
#[inline(always)]
fn retreat(support: &Support, y: &[Lane], lane: usize, a: &mut [f64]) -> usize {
    let (mut length, mut blocking) = (f64::INFINITY, 0);
    for (i, (&k, y)) in support.points.iter().zip(y).enumerate() {
        let (from, to) = (a[k as usize], y[lane]);
        // A point that has just joined and cannot grow leaves again.
        let reach = if from > 0.0 { from / (from - to) } else { 0.0 };
        if to <= 0.0 && reach < length {
            (length, blocking) = (reach, i);
        }
    }
    for (&k, y) in support.points.iter().zip(y) {
        let a = &mut a[k as usize];
        *a = (*a + length * (y[lane] - *a)).max(0.0);
    }
    a[support.points[blocking] as usize] = 0.0;
    blocking
}

#[cfg(test)]
mod tests;
