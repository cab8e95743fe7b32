//! The mixture of stacks that makes a colour and differs least in lightness from dot to dot.
//!
//! Problem: most colours are mixtures in many ways. Black and paper are the cheapest for a shadow, and the
//! grainiest.
//! Method: all mixtures of a colour have one mean luminance, so their variance is least where the mean of
//! its square is: a linear programme. Stacks are points in red, green and blue with the square of their
//! luminance as a height. The lower side of their convex hull divides the colours into tetrahedra; a colour
//! is the mixture of the corners of its own. What is about grey is black and paper as far as it can be,
//! whose hue no error of the printer changes: the tetrahedra about the line between these two
//! ([`Even::about_grey`]). Stacks that span no volume make the nearest mixture of at most three.
//! Cost: n⁵ / 24 for n stacks, 2 ms for sixteen; a microsecond a colour. Limits: a colour on or outside the
//! hull takes the nearest tetrahedron's mixture.

use crate::colour::intent::{Light, cross, dot, luminance, minus};
use maths::Maths;

/// Corners that lie in a plane up to this make no tetrahedron, and heights that differ by it are equal.
const NEAR: f64 = 1e-9;

/// A tetrahedron of four stacks, and what of a colour, after the first corner is taken off, is the share of
/// the others.
struct Tetrahedron {
    corners: [usize; 4],
    first: Light,
    shares: [Light; 3],
}

/// The tetrahedra of some stacks.
pub(crate) struct Even {
    points: Vec<Light>,
    all: Vec<Tetrahedron>,
    /// Those that have both black and paper.
    grey: Vec<Tetrahedron>,
}

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
    /// Of stacks with these colours, between black and paper in linear light, of which these two are black
    /// and paper.
    pub fn new(points: &[Light], (black, paper): (usize, usize)) -> Even {
        let height = |p: Light| luminance(p).squared();
        let n = points.len();
        let mut all = Vec::new();
        for a in 0..n {
            for b in a + 1..n {
                for c in b + 1..n {
                    all.extend((c + 1..n).filter_map(|d| Tetrahedron::new([a, b, c, d], points)).filter(
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
        let others = || (0..n).filter(|&other| other != black && other != paper);
        let pairs = others().flat_map(|a| others().filter(move |&b| b > a).map(move |b| (a, b)));
        let grey = pairs.filter_map(|(a, b)| Tetrahedron::new([black, paper, a, b], points));
        let grey = grey.filter(|_| black != paper).collect();
        Even { points: points.to_vec(), all, grey }
    }

    /// The shares of the stacks in a colour.
    pub fn shares(&self, colour: Light) -> [(usize, f64); 4] {
        let least = |shares: &[f64; 4]| shares.iter().fold(f64::INFINITY, |least, &share| least.min(share));
        let all = self.all.iter().map(|t| (t.corners, t.shares(colour)));
        let best = all.max_by(|a, b| least(&a.1).total_cmp(&least(&b.1)));
        best.map_or_else(|| self.flat(colour), normal)
    }

    /// The same of a colour that is about grey: with as little of other stacks than black and paper as
    /// there can be.
    pub fn about_grey(&self, colour: Light) -> [(usize, f64); 4] {
        let all = self.grey.iter().map(|t| (t.corners, t.shares(colour)));
        let inside = all.filter(|(_, shares)| shares.iter().all(|share| *share >= -NEAR));
        let best = inside.min_by(|a, b| (a.1[2] + a.1[3]).total_cmp(&(b.1[2] + b.1[3])));
        best.map_or_else(|| self.shares(colour), normal)
    }

    /// The nearest mixture of at most three stacks.
    fn flat(&self, colour: Light) -> [(usize, f64); 4] {
        let n = self.points.len();
        let mut best = (f64::INFINITY, [(0, 1.0), (0, 0.0), (0, 0.0), (0, 0.0)]);
        for (a, b, c) in (0..n).flat_map(|a| (a..n).flat_map(move |b| (b..n).map(move |c| (a, b, c)))) {
            let [u, v, w] = [self.points[b], self.points[c], colour].map(|p| minus(p, self.points[a]));
            let (uu, uv, vv, uw, vw) = (dot(u, u), dot(u, v), dot(v, v), dot(u, w), dot(v, w));
            let (volume, edge) = (uu * vv - uv * uv, uu.max(vv));
            // A point, a line or a triangle.
            let (p, q) = match () {
                () if volume > NEAR => ((uw * vv - vw * uv) / volume, (vw * uu - uw * uv) / volume),
                () if edge > NEAR && uu >= vv => (uw / uu, 0.0),
                () if edge > NEAR => (0.0, vw / vv),
                () => (0.0, 0.0),
            };
            let shares = [1.0 - p - q, p, q];
            if shares.iter().all(|share| *share >= 0.0) {
                let off: Light = std::array::from_fn(|i| w[i] - p * u[i] - q * v[i]);
                if dot(off, off) < best.0 - NEAR {
                    best = (dot(off, off), [(a, shares[0]), (b, p), (c, q), (a, 0.0)]);
                }
            }
        }
        best.1
    }
}

/// Corners with their shares, none of which is less than none.
fn normal((corners, shares): ([usize; 4], [f64; 4])) -> [(usize, f64); 4] {
    let shares = shares.map(|share| share.max(0.0));
    let sum: f64 = shares.iter().sum();
    std::array::from_fn(|n| (corners[n], shares[n] / sum))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn what_is_about_grey_is_exact_and_has_little_of_other_stacks(level in 0.1f64..0.9, off in prop::array::uniform3(-0.02f64..0.02)) {
            let points = [
                [0.0; 3], [1.0; 3], [0.0, 0.33, 0.75], [0.78, 0.0, 0.19], [0.95, 0.83, 0.0], [0.0, 0.0, 0.14], [0.0, 0.28, 0.0], [0.78, 0.0, 0.0],
            ];
            let colour: Light = off.map(|off| level + off);
            let found = Even::new(&points, (0, 1)).about_grey(colour);
            for c in 0..3 {
                let mixed: f64 = found.iter().map(|&(q, share)| share * points[q][c]).sum();
                prop_assert!((mixed - colour[c]).abs() < 1e-9);
            }
            let others: f64 = found.iter().filter(|(q, _)| *q > 1).map(|(_, share)| share).sum();
            prop_assert!(others < 0.25, "{found:?}");
        }

        /// On a line and in a plane, as with few inks: the nearest point of it.
        #[test]
        fn stacks_without_a_volume_make_the_nearest_mixture(colour in prop::array::uniform3(0.0f64..1.0), tried in prop::array::uniform3(0.0f64..1.0)) {
            for points in [&[[1.0; 3], [0.0; 3]][..], &[[1.0; 3], [0.0; 3], [0.0, 0.3, 0.8]], &[[1.0; 3]]] {
                let off = |shares: &[(usize, f64)]| -> f64 {
                    (0..3).map(|c| (shares.iter().map(|&(q, s)| s * points[q][c]).sum::<f64>() - colour[c]).powi(2)).sum()
                };
                let found = Even::new(points, (points.len() - 1, 0)).shares(colour);
                let sum: f64 = tried.iter().take(points.len()).sum::<f64>() + 1e-9;
                let other: Vec<(usize, f64)> =
                    (0..points.len()).map(|q| (q, (tried[q] + 1e-9 / points.len() as f64) / sum)).collect();
                prop_assert!(off(&found) <= off(&other) + 1e-6);
            }
        }

        /// No other mixture of four stacks with that colour has less variance: all of them are tried.
        #[test]
        fn no_mixture_of_a_colour_is_more_even(
            points in prop::collection::vec(prop::array::uniform3(0.0f64..1.0), 5..8),
            weights in prop::collection::vec(0.01f64..1.0, 8),
        ) {
            let sum: f64 = weights.iter().take(points.len()).sum();
            let colour: Light =
                std::array::from_fn(|c| points.iter().zip(&weights).map(|(p, w)| p[c] * w / sum).sum());
            let found = Even::new(&points, (0, 1)).shares(colour);
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
