//! Small dense systems of linear equations, symmetric and positive definite.
//!
//! Method: Cholesky's factorisation. Cost: n^3 / 6 multiplications; systems here have at most some hundreds of unknowns.

/// A lower triangle L with `L L^T = A`, rows one after the other.
pub(crate) struct Cholesky {
    n: usize,
    l: Vec<f64>,
}

impl Cholesky {
    /// Factors the n x n matrix `a`. None if it is not positive definite.
    pub(crate) fn new(a: &[f64], n: usize) -> Option<Cholesky> {
        let mut l = vec![0.0; n * n];
        for i in 0..n {
            for j in 0..=i {
                let dot: f64 = (0..j).map(|k| l[i * n + k] * l[j * n + k]).sum();
                let rest = a[i * n + j] - dot;
                if i == j {
                    if rest.is_nan() || rest <= 0.0 {
                        return None;
                    }
                    l[i * n + i] = rest.sqrt();
                } else {
                    l[i * n + j] = rest / l[j * n + j];
                }
            }
        }
        Some(Cholesky { n, l })
    }

    /// Solves `A x = b`.
    pub(crate) fn solve(&self, b: &[f64]) -> Vec<f64> {
        let (n, l) = (self.n, &self.l);
        let mut x = b.to_vec();
        for i in 0..n {
            let dot: f64 = (0..i).map(|k| l[i * n + k] * x[k]).sum();
            x[i] = (x[i] - dot) / l[i * n + i];
        }
        self.back(x)
    }

    /// Solves `L^T x = b`. For b of independent unit normal numbers, x has the covariance `A^-1`.
    pub(crate) fn back(&self, mut x: Vec<f64>) -> Vec<f64> {
        let (n, l) = (self.n, &self.l);
        for i in (0..n).rev() {
            let dot: f64 = (i + 1..n).map(|k| l[k * n + i] * x[k]).sum();
            x[i] = (x[i] - dot) / l[i * n + i];
        }
        x
    }
}

/// The median; 0 for no values. Reorders them.
pub(crate) fn median(values: &mut [f64]) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Median and robust standard deviation (1.4826 median absolute deviations).
pub(crate) fn spread(values: &[f64]) -> (f64, f64) {
    let middle = median(&mut values.to_vec());
    let mut off: Vec<f64> = values.iter().map(|v| (v - middle).abs()).collect();
    (middle, 1.4826 * median(&mut off))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_solution_satisfies_its_equations() {
        // A = M M^T + 1, from a fixed M.
        let n = 7;
        let m: Vec<f64> = (0..n * n).map(|i| ((i * i * 37 + 11) % 19) as f64 / 19.0).collect();
        let mut a = vec![0.0; n * n];
        for i in 0..n {
            for j in 0..n {
                a[i * n + j] =
                    (0..n).map(|k| m[i * n + k] * m[j * n + k]).sum::<f64>() + f64::from(u8::from(i == j));
            }
        }
        let b: Vec<f64> = (0..n).map(|i| i as f64 - 2.5).collect();
        let x = Cholesky::new(&a, n).unwrap().solve(&b);
        for i in 0..n {
            let sum: f64 = (0..n).map(|j| a[i * n + j] * x[j]).sum();
            assert!((sum - b[i]).abs() < 1e-10, "{i}: {sum}");
        }
        assert!(Cholesky::new(&[1.0, 2.0, 2.0, 1.0], 2).is_none());
    }

    #[test]
    fn one_outlier_does_not_move_the_spread() {
        let mut values: Vec<f64> = (0..101).map(|i| f64::from(i) / 100.0).collect();
        let clean = spread(&values);
        values[0] = 1e9;
        let dirty = spread(&values);
        assert!((clean.0 - dirty.0).abs() < 0.02 && (clean.1 - dirty.1).abs() < 0.02);
    }
}
