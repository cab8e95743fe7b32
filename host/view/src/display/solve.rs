//! How far each cell of a pixel is open: bounded least squares in cube roots.
//!
//! Problem: minimise `sum_j W_j^2 (cbrt(sum_q u_q R_qj) - cbrt(t_j))^2` over `leak <= u_q <= 1`, where `R_q` is what all cells
//! of stack q return when open, relative to the display's brightness, t is the target's radiance and W are the weights of the
//! metric (eqs. 2-3 of the 2009 paper). The simplex of `appearance::solve` does not fit: cells open independently, so weights
//! have bounds and no sum.
//! Method: Gauss-Newton. The model at each step is a quadratic with bounds in at most nine unknowns, which descent along one
//! unknown after the other solves ([`within`]); Armijo's rule halves the step. It starts from least squares in the tangent of
//! the metric at the target.
//! Cost: about six steps of `K^2 m` products. Limits: a local minimum, like any search in this metric; in 256 random problems
//! of two stacks none was worse than the best of a fine grid.

use appearance::brdf::{Space, Table, reflectances};
use inks::{Library, Stack};
use maths::Maths;

/// Relative fall of the objective below which the search ends, and the most steps.
const DROP: f64 = 1e-10;
const MOST_STEPS: usize = 60;
const MOST_HALVINGS: usize = 30;
/// Rounds of descent along the unknowns; they end as soon as nothing moves.
const MOST_ROUNDS: usize = 400;
/// Radiance below this share of the brightest stack has the slope of the cube root there.
const FLOOR: f64 = 1e-7;

/// Solves one pixel after another.
#[derive(Clone, Debug)]
pub struct Solver {
    /// Radiance of each stack, all cells open.
    rows: Vec<Vec<f64>>,
    radiance: Vec<f64>,
    weight: Vec<f64>,
    leak: f64,
    floor: f64,
}

impl Solver {
    /// For stacks whose cells cover `gains` times the area of the least; closed cells show `leak` of what open ones show.
    pub fn new(space: &Space, stacks: &[Stack], gains: &[f64], leak: f64, library: &Library) -> Solver {
        Solver::of_rows(space, &reflectances(stacks, library, space), gains, leak)
    }

    /// The same from reflectances (1/sr), a row a stack.
    pub(super) fn of_rows(space: &Space, rows: &Table, gains: &[f64], leak: f64) -> Solver {
        let radiance = space.radiance().to_vec();
        let rows: Vec<Vec<f64>> = rows
            .rows()
            .zip(gains)
            .map(|(row, gain)| row.iter().zip(&radiance).map(|(f, c)| gain * f.max(0.0) * c).collect())
            .collect();
        let brightest = rows.iter().flatten().copied().fold(0.0, f64::max);
        Solver {
            rows,
            weight: space.weight().to_vec(),
            radiance,
            leak,
            floor: (FLOOR * brightest).max(1e-30),
        }
    }

    /// How far the cells of each stack are open, `leak` to 1, as shares of what open cells return, and the distance d that is
    /// left between the display and the target (reflectance in 1/sr).
    pub fn solve(&self, target: &[f32]) -> (Vec<f64>, f64) {
        let target: Vec<f64> =
            target.iter().zip(&self.radiance).map(|(f, c)| (f64::from(*f) * c).max(0.0)).collect();
        let roots: Vec<f64> = target.iter().map(|t| t.cube_root()).collect();
        let count = self.rows.len();
        let bounds = vec![(self.leak, 1.0); count];
        let mut open = vec![0.5 * (self.leak + 1.0); count];
        // The tangent of the metric at the target: its model holds everywhere, so one step is the start.
        let (hessian, slope) = self.model(&open, |j, mixed| {
            let slope = self.slope(j, target[j]);
            (slope, slope * (mixed - target[j]))
        });
        within(&hessian, &slope, &bounds, &mut open);
        let mut value = self.value(&open, &roots);
        for _ in 0..MOST_STEPS {
            let (hessian, slope) = self.model(&open, |j, mixed| {
                (self.slope(j, mixed), self.weight[j] * (mixed.cube_root() - roots[j]))
            });
            let mut full = open.clone();
            within(&hessian, &slope, &bounds, &mut full);
            let step: Vec<f64> = full.iter().zip(&open).map(|(to, from)| to - from).collect();
            let promised: f64 = 2.0 * step.iter().zip(&slope).map(|(d, g)| d * g).sum::<f64>();
            let mut length = 1.0;
            let better = (0..MOST_HALVINGS).find_map(|_| {
                let trial: Vec<f64> = open.iter().zip(&step).map(|(u, d)| u + length * d).collect();
                let at = self.value(&trial, &roots);
                let falls = at <= value + 1e-4 * length * promised;
                length *= 0.5;
                falls.then_some((trial, at))
            });
            let Some((trial, at)) = better else { break };
            let fell = value - at;
            (open, value) = (trial, at);
            if fell <= DROP * value {
                break;
            }
        }
        (open, value.sqrt())
    }

    /// The radiance of column j.
    fn mixed(&self, open: &[f64], j: usize) -> f64 {
        self.rows.iter().zip(open).map(|(row, u)| u * row[j]).sum()
    }

    /// How fast the weighted cube root of column j grows at a radiance.
    fn slope(&self, j: usize, radiance: f64) -> f64 {
        self.weight[j] / (3.0 * radiance.max(self.floor).cube_root().squared())
    }

    /// The objective: squared distance.
    pub(super) fn value(&self, open: &[f64], roots: &[f64]) -> f64 {
        let miss = |j: usize| self.weight[j] * (self.mixed(open, j).cube_root() - roots[j]);
        (0..roots.len()).map(|j| miss(j).squared()).sum()
    }

    /// The quadratic model: half its second and first derivatives. `at` gives the slope and the weighted miss of a column.
    fn model(&self, open: &[f64], at: impl Fn(usize, f64) -> (f64, f64)) -> (Vec<f64>, Vec<f64>) {
        let count = self.rows.len();
        let (mut hessian, mut slope) = (vec![0.0; count * count], vec![0.0; count]);
        for j in 0..self.weight.len() {
            let (steep, miss) = at(j, self.mixed(open, j));
            for (a, row) in self.rows.iter().enumerate() {
                let pull = steep * row[j];
                slope[a] += pull * miss;
                for (b, other) in self.rows[..=a].iter().enumerate() {
                    hessian[a * count + b] += pull * steep * other[j];
                }
            }
        }
        for (a, b) in (0..count).flat_map(|a| (0..a).map(move |b| (a, b))) {
            hessian[b * count + a] = hessian[a * count + b];
        }
        (hessian, slope)
    }
}

/// Minimises `(u - u0) H (u - u0) / 2 + g (u - u0)` within bounds, from `u0` in `at`, along one unknown after the other. H is
/// symmetric and positive semidefinite, so the descent ends at the minimum.
pub(super) fn within(hessian: &[f64], slope: &[f64], bounds: &[(f64, f64)], at: &mut [f64]) {
    let count = at.len();
    let mut gradient = slope.to_vec();
    for _ in 0..MOST_ROUNDS {
        let mut moved: f64 = 0.0;
        for i in 0..count {
            let stiff = hessian[i * count + i];
            if stiff <= 0.0 {
                continue;
            }
            let to = (at[i] - gradient[i] / stiff).clamp(bounds[i].0, bounds[i].1);
            let step = to - at[i];
            if step != 0.0 {
                at[i] = to;
                (0..count).for_each(|k| gradient[k] += step * hessian[k * count + i]);
                moved = moved.max(step.abs());
            }
        }
        if moved < 1e-12 {
            break;
        }
    }
}
