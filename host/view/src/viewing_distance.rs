//! What an eye sees of a picture from a distance.
//!
//! Problem: a picture on a screen shows dots that nobody sees on the sheet, and hides what shows from near by.
//! Method: radiance, linear, is filtered by the contrast sensitivity of an eye ([`sensitivity`], the one by which halftones are judged)
//! with a Fourier transform. A pixel of the picture is so many metres of the window through the sheet's middle, and the distance
//! makes an angle of it. Coverage is filtered alike and divides the result (normalised convolution), so neither the ground nor what lies
//! beyond the picture darkens edges; the coverage itself stays sharp. Where pixels are coarser than the eye, the picture is
//! rendered finer and averaged after the filter ([`finer`]).
//! Cost: four transforms of a number a pixel. Memory: 8 bytes a pixel more, with a margin.
//! Limits: the eye's filter is 1 at 0 and falls from there, and is the same for all colours and all brightness, while real eyes
//! lose little of coarse detail and more of colours. It spreads far, so a light beside the picture is missed. Pixels of a
//! tilted sheet are taken to be as far away as its middle.
//! Source: R. Nasanen, Visibility of halftone dot textures, IEEE Trans. SMC 14, 1984; H. Knutsson, C.-F. Westin, Normalized
//! convolution, CVPR 1993.

use std::f64::consts::TAU;

use halftone::contrast_sensitivity::{degree, sensitivity};
use observe::Observer;
use press::preview::{LONGEST_SIDE, Radiance};
use rayon::prelude::*;
use spectra::{Complex, fast_side};

use crate::error::ViewError;
use crate::render::Renderer;
use crate::scene::{Camera, Scene};

/// Contrast that is left of the finest detail of a picture that is as fine as the eye.
const FAINT: f64 = 0.01;

/// The most pixels that are rendered for a picture with fewer.
const MOST_PIXELS: usize = 1 << 24;

/// The margin around a picture in units of the eye's spread: beyond it lie 2 % of what a point becomes.
const MARGIN: f64 = 48.0;

/// How much finer than its pixels a picture has to be rendered for an eye so many metres away, and whether that is fine enough.
pub fn finer(camera: &Camera, width: usize, height: usize, metres: f64) -> (usize, bool) {
    let (width, height) = (width.max(1), height.max(1));
    // Cycles in a degree, of the faintest detail and of the finest detail of the pixels.
    let (faintest, finest) = (FAINT.ln() / slope(), 0.5 / in_degrees(camera, height, metres));
    let wanted = (faintest / finest).ceil().clamp(1.0, 1e6) as usize;
    let most = (LONGEST_SIDE / width.max(height)).min((MOST_PIXELS / (width * height)).isqrt()).max(1);
    (wanted.min(most), wanted <= most)
}

/// The logarithm of the contrast that is left of one cycle in a degree: the sensitivity is a power of it.
fn slope() -> f64 {
    sensitivity(1.0).ln()
}

/// The angle of a pixel in the middle of the picture, in degrees.
fn in_degrees(camera: &Camera, height: usize, metres: f64) -> f64 {
    camera.height / height as f64 / degree(metres)
}

impl Renderer<'_> {
    /// Renders `width` x `height` pixels as an eye sees the sheet from so many metres, wherever the eye of the scene is. They are
    /// rendered `finer` times as fine ([`finer()`]).
    ///
    /// # Errors
    /// Those of [`Renderer::render`].
    pub fn seen_from(
        &self,
        scene: &Scene,
        (width, height): (usize, usize),
        metres: f64,
        finer: usize,
        observer: &dyn Observer,
    ) -> Result<Radiance, ViewError> {
        let finer = finer.max(1);
        let mut radiance = self.render(scene, finer * width, finer * height, observer)?;
        observer.begin("looking from a distance", 2);
        let pixel = in_degrees(&scene.camera, finer * height, metres);
        blur(&mut radiance, pixel, observer);
        observer.end();
        Ok(averaged(radiance, finer))
    }
}

/// Filters a picture whose pixels are so many degrees wide.
fn blur(radiance: &mut Radiance, pixel: f64, observer: &dyn Observer) {
    let (width, height) = (radiance.width, radiance.height);
    let spread = slope().abs() / TAU / pixel;
    let side = |side: usize| fast_side(side + ((MARGIN * spread).ceil() as usize).min(side));
    let (wide, high) = (side(width), side(height));
    let mut plane = vec![Complex::default(); wide * high];
    // Two real pictures are one complex one, since the filter weighs frequencies the same both ways.
    let mut filtered = |first: usize, second: usize| {
        plane.fill(Complex::default());
        for (row, pixels) in plane.chunks_exact_mut(wide).zip(radiance.pixels.chunks_exact(width)) {
            row.iter_mut().zip(pixels).for_each(|(out, p)| *out = Complex::new(p[first], p[second]));
        }
        spectra::filter(&mut plane, wide, height, &|cycles| sensitivity(cycles / pixel));
        observer.advance(1);
        let rows = plane.chunks_exact(wide).take(height);
        rows.flat_map(|row| &row[..width]).copied().collect::<Vec<_>>()
    };
    let (red_green, blue_covered) = (filtered(0, 1), filtered(2, 3));
    let seen = red_green.into_par_iter().zip(blue_covered);
    radiance.pixels.par_iter_mut().zip(seen).for_each(|(p, (red_green, blue_covered))| {
        // What is covered counts itself most, so this is no division by little.
        if p[3] > 0.0 {
            let part = p[3] / blue_covered.im.max(1e-6);
            let seen = [red_green.re, red_green.im, blue_covered.re];
            (0..3).for_each(|c| p[c] = (part * seen[c]).max(0.0));
        }
    });
}

/// The means of `finer` x `finer` pixels.
fn averaged(radiance: Radiance, finer: usize) -> Radiance {
    if finer == 1 {
        return radiance;
    }
    let (width, height) = (radiance.width / finer, radiance.height / finer);
    let mut pixels = vec![[0.0f32; 4]; width * height];
    let part = 1.0 / (finer * finer) as f32;
    let rows = radiance.pixels.par_chunks_exact(finer * radiance.width);
    pixels.par_chunks_exact_mut(width).zip(rows).for_each(|(out, rows)| {
        for row in rows.chunks_exact(radiance.width) {
            for (out, pixels) in out.iter_mut().zip(row.chunks_exact(finer)) {
                pixels.iter().for_each(|p| (0..4).for_each(|c| out[c] += part * p[c]));
            }
        }
    });
    Radiance { width, height, pixels }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lit::tests::uniform;
    use crate::scene::{Light, Pose};
    use observe::Silent;
    use std::f64::consts::PI;

    /// Cycles in a degree at which a grating keeps 1/e of its contrast, by the paper, for the luminance of the halftoner.
    fn cutoff() -> f64 {
        0.525 * 11f64.ln() + 3.91
    }

    fn picture(width: usize, height: usize, value: impl Fn(usize, usize) -> [f64; 2]) -> Radiance {
        let pixel = |i: usize| {
            let [v, covered] = value(i % width, i / width).map(|v| v as f32);
            [v * covered, 0.5 * v * covered, 0.25 * v * covered, covered]
        };
        Radiance { width, height, pixels: (0..width * height).map(pixel).collect() }
    }

    #[test]
    fn a_grating_keeps_the_contrast_of_its_frequency() {
        let side = 768;
        // What a bounded picture cannot hold of the filter's reach is less than the error allowed.
        for (period, f) in [(8.0, 2.0), (8.0, 5.0), (8.0, 10.0), (32.0, 1.0), (4.0, 15.0)] {
            // The second grating is turned by a right angle, the third lies aslant.
            for (a, b) in [(1.0, 0.0), (0.0, 1.0), (0.6, 0.8)] {
                let wave =
                    |x: usize, y: usize| TAU * (a * (x as f64 - 384.0) + b * (y as f64 - 384.0)) / period;
                let mut seen = picture(side, side, |x, y| [1.0 + 0.8 * wave(x, y).cos(), 1.0]);
                blur(&mut seen, 1.0 / (f * period), &Silent);
                // Whole periods around the middle: a fifth of the picture.
                let (from, to) = (384 - 80, 384 + 80);
                let (mut mean, mut contrast) = (0.0, 0.0);
                for (x, y) in (from..to).flat_map(|y| (from..to).map(move |x| (x, y))) {
                    let v = f64::from(seen.pixels[y * side + x][0]) / 160.0 / 160.0;
                    mean += v;
                    contrast += 2.0 * v * wave(x, y).cos();
                }
                let expected = 0.8 * (-f / cutoff()).exp();
                assert!((mean - 1.0).abs() < 0.002, "{f}: mean {mean}");
                assert!((contrast / expected - 1.0).abs() < 0.01, "{f}: {contrast}, not {expected}");
            }
        }
    }

    /// The edge of a half plane, by the filter's transform: `1/2 + atan(x / s) / pi`, s = 1 / (2 pi cutoff) degrees.
    #[test]
    fn an_edge_spreads_as_the_transform_of_the_filter() {
        let (side, pixels_in_degree) = (512usize, 100.0);
        let mut seen = picture(side, side, |x, _| [f64::from(u8::from(x >= side / 2)), 1.0]);
        blur(&mut seen, 1.0 / pixels_in_degree, &Silent);
        for x in -40i32..40 {
            let at = (f64::from(x) + 0.5) * TAU * cutoff() / pixels_in_degree;
            let found = seen.pixels[256 * side + (256 + x) as usize][0];
            let expected = 0.5 + at.atan() / PI;
            assert!((f64::from(found) - expected).abs() < 0.01, "{x}: {found}, not {expected}");
        }
    }

    #[test]
    fn an_even_sheet_stays_even_up_to_its_edges_and_the_ground_black() {
        let (width, height) = (150, 97);
        let covered = |x: usize, y: usize| (30.0 - (x as f64 - 70.0).hypot(y as f64 - 40.0)).clamp(0.0, 1.0);
        for pixel in [0.3, 0.02, 0.001] {
            for all in [true, false] {
                let before = picture(width, height, |x, y| [0.7, if all { 1.0 } else { covered(x, y) }]);
                let mut seen = Radiance { width, height, pixels: before.pixels.clone() };
                blur(&mut seen, pixel, &Silent);
                for (found, expected) in seen.pixels.iter().zip(&before.pixels) {
                    let near = (0..4).all(|c| (found[c] - expected[c]).abs() < 1e-4);
                    assert!(near, "{pixel}: {found:?}, not {expected:?}");
                }
            }
        }
    }

    #[test]
    fn from_very_near_nothing_is_lost() {
        let value = |x: usize, y: usize| [((x * 7919 + y * 104_729) % 13) as f64 / 13.0, 1.0];
        let before = picture(64, 48, value);
        let mut seen = picture(64, 48, value);
        blur(&mut seen, 1e4, &Silent);
        for (found, expected) in seen.pixels.iter().zip(&before.pixels) {
            assert!((found[0] - expected[0]).abs() < 1e-3, "{found:?}, not {expected:?}");
        }
    }

    /// Pixels of a millimetre are coarser than the eye at half a metre, which sees 0.2 mm with a hundredth of the contrast.
    #[test]
    fn pictures_are_as_fine_as_the_eye_or_said_not_to_be() {
        let camera = |height| Camera { towards: [0.0, 0.0, 1.0], distance: None, middle: [0.0; 2], height };
        let span = degree(0.5);
        let needed = 2.0 * 100f64.ln() * cutoff() / span;
        assert_eq!(finer(&camera(0.1), 100, 100, 0.5), ((needed * 0.001).ceil() as usize, true));
        assert_eq!(finer(&camera(0.01), 100, 100, 0.5), (1, true));
        assert_eq!(finer(&camera(10.0), 8192, 100, 0.02), (1, false));
        let (times, fine) = finer(&camera(10.0), 1000, 1000, 0.02);
        assert!(times == 4 && !fine);
    }

    #[test]
    fn a_rendered_sheet_of_one_material_looks_the_same_from_anywhere() {
        let lit = uniform([0.1, 0.1], |_| [0.6 / PI, 0.3 / PI, 0.1 / PI]);
        let scene = Scene {
            camera: Camera::whole([0.0, 0.0, 1.0], None, [0.1, 0.1], 1.0),
            pose: Pose::default(),
            lights: vec![Light::Far([0.0, 0.0, 1.0])],
            probe: None,
        };
        let renderer = Renderer::new(&lit);
        let plain = renderer.render(&scene, 60, 60, &Silent).unwrap();
        for (metres, times) in [(0.3, 1), (0.3, 3), (5.0, 1)] {
            let seen = renderer.seen_from(&scene, (60, 60), metres, times, &Silent).unwrap();
            assert_eq!((seen.width, seen.height), (60, 60));
            for (found, expected) in seen.pixels.iter().zip(&plain.pixels) {
                // Edges of finer pixels are steeper.
                if expected[3] == 1.0 || expected[3] == 0.0 {
                    assert!(
                        (0..4).all(|c| (found[c] - expected[c]).abs() < 1e-4),
                        "{found:?}, not {expected:?}"
                    );
                }
            }
        }
    }
}
