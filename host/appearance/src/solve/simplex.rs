//! Least squares on the simplex: the point of a convex hull nearest to a target.
//!
//! Problem: minimise `1/2 a'Ga - h'a` over `a >= 0, sum a = 1`, with G the Gram matrix of the hull's points and
//! h their inner products with the target.
//! Method: primal active set. A Cholesky factor of G on the support (the points with positive weight) gives the step to
//! their joint optimum. A step that would make a weight negative stops at the boundary and drops the point. At the optimum
//! the point with the steepest reduced gradient joins, until no point descends. Every step starts from the gradient at the
//! current point, so errors of the factor correct themselves. A point that depends on the support (a duplicate, or a point
//! inside its hull) joins by exchange: weight moves along the flat direction until some point has none left and leaves. So
//! the support is always affinely independent.
//! Cost: O(n p) for each change of a support of p of n points, no allocation; a warm start from a similar target needs few
//! changes. Limits: at most `20 n + 100` steps, ten times as many as the method has ever needed; whenever it ends, the
//! weights are feasible and the certificate bounds the remaining error.
//! Source: Lawson & Hanson 1974, chapter 23, with the equality kept exactly instead of by a heavily weighted row.

use super::gram::Gram;
use super::vector::{add_scaled, dot, dot_short, least};
use crate::wide::wide;

/// Reduced gradients within this share of the problem's scale count as zero: about a hundred roundings.
pub(super) const TOLERANCE: f64 = 4e-14;
/// Squared relative distance to the hull of the support below which a point counts as dependent on it: some
/// fifty roundings of a double, below which a distance would be chance.
const PIVOT_FLOOR: f64 = 1e-14;

/// A bound on the error of a solution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Certificate {
    /// The Frank-Wolfe gap `max_k grad.(a - e_k)`: no weights have an objective lower by more than this. In units of the
    /// objective; for a solved problem, about 1e-14 of the largest entry of the Gram matrix.
    pub gap: f64,
    /// Steps taken.
    pub steps: u32,
}

/// Why there is no solution.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum SimplexError {
    /// Lengths differ or are zero.
    #[error(
        "a hull of {points} points needs as many inner products and weights, and at least one; found {products} inner \
         products and {weights} weights"
    )]
    Size {
        /// Points of the hull.
        points: usize,
        /// Inner products given.
        products: usize,
        /// Weights given.
        weights: usize,
    },
    /// Some number is infinite or not a number.
    #[error("the least-squares problem contains an infinite or undefined number")]
    NotFinite,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum SupportStatus {
    Out,
    /// On the support.
    In,
    /// Off the support, and not accepted again until the weights have moved: it joined and could not grow.
    Refused,
}

/// The solver and its workspace. Each thread needs its own.
#[derive(Clone, Debug, Default)]
pub struct Simplex {
    n: usize,
    support: Vec<usize>,
    /// Points whose row of the factor is out of date, last first.
    pending: Vec<usize>,
    place: Vec<SupportStatus>,
    refused: Vec<usize>,
    /// Lower Cholesky factor of the shifted Gram matrix on the support, rows `n` apart, diagonal inverted.
    factor: Vec<f64>,
    /// `factor^-1` times the vector of ones.
    ones: Vec<f64>,
    step: Vec<f64>,
    gradient: Vec<f64>,
    /// The edition of the matrix that the factor on the support belongs to.
    edition: u64,
}

impl Simplex {
    /// A solver. It allocates for the first problem of a given size and not afterwards.
    pub fn new() -> Simplex {
        Simplex::default()
    }

    /// Minimises `1/2 a'Ga - h'a` over the simplex. `a` is the warm start, ideally the solution of a similar problem, and
    /// receives the solution. A start that is not a point of the simplex (for example all zeros) is a cold start. `h` and
    /// `a` have one value per row of the Gram matrix.
    ///
    /// Uses the widest vectors of the processor. The order of additions does not depend on the width, and neither does the
    /// result.
    pub fn solve(&mut self, gram: &Gram, h: &[f64], a: &mut [f64]) -> Result<Certificate, SimplexError> {
        wide(
            #[inline(always)]
            || self.solve_plainly(gram, h, a),
        )
    }

    #[inline(always)]
    fn solve_plainly(&mut self, gram: &Gram, h: &[f64], a: &mut [f64]) -> Result<Certificate, SimplexError> {
        let n = gram.len();
        if h.len() != n || a.len() != n || n == 0 {
            return Err(SimplexError::Size { points: n, products: h.len(), weights: a.len() });
        }
        if !normalise(a) {
            // The vertex with the lowest objective; `total_cmp` orders numbers that are not finite too.
            let value = |k: usize| 0.5 * gram.row(k)[k] - h[k];
            let best = (0..n).min_by(|&i, &j| value(i).total_cmp(&value(j))).unwrap_or(0);
            a.fill(0.0);
            a[best] = 1.0;
        }
        self.reset(n);
        let scale = h.iter().fold(gram.largest(), |scale, h| scale.max(h.abs()));
        let mut gradient = std::mem::take(&mut self.gradient);
        let mut steps = 0;
        let gap = loop {
            // Recomputed every time, because the running gradient of the search accumulates rounding errors.
            evaluate(gram, h, a, &mut gradient);
            let gap = frank_wolfe_gap(&gradient, a);
            if steps > 0 && (gap <= 2.0 * TOLERANCE * scale || steps >= most_steps(n)) || gap.is_nan() {
                break gap;
            }
            let before = steps;
            steps += self.search(gram, &mut gradient, a, TOLERANCE * scale, most_steps(n) - steps);
            if steps == before + 1 && before > 0 {
                // Nothing moved: this is as accurate as the numbers allow.
                evaluate(gram, h, a, &mut gradient);
                break frank_wolfe_gap(&gradient, a);
            }
        };
        self.gradient = gradient;
        finish(gap, steps)
    }

    /// Solves the same problem around a point: minimises `q'(y - a) + 1/2 (y - a)'G(y - a)` over y in the simplex, where `q`
    /// is the gradient at `a`, a point of the simplex. `a` becomes y and `q` the gradient there.
    ///
    /// Near the solution, `q` has digits that `h = Ga - q` would lose.
    #[inline(always)]
    pub(crate) fn descend(
        &mut self,
        gram: &Gram,
        q: &mut [f64],
        a: &mut [f64],
    ) -> Result<Certificate, SimplexError> {
        let n = gram.len();
        if q.len() != n || a.len() != n || n == 0 {
            return Err(SimplexError::Size { points: n, products: q.len(), weights: a.len() });
        }
        if !normalise(a) {
            return Err(SimplexError::NotFinite);
        }
        self.reset(n);
        let steps = self.search(gram, q, a, TOLERANCE * gram.largest(), most_steps(n));
        finish(frank_wolfe_gap(q, a), steps)
    }

    /// Forgets the factor of the last support, so that the next result does not depend on it even in the last bit.
    pub(super) fn forget(&mut self) {
        self.edition = 0;
    }

    #[inline(always)]
    fn reset(&mut self, n: usize) {
        if self.n != n {
            (self.n, self.edition) = (n, 0);
            self.support.clear();
        }
        self.place.resize(n, SupportStatus::Out);
        self.gradient.resize(n, 0.0);
        self.ones.resize(n, 0.0);
        self.step.resize(n, 0.0);
        if self.factor.len() < n * n {
            self.factor.resize(n * n, 0.0);
        }
        self.support.reserve(n);
        self.pending.reserve(n);
        self.refused.reserve(n);
    }

    /// Moves from `a`, where the gradient is `g`, to the optimum and updates both. Returns the number of steps, at least 1.
    #[inline(always)]
    fn search(&mut self, gram: &Gram, g: &mut [f64], a: &mut [f64], tolerance: f64, most: u32) -> u32 {
        self.take_support(gram, g, a);
        let mut steps = 0;
        let mut entered = None;
        let mut repeats = 0;
        while steps < most.max(1) {
            steps += 1;
            if self.support.len() > 1 {
                let (length, blocked) = self.step_on_support(gram, g, a);
                if length > 0.0 {
                    while let Some(k) = self.refused.pop() {
                        self.place[k] = SupportStatus::Out;
                    }
                }
                if blocked {
                    if let Some(k) = entered
                        && a[k] <= 0.0
                    {
                        self.refuse(k);
                    }
                    entered = None;
                    continue;
                }
                // With a badly conditioned factor the gradient may still differ over the support; another step corrects it.
                if repeats < 2 && self.unevenness(g) > tolerance {
                    repeats += 1;
                    continue;
                }
            }
            repeats = 0;
            let level = dot(g, a);
            let mut joining = None;
            let mut least = level - tolerance;
            for (k, &slope) in g.iter().enumerate() {
                if slope < least && self.place[k] == SupportStatus::Out {
                    (joining, least) = (Some(k), slope);
                }
            }
            let Some(k) = joining else { break };
            if self.join(gram, g, a, k) {
                entered = joining;
            } else {
                self.refuse(k);
            }
        }
        // Rounding may have changed the sum.
        normalise(a);
        steps
    }

    /// Keeps point `k` from joining until the weights have moved.
    #[inline(always)]
    fn refuse(&mut self, k: usize) {
        self.place[k] = SupportStatus::Refused;
        self.refused.push(k);
    }

    /// Makes the points with weight the support. Neighbouring pixels often have the same support; then its factor is kept.
    #[inline(always)]
    fn take_support(&mut self, gram: &Gram, g: &mut [f64], a: &mut [f64]) {
        self.place.fill(SupportStatus::Out);
        self.refused.clear();
        let same = self.edition == gram.edition()
            && self.support.iter().all(|&k| a[k] > 0.0)
            && a.iter().filter(|&&a| a > 0.0).count() == self.support.len();
        if same {
            self.support.iter().for_each(|&k| self.place[k] = SupportStatus::In);
            return;
        }
        (self.edition, self.n) = (gram.edition(), gram.len());
        self.support.clear();
        for k in 0..self.n {
            if a[k] > 0.0 {
                self.join(gram, g, a, k);
            }
        }
    }

    /// Moves toward the optimum on the support until the first weight reaches zero; that point leaves. Returns the share of
    /// the way taken and whether a point left.
    #[inline(always)]
    fn step_on_support(&mut self, gram: &Gram, g: &mut [f64], a: &mut [f64]) -> (f64, bool) {
        let p = self.support.len();
        let n = self.n;
        // (G + shift) d = level - g with sum d = 0; subtracting a common value first keeps small differences.
        let common = g[self.support[0]];
        for i in 0..p {
            let row = &self.factor[i * n..][..=i];
            let sum = dot_short(&row[..i], &self.step[..i]);
            self.step[i] = (common - g[self.support[i]] - sum) * row[i];
        }
        let level = dot_short(&self.ones[..p], &self.step[..p]) / dot_short(&self.ones[..p], &self.ones[..p]);
        add_scaled(&mut self.step[..p], -level, &self.ones[..p]);
        self.solve_transposed(p);
        let mut length = 1.0;
        let mut blocking = None;
        for (i, &k) in self.support.iter().enumerate() {
            let d = self.step[i];
            if d < 0.0 && a[k] + d <= 0.0 {
                let reach = a[k] / -d;
                if blocking.is_none() || reach < length {
                    (length, blocking) = (reach, Some(k));
                }
            }
        }
        for (i, &k) in self.support.iter().enumerate() {
            let d = length * self.step[i];
            if d != 0.0 {
                a[k] += d;
                add_scaled(g, d, gram.row(k));
            }
        }
        let Some(blocking) = blocking else { return (length, false) };
        a[blocking] = 0.0;
        while let Some(i) = self.support.iter().rposition(|&k| a[k] <= 0.0) {
            let k = self.support[i];
            a[k] = 0.0;
            self.place[k] = SupportStatus::Out;
            self.leave(i);
        }
        self.join_pending(gram, g, a);
        (length, true)
    }

    /// Adds point `k` to the support. If it depends on the points there, weight is exchanged along the flat direction
    /// (downhill, if it slopes) until one of the points has none left and leaves. Returns false if that is `k` itself.
    #[inline(always)]
    fn join(&mut self, gram: &Gram, g: &mut [f64], a: &mut [f64], k: usize) -> bool {
        self.pending.push(k);
        self.join_pending(gram, g, a);
        self.place[k] == SupportStatus::In
    }

    /// Adds the pending points to the support, the last first. This ends, because every exchange removes a point from both
    /// lists.
    #[inline(always)]
    fn join_pending(&mut self, gram: &Gram, g: &mut [f64], a: &mut [f64]) {
        while let Some(k) = self.pending.pop() {
            let p = self.support.len();
            self.support.push(k);
            if self.factor_row(gram, p) {
                self.place[k] = SupportStatus::In;
                continue;
            }
            let gone = self.exchange(gram, g, a);
            a[self.support[gone]] = 0.0;
            self.place[self.support[gone]] = SupportStatus::Out;
            self.leave(gone);
        }
    }

    /// The last point of the support depends on the others. Moves weight along the direction that leaves the mixture
    /// unchanged, and returns the position of the point that has none left.
    #[inline(always)]
    fn exchange(&mut self, gram: &Gram, g: &mut [f64], a: &mut [f64]) -> usize {
        let n = self.n;
        let last = self.support.len() - 1;
        // Exchanges the nearest affine combination of the others for it: d_last = 1, sum d = 0.
        let row = &self.factor[last * n..][..last];
        let ones = &self.ones[..last];
        let level = (dot_short(ones, row) - 1.0) / dot_short(ones, ones);
        for ((d, one), l) in self.step.iter_mut().zip(ones).zip(row) {
            *d = level * one - l;
        }
        self.solve_transposed(last);
        self.step[last] = 1.0;
        let slope: f64 = self.support.iter().zip(&self.step).map(|(&k, d)| g[k] * d).sum();
        // With no weight yet, the last point can only gain.
        let sign = if slope <= 0.0 || a[self.support[last]] <= 0.0 { 1.0 } else { -1.0 };
        let (mut reach, mut blocking) = (f64::INFINITY, last);
        for (i, (&k, d)) in self.support.iter().zip(&self.step).enumerate() {
            if sign * d < 0.0 && a[k] / -(sign * d) < reach {
                (reach, blocking) = (a[k] / -(sign * d), i);
            }
        }
        // The direction sums to zero, so some weight reaches zero, unless numbers have overflowed.
        if reach.is_finite() {
            for (&k, d) in self.support.iter().zip(&self.step) {
                let d = sign * reach * d;
                a[k] = (a[k] + d).max(0.0);
                add_scaled(g, d, gram.row(k));
            }
        }
        blocking
    }

    /// Removes a position of the support; the points after it need new rows of the factor.
    #[inline(always)]
    fn leave(&mut self, position: usize) {
        self.pending.extend(self.support[position + 1..].iter().rev());
        self.support.truncate(position);
    }

    /// `step = factor^-T step` on the first `p` elements.
    #[inline(always)]
    fn solve_transposed(&mut self, p: usize) {
        for i in (0..p).rev() {
            let row = &self.factor[i * self.n..][..=i];
            let value = self.step[i] * row[i];
            self.step[i] = value;
            add_scaled(&mut self.step[..i], -value, &row[..i]);
        }
    }

    /// Computes row `i` of the Cholesky factor. Returns false if the point depends on those before it.
    #[inline(always)]
    fn factor_row(&mut self, gram: &Gram, i: usize) -> bool {
        let n = self.n;
        let (above, rest) = self.factor.split_at_mut(i * n);
        let row = &mut rest[..=i];
        let k = self.support[i];
        let products = gram.row(k);
        for j in 0..i {
            let other = &above[j * n..][..=j];
            let sum = dot_short(&other[..j], &row[..j]);
            row[j] = (products[self.support[j]] + gram.shift() - sum) * other[j];
        }
        let length = products[k] + gram.shift();
        let pivot = length - dot_short(&row[..i], &row[..i]);
        let floor = PIVOT_FLOOR * length;
        row[i] = 1.0 / pivot.max(floor).sqrt();
        self.ones[i] = (1.0 - dot_short(&row[..i], &self.ones[..i])) * row[i];
        pivot > floor
    }

    /// The range of the gradient over the support; 0 at its optimum.
    #[inline(always)]
    fn unevenness(&self, g: &[f64]) -> f64 {
        let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
        for &k in &self.support {
            least = least.min(g[k]);
            most = most.max(g[k]);
        }
        most - least
    }
}

fn most_steps(n: usize) -> u32 {
    (n as u32).saturating_mul(20).saturating_add(100)
}

fn finish(gap: f64, steps: u32) -> Result<Certificate, SimplexError> {
    if gap.is_finite() { Ok(Certificate { gap: gap.max(0.0), steps }) } else { Err(SimplexError::NotFinite) }
}

/// The gradient `Ga - h`.
#[inline(always)]
fn evaluate(gram: &Gram, h: &[f64], a: &[f64], g: &mut [f64]) {
    for (g, h) in g.iter_mut().zip(h) {
        *g = -h;
    }
    for (k, &w) in a.iter().enumerate() {
        if w != 0.0 {
            add_scaled(g, w, gram.row(k));
        }
    }
}

/// `max_k g.(a - e_k)` for a point of the simplex; NaN if any part is NaN.
#[inline(always)]
pub(super) fn frank_wolfe_gap(g: &[f64], a: &[f64]) -> f64 {
    // A gradient that is not finite makes the inner product NaN, even where the weight is zero.
    dot(g, a) - least(g)
}

/// Scales weights to sum 1. Returns false if they cannot be: a weight is negative or not finite, or all are zero.
#[inline(always)]
fn normalise(a: &mut [f64]) -> bool {
    let sum: f64 = a.iter().sum();
    let least = a.iter().copied().fold(f64::INFINITY, f64::min);
    if !(sum.is_finite() && sum > 0.0 && least >= 0.0) || a.iter().any(|w| w.is_nan()) {
        return false;
    }
    if sum != 1.0 {
        let scale = 1.0 / sum;
        a.iter_mut().for_each(|w| *w *= scale);
    }
    true
}

#[cfg(test)]
pub(super) mod tests;
