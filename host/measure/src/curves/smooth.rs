//! A smooth curve through noisy samples on an even grid, with as much smoothing as the samples bear.
//!
//! Method: Whittaker's smoother, the least squares of `sum w (y - z)^2 + lambda sum (second difference of z)^2`; lambda by
//! leave-one-out cross-validation, which a linear smoother gives in closed form. Then the nearest curve that falls and may rise
//! once (pool adjacent violators from both sides): lobes fall from the peak, and rise only as 1 / cos toward grazing. Cost: one
//! system of some sixty unknowns for each of twenty lambdas.

use crate::linalg::Cholesky;

/// The smoothed samples and their standard deviations. `weight` is 1 / variance, 0 for a missing sample.
pub(crate) fn smooth(y: &[f64], weight: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let known = weight.iter().filter(|w| **w > 0.0).count();
    if known < 4 {
        let mean =
            y.iter().zip(weight).map(|(y, w)| y * w).sum::<f64>() / weight.iter().sum::<f64>().max(1e-300);
        let z = y.iter().zip(weight).map(|(y, w)| if *w > 0.0 { *y } else { mean }).collect();
        return (z, weight.iter().map(|w| if *w > 0.0 { w.powf(-0.5) } else { 1.0 }).collect());
    }
    let mut largest: Vec<f64> = weight.iter().copied().filter(|w| *w > 0.0).collect();
    let typical = crate::linalg::median(&mut largest);
    let mut best: Option<(f64, Vec<f64>, Vec<f64>)> = None;
    for power in -6..14 {
        let lambda = typical * 10f64.powf(f64::from(power) / 2.0);
        let Some((z, leverage)) = whittaker(y, weight, lambda) else { continue };
        let left_out: f64 = (0..y.len())
            .filter(|&i| weight[i] > 0.0)
            .map(|i| weight[i] * ((y[i] - z[i]) / (1.0 - weight[i] * leverage[i]).max(1e-3)).powi(2))
            .sum();
        if best.as_ref().is_none_or(|(least, ..)| left_out < *least) {
            best = Some((left_out, z, leverage));
        }
    }
    let (_, z, leverage) = best.unwrap_or((0.0, y.to_vec(), vec![0.0; y.len()]));
    (z, leverage.iter().map(|v| v.max(0.0).sqrt()).collect())
}

/// The smoother for one lambda: the curve, and the variance of each of its samples (the inverse's diagonal).
fn whittaker(y: &[f64], weight: &[f64], lambda: f64) -> Option<(Vec<f64>, Vec<f64>)> {
    let n = y.len();
    let mut a = vec![0.0; n * n];
    for i in 0..n {
        a[i * n + i] += weight[i];
    }
    for i in 1..n - 1 {
        for (j, u) in [(i - 1, 1.0), (i, -2.0), (i + 1, 1.0)] {
            for (k, v) in [(i - 1, 1.0), (i, -2.0), (i + 1, 1.0)] {
                a[j * n + k] += lambda * u * v;
            }
        }
    }
    let factors = Cholesky::new(&a, n)?;
    let b: Vec<f64> = y.iter().zip(weight).map(|(y, w)| y * w).collect();
    let z = factors.solve(&b);
    let variance = (0..n)
        .map(|i| {
            let mut unit = vec![0.0; n];
            unit[i] = 1.0;
            factors.solve(&unit)[i]
        })
        .collect();
    Some((z, variance))
}

/// The nearest sequence that falls up to some sample and rises from there.
pub(crate) fn falling_then_rising(y: &[f64], weight: &[f64]) -> Vec<f64> {
    let cost = |z: &[f64], y: &[f64], w: &[f64]| -> f64 {
        z.iter().zip(y).zip(w).map(|((z, y), w)| w * (z - y) * (z - y)).sum()
    };
    let mut best = (f64::INFINITY, y.to_vec());
    for turn in 1..=y.len() {
        let mut z = falling(&y[..turn], &weight[..turn]);
        let rest: Vec<f64> = y[turn..].iter().rev().copied().collect();
        let back: Vec<f64> = weight[turn..].iter().rev().copied().collect();
        z.extend(falling(&rest, &back).into_iter().rev());
        let found = cost(&z, y, weight);
        // Among equals the later turn: what falls to the end needs no rise.
        if found <= best.0 * (1.0 + 1e-12) {
            best = (found, z);
        }
    }
    best.1
}

/// The nearest sequence that never rises.
fn falling(y: &[f64], weight: &[f64]) -> Vec<f64> {
    let mut blocks: Vec<(f64, f64, usize)> = Vec::new();
    for (y, w) in y.iter().zip(weight) {
        blocks.push((*y, w.max(1e-9), 1));
        while let [.., a, b] = blocks[..] {
            if a.0 >= b.0 {
                break;
            }
            blocks.truncate(blocks.len() - 2);
            blocks.push(((a.0 * a.1 + b.0 * b.1) / (a.1 + b.1), a.1 + b.1, a.2 + b.2));
        }
    }
    blocks.into_iter().flat_map(|(y, _, n)| std::iter::repeat_n(y, n)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Even noise without a library: a fixed sequence of known variance 1.
    fn noise(i: usize) -> f64 {
        let x = ((i as f64 * 12.9898).sin() * 43_758.545_3).fract().abs();
        (x - 0.5) * 12f64.sqrt()
    }

    #[test]
    fn smoothing_removes_noise_and_keeps_shape() {
        let truth = |i: usize| -(i as f64 / 12.0).powi(2) / (1.0 + i as f64 / 30.0);
        for sigma in [0.0, 0.02, 0.2] {
            let y: Vec<f64> = (0..64).map(|i| truth(i) + sigma * noise(i)).collect();
            let weight = vec![1.0 / (sigma * sigma).max(1e-6); 64];
            let (z, deviation) = smooth(&y, &weight);
            let rms = |v: &[f64]| {
                (v.iter().enumerate().map(|(i, v)| (v - truth(i)).powi(2)).sum::<f64>() / 64.0).sqrt()
            };
            assert!(rms(&z) < 0.6 * sigma.max(2e-3), "sigma {sigma}: {}", rms(&z));
            assert!(deviation.iter().all(|d| *d <= sigma.max(1e-3) * 1.001));
        }
    }

    #[test]
    fn a_gap_is_bridged() {
        let mut weight = vec![1e4; 30];
        weight[12..16].fill(0.0);
        let y: Vec<f64> =
            (0..30).map(|i| if (12..16).contains(&i) { 99.0 } else { -0.1 * i as f64 }).collect();
        let (z, _) = smooth(&y, &weight);
        assert!((z[14] + 1.4).abs() < 0.01, "{z:?}");
    }

    #[test]
    fn the_nearest_curve_falls_and_rises_once() {
        let y = [5.0, 5.2, 3.0, 1.0, 1.4, 0.9, 0.8, 1.5, 2.0];
        let z = falling_then_rising(&y, &[1.0; 9]);
        let turn = (0..9).min_by(|a, b| z[*a].total_cmp(&z[*b])).unwrap();
        assert!(
            z[..=turn].windows(2).all(|p| p[1] <= p[0]) && z[turn..].windows(2).all(|p| p[1] >= p[0]),
            "{z:?}"
        );
        assert!((z[0] - 5.1).abs() < 1e-12 && (z[8] - 2.0).abs() < 1e-12);
        let falls = [3.0, 2.0, 1.0, 0.5];
        assert_eq!(falling_then_rising(&falls, &[1.0; 4]), falls);
    }
}
