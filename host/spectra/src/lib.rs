//! Fourier transforms of planes of numbers.
//!
//! Problem: halftones and pictures are judged and filtered by frequency, in three crates. The transform is generic code that
//! each of them would compile again, a quarter to a third of all its code.
//! Method: functions on planes of plain numbers, compiled here. Rows are transformed, then columns.
//! Cost: n log n for a plane of n numbers. Memory: see each function. Limits: numbers of 32 bits, for a second width doubles the code, which is a
//! tenth of the program; results are right to some 1e-6 of the largest. Sides with small prime factors are fast ([`fast_side`]). Transforms are not scaled: forth and back multiplies by the number of values.

#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests compare with the standard mathematics"))]

use maths::Maths;
use rayon::prelude::*;
use rustfft::FftPlanner;
pub use rustfft::num_complex::Complex;

/// Columns that are transformed together: what lies side by side in memory is read at once.
const STRIP: usize = 32;

/// Transforms a plane in rows of `width`, in place.
pub fn transform(plane: &mut [Complex<f32>], width: usize) {
    let height = plane.len() / width;
    let mut planner = FftPlanner::new();
    planner.plan_fft_forward(width).process(plane);
    let down = planner.plan_fft_forward(height);
    let mut column = vec![Complex::default(); height];
    for x in 0..width {
        for (y, value) in column.iter_mut().enumerate() {
            *value = plane[y * width + x];
        }
        down.process(&mut column);
        for (y, value) in column.iter().enumerate() {
            plane[y * width + x] = *value;
        }
    }
}

/// The power of each frequency of a square of real numbers, down, then across. Memory: 16 bytes a number.
pub fn power(square: &[f64], side: usize) -> Vec<f32> {
    let mut plane: Vec<Complex<f32>> = square.iter().map(|&value| Complex::new(value as f32, 0.0)).collect();
    let fft = FftPlanner::new().plan_fft_forward(side);
    fft.process(&mut plane);
    let mut turned: Vec<Complex<f32>> = (0..plane.len()).map(|i| plane[i % side * side + i / side]).collect();
    fft.process(&mut turned);
    turned.iter().map(Complex::norm_sqr).collect()
}

/// Multiplies each frequency of a plane in rows of `width` by `response`, of cycles in a pixel whatever their direction. All rows
/// after the first `rows` are empty, and mean nothing afterwards. The plane repeats at its borders. It is scaled to keep its values
/// where the response is 1.
pub fn filter(plane: &mut [Complex<f32>], width: usize, rows: usize, response: &(dyn Fn(f64) -> f64 + Sync)) {
    let height = plane.len() / width;
    let mut planner = FftPlanner::new();
    let forward = [planner.plan_fft_forward(width), planner.plan_fft_forward(height)];
    let back = [planner.plan_fft_inverse(width), planner.plan_fft_inverse(height)];
    plane[..rows * width].par_chunks_exact_mut(width).for_each(|row| forward[0].process(row));
    let cycles = |i: usize, side: usize| i.min(side - i) as f64 / side as f64;
    let whole = plane.len() as f64;
    let mut columns = vec![Complex::default(); STRIP * height];
    for left in (0..width).step_by(STRIP) {
        let across = STRIP.min(width - left);
        for (y, row) in plane.chunks_exact(width).enumerate() {
            (0..across).for_each(|x| columns[x * height + y] = row[left + x]);
        }
        columns.par_chunks_exact_mut(height).take(across).enumerate().for_each(|(x, column)| {
            forward[1].process(column);
            let fx = cycles(left + x, width);
            for (y, value) in column.iter_mut().enumerate() {
                *value *= (response(fx.hypotenuse(cycles(y, height))) / whole) as f32;
            }
            back[1].process(column);
        });
        for (y, row) in plane.chunks_exact_mut(width).enumerate() {
            (0..across).for_each(|x| row[left + x] = columns[x * height + y]);
        }
    }
    plane[..rows * width].par_chunks_exact_mut(width).for_each(|row| back[0].process(row));
}

/// The least number from `least` on whose transform is fast: it has no prime factor above 5.
pub fn fast_side(least: usize) -> usize {
    let rest = |mut n: usize| {
        for factor in [2, 3, 5] {
            while n.is_multiple_of(factor) {
                n /= factor;
            }
        }
        n
    };
    (least.max(1)..).find(|&n| rest(n) == 1).unwrap_or(least)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    fn noise(i: usize) -> f64 {
        f64::from((i as u32).wrapping_mul(0x9e37_79b1) >> 8) / f64::from(1 << 24) - 0.5
    }

    /// The sum that defines the transform.
    fn direct(values: &[Complex<f64>], width: usize) -> Vec<Complex<f64>> {
        let height = values.len() / width;
        let at = |u: usize, v: usize| {
            let term = |(i, value): (usize, &Complex<f64>)| {
                let turns = (i % width * u) as f64 / width as f64 + (i / width * v) as f64 / height as f64;
                value * Complex::from_polar(1.0, -TAU * turns)
            };
            values.iter().enumerate().map(term).sum()
        };
        (0..values.len()).map(|i| at(i % width, i / width)).collect()
    }

    #[test]
    fn transforms_are_the_sums_that_define_them() {
        for (width, height) in [(1, 1), (8, 5), (7, 12)] {
            let before: Vec<_> =
                (0..width * height).map(|i| Complex::new(noise(2 * i), noise(2 * i + 1))).collect();
            let mut after: Vec<_> = before.iter().map(|v| Complex::new(v.re as f32, v.im as f32)).collect();
            transform(&mut after, width);
            for (found, expected) in after.iter().zip(direct(&before, width)) {
                let found = Complex::new(f64::from(found.re), f64::from(found.im));
                assert!((found - expected).norm() < 1e-5, "{found}, not {expected}");
            }
        }
        let (side, square): (usize, Vec<f64>) = (12, (0..144).map(noise).collect());
        let expected =
            direct(&square.iter().map(|&value| Complex::new(value, 0.0)).collect::<Vec<_>>(), side);
        for (i, found) in power(&square, side).into_iter().enumerate() {
            let expected = expected[i % side * side + i / side].norm_sqr();
            assert!((f64::from(found) - expected).abs() < 1e-3, "{found}, not {expected}");
        }
    }

    /// A wave keeps its shape and has the response at its frequency; rows that are left out are empty.
    #[test]
    fn a_wave_is_multiplied_by_the_response_at_its_frequency() {
        let (width, height) = (40, 50);
        let wave =
            |i: usize| (TAU * (3.0 * (i % width) as f64 / 40.0 + 10.0 * (i / width) as f64 / 50.0)).cos();
        let mut plane: Vec<Complex<f32>> =
            (0..width * height).map(|i| Complex::new(wave(i) as f32, -0.5 * wave(i) as f32)).collect();
        filter(&mut plane, width, height, &|cycles| 1.0 - cycles);
        let kept = 1.0 - (3.0f64 / 40.0).hypot(10.0 / 50.0);
        for (i, found) in plane.iter().enumerate() {
            let expected = Complex::new(kept * wave(i), -0.5 * kept * wave(i));
            assert!(
                (Complex::new(f64::from(found.re), f64::from(found.im)) - expected).norm() < 1e-5,
                "{found} {expected}"
            );
        }
        let mut plane = vec![Complex::default(); 6 * 8];
        plane[..12].fill(Complex::new(0.25, -1.0));
        filter(&mut plane, 6, 2, &|_| 1.0);
        assert!(plane[..12].iter().all(|value| (value - Complex::new(0.25, -1.0)).norm() < 1e-6));
    }

    #[test]
    fn sides_of_transforms_have_small_factors() {
        assert_eq!([1, 7, 97, 1024, 1025, 8193].map(fast_side), [1, 8, 100, 1024, 1080, 8640]);
    }
}
