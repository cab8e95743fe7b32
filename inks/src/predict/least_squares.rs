//! Non-linear least squares with bounds, by Levenberg and Marquardt's method.
//!
//! Problem: a hundred numbers, some of which hardly matter, from some thousand residuals.
//! Method: the normal equations, damped by a multiple of their diagonal, solved by Cholesky's factorisation. Numbers at a bound that would
//! leave it stay there for the step. The step is taken, and damping falls to a fifth, if it lowers the cost; else
//! damping grows five times.
//! Cost: n^3 / 6 operations a step beside the caller's. Limits: a local minimum near the start. Priors of the caller keep the equations
//! regular.

use crate::linalg::Cholesky;

/// A symmetric matrix, row by row.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Matrix {
    pub n: usize,
    pub values: Vec<f64>,
}

/// Cost, gradient and curvature at a point: those of `r . r`, halved.
#[derive(Clone, Debug)]
pub(super) struct Normal {
    pub cost: f64,
    pub gradient: Vec<f64>,
    pub curvature: Matrix,
}

impl Matrix {
    pub fn zero(n: usize) -> Matrix {
        Matrix { n, values: vec![0.0; n * n] }
    }

    pub fn at_mut(&mut self, i: usize, j: usize) -> &mut f64 {
        &mut self.values[i * self.n + j]
    }

    /// Its factor; `None` unless it is positive definite.
    pub fn factor(&self) -> Option<Cholesky> {
        Cholesky::new(&self.values, self.n)
    }
}

/// Steps after which the present point has to do.
const MOST_STEPS: usize = 200;
/// The decrease of the cost, as a share, that ends the search.
const ENOUGH: f64 = 1e-9;

/// A point of low cost near `x`, within the bounds, and the normal equations there.
pub(super) fn minimise(
    mut x: Vec<f64>,
    bounds: &[[f64; 2]],
    mut normal: impl FnMut(&[f64]) -> Normal,
    mut cost: impl FnMut(&[f64]) -> f64,
) -> (Vec<f64>, Normal) {
    for (v, [least, most]) in x.iter_mut().zip(bounds) {
        *v = v.clamp(*least, *most);
    }
    let mut here = normal(&x);
    let mut damping = 1e-3;
    for _ in 0..MOST_STEPS {
        let Some(tried) = step(&x, &here, damping, bounds) else {
            damping *= 10.0;
            if damping > 1e12 {
                break;
            }
            continue;
        };
        let reached = cost(&tried);
        if reached.is_finite() && reached < here.cost {
            let gain = here.cost - reached;
            let before = here.cost;
            x = tried;
            here = normal(&x);
            damping = (damping * 0.2).max(1e-12);
            if gain <= ENOUGH * before {
                break;
            }
        } else {
            damping *= 5.0;
            if damping > 1e12 {
                break;
            }
        }
    }
    (x, here)
}

/// One damped step, cut at the bounds.
fn step(x: &[f64], here: &Normal, damping: f64, bounds: &[[f64; 2]]) -> Option<Vec<f64>> {
    let n = x.len();
    let held: Vec<bool> = (0..n)
        .map(|i| {
            let downhill = -here.gradient[i];
            (x[i] <= bounds[i][0] && downhill < 0.0) || (x[i] >= bounds[i][1] && downhill > 0.0)
        })
        .collect();
    let mut free = here.curvature.clone();
    let mut right: Vec<f64> = here.gradient.iter().map(|g| -g).collect();
    for i in 0..n {
        if held[i] {
            right[i] = 0.0;
            for j in 0..n {
                *free.at_mut(i, j) = 0.0;
                *free.at_mut(j, i) = 0.0;
            }
            *free.at_mut(i, i) = 1.0;
        }
    }
    let move_ = Cholesky::damped(&free.values, n, damping)?.solve(&right);
    Some((0..n).map(|i| (x[i] + move_[i]).clamp(bounds[i][0], bounds[i][1])).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The normal equations of residuals, by differences.
    fn equations(residuals: &dyn Fn(&[f64]) -> Vec<f64>, x: &[f64]) -> Normal {
        let n = x.len();
        let r = residuals(x);
        let columns: Vec<Vec<f64>> = (0..n)
            .map(|i| {
                let mut there = x.to_vec();
                there[i] += 1e-6;
                residuals(&there).iter().zip(&r).map(|(a, b)| (a - b) / 1e-6).collect()
            })
            .collect();
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let mut curvature = Matrix::zero(n);
        for i in 0..n {
            for j in 0..n {
                *curvature.at_mut(i, j) = dot(&columns[i], &columns[j]);
            }
        }
        Normal {
            cost: dot(&r, &r) / 2.0,
            gradient: columns.iter().map(|column| dot(column, &r)).collect(),
            curvature,
        }
    }

    fn least(residuals: &dyn Fn(&[f64]) -> Vec<f64>, x: Vec<f64>, bounds: &[[f64; 2]]) -> Vec<f64> {
        let cost = |x: &[f64]| residuals(x).iter().map(|r| r * r).sum::<f64>() / 2.0;
        minimise(x, bounds, |x| equations(residuals, x), cost).0
    }

    /// Rosenbrock's valley has its minimum at (1, 1); bounded away from it, the minimum is on the bound.
    #[test]
    fn the_bent_valley_is_followed_to_its_end_and_to_a_bound() {
        let valley = |x: &[f64]| vec![10.0 * (x[1] - x[0] * x[0]), 1.0 - x[0]];
        let free = least(&valley, vec![-1.2, 1.0], &[[-9.0, 9.0]; 2]);
        assert!((free[0] - 1.0).abs() < 1e-5 && (free[1] - 1.0).abs() < 1e-5, "{free:?}");
        let bounded = least(&valley, vec![-1.2, 1.0], &[[-9.0, 0.5], [-9.0, 9.0]]);
        assert!((bounded[0] - 0.5).abs() < 1e-9 && (bounded[1] - 0.25).abs() < 1e-5, "{bounded:?}");
    }
}
