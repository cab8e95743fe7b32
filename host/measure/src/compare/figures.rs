//! How far a photograph is from the target and from the prediction, and where that comes from.
//!
//! Method: four pictures under the same light follow each other: the document, its mixture of stacks, the printed dots, the photograph.
//! The error of each step is the root mean square difference over spots of a millimetre and three channels, relative to the root mean
//! square of the first picture. The last step has two parts: what one factor for each stack and channel explains
//! is inks that differ from the library at these angles, and the remainder is everything else: registration, lamp, noise.
//! Passes that lie beside their place ([`super::passes`]) are in the cover that factors are of, so what they do is in the remainder.
//! Factors are found by least squares over the spots; none is negative. Their standard errors come from what remains, which neither needs to be alike
//! everywhere nor independent between neighbours (White 1980; Conley 1999, with weights that fall to 0 at [`NEAR`] spots), and from how
//! far the photograph's scale is known.
//! Limits: errors of steps may cancel, so they do not add up to the whole; a lamp in the wrong place looks like inks.

use inks::Curve;
use rayon::prelude::*;
use serde::Serialize;

use super::flat::ComparedArea;
use crate::geometry::scene::{Vector, along, cross, dot, unit};
use crate::linalg::Cholesky;

/// What makes factors unique where stacks always come together, relative to a stack that covers everything:
/// far below what photographs tell, so that it decides nothing else.
const HELD: f64 = 1e-8;
/// The least share of the dots that a stack must have for its factor to be told.
const TOLD: f64 = 0.01;
/// Spots so far apart do not know of each other.
const NEAR: usize = 4;
/// How many spots know as much as one that does not overlap others.
const OVERLAP: f64 = 2.25;
/// A factor differs from 1 if it does by so many standard errors, for a comparison has hundreds of factors, ...
const SURE: f64 = 4.0;
/// ... and by more than this: a hundredth of a millimetre of registration, which is alike along a whole edge, makes a few thousandths.
const SLIGHT: f64 = 0.01;
/// The same where a pass lay beside its place: it is found to some micrometres, and stacks beside its edges are off by up to 2 %.
const SLIGHT_PLACED: f64 = 0.03;

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
    /// Its standard error.
    pub standard_error: [f64; 3],
    /// Whether it differs from 1 by more than four standard errors and 0.01 in any channel.
    pub differs: bool,
}

/// The factors from a photograph's values to radiance.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scale {
    pub(crate) factor: [f64; 3],
    /// Their relative standard errors.
    pub(crate) error: [f64; 3],
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

/// Means over spots.
pub(crate) type Spots = Vec<[f64; 3]>;

/// The pictures of one photograph, spot by spot.
pub(crate) struct Steps<'a> {
    pub(crate) document: Option<&'a [Spots; 2]>,
    pub(crate) print: &'a Spots,
    pub(crate) photo: &'a [Option<[f64; 3]>],
    /// How many of the stacks the job has, if a pass lay beside its place. The others are slivers that this pass makes along edges, as wide as
    /// the blur of a lens; they are solved for, and not judged.
    pub(crate) placed: Option<usize>,
}

/// What covers the spots: for each spot the share of every curve.
pub(crate) struct Cover {
    pub(crate) shares: Vec<f32>,
    pub(crate) curves: Vec<Curve>,
    /// Of stacks.
    pub(crate) names: Vec<String>,
}

/// The light that each curve of a cover sends from each spot to the eye.
pub(crate) struct Lights<'a> {
    cover: &'a Cover,
    light: Vec<[f64; 3]>,
}

impl Cover {
    /// Lights the spots.
    pub(crate) fn lights(&self, window: &ComparedArea, lighting: &Lighting) -> Lights<'_> {
        let n = self.curves.len();
        let mut light = vec![[0.0; 3]; self.shares.len()];
        light.par_chunks_exact_mut(n).zip(self.shares.par_chunks_exact(n)).enumerate().for_each(
            |(i, (light, shares))| {
                let ([_, _, theta], irradiance) = lighting.at(window.spot(i));
                for ((light, &share), curve) in light.iter_mut().zip(shares).zip(&self.curves) {
                    if share != 0.0 {
                        *light = curve.at(theta).map(|f| f * irradiance * f64::from(share));
                    }
                }
            },
        );
        Lights { cover: self, light }
    }
}

impl Lights<'_> {
    /// The curves' lights of a spot.
    fn at_spot(&self, spot: usize) -> &[[f64; 3]] {
        let n = self.cover.curves.len();
        &self.light[spot * n..][..n]
    }

    /// The light of each spot.
    pub(crate) fn sums(&self) -> Spots {
        let sum = |light: &[[f64; 3]]| std::array::from_fn(|c| light.iter().map(|rgb| rgb[c]).sum());
        self.light.chunks_exact(self.cover.curves.len()).map(sum).collect()
    }

    /// The share of a curve in these spots.
    fn share(&self, curve: usize, spots: &[usize]) -> f64 {
        let n = self.cover.curves.len();
        let sum: f64 = spots.iter().map(|spot| f64::from(self.cover.shares[spot * n + curve])).sum();
        sum / spots.len().max(1) as f64
    }
}

/// Root mean square of the known values.
fn rms(known: &[usize], value: impl Fn(usize, usize) -> f64) -> f64 {
    let sum: f64 =
        known.iter().flat_map(|&i| (0..3).map(move |c| (i, c))).map(|(i, c)| value(i, c).powi(2)).sum();
    (sum / (3 * known.len().max(1)) as f64).sqrt()
}

/// The errors of a photograph and the factors of its stacks as they lie on the sheet. `None` if no spot is known.
pub(crate) fn errors(
    steps: &Steps<'_>,
    lights: &Lights<'_>,
    window: &ComparedArea,
    scale: [f64; 3],
) -> Option<(Errors, Vec<Factor>)> {
    let known: Vec<usize> = (0..steps.photo.len()).filter(|&i| steps.photo[i].is_some()).collect();
    if known.is_empty() {
        return None;
    }
    let photo = |i: usize, c: usize| steps.photo[i].map_or(0.0, |rgb| rgb[c]);
    let first = steps.document.map_or(steps.print, |[document, _]| document);
    let whole = rms(&known, |i, c| first[i][c]).max(1e-30);
    let between = |a: &Spots, b: &Spots| rms(&known, |i, c| a[i][c] - b[i][c]) / whole;

    let (explained, factors) = fitted(steps, lights, window, &known, scale);
    let print = |i: usize, c: usize| photo(i, c) - steps.print[i][c];
    let errors = Errors {
        total: rms(&known, |i, c| photo(i, c) - first[i][c]) / whole,
        gamut: steps.document.map(|[document, mapped]| between(document, mapped)),
        halftone: steps.document.map(|[_, mapped]| between(mapped, steps.print)),
        print: rms(&known, print) / whole,
        inks: rms(&known, |i, c| explained[i][c]) / whole,
        rest: rms(&known, |i, c| print(i, c) - explained[i][c]) / whole,
    };
    Some((errors, factors))
}

/// For each spot the light that the factors add to the prediction; and the factors.
fn fitted(
    steps: &Steps<'_>,
    lights: &Lights<'_>,
    window: &ComparedArea,
    known: &[usize],
    scale: [f64; 3],
) -> (Spots, Vec<Factor>) {
    let names = &lights.cover.names;
    let n = names.len();
    let registered = lights.sums();
    let mut added = vec![[0.0; 3]; steps.photo.len()];
    let mut factors: Vec<Factor> = (0..n)
        .map(|s| Factor {
            stack: names[s].clone(),
            share: lights.share(s, known),
            factor: [1.0; 3],
            standard_error: [0.0; 3],
            differs: false,
        })
        .collect();
    // What is left of the freedom of the spots, for the standard errors.
    let free = known.len() as f64 / OVERLAP;
    let used = factors.iter().filter(|factor| factor.share > 0.0).count() as f64;
    let freedom = free / (free - used).max(1.0);
    let slight = if steps.placed.is_some() { SLIGHT_PLACED } else { SLIGHT };
    for c in 0..3 {
        let (mut normal, mut right) = (vec![0.0; n * n], vec![0.0; n]);
        let mut whole = 0.0;
        let off = |i: usize| steps.photo[i].map_or(0.0, |rgb| rgb[c] - registered[i][c]);
        for &i in known {
            whole += steps.print[i][c].powi(2);
            let light = lights.at_spot(i);
            for (a, from) in light.iter().enumerate().filter(|(_, l)| l[c] != 0.0) {
                right[a] += from[c] * off(i);
                for (b, to) in light.iter().enumerate() {
                    normal[a * n + b] += from[c] * to[c];
                }
            }
        }
        for s in 0..n {
            normal[s * n + s] += HELD * whole + 1e-30;
        }
        let Some(system) = Cholesky::new(&normal, n) else { continue };
        let by = not_negative(&normal, &right, n).unwrap_or_else(|| system.solve(&right));
        let along =
            |i: usize, by: &[f64]| lights.at_spot(i).iter().zip(by).map(|(l, by)| l[c] * by).sum::<f64>();
        for &i in known {
            added[i][c] = along(i, &by);
        }
        for (s, factor) in factors.iter_mut().enumerate() {
            factor.factor[c] = 1.0 + by[s];
            if factor.share < TOLD {
                continue;
            }
            // How much each spot's remainder moves this factor.
            let mut unit = vec![0.0; n];
            unit[s] = 1.0;
            let unit = system.solve(&unit);
            let mut moves = vec![0.0; steps.photo.len()];
            for &i in known {
                moves[i] = along(i, &unit) * (off(i) - added[i][c]);
            }
            let variance = freedom * together(&moves, window.spots());
            let error = (variance + (factor.factor[c] * scale[c]).powi(2)).sqrt();
            factor.standard_error[c] = error;
            let is_judged = steps.placed.is_none_or(|own| s < own);
            factor.differs |= is_judged && (factor.factor[c] - 1.0).abs() > (SURE * error).max(slight);
        }
    }
    factors.retain(|factor| factor.share >= TOLD);
    factors.sort_by(|a, b| b.share.total_cmp(&a.share));
    (added, factors)
}

/// Additions to factors of 1 that leave none below 0, by least squares: what would be is held at 0, and the others are solved again.
fn not_negative(normal: &[f64], right: &[f64], n: usize) -> Option<Vec<f64>> {
    let mut held = vec![false; n];
    loop {
        let (mut matrix, mut vector) = (normal.to_vec(), right.to_vec());
        for s in (0..n).filter(|s| held[*s]) {
            for a in 0..n {
                vector[a] += normal[a * n + s];
                matrix[a * n + s] = 0.0;
                matrix[s * n + a] = 0.0;
            }
            matrix[s * n + s] = 1.0;
        }
        (0..n).filter(|s| held[*s]).for_each(|s| vector[s] = -1.0);
        let by = Cholesky::new(&matrix, n)?.solve(&vector);
        let below: Vec<usize> = (0..n).filter(|s| !held[*s] && by[*s] < -1.0).collect();
        if below.is_empty() {
            return Some(by);
        }
        below.into_iter().for_each(|s| held[s] = true);
    }
}

/// The variance of a sum of values on a grid, those of neighbours not independent.
fn together(values: &[f64], [across, down]: [usize; 2]) -> f64 {
    // Weights that fall along a line on both sides make no variance negative.
    let spread = |values: &[f64], step: usize, side: usize| -> Vec<f64> {
        let at = |i: usize| i / step % side;
        let mean = |i: usize| {
            let mut sum = values[i];
            for k in 1..NEAR {
                let share = 1.0 - k as f64 / NEAR as f64;
                sum += if at(i) >= k { share * values[i - k * step] } else { 0.0 };
                sum += if at(i) + k < side { share * values[i + k * step] } else { 0.0 };
            }
            sum
        };
        (0..values.len()).map(mean).collect()
    };
    let wide = spread(&spread(values, 1, across), across, down);
    values.iter().zip(&wide).map(|(value, around)| value * around).sum::<f64>().max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A print of two stacks in stripes, 20 mm wide.
    struct Print {
        window: ComparedArea,
        lighting: Lighting,
        cover: Cover,
    }

    impl Print {
        fn new() -> Print {
            let curve = |v: f64| Curve::sampled(&[0.0, 0.5, 1.5], |t| [v * (1.0 + t), v, 0.5 * v]);
            let share = |i: usize| if i % 20 < 10 { [1.0f32, 0.0] } else { [0.25, 0.75] };
            Print {
                window: ComparedArea::new([0.0, 0.0], [21.0, 21.0], 2.0),
                lighting: Lighting { eye: [0.0, 0.0, 500.0], lamp: [200.0, 100.0, 500.0], middle: [0.0; 2] },
                cover: Cover {
                    shares: (0..400).flat_map(share).collect(),
                    curves: vec![curve(0.1), curve(0.3)],
                    names: vec!["C".to_string(), "MS".to_string()],
                },
            }
        }

        fn lights(&self) -> Lights<'_> {
            self.cover.lights(&self.window, &self.lighting)
        }

        /// Its light with each stack so much brighter, spot by spot.
        fn seen(&self, factor: [f64; 2]) -> Spots {
            let lights = self.lights();
            let spot =
                |i: usize| std::array::from_fn(|c| (0..2).map(|s| factor[s] * lights.at_spot(i)[s][c]).sum());
            (0..400).map(spot).collect()
        }

        fn errors(&self, photo: &[Option<[f64; 3]>]) -> Option<(Errors, Vec<Factor>)> {
            let (lights, print) = (self.lights(), self.seen([1.0; 2]));
            let steps = Steps { document: None, print: &print, photo, placed: None };
            errors(&steps, &lights, &self.window, [0.0; 3])
        }
    }

    /// Even noise from -1 to 1.
    fn noise(i: usize, seed: usize) -> f64 {
        let mut state = (i as u64 ^ (seed as u64) << 32).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        state = (state ^ state >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        ((state ^ state >> 32) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    /// One stack is brighter than its curve by a third: all of the error is inks', and the factor is found.
    #[test]
    fn a_brighter_ink_is_told_from_noise() {
        let print = Print::new();
        let mut photo: Vec<Option<[f64; 3]>> = print.seen([1.0, 4.0 / 3.0]).into_iter().map(Some).collect();
        photo[7] = None;
        let (found, factors) = print.errors(&photo).unwrap();
        assert_eq!(factors[0].stack, "C");
        for (factor, expected) in factors.iter().zip([1.0, 4.0 / 3.0]) {
            assert!(factor.factor.iter().all(|f| (f - expected).abs() < 1e-6), "{factors:?}");
            assert!(factor.standard_error.iter().all(|e| *e < 1e-6), "{factors:?}");
        }
        assert!(
            found.rest < 0.01 * found.print && (found.inks / found.print - 1.0).abs() < 0.01,
            "{found:?}"
        );
        // By the closed form: a third of the brighter stack's light.
        let (mut up, mut down) = (0.0, 0.0);
        let (brighter, plain) = (print.seen([0.0, 1.0]), print.seen([1.0; 2]));
        for i in (0..400).filter(|i| *i != 7) {
            for c in 0..3 {
                up += (brighter[i][c] / 3.0).powi(2);
                down += plain[i][c].powi(2);
            }
        }
        assert!((found.print / (up / down).sqrt() - 1.0).abs() < 1e-9, "{found:?}");
        // Noise is no ink's.
        let noisy: Vec<_> = plain
            .iter()
            .enumerate()
            .map(|(i, rgb)| Some(rgb.map(|v| v * (1.0 + 0.1 * noise(i, 0)))))
            .collect();
        let (found, factors) = print.errors(&noisy).unwrap();
        assert!(found.inks < 0.2 * found.rest && factors.iter().all(|f| !f.differs), "{found:?} {factors:?}");
        assert!(print.errors(&[None; 400]).is_none());
    }

    /// How factors scatter over photographs that differ in noise alone is what each photograph says of it, with noise that neighbours
    /// share as spots do and that is stronger on one stack.
    #[test]
    fn standard_errors_are_the_scatter_of_factors() {
        let print = Print::new();
        let plain = print.seen([1.0; 2]);
        let photos = 300;
        let (mut square, mut stated) = ([0.0; 2], [0.0; 2]);
        let mut differ = 0;
        for seed in 0..photos {
            let fine = |x: usize, y: usize| noise(1000 * y + x, seed + 1);
            let photo: Vec<_> = (0..400)
                .map(|i| {
                    // A spot's own weights, in quarters: its sides are its neighbours' middles.
                    let weights = [0.25, 0.75, 0.75, 0.25].into_iter().enumerate();
                    let sum: f64 = weights
                        .clone()
                        .flat_map(|(y, down)| weights.clone().map(move |(x, across)| (x, y, down * across)))
                        .map(|(x, y, weight)| weight * fine(2 * (i % 20) + x, 2 * (i / 20) + y))
                        .sum();
                    let strong = if i % 20 < 10 { 0.02 } else { 0.1 };
                    Some(plain[i].map(|v| v * (1.0 + 0.25 * strong * sum)))
                })
                .collect();
            let (_, mut factors) = print.errors(&photo).unwrap();
            factors.sort_by(|a, b| a.stack.cmp(&b.stack));
            for (s, factor) in factors.iter().enumerate() {
                square[s] += (factor.factor[1] - 1.0).powi(2) / photos as f64;
                stated[s] += factor.standard_error[1].powi(2) / photos as f64;
                differ += usize::from(factor.differs);
            }
        }
        for s in 0..2 {
            let ratio = (stated[s] / square[s]).sqrt();
            println!(
                "{}: scatter {:.5}, stated {:.5}",
                print.cover.names[s],
                square[s].sqrt(),
                stated[s].sqrt()
            );
            assert!((0.85..1.15).contains(&ratio), "{}: {ratio}", print.cover.names[s]);
        }
        assert!(differ <= 12, "{differ} of 600 factors seem to differ");
    }

    /// Light that no factor explains asks for less than nothing of one stack: it gets nothing, and the other is what then fits best.
    #[test]
    fn no_factor_is_negative() {
        let print = Print::new();
        let photo: Vec<_> = print.seen([1.0, -0.5]).into_iter().map(Some).collect();
        let (_, mut factors) = print.errors(&photo).unwrap();
        factors.sort_by(|a, b| a.stack.cmp(&b.stack));
        assert!(factors[1].factor.iter().all(|f| f.abs() < 1e-9), "{factors:?}");
        // By the closed form of one unknown.
        let (cyan, seen) = (print.seen([1.0, 0.0]), print.seen([1.0, -0.5]));
        let of = |a: &Spots, b: &Spots| a.iter().zip(b).map(|(a, b)| a[1] * b[1]).sum::<f64>();
        let want = of(&cyan, &seen) / of(&cyan, &cyan);
        assert!((factors[0].factor[1] - want).abs() < 1e-6, "{factors:?} {want}");
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
