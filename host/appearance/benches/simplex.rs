//! Least squares on the simplex for a stream of pixels, each started from the one before.
//!
//! The time of `scalar_products` includes the inner products with the target, that of `solve` does not. `solve_in_lanes` has
//! all pixels at once, cold as in the first round of factoring by `sacls`, and its time includes what is done once for a matrix.
//! `lawson_hanson` is the textbook method on the same
//! Gram matrix, which always starts cold.

#![allow(clippy::disallowed_methods, reason = "it decides no dot of a job")]

use appearance::brdf::{Space, Table};
use appearance::document::Materials;
use appearance::gamut::Printable;
use appearance::solve::{Columns, Gram, Simplex, SimplexBatch};
use divan::{Bencher, black_box};
use inks::{InkSet, Library};
use protocol::ink::Ink;

mod common;

const PIXELS: usize = 4096;

/// Stacks and pixels in the tangent of the metric at the mean of the pixels.
fn problem(k: usize) -> (Table, Table) {
    let field = common::Field::rusty_metal(256);
    let space: &Space = field.space();
    let m = space.columns();
    let mut row = vec![0f32; m];
    let mut pixels = Vec::new();
    let mut mean = vec![0.0; m];
    for p in 0..PIXELS {
        field.reflectance(p, &mut row);
        let values: Vec<f64> = row.iter().zip(space.radiance()).map(|(&f, c)| f64::from(f) * c).collect();
        mean.iter_mut().zip(&values).for_each(|(m, v)| *m += v / PIXELS as f64);
        pixels.push(values);
    }
    let tangent: Vec<f64> = (0..m).map(|j| space.weight()[j] / (3.0 * mean[j].cbrt().powi(2))).collect();
    let scaled = |row: &[f64]| row.iter().zip(&tangent).map(|(v, t)| v * t).collect::<Vec<f64>>();
    let mut targets = Table::new(m);
    pixels.iter().for_each(|p| targets.push(&scaled(p)));
    let all = Printable::from_library(&Library::builtin(), &InkSet::of(Ink::ALL), space).curves;
    let mut stacks = Table::new(m);
    for i in 0..k {
        let row = all.row(i * all.len() / k);
        let radiance: Vec<f64> = row.iter().zip(space.radiance()).map(|(f, c)| f * c).collect();
        stacks.push(&scaled(&radiance));
    }
    (stacks, targets)
}

#[divan::bench(args = [15, 57])]
fn scalar_products_and_solve(bencher: Bencher, k: usize) {
    let (stacks, targets) = problem(k);
    let by_column = Columns::of_rows(&stacks);
    let gram = Gram::of_rows(&stacks);
    let (mut h, mut a) = (vec![0.0; k], vec![0.0; k]);
    let mut simplex = Simplex::new();
    bencher.counter(divan::counter::ItemsCount::new(PIXELS)).bench_local(|| {
        for t in targets.rows() {
            by_column.products(t, &mut h);
            black_box(simplex.solve(&gram, &h, &mut a).unwrap());
        }
    });
}

#[divan::bench(args = [15, 57])]
fn solve(bencher: Bencher, k: usize) {
    let (stacks, targets) = problem(k);
    let by_column = Columns::of_rows(&stacks);
    let gram = Gram::of_rows(&stacks);
    let mut h = vec![0.0; k];
    let products: Vec<Vec<f64>> = targets
        .rows()
        .map(|t| {
            by_column.products(t, &mut h);
            h.clone()
        })
        .collect();
    let mut a = vec![0.0; k];
    let mut simplex = Simplex::new();
    bencher.counter(divan::counter::ItemsCount::new(PIXELS)).bench_local(|| {
        for h in &products {
            black_box(simplex.solve(&gram, h, &mut a).unwrap());
        }
    });
}

#[divan::bench(args = [15, 57])]
fn solve_in_lanes(bencher: Bencher, k: usize) {
    let (stacks, targets) = problem(k);
    let by_column = Columns::of_rows(&stacks);
    let gram = Gram::of_rows(&stacks);
    let (mut h, mut a) = (vec![0.0; k * PIXELS], vec![0.0; k * PIXELS]);
    h.chunks_exact_mut(k).zip(targets.rows()).for_each(|(h, t)| by_column.products(t, h));
    let typical: Vec<f64> = h.chunks_exact(k).step_by(PIXELS / 64).flatten().copied().collect();
    bencher.counter(divan::counter::ItemsCount::new(PIXELS)).bench_local(|| {
        let mut lanes = SimplexBatch::new(&gram, &typical).unwrap();
        black_box(lanes.solve(&h, &mut a).unwrap());
    });
}

#[divan::bench(args = [15, 57])]
fn solve_cold(bencher: Bencher, k: usize) {
    let (stacks, targets) = problem(k);
    let by_column = Columns::of_rows(&stacks);
    let gram = Gram::of_rows(&stacks);
    let (mut h, mut a) = (vec![0.0; k], vec![0.0; k]);
    let mut simplex = Simplex::new();
    bencher.counter(divan::counter::ItemsCount::new(PIXELS)).bench_local(|| {
        for t in targets.rows() {
            by_column.products(t, &mut h);
            a.fill(0.0);
            black_box(simplex.solve(&gram, &h, &mut a).unwrap());
        }
    });
}

#[divan::bench(args = [15, 57], sample_count = 10)]
fn lawson_hanson(bencher: Bencher, k: usize) {
    let (stacks, targets) = problem(k);
    let by_column = Columns::of_rows(&stacks);
    let mut extended = stacks.clone();
    let heavy = 1e3;
    let mut rows = Table::new(stacks.columns() + 1);
    for row in extended.rows() {
        rows.push(&[row, &[heavy]].concat());
    }
    extended = rows;
    let gram = Gram::of_rows(&extended);
    let mut h = vec![0.0; k];
    bencher.counter(divan::counter::ItemsCount::new(PIXELS)).bench_local(|| {
        for t in targets.rows() {
            by_column.products(t, &mut h);
            // The tolerance follows the scale of the problem, not that of the heavy row.
            let tolerance = 1e-9 * h.iter().copied().fold(0.0, f64::max);
            h.iter_mut().for_each(|h| *h += heavy * heavy);
            black_box(nnls(&gram, &h, tolerance));
        }
    });
}

/// Lawson and Hanson's algorithm on normal equations, Cholesky afresh for each support.
fn nnls(gram: &Gram, h: &[f64], tolerance: f64) -> Vec<f64> {
    let k = h.len();
    let mut x = vec![0.0; k];
    let mut passive: Vec<usize> = Vec::new();
    for _ in 0..3 * k {
        let slope = |i: usize| h[i] - passive.iter().map(|&j| gram.row(i)[j] * x[j]).sum::<f64>();
        let best = (0..k)
            .filter(|i| !passive.contains(i))
            .map(|i| (slope(i), i))
            .fold((tolerance, None), |best, (s, i)| if s > best.0 { (s, Some(i)) } else { best });
        let (_, Some(best)) = best else { break };
        passive.push(best);
        loop {
            let z = cholesky(gram, &passive, h);
            if z.iter().all(|&z| z > 0.0) {
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
            passive.retain(|&i| {
                let stays = x[i] > 1e-14;
                if !stays {
                    x[i] = 0.0;
                }
                stays
            });
        }
    }
    x
}

fn cholesky(gram: &Gram, passive: &[usize], h: &[f64]) -> Vec<f64> {
    let p = passive.len();
    let mut l = vec![0.0; p * p];
    let mut z = vec![0.0; p];
    for i in 0..p {
        for j in 0..=i {
            let s: f64 = (0..j).map(|c| l[i * p + c] * l[j * p + c]).sum();
            let v = gram.row(passive[i])[passive[j]] - s;
            l[i * p + j] = if i == j { v.max(1e-12).sqrt() } else { v / l[j * p + j] };
        }
        let s: f64 = (0..i).map(|c| l[i * p + c] * z[c]).sum();
        z[i] = (h[passive[i]] - s) / l[i * p + i];
    }
    for i in (0..p).rev() {
        let s: f64 = (i + 1..p).map(|c| l[c * p + i] * z[c]).sum();
        z[i] = (z[i] - s) / l[i * p + i];
    }
    z
}

fn main() {
    divan::main();
}
