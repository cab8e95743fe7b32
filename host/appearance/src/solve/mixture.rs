//! Equation 1: the mixture of printable stacks that looks most like a target.
//!
//! Problem: minimise `F(a) = sqrt(E + g + p'a) + mu H(u)` over the simplex, what an eye sees in one unit.
//! `E(a) = sum_j W_j^2 (cbrt((Aa)_j) - cbrt(t_j))^2`, where the rows of A are the stacks' reflected
//! radiances, t is the target's and W are the metric's weights; the albedos may be further columns
//! ([`Hull::new`]). `g = eta sum_k a_k D_k^2` is grain, `u` hue in the dark and its own grain
//! ([`super::hue`]), and p a small price of each stack that breaks ties toward fewer layers. Without a
//! weight for light E is all there is.
//! Method: sequential quadratic steps. At a, S being the root there, `2 S F` is replaced by the
//! Gauss-Newton model of E, with the exact second derivative where that is positive, the linear terms, and
//! the quadratic that touches the price of hue and lies above it. [`Simplex`] minimises the model exactly
//! over the stacks in use and those whose gradient shows that they would help; Armijo's rule on F halves
//! the step. The search ends when the gap is small enough or F falls by less than 1e-12 of itself. Every
//! step computes the gradient of all stacks; only half a dozen enter the quadratic.
//! Cost: K m multiplications per step for the gradient and as many for the grain of a target (K stacks, m
//! columns), about 5 steps from the tangent start and 2 from a neighbour's solution; no allocation. Limits:
//! E is convex where no sample of the mixture exceeds 8 times the target. There the gap bounds the error of
//! all but hue; elsewhere several starts are the only assurance.
//! Source: eq. 1 of the 2009 paper (section 4.1) with the metric of its appendix.

use super::gram::Gram;
use super::hue::{COLUMNS, Missed};
use super::hull::{DARKEST, Hull, MixtureError, Target, seen_of_share};
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
/// The most stacks that join the mixture in one step: most of those that seem to help do so no longer once
/// the best have moved.
const MOST_JOINING: usize = 3;
/// The gap, in squared distance, that a start may have: a start need not be more exact than what it starts.
const START: f64 = 1e-6;
/// The price of hue from which a second start is tried: a tenth of what is barely visible.
const HUE_SEEN: f64 = 1e-3;
/// Two starts agree if their distances differ by less than this: a ten-thousandth of what is barely visible,
/// as much as is measured in decisions/gauss-newton-on-the-simplex.md.
const AGREEMENT: f64 = 1e-6;

/// How good a mixture is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fit {
    /// What decides, in the unit of the metric: F without the price of layers.
    pub objective: f64,
    /// Distance between mixture and target in the metric of the hull, with light.
    pub distance: f64,
    /// The part of it that eqs. 2-3 see: distance d.
    pub curve: f64,
    /// The part of the objective that is the price of hue.
    pub hue: f64,
    /// Frank-Wolfe gap in squared distance: where E is convex, no mixture has a value of `E + g + p'a`
    /// lower by more than this. With hue in the dark, which is not convex, that holds for all the rest if
    /// the search went as far as possible; otherwise it says how nearly the search was done.
    pub gap: f64,
    /// Steps taken.
    pub steps: u32,
    /// No sample of the mixture exceeds 8 times the target, so E is convex around it and the gap is a bound.
    pub convex: bool,
}

/// The objective at a mixture.
#[derive(Clone, Copy, Debug, Default)]
struct Value {
    /// E, and with it what stacks cost: the square under the root.
    squared: f64,
    all: f64,
    /// The price of hue.
    missed: f64,
}

impl Value {
    fn root(self) -> f64 {
        self.all.max(f64::MIN_POSITIVE).sqrt()
    }

    fn objective(self) -> f64 {
        self.root() + self.missed
    }

    /// How much lower the objective is elsewhere, times 2 S: about the drop of the square.
    fn drop_to(self, other: Value) -> f64 {
        let (here, there) = (self.root(), other.root());
        2.0 * here * ((self.all - other.all) / (here + there) + self.missed - other.missed)
    }
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
    /// How many starts reached the same objective within 1e-6.
    pub agreeing: usize,
}

/// The solver of equation 1 and its workspace. Each thread needs its own.
#[derive(Clone, Debug)]
pub struct Mixer {
    simplex: Simplex,
    gram: Gram,
    /// Weights of the columns for the target.
    weight: Vec<f64>,
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
    /// The squared distance of every stack by itself, and what each costs by its share.
    apart: Vec<f64>,
    cost: Vec<f64>,
    /// The root S that the quadratic belongs to.
    root: f64,
    /// Whether each stack is excluded.
    closed: Vec<bool>,
    /// The stacks of the quadratic, and their stiffness-scaled rows, slopes and weights.
    working: Vec<usize>,
    scaled: Vec<f64>,
    working_slope: Vec<f64>,
    working_weights: Vec<f64>,
    /// Another mixture.
    other: Vec<f64>,
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
            weight: Vec::new(),
            mix: Vec::new(),
            change: Vec::new(),
            trial: Vec::new(),
            inverse: Vec::new(),
            residual: Vec::new(),
            pull: Vec::new(),
            stiffness: Vec::new(),
            hue: Missed::default(),
            slope: Vec::new(),
            apart: Vec::new(),
            cost: Vec::new(),
            root: 0.0,
            closed: Vec::new(),
            working: Vec::new(),
            scaled: Vec::new(),
            working_slope: Vec::new(),
            working_weights: Vec::new(),
            other: Vec::new(),
        }
    }

    #[inline(always)]
    fn prepare(&mut self, hull: &Hull, target: &Target) {
        hull.weigh(target, &mut self.weight);
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
        for stacks in [&mut self.slope, &mut self.apart, &mut self.cost] {
            stacks.resize(k, 0.0);
        }
        self.scaled.resize(k * m, 0.0);
    }

    /// The minimum over several starts: the tangent start, the linear start (least squares without the cube
    /// root), equal weights, and the four nearest single stacks.
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
        self.prepare(hull, target);
        hull.apart(target, &self.weight, &mut self.change, &mut self.apart);
        let mut nearest: Vec<(f64, usize)> = self.apart.iter().copied().zip(0..).collect();
        nearest.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        starts.extend(nearest.iter().take(4).map(|&(_, i)| single(i)));

        let mut results = Vec::with_capacity(starts.len());
        for mut a in starts {
            let (fit, value) = self.descend(hull, target, &mut a, Reach::All, 0.0)?;
            results.push((value, fit, a));
        }
        let starts = results.len();
        let least = results.iter().map(|(value, ..)| *value).fold(f64::INFINITY, f64::min);
        let agreeing = results.iter().filter(|(value, ..)| value - least < AGREEMENT).count();
        // Ties go to the earlier start. There is always at least one start, so the error cannot happen.
        let best = results.into_iter().reduce(|best, other| if other.0 < best.0 { other } else { best });
        let Some((_, fit, weights)) = best else { return Err(MixtureError::NoStacks) };
        Ok(Best { weights, fit, starts, agreeing })
    }

    /// The objective of a mixture, without the price of layers.
    #[cfg(test)]
    pub(crate) fn objective(&mut self, hull: &Hull, target: &Target, a: &[f64]) -> f64 {
        self.prepare(hull, target);
        hull.apart(target, &self.weight, &mut self.change, &mut self.apart);
        hull.costs(&self.apart, &mut self.cost);
        hull.mix(a, &mut self.mix);
        self.trial.copy_from_slice(&self.mix);
        let grain = dot(&self.cost, a) - dot(&hull.price, a);
        self.linearise(hull, target, grain).objective()
    }

    /// The objective of a mixture of the last target that was fitted, with the grain that an eye sees of
    /// each share, rare ones most.
    pub(crate) fn exactly(&mut self, hull: &Hull, target: &Target, a: &[f64]) -> f64 {
        hull.mix(a, &mut self.mix);
        self.trial.copy_from_slice(&self.mix);
        let grain: f64 = a.iter().zip(&self.apart).map(|(&w, apart)| w * apart * seen_of_share(w)).sum();
        self.linearise(hull, target, grain).objective()
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
        self.prepare(hull, target);
        // The tangent at black is vertical: targets below a millionth of the brightest stack use the
        // tangent there.
        let floor = hull.darkest / DARKEST * 1e-6;
        for (j, s) in self.stiffness.iter_mut().enumerate() {
            let root = inverse_cbrt(target.radiance[j].max(floor));
            *s = match metric {
                Linear::Tangent => self.weight[j] * root * root / 3.0,
                Linear::Plain => self.weight[j],
            };
        }
        hull.apart(target, &self.weight, &mut self.change, &mut self.apart);
        let nearest = (0..a.len()).min_by(|&i, &k| self.apart[i].total_cmp(&self.apart[k]));
        a.fill(0.0);
        a[nearest.ok_or(MixtureError::NoStacks)?] = 1.0;
        self.closed.clear();
        self.closed.resize(a.len(), false);
        self.cost.fill(0.0);
        for _ in 0..MOST_STEPS {
            hull.mix(a, &mut self.mix);
            let columns = self.pull.iter_mut().zip(&self.mix).zip(&target.radiance).zip(&self.stiffness);
            columns.for_each(|(((pull, f), t), s)| *pull = (f - t) * s * s);
            self.price(hull);
            if 2.0 * frank_wolfe_gap(&self.slope, a) <= START {
                break;
            }
            self.choose(a);
            self.scale_working(hull);
            self.solve_scaled(hull.columns(), a)?;
            self.working.iter().zip(&self.working_weights).for_each(|(&k, &w)| a[k] = w);
        }
        Ok(())
    }

    /// Refines a start until the gap (in squared distance) is at most `enough`; 0 means as far as possible.
    /// `a` is the start, a point of the simplex, and receives the weights.
    pub fn refine(
        &mut self,
        hull: &Hull,
        target: &Target,
        a: &mut [f64],
        enough: f64,
    ) -> Result<Fit, MixtureError> {
        self.descend(hull, target, a, Reach::All, enough).map(|(fit, _)| fit)
    }

    /// Like [`Mixer::refine`], and where hue has a price that somebody may see, again from the tangent
    /// start: hue makes the objective hollow in places. The better of both stays.
    pub(crate) fn refine_beyond(
        &mut self,
        hull: &Hull,
        target: &Target,
        a: &mut [f64],
        enough: f64,
    ) -> Result<Fit, MixtureError> {
        let fit = self.refine(hull, target, a, enough)?;
        if fit.hue < HUE_SEEN {
            return Ok(fit);
        }
        let mut other = std::mem::take(&mut self.other);
        other.resize(a.len(), 0.0);
        self.tangent(hull, target, &mut other)?;
        let again = self.refine(hull, target, &mut other, enough)?;
        let is_better = again.objective < fit.objective;
        if is_better {
            a.copy_from_slice(&other);
        }
        self.other = other;
        Ok(if is_better { again } else { fit })
    }

    /// Like [`Mixer::refine`], but uses only the stacks that have weight in `a`; so does the gap.
    pub(crate) fn polish(
        &mut self,
        hull: &Hull,
        target: &Target,
        a: &mut [f64],
        enough: f64,
    ) -> Result<Fit, MixtureError> {
        self.descend(hull, target, a, Reach::Support, enough).map(|(fit, _)| fit)
    }

    /// The fit, and F with the price of layers.
    fn descend(
        &mut self,
        hull: &Hull,
        target: &Target,
        a: &mut [f64],
        reach: Reach,
        enough: f64,
    ) -> Result<(Fit, f64), MixtureError> {
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
    ) -> Result<(Fit, f64), MixtureError> {
        check(hull, target, a)?;
        self.prepare(hull, target);
        self.closed.clear();
        self.closed.extend(a.iter().map(|&w| matches!(reach, Reach::Support) && w <= 0.0));
        hull.apart(target, &self.weight, &mut self.change, &mut self.apart);
        hull.costs(&self.apart, &mut self.cost);
        hull.mix(a, &mut self.mix);
        self.trial.copy_from_slice(&self.mix);
        let mut spent = dot(&self.cost, a);
        let mut value = self.linearise(hull, target, spent);
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
            let (promised, costs) = self.full_step(hull, a);
            match self.search(hull, target, (value, spent), promised, costs) {
                Some((length, next)) => {
                    std::mem::swap(&mut self.mix, &mut self.trial);
                    for (&k, w) in self.working.iter().zip(&self.working_weights) {
                        a[k] = (a[k] + length * w).max(0.0);
                    }
                    stalled = value.drop_to(next) <= DROP * value.all;
                    (value, spent) = (next, spent + length * costs);
                }
                None => {
                    stalled = true;
                    self.trial.copy_from_slice(&self.mix);
                    value = self.linearise(hull, target, spent);
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
        let layers = dot(&hull.price, a);
        let objective = Value { all: value.all - layers, ..value }.objective();
        let (distance, gap) = (value.squared.sqrt(), gap.max(0.0));
        Ok((Fit { objective, distance, curve, hue: value.missed, gap, steps, convex }, value.objective()))
    }

    /// Half the gradient of 2 S F for every stack, what it costs included; closed stacks get one so large
    /// that they never join.
    #[inline(always)]
    fn price(&mut self, hull: &Hull) {
        hull.by_column.multiply(&self.pull, &mut self.slope);
        for (slope, cost) in self.slope.iter_mut().zip(&self.cost) {
            *slope += 0.5 * cost;
        }
        for (slope, &closed) in self.slope.iter_mut().zip(&self.closed) {
            if closed {
                *slope = f64::MAX;
            }
        }
    }

    /// The gap of the part of the objective that is convex, at the mixture that was found: what a
    /// certificate can say.
    #[inline(always)]
    fn gap_without_hue(&mut self, hull: &Hull, a: &[f64]) -> f64 {
        let Some(hue) = &hull.hue else { return 0.0 };
        self.pull[hue.first..][..COLUMNS].fill(0.0);
        self.price(hull);
        2.0 * frank_wolfe_gap(&self.slope, a)
    }

    /// Minimises the quadratic model over the working stacks; `working_weights` receives their weights. Its
    /// curvature is Gauss-Newton's times `(2 cbrt t - cbrt f) / cbrt f`, the exact second derivative,
    /// limited to 0.25..9.
    #[inline(always)]
    fn solve_model(&mut self, hull: &Hull, target: &Target, a: &[f64]) -> Result<(), SimplexError> {
        let m = hull.columns();
        let (inverse, t, weight) = (&self.inverse[..m], &target.root[..m], &self.weight[..m]);
        let stiffness = &mut self.stiffness[..m];
        for j in 0..m {
            let r = inverse[j];
            let exact = 2.0 * t[j] * r - 1.0;
            let exact = if exact > 0.25 { exact } else { 0.25 };
            let exact = if exact < 9.0 { exact } else { 9.0 };
            stiffness[j] = weight[j] * (r * r) * (1.0 / 3.0) * exact.sqrt();
        }
        self.scale_working(hull);
        if let Some(hue) = &hull.hue {
            for (i, &k) in self.working.iter().enumerate() {
                let from = &hull.rows.row(k)[hue.first..][..3];
                self.hue.scale(self.root, from, &mut self.scaled[i * m + hue.first..][..3]);
            }
        }
        self.solve_scaled(m, a)
    }

    /// Multiplies the rows of the working stacks by the stiffness of each column.
    #[inline(always)]
    fn scale_working(&mut self, hull: &Hull) {
        let m = hull.columns();
        for (i, &k) in self.working.iter().enumerate() {
            let scaled = &mut self.scaled[i * m..][..m];
            for ((x, f), s) in scaled.iter_mut().zip(hull.rows.row(k)).zip(&self.stiffness) {
                *x = f * s;
            }
        }
    }

    /// Minimises the quadratic of the scaled rows, given half its gradient at `a`.
    #[inline(always)]
    fn solve_scaled(&mut self, m: usize, a: &[f64]) -> Result<(), SimplexError> {
        let scaled = &self.scaled;
        self.gram.refill(self.working.len(), |i| &scaled[i * m..][..m]);
        self.working_slope.clear();
        self.working_slope.extend(self.working.iter().map(|&k| self.slope[k]));
        self.working_weights.clear();
        self.working_weights.extend(self.working.iter().map(|&k| a[k]));
        self.simplex.descend(&self.gram, &mut self.working_slope, &mut self.working_weights)?;
        Ok(())
    }

    /// Turns `working_weights` into the full step from `a`, and sets the change of the mixture along it.
    /// Returns the decrease of 2 S F the gradient promises (negative) and the change in what stacks cost,
    /// both for the full step.
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
        let costs = self.working.iter().zip(&self.working_weights).map(|(&k, w)| w * self.cost[k]).sum();
        (promised, costs)
    }

    /// Halves the step until the objective falls enough (Armijo's rule). Returns the share of the full step
    /// taken and the objective there, or `None` if no share helps.
    #[inline(always)]
    fn search(
        &mut self,
        hull: &Hull,
        target: &Target,
        (value, spent): (Value, f64),
        promised: f64,
        costs: f64,
    ) -> Option<(f64, Value)> {
        let mut length = 1.0;
        for _ in 0..MOST_HALVINGS {
            for ((trial, mix), change) in self.trial.iter_mut().zip(&self.mix).zip(&self.change) {
                *trial = mix + length * change;
            }
            // This also sets up the model of the next step, so an accepted mixture is evaluated only once.
            let next = self.linearise(hull, target, spent + length * costs);
            if value.drop_to(next) >= -1e-4 * length * promised.min(0.0) {
                return Some((length, next));
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

    /// Returns the objective of the trial mixture, whose stacks cost so much, and sets up what the gradient
    /// and the model there need: `inverse`, `residual`, `pull`, `hue` and `root`.
    #[inline(always)]
    fn linearise(&mut self, hull: &Hull, target: &Target, spent: f64) -> Value {
        let m = self.trial.len();
        let (mix, t, weight) = (&self.trial[..m], &target.root[..m], &self.weight[..m]);
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
        let squared = dot(residual, residual);
        let mut value = Value { squared, all: squared + spent, missed: 0.0 };
        self.root = value.root();
        if let (Some(hue), Some(aim)) = (&hull.hue, &target.hue) {
            self.hue = hue.compare(aim, &mix[hue.first..][..COLUMNS]);
            self.hue.pull(self.root, &mut pull[hue.first..][..COLUMNS]);
            value.missed = self.hue.price;
        }
        value
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
