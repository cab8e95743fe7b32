//! Small dense systems of linear equations, symmetric and positive definite: normal equations of least squares.
//!
//! Method: Cholesky's factorisation. Cost: n^3 / 6 multiplications; systems here have at most some hundreds of unknowns.
//! `foilpress-measure` uses it too.

/// A lower triangle L with `L L^T = A`, rows one after the other.
#[derive(Clone, Debug)]
pub struct Cholesky {
    n: usize,
    l: Vec<f64>,
}

impl Cholesky {
    /// Factors the n x n matrix `a`. None if it is not positive definite.
    ///
    /// # Panics
    /// If `a` has fewer than n x n numbers, which is a bug in the caller.
    pub fn new(a: &[f64], n: usize) -> Option<Cholesky> {
        let mut l = vec![0.0; n * n];
        for i in 0..n {
            for j in 0..=i {
                let dot: f64 = (0..j).map(|k| l[i * n + k] * l[j * n + k]).sum();
                let rest = a[i * n + j] - dot;
                if i == j {
                    if !(rest.is_finite() && rest > 0.0) {
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

    /// Factors `a` with its diagonal made larger by the share `damping`, as Levenberg and Marquardt's method does.
    pub fn damped(a: &[f64], n: usize, damping: f64) -> Option<Cholesky> {
        let mut a = a.to_vec();
        (0..n).for_each(|i| a[i * n + i] *= 1.0 + damping);
        Cholesky::new(&a, n)
    }

    /// Solves `L y = b`; the square of y is `b A^-1 b`.
    pub fn forward(&self, b: &[f64]) -> Vec<f64> {
        let (n, l) = (self.n, &self.l);
        let mut y = b.to_vec();
        for i in 0..n {
            let dot: f64 = (0..i).map(|k| l[i * n + k] * y[k]).sum();
            y[i] = (y[i] - dot) / l[i * n + i];
        }
        y
    }

    /// Solves `A x = b`.
    pub fn solve(&self, b: &[f64]) -> Vec<f64> {
        self.back(self.forward(b))
    }

    /// Solves `L^T x = b`. For b of independent unit normal numbers, x has the covariance `A^-1`.
    pub fn back(&self, mut x: Vec<f64>) -> Vec<f64> {
        let (n, l) = (self.n, &self.l);
        for i in (0..n).rev() {
            let dot: f64 = (i + 1..n).map(|k| l[k * n + i] * x[k]).sum();
            x[i] = (x[i] - dot) / l[i * n + i];
        }
        x
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn factors_solve_their_matrix(entries in prop::collection::vec(-1.0f64..1.0, 25), b in prop::collection::vec(-1.0f64..1.0, 5)) {
            let mut a = vec![0.0; 25];
            for i in 0..5 {
                for j in 0..5 {
                    let dot: f64 = (0..5).map(|k| entries[5 * i + k] * entries[5 * j + k]).sum();
                    a[5 * i + j] = dot + if i == j { 0.1 } else { 0.0 };
                }
            }
            let factor = Cholesky::new(&a, 5).unwrap();
            let x = factor.solve(&b);
            for (i, b) in b.iter().enumerate() {
                let found: f64 = (0..5).map(|j| a[5 * i + j] * x[j]).sum();
                prop_assert!((found - b).abs() < 1e-9);
            }
            let y = factor.forward(&b);
            let inner: f64 = x.iter().zip(&b).map(|(x, b)| x * b).sum();
            prop_assert!((y.iter().map(|y| y * y).sum::<f64>() - inner).abs() < 1e-9 * (1.0 + inner.abs()));
        }
    }

    #[test]
    fn a_matrix_that_is_not_positive_has_no_factor() {
        assert!(Cholesky::new(&[1.0, 2.0, 2.0, 1.0], 2).is_none());
        assert!(Cholesky::new(&[1.0, 0.0, 0.0, f64::NAN], 2).is_none());
        let damped = Cholesky::damped(&[1.0, 2.0, 2.0, 1.0], 2, 2.0).unwrap();
        assert!((damped.solve(&[3.0, 2.0])[0] - 1.0).abs() < 1e-12);
    }
}
