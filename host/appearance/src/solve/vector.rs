//! Inner products and updates of short vectors, in a fixed order.
//!
//! Eight running sums are added pairwise at the end. Every vector unit can use them, and the result is the same bit for bit,
//! because the order of additions does not depend on the width of the vectors.

/// The inner product of two vectors, over the shorter length.
#[inline(always)]
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

/// The smallest element, infinity if there is none; elements that are not numbers do not count.
#[inline(always)]
pub fn least(a: &[f64]) -> f64 {
    let smaller = |a: f64, b: f64| if a < b { a } else { b };
    let (chunks, rest) = a.as_chunks::<8>();
    let mut lanes = [f64::INFINITY; 8];
    for chunk in chunks {
        for lane in 0..8 {
            lanes[lane] = smaller(chunk[lane], lanes[lane]);
        }
    }
    rest.iter().chain(&lanes).fold(f64::INFINITY, |least, &a| smaller(a, least))
}

/// The inner product of vectors of about a dozen elements, where a plain loop is faster than eight sums.
#[inline(always)]
pub fn dot_short(a: &[f64], b: &[f64]) -> f64 {
    let mut sum = 0.0;
    for (a, b) in a.iter().zip(b) {
        sum += a * b;
    }
    sum
}

/// `y += s x`, element by element.
#[inline(always)]
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
            assert_eq!(dot_short(&a, &b), plain);
        }
    }

    #[test]
    fn the_smallest_element_of_every_length_is_found() {
        for n in 1..40 {
            for at in 0..n {
                let a: Vec<f64> = (0..n).map(|i| if i == at { -1.0 } else { f64::from(i) }).collect();
                assert_eq!(least(&a), -1.0);
            }
        }
    }
}
