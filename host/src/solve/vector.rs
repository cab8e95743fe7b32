//! Inner products and updates of short vectors, in a fixed order.
//!
//! Eight running sums, added pairwise at the end: any vector unit can use them, and the result is the same bit
//! for bit whichever does, because nothing depends on the machine's width.

/// The inner product of two vectors (the shorter length counts).
#[inline]
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len().min(b.len());
    let (a, a_rest) = a[..n].as_chunks::<8>();
    let (b, b_rest) = b[..n].as_chunks::<8>();
    let mut sums = [0.0; 8];
    for (a, b) in a.iter().zip(b) {
        for lane in 0..8 {
            sums[lane] += a[lane] * b[lane];
        }
    }
    let mut rest = 0.0;
    for (a, b) in a_rest.iter().zip(b_rest) {
        rest += a * b;
    }
    let [a, b, c, d, e, f, g, h] = sums;
    ((a + e) + (b + f)) + ((c + g) + (d + h)) + rest
}

/// Inner products of four vectors with one; all as long as `x` or longer. Loading `x` once for four rows is what
/// prices of stacks cost least by.
#[inline]
pub fn dot4(rows: [&[f64]; 4], x: &[f64]) -> [f64; 4] {
    let n = x.len();
    let (x, x_rest) = x.as_chunks::<4>();
    let [(a, a_rest), (b, b_rest), (c, c_rest), (d, d_rest)] = rows.map(|row| row[..n].as_chunks::<4>());
    let mut sums = [[0.0; 4]; 4];
    for ((((a, b), c), d), x) in a.iter().zip(b).zip(c).zip(d).zip(x) {
        for (sums, row) in sums.iter_mut().zip([a, b, c, d]) {
            for lane in 0..4 {
                sums[lane] += row[lane] * x[lane];
            }
        }
    }
    let mut out = sums.map(|[a, b, c, d]| (a + c) + (b + d));
    for (out, row) in out.iter_mut().zip([a_rest, b_rest, c_rest, d_rest]) {
        for (a, x) in row.iter().zip(x_rest) {
            *out += a * x;
        }
    }
    out
}

/// `y += s x`, element by element.
#[inline]
pub fn add_scaled(y: &mut [f64], s: f64, x: &[f64]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y += s * x;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inner_products_of_every_length_are_the_plain_sum() {
        for n in 0..40 {
            let a: Vec<f64> = (0..n).map(|i| f64::from(i) + 1.0).collect();
            let b: Vec<f64> = (0..n).map(|i| 2.0 * f64::from(i) - 3.0).collect();
            let plain: f64 = a.iter().zip(&b).map(|(a, b)| a * b).sum();
            assert_eq!(dot(&a, &b), plain, "whole numbers add without rounding");
            let twice: Vec<f64> = a.iter().map(|a| 2.0 * a).collect();
            let squares = dot(&b, &b);
            assert_eq!(dot4([&a, &twice, &b, &a], &b), [plain, 2.0 * plain, squares, plain]);
        }
    }
}
