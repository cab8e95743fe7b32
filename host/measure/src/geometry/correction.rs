//! Corrects what was measured with a tape: radius and place of the can, tilt, position of the lamp.
//!
//! Problem: half a degree at a foil's peak is 10 % of its reflectance, and a tape is not that exact. Idea: reflectance depends on
//! the half angle alone, so pixels with the same half angle, on both sides of the highlight and at all heights, must agree. Method: separable
//! least squares. For given measures each stack's curve is the best piecewise linear ln f over the square-root grid;
//! Levenberg and Marquardt's method moves the measures, each held to its tape by its tolerance, to where pixels deviate least.
//! The can's outline, where it stands out from the background, adds distances in pixels. Huber's weights leave out dust.
//! Cost: some thousand pixels, ten measures, a hundred evaluations. Limits: a lamp's distance is seen poorly, and matters as
//! little; what the pictures cannot tell stays as the tape says.

use super::scene::{Scene, Unknown};
use crate::camera::merge::Radiance;
use crate::linalg::{Cholesky, spread};

/// Nodes of a stack's curve over the square root of the angle.
const NODES: usize = 48;
/// Standard error of a place on the outline in pixels.
const OUTLINE: f64 = 1.0;
/// What a model of one variable leaves unexplained at least, in ln f.
const LEAST_MISFIT: f64 = 0.004;
/// Neighbouring pixels share errors: paper's waves, the model's. So many of them count as one.
const ALIKE: f64 = 20.0;
/// From this multiple on a second solution is worth its time.
const MORE_ALIKE: f64 = 1.2;
/// Parts of the picture along its longer side whose samples may deviate together.
const PARTS: f64 = 12.0;
/// The cosine of incidence at the outline from which it is bright enough.
const GRAZING: f64 = 0.2;
/// The most steps of the method, so that one that does not settle ends.
const STEPS: usize = 14;

/// A pixel that takes part.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GeometrySample {
    pub(crate) x: f64,
    pub(crate) y: f64,
    pub(crate) light: usize,
    pub(crate) patch: usize,
    /// The first photograph of the series that is not full there.
    pub(crate) first: u8,
    /// Logarithm of the calibrated radiance.
    pub(crate) ln: f64,
    /// Its standard deviation.
    pub(crate) sigma: f64,
}

/// A measure with its tolerance.
pub(crate) type Measure = (Unknown, f64);

/// The corrected scene.
pub(crate) struct Solved {
    pub(crate) scene: Scene,
    /// Each correction in tolerances.
    pub(crate) moved: Vec<f64>,
    /// Corrections that differ from the solution by one standard deviation, independent of each other.
    pub(crate) uncertain: Vec<Vec<f64>>,
    /// Robust standard deviation of ln f among pixels of one half angle.
    pub(crate) misfit: f64,
    /// The misfit before the correction.
    pub(crate) before: f64,
}

/// The scene with corrections in tolerances.
pub(crate) fn apply(scene: &Scene, measures: &[Measure], moved: &[f64]) -> Scene {
    measures
        .iter()
        .zip(moved)
        .fold(scene.clone(), |scene, ((what, tolerance), u)| scene.changed(*what, u * tolerance))
}

fn node(theta: f64) -> f64 {
    ((theta / std::f64::consts::FRAC_PI_2).max(0.0).sqrt() * NODES as f64 - 0.5)
        .clamp(0.0, NODES as f64 - 1.001)
}

/// Deviations of ln f from each stack's curve for this scene. Pixels without light get 0.
fn deviations(scene: &Scene, samples: &[GeometrySample], weights: &[f64], patches: usize) -> Vec<f64> {
    let seen: Vec<Option<(f64, f64)>> = samples
        .iter()
        .map(|s| {
            let view = scene.seen(s.x, s.y, s.light, s.first)?;
            (view.cos_i > 0.05 && view.cos_o > 0.05).then(|| (node(view.theta), s.ln - view.irradiance.ln()))
        })
        .collect();
    let mut out = vec![0.0; samples.len()];
    for patch in 0..patches {
        // Normal equations of the piecewise linear curve: tridiagonal, with a little smoothness for empty nodes.
        let (mut a, mut b) = (vec![0.0; NODES * NODES], vec![0.0; NODES]);
        for i in 1..NODES - 1 {
            for (j, u) in [(i - 1, 1.0), (i, -2.0), (i + 1, 1.0)] {
                for (k, v) in [(i - 1, 1.0), (i, -2.0), (i + 1, 1.0)] {
                    a[j * NODES + k] += 0.02 * u * v;
                }
            }
        }
        for ((s, seen), w) in samples.iter().zip(&seen).zip(weights) {
            let (true, Some((at, ln_f))) = (s.patch == patch, seen) else { continue };
            let (i, t) = (*at as usize, at.fract());
            a[i * NODES + i] += w * (1.0 - t) * (1.0 - t);
            a[(i + 1) * NODES + i + 1] += w * t * t;
            a[(i + 1) * NODES + i] += w * t * (1.0 - t);
            a[i * NODES + i + 1] += w * t * (1.0 - t);
            b[i] += w * (1.0 - t) * ln_f;
            b[i + 1] += w * t * ln_f;
        }
        for i in 0..NODES {
            a[i * NODES + i] += 1e-9;
        }
        let Some(factors) = Cholesky::new(&a, NODES) else { continue };
        let curve = factors.solve(&b);
        for ((s, seen), out) in samples.iter().zip(&seen).zip(&mut out) {
            if let (true, Some((at, ln_f))) = (s.patch == patch, seen) {
                let (i, t) = (*at as usize, at.fract());
                *out = ln_f - (1.0 - t) * curve[i] - t * curve[i + 1];
            }
        }
    }
    out
}

fn huber(residual: f64) -> f64 {
    if residual.abs() <= 2.0 { 1.0 } else { 2.0 / residual.abs() }
}

/// Finds the corrections. Neighbours that still deviate together afterwards, as on paper that waves, count as one in a second solution,
/// so that the tape is kept where the pictures cannot tell.
pub(crate) fn solve(
    scene: &Scene,
    samples: &[GeometrySample],
    outline: &[[f64; 2]],
    measures: &[Measure],
) -> Solved {
    let first = solve_with(scene, samples, outline, measures, ALIKE);
    let alike = alike(samples, &first);
    if alike < MORE_ALIKE * ALIKE { first } else { solve_with(scene, samples, outline, measures, alike) }
}

/// How many neighbouring samples count as one: the variance of sums over parts of the picture, relative to that of independent samples.
fn alike(samples: &[GeometrySample], solved: &Solved) -> f64 {
    let patches = samples.iter().map(|s| s.patch + 1).max().unwrap_or(0);
    let flat: Vec<f64> = samples.iter().map(|s| 1.0 / (s.sigma * s.sigma + 0.02 * 0.02)).collect();
    let off = deviations(&solved.scene, samples, &flat, patches);
    let extent = |at: &dyn Fn(&GeometrySample) -> f64| {
        let places = samples.iter().map(at);
        places.fold((f64::MAX, f64::MIN), |(least, most), v| (least.min(v), most.max(v)))
    };
    let ((left, right), (top, bottom)) = (extent(&|s| s.x), extent(&|s| s.y));
    let side = ((right - left).max(bottom - top) / PARTS).max(1.0);
    let mut parts: std::collections::BTreeMap<(usize, usize, i64, i64), (f64, f64)> =
        std::collections::BTreeMap::new();
    let limit = 3.0 * solved.misfit;
    for (s, off) in samples.iter().zip(off) {
        let (column, row) = (((s.x - left) / side) as i64, ((s.y - top) / side) as i64);
        let off = off.clamp(-limit, limit);
        let part = parts.entry((s.light, s.patch, column, row)).or_default();
        part.0 += off;
        part.1 += off * off;
    }
    let (sums, squares) =
        parts.values().fold((0.0, 0.0), |all, part| (all.0 + part.0 * part.0, all.1 + part.1));
    if squares > 0.0 { sums / squares } else { 1.0 }
}

fn solve_with(
    scene: &Scene,
    samples: &[GeometrySample],
    outline: &[[f64; 2]],
    measures: &[Measure],
    alike: f64,
) -> Solved {
    let patches = samples.iter().map(|s| s.patch + 1).max().unwrap_or(0);
    let n = measures.len();
    let flat: Vec<f64> = samples.iter().map(|s| 1.0 / (s.sigma * s.sigma + 0.02 * 0.02)).collect();
    let first = deviations(scene, samples, &flat, patches);
    let before = spread(&first).1;
    let mut moved = vec![0.0; n];
    let mut misfit = before.max(LEAST_MISFIT);
    let mut damping = 1e-3;
    let outlines = |scene: &Scene| -> Vec<f64> {
        outline.iter().map(|p| scene.outside_outline(p[0], p[1]) / OUTLINE).collect()
    };
    let mut normal = Vec::new();
    for step in 0..STEPS {
        let now = apply(scene, measures, &moved);
        let plain = deviations(&now, samples, &flat, patches);
        misfit = spread(&plain).1.max(LEAST_MISFIT);
        let sigma = |s: &GeometrySample| (s.sigma * s.sigma + misfit * misfit).sqrt();
        let weights: Vec<f64> = samples
            .iter()
            .zip(&plain)
            .map(|(s, r)| huber(r / sigma(s)) / (sigma(s) * sigma(s)) / alike)
            .collect();
        let residuals = |u: &[f64]| {
            let scene = apply(scene, measures, u);
            (deviations(&scene, samples, &weights, patches), outlines(&scene))
        };
        let (base, edge) = residuals(&moved);
        let edge_weights: Vec<f64> = edge.iter().map(|r| huber(*r)).collect();
        let cost = |(r, e): &(Vec<f64>, Vec<f64>), u: &[f64]| -> f64 {
            r.iter().zip(&weights).map(|(r, w)| w * r * r).sum::<f64>()
                + e.iter().zip(&edge_weights).map(|(e, w)| w * e * e).sum::<f64>()
                + u.iter().map(|u| u * u).sum::<f64>()
        };
        let columns: Vec<(Vec<f64>, Vec<f64>)> = (0..n)
            .map(|k| {
                let mut u = moved.clone();
                u[k] += 0.02;
                let (r, e) = residuals(&u);
                let slope = |a: Vec<f64>, b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b) / 0.02).collect();
                (slope(r, &base), slope(e, &edge))
            })
            .collect();
        let dot = |w: &[f64], a: &[f64], b: &[f64]| {
            w.iter().zip(a).zip(b).map(|((w, a), b)| w * a * b).sum::<f64>()
        };
        normal = vec![0.0; n * n];
        let mut gradient = vec![0.0; n];
        for i in 0..n {
            for j in 0..n {
                normal[i * n + j] = dot(&weights, &columns[i].0, &columns[j].0)
                    + dot(&edge_weights, &columns[i].1, &columns[j].1)
                    + f64::from(u8::from(i == j));
            }
            gradient[i] =
                -dot(&weights, &columns[i].0, &base) - dot(&edge_weights, &columns[i].1, &edge) - moved[i];
        }
        let old = cost(&(base, edge), &moved);
        let mut settled = true;
        for _ in 0..8 {
            let Some(factors) = Cholesky::damped(&normal, n, damping) else { break };
            let by = factors.solve(&gradient);
            let next: Vec<f64> =
                moved.iter().zip(&by).map(|(u, d)| (u + d.clamp(-3.0, 3.0)).clamp(-30.0, 30.0)).collect();
            if cost(&residuals(&next), &next) < old {
                damping = (damping / 5.0).max(1e-6);
                settled = by.iter().all(|d| d.abs() < 2e-3);
                moved = next;
                break;
            }
            damping *= 8.0;
        }
        if settled && step > 2 {
            break;
        }
    }
    let uncertain = Cholesky::new(&normal, n).map_or_else(Vec::new, |factors| {
        (0..n)
            .map(|k| {
                let mut unit = vec![0.0; n];
                unit[k] = 1.0;
                factors.back(unit).iter().zip(&moved).map(|(d, u)| u + d).collect()
            })
            .collect()
    });
    Solved { scene: apply(scene, measures, &moved), moved, uncertain, misfit, before }
}

/// Places in the picture where the can ends against a darker background.
pub(crate) fn outline(scene: &Scene, radiance: &Radiance, light: usize) -> Vec<[f64; 2]> {
    let Some(radius) = scene.radius() else { return Vec::new() };
    let mut found = Vec::new();
    for row in -12i32..=12 {
        let height = f64::from(row) / 14.0 * scene.half_height();
        for side in [-1.0, 1.0] {
            // Where the lamp's light only grazes, the can's shadow ends before the can does.
            if scene.lit_from_side(side, light) > GRAZING {
                found.extend(edge(scene, radiance, side * radius, height));
            }
        }
    }
    found
}

/// The outermost fall of brightness along a line that leaves the can.
fn edge(scene: &Scene, radiance: &Radiance, radius: f64, height: f64) -> Option<[f64; 2]> {
    let (from, to) = (scene.beside(0.6 * radius, height), scene.beside(1.3 * radius, height));
    let length = (to[0] - from[0]).hypot(to[1] - from[1]);
    let count = length.ceil() as usize;
    let at = |i: f64| {
        [from[0] + (to[0] - from[0]) * i / count as f64, from[1] + (to[1] - from[1]) * i / count as f64]
    };
    // Between pixel centres, which are at halves; the picture's rows are level enough for the nearest one.
    let light = |i: f64| -> Option<f64> {
        let [x, y] = at(i);
        let (u, row) = (x - 0.5, y.floor());
        if u < 0.0 || row < 0.0 || u as usize + 1 >= radiance.width || row as usize >= radiance.height {
            return None;
        }
        let pixel = row as usize * radiance.width + u as usize;
        let value = |pixel: usize| (0..3).map(|c| f64::from(radiance.value[3 * pixel + c])).sum::<f64>();
        Some(value(pixel) * (1.0 - u.fract()) + value(pixel + 1) * u.fract()).filter(|v| v.is_finite())
    };
    let line: Vec<f64> = (0..=count).map_while(|i| light(i as f64)).collect();
    let most = line.iter().copied().fold(0.0, f64::max);
    for i in 3..line.len().saturating_sub(3) {
        let (inside, outside) = (line[i - 3], line[i + 3].max(0.0));
        let beyond = line[i + 3..].iter().copied().fold(0.0, f64::max);
        if inside < 0.02 * most || outside > 0.2 * inside || beyond > 0.3 * inside {
            continue;
        }
        // Half way down.
        let half = 0.5 * (inside + outside);
        for j in i - 3..i + 3 {
            if line[j] >= half && line[j + 1] < half {
                return Some(at(j as f64 + (line[j] - half) / (line[j] - line[j + 1]).max(1e-30)));
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::setup::{Setup, tests::CAN};

    fn measures() -> Vec<Measure> {
        vec![
            (Unknown::Radius, 0.75),
            (Unknown::Lean, 0.017),
            (Unknown::Nod, 0.017),
            (Unknown::Across, 2.0),
            (Unknown::Light(0, 0), 15.0),
            (Unknown::Light(0, 1), 15.0),
            (Unknown::Light(0, 2), 15.0),
        ]
    }

    /// Pixels of a glossy can under exact geometry.
    fn samples(truth: &Scene) -> Vec<GeometrySample> {
        let mut samples = Vec::new();
        for y in (60..300).step_by(4) {
            for x in (160..320).step_by(2) {
                let (x, y) = (f64::from(x) + 0.5, f64::from(y) + 0.5);
                let Some(view) = truth.view(x, y, 0).filter(|v| v.cos_i > 0.15 && v.cos_o > 0.15) else {
                    continue;
                };
                let f = 0.05 + inks::ggx::lobe(view.theta, 0.1);
                samples.push(GeometrySample {
                    x,
                    y,
                    light: 0,
                    patch: 0,
                    first: 0,
                    ln: (f * view.irradiance).ln(),
                    sigma: 0.01,
                });
            }
        }
        samples
    }

    #[test]
    fn a_wrong_tape_is_corrected_where_the_picture_can_tell() {
        let truth = Scene::new(&Setup::parse(CAN).unwrap(), (480, 360), 14f64.to_radians()).unwrap();
        let samples = samples(&truth);
        // The outline of the true can, as a picture would show it.
        let outline: Vec<[f64; 2]> = (0..20)
            .map(|i| {
                let y = 100.0 + 8.0 * f64::from(i);
                let (mut low, mut high) = (300.0, 340.0);
                for _ in 0..40 {
                    let x: f64 = 0.5 * (low + high);
                    if truth.outside_outline(x, y) < 0.0 { low = x } else { high = x }
                }
                [low, y]
            })
            .collect();
        for (what, by) in [
            (Unknown::Radius, 0.5),
            (Unknown::Lean, 0.0087),
            (Unknown::Nod, 0.0087),
            (Unknown::Light(0, 0), 5.0),
        ] {
            let wrong = truth.clone().changed(what, by);
            let solved = solve(&wrong, &samples, &outline, &measures());
            let off = |scene: &Scene| -> f64 {
                let far = samples.iter().map(|s| {
                    let theta = |scene: &Scene| scene.view(s.x, s.y, 0).map_or(0.0, |v| v.theta);
                    (theta(scene) - theta(&truth)).abs()
                });
                far.sum::<f64>() / samples.len() as f64
            };
            println!(
                "{what:?}: {:.5} to {:.5}, misfit {:.4} to {:.4}",
                off(&wrong),
                off(&solved.scene),
                solved.before,
                solved.misfit
            );
            assert!(
                off(&solved.scene) < 0.35 * off(&wrong),
                "{what:?}: {} of {}",
                off(&solved.scene),
                off(&wrong)
            );
            assert!(solved.misfit <= solved.before.max(LEAST_MISFIT), "{what:?}");
        }
    }
}
