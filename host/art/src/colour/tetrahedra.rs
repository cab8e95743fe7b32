//! The mixture of stacks that makes a colour and differs least in lightness from dot to dot.
//!
//! Problem: most colours are mixtures in many ways. Black and paper are the cheapest for a shadow, and the grainiest.
//! Method: all mixtures of a colour have one mean luminance, so their variance is least where the mean of its square is: a linear
//! programme. Stacks are points in red, green and blue with the square of their luminance as a height. The lower side of
//! their convex hull divides the colours into tetrahedra; a colour is the mixture of the corners of its own.
//! Cost: n⁵ / 24 for n stacks, 2 ms for sixteen; a microsecond a colour. Limits: a colour on or outside the hull takes the nearest tetrahedron's
//! mixture.

use crate::colour::intent::{Light, cross, dot, luminance, minus};
use maths::Maths;

/// Corners that lie in a plane up to this make no tetrahedron, and heights that differ by it are equal.
const NEAR: f64 = 1e-9;

/// A tetrahedron of four stacks, and what of a colour, after the first corner is taken off, is the share of the others.
struct Tetrahedron {
    corners: [usize; 4],
    first: Light,
    shares: [Light; 3],
}

/// The tetrahedra of some stacks.
pub(crate) struct Even(Vec<Tetrahedron>);

impl Tetrahedron {
    fn new(corners: [usize; 4], points: &[Light]) -> Option<Tetrahedron> {
        let first = points[corners[0]];
        let [a, b, c] = [1, 2, 3].map(|n| minus(points[corners[n]], first));
        let volume = dot(a, cross(b, c));
        let shares = [cross(b, c), cross(c, a), cross(a, b)].map(|v| v.map(|v| v / volume));
        (volume.abs() > NEAR).then_some(Tetrahedron { corners, first, shares })
    }

    /// The shares of the corners; some are negative outside.
    fn shares(&self, colour: Light) -> [f64; 4] {
        let off = minus(colour, self.first);
        let [a, b, c] = self.shares.map(|share| dot(share, off));
        [1.0 - a - b - c, a, b, c]
    }
}

impl Even {
    /// Of stacks with these colours, between black and paper in linear light.
    pub fn new(points: &[Light]) -> Even {
        let height = |p: Light| luminance(p).squared();
        let n = points.len();
        let mut found = Vec::new();
        for a in 0..n {
            for b in a + 1..n {
                for c in b + 1..n {
                    found.extend((c + 1..n).filter_map(|d| Tetrahedron::new([a, b, c, d], points)).filter(
                        |t| {
                            let corners = t.corners.map(|corner| height(points[corner]));
                            points.iter().all(|&p| {
                                let below: f64 = t.shares(p).iter().zip(corners).map(|(s, h)| s * h).sum();
                                below <= height(p) + NEAR
                            })
                        },
                    ));
                }
            }
        }
        Even(found)
    }

    /// The shares of the stacks in a colour; `None` if the stacks span no volume.
    pub fn shares(&self, colour: Light) -> Option<[(usize, f64); 4]> {
        let least = |shares: &[f64; 4]| shares.iter().fold(f64::INFINITY, |least, &share| least.min(share));
        let all = self.0.iter().map(|t| (t.corners, t.shares(colour)));
        let (corners, shares) = all.max_by(|a, b| least(&a.1).total_cmp(&least(&b.1)))?;
        let shares = shares.map(|share| share.max(0.0));
        let sum: f64 = shares.iter().sum();
        Some(std::array::from_fn(|n| (corners[n], shares[n] / sum)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// No other mixture of four stacks with that colour has less variance: all of them are tried.
        #[test]
        fn no_mixture_of_a_colour_is_more_even(
            points in prop::collection::vec(prop::array::uniform3(0.0f64..1.0), 5..8),
            weights in prop::collection::vec(0.01f64..1.0, 8),
        ) {
            let sum: f64 = weights.iter().take(points.len()).sum();
            let colour: Light =
                std::array::from_fn(|c| points.iter().zip(&weights).map(|(p, w)| p[c] * w / sum).sum());
            let found = Even::new(&points).shares(colour).unwrap();
            for c in 0..3 {
                let mixed: f64 = found.iter().map(|&(q, share)| share * points[q][c]).sum();
                prop_assert!((mixed - colour[c]).abs() < 1e-6);
            }
            let squares = |shares: &[(usize, f64); 4]| -> f64 {
                shares.iter().map(|&(q, share)| share * luminance(points[q]).powi(2)).sum()
            };
            let n = points.len();
            for at in 0..n.pow(4) {
                let corners = [at % n, at / n % n, at / n / n % n, at / n / n / n];
                let Some(t) = Tetrahedron::new(corners, &points) else { continue };
                let shares = t.shares(colour);
                if shares.iter().all(|&share| share >= 0.0) {
                    let other = std::array::from_fn(|n| (corners[n], shares[n]));
                    prop_assert!(squares(&found) <= squares(&other) + 1e-6);
                }
            }
        }
    }
}
