//! Systems of linear equations, and what is typical of some values.

pub(crate) use inks::linalg::Cholesky;

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
    fn one_outlier_does_not_move_the_spread() {
        let mut values: Vec<f64> = (0..101).map(|i| f64::from(i) / 100.0).collect();
        let clean = spread(&values);
        values[0] = 1e9;
        let dirty = spread(&values);
        assert!((clean.0 - dirty.0).abs() < 0.02 && (clean.1 - dirty.1).abs() < 0.02);
    }
}
