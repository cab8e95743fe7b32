//! Stacks that nobody measured, from those that were.
//!
//! Problem: twelve ribbons make some dozens of stacks, and an owner measures a handful. What they reflect says what their inks do, and
//! the inks what the other stacks reflect.
//! Method: the figures of the layer model ([`crate::model`]) are fitted to all measured curves at once. Residuals are differences of logarithms, so
//! that a foil's peak and its body count alike; each is weighed by the measurement's standard deviation and by what the model itself
//! may be off. The library's own figures are priors. A stack is predicted if each of its inks was measured, alone or in
//! another stack. Each measured stack is also predicted from the others alone: the difference is the leave-one-out error. The band of a
//! prediction is the spread that the fit leaves to its figures, together with what those errors exceed such spreads by, on all stacks or
//! on those of its own kind, whichever is more: a model that is right for inks on paper may be wrong for inks on metal.
//! Cost: about a second for twenty stacks, most of it leaving out. Limits: what the model cannot express (trapping, grazing angles,
//! lobes that are not GGX) shows in the leave-one-out error, not in the figures.

mod figures;
mod least_squares;

use maths::Maths;
use std::f64::consts::FRAC_PI_2;

use protocol::ink::Kind;
use serde::Serialize;

use self::figures::Slot;
use self::least_squares::{Matrix, Normal};
use crate::curve::Curve;
use crate::library::Library;
use crate::linalg::Cholesky;
use crate::model::{ModelError, Optics};
use crate::stack::Stack;
use crate::uncertainty::SampleKind;

/// Half angle in radians beyond which curves are not compared: 80 degrees. Lobes grow as 1 / cos there, and few cameras see it.
const WIDEST: f64 = 1.396;
/// The most samples of a curve that are compared.
const MOST_SAMPLES: usize = 48;
/// Reflectance, in 1/sr, below which differences do not matter.
const FLOOR: f64 = 1e-4;
/// What the model may be off, as a share.
const MISFIT: f64 = 0.03;
/// What it may be off where nothing could be left out to test it.
const UNTESTED: f64 = 0.25;
/// The step of a logarithm for derivatives by central differences.
const STEP: f64 = 1e-4;
/// Samples of a predicted curve.
const SAMPLES: u32 = 64;

/// Why nothing can be predicted.
#[derive(Debug, thiserror::Error)]
pub enum PredictError {
    /// No curve of the library is a measurement.
    #[error(
        "the library has no measured curve, so there is nothing to predict from; `foilpress measure` makes some"
    )]
    NothingMeasured,
    /// The measured stacks hold inks without a model.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The equations of the fit have no solution.
    #[error(
        "the measured curves do not determine the figures of the model; check them with `foilpress inks check`"
    )]
    Singular,
}

/// A measured curve at the angles at which it is compared.
#[derive(Clone, Debug)]
struct Data {
    stack: Stack,
    theta: Vec<f64>,
    /// Logarithms of the reflectance.
    log: Vec<[f64; 3]>,
    /// Their standard deviations.
    sigma: Vec<[f64; 3]>,
}

fn log(rgb: [f64; 3]) -> [f64; 3] {
    rgb.map(|v| (v.max(0.0) + FLOOR).logarithm())
}

/// The measured curves of a library.
fn measured(library: &Library) -> Vec<Data> {
    let entries = library.entries().iter().filter(|entry| entry.provenance.is_measured());
    entries
        .map(|entry| {
            let curve = &entry.curve;
            let seen = |&i: &usize| {
                curve.theta()[i] <= WIDEST
                    && entry.uncertainty.as_ref().is_none_or(|u| u.kinds()[i] == SampleKind::Measured)
            };
            let seen: Vec<usize> = (0..curve.theta().len()).filter(seen).collect();
            let every = seen.len().div_ceil(MOST_SAMPLES).max(1);
            let mut data =
                Data { stack: entry.stack.clone(), theta: Vec::new(), log: Vec::new(), sigma: Vec::new() };
            for i in seen.into_iter().step_by(every) {
                let rgb = curve.rgb()[i];
                let stated = entry.uncertainty.as_ref().map_or([0.0; 3], |u| u.sigma()[i]);
                data.theta.push(curve.theta()[i]);
                data.log.push(log(rgb));
                data.sigma.push(std::array::from_fn(|c| MISFIT.hypotenuse(stated[c] / (rgb[c] + FLOOR))));
            }
            data
        })
        .collect()
}

/// The logarithms of what a stack reflects.
fn modelled(optics: &Optics, stack: &Stack, theta: &[f64]) -> Result<Vec<[f64; 3]>, ModelError> {
    let lobes = optics.lobes(stack)?;
    Ok(theta.iter().map(|&t| log(lobes.at(t))).collect())
}

/// The figures of a model, fitted to curves.
struct Fitted {
    optics: Optics,
    slots: Vec<Slot>,
    x: Vec<f64>,
    factor: Cholesky,
    /// The factor on all standard deviations that the residuals ask for, at least 1.
    scale: f64,
}

/// Fits the figures that these curves depend on. `from` are the library's own, which are the priors as well; `start` is
/// where the search begins.
fn fit(from: &Optics, data: &[&Data], start: Option<&Fitted>) -> Result<Fitted, PredictError> {
    let mut optics = figures::prepared(from);
    let mut inks: Vec<_> = data.iter().flat_map(|d| figures::inks_of(from, &d.stack)).collect();
    inks.sort_unstable();
    inks.dedup();
    let slots = figures::slots(&mut optics, &inks);
    for d in data {
        optics.lobes(&d.stack)?;
    }
    let values: Vec<f64> = slots.iter().map(|slot| slot.get(&mut optics).unwrap_or(1.0)).collect();
    let bounds: Vec<[f64; 2]> = slots.iter().map(|slot| slot.range().map(f64::logarithm)).collect();
    let prior: Vec<f64> = values.iter().map(|v| v.max(1e-12).logarithm()).collect();
    let spread: Vec<f64> = slots.iter().zip(&values).map(|(slot, &v)| slot.spread(v)).collect();
    let known = |slot: &Slot| start.and_then(|s| s.slots.iter().position(|k| k == slot).map(|i| s.x[i]));
    let x: Vec<f64> = slots.iter().zip(&prior).map(|(slot, &p)| known(slot).unwrap_or(p)).collect();
    // The numbers that each curve depends on.
    let active: Vec<Vec<usize>> = data.iter().map(|d| depends(from, &slots, &d.stack)).collect();
    let priors = |x: &[f64]| -> f64 { (0..x.len()).map(|i| ((x[i] - prior[i]) / spread[i]).squared()).sum() };
    let cost = |x: &[f64]| {
        let mut optics = optics.clone();
        put(&mut optics, &slots, x);
        let of = |d: &&Data| residuals(&optics, d).map_or(f64::INFINITY, |r| r.iter().map(|r| r * r).sum());
        0.5 * (priors(x) + data.iter().map(of).sum::<f64>())
    };
    let normal = |x: &[f64]| {
        let mut optics = optics.clone();
        put(&mut optics, &slots, x);
        let n = x.len();
        let mut found = Normal { cost: 0.5 * priors(x), gradient: vec![0.0; n], curvature: Matrix::zero(n) };
        for i in 0..n {
            found.gradient[i] = (x[i] - prior[i]) / spread[i].squared();
            *found.curvature.at_mut(i, i) = spread[i].whole_power(-2);
        }
        for (d, active) in data.iter().zip(&active) {
            let Ok(r) = residuals(&optics, d) else { continue };
            found.cost += 0.5 * r.iter().map(|r| r * r).sum::<f64>();
            let weights: Vec<f64> = d.sigma.iter().flatten().map(|s| 1.0 / s).collect();
            let columns: Vec<Vec<f64>> = active
                .iter()
                .map(|&i| {
                    let slope = slopes(&mut optics, slots[i], x[i], &d.stack, &d.theta);
                    slope.iter().flatten().zip(&weights).map(|(s, w)| s * w).collect()
                })
                .collect();
            for (a, &i) in active.iter().enumerate() {
                found.gradient[i] += dot(&columns[a], &r);
                for (b, &j) in active.iter().enumerate().take(a + 1) {
                    let product = dot(&columns[a], &columns[b]);
                    *found.curvature.at_mut(i, j) += product;
                    if i != j {
                        *found.curvature.at_mut(j, i) += product;
                    }
                }
            }
        }
        found
    };
    let (x, last) = least_squares::minimise(x, &bounds, normal, cost);
    let factor = last.curvature.factor().ok_or(PredictError::Singular)?;
    let count: usize = data.iter().map(|d| 3 * d.theta.len()).sum();
    let freedom = count.saturating_sub(slots.len()).max(1);
    let scale = (2.0 * last.cost / freedom as f64).sqrt().max(1.0);
    put(&mut optics, &slots, &x);
    Ok(Fitted { optics, slots, x, factor, scale })
}

/// The numbers that the curve of a stack depends on, by their place in the list.
fn depends(optics: &Optics, slots: &[Slot], stack: &Stack) -> Vec<usize> {
    let inks = figures::inks_of(optics, stack);
    (0..slots.len()).filter(|&i| slots[i].ink().is_none_or(|ink| inks.contains(&ink))).collect()
}

fn put(optics: &mut Optics, slots: &[Slot], x: &[f64]) {
    for (slot, x) in slots.iter().zip(x) {
        slot.set(optics, x.exponential());
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Differences of logarithms between model and measurement, in standard deviations.
fn residuals(optics: &Optics, data: &Data) -> Result<Vec<f64>, ModelError> {
    let model = modelled(optics, &data.stack, &data.theta)?;
    let all = model.iter().zip(&data.log).zip(&data.sigma);
    Ok(all.flat_map(|((m, f), s)| (0..3).map(move |c| (m[c] - f[c]) / s[c])).collect())
}

/// The derivative of the logarithm of a stack's curve by the logarithm of a number whose logarithm is `x`.
fn slopes(optics: &mut Optics, slot: Slot, x: f64, stack: &Stack, theta: &[f64]) -> Vec<[f64; 3]> {
    let mut at = |x: f64| {
        slot.set(optics, x.exponential());
        modelled(optics, stack, theta)
    };
    let both = (at(x + STEP), at(x - STEP));
    slot.set(optics, x.exponential());
    let (Ok(above), Ok(below)) = both else { return vec![[0.0; 3]; theta.len()] };
    let slope = |(a, b): (&[f64; 3], &[f64; 3])| std::array::from_fn(|c| (a[c] - b[c]) / (2.0 * STEP));
    above.iter().zip(&below).map(slope).collect()
}

/// A number of the model before and after the fit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FittedFigure {
    /// Its path, such as `metallic-silver.alpha` or `cyan.solid.red`. Colours are linear RGB; a metal's reflectance is a share of
    /// aluminium's.
    pub name: String,
    /// The library's own value.
    pub before: f64,
    /// The value that fits the curves.
    pub value: f64,
    /// Its standard deviation, as a share of the value.
    pub uncertainty: f64,
    /// That of the library's own value.
    pub uncertainty_before: f64,
}

/// A measured stack, and how well the model knows it. Errors are root mean squares of relative differences over all samples.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LeftOut {
    /// The stack.
    pub stack: Stack,
    /// Error of the figures of the library that the measured one is based on.
    pub modelled: f64,
    /// Error of the figures fitted to all measured stacks.
    pub fitted: f64,
    /// Error of the figures fitted to all other measured stacks; none if one of its inks is in no other of them.
    pub left_out: Option<f64>,
    /// Its curve as predicted from the others.
    #[serde(skip)]
    pub curve: Option<Curve>,
}

/// A stack as the others predict it.
#[derive(Clone, Debug, PartialEq)]
pub struct Predicted {
    /// The stack.
    pub stack: Stack,
    /// Its curve.
    pub curve: Curve,
    /// The standard deviation of each sample, in 1/sr.
    pub sigma: Vec<[f64; 3]>,
    /// The measured stacks that share an ink with it.
    pub from: Vec<Stack>,
}

/// What measured curves say about the others.
#[derive(Clone, Debug, PartialEq)]
pub struct Prediction {
    /// The name of the model.
    pub model: String,
    /// Its figures.
    pub figures: Vec<FittedFigure>,
    /// The measured stacks.
    pub measured: Vec<LeftOut>,
    /// The root mean square of their leave-one-out errors; none if no stack could be left out.
    pub error: Option<f64>,
    /// The stacks that could be predicted.
    pub stacks: Vec<Predicted>,
    /// Those that could not: an ink in them was not measured.
    pub unknown: Vec<Stack>,
}

/// Whether each ink of a stack is in one of the others. The bare paper is what it is.
fn is_known(optics: &Optics, stack: &Stack, others: &[&Data]) -> bool {
    let own = |ink| others.iter().any(|d| d.stack.layers().contains(ink));
    optics.lobes(stack).is_ok() && !stack.layers().is_empty() && stack.layers().iter().all(own)
}

/// What a sample of a left-out stack says of the model.
#[derive(Clone, Copy, Debug)]
struct Excess {
    /// The squared difference of logarithms.
    off: f64,
    /// The variance that fit and measurement explain.
    known: f64,
    /// That which the measurement explains.
    measured: f64,
    /// See [`filtered`].
    filtered: f64,
}

/// What layers do to each other; a stack may do several.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Act {
    InkOnInk,
    InkOnMetal,
    FinishOnInk,
    FinishOnMetal,
    OnUndercoat,
}

impl Act {
    const ALL: [Act; 5] =
        [Act::InkOnInk, Act::InkOnMetal, Act::FinishOnInk, Act::FinishOnMetal, Act::OnUndercoat];

    fn is_in(self, stack: &Stack) -> bool {
        let metal = |kind: Kind| matches!(kind, Kind::Metallic | Kind::Foil);
        let over = |above: &dyn Fn(Kind) -> bool, below: &dyn Fn(Kind) -> bool| {
            let layers = stack.layers();
            layers
                .iter()
                .enumerate()
                .any(|(i, ink)| below(ink.kind()) && layers[i + 1..].iter().any(|ink| above(ink.kind())))
        };
        let (ink, finish) = (|kind| kind == Kind::Process, |kind| kind == Kind::Finish);
        match self {
            Act::InkOnInk => over(&ink, &ink),
            Act::InkOnMetal => over(&ink, &metal),
            Act::FinishOnInk => over(&finish, &ink),
            Act::FinishOnMetal => over(&finish, &metal),
            Act::OnUndercoat => over(&|_| true, &|kind| matches!(kind, Kind::Primer | Kind::White)),
        }
    }
}

/// What the model itself may be off, in logarithms.
#[derive(Clone, Debug, PartialEq)]
struct Misfit {
    /// Variance of every sample.
    even: f64,
    /// Variance for each squared unit of [`filtered`].
    filtering: f64,
    /// Variance of every sample of the stacks in which layers act so.
    acts: Vec<(Act, f64)>,
}

impl Act {
    /// The variance that stacks of this kind show beyond what fit and measurement explain. The only one of its kind was predicted without any
    /// knowledge of the kind, and the fit was wide; it is narrow once that one is in, though one is no test of the others: all of its
    /// error counts. Few stacks scatter: one more with the mean's own variance counts for that.
    fn misfit(self, stacks: &[(&Stack, Vec<Excess>)]) -> Option<f64> {
        let own: Vec<_> =
            stacks.iter().filter(|(stack, _)| self.is_in(stack)).map(|(_, excess)| excess).collect();
        let n = own.len() as f64;
        let left = |e: &Excess| e.off - if own.len() == 1 { e.measured } else { e.known };
        let mean = |excess: &[Excess]| excess.iter().map(left).sum::<f64>() / excess.len().max(1) as f64;
        (n > 0.0).then(|| own.iter().map(|excess| mean(excess)).sum::<f64>() / n * (n + 1.0) / n)
    }
}

impl Misfit {
    /// The misfit that stacks which were left out show.
    fn of_stacks(stacks: &[(&Stack, Vec<Excess>)]) -> Misfit {
        if stacks.is_empty() {
            return Misfit { even: UNTESTED * UNTESTED, filtering: 0.0, acts: Vec::new() };
        }
        // A straight line through what is not explained, over the squares. A square scatters as much as its mean, so samples count
        // little where much is explained.
        let mut sums = [0.0; 5];
        for e in stacks.iter().flat_map(|(_, excess)| excess) {
            let (x, y) = (e.filtered * e.filtered, e.off - e.known);
            let weight = (e.known + MISFIT * MISFIT).whole_power(-2);
            [1.0, x, y, x * x, x * y].into_iter().zip(&mut sums).for_each(|(v, sum)| *sum += weight * v);
        }
        let [_, x, y, xx, xy] = sums.map(|sum| sum / sums[0]);
        let slope = ((xy - x * y) / (xx - x * x).max(1e-12)).max(0.0);
        let acts = Act::ALL.into_iter().filter_map(|act| Some((act, act.misfit(stacks)?))).collect();
        Misfit { even: (y - slope * x).max(MISFIT * MISFIT), filtering: slope, acts }
    }

    /// Its standard deviation in a stack.
    fn at(&self, stack: &Stack, filtered: f64) -> f64 {
        let own = self.acts.iter().filter(|(act, _)| act.is_in(stack)).map(|(_, variance)| *variance);
        own.fold(self.even + self.filtering * filtered * filtered, f64::max).sqrt()
    }
}

/// How far the light of a stack depends on what its layers do to each other: the logarithm of what its filters take away, times the
/// number of layers that lie on others.
fn filtered(optics: &Optics, stack: &Stack, theta: &[f64]) -> Result<Vec<[f64; 3]>, ModelError> {
    let below: Vec<_> = stack.layers().iter().copied().filter(|ink| ink.kind() != Kind::Process).collect();
    let overlaps = stack.layers().len().saturating_sub(1) as f64;
    let (with, without) = (modelled(optics, stack, theta)?, modelled(optics, &Stack::new(below), theta)?);
    let taken = |(with, without): (&[f64; 3], &[f64; 3])| {
        std::array::from_fn(|c| overlaps * (without[c] - with[c]).max(0.0))
    };
    Ok(with.iter().zip(&without).map(taken).collect())
}

/// The root mean square of the relative differences between a model and a measurement.
fn error(optics: &Optics, data: &Data) -> Result<f64, ModelError> {
    let model = modelled(optics, &data.stack, &data.theta)?;
    let squares = model.iter().zip(&data.log).flat_map(|(m, f)| (0..3).map(move |c| (m[c] - f[c]).squared()));
    Ok((squares.sum::<f64>() / (3 * data.theta.len()).max(1) as f64).sqrt())
}

impl Library {
    /// Predicts the stacks that are modelled from those that were measured. `done` is called after each stack that was left out.
    ///
    /// # Errors
    /// A library without measured curves, and measured stacks of inks that have no model and share none with others.
    pub fn predict(&self, mut done: impl FnMut()) -> Result<Prediction, PredictError> {
        let from = self.optics();
        let mut data = measured(self);
        // White has no model: its stacks stay as they were measured.
        data.retain(|d| from.lobes(&d.stack).is_ok() && !d.theta.is_empty());
        if data.is_empty() {
            return Err(PredictError::NothingMeasured);
        }
        let all: Vec<&Data> = data.iter().collect();
        let fitted = fit(from, &all, None)?;
        // What each error exceeds what the fit and the measurement say of themselves.
        let (mut left, mut excess) = (Vec::with_capacity(all.len()), Vec::new());
        for d in &all {
            let others: Vec<&Data> = all.iter().copied().filter(|other| other.stack != d.stack).collect();
            let known = is_known(from, &d.stack, &others);
            let without = known.then(|| fit(from, &others, Some(&fitted))).transpose()?;
            let (left_out, curve) = match &without {
                None => (None, None),
                Some(f) => (Some(error(&f.optics, d)?), Some(f.optics.lobes(&d.stack)?.curve(&grid()))),
            };
            if let Some(f) = &without {
                excess.push((&d.stack, f.excess(from, d)?));
            }
            let (modelled, fitted) = (error(from, d)?, error(&fitted.optics, d)?);
            left.push(LeftOut { stack: d.stack.clone(), modelled, fitted, left_out, curve });
            done();
        }
        let errors: Vec<f64> = left.iter().filter_map(|l| l.left_out).collect();
        let mean = |of: &[f64]| (of.iter().map(|e| e * e).sum::<f64>() / of.len() as f64).sqrt();
        let error = (!errors.is_empty()).then(|| mean(&errors));
        let misfit = Misfit::of_stacks(&excess);
        let modelled = self.entries().iter().filter(|entry| entry.lobes.is_some());
        let (known, unknown): (Vec<_>, Vec<_>) = modelled.partition(|e| is_known(from, &e.stack, &all));
        let stacks = known
            .into_iter()
            .map(|entry| fitted.predict(from, &entry.stack, &all, &misfit))
            .collect::<Result<_, _>>()?;
        Ok(Prediction {
            model: from.model.name.clone(),
            figures: fitted.figures(from),
            measured: left,
            error,
            stacks,
            unknown: unknown.into_iter().map(|entry| entry.stack.clone()).collect(),
        })
    }
}

/// Angles of a predicted curve: the square-root grid from 0 to 87 degrees.
fn grid() -> Vec<f64> {
    (0..SAMPLES).map(|n| FRAC_PI_2 * (f64::from(n) / f64::from(SAMPLES)).squared()).collect()
}

impl Fitted {
    /// The standard deviation that the fit leaves to the logarithm of a stack's curve, at these angles.
    fn spread(&self, from: &Optics, stack: &Stack, theta: &[f64]) -> Vec<[f64; 3]> {
        let mut optics = self.optics.clone();
        let active = depends(from, &self.slots, stack);
        let columns: Vec<Vec<[f64; 3]>> =
            active.iter().map(|&i| slopes(&mut optics, self.slots[i], self.x[i], stack, theta)).collect();
        let at = |k: usize, c: usize| {
            let mut row = vec![0.0; self.x.len()];
            for (&i, column) in active.iter().zip(&columns) {
                row[i] = column[k][c];
            }
            let y = self.factor.forward(&row);
            self.scale * dot(&y, &y).sqrt()
        };
        (0..theta.len()).map(|k| std::array::from_fn(|c| at(k, c))).collect()
    }

    /// What the difference between this fit and a measurement exceeds what both say of themselves by.
    fn excess(&self, from: &Optics, data: &Data) -> Result<Vec<Excess>, ModelError> {
        let model = modelled(&self.optics, &data.stack, &data.theta)?;
        let spread = self.spread(from, &data.stack, &data.theta);
        let filtered = filtered(&self.optics, &data.stack, &data.theta)?;
        let at = |k: usize, c: usize| Excess {
            off: (model[k][c] - data.log[k][c]).squared(),
            known: spread[k][c].squared() + data.sigma[k][c].squared(),
            measured: data.sigma[k][c].squared(),
            filtered: filtered[k][c],
        };
        let excess: Vec<Excess> = (0..data.theta.len()).flat_map(|k| (0..3).map(move |c| at(k, c))).collect();
        Ok(excess)
    }

    /// The curve of a stack and its standard deviations.
    fn predict(
        &self,
        from: &Optics,
        stack: &Stack,
        data: &[&Data],
        misfit: &Misfit,
    ) -> Result<Predicted, ModelError> {
        let theta = grid();
        let curve = self.optics.lobes(stack)?.curve(&theta);
        let spread = self.spread(from, stack, &theta);
        let filtered = filtered(&self.optics, stack, &theta)?;
        let sigma = |k: usize| {
            std::array::from_fn(|c| {
                spread[k][c].hypotenuse(misfit.at(stack, filtered[k][c])) * (curve.rgb()[k][c] + FLOOR)
            })
        };
        let sigma = (0..theta.len()).map(sigma).collect();
        let shares = |d: &&&Data| d.stack.layers().iter().any(|ink| stack.layers().contains(ink));
        let from = data.iter().filter(shares).map(|d| d.stack.clone()).collect();
        Ok(Predicted { stack: stack.clone(), curve, sigma, from })
    }

    fn figures(&self, from: &Optics) -> Vec<FittedFigure> {
        let mut before = figures::prepared(from);
        let n = self.x.len();
        (0..n)
            .map(|i| {
                let mut unit = vec![0.0; n];
                unit[i] = 1.0;
                let y = self.factor.forward(&unit);
                let was = self.slots[i].get(&mut before).unwrap_or(0.0);
                FittedFigure {
                    name: self.slots[i].name(),
                    before: was,
                    value: self.x[i].exponential(),
                    uncertainty: self.scale * dot(&y, &y).sqrt(),
                    uncertainty_before: self.slots[i].spread(was),
                }
            })
            .collect()
    }
}

#[cfg(test)]
mod tests;
