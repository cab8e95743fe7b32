//! How far a photograph is from the target and from the prediction, and where that comes from.
//!
//! Method: four pictures under the same light follow each other: the document, its mixture of stacks, the printed dots, the photograph.
//! The error of each step is the root mean square difference over squares of a millimetre and three channels, relative to the root mean
//! square of the first picture. The last step has two parts: what one factor for each stack and channel explains
//! is inks that differ from the library at these angles, and the remainder is everything else: registration, lamp, noise.
//! Factors are found by least squares over the squares, held to 1 where a stack covers little.
//! Limits: errors of steps may cancel, so they do not add up to the whole; a lamp in the wrong place looks like inks.

use inks::Curve;
use serde::Serialize;

use super::flat::Window;
use crate::geometry::{Vector, along, cross, dot, unit};
use crate::linear::Cholesky;

/// How strongly factors are held to 1, relative to a stack that covers everything.
const HELD: f64 = 1e-4;
/// The least part of the squares' light that a stack must have for its factor to be told.
const TOLD: f64 = 0.01;

/// Errors as shares: 0.1 is 10 %.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Errors {
    /// Photograph against document; against the prediction where there is no document.
    pub total: f64,
    /// Mixture of stacks against document.
    pub gamut: Option<f64>,
    /// Dots against mixture of stacks.
    pub halftone: Option<f64>,
    /// Photograph against the predicted print.
    pub print: f64,
    /// The part of that which brighter or darker stacks explain.
    pub inks: f64,
    /// The remainder.
    pub rest: f64,
}

/// How much brighter a stack is than the library says, at the angles of a photograph.
#[derive(Clone, Debug, Serialize)]
pub struct Factor {
    /// The stack.
    pub stack: String,
    /// Share of the compared dots.
    pub share: f64,
    /// Photographed over predicted, for each channel.
    pub factor: [f64; 3],
}

/// An eye and a lamp over a sheet in the plane z = 0, in mm.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lighting {
    pub(crate) eye: Vector,
    pub(crate) lamp: Vector,
    /// Where a surface that faces the lamp has irradiance 1.
    pub(crate) middle: [f64; 2],
}

impl Lighting {
    /// Angles in radians at a place: of incidence, to the eye, and between normal and half vector; and the irradiance there.
    pub(crate) fn at(&self, [x, y]: [f64; 2]) -> ([f64; 3], f64) {
        let p = [x, y, 0.0];
        let to = along(self.lamp, -1.0, p);
        let (l, v) = (unit(to), unit(along(self.eye, -1.0, p)));
        let h = unit(along(l, 1.0, v));
        let from = |v: Vector| {
            let side = cross([0.0, 0.0, 1.0], v);
            dot(side, side).sqrt().atan2(v[2])
        };
        let middle = along(self.lamp, -1.0, [self.middle[0], self.middle[1], 0.0]);
        let fall = dot(middle, middle) / dot(to, to);
        ([from(l), from(v), from(h)], (l[2] * fall).max(0.0))
    }
}

/// Means over squares.
pub(crate) type Squares = Vec<[f64; 3]>;

/// The pictures of one photograph, square by square.
pub(crate) struct Steps<'a> {
    pub(crate) document: Option<(&'a Squares, &'a Squares)>,
    pub(crate) print: &'a Squares,
    pub(crate) photo: &'a [Option<[f64; 3]>],
}

/// What stacks cover: shares of squares, as many values a square as there are stacks, and each stack's name and curve.
pub(crate) struct Cover<'a> {
    pub(crate) shares: &'a [f32],
    pub(crate) stacks: &'a [(String, Curve)],
}

/// Sums of squares of the known values, and their number.
fn rms(known: &[usize], value: impl Fn(usize, usize) -> f64) -> f64 {
    let sum: f64 =
        known.iter().flat_map(|&i| (0..3).map(move |c| (i, c))).map(|(i, c)| value(i, c).powi(2)).sum();
    (sum / (3 * known.len().max(1)) as f64).sqrt()
}

/// The errors of a photograph and the factors of its stacks. `None` if no square is known.
pub(crate) fn errors(
    steps: &Steps<'_>,
    cover: &Cover<'_>,
    window: &Window,
    lighting: &Lighting,
) -> Option<(Errors, Vec<Factor>)> {
    let seen: Vec<(usize, [f64; 3])> =
        steps.photo.iter().enumerate().filter_map(|(i, photo)| photo.map(|rgb| (i, rgb))).collect();
    let known: Vec<usize> = seen.iter().map(|(i, _)| *i).collect();
    if known.is_empty() {
        return None;
    }
    let photo = |i: usize, c: usize| steps.photo[i].map_or(0.0, |rgb| rgb[c]);
    let first = steps.document.map_or(steps.print, |(document, _)| document);
    let whole = rms(&known, |i, c| first[i][c]).max(1e-30);
    let between = |a: &Squares, b: &Squares| rms(&known, |i, c| a[i][c] - b[i][c]) / whole;

    let (explained, factors) = fitted(steps, cover, window, lighting, &seen);
    let at: std::collections::HashMap<usize, [f64; 3]> = known.iter().copied().zip(explained).collect();
    let inks = |i: usize, c: usize| at.get(&i).map_or(0.0, |rgb| rgb[c]);
    let print = |i: usize, c: usize| photo(i, c) - steps.print[i][c];
    let errors = Errors {
        total: rms(&known, |i, c| photo(i, c) - first[i][c]) / whole,
        gamut: steps.document.map(|(document, mapped)| between(document, mapped)),
        halftone: steps.document.map(|(_, mapped)| between(mapped, steps.print)),
        print: rms(&known, print) / whole,
        inks: rms(&known, inks) / whole,
        rest: rms(&known, |i, c| print(i, c) - inks(i, c)) / whole,
    };
    Some((errors, factors))
}

/// For each known square the light that the factors add to the prediction; and the factors.
fn fitted(
    steps: &Steps<'_>,
    cover: &Cover<'_>,
    window: &Window,
    lighting: &Lighting,
    seen: &[(usize, [f64; 3])],
) -> (Vec<[f64; 3]>, Vec<Factor>) {
    let n = cover.stacks.len();
    let shares = |i: usize| &cover.shares[i * n..][..n];
    let mut added = vec![[0.0; 3]; seen.len()];
    let mut factors: Vec<Factor> = cover
        .stacks
        .iter()
        .enumerate()
        .map(|(s, (name, _))| {
            let share = seen.iter().map(|(i, _)| f64::from(shares(*i)[s])).sum::<f64>() / seen.len() as f64;
            Factor { stack: name.clone(), share, factor: [1.0; 3] }
        })
        .collect();
    // Light of each stack on each square, all channels.
    let light: Vec<Vec<[f64; 3]>> = seen
        .iter()
        .map(|(i, _)| {
            let ([_, _, theta], irradiance) = lighting.at(window.square(*i));
            cover
                .stacks
                .iter()
                .zip(shares(*i))
                .map(|((_, curve), &share)| {
                    if share == 0.0 {
                        [0.0; 3]
                    } else {
                        curve.at(theta).map(|f| f * irradiance * f64::from(share))
                    }
                })
                .collect()
        })
        .collect();
    for c in 0..3 {
        let (mut normal, mut right) = (vec![0.0; n * n], vec![0.0; n]);
        let mut whole = 0.0;
        for ((i, rgb), light) in seen.iter().zip(&light) {
            let off = rgb[c] - steps.print[*i][c];
            whole += steps.print[*i][c].powi(2);
            for (a, from) in light.iter().enumerate().filter(|(_, l)| l[c] != 0.0) {
                right[a] += from[c] * off;
                for (b, to) in light.iter().enumerate() {
                    normal[a * n + b] += from[c] * to[c];
                }
            }
        }
        for s in 0..n {
            normal[s * n + s] += HELD * whole + 1e-30;
        }
        let Some(by) = Cholesky::new(&normal, n).map(|factors| factors.solve(&right)) else { continue };
        for (added, light) in added.iter_mut().zip(&light) {
            added[c] = light.iter().zip(&by).map(|(l, by)| l[c] * by).sum();
        }
        for (factor, by) in factors.iter_mut().zip(by) {
            factor.factor[c] = 1.0 + by;
        }
    }
    factors.retain(|factor| factor.share >= TOLD);
    factors.sort_by(|a, b| b.share.total_cmp(&a.share));
    (added, factors)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two stacks in stripes, one of them brighter than its curve by a third: all of the error is inks', and the
    /// factor is found.
    #[test]
    fn a_brighter_ink_is_told_from_noise() {
        let window = Window::new([0.0, 0.0], [20.0, 20.0], 2.0);
        let lighting = Lighting { eye: [0.0, 0.0, 500.0], lamp: [200.0, 100.0, 500.0], middle: [0.0, 0.0] };
        let curve = |v: f64| Curve::sampled(&[0.0, 0.5, 1.5], |t| [v * (1.0 + t), v, 0.5 * v]);
        let stacks = [("C".to_string(), curve(0.1)), ("MS".to_string(), curve(0.3))];
        let share = |i: usize| if i % 20 < 10 { [1.0f32, 0.0] } else { [0.25, 0.75] };
        let shares: Vec<f32> = (0..400).flat_map(share).collect();
        let light = |i: usize, factor: [f64; 2]| -> [f64; 3] {
            let ([_, _, theta], e) = lighting.at(window.square(i));
            let s = share(i);
            std::array::from_fn(|c| {
                (0..2).map(|k| factor[k] * f64::from(s[k]) * stacks[k].1.at(theta)[c] * e).sum()
            })
        };
        let print: Squares = (0..400).map(|i| light(i, [1.0, 1.0])).collect();
        let mut photo: Vec<Option<[f64; 3]>> = (0..400).map(|i| Some(light(i, [1.0, 4.0 / 3.0]))).collect();
        photo[7] = None;
        let steps = Steps { document: None, print: &print, photo: &photo };
        let cover = Cover { shares: &shares, stacks: &stacks };
        let (found, factors) = errors(&steps, &cover, &window, &lighting).unwrap();
        assert_eq!(factors[0].stack, "C");
        for (factor, expected) in factors.iter().zip([1.0, 4.0 / 3.0]) {
            assert!(factor.factor.iter().all(|f| (f - expected).abs() < 2e-3), "{factors:?}");
        }
        assert!(
            found.rest < 0.01 * found.print && (found.inks / found.print - 1.0).abs() < 0.01,
            "{found:?}"
        );
        // By the closed form: a third of the brighter stack's light.
        let (mut up, mut down) = (0.0, 0.0);
        for i in (0..400).filter(|i| *i != 7) {
            for c in 0..3 {
                up += (light(i, [0.0, 1.0])[c] / 3.0).powi(2);
                down += print[i][c].powi(2);
            }
        }
        assert!((found.print / (up / down).sqrt() - 1.0).abs() < 1e-9, "{found:?}");
        // Noise is no ink's.
        let noisy: Vec<Option<[f64; 3]>> = (0..400)
            .map(|i| {
                Some(print[i].map(|v| {
                    v * (1.0
                        + 0.1 * (f64::from((i as u32).wrapping_mul(2_654_435_761) >> 16) / 32_768.0 - 1.0))
                }))
            })
            .collect();
        let steps = Steps { document: None, print: &print, photo: &noisy };
        let (found, _) = errors(&steps, &cover, &window, &lighting).unwrap();
        assert!(found.inks < 0.2 * found.rest, "{found:?}");
        let none = vec![None; 400];
        assert!(
            errors(&Steps { document: None, print: &print, photo: &none }, &cover, &window, &lighting)
                .is_none()
        );
    }

    #[test]
    fn angles_are_those_of_the_triangle() {
        let lighting = Lighting { eye: [0.0, 0.0, 100.0], lamp: [100.0, 0.0, 100.0], middle: [0.0, 0.0] };
        let ([i, o, h], e) = lighting.at([0.0, 0.0]);
        let degrees = |a: f64| a.to_degrees();
        assert!((degrees(i) - 45.0).abs() < 1e-9 && degrees(o) < 1e-9 && (degrees(h) - 22.5).abs() < 1e-9);
        assert!((e - 0.5f64.sqrt()).abs() < 1e-12);
        assert!((lighting.at([100.0, 0.0]).1 - 2.0).abs() < 1e-12);
    }
}
