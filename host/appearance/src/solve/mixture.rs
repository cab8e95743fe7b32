//! Equation 1: the mixture of printable stacks that looks most like a target.
//!
//! Problem: minimise `E(a) = sum_j W_j^2 (cbrt((Aa)_j) - cbrt(t_j))^2 + p'a` over the simplex, where the rows of A
//! are the stacks' reflected radiances, t is the target's, W are the metric's weights and p is a small price of each stack
//! that breaks ties toward fewer layers. The albedos may be further columns ([`Hull::new`]), beside hue in the dark
//! ([`super::hue`]).
//! Method: sequential quadratic steps. At a, the metric is replaced by its Gauss-Newton model, with the exact second
//! derivative where that is positive. [`Simplex`] minimises the model exactly over the stacks in use and those whose
//! gradient shows that they would help; Armijo's rule halves the step. The search ends when the gap is small enough or the
//! objective falls by less than 1e-12 of itself. Every step computes the gradient of all stacks; only half a dozen enter
//! the quadratic.
//! Cost: K m multiplications per step for the gradient (K stacks, m columns), about 5 steps from the tangent start and 2
//! from a neighbour's solution; no allocation. Limits: E is convex where no sample of the mixture exceeds 8 times the
//! target. There the gap bounds the error; elsewhere several starts are the only assurance.
//! Source: eq. 1 of the 2009 paper (section 4.1) with the metric of its appendix.

use super::gram::Gram;
use super::hue::Missed;
use super::hull::{DARKEST, Hull, MixtureError, Target};
use super::root::inverse_cbrt;
use super::simplex::{Simplex, SimplexError, frank_wolfe_gap};
use super::vector::{add_scaled, dot};
use crate::wide::wide;

/// Relative drop of the objective below which the search ends: some thousand roundings of a double, below
/// which a drop would be chance.
const DROP: f64 = 1e-12;
/// The most steps; ten times as many as the slowest of a thousand random problems needs.
const MOST_STEPS: u32 = 100;
/// Halvings of a step before the search gives up: after 30 it is a billionth, which cannot change the result
/// visibly.
const MOST_HALVINGS: u32 = 30;
/// The most stacks that join the mixture in one step: most of those that seem to help do so no longer once the best have moved.
const MOST_JOINING: usize = 3;
/// Two starts agree if their distances differ by less than this: a ten-thousandth of what is barely visible,
/// as much as is measured in decisions/gauss-newton-on-the-simplex.md.
const AGREEMENT: f64 = 1e-6;

/// How good a mixture is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fit {
    /// Distance between mixture and target in the metric of the hull, with light and hue in the dark.
    pub distance: f64,
    /// The part of it that eqs. 2-3 see: distance d.
    pub curve: f64,
    /// Frank-Wolfe gap in squared distance: where E is convex, no mixture has a value of `d^2 + p'a` lower by more than this.
    /// With hue in the dark, which is not convex, that holds for all the rest if the search went as far as possible; otherwise
    /// it says how nearly the search was done.
    pub gap: f64,
    /// Steps taken.
    pub steps: u32,
    /// No sample of the mixture exceeds 8 times the target, so E is convex around it and the gap is a bound.
    pub convex: bool,
}

/// The best mixture over several starts.
#[derive(Clone, Debug, PartialEq)]
pub struct Best {
    /// One weight per stack; 0 or more, with sum 1.
    pub weights: Vec<f64>,
    /// How good it is.
    pub fit: Fit,
    /// Starts tried.
    pub starts: usize,
    /// How many starts reached the same distance within 1e-6.
    pub agreeing: usize,
}

/// The solver of equation 1 and its workspace. Each thread needs its own.
#[derive(Clone, Debug)]
pub struct Mixer {
    simplex: Simplex,
    gram: Gram,
    /// Radiance of the mixture, its change over the full step, and the trial mixture.
    mix: Vec<f64>,
    change: Vec<f64>,
    trial: Vec<f64>,
    /// Per column: inverse cube root of the radiance, and weighted difference of the cube roots.
    inverse: Vec<f64>,
    residual: Vec<f64>,
    /// Per column: residual times slope, and the root of the model's curvature.
    pull: Vec<f64>,
    stiffness: Vec<f64>,
    /// What the trial mixture misses of the target's hue in the dark.
    hue: Missed,
    /// Half the gradient, one value per stack.
    slope: Vec<f64>,
    /// Whether each stack is excluded.
    closed: Vec<bool>,
    /// The stacks of the quadratic, and their stiffness-scaled rows, slopes and weights.
    working: Vec<usize>,
    scaled: Vec<f64>,
    working_slope: Vec<f64>,
    working_weights: Vec<f64>,
}

impl Default for Mixer {
    fn default() -> Mixer {
        Mixer::new()
    }
}

impl Mixer {
    /// A solver. It allocates for the first problem of a given size and not afterwards.
    pub fn new() -> Mixer {
        Mixer {
            simplex: Simplex::new(),
            gram: Gram::empty(),
            mix: Vec::new(),
            change: Vec::new(),
            trial: Vec::new(),
            inverse: Vec::new(),
            residual: Vec::new(),
            pull: Vec::new(),
            stiffness: Vec::new(),
            hue: Missed::default(),
            slope: Vec::new(),
            closed: Vec::new(),
            working: Vec::new(),
            scaled: Vec::new(),
            working_slope: Vec::new(),
            working_weights: Vec::new(),
        }
    }

    #[inline(always)]
    fn resize(&mut self, hull: &Hull) {
        let (k, m) = (hull.len(), hull.columns());
        for columns in [
            &mut self.mix,
            &mut self.change,
            &mut self.trial,
            &mut self.inverse,
            &mut self.residual,
            &mut self.pull,
            &mut self.stiffness,
        ] {
            columns.resize(m, 0.0);
        }
        self.slope.resize(k, 0.0);
        self.scaled.resize(k * m, 0.0);
    }

    /// The minimum over several starts: the tangent start, the linear start (least squares without the cube root), equal
    /// weights, and the four nearest single stacks.
    pub fn best(&mut self, hull: &Hull, target: &Target) -> Result<Best, MixtureError> {
        let k = hull.len();
        let mut starts = Vec::new();
        for metric in [Linear::Tangent, Linear::Plain] {
            let mut a = vec![0.0; k];
            self.linear(hull, target, metric, &mut a)?;
            starts.push(a);
        }
        starts.push(vec![1.0 / k as f64; k]);
        let single = |i: usize| {
            let mut a = vec![0.0; k];
            a[i] = 1.0;
            a
        };
        let mut nearest: Vec<(f64, usize)> = (0..k).map(|i| (hull.distance(&single(i), target), i)).collect();
        nearest.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        starts.extend(nearest.iter().take(4).map(|&(_, i)| single(i)));

        let mut results = Vec::with_capacity(starts.len());
        for mut a in starts {
            let fit = self.refine(hull, target, &mut a, 0.0)?;
            let value = fit.distance * fit.distance + dot(&hull.price, &a);
            results.push((value, fit, a));
        }
        let starts = results.len();
        let least = results.iter().map(|(_, fit, _)| fit.distance).fold(f64::INFINITY, f64::min);
        let agreeing = results.iter().filter(|(_, fit, _)| fit.distance - least < AGREEMENT).count();
        // Ties go to the earlier start. There is always at least one start, so the error cannot happen.
        let best = results.into_iter().reduce(|best, other| if other.0 < best.0 { other } else { best });
        let Some((_, fit, weights)) = best else { return Err(MixtureError::NoStacks) };
        Ok(Best { weights, fit, starts, agreeing })
    }

    /// The tangent start: least squares in the tangent of the metric at the target.
    pub fn tangent(&mut self, hull: &Hull, target: &Target, a: &mut [f64]) -> Result<(), MixtureError> {
        self.linear(hull, target, Linear::Tangent, a)
    }

    fn linear(
        &mut self,
        hull: &Hull,
        target: &Target,
        metric: Linear,
        a: &mut [f64],
    ) -> Result<(), MixtureError> {
        wide(
            #[inline(always)]
            || self.linear_plainly(hull, target, metric, a),
        )
    }

    #[inline(always)]
    fn linear_plainly(
        &mut self,
        hull: &Hull,
        target: &Target,
        metric: Linear,
        a: &mut [f64],
    ) -> Result<(), MixtureError> {
        check(hull, target, a)?;
        self.resize(hull);
        let (k, m) = (hull.len(), hull.columns());
        // The tangent at black is vertical: targets below a millionth of the brightest stack use the tangent there.
        let floor = hull.darkest / DARKEST * 1e-6;
        for (j, s) in self.stiffness.iter_mut().enumerate() {
            let root = inverse_cbrt(target.radiance[j].max(floor));
            *s = match metric {
                Linear::Tangent => hull.weight[j] * root * root / 3.0,
                Linear::Plain => hull.weight[j],
            };
            self.pull[j] = target.radiance[j] * *s;
        }
        for i in 0..k {
            let scaled = &mut self.scaled[i * m..][..m];
            for ((x, f), s) in scaled.iter_mut().zip(hull.rows.row(i)).zip(&self.stiffness) {
                *x = f * s;
            }
            self.slope[i] = dot(scaled, &self.pull);
        }
        let scaled = &self.scaled;
        self.gram.refill(k, |i| &scaled[i * m..][..m]);
        a.fill(0.0);
        self.simplex.solve(&self.gram, &self.slope, a)?;
        Ok(())
    }

    /// Refines a start until the gap (in squared distance) is at most `enough`; 0 means as far as possible. `a` is the start,
    /// a point of the simplex, and receives the weights.
    pub fn refine(
        &mut self,
        hull: &Hull,
        target: &Target,
        a: &mut [f64],
        enough: f64,
    ) -> Result<Fit, MixtureError> {
        self.descend(hull, target, a, Reach::All, enough)
    }

    /// Like [`Mixer::refine`], but uses only the stacks that have weight in `a`; so does the gap.
    pub(crate) fn polish(
        &mut self,
        hull: &Hull,
        target: &Target,
        a: &mut [f64],
        enough: f64,
    ) -> Result<Fit, MixtureError> {
        self.descend(hull, target, a, Reach::Support, enough)
    }

    fn descend(
        &mut self,
        hull: &Hull,
        target: &Target,
        a: &mut [f64],
        reach: Reach,
        enough: f64,
    ) -> Result<Fit, MixtureError> {
        wide(
            #[inline(always)]
            || self.descend_plainly(hull, target, a, reach, enough),
        )
    }

    #[inline(always)]
    fn descend_plainly(
        &mut self,
        hull: &Hull,
        target: &Target,
        a: &mut [f64],
        reach: Reach,
        enough: f64,
    ) -> Result<Fit, MixtureError> {
        check(hull, target, a)?;
        self.resize(hull);
        self.closed.clear();
        self.closed.extend(a.iter().map(|&w| matches!(reach, Reach::Support) && w <= 0.0));
        hull.mix(a, &mut self.mix);
        self.trial.copy_from_slice(&self.mix);
        let mut squared = self.linearise(hull, target);
        let mut steps = 0;
        let mut stalled = false;

        let gap = loop {
            self.price(hull);
            let gap = 2.0 * frank_wolfe_gap(&self.slope, a);
            if stalled || steps >= MOST_STEPS || gap <= enough || gap.is_nan() {
                break gap;
            }
            steps += 1;
            self.choose(a);
            self.solve_model(hull, target, a)?;
            let (promised, priced) = self.full_step(hull, a);
            let before = squared;
            match self.search(hull, target, before, promised, priced) {
                Some((length, value)) => {
                    squared = value;
                    std::mem::swap(&mut self.mix, &mut self.trial);
                    for (&k, w) in self.working.iter().zip(&self.working_weights) {
                        a[k] = (a[k] + length * w).max(0.0);
                    }
                    let drop = before - squared - length * priced;
                    stalled = drop <= DROP * before;
                }
                None => {
                    stalled = true;
                    self.trial.copy_from_slice(&self.mix);
                    squared = self.linearise(hull, target);
                }
            }
        };
        let gap = if enough == 0.0 { gap.max(self.gap_without_hue(hull, a)) } else { gap };
        if !gap.is_finite() {
            return Err(SimplexError::NotFinite.into());
        }
        let convex = self.mix.iter().zip(&target.radiance).all(|(f, t)| *f <= 8.0 * t);
        let of_curve = &self.residual[..hull.curve_columns()];
        let curve = dot(of_curve, of_curve).sqrt();
        Ok(Fit { distance: squared.sqrt(), curve, gap: gap.max(0.0), steps, convex })
    }

    /// Half the gradient for every stack, its price included; closed stacks get one so large that they never join.
    #[inline(always)]
    fn price(&mut self, hull: &Hull) {
        hull.by_column.multiply(&self.pull, &mut self.slope);
        for (slope, price) in self.slope.iter_mut().zip(&hull.price) {
            *slope += 0.5 * price;
        }
        for (slope, &closed) in self.slope.iter_mut().zip(&self.closed) {
            if closed {
                *slope = f64::MAX;
            }
        }
    }

    /// The gap of the part of the objective that is convex, at the mixture that was found: what a certificate can say.
    #[inline(always)]
    fn gap_without_hue(&mut self, hull: &Hull, a: &[f64]) -> f64 {
        let Some(hue) = &hull.hue else { return 0.0 };
        self.pull[hue.first..][..3].fill(0.0);
        self.price(hull);
        2.0 * frank_wolfe_gap(&self.slope, a)
    }

    /// Minimises the quadratic model over the working stacks; `working_weights` receives their weights. Its curvature is
    /// Gauss-Newton's times `(2 cbrt t - cbrt f) / cbrt f`, the exact second derivative, limited to 0.25..9.
    #[inline(always)]
    fn solve_model(&mut self, hull: &Hull, target: &Target, a: &[f64]) -> Result<(), SimplexError> {
        let m = hull.columns();
        let (inverse, t, weight) = (&self.inverse[..m], &target.root[..m], &hull.weight[..m]);
        let stiffness = &mut self.stiffness[..m];
        for j in 0..m {
            let r = inverse[j];
            let exact = 2.0 * t[j] * r - 1.0;
            let exact = if exact > 0.25 { exact } else { 0.25 };
            let exact = if exact < 9.0 { exact } else { 9.0 };
            stiffness[j] = weight[j] * (r * r) * (1.0 / 3.0) * exact.sqrt();
        }
        for (i, &k) in self.working.iter().enumerate() {
            let scaled = &mut self.scaled[i * m..][..m];
            for ((x, f), s) in scaled.iter_mut().zip(hull.rows.row(k)).zip(&self.stiffness) {
                *x = f * s;
            }
            if let Some(hue) = &hull.hue {
                self.hue.scale(&hull.rows.row(k)[hue.first..][..3], &mut scaled[hue.first..][..3]);
            }
        }
        let scaled = &self.scaled;
        self.gram.refill(self.working.len(), |i| &scaled[i * m..][..m]);
        self.working_slope.clear();
        self.working_slope.extend(self.working.iter().map(|&k| self.slope[k]));
        self.working_weights.clear();
        self.working_weights.extend(self.working.iter().map(|&k| a[k]));
        self.simplex.descend(&self.gram, &mut self.working_slope, &mut self.working_weights)?;
        Ok(())
    }

    /// Turns `working_weights` into the full step from `a`, and sets the change of the mixture along it. Returns the
    /// decrease the gradient promises (negative) and the change in price, both for the full step.
    #[inline(always)]
    fn full_step(&mut self, hull: &Hull, a: &[f64]) -> (f64, f64) {
        self.change.fill(0.0);
        let mut promised = 0.0;
        for (&k, w) in self.working.iter().zip(&mut self.working_weights) {
            *w -= a[k];
            promised += 2.0 * *w * self.slope[k];
            if *w != 0.0 {
                add_scaled(&mut self.change, *w, hull.rows.row(k));
            }
        }
        let priced = self.working.iter().zip(&self.working_weights).map(|(&k, w)| w * hull.price[k]).sum();
        (promised, priced)
    }

    /// Halves the step until the objective falls enough (Armijo's rule). Returns the share of the full step taken and the
    /// squared distance there, or `None` if no share helps.
    #[inline(always)]
    fn search(
        &mut self,
        hull: &Hull,
        target: &Target,
        before: f64,
        promised: f64,
        priced: f64,
    ) -> Option<(f64, f64)> {
        let mut length = 1.0;
        for _ in 0..MOST_HALVINGS {
            for ((trial, mix), change) in self.trial.iter_mut().zip(&self.mix).zip(&self.change) {
                *trial = mix + length * change;
            }
            // This also sets up the model of the next step, so an accepted mixture is evaluated only once.
            let squared = self.linearise(hull, target);
            if squared + length * priced <= before + 1e-4 * length * promised.min(0.0) {
                return Some((length, squared));
            }
            length *= 0.5;
        }
        None
    }

    /// Selects the working stacks: those in use and those that would help most.
    #[inline(always)]
    fn choose(&mut self, a: &[f64]) {
        let level = dot(&self.slope, a);
        let mut joining = [(level, usize::MAX); MOST_JOINING];
        for (k, (&slope, &w)) in self.slope.iter().zip(a).enumerate() {
            if w <= 0.0 && slope < joining[MOST_JOINING - 1].0 {
                let place = joining.iter().position(|best| slope < best.0).unwrap_or(MOST_JOINING - 1);
                joining[place..].rotate_right(1);
                joining[place] = (slope, k);
            }
        }
        let joins = |k: usize| joining.iter().any(|&(_, joining)| joining == k);
        self.working.clear();
        self.working.extend((0..a.len()).filter(|&k| a[k] > 0.0 || joins(k)));
    }

    /// Returns the squared distance of the trial mixture and sets up what the gradient and the model there need: `inverse`,
    /// `residual` and `pull`.
    #[inline(always)]
    fn linearise(&mut self, hull: &Hull, target: &Target) -> f64 {
        let m = self.trial.len();
        let (mix, t, weight) = (&self.trial[..m], &target.root[..m], &hull.weight[..m]);
        let pull = &mut self.pull[..m];
        // Loops without sums, so that the compiler can vectorise over the columns.
        let inverse = &mut self.inverse[..m];
        for (r, f) in inverse.iter_mut().zip(mix) {
            *r = inverse_cbrt(if *f > hull.darkest { *f } else { hull.darkest });
        }
        let residual = &mut self.residual[..m];
        for j in 0..m {
            let r = inverse[j];
            let r2 = r * r;
            let f = if mix[j] > hull.darkest { mix[j] } else { hull.darkest };
            residual[j] = weight[j] * (f * r2 - t[j]);
            let tangent = weight[j] * r2 * (1.0 / 3.0);
            pull[j] = residual[j] * tangent;
        }
        if let (Some(hue), Some(aim)) = (&hull.hue, &target.hue) {
            let dark = std::array::from_fn(|c| mix[hue.first + c]);
            self.hue = aim.compare(dark, &mut residual[hue.first..][..3], &mut pull[hue.first..][..3]);
        }
        dot(residual, residual)
    }
}

/// Which stacks can receive weight.
#[derive(Clone, Copy)]
enum Reach {
    All,
    Support,
}

/// The metric of a linear start.
#[derive(Clone, Copy)]
enum Linear {
    Tangent,
    Plain,
}

fn check(hull: &Hull, target: &Target, a: &[f64]) -> Result<(), MixtureError> {
    if target.root.len() != hull.columns() {
        let (expected, found) = (hull.columns(), target.root.len());
        return Err(MixtureError::Columns { what: "the target", expected, found });
    }
    if a.len() != hull.len() {
        return Err(MixtureError::Length { stacks: hull.len(), found: a.len() });
    }
    Ok(())
}

#[cfg(test)]
mod tests;
