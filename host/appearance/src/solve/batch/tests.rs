//! Against the solver of one pixel, against the optimality conditions, and each pixel against itself in other company.

use proptest::prelude::*;

use super::*;
use crate::brdf::Table;
use crate::solve::columns::Columns;
use crate::solve::simplex::tests::points;
use crate::solve::vector::{add_scaled, dot};

/// The matrix of some points, the inner products of some targets with them, and the points.
fn problem(rows: &[Vec<f64>], targets: &[Vec<f64>]) -> (Table, Gram, Vec<f64>) {
    let mut table = Table::new(rows[0].len());
    rows.iter().for_each(|row| table.push(row));
    let mut h = vec![0.0; rows.len() * targets.len()];
    let columns = Columns::of_rows(&table);
    for (h, t) in h.chunks_exact_mut(rows.len()).zip(targets) {
        columns.products(t, h);
    }
    let gram = Gram::of_rows(&table);
    (table, gram, h)
}

fn residual(rows: &Table, a: &[f64], t: &[f64]) -> f64 {
    let mut r: Vec<f64> = t.iter().map(|t| -t).collect();
    a.iter().enumerate().for_each(|(k, &w)| add_scaled(&mut r, w, rows.row(k)));
    dot(&r, &r).sqrt()
}

/// Points, some dependent on others, and targets: outside, equal to a point, and between two of them.
fn problems() -> impl Strategy<Value = (Vec<Vec<f64>>, Vec<Vec<f64>>)> {
    (points(), prop::collection::vec((prop::collection::vec(-1.5f64..1.5, 14), 0..4, 0usize..30), 1..40))
        .prop_map(|(rows, targets)| {
            let targets = targets.into_iter().map(|(t, kind, k)| {
                let (one, other) = (&rows[k % rows.len()], &rows[(k + 1) % rows.len()]);
                match kind {
                    0 => one.clone(),
                    1 => one.iter().zip(other).map(|(a, b)| 0.5 * (a + b)).collect(),
                    _ => t[..one.len()].to_vec(),
                }
            });
            let targets = targets.collect();
            (rows, targets)
        })
}

proptest! {
    #![proptest_config(testing::cases(200))]

    /// Feasible, certified, and as near as the solver of one pixel; the certificate is checked against a gradient of its own.
    #[test]
    fn solutions_are_those_of_one_pixel_at_a_time((rows, targets) in problems(), known in 0usize..10) {
        let (table, gram, h) = problem(&rows, &targets);
        let n = rows.len();
        let mut a = vec![0.0; h.len()];
        let mut lanes = SimplexBatch::new(&gram, &h[..known.min(targets.len()) * n]).unwrap();
        let certificate = lanes.solve(&h, &mut a).unwrap();
        prop_assert!(certificate.gap < 1e-11, "{certificate:?}");
        for ((a, h), t) in a.chunks_exact(n).zip(h.chunks_exact(n)).zip(&targets) {
            prop_assert!(a.iter().all(|&w| w >= 0.0) && (a.iter().sum::<f64>() - 1.0).abs() < 1e-14, "{a:?}");
            let mut slope: Vec<f64> = h.iter().map(|h| -h).collect();
            a.iter().enumerate().for_each(|(k, &w)| add_scaled(&mut slope, w, gram.row(k)));
            let least = slope.iter().copied().fold(f64::INFINITY, f64::min);
            prop_assert!(dot(&slope, a) - least < 1e-11, "{slope:?}");
            let mut alone = vec![0.0; n];
            Simplex::new().solve(&gram, h, &mut alone).unwrap();
            prop_assert!((residual(&table, a, t) - residual(&table, &alone, t)).abs() < 1e-6);
        }
    }

    /// Whatever a pixel starts from: its own weights, those of another pixel, or what are no weights at all.
    #[test]
    fn starts_do_not_decide((rows, targets) in problems(), turn in 0usize..40, odd in prop::sample::select(vec![f64::NAN, -1.0, 7.0])) {
        let (table, gram, h) = problem(&rows, &targets);
        let n = rows.len();
        let mut lanes = SimplexBatch::new(&gram, &[]).unwrap();
        let mut cold = vec![0.0; h.len()];
        lanes.solve(&h, &mut cold).unwrap();
        let mut warm = cold.clone();
        warm.rotate_left(turn % targets.len() * n);
        warm[0] = odd;
        lanes.solve_from(&h, &mut warm).unwrap();
        for ((cold, warm), t) in cold.chunks_exact(n).zip(warm.chunks_exact(n)).zip(&targets) {
            prop_assert!(warm.iter().all(|&w| w >= 0.0) && (warm.iter().sum::<f64>() - 1.0).abs() < 1e-14, "{warm:?}");
            prop_assert!((residual(&table, cold, t) - residual(&table, warm, t)).abs() < 1e-6);
        }
    }

    /// Bit by bit: in other company, in another order, after other pixels, and with vectors of any width.
    #[test]
    fn company_changes_nothing((rows, targets) in problems(), known in 0usize..10) {
        let (_, gram, h) = problem(&rows, &targets);
        let n = rows.len();
        let fresh = SimplexBatch::new(&gram, &h[..known.min(targets.len()) * n]).unwrap();
        let mut together = vec![0.0; h.len()];
        let mut used = fresh.clone();
        used.solve(&h, &mut together).unwrap();
        let mut plain = vec![0.0; h.len()];
        fresh.clone().batch_plainly(&h, &mut plain).unwrap();
        prop_assert_eq!(&together, &plain);
        for (i, h) in h.chunks_exact(n).enumerate().rev() {
            let (mut alone, mut after) = (vec![0.0; n], vec![0.0; n]);
            fresh.clone().solve(h, &mut alone).unwrap();
            used.solve(h, &mut after).unwrap();
            prop_assert_eq!(&alone[..], &together[i * n..][..n]);
            prop_assert_eq!(alone, after);
        }
    }

    #[test]
    fn hostile_numbers_give_an_error_and_an_end(
        h in prop::collection::vec(prop::num::f64::ANY, 50),
        large in prop::collection::vec(-1e300f64..1e300, 50),
        g in prop::collection::vec(-1e200f64..1e200, 15),
    ) {
        let mut values = [0.0; 25];
        let mut next = g.iter();
        for i in 0..5 {
            for j in 0..=i {
                let v = *next.next().unwrap();
                (values[5 * i + j], values[5 * j + i]) = if i == j { (v.abs(), v.abs()) } else { (v, v) };
            }
        }
        let mut gram = Gram::empty();
        gram.refill_products(5, |i, j| values[5 * i + j]);
        let mut lanes = SimplexBatch::new(&gram, &[]).unwrap();
        for h in [h, large] {
            let mut a = vec![0.0; h.len()];
            match lanes.solve(&h, &mut a) {
                Ok(certificate) => {
                    prop_assert!(certificate.gap.is_finite());
                    for a in a.chunks_exact(5) {
                        prop_assert!(a.iter().all(|&w| w >= 0.0) && (a.iter().sum::<f64>() - 1.0).abs() < 1e-9);
                    }
                }
                Err(error) => prop_assert_eq!(error, SimplexError::NotFinite),
            }
        }
        // An error leaves nothing behind.
        let mut a = [0.0; 5];
        lanes.solve(&[0.0; 5], &mut a).unwrap();
        let mut fresh = [0.0; 5];
        SimplexBatch::new(&gram, &[]).unwrap().solve(&[0.0; 5], &mut fresh).unwrap();
        prop_assert_eq!(a, fresh);
    }
}

/// More pixels than are sorted at a time, and more supports than are kept.
#[test]
fn long_documents_are_solved_like_short_ones() {
    let mut state = 7u64;
    let mut number = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    };
    let rows: Vec<Vec<f64>> = (0..40).map(|_| (0..9).map(|_| number()).collect()).collect();
    let targets: Vec<Vec<f64>> =
        (0..2 * BATCH + 100).map(|_| (0..9).map(|_| 0.7 * number()).collect()).collect();
    let (_, gram, h) = problem(&rows, &targets);
    let mut lanes = SimplexBatch::new(&gram, &h[..40 * 16]).unwrap();
    let mut a = vec![0.0; h.len()];
    assert!(lanes.solve(&h, &mut a).unwrap().gap < 1e-13);
    assert!(lanes.supports.len() > 500, "{}", lanes.supports.len());
    let mut again = vec![0.0; h.len()];
    for (h, a) in h.chunks(40 * 700).zip(again.chunks_mut(40 * 700)) {
        lanes.supports.truncate(lanes.permanent);
        lanes.solve(h, a).unwrap();
    }
    for (pixel, (a, again)) in a.chunks_exact(40).zip(again.chunks_exact(40)).enumerate() {
        assert_eq!(a, again, "pixel {pixel}");
    }
}

/// Few pixels are left to the solver of one pixel, or nothing would be gained.
#[test]
fn ordinary_pixels_stay_in_their_lanes() {
    let rows: Vec<Vec<f64>> = (0..30)
        .map(|i| (0..12).map(|j| f64::from((i * i + 7 * j * i + 3 * j) % 31) / 31.0).collect())
        .collect();
    let targets: Vec<Vec<f64>> =
        (0..500).map(|i| (0..12).map(|j| f64::from((i * 13 + j * j * 5) % 97) / 97.0).collect()).collect();
    let (_, gram, h) = problem(&rows, &targets);
    let mut lanes = SimplexBatch::new(&gram, &[]).unwrap();
    lanes.solve(&h, &mut vec![0.0; h.len()]).unwrap();
    assert!(lanes.hard.is_empty(), "{}", lanes.hard.len());
}

#[test]
fn wrong_lengths_are_refused() {
    let (_, gram, h) = problem(&[vec![1.0], vec![2.0]], &[vec![1.5]]);
    let mut lanes = SimplexBatch::new(&gram, &h).unwrap();
    let error = lanes.solve(&[1.0; 3], &mut [0.0; 3]).unwrap_err();
    assert_eq!(error, SimplexError::Size { points: 2, products: 3, weights: 3 });
    assert!(lanes.solve(&[1.0; 4], &mut [0.0; 2]).is_err());
    assert!(SimplexBatch::new(&gram, &[1.0]).is_err());
    assert!(SimplexBatch::new(&Gram::empty(), &[]).is_err());
    assert_eq!(lanes.solve(&[], &mut []).unwrap(), Certificate { gap: 0.0, steps: 0 });
}
