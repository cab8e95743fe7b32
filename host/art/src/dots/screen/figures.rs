//! How far dots differ from the art, as an eye sees both from reading distance: the figures of
//! docs/decisions/flat-art.md.
//!
//! Method: letters, lines and tints are drawn here. What is asked is the drawn colour, or the nearest of
//! its hue that the stacks reach ([`Reach`]), as light between black and paper; what is printed is the
//! light of the stacks. Both are filtered as an eye does ([`seen`]), and their mean difference over the
//! picture is the figure. No mixture of the code under test has a part in what is asked.
//! Limits: dots are squares without gain. Source: X. Zhang, B. Wandell, A spatial extension of CIELAB for
//! digital color image reproduction (1997): weights and spreads of the filters in degrees, each normalised
//! to a sum of 1.

use rustfft::FftPlanner;
use rustfft::num_complex::Complex;

use super::mixtures::Rules;
use super::tests::{Art, INKS, stack};
use super::*;
use crate::colour::intent::{Light, oklab};
use crate::read::object_type::ObjectType;

/// Dots along each side of the art, 22 mm.
pub(super) const SIDE: usize = 512;

/// Linear sRGB to XYZ, and XYZ to light, red and green, blue and yellow.
const XYZ: [Light; 3] =
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]];
const OPPONENT: [Light; 3] = [[0.279, 0.72, -0.107], [-0.449, 0.29, -0.077], [0.086, -0.59, 0.501]];
/// Weights and spreads in degrees of the Gaussians by which each of these is seen.
const FILTERS: [&[(f64, f64)]; 3] = [
    &[(0.921, 0.0283), (0.105, 0.133), (-0.108, 4.336)],
    &[(0.531, 0.0392), (0.330, 0.494)],
    &[(0.488, 0.0536), (0.371, 0.386)],
];

fn times(matrix: &[Light; 3], v: Light) -> Light {
    std::array::from_fn(|row| (0..3).map(|c| matrix[row][c] * v[c]).sum())
}

fn inverse(m: &[Light; 3]) -> [Light; 3] {
    let minor = |i: usize, j: usize| {
        let at = |i: usize, j: usize| m[i % 3][j % 3];
        at(i + 1, j + 1) * at(i + 2, j + 2) - at(i + 1, j + 2) * at(i + 2, j + 1)
    };
    let determinant: f64 = (0..3).map(|j| m[0][j] * minor(0, j)).sum();
    std::array::from_fn(|i| std::array::from_fn(|j| minor(j, i) / determinant))
}

/// Lab of each dot as it is seen from so many metres, relative to paper.
fn seen(light: &[Light], metres: f64) -> Vec<Light> {
    let degree = halftone::contrast_sensitivity::degree(metres) * 600.0 / 0.0254;
    let planes: Vec<Vec<f64>> = (0..3)
        .into_par_iter()
        .map(|c| {
            let plane = light.iter().map(|&light| Complex::from(times(&OPPONENT, times(&XYZ, light))[c]));
            let sum: f64 = FILTERS[c].iter().map(|(weight, _)| weight).sum();
            filtered(plane.collect(), |f| {
                let gauss = |spread: f64| (-(std::f64::consts::PI * spread * f * degree).powi(2)).exp();
                FILTERS[c].iter().map(|&(weight, spread)| weight / sum * gauss(spread)).sum()
            })
        })
        .collect();
    let (back, white) = (inverse(&OPPONENT), times(&XYZ, [1.0; 3]));
    let lab = |at: usize| {
        let xyz = times(&back, std::array::from_fn(|c| planes[c][at]));
        let [x, y, z] = std::array::from_fn(|c| {
            let t: f64 = xyz[c] / white[c];
            if t > 216.0 / 24389.0 { t.cbrt() } else { (24389.0 / 27.0 * t + 16.0) / 116.0 }
        });
        [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
    };
    (0..light.len()).map(lab).collect()
}

/// A square whose frequencies, in cycles a dot, are weighed by `gain`.
fn filtered(mut image: Vec<Complex<f64>>, gain: impl Fn(f64) -> f64) -> Vec<f64> {
    let side = image.len().isqrt();
    let mut planner = FftPlanner::new();
    let mut transform = |image: &mut Vec<Complex<f64>>, back: bool| {
        let plan = if back { planner.plan_fft_inverse(side) } else { planner.plan_fft_forward(side) };
        for _ in 0..2 {
            plan.process(image);
            *image = (0..image.len()).map(|at| image[at % side * side + at / side]).collect();
        }
    };
    transform(&mut image, false);
    let cycles = |n: usize| n.min(side - n) as f64 / side as f64;
    for (at, value) in image.iter_mut().enumerate() {
        *value *= gain(cycles(at % side).hypot(cycles(at / side)));
    }
    transform(&mut image, true);
    image.into_iter().map(|value| value.re / (side * side) as f64).collect()
}

fn difference(a: Light, b: Light) -> f64 {
    (0..3).map(|c| (a[c] - b[c]).powi(2)).sum::<f64>().sqrt()
}

/// The light of each stack.
fn bodies() -> Vec<Light> {
    INKS.0.stacks.iter().map(|stack| INKS.1.body(stack)).collect()
}

/// The light of each stack between black and paper.
pub(super) fn lights() -> Vec<Light> {
    INKS.0.stacks.iter().map(|stack| INKS.1.light(stack)).collect()
}

/// What mixtures of the stacks reach, found by trying.
pub(super) struct Reach {
    /// Planes through three stacks that have all on one side: outside, the first is less than the product.
    planes: Vec<(f64, Light)>,
    /// Mixtures of any three stacks, as light and in Oklab.
    mixtures: Vec<(Light, Light)>,
}

impl Reach {
    pub fn new(stacks: &[Light]) -> Reach {
        /// Parts of a mixture.
        const PARTS: usize = 40;
        let product = |a: Light, b: Light| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let (mut planes, mut mixtures) = (Vec::new(), Vec::new());
        for a in 0..stacks.len() {
            for b in a + 1..stacks.len() {
                for c in b + 1..stacks.len() {
                    let corners = [stacks[a], stacks[b], stacks[c]];
                    let [u, v] =
                        [1, 2].map(|n| std::array::from_fn::<f64, 3, _>(|i| corners[n][i] - corners[0][i]));
                    let normal =
                        [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
                    let at = product(normal, corners[0]);
                    let sides: Vec<f64> = stacks.iter().map(|&stack| product(normal, stack) - at).collect();
                    let is_on = |sign: f64| sides.iter().all(|side| sign * side <= 1e-9);
                    if is_on(1.0) && !is_on(-1.0) {
                        planes.push((at, normal));
                    } else if is_on(-1.0) && !is_on(1.0) {
                        planes.push((-at, normal.map(|v| -v)));
                    } else {
                        continue;
                    }
                    let parts = (0..=PARTS).flat_map(|m| (0..=PARTS - m).map(move |n| [m, n, PARTS - m - n]));
                    mixtures.extend(parts.map(|parts| {
                        let of = |i| (0..3).map(|n| parts[n] as f64 / PARTS as f64 * corners[n][i]).sum();
                        let light: Light = std::array::from_fn(of);
                        (light, oklab(light))
                    }));
                }
            }
        }
        Reach { planes, mixtures }
    }

    pub fn has(&self, light: Light) -> bool {
        let product = |a: Light| a[0] * light[0] + a[1] * light[1] + a[2] * light[2];
        self.planes.iter().all(|&(at, normal)| product(normal) <= at + 1e-9)
    }

    /// The nearest mixture of about the same hue, and how far it is, for what is beyond reach.
    pub fn nearest(&self, light: Light) -> (Light, f64) {
        let own = oklab(light);
        let chroma = own[1].hypot(own[2]);
        let far = |other: Light| (0..3).map(|i| (own[i] - other[i]).powi(2)).sum::<f64>().sqrt();
        // Half a degree, or where there is hardly any colour.
        let is_of_hue = |other: Light| {
            let across = own[1] * other[2] - own[2] * other[1];
            let along = own[1] * other[1] + own[2] * other[2];
            along >= 0.0 && across.abs() <= chroma * (0.009 * other[1].hypot(other[2])).max(0.0005)
        };
        let of_hue = self.mixtures.iter().filter(|(_, other)| is_of_hue(*other));
        let found = of_hue.map(|&(light, other)| (light, far(other))).min_by(|a, b| a.1.total_cmp(&b.1));
        found.unwrap_or((light, 0.0))
    }
}

pub(super) static REACH: std::sync::LazyLock<Reach> = std::sync::LazyLock::new(|| Reach::new(&lights()));

/// The light of a colour of sRGB.
pub(super) fn drawn(colour: [u8; 3]) -> Light {
    colour.map(|v| f64::from(appearance::srgb::decode(f32::from(v) / 255.0)))
}

/// The light that is asked for each dot, relative to paper.
fn asked(art: &Art) -> Vec<Light> {
    let black = INKS.1.body(&INKS.0.stacks[usize::from(stack("K"))]);
    let mut known = std::collections::HashMap::new();
    let light = |&colour: &[u8; 3]| {
        *known.entry(colour).or_insert_with(|| {
            let light = drawn(colour);
            let light = if REACH.has(light) { light } else { REACH.nearest(light).0 };
            std::array::from_fn(|c| black[c] + light[c] * (1.0 - black[c]))
        })
    };
    art.rgb.iter().map(light).collect()
}

/// The mean difference at .3 m between art at the dots and what is printed of it when it is read in pixels
/// of `coarse` dots.
fn figure(art: &Art, kind: ObjectType, coarse: usize) -> f64 {
    figure_by(Rules::USUAL, art, kind, coarse)
}

/// The same by these rules.
pub(super) fn figure_by(rules: Rules, art: &Art, kind: ObjectType, coarse: usize) -> f64 {
    let bodies = bodies();
    let dots = softened(art, coarse).dots_by(rules, kind, (art.width, art.height));
    let printed: Vec<Light> = dots.iter().map(|&dot| bodies[usize::from(dot)]).collect();
    let (asked, printed) = (seen(&asked(art), 0.3), seen(&printed, 0.3));
    asked.iter().zip(&printed).map(|(&a, &b)| difference(a, b)).sum::<f64>() / asked.len() as f64
}

/// The art in pixels of so many dots.
pub(super) fn softened(art: &Art, coarse: usize) -> Art {
    Art::new(art.width / coarse, art.height / coarse, |x, y| {
        std::array::from_fn(|c| {
            let all = (0..coarse * coarse).map(|at| (x * coarse + at % coarse, y * coarse + at / coarse));
            let sum: usize = all.map(|(x, y)| usize::from(art.rgb[y * art.width + x][c])).sum();
            ((sum + coarse * coarse / 2) / (coarse * coarse)) as u8
        })
    })
}

/// Letters as strokes between points of a square of 6 by 9: stems, bowls and slants.
const LETTERS: [&[(f64, f64)]; 8] = [
    &[(0.0, 0.0), (0.0, 9.0), (0.0, 5.0), (4.0, 5.0), (4.0, 9.0), (4.0, 0.0)],
    &[(0.0, 9.0), (0.0, 4.0), (1.0, 3.0), (3.0, 3.0), (4.0, 4.0), (4.0, 9.0)],
    &[
        (4.0, 6.0),
        (0.0, 6.0),
        (0.0, 4.0),
        (1.0, 3.0),
        (3.0, 3.0),
        (4.0, 4.0),
        (4.0, 6.0),
        (0.0, 6.0),
        (1.0, 9.0),
        (4.0, 9.0),
    ],
    &[(0.0, 3.0), (2.0, 9.0), (4.0, 3.0)],
    &[(2.0, 3.0), (4.0, 4.0), (4.0, 8.0), (2.0, 9.0), (0.0, 8.0), (0.0, 4.0), (2.0, 3.0)],
    &[(0.0, 9.0), (4.0, 3.0), (2.0, 6.0), (0.0, 3.0), (4.0, 9.0)],
    &[(0.0, 9.0), (2.0, 0.0), (4.0, 9.0), (3.2, 6.0), (0.8, 6.0)],
    &[(2.0, 0.0), (2.0, 9.0)],
];

/// Whether a place is on a stroke of so many dots between two points.
fn on(stroke: f64, a: (f64, f64), b: (f64, f64), (x, y): (f64, f64)) -> bool {
    let (way, off) = ((b.0 - a.0, b.1 - a.1), (x - a.0, y - a.1));
    let part = ((off.0 * way.0 + off.1 * way.1) / (way.0 * way.0 + way.1 * way.1)).clamp(0.0, 1.0);
    (off.0 - part * way.0).hypot(off.1 - part * way.1) <= stroke / 2.0
}

/// Lines of text of these sizes in points.
pub(super) fn text(sizes: &[f64], ink: [u8; 3], ground: [u8; 3]) -> Art {
    let mut art = Art::new(SIDE, SIDE, |_, _| ground);
    let mut top = 20.0;
    for (line, &points) in sizes.iter().enumerate() {
        // The strokes of ordinary letters are a twelfth as wide as their size.
        let (unit, stroke) = (points * 600.0 / 72.0 * 0.72 / 9.0, points * 600.0 / 72.0 / 12.0);
        let mut left = 20.0;
        for letter in (line..).map(|n| LETTERS[n % LETTERS.len()]) {
            if left + 6.0 * unit > SIDE as f64 - 20.0 {
                break;
            }
            let at = |(x, y): (f64, f64)| (left + x * unit, top + y * unit);
            for pair in letter.windows(2) {
                let (a, b) = (at(pair[0]), at(pair[1]));
                let range = |a: f64, b: f64| (a.min(b) - stroke) as usize..(a.max(b) + stroke) as usize;
                for (x, y) in range(a.1, b.1).flat_map(|y| range(a.0, b.0).map(move |x| (x, y))) {
                    if on(stroke, a, b, (x as f64 + 0.5, y as f64 + 0.5)) {
                        art.rgb[y * SIDE + x] = ink;
                    }
                }
            }
            left += 5.6 * unit;
        }
        top += 12.0 * unit;
    }
    art
}

pub(super) const SIZES: [f64; 5] = [5.0, 6.0, 8.0, 10.0, 14.0];

/// Lines of .1 to 1 mm, upright and slanting.
fn lines(ink: [u8; 3]) -> Art {
    let widths = [0.1, 0.2, 0.3, 0.5, 0.8, 1.0].map(|mm| mm * 600.0 / 25.4);
    Art::new(SIDE, SIDE, |x, y| {
        let (x, y) = (x as f64, y as f64);
        let is_on = |(n, &wide): (usize, &f64)| {
            let at = 20.0 + 40.0 * n as f64;
            (20.0..490.0).contains(&y) && (x - at - 0.12 * y).abs() * 0.993 < wide / 2.0
                || (300.0..490.0).contains(&x) && (y - at - 100.0).abs() < wide / 2.0
        };
        if widths.iter().enumerate().any(is_on) { ink } else { [255; 3] }
    })
}

/// A map: fields, contours, a river, roads with casings, and names.
pub(super) fn map() -> Art {
    let mut art = Art::new(SIDE, SIDE, |x, y| {
        let (x, y) = (x as f64, y as f64);
        let height = (x / 61.0).sin() + (y / 83.0 + x / 170.0).cos() + 0.3 * ((x + 2.0 * y) / 37.0).sin();
        let river = (y - 300.0 - 60.0 * (x / 90.0).sin()).abs();
        let road = (x - 200.0 - 50.0 * (y / 120.0).sin()).abs();
        // Contours of .1 mm, 2.4 dots.
        let slope = [
            (x / 61.0).cos() / 61.0 - (y / 83.0 + x / 170.0).sin() / 170.0
                + 0.3 * ((x + 2.0 * y) / 37.0).cos() / 37.0,
            0.6 * ((x + 2.0 * y) / 37.0).cos() / 37.0 - (y / 83.0 + x / 170.0).sin() / 83.0,
        ];
        let level = ((2.0 * height).rem_euclid(1.0) - 0.5).abs() / 2.0;
        let contour = level < 1.2 * slope[0].hypot(slope[1]);
        match () {
            () if road < 5.0 => [252, 214, 164],
            () if road < 8.0 => GREY,
            () if river < 6.0 => [120, 180, 220],
            () if contour => [140, 90, 50],
            () if height > 0.6 => [205, 230, 190],
            () if (320.0..380.0).contains(&x) && (40.0..110.0).contains(&y) => [240, 225, 200],
            () => [255; 3],
        }
    });
    let names = text(&[6.0, 8.0, 6.0], [40; 3], [255; 3]);
    art.rgb
        .iter_mut()
        .zip(names.rgb)
        .filter(|(_, name)| *name != [255; 3])
        .for_each(|(dot, name)| *dot = name);
    art
}

/// A window of a browser: a heading bar, panels in tints with text in several colours, buttons.
fn screenshot() -> Art {
    let inks = [[26, 79, 139], [230, 126, 34], [60; 3], [255; 3]];
    let grounds = [[255; 3], [245, 247, 250], [225, 235, 245], [60, 120, 190]];
    let mut art = Art::new(SIDE, SIDE, |_, y| grounds[y / 128]);
    for (number, (ink, ground)) in inks.into_iter().zip(grounds).enumerate() {
        let lines = text(&[12.0, 10.0, 9.0], ink, ground);
        let rows = 128 * number..128 * (number + 1);
        for (row, y) in rows.enumerate().skip(8).take(112) {
            let from = (row + 10) * SIDE;
            art.rgb[y * SIDE..(y + 1) * SIDE].copy_from_slice(&lines.rgb[from..from + SIDE]);
        }
    }
    art
}

/// Something like a photograph: light that falls off, soft things and hard ones, and a texture at all scales.
pub(super) fn photograph() -> Art {
    let noise = |x: f64, y: f64, seed: f64| {
        (0..6).map(move |octave| {
            let f = 0.008 * 2f64.powi(octave);
            let turn = 0.7 * f64::from(octave) + seed;
            let (u, v) = (x * turn.cos() + y * turn.sin(), y * turn.cos() - x * turn.sin());
            ((u * f + seed).sin() + (v * f * 1.3 + 2.0 * seed).sin()) / 2f64.powi(octave + 1)
        })
    };
    Art::new(SIDE, SIDE, |x, y| {
        let (x, y) = (x as f64, y as f64);
        let texture: f64 = noise(x, y, 1.0).sum();
        let hue: f64 = noise(x, y, 4.0).take(3).sum();
        let inside = (x - 180.0).hypot(y - 220.0) < 120.0;
        let light = (0.15 + 0.6 * (x + y) / 1024.0 + 0.2 * texture) * if inside { 0.45 } else { 1.0 };
        let rgb = [1.0 + 0.35 * hue, 1.0, 1.0 - 0.4 * hue];
        rgb.map(|v| (255.0 * light * v).clamp(0.0, 255.0) as u8)
    })
}

pub(super) const GREY: [u8; 3] = [128; 3];
const ORANGE: [u8; 3] = [230, 126, 34];
const PALE: [u8; 3] = [230; 3];

#[test]
fn an_eye_sees_what_was_asked() {
    let hard: [(&str, Art, f64); 9] = [
        ("grey text", text(&SIZES, GREY, [255; 3]), 1.0),
        ("orange text", text(&SIZES, ORANGE, [255; 3]), 1.0),
        ("pale text", text(&SIZES, PALE, [255; 3]), 1.0),
        ("dark text on a tint", text(&SIZES, [40; 3], [200, 225, 250]), 3.3),
        ("white text on orange", text(&SIZES, [255; 3], ORANGE), 2.5),
        ("white text on grey", text(&SIZES, [255; 3], GREY), 2.5),
        ("grey lines", lines(GREY), 1.0),
        ("brown lines", lines([140, 90, 50]), 1.0),
        ("map", map(), 1.5),
    ];
    for (name, art, most) in hard {
        let found = figure(&art, ObjectType::Drawing, 1);
        println!("{name}: {found:.2}");
        assert!(found <= most, "{name}: {found}");
    }
    for (coarse, most) in [(4, 4.6), (2, 3.6)] {
        for ink in [[0; 3], GREY, ORANGE] {
            let found = figure(&text(&SIZES, ink, [255; 3]), ObjectType::Drawing, coarse);
            println!("{ink:?} in pixels of {coarse}: {found:.2}");
            assert!(found <= most, "{ink:?} in pixels of {coarse} dots: {found}");
        }
    }
}

#[test]
fn an_eye_sees_pictures_as_they_were_asked_for() {
    let pictures = [
        ("map at 300 dpi", map(), ObjectType::Drawing, 2, 2.0),
        ("screenshot at 150 dpi", screenshot(), ObjectType::Picture, 4, 3.0),
        ("photograph at 300 dpi", photograph(), ObjectType::Picture, 2, 2.5),
    ];
    for (name, art, kind, coarse, most) in pictures {
        let found = figure(&art, kind, coarse);
        println!("{name}: {found:.2}");
        assert!(found <= most, "{name}: {found}");
    }
}

/// Ramps from white over a colour to black: how far the mean of a row is off.
#[test]
fn ramps_have_no_bands() {
    for end in [[0; 3], ORANGE, [0, 90, 160], [160, 60, 90]] {
        let art = Art::new(SIDE, SIDE, |_, y| {
            let part = y as f64 / SIDE as f64;
            end.map(|v: u8| match part < 0.5 {
                true => 255.0 - 2.0 * part * (255.0 - f64::from(v)),
                false => 2.0 * (1.0 - part) * f64::from(v),
            } as u8)
        });
        let bodies = bodies();
        let dots = art.dots(ObjectType::Picture, (SIDE, SIDE));
        let printed: Vec<Light> = dots.iter().map(|&dot| bodies[usize::from(dot)]).collect();
        let (asked, printed) = (seen(&asked(&art), 0.3), seen(&printed, 0.3));
        let mean = |lab: &[Light], y: usize| -> Light {
            std::array::from_fn(|c| {
                lab[y * SIDE..(y + 1) * SIDE].iter().map(|lab| lab[c]).sum::<f64>() / SIDE as f64
            })
        };
        // The seam where the page repeats is none of the ramp.
        let rows = 40..SIDE - 40;
        let off: f64 = rows.clone().map(|y| difference(mean(&asked, y), mean(&printed, y))).sum();
        let off = off / rows.len() as f64;
        println!("ramp to {end:?}: {off:.2}");
        assert!(off <= 1.3, "{end:?}: {off}");
    }
}

#[test]
fn soft_text_has_the_dots_that_were_drawn() {
    let art = text(&[8.0, 12.0, 8.0, 12.0], [0; 3], [255; 3]);
    let ink = art.rgb.iter().filter(|rgb| **rgb == [0; 3]).count();
    for (coarse, most) in [(1, 0.0), (2, 0.05), (4, 0.12)] {
        let dots = softened(&art, coarse).dots(ObjectType::Drawing, (SIDE, SIDE));
        let wrong = art.rgb.iter().zip(&dots).filter(|(rgb, dot)| (**rgb == [0; 3]) != (**dot == stack("K")));
        let wrong = wrong.count() as f64 / ink as f64;
        println!("pixels of {coarse}: {wrong:.3}");
        assert!(wrong <= most, "{wrong} of the dots in pixels of {coarse}");
    }
}

#[test]
fn tints_are_even_and_their_dots_hang_together() {
    let tints = [
        [128; 3],
        [200; 3],
        PALE,
        [64; 3],
        ORANGE,
        [120, 180, 230],
        [60, 90, 160],
        [150, 200, 120],
        [230, 180, 200],
        [160, 60, 90],
        [250, 240, 180],
        [100, 70, 120],
    ];
    let bodies = bodies();
    let (mut grain, mut lone) = ([0.0; 2], Vec::new());
    for tint in tints {
        let dots = Art::new(SIDE, SIDE, |_, _| tint).dots(ObjectType::Drawing, (SIDE, SIDE));
        let printed: Vec<Light> = dots.iter().map(|&dot| bodies[usize::from(dot)]).collect();
        for (grain, metres) in grain.iter_mut().zip([0.3, 0.5]) {
            let seen = seen(&printed, metres);
            let mean = seen.iter().map(|lab| lab[0]).sum::<f64>() / seen.len() as f64;
            let squares = seen.iter().map(|lab| (lab[0] - mean).powi(2)).sum::<f64>();
            *grain += (squares / seen.len() as f64).sqrt() / tints.len() as f64;
        }
        for ink in ["C", "M", "Y", "K"] {
            let has: Vec<bool> = INKS.0.stacks.iter().map(|stack| stack.to_string().contains(ink)).collect();
            let inked: Vec<bool> = dots.iter().map(|&dot| has[usize::from(dot)]).collect();
            let count = inked.iter().filter(|&&inked| inked).count();
            // Dots beyond the border are those of the other side.
            let at = |x: usize, y: usize| inked[y % SIDE * SIDE + x % SIDE];
            let alone = |at_dot: &usize| {
                let (x, y) = (at_dot % SIDE + SIDE, at_dot / SIDE + SIDE);
                at(x, y) && ![at(x + 1, y), at(x - 1, y), at(x, y + 1), at(x, y - 1)].contains(&true)
            };
            let alone = (0..dots.len()).filter(alone).count();
            if 10 * count > dots.len() {
                println!("{tint:?}: {alone} dots of {count} in {ink} lie alone");
                lone.push(alone as f64 / count as f64);
            }
        }
    }
    let lone = lone.iter().sum::<f64>() / lone.len() as f64;
    println!("lone dots {lone:.3}, grain {grain:?}");
    assert!(lone <= 0.05, "{lone} of the dots lie alone");
    assert!(grain[0] <= 1.5 && grain[1] <= 0.6, "{grain:?}");
}

/// The shares of the stacks of a word and of a panel in one colour.
#[test]
fn a_word_and_a_panel_of_one_colour_are_printed_alike() {
    for colour in [GREY, ORANGE, PALE, [120, 180, 230]] {
        let word = text(&SIZES, colour, [255; 3]);
        let panel = Art::new(SIDE, SIDE, |_, _| colour);
        let shares = |art: &Art| {
            let dots = art.dots(ObjectType::Drawing, (SIDE, SIDE));
            let mut counts = [0.0; 16];
            let own = art.rgb.iter().zip(dots).filter(|(rgb, _)| **rgb == colour);
            own.for_each(|(_, dot)| counts[usize::from(dot)] += 1.0);
            let sum: f64 = counts.iter().sum();
            counts.map(|count| count / sum)
        };
        let (word, panel) = (shares(&word), shares(&panel));
        for q in 0..16 {
            assert!((word[q] - panel[q]).abs() < 0.05, "{colour:?}: {word:?} and {panel:?}");
        }
    }
}

/// The eye again, as NumPy has it.
const IN_NUMPY: &str = r"
import sys, numpy as np
light = np.fromfile(sys.argv[1]).reshape(512, 512, 3)
xyz = np.array([[.4124564, .3575761, .1804375], [.2126729, .7151522, .0721750], [.0193339, .1191920, .9503041]])
opponent = np.array([[.279, .72, -.107], [-.449, .29, -.077], [.086, -.59, .501]])
filters = [[(.921, .0283), (.105, .133), (-.108, 4.336)], [(.531, .0392), (.330, .494)], [(.488, .0536), (.371, .386)]]
f = np.fft.fftfreq(512) * (2 * .3 * np.tan(np.radians(.5)) / .0254 * 600)
f = np.hypot(f[:, None], f)
seen = light @ xyz.T @ opponent.T
for c, parts in enumerate(filters):
    gain = sum(w * np.exp(-(np.pi * s * f) ** 2) for w, s in parts) / sum(w for w, s in parts)
    seen[..., c] = np.fft.ifft2(np.fft.fft2(seen[..., c]) * gain).real
t = seen @ np.linalg.inv(opponent).T / xyz.sum(1)
t = np.where(t > 216 / 24389, np.cbrt(t), (24389 / 27 * t + 16) / 116)
lab = np.stack([116 * t[..., 1] - 16, 500 * (t[..., 0] - t[..., 1]), 200 * (t[..., 1] - t[..., 2])], -1)
lab.tofile(sys.argv[2])
";

#[test]
fn an_eye_in_numpy_sees_the_same() {
    if !testing::needs::numpy() {
        return;
    }
    let bodies = bodies();
    let dots = text(&SIZES, ORANGE, [200, 225, 250]).dots(ObjectType::Drawing, (SIDE, SIDE));
    let light: Vec<Light> = dots.iter().map(|&dot| bodies[usize::from(dot)]).collect();
    let folder = tempfile::tempdir().unwrap();
    let [given, found] = ["light", "lab"].map(|name| folder.path().join(name));
    let bytes: Vec<u8> = light.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
    std::fs::write(&given, bytes).unwrap();
    let mut python = std::process::Command::new("python3");
    assert!(python.args(["-c", IN_NUMPY]).args([&given, &found]).status().unwrap().success());
    let found = std::fs::read(found).unwrap();
    let found = found.as_chunks::<8>().0.iter().map(|&v| f64::from_le_bytes(v));
    let ours = seen(&light, 0.3);
    assert_eq!(found.len(), ours.as_flattened().len());
    for (ours, found) in ours.as_flattened().iter().zip(found) {
        assert!((ours - found).abs() < 1e-6, "{ours} and {found}");
    }
}

/// What is left of a grating is what its frequency has.
#[test]
fn a_grating_is_filtered_by_its_frequency() {
    for (across, down) in [(32, 0), (0, 20), (12, 31)] {
        let turn = |at: usize| {
            std::f64::consts::TAU * (across * (at % SIDE) + down * (at / SIDE)) as f64 / SIDE as f64
        };
        let gain = |f: f64| (-10.0 * f).exp();
        let found = filtered((0..SIDE * SIDE).map(|at| Complex::from(turn(at).cos())).collect(), gain);
        let left = gain((across as f64).hypot(down as f64) / SIDE as f64);
        for (at, found) in found.into_iter().enumerate() {
            assert!((found - left * turn(at).cos()).abs() < 1e-9, "{across}, {down}: {found} at {at}");
        }
    }
}
