//! Colours out of the inks' reach: what is printed in their place.
//!
//! Problem: sRGB has colours that four inks do not. Each taken to the nearest printable one by itself, a
//! saturated area becomes a flat patch.
//! Method: red, green and blue are relative to paper and black, so black, white and all greys are
//! printable. What mixtures of stacks reach is the convex hull of their colours in linear light. Both
//! intents work in Oklab and keep the hue. [`Intent::Colorimetric`] keeps printable colours and takes
//! others to the nearest printable colour of their hue. [`Intent::Perceptual`] moves every colour along the
//! ray from a grey, a middle one for saturated colours and one nearly as light as the colour for what is
//! nearly grey: pale colours stay pale. Up to [`KNEE`] of the way to the hull nothing changes; from there
//! to the surface of sRGB, a hyperbola brings it to the surface of the hull. It starts with slope 1 and
//! never becomes level, so what differs in the picture differs in print.
//! Cost: 30 microseconds a colour; it is done for the nodes of a lattice. Limits: four stacks or more in
//! general position, otherwise colours stay as they are and the fit decides.
//! Source: B. Ottosson, A perceptual color space for image processing (2020), through `palette`; J.
//! Morovic, Color Gamut Mapping (2008), for the two families.

use maths::Maths;
use palette::convert::FromColorUnclamped;
use palette::{LinSrgb, Oklab};
use serde::Serialize;

/// How colours that cannot be printed are replaced.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Intent {
    /// Perceptual for pictures, colorimetric for text and drawings; tints of the six primaries keep their
    /// inks there.
    #[default]
    Auto,
    /// Smoothly: saturated colours move closer together, and none become equal.
    Perceptual,
    /// Printable colours are kept, and others become the nearest printable colour of the same hue.
    Colorimetric,
}

/// Lightness of the grey that rays to saturated colours start from.
const MIDDLE: f64 = 0.6;
/// How far from that to the lightness of the colour itself the grey of colours that are nearly grey is.
/// With all of it pale skies would be grey.
const AS_LIGHT: f64 = 0.8;
/// The chroma at which it is half as far.
const SATURATED: f64 = 0.15;
/// Part of the way to the hull on which the perceptual intent changes nothing.
/// Source: at .7, .85, .9 and .95 a screenshot differs by 3.2, 2.9, 2.8 and 2.8; the farther, the less is
/// left for what lies beyond.
const KNEE: f64 = 0.9;
/// Steps of lightness in which the nearest printable colour is looked for, and how often they and those of
/// chroma are halved then: far below what an eye sees.
const TRIED: u32 = 32;
const HALVED: usize = 14;

/// A colour in linear light; 0 is black, 1 is paper.
pub(crate) type Light = [f64; 3];

/// The luminance of a colour: that of sRGB (IEC 61966-2-1).
pub(crate) fn luminance([r, g, b]: Light) -> f64 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

/// What mixtures of stacks can reach.
pub(crate) struct Hull {
    /// Half spaces: normal and distance. Inside, `normal . colour <= distance`.
    faces: Vec<(Light, f64)>,
}

pub(crate) fn dot(a: Light, b: Light) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn minus(a: Light, b: Light) -> Light {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub(crate) fn cross(a: Light, b: Light) -> Light {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

impl Hull {
    /// The convex hull of colours: every plane through three of them that has all on one side.
    pub fn new(points: &[Light]) -> Hull {
        /// Lengths below this are rounding: coordinates are about 1.
        const NEAR: f64 = 1e-9;
        let mut faces: Vec<(Light, f64)> = Vec::new();
        for (i, &a) in points.iter().enumerate() {
            for (j, &b) in points.iter().enumerate().skip(i + 1) {
                for &c in &points[j + 1..] {
                    let normal = cross(minus(b, a), minus(c, a));
                    let length = dot(normal, normal).sqrt();
                    if length < NEAR {
                        continue;
                    }
                    let normal = normal.map(|v| v / length);
                    let off = |p: &Light| dot(normal, minus(*p, a));
                    let (least, most) =
                        points.iter().map(off).fold((0.0f64, 0.0f64), |(l, m), v| (l.min(v), m.max(v)));
                    if most <= NEAR && least < -NEAR {
                        faces.push((normal, dot(normal, a)));
                    } else if least >= -NEAR && most > NEAR {
                        faces.push((normal.map(|v| -v), -dot(normal, a)));
                    }
                }
            }
        }
        Hull { faces }
    }

    /// Whether the colours span no volume, so that nothing is inside.
    pub fn is_flat(&self) -> bool {
        self.faces.is_empty()
    }

    /// Whether a colour is inside, or outside by less than rounding.
    pub fn has(&self, colour: Light) -> bool {
        self.faces.iter().all(|&(normal, distance)| dot(normal, colour) <= distance + 1e-6)
    }

    /// The colour that is printed for a colour of sRGB. `intent` is not [`Intent::Auto`].
    pub fn map(&self, colour: Light, intent: Intent) -> Light {
        let [r, g, b] = colour;
        match intent {
            // Greys are mixtures of black and paper; rounding must not tint white.
            _ if self.is_flat() || r == g && g == b => colour,
            Intent::Colorimetric => self.nearest(colour),
            Intent::Auto | Intent::Perceptual => self.compressed(colour),
        }
    }

    fn compressed(&self, colour: Light) -> Light {
        let to = oklab(colour);
        let saturation = to[1].hypotenuse(to[2]) / SATURATED;
        let grey = MIDDLE + AS_LIGHT * (to[0] - MIDDLE) / (1.0 + saturation * saturation);
        let ray = Ray { from: [grey, 0.0, 0.0], to };
        if ray.length() < 1e-6 {
            return colour;
        }
        // In parts of the way from the middle to the colour.
        let srgb = |colour: Light| colour.iter().all(|v| (-1e-6..=1.0 + 1e-6).contains(v));
        // A straight way to a deep blue leaves sRGB before it comes back to that blue.
        let (source, target) = (ray.leaves(srgb).max(1.0), ray.leaves(|colour| self.has(colour)));
        let knee = KNEE * target;
        if source <= target || knee >= 1.0 {
            return colour;
        }
        let (beyond, room) = (source - knee, target - knee);
        let at = 1.0 - knee;
        ray.at(knee + at / (1.0 + at * (1.0 / room - 1.0 / beyond)))
    }

    /// The printable colour of the same hue that is nearest in Oklab: of each lightness the one whose
    /// chroma is nearest, and of these the nearest. So corners and edges of the hull are found like its
    /// faces.
    fn nearest(&self, colour: Light) -> Light {
        if self.has(colour) {
            return colour;
        }
        let [lightness, a, b] = oklab(colour);
        let chroma = a.hypotenuse(b);
        let way = [a, b].map(|v| if chroma > 0.0 { v / chroma } else { 0.0 });
        // The nearest of a lightness, and how far it is.
        let nearest_of = |l: f64| {
            let at = |c: f64| linear([l, c * way[0], c * way[1]]);
            let mut inside = (0.0, chroma);
            if self.has(at(chroma)) {
                inside.0 = chroma;
            } else {
                for _ in 0..HALVED {
                    let middle = (inside.0 + inside.1) / 2.0;
                    if self.has(at(middle)) { inside.0 = middle } else { inside.1 = middle }
                }
            }
            ((l - lightness).hypotenuse(inside.0 - chroma), at(inside.0))
        };
        let mut best = (f64::INFINITY, lightness, colour);
        let look = |best: &mut (f64, f64, Light), l: f64| {
            let l = l.clamp(0.0, 1.0);
            if (l - lightness).abs() < best.0 {
                let (away, found) = nearest_of(l);
                *best = if away < best.0 { (away, l, found) } else { *best };
            }
        };
        let mut step = 1.0 / f64::from(TRIED);
        // What is nearest is tried first: it spares most others.
        for n in 0..TRIED {
            let off = f64::from(n) * step;
            [lightness - off, lightness + off].into_iter().for_each(|l| look(&mut best, l));
        }
        for _ in 0..HALVED {
            step /= 2.0;
            let from = best.1;
            [from - step, from + step].into_iter().for_each(|l| look(&mut best, l));
        }
        best.2
    }
}

/// A ray in Oklab, from one colour to another and beyond.
struct Ray {
    from: [f64; 3],
    to: [f64; 3],
}

impl Ray {
    fn length(&self) -> f64 {
        let way = minus(self.to, self.from);
        dot(way, way).sqrt()
    }

    fn at(&self, part: f64) -> Light {
        linear(std::array::from_fn(|i| self.from[i] + part * (self.to[i] - self.from[i])))
    }

    /// Where the ray first leaves a set, in parts of the way from one colour to the other; at most 4. The
    /// start is inside.
    fn leaves(&self, inside: impl Fn(Light) -> bool) -> f64 {
        const STEP: f64 = 1.0 / 16.0;
        let first = (1..=64).map(|i| f64::from(i) * STEP).find(|&part| !inside(self.at(part)));
        let Some(outside) = first else { return 4.0 };
        let (mut low, mut high) = (outside - STEP, outside);
        for _ in 0..24 {
            let middle = (low + high) / 2.0;
            if inside(self.at(middle)) { low = middle } else { high = middle }
        }
        low
    }
}

/// A colour in Oklab.
pub(crate) fn oklab(light: Light) -> [f64; 3] {
    let lab = Oklab::<f64>::from_color_unclamped(LinSrgb::new(light[0], light[1], light[2]));
    [lab.l, lab.a, lab.b]
}

/// The light of a colour in Oklab.
fn linear([l, a, b]: [f64; 3]) -> Light {
    let light = LinSrgb::<f64>::from_color_unclamped(Oklab::new(l, a, b));
    [light.red, light.green, light.blue]
}

/// The distance of two colours in Oklab; 0.02 is barely visible.
pub(crate) fn difference(a: Light, b: Light) -> f64 {
    let way = minus(oklab(a), oklab(b));
    dot(way, way).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Paper, black, three inks and what two of them make, as printed ones are: darker and duller than sRGB.
    const STACKS: [Light; 8] = [
        [1.0, 1.0, 1.0],
        [0.0, 0.0, 0.0],
        [0.0, 0.33, 0.75],
        [0.78, 0.0, 0.19],
        [0.95, 0.83, 0.0],
        [0.0, 0.0, 0.14],
        [0.0, 0.28, 0.0],
        [0.78, 0.0, 0.0],
    ];

    fn mixture(weights: [f64; 8]) -> Light {
        let sum: f64 = weights.iter().sum();
        std::array::from_fn(|c| weights.iter().zip(STACKS).map(|(w, stack)| w * stack[c]).sum::<f64>() / sum)
    }

    #[test]
    fn greys_stay_where_they_are() {
        let hull = Hull::new(&STACKS);
        for i in 0..=32 {
            let grey = [f64::from(i) / 32.0; 3];
            for intent in [Intent::Perceptual, Intent::Colorimetric] {
                assert!(difference(hull.map(grey, intent), grey) < 1e-3, "{grey:?}, {intent:?}");
            }
        }
    }

    #[test]
    fn blues_whose_ray_leaves_srgb_before_them_are_printable_and_stay_apart() {
        let hull = Hull::new(&STACKS);
        let mut last = 0.0;
        for blue in (8..=255).step_by(4) {
            let printed = hull.map([0.0, 0.0, f64::from(blue) / 255.0], Intent::Perceptual);
            assert!(hull.has(printed.map(|v| v * 0.999 + 0.0003)), "{blue} becomes {printed:?}");
            let lightness = oklab(printed)[0];
            assert!(lightness > last, "{blue} becomes {printed:?}");
            last = lightness;
        }
    }

    #[test]
    fn inks_on_a_line_have_no_inside_and_change_nothing() {
        let hull = Hull::new(&[[0.0; 3], [1.0; 3], [0.5; 3]]);
        assert!(hull.is_flat());
        assert_eq!(hull.map([1.0, 0.0, 0.0], Intent::Perceptual), [1.0, 0.0, 0.0]);
    }

    #[test]
    fn ramps_of_saturation_have_no_flat_patch_and_no_step() {
        let hull = Hull::new(&STACKS);
        for hue in 0..24 {
            let angle = f64::from(hue) * std::f64::consts::TAU / 24.0;
            for lightness in [0.35, 0.5, 0.7, 0.85] {
                let light = |chroma: f64| {
                    let lab = Oklab::new(lightness, chroma * angle.cos(), chroma * angle.sin());
                    let rgb = LinSrgb::<f64>::from_color_unclamped(lab);
                    [rgb.red, rgb.green, rgb.blue]
                };
                let inside = |c: &Light| c.iter().all(|v| (0.0..=1.0).contains(v));
                let ramp: Vec<Light> =
                    (0..).map(|i| light(f64::from(i) * 0.005)).take_while(inside).collect();
                let printed: Vec<Light> = ramp.iter().map(|&c| hull.map(c, Intent::Perceptual)).collect();
                // The picture's steps are 0.005.
                for pair in printed.windows(2) {
                    let step = difference(pair[0], pair[1]);
                    assert!(step > 0.0004 && step < 0.015, "hue {hue}, lightness {lightness}: {step}");
                }
            }
        }
    }

    proptest! {
        #[test]
        fn a_hull_has_its_mixtures_and_nothing_else(weights: [u8; 8], beyond in 1.01f64..3.0) {
            let hull = Hull::new(&STACKS);
            let weights = weights.map(|w| f64::from(w) + 0.01);
            let inside = mixture(weights);
            prop_assert!(hull.has(inside));
            // From the inside through a corner and out.
            for corner in STACKS {
                let out = std::array::from_fn(|c| inside[c] + beyond * (corner[c] - inside[c]));
                prop_assert!(!hull.has(out), "{:?}", out);
            }
        }

        #[test]
        fn what_is_printed_is_printable_and_printable_colours_are_kept(rgb: [u8; 3], weights: [u8; 8]) {
            let hull = Hull::new(&STACKS);
            let colour = rgb.map(|v| f64::from(v) / 255.0);
            for intent in [Intent::Perceptual, Intent::Colorimetric] {
                let printed = hull.map(colour, intent);
                prop_assert!(hull.has(printed.map(|v| v * 0.999 + 0.0003)), "{:?} becomes {:?}", colour, printed);
                // Same hue; where there is little colour, hue has no meaning.
                let ([_, a, b], [_, c, d]) = (oklab(colour), oklab(printed));
                prop_assert!((a * d - b * c).abs() < 1e-4 && a * c + b * d > -1e-4);
            }
            let printable = mixture(weights.map(|w| f64::from(w) + 0.01));
            prop_assert_eq!(hull.map(printable, Intent::Colorimetric), printable);
        }

        #[test]
        fn no_other_printable_colour_of_the_hue_is_much_nearer(rgb: [u8; 3], lightness in 0.0f64..1.0, part in 0.0f64..1.0) {
            let hull = Hull::new(&STACKS);
            let colour = rgb.map(|v| f64::from(v) / 255.0);
            let printed = hull.map(colour, Intent::Colorimetric);
            let ray = Ray { from: [lightness, 0.0, 0.0], to: oklab(colour) };
            let other = ray.at(part);
            if hull.has(other) {
                prop_assert!(difference(printed, colour) < difference(other, colour) + 0.002);
            }
        }
    }
}
