//! Optical dot gain: the light that is lost between dots inside the paper.
//!
//! Problem: light enters the paper beside a dot and leaves it below one, so a halftone is darker than its dots' areas say.
//! Method: the Yule-Nielsen model, on diffuse light alone, since what a surface reflects never enters the paper. Each curve is a flat body
//! and its gloss ([`Nearest`]). Over a neighbourhood, the diffuse reflectance of a mixture is `(sum w_k d_k^(1/n))^n` instead of
//! `sum w_k d_k`, which is Murray-Davies (n = 1) and what the renderer sums otherwise. Every place is darkened by the ratio of the two, both
//! averaged with a Gaussian of [`SPREAD`] around it. The renderer stays linear: three flat curves, one a channel, take away what is lost.
//! Cost: three channels blurred once. Limits: a model with one number, which nobody has measured on this printer's papers and inks. It
//! knows neither how far light really spreads nor that inks above metal hide the paper. Edges of the document are averaged as dots are.
//! Source: J. Yule, W. Nielsen, The penetration of light into paper and its effect on halftone reproduction, TAGA 1951;
//! channel by channel of linear Rec. 709 instead of by wavelength.

use std::f64::consts::PI;
use std::ops::RangeInclusive;

use appearance::brdf::Space;
use appearance::materials::Nearest;
use inks::Curve;
use rayon::prelude::*;

use crate::lit::{LANES, Level, Lit, pyramid};

/// The numbers n of the model: 1 is no gain; 2 would be light that spreads evenly, and more is found where dots have soft edges.
pub const DOT_GAIN: RangeInclusive<f64> = 1.0..=10.0;

/// Standard deviation of the neighbourhood in metres: some cells of the halftone.
const SPREAD: f64 = 0.000_25;

/// Places on the longer side of a sheet of this size (metres) whose neighbourhoods are still resolved.
pub fn places_for_dot_gain(size: [f64; 2]) -> usize {
    (size[0].max(size[1]) / SPREAD).ceil() as usize
}

impl Lit {
    /// The same with optical dot gain of this n, within [`DOT_GAIN`]. `space` is that of the curves. Maps should have
    /// [`places_for_dot_gain`] or more.
    #[must_use]
    pub fn with_dot_gain(mut self, space: &Space, n: f64) -> Lit {
        let n = n.clamp(*DOT_GAIN.start(), *DOT_GAIN.end());
        if n == 1.0 || self.levels.is_empty() {
            return self;
        }
        let flat = |curve: &Curve| {
            let row = space.row(curve);
            body(&Nearest::to(space, &row), &row)
        };
        let bodies: Vec<[f64; 3]> = self.curves.par_iter().map(flat).collect();
        let first = self.levels.swap_remove(0);
        let (width, height) = (first.width, first.height);
        let linear = channels(&first, self.stride, &bodies);
        let roots: Vec<[f64; 3]> = bodies.iter().map(|d| d.map(|d| d.powf(n.recip()))).collect();
        let sigma = [SPREAD * width as f64 / self.size[0], SPREAD * height as f64 / self.size[1]];
        let around = blurred(&linear, width, height, sigma);
        let roots = blurred(&channels(&first, self.stride, &roots), width, height, sigma);
        let stride = (self.curves.len() + 3).next_multiple_of(LANES);
        let mut weights = vec![0.0; width * height * stride];
        let known = self.curves.len();
        weights.par_chunks_exact_mut(stride).enumerate().for_each(|(i, out)| {
            out[..known].copy_from_slice(&first.weights[i * self.stride..][..known]);
            for c in 0..3 {
                let spread = f64::from(roots[i][c]).powf(n);
                let ratio =
                    if around[i][c] > 0.0 { (spread / f64::from(around[i][c])).min(1.0) } else { 1.0 };
                out[known + c] = linear[i][c] * (ratio as f32 - 1.0);
            }
        });
        for c in 0..3 {
            let flat = std::array::from_fn(|channel| f64::from(u8::from(channel == c)));
            self.curves.push(Curve::sampled(space.angles(), |_| flat));
        }
        self.bodies = bodies.iter().map(|body| body.map(|d| d as f32)).collect();
        self.stride = stride;
        self.levels = pyramid(Level { width, height, weights }, stride);
        self
    }
}

/// The flat body of a row, in 1/sr: never more than the row has anywhere.
pub(crate) fn body(found: &Nearest, row: &[f64]) -> [f64; 3] {
    std::array::from_fn(|c| {
        let least = row.iter().skip(c).step_by(3).copied().fold(f64::INFINITY, f64::min);
        (found.diffuse[c] / PI).min(least).max(0.0)
    })
}

/// At every place the sum of these values of the curves, by their weights.
fn channels(level: &Level, stride: usize, values: &[[f64; 3]]) -> Vec<[f32; 3]> {
    let mixed = |weights: &[f32]| {
        let mut sum = [0.0; 3];
        for (&w, value) in weights.iter().zip(values).filter(|(w, _)| **w != 0.0) {
            (0..3).for_each(|c| sum[c] += f64::from(w) * value[c]);
        }
        sum.map(|v| v as f32)
    };
    level.weights.par_chunks_exact(stride).map(mixed).collect()
}

/// A Gaussian mean with these standard deviations in places, of what lies within the map.
fn blurred(values: &[[f32; 3]], width: usize, height: usize, sigma: [f64; 2]) -> Vec<[f32; 3]> {
    let lines = |values: &[[f32; 3]], length: usize, sigma: f64| -> Vec<[f32; 3]> {
        let reach = (3.0 * sigma).ceil() as usize;
        let kernel: Vec<f32> =
            (0..=reach).map(|i| (-0.5 * (i as f64 / sigma.max(1e-9)).powi(2)).exp() as f32).collect();
        let line = |line: &[[f32; 3]]| {
            let at = |x: usize| {
                let (mut sum, mut whole) = ([0.0; 3], 0.0);
                for from in x.saturating_sub(reach)..(x + reach + 1).min(length) {
                    let part = kernel[from.abs_diff(x)];
                    whole += part;
                    (0..3).for_each(|c| sum[c] += part * line[from][c]);
                }
                sum.map(|v| v / whole)
            };
            (0..length).map(at).collect::<Vec<_>>()
        };
        values.par_chunks_exact(length).flat_map_iter(line).collect()
    };
    let turned = |values: &[[f32; 3]], width: usize| -> Vec<[f32; 3]> {
        let height = values.len() / width;
        (0..values.len()).map(|i| values[i % height * width + i / height]).collect()
    };
    let across = lines(values, width, sigma[0]);
    turned(&lines(&turned(&across, width), height, sigma[1]), height)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::Renderer;
    use crate::scene::{Camera, Light, Pose, Scene, direction};
    use appearance::brdf::Table;
    use appearance::factor::Factored;
    use appearance::weights::{ONE, WeightMaps};
    use observe::Silent;
    use press::preview::Source;

    const SIZE: [f64; 2] = [0.02, 0.02];
    const SIDE: usize = 256;
    const BODIES: [[f64; 3]; 2] = [[0.8, 0.7, 0.5], [0.04, 0.2, 0.5]];
    const F0: [f64; 2] = [0.03, 0.6];

    /// Two varnished bodies, the second on so many of four places of a fine pattern.
    fn halftone(of_four: usize) -> (Space, Lit) {
        let space = Space::half_angle(64);
        let mut bases = Table::new(space.columns());
        for (body, f0) in BODIES.iter().zip(F0) {
            bases.push(&space.row(&Curve::sampled(space.angles(), |t| {
                body.map(|d| d / PI + f0 * inks::ggx::lobe(t, 0.2))
            })));
        }
        let data = (0..SIDE * SIDE).flat_map(|i| {
            let on = [[0, 2], [3, 1]][i / SIDE % 2][i % 2] < of_four;
            if on { [0, ONE] } else { [ONE, 0] }
        });
        let maps = WeightMaps::new(SIDE, SIDE, 2, data.collect()).unwrap();
        let factored = Factored { space: space.clone(), bases, maps };
        let lit = Lit::new(&Source::Factored(&factored), SIZE, SIDE).unwrap();
        (space, lit)
    }

    /// The mean radiance of the middle of the sheet under a far light.
    fn seen(lit: &Lit, azimuth: f64) -> [f64; 3] {
        let scene = Scene {
            camera: Camera { towards: [0.0, 0.0, 1.0], distance: None, middle: [0.0; 2], height: 0.01 },
            pose: Pose::default(),
            lights: vec![Light::Far(direction(azimuth, 0.0))],
            probe: None,
        };
        let picture = Renderer::new(lit).render(&scene, 64, 64, &Silent).unwrap();
        let sum = |c: usize| picture.pixels.iter().map(|p| f64::from(p[c])).sum::<f64>();
        std::array::from_fn(|c| sum(c) / picture.pixels.len() as f64)
    }

    #[test]
    fn a_halftone_reflects_what_yule_and_nielsen_say_and_its_gloss_stays() {
        for of_four in 0..=4 {
            let a = of_four as f64 / 4.0;
            for n in [1.0, 1.4, 2.0, 4.0] {
                let (space, lit) = halftone(of_four);
                let lit = lit.with_dot_gain(&space, n);
                // In the highlight and beside it: gloss is added by area at both.
                for azimuth in [8.0f64, 60.0] {
                    let (cos, half) = (azimuth.to_radians().cos(), 0.5 * azimuth.to_radians());
                    let gloss = ((1.0 - a) * F0[0] + a * F0[1]) * inks::ggx::lobe(half, 0.2);
                    let found = seen(&lit, azimuth);
                    for c in 0..3 {
                        let root = |body: [f64; 3]| body[c].powf(n.recip());
                        let body = ((1.0 - a) * root(BODIES[0]) + a * root(BODIES[1])).powf(n);
                        let expected = cos * (body / PI + gloss);
                        assert!(
                            (found[c] / expected - 1.0).abs() < 0.01,
                            "a {a}, n {n}, {azimuth}: {found:?}[{c}], not {expected}"
                        );
                    }
                }
            }
        }
    }

    /// Dots that are looked at one by one lose together what their mean loses.
    #[test]
    fn single_dots_darken_as_their_mean() {
        use sheet::{Area, DotMap};
        let space = Space::half_angle(64);
        let mut stacks = Table::new(space.columns());
        for body in BODIES {
            stacks.push(&space.row(&Curve::sampled(space.angles(), |_| body.map(|d| d / PI))));
        }
        let names = ["substrate", "C"].map(|stack| stack.parse::<inks::Stack>().unwrap());
        let index = (0..SIDE * SIDE).map(|i| u8::from((i % SIDE + i / SIDE).is_multiple_of(2))).collect();
        let dots = DotMap::new(SIDE, SIDE, names.to_vec(), index).unwrap();
        let source = Source::Print { dots: &dots, space: &space, stacks: &stacks, area: Area::whole(&dots) };
        let mut lit = Lit::new(&source, SIZE, SIDE).unwrap().with_dot_gain(&space, 2.0);
        let sharp = seen(&lit, 40.0);
        lit.dots = None;
        let mean = seen(&lit, 40.0);
        for c in 0..3 {
            let root = 0.5 * (BODIES[0][c].sqrt() + BODIES[1][c].sqrt());
            let expected = 40f64.to_radians().cos() * root * root / PI;
            assert!((sharp[c] / expected - 1.0).abs() < 0.01, "{sharp:?}[{c}], not {expected}");
            assert!((sharp[c] / mean[c] - 1.0).abs() < 0.01, "{sharp:?}, not {mean:?}");
        }
    }

    #[test]
    fn no_gain_is_what_was_there_and_more_is_darker_never_black() {
        let (space, plain) = halftone(2);
        let before = seen(&plain, 40.0);
        let (_, lit) = halftone(2);
        assert_eq!(seen(&lit.with_dot_gain(&space, 1.0), 40.0), before);
        let mut last = before;
        for n in [1.2, 2.0, 5.0, 10.0] {
            let (_, lit) = halftone(2);
            let lit = lit.with_dot_gain(&space, n);
            let now = seen(&lit, 40.0);
            // The blue bodies are alike: the third channel has nothing to lose.
            assert!(
                now[0] < last[0] && now[1] < last[1] && (now[2] / before[2] - 1.0).abs() < 1e-3,
                "n {n}: {now:?}"
            );
            assert!(now[0] > 0.0);
            last = now;
            let known = lit.curves.len() - 3;
            for place in lit.levels[0].weights.chunks_exact(lit.stride) {
                // No place loses more than its body has.
                for c in 0..3 {
                    let body: f64 = (0..known).map(|k| f64::from(place[k]) * BODIES[k][c] / PI).sum();
                    assert!(f64::from(place[known + c]) <= 0.0 && body + f64::from(place[known + c]) > 0.0);
                }
            }
        }
    }
}
