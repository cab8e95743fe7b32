//! Against Lawson and Hanson's own method, and against the optimality conditions.

use proptest::prelude::*;

use super::*;
use crate::brdf::Table;
use crate::solve::columns::Columns;

fn table(rows: &[Vec<f64>]) -> Table {
    let mut table = Table::new(rows[0].len());
    rows.iter().for_each(|row| table.push(row));
    table
}

fn residual(rows: &Table, a: &[f64], t: &[f64]) -> f64 {
    let mut r: Vec<f64> = t.iter().map(|t| -t).collect();
    for (k, &w) in a.iter().enumerate() {
        add_scaled(&mut r, w, rows.row(k));
    }
    dot(&r, &r).sqrt()
}

/// Distance of `t` to the hull of the rows, by our solver.
fn ours(rows: &Table, t: &[f64]) -> (Vec<f64>, Certificate) {
    let gram = Gram::of_rows(rows);
    let mut h = vec![0.0; rows.len()];
    Columns::of_rows(rows).products(t, &mut h);
    let mut a = vec![0.0; rows.len()];
    let certificate = Simplex::new().solve(&gram, &h, &mut a).unwrap();
    (a, certificate)
}

/// Solves a small dense system by elimination with row exchanges; `None` when it is singular.
fn eliminate(mut m: Vec<Vec<f64>>, mut b: Vec<f64>) -> Option<Vec<f64>> {
    let n = b.len();
    for c in 0..n {
        let p = (c..n).max_by(|&i, &j| m[i][c].abs().total_cmp(&m[j][c].abs()))?;
        if m[p][c].abs() < 1e-14 {
            return None;
        }
        m.swap(c, p);
        b.swap(c, p);
        for r in c + 1..n {
            let f = m[r][c] / m[c][c];
            let upper = m[c].clone();
            m[r].iter_mut().zip(&upper).for_each(|(m, u)| *m -= f * u);
            b[r] -= f * b[c];
        }
    }
    for c in (0..n).rev() {
        let s: f64 = (c + 1..n).map(|k| m[c][k] * b[k]).sum();
        b[c] = (b[c] - s) / m[c][c];
    }
    Some(b)
}

/// Lawson and Hanson's non-negative least squares, the sum kept by a heavy extra equation, as textbooks do it.
fn lawson_hanson(rows: &Table, t: &[f64]) -> Vec<f64> {
    let (k, heavy) = (rows.len(), 1e4);
    let extended = |i: usize| rows.row(i).iter().copied().chain([heavy]).collect::<Vec<f64>>();
    let a: Vec<Vec<f64>> = (0..k).map(extended).collect();
    let t: Vec<f64> = t.iter().copied().chain([heavy]).collect();
    let mut x = vec![0.0; k];
    let mut passive: Vec<usize> = Vec::new();
    for _ in 0..10 * k {
        let r: Vec<f64> = (0..t.len()).map(|j| t[j] - (0..k).map(|i| a[i][j] * x[i]).sum::<f64>()).collect();
        let w: Vec<f64> = a.iter().map(|a| dot(a, &r)).collect();
        let best = (0..k).filter(|i| !passive.contains(i)).max_by(|&i, &j| w[i].total_cmp(&w[j]));
        let Some(best) = best.filter(|&i| w[i] > 1e-9) else { break };
        passive.push(best);
        loop {
            let normal =
                passive.iter().map(|&i| passive.iter().map(|&j| dot(&a[i], &a[j])).collect()).collect();
            let right = passive.iter().map(|&i| dot(&a[i], &t)).collect();
            let Some(z) = eliminate(normal, right) else {
                passive.pop();
                break;
            };
            if z.iter().all(|&z| z > 0.0) {
                x.fill(0.0);
                passive.iter().zip(&z).for_each(|(&i, &z)| x[i] = z);
                break;
            }
            let step = passive
                .iter()
                .zip(&z)
                .filter(|(_, z)| **z <= 0.0)
                .map(|(&i, z)| x[i] / (x[i] - z))
                .fold(1.0, f64::min);
            passive.iter().zip(&z).for_each(|(&i, z)| x[i] += step * (z - x[i]));
            passive.retain(|&i| x[i] > 1e-14);
            (0..k).filter(|i| !passive.contains(i)).for_each(|i| x[i] = 0.0);
        }
    }
    x
}

fn is_feasible(a: &[f64]) -> bool {
    a.iter().all(|&w| w >= 0.0) && (a.iter().sum::<f64>() - 1.0).abs() < 1e-14
}

/// Points; some are doubled, some lie between others, so that G is singular.
pub(in crate::solve) fn points() -> impl Strategy<Value = Vec<Vec<f64>>> {
    (1usize..24, 1usize..14).prop_flat_map(|(k, m)| {
        let point = prop::collection::vec(-1.0f64..1.0, m);
        (prop::collection::vec(point, k), 0usize..4).prop_map(|(mut rows, extra)| {
            for i in 0..extra.min(rows.len()) {
                rows.push(rows[i].clone());
                let other = rows[(i + 1) % rows.len()].clone();
                rows.push(rows[i].iter().zip(&other).map(|(a, b)| 0.25 * a + 0.75 * b).collect());
            }
            rows
        })
    })
}

/// Points and a target.
fn problem() -> impl Strategy<Value = (Vec<Vec<f64>>, Vec<f64>)> {
    points().prop_flat_map(|rows| {
        let columns = rows[0].len();
        (Just(rows), prop::collection::vec(-1.5f64..1.5, columns))
    })
}

proptest! {
    #![proptest_config(testing::cases(300))]

    #[test]
    fn solutions_are_feasible_and_certified((rows, t) in problem()) {
        let (a, certificate) = ours(&table(&rows), &t);
        prop_assert!(is_feasible(&a), "{a:?}");
        prop_assert!(certificate.gap < 1e-11, "{certificate:?}");
        prop_assert!(certificate.steps < most_steps(a.len()) / 2, "{certificate:?}");
    }

    /// The nearest point y of a hull is the one at which no point e of the hull lies on the target's side:
    /// for y - t = r, r.(e - y) >= 0 for all of them, and for no other point of the hull. Counted from the
    /// points themselves.
    #[test]
    fn no_point_of_the_hull_lies_on_the_targets_side((rows, t) in problem()) {
        let rows = table(&rows);
        let (a, _) = ours(&rows, &t);
        let mut y = vec![0.0; t.len()];
        a.iter().enumerate().for_each(|(k, &w)| add_scaled(&mut y, w, rows.row(k)));
        let side = |point: &[f64]| -> f64 { (0..t.len()).map(|j| (y[j] - t[j]) * (point[j] - y[j])).sum() };
        let least = (0..rows.len()).map(|k| side(rows.row(k))).fold(f64::INFINITY, f64::min);
        prop_assert!(least > -1e-11, "{least}");
    }

    #[test]
    fn the_distance_is_lawson_and_hansons((rows, t) in problem()) {
        let rows = table(&rows);
        let (a, _) = ours(&rows, &t);
        let mut b = lawson_hanson(&rows, &t);
        prop_assert!(normalise(&mut b));
        let (ours, theirs) = (residual(&rows, &a, &t), residual(&rows, &b, &t));
        // The heavy equation leaves their sum off by about the residual over 1e8.
        prop_assert!((ours - theirs).abs() < 1e-5, "{ours} {theirs}");
    }

    #[test]
    fn any_start_gives_the_same_distance((rows, t) in problem(), start in prop::collection::vec(0.0f64..1.0, 40)) {
        let rows = table(&rows);
        let (cold, _) = ours(&rows, &t);
        let gram = Gram::of_rows(&rows);
        let mut h = vec![0.0; rows.len()];
        Columns::of_rows(&rows).products(&t, &mut h);
        let mut warm: Vec<f64> = start[..rows.len()].iter().map(|&w| (w - 0.3).max(0.0)).collect();
        let certificate = Simplex::new().solve(&gram, &h, &mut warm).unwrap();
        prop_assert!(certificate.gap < 1e-11);
        prop_assert!((residual(&rows, &cold, &t) - residual(&rows, &warm, &t)).abs() < 1e-6);
    }

    #[test]
    fn stepping_from_a_point_finds_the_same_optimum((rows, t) in problem()) {
        let rows = table(&rows);
        let gram = Gram::of_rows(&rows);
        let n = rows.len();
        let mut a = vec![1.0 / n as f64; n];
        let mut q = vec![0.0; n];
        let mut h = vec![0.0; n];
        Columns::of_rows(&rows).products(&t, &mut h);
        evaluate(&gram, &h, &a, &mut q);
        Simplex::new().descend(&gram, &mut q, &mut a).unwrap();
        prop_assert!(is_feasible(&a));
        let (cold, _) = ours(&rows, &t);
        prop_assert!((residual(&rows, &cold, &t) - residual(&rows, &a, &t)).abs() < 1e-6);
        let mut fresh = vec![0.0; n];
        evaluate(&gram, &h, &a, &mut fresh);
        for (q, fresh) in q.iter().zip(&fresh) {
            prop_assert!((q - fresh).abs() < 1e-11, "{q} {fresh}");
        }
    }

    #[test]
    fn a_target_in_the_hull_is_met(
        (rows, _) in problem(),
        weights in prop::collection::vec(0.0f64..1.0, 40),
    ) {
        let rows = table(&rows);
        let mut a = weights[..rows.len()].to_vec();
        prop_assume!(normalise(&mut a));
        let mut t = vec![0.0; rows.columns()];
        a.iter().enumerate().for_each(|(k, &w)| add_scaled(&mut t, w, rows.row(k)));
        let (found, _) = ours(&rows, &t);
        prop_assert!(residual(&rows, &found, &t) < 1e-9, "{}", residual(&rows, &found, &t));
    }

    #[test]
    fn hostile_numbers_give_an_error_and_an_end(
        h in prop::collection::vec(prop::num::f64::ANY, 5),
        a in prop::collection::vec(prop::num::f64::ANY, 5),
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
        let mut a = a;
        match Simplex::new().solve(&gram, &h, &mut a) {
            Ok(certificate) => {
                prop_assert!(certificate.gap.is_finite());
                prop_assert!(a.iter().all(|&w| w >= 0.0) && (a.iter().sum::<f64>() - 1.0).abs() < 1e-9);
            }
            Err(error) => prop_assert_eq!(error, SimplexError::NotFinite),
        }
    }
}

#[test]
fn a_triangle_has_its_textbook_answers() {
    let rows = table(&[vec![0.0, 0.0], vec![1.0, 0.0], vec![0.0, 1.0]]);
    for (t, expected) in [
        ([0.25, 0.25], [0.5, 0.25, 0.25]),
        ([-1.0, -2.0], [1.0, 0.0, 0.0]),
        ([0.4, -3.0], [0.6, 0.4, 0.0]),
        ([2.0, 1.5], [0.0, 0.75, 0.25]),
        ([9.0, 0.5], [0.0, 1.0, 0.0]),
    ] {
        let (a, _) = ours(&rows, &t);
        for (a, expected) in a.iter().zip(expected) {
            assert!((a - expected).abs() < 1e-14, "{t:?}: {a} instead of {expected}");
        }
    }
}

#[test]
fn one_point_is_its_own_hull_even_at_zero() {
    for value in [0.0, 3.0] {
        let (a, certificate) = ours(&table(&[vec![value]]), &[1.0]);
        assert_eq!((a[0], certificate.gap), (1.0, 0.0));
    }
}

#[test]
fn identical_points_end_at_once() {
    let rows = table(&vec![vec![0.3, 0.7, 0.1]; 64]);
    let (a, certificate) = ours(&rows, &[1.0, 0.0, 0.5]);
    assert!(is_feasible(&a) && certificate.gap < 1e-13 && certificate.steps < 5, "{certificate:?}");
}

/// Curves that differ in the ninth digit: the Gram matrix is singular to working precision.
#[test]
fn nearly_equal_points_are_solved_to_rounding() {
    let rows: Vec<Vec<f64>> = (0..40)
        .map(|i| {
            (0..12).map(|j| 1.0 + 1e-9 * f64::from((i * 7 + j * 13) % 11) + 0.1 * f64::from(j)).collect()
        })
        .collect();
    let t: Vec<f64> = (0..12).map(|j| 1.0 + 0.1 * f64::from(j) + 4e-9).collect();
    let (a, certificate) = ours(&table(&rows), &t);
    assert!(is_feasible(&a) && certificate.gap < 1e-11, "{certificate:?}");
}

#[test]
fn the_scale_of_the_problem_does_not_matter() {
    let rows: Vec<Vec<f64>> =
        (0..9).map(|i| (0..5).map(|j| f64::from((i * i + 3 * j * i + j) % 7)).collect()).collect();
    let t = [2.0, 5.0, 1.0, 0.5, 3.0];
    let (plain, _) = ours(&table(&rows), &t);
    // Powers of two scale without rounding.
    for scale in [2f64.powi(-200), 2f64.powi(200)] {
        let scaled: Vec<Vec<f64>> = rows.iter().map(|r| r.iter().map(|v| v * scale).collect()).collect();
        let (a, _) = ours(&table(&scaled), &t.map(|t| t * scale));
        assert_eq!(a, plain);
    }
}

#[test]
fn wrong_lengths_are_refused() {
    let gram = Gram::of_rows(&table(&[vec![1.0], vec![2.0]]));
    let error = Simplex::new().solve(&gram, &[1.0], &mut [0.0, 0.0]).unwrap_err();
    assert_eq!(error, SimplexError::Size { points: 2, products: 1, weights: 2 });
    assert!(Simplex::new().solve(&Gram::empty(), &[], &mut []).is_err());
}
