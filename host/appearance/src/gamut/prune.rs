//! Leaving out weights that are too small to print.

/// Weights below this are left out, so they need no cartridge.
pub(super) const PRUNED: f64 = 0.005;

/// Drops weights below 0.5 %, and returns whether there were any. The largest weight always stays.
pub(super) fn prune(weights: &mut [f64]) -> bool {
    let small = |w: f64| w > 0.0 && w < PRUNED;
    if !weights.iter().any(|&w| small(w)) {
        return false;
    }
    let largest = weights.iter().copied().fold(0.0, f64::max);
    let mut sum = 0.0;
    let mut dropped = false;
    for w in weights.iter_mut() {
        if small(*w) && *w < largest {
            *w = 0.0;
            dropped = true;
        }
        sum += *w;
    }
    if sum > 0.0 {
        weights.iter_mut().for_each(|w| *w /= sum);
    }
    dropped
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_weights_are_dropped_and_the_rest_sum_to_one() {
        let mut weights = [0.6, 0.004, 0.0, 0.396];
        assert!(prune(&mut weights));
        assert_eq!(weights[1], 0.0);
        assert!(
            (weights.iter().sum::<f64>() - 1.0).abs() < 1e-15 && (weights[0] - 0.6 / 0.996).abs() < 1e-15
        );
        assert!(!prune(&mut weights));
    }

    /// With more than two hundred equal weights all are small, and all are the largest, so they stay.
    #[test]
    fn the_largest_weight_stays_however_small() {
        let mut weights = vec![1.0 / 250.0; 250];
        prune(&mut weights);
        assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
    }
}
