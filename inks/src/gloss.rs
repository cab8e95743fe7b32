//! Specular gloss at 20, 60 and 85 degrees, as a gloss meter reads it, and the width of a lobe from such
//! readings.
//!
//! Problem: owners have gloss meters, not gonioreflectometers, and want to compare their readings with
//! curves.
//! Method: the light of each lobe that passes the window of the meter (ISO 2813: 4.4 degrees in the plane
//! of incidence and 11.7 across it at 60 degrees, 1.8 and 3.6 at 20, 4.0 and 6.0 at 85), relative to
//! polished black glass of index 1.567, which reads 100. Each lobe is evaluated as a full microfacet BRDF
//! with Smith's shadowing; reflectance rises at 60 degrees by Fresnel's equations for a dielectric surface
//! and by Schlick's form for metal. The width is searched on a grid and then by golden sections, for the
//! least squares of the readings' relative errors. A curve reads by its integral and shape ([`of_curve`]).
//! Cost: 4096 evaluations per lobe and angle; some hundred of those for a width. Limits: the beam is
//! assumed to be parallel. [`units`] ignores the diffuse body, [`reading`] counts it. Because of the long
//! tails of GGX, a lobe reads lower than its visible sharpness suggests, and readings at several angles
//! disagree about its width: the disagreement is part of the answer.

use maths::Maths;
use std::f64::consts::PI;

use crate::curve::Curve;
use crate::ggx;
use crate::lobes::{Lobe, Lobes};

/// Index of the glass that reads 100.
const GLASS: f64 = 1.567;
const STEPS: usize = 64;
/// The half angle beyond which a curve is looked at for its body: nearer, a lobe that is a little off hides
/// it.
const ASIDE: f64 = PI / 6.0;
/// The largest half angle at which curves are trusted.
const TRUSTED: f64 = 75.0 * PI / 180.0;
/// The widths that are searched.
const WIDTHS: [f64; 2] = [0.005, 1.0];
/// What a gloss meter may be off: gloss units, and a share of the reading.
const METER: [f64; 2] = [0.5, 0.02];

/// An angle at which gloss is measured, with the window of ISO 2813.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Geometry {
    /// The angle of the beam from the normal, in degrees.
    pub degrees: f64,
    /// Half the window, in degrees: in the plane of incidence and across it.
    window: [f64; 2],
}

impl Geometry {
    /// For polished surfaces.
    pub const TWENTY: Geometry = Geometry { degrees: 20.0, window: [0.9, 1.8] };
    /// For everything between.
    pub const SIXTY: Geometry = Geometry { degrees: 60.0, window: [2.2, 5.85] };
    /// For matte surfaces.
    pub const EIGHTY_FIVE: Geometry = Geometry { degrees: 85.0, window: [2.0, 3.0] };
}
/// A lobe above this is metal; dielectrics up to index 1.8 reflect less.
const DIELECTRIC: f64 = 0.082;

/// Units at 60 degrees below which a surface is matt, and above which it is glossy (ISO 2813).
const SATIN: [f64; 2] = [10.0, 70.0];

/// "matt", "satin" or "glossy", by units at 60 degrees.
#[must_use]
pub fn word(units: f64) -> &'static str {
    match units {
        at if at < SATIN[0] => "matt",
        at if at < SATIN[1] => "satin",
        _ => "glossy",
    }
}

/// Unpolarised reflectance of a dielectric of index `n` at the angle with cosine `cos`.
fn fresnel(n: f64, cos: f64) -> f64 {
    let inside = (1.0 - (1.0 - cos * cos) / (n * n)).sqrt();
    let s = (cos - n * inside) / (cos + n * inside);
    let p = (inside - n * cos) / (inside + n * cos);
    (s * s + p * p) / 2.0
}

fn reflectance(f0: f64, cos: f64) -> f64 {
    if f0 <= 0.0 {
        0.0
    } else if f0 <= DIELECTRIC {
        fresnel((1.0 + f0.sqrt()) / (1.0 - f0.sqrt()), cos)
    } else {
        f0 + (1.0 - f0) * (1.0 - cos).whole_power(5)
    }
}

/// Relative luminance of a linear Rec. 709 colour.
fn luminance(rgb: [f64; 3]) -> f64 {
    0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]
}

fn lambda(cos: f64, alpha: f64) -> f64 {
    ((1.0 + alpha * alpha * (1.0 / (cos * cos) - 1.0)).sqrt() - 1.0) / 2.0
}

/// The integral of `f cos_o` over the window, where `f` gets the outgoing direction and the beam arrives in
/// the plane y = 0.
fn through_window(geometry: Geometry, f: impl Fn([f64; 3]) -> f64) -> f64 {
    let (sin_i, cos_i) = geometry.degrees.to_radians().sine_cosine();
    let half = geometry.window.map(f64::to_radians);
    // The position and width of a step. Steps are smallest in the centre, where narrow lobes are.
    let at = |i: usize, half: f64| {
        let u = (2 * i + 1) as f64 / STEPS as f64 - 1.0;
        (half * u * u.abs(), half * 2.0 * u.abs() * 2.0 / STEPS as f64)
    };
    let mut sum = 0.0;
    for row in 0..STEPS {
        for column in 0..STEPS {
            let ((along, height), (across, width)) = (at(row, half[0]), at(column, half[1]));
            // The direction through this point of a flat window perpendicular to the mirror direction.
            let (x, y) = (along.tangent(), across.tangent());
            let length = (1.0 + x * x + y * y).sqrt();
            let o = [(sin_i + cos_i * x) / length, y / length, (cos_i - sin_i * x) / length];
            let solid_angle = (1.0 + x * x) * (1.0 + y * y) / length.cubed();
            sum += f(o) * solid_angle * height * width;
        }
    }
    sum
}

/// The ratio of light through the window to light in the beam, for one lobe.
fn of_lobe(geometry: Geometry, lobe: &Lobe) -> f64 {
    let (sin_i, cos_i) = geometry.degrees.to_radians().sine_cosine();
    let f0 = luminance(lobe.f0);
    through_window(geometry, |o| {
        let h = [o[0] - sin_i, o[1], o[2] + cos_i];
        let h_length = (h[0] * h[0] + h[1] * h[1] + h[2] * h[2]).sqrt();
        let (cos_h, cos_d) = (h[2] / h_length, (cos_i * h[2] - sin_i * h[0]) / h_length);
        let shadowing = 1.0 / (1.0 + lambda(cos_i, lobe.alpha) + lambda(o[2], lobe.alpha));
        // f cos_o, where f = F D G / (4 cos_i cos_o).
        reflectance(f0, cos_d) * ggx::distribution(cos_h, lobe.alpha) * shadowing / (4.0 * cos_i)
    })
}

/// Gloss units for a share of the beam.
fn relative(geometry: Geometry, share: f64) -> f64 {
    100.0 * share / fresnel(GLASS, geometry.degrees.to_radians().cosine())
}

/// Gloss units at 60 degrees of the lobes alone.
pub fn units(lobes: &Lobes) -> f64 {
    lobes.lobes.iter().map(|lobe| relative(Geometry::SIXTY, of_lobe(Geometry::SIXTY, lobe))).sum()
}

/// What a gloss meter reads, body and lobes together.
pub fn reading(geometry: Geometry, lobes: &Lobes) -> f64 {
    let body = lobes.entering * luminance(lobes.kd) / PI;
    let diffuse = through_window(geometry, |o| body * o[2]);
    relative(geometry, diffuse + lobes.lobes.iter().map(|lobe| of_lobe(geometry, lobe)).sum::<f64>())
}

/// What a gloss meter reads at some angles on a surface of which only the curve over the half angle is
/// known, light and eye in one place.
///
/// The curve is split into a body, which is what is left at its lowest, and a lobe above it, whose
/// microfacets cover the unit disc once; so the lobe's F0 follows from its integral. Its shape stays that
/// of the curve. Values beyond 75 degrees are not looked at, where measurements end or are noise.
pub fn of_curve<const N: usize>(geometries: [Geometry; N], curve: &Curve) -> [f64; N] {
    let split = Split::of(curve, ASIDE);
    geometries.map(|geometry| split.reading(geometry, curve))
}

/// A curve as a body and a lobe.
struct Split {
    /// Luminance of the body, in 1/sr.
    body: f64,
    /// Reflectance of the lobe at normal incidence.
    f0: f64,
    /// Its width, if it is a GGX lobe.
    alpha: f64,
}

impl Split {
    fn of(curve: &Curve, aside: f64) -> Split {
        const STEPS: u32 = 512;
        // As many repetitions change the reading of a lobe of alpha .5 by less than a thousandth.
        const ROUNDS: u32 = 16;
        let step = |i: u32| {
            let u = (f64::from(i) + 0.5) / f64::from(STEPS);
            (TRUSTED * u * u, TRUSTED * 2.0 * u / f64::from(STEPS))
        };
        let values: Vec<f64> = (0..STEPS).map(|i| luminance(curve.at(step(i).0)).max(0.0)).collect();
        let mut split =
            Split { body: values.iter().copied().fold(f64::INFINITY, f64::min), f0: 0.0, alpha: 1.0 };
        for _ in 0..ROUNDS {
            split.f0 = 0.0;
            for (&f, (t, dt)) in values.iter().zip((0..STEPS).map(step)) {
                let (sin, cos) = t.sine_cosine();
                let d = 4.0 * cos * cos * (f - split.body).max(0.0) / ggx::shadowing(cos, split.alpha);
                split.f0 += d * cos * 2.0 * PI * sin * dt;
            }
            let peak = (values[0] - split.body).max(f64::MIN_POSITIVE);
            split.alpha = (split.f0 / (4.0 * PI * peak)).sqrt().clamp(WIDTHS[0], WIDTHS[1]);
            let lobe = |t: f64| split.f0 * ggx::lobe(t, split.alpha);
            let angles = (0..STEPS).map(|i| step(i).0);
            let seen = values.iter().zip(angles).filter(|(_, t)| *t > aside);
            split.body = seen.map(|(f, t)| (f - lobe(t)).max(0.0)).fold(f64::INFINITY, f64::min);
        }
        split.f0 = split.f0.min(1.0);
        split
    }

    fn lobe(&self, curve: &Curve, t: f64) -> f64 {
        (luminance(curve.at(t)) - self.body).max(0.0)
    }

    /// Gloss units at an angle of the curve that was split.
    fn reading(&self, geometry: Geometry, curve: &Curve) -> f64 {
        let (sin_i, cos_i) = geometry.degrees.to_radians().sine_cosine();
        let per_f0 = 1.0 / self.f0.max(f64::MIN_POSITIVE);
        let share = through_window(geometry, |o| {
            let h = [o[0] - sin_i, o[1], o[2] + cos_i];
            let length = (h[0] * h[0] + h[1] * h[1] + h[2] * h[2]).sqrt();
            let (cos_h, cos_d) = ((h[2] / length).min(1.0), (cos_i * h[2] - sin_i * h[0]) / length);
            // f = F0 D G / (4 cos^2 h) of the curve gives D, and the directions give F and G.
            let distribution = 4.0 * cos_h * cos_h * self.lobe(curve, cos_h.arccosine())
                / ggx::shadowing(cos_h, self.alpha).max(f64::MIN_POSITIVE);
            let shadowing = 1.0 / (1.0 + lambda(cos_i, self.alpha) + lambda(o[2], self.alpha));
            let lobe = reflectance(self.f0, cos_d) * per_f0 * distribution * shadowing / (4.0 * cos_i);
            self.body * o[2] + lobe
        });
        relative(geometry, share)
    }
}

/// The width of a lobe, from gloss readings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Width {
    /// Microfacet width.
    pub alpha: f64,
    /// Its standard deviation, as a share: what the meter may be off, and the disagreement of the readings.
    pub uncertainty: f64,
    /// The largest difference between a reading and that of the lobe, as a share.
    pub misfit: f64,
}

/// The width of a surface's only lobe from readings in gloss units. `body` says what lies under a lobe of
/// that width. `None` without readings, or if one is not positive.
pub fn width(readings: &[(Geometry, f64)], body: impl Fn(f64) -> Lobes) -> Option<Width> {
    if readings.is_empty() || readings.iter().any(|(_, read)| !(read.is_finite() && *read > 0.0)) {
        return None;
    }
    let sigma = |read: f64| METER[1].hypotenuse(METER[0] / read);
    let off = |(geometry, read): &(Geometry, f64), ln: f64| {
        (reading(*geometry, &body(ln.exponential())).max(1e-12) / read).logarithm() / sigma(*read)
    };
    let least = |readings: &[(Geometry, f64)]| {
        let cost = |ln: f64| readings.iter().map(|r| off(r, ln).squared()).sum::<f64>();
        lowest(cost, WIDTHS.map(f64::logarithm))
    };
    let ln = least(readings);
    let step = 1e-3;
    let slope = |r: &(Geometry, f64)| (off(r, ln + step) - off(r, ln - step)) / (2.0 * step);
    let meter = readings.iter().map(|r| slope(r).squared()).sum::<f64>().max(1e-12).sqrt().recip();
    let alone = readings.iter().map(|r| least(&[*r]) - ln);
    let disagreement = if readings.len() > 1 { alone.fold(0.0, |a: f64, b| a.max(b.abs())) } else { 0.0 };
    let misfit = readings.iter().map(|r| (off(r, ln) * sigma(r.1)).abs()).fold(0.0, f64::max);
    Some(Width { alpha: ln.exponential(), uncertainty: meter.hypotenuse(disagreement), misfit })
}

/// Where a function of one number is lowest: the best of a grid, refined by golden sections.
fn lowest(cost: impl Fn(f64) -> f64, [from, to]: [f64; 2]) -> f64 {
    const GRID: u32 = 24;
    let step = (to - from) / f64::from(GRID);
    let at = |i: u32| from + step * f64::from(i);
    let best = (0..=GRID).map(|i| (cost(at(i)), at(i))).min_by(|a, b| a.0.total_cmp(&b.0));
    let middle = best.map_or(from, |(_, x)| x);
    let (mut low, mut high) = ((middle - step).max(from), (middle + step).min(to));
    let golden = (5f64.sqrt() - 1.0) / 2.0;
    let (mut a, mut b) = (high - golden * (high - low), low + golden * (high - low));
    let (mut fa, mut fb) = (cost(a), cost(b));
    for _ in 0..30 {
        if fa < fb {
            (high, b, fb) = (b, a, fa);
            a = high - golden * (high - low);
            fa = cost(a);
        } else {
            (low, a, fa) = (a, b, fb);
            b = low + golden * (high - low);
            fb = cost(b);
        }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lobe(f0: f64, alpha: f64) -> Lobes {
        Lobes { kd: [0.0; 3], entering: 0.96, lobes: vec![Lobe { f0: [f0; 3], alpha }] }
    }

    #[test]
    fn polished_black_glass_reads_a_hundred() {
        let f0 = ((GLASS - 1.0) / (GLASS + 1.0)).powi(2);
        let reading = units(&lobe(f0, 0.002));
        assert!((reading - 100.0).abs() < 1.0, "{reading}");
    }

    #[test]
    fn polished_glass_of_an_index_reads_by_fresnel_at_every_angle() {
        // 1.5 reads 91.9 or so at 60 degrees, from the equations alone.
        for geometry in [Geometry::TWENTY, Geometry::SIXTY, Geometry::EIGHTY_FIVE] {
            let cos = geometry.degrees.to_radians().cos();
            for n in [GLASS, 1.5, 1.46] {
                let f0 = ((n - 1.0f64) / (n + 1.0)).powi(2);
                let expected = 100.0 * fresnel(n, cos) / fresnel(GLASS, cos);
                let found = reading(geometry, &lobe(f0, 0.001));
                // At 85 degrees Fresnel is steep, and the tails of the lobe reach up it.
                assert!(
                    (found / expected - 1.0).abs() < 0.03,
                    "{n} at {}: {found} {expected}",
                    geometry.degrees
                );
            }
        }
    }

    /// A white body alone: its radiance times the cone of the window, cos and all, by hand.
    #[test]
    fn a_white_body_reads_its_share_of_the_window() {
        let white = Lobes { kd: [1.0; 3], entering: 1.0, lobes: Vec::new() };
        for (geometry, window) in [
            (Geometry::TWENTY, [1.8, 3.6]),
            (Geometry::SIXTY, [4.4, 11.7]),
            (Geometry::EIGHTY_FIVE, [4.0, 6.0]),
        ] {
            let [a, b] = window.map(|w: f64| 2.0 * (w / 2.0).to_radians().tan());
            let cos = geometry.degrees.to_radians().cos();
            let expected = 100.0 * a * b * cos / PI / fresnel(GLASS, cos);
            let found = reading(geometry, &white);
            assert!((found / expected - 1.0).abs() < 0.01, "{}: {found} {expected}", geometry.degrees);
        }
    }

    /// The same definition on a grid of 400 x 400 directions, computed with NumPy.
    #[test]
    fn another_program_reads_the_same() {
        for (alpha, read) in
            [(0.10, [1.358, 13.697, 10.990]), (0.14, [0.708, 8.335, 6.266]), (0.28, [0.191, 2.388, 1.563])]
        {
            let lobes = Lobes { kd: [0.015; 3], entering: 0.96, ..lobe(0.04, alpha) };
            for (geometry, expected) in
                [Geometry::TWENTY, Geometry::SIXTY, Geometry::EIGHTY_FIVE].into_iter().zip(read)
            {
                let found = reading(geometry, &lobes);
                assert!(
                    (found - expected).abs() < 0.005 * expected + 0.001,
                    "{alpha} {geometry:?}: {found} {expected}"
                );
            }
        }
    }

    /// The curve of a lobe reads what the lobe reads, which other tests compare with Fresnel's equations
    /// and another program.
    #[test]
    fn a_curve_reads_what_its_lobe_does() {
        let fine: Vec<f64> = (0..400).map(|i| PI / 2.0 * (f64::from(i) / 399.0).powi(2)).collect();
        let grid: Vec<f64> = (0..32).map(|i| PI / 2.0 * ((f64::from(i) + 0.5) / 32.0).powi(2)).collect();
        let glass = ((GLASS - 1.0) / (GLASS + 1.0)).powi(2);
        for (f0, kd) in [(0.04, 0.8), (0.04, 0.02), (glass, 0.0), (0.5, 0.1), (0.85, 0.015)] {
            for (angles, alphas) in
                [(&fine, &[0.01, 0.05, 0.14, 0.28, 0.5][..]), (&grid, &[0.05, 0.14, 0.28])]
            {
                for &alpha in alphas {
                    let lobes = Lobes { kd: [kd; 3], entering: 0.96, ..lobe(f0, alpha) };
                    let curve = Curve::sampled(angles, |t| lobes.at(t));
                    // Where a curve is looked at for its body hardly matters.
                    for aside in [0.8 * ASIDE, 1.2 * ASIDE] {
                        let (one, other) = (Split::of(&curve, ASIDE), Split::of(&curve, aside));
                        assert!((one.body - other.body).abs() < 0.05 * one.body + 1e-4);
                        assert!((one.f0 / other.f0 - 1.0).abs() < 0.05, "{alpha}");
                        assert!((one.alpha / other.alpha - 1.0).abs() < 0.05);
                    }
                    let geometries = [Geometry::TWENTY, Geometry::SIXTY, Geometry::EIGHTY_FIVE];
                    for (geometry, found) in geometries.into_iter().zip(of_curve(geometries, &curve)) {
                        let expected = reading(geometry, &lobes);
                        assert!(
                            (found - expected).abs() < 0.05 * expected + 0.3,
                            "F0 {f0}, body {kd}, alpha {alpha}, {} samples, {geometry:?}: {found}, not {expected}",
                            angles.len()
                        );
                    }
                }
            }
        }
    }

    /// ISO 2813's standard: 100 at each angle, from a curve. Three times as bright a curve is no glass; a
    /// matt one reads its share.
    #[test]
    fn the_curve_of_polished_black_glass_reads_a_hundred() {
        let angles: Vec<f64> = (0..2000).map(|i| PI / 2.0 * (f64::from(i) / 1999.0).powi(5)).collect();
        let f0 = ((GLASS - 1.0) / (GLASS + 1.0)).powi(2);
        let curve = Curve::sampled(&angles, |t| [f0 * ggx::lobe(t, 0.001); 3]);
        for geometry in [Geometry::TWENTY, Geometry::SIXTY, Geometry::EIGHTY_FIVE] {
            let [found] = of_curve([geometry], &curve);
            assert!((found - 100.0).abs() < 4.0, "{geometry:?}: {found}");
            let white = Curve::sampled(&angles, |_| [1.0 / PI; 3]);
            let body = Lobes { kd: [1.0; 3], entering: 1.0, lobes: Vec::new() };
            let ([found], expected) = (of_curve([geometry], &white), reading(geometry, &body));
            assert!((found / expected - 1.0).abs() < 1e-6, "{geometry:?}: {found} {expected}");
        }
    }

    #[test]
    fn a_known_width_comes_back_from_its_readings() {
        for (f0, kd) in [(0.04, 0.8), (0.04, 0.02), (0.85, 0.015)] {
            for alpha in [0.02, 0.06, 0.12, 0.28, 0.5] {
                let body = |alpha: f64| Lobes { kd: [kd; 3], entering: 0.96, ..lobe(f0, alpha) };
                let read = |g: Geometry| (g, reading(g, &body(alpha)));
                for set in [
                    vec![read(Geometry::SIXTY)],
                    vec![read(Geometry::TWENTY), read(Geometry::SIXTY), read(Geometry::EIGHTY_FIVE)],
                ] {
                    let found = width(&set, body).unwrap();
                    assert!((found.alpha / alpha - 1.0).abs() < 0.01, "{f0} {kd} {alpha}: {found:?}");
                    assert!(found.misfit < 0.01 && found.uncertainty < 0.5, "{found:?}");
                }
            }
        }
        let body = |alpha: f64| lobe(0.04, alpha);
        assert_eq!(width(&[], body), None);
        assert_eq!(width(&[(Geometry::SIXTY, -3.0)], body), None);
        // Readings of two different surfaces disagree, and the width says so.
        let mixed = [
            (Geometry::TWENTY, reading(Geometry::TWENTY, &body(0.05))),
            (Geometry::SIXTY, reading(Geometry::SIXTY, &body(0.2))),
        ];
        let found = width(&mixed, body).unwrap();
        assert!(found.uncertainty > 0.3 && (0.05..0.2).contains(&found.alpha), "{found:?}");
    }

    /// Published with the model for F0 = 0.04 and for a metal of 0.85, in whole units. The model of the
    /// beam was not published, hence the tolerance of 3 %.
    #[test]
    fn the_published_readings() {
        for (alpha, clear, metal) in [
            (0.05, 31.0, 296.0),
            (0.10, 14.0, 133.0),
            (0.15, 8.0, 73.0),
            (0.20, 5.0, 44.0),
            (0.27, 3.0, 25.0),
            (0.38, 1.0, 12.0),
        ] {
            for (f0, published) in [(0.04, clear), (0.85, metal)] {
                let reading = units(&lobe(f0, alpha));
                assert!(
                    (reading - published).abs() < 0.6 + 0.03 * published,
                    "{f0} {alpha}: {reading} {published}"
                );
            }
        }
    }

    #[test]
    fn a_metal_lobe_brighter_or_narrower_reads_higher() {
        let mut last = f64::INFINITY;
        for alpha in [0.02, 0.05, 0.1, 0.2, 0.4, 0.8] {
            let reading = units(&lobe(0.9, alpha));
            assert!(reading < last && reading > units(&lobe(0.5, alpha)));
            last = reading;
        }
    }
}
