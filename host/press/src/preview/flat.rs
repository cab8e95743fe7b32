//! A flat document or sheet under lights, seen from straight above.
//!
//! Method: the eye is orthographic, so the view direction is the normal everywhere and the half angle is half the polar angle
//! of the light. The mean reflectance of each pixel is read once and evaluated for every light:
//! `L = f(theta_h) E cos_i`. E is 1 at the middle of the picture facing the light, and falls with the square of the
//! distance from a point light.
//! Cost: reading the source, then one search among the angles and six multiply-adds for each light and pixel.
//! Limits: lights have no size, so a highlight is as sharp as the material.

use rayon::prelude::*;

use observe::Observer;

use super::error::PreviewError;
use super::radiance::Radiance;
use super::source::{Scratch, Source};

/// A light over the picture. x points right, y to the top of the picture, z to the eye. The unit of length is the
/// picture's longer side; the origin is its middle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Light {
    /// Infinitely far away in this direction (any length, z > 0).
    Far([f64; 3]),
    /// At this point (z > 0). Highlights lie beneath it.
    Point([f64; 3]),
}

impl Light {
    fn check(self, light: usize) -> Result<(), PreviewError> {
        let (Light::Far(v) | Light::Point(v)) = self;
        let wrong = |problem| Err(PreviewError::Light { light, problem });
        if !v.iter().all(|c| c.is_finite() && c.abs() < 1e6) {
            return wrong("its coordinates must be finite and below a million");
        }
        if v[2] < 1e-6 {
            return wrong("it must be above the sheet (z > 0)");
        }
        Ok(())
    }

    /// The direction from a point of the sheet to the light, of any length.
    pub(super) fn direction(self, x: f64, y: f64) -> [f64; 3] {
        match self {
            Light::Far(v) => v,
            Light::Point(p) => [p[0] - x, p[1] - y, p[2]],
        }
    }

    /// The half angle (radians) and `E cos_i` at a point of the sheet.
    pub(super) fn at(self, x: f64, y: f64) -> (f64, f64) {
        let to = self.direction(x, y);
        let falloff = match self {
            Light::Far(_) => 1.0,
            Light::Point(p) => dot(p, p) / dot(to, to),
        };
        let across = (to[0] * to[0] + to[1] * to[1]).sqrt();
        (0.5 * across.atan2(to[2]), falloff * to[2] / dot(to, to).sqrt())
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The two angles around `theta` and its fractional place between them. Outside the range, the nearest end applies.
pub(super) fn bracket(angles: &[f64], theta: f64) -> (usize, usize, f64) {
    let above = angles.partition_point(|&a| a <= theta);
    if above == 0 {
        (0, 0, 0.0)
    } else if above == angles.len() {
        (above - 1, above - 1, 0.0)
    } else {
        (above - 1, above, (theta - angles[above - 1]) / (angles[above] - angles[above - 1]))
    }
}

/// Places averaged along each axis of a pixel if a document is finer than the picture.
const DOCUMENT_SAMPLES: usize = 4;

/// Renders `source` as `width` x `height` pixels, one picture for each of `lights`.
///
/// # Errors
/// A tabulation without half angles, tables that do not match each other, or a light below the sheet.
pub fn flat(
    source: &Source,
    lights: &[Light],
    width: usize,
    height: usize,
    observer: &dyn Observer,
) -> Result<Vec<Radiance>, PreviewError> {
    let space = source.space();
    let angles = space.angles();
    if angles.is_empty() {
        return Err(PreviewError::NoAngles { columns: space.columns() });
    }
    for (i, light) in lights.iter().enumerate() {
        light.check(i)?;
    }
    let lines = source.lines(width, height, DOCUMENT_SAMPLES)?;
    if lights.is_empty() {
        return Ok(Vec::new());
    }
    observer.begin("lighting the sheet", height as u64);
    let unit = 1.0 / width.max(height) as f64;
    let mut all = vec![[0.0f32; 4]; width * height * lights.len()];
    all.par_chunks_exact_mut(width * lights.len()).enumerate().for_each_init(
        || (Scratch::default(), vec![0.0f32; width * lines.columns()]),
        |(scratch, line), (y, out)| {
            lines.read(y, scratch, line);
            let py = (height as f64 / 2.0 - y as f64 - 0.5) * unit;
            for (light, out) in lights.iter().zip(out.chunks_exact_mut(width)) {
                let pixels = out.iter_mut().zip(line.chunks_exact(lines.columns()));
                for (x, (pixel, row)) in pixels.enumerate() {
                    let px = (x as f64 + 0.5 - width as f64 / 2.0) * unit;
                    let (theta, irradiance) = light.at(px, py);
                    let (i, j, s) = bracket(angles, theta);
                    let (near, far) = ((1.0 - s) * irradiance, s * irradiance);
                    for c in 0..3 {
                        pixel[c] = near as f32 * row[3 * i + c] + far as f32 * row[3 * j + c];
                    }
                    pixel[3] = 1.0;
                }
            }
            observer.advance(1);
        },
    );
    observer.end();
    let picture = |light: usize| Radiance {
        width,
        height,
        pixels: all.chunks_exact(width).skip(light).step_by(lights.len()).flatten().copied().collect(),
    };
    Ok((0..lights.len()).map(picture).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sheet::{Area, Sheet};
    use appearance::brdf::{Space, Table};
    use inks::{Curve, Stack};
    use observe::Silent;
    use protocol::paper::Paper;
    use std::f64::consts::PI;

    /// A sheet of two stacks, the second on every dot where `inked` says so.
    fn sheet(width: u16, length: u16, inked: impl Fn(usize, usize) -> bool) -> Sheet {
        let index = (0..usize::from(width) * usize::from(length))
            .map(|i| u8::from(inked(i % usize::from(width), i / usize::from(width))))
            .collect();
        let stacks = vec![Stack::SUBSTRATE, "SF".parse().unwrap()];
        Sheet::new(Paper::Custom { width, length }, stacks, index).unwrap()
    }

    fn rows(space: &Space, curves: [&dyn Fn(f64) -> f64; 2]) -> Table {
        let mut rows = Table::new(space.columns());
        for f in curves {
            rows.push(&space.row(&Curve::sampled(space.angles(), |t| [f(t); 3])));
        }
        rows
    }

    fn lit(sheet: &Sheet, space: &Space, stacks: &Table, lights: &[Light]) -> Vec<Radiance> {
        let print = Source::Print { dots: sheet.dots(), space, stacks, area: Area::whole(sheet.dots()) };
        flat(&print, lights, sheet.width(), sheet.length(), &Silent).unwrap()
    }

    #[test]
    fn lambertian_paper_under_a_lamp_falls_off_with_cosine_and_distance() {
        let space = Space::half_angle(8);
        let rows = rows(&space, [&|_| 0.6 / PI, &|_| 0.0]);
        let (sheet, lamp) = (sheet(40, 20, |_, _| false), [0.3, -0.1, 0.8]);
        let picture = &lit(&sheet, &space, &rows, &[Light::Point(lamp)])[0];
        for (x, y) in [(0usize, 0usize), (39, 0), (20, 10), (7, 19), (31, 4)] {
            // E = I cos_i / r^2 with I such that a surface at the middle turned to the lamp receives 1.
            let to = [lamp[0] - (x as f64 - 19.5) / 40.0, lamp[1] + (y as f64 - 9.5) / 40.0, lamp[2]];
            let intensity = lamp.iter().map(|v| v * v).sum::<f64>();
            let r = to.iter().map(|v| v * v).sum::<f64>().sqrt();
            let expected = 0.6 / PI * intensity * to[2] / r.powi(3);
            let found = f64::from(picture.pixels[y * 40 + x][1]);
            assert!((found / expected - 1.0).abs() < 1e-5, "({x}, {y}): {found}, not {expected}");
        }
    }

    #[test]
    fn a_far_light_shows_the_curve_at_half_its_angle() {
        let space = Space::half_angle(64);
        let rows = rows(&space, [&|t| 1.0 + t, &|_| 0.0]);
        let sheet = sheet(3, 2, |_, _| false);
        for degrees in [0.0, 10.0, 47.0, 80.0f64] {
            let angle = degrees.to_radians();
            let light = Light::Far([0.0, 5.0 * angle.sin(), 5.0 * angle.cos()]);
            let expected = (1.0 + angle / 2.0) * angle.cos();
            let held = (1.0 + space.angles()[0]) * angle.cos();
            for p in &lit(&sheet, &space, &rows, &[light])[0].pixels {
                assert!((f64::from(p[0]) - expected.max(held)).abs() < 1e-5, "{degrees} degrees: {p:?}");
            }
        }
    }

    #[test]
    fn the_highlight_lies_beneath_the_lamp_and_is_sharper_on_foil_than_on_paper() {
        let space = Space::half_angle(32);
        let paper = |t| 0.27 + 0.04 * inks::ggx::lobe(t, 0.28);
        let foil = |t| 0.005 + 0.85 * inks::ggx::lobe(t, 0.06);
        let rows = rows(&space, [&paper, &foil]);
        let sheet = sheet(120, 120, |x, _| x >= 60);
        let at = |x: f64, y: f64| Light::Point([(x - 59.5) / 120.0, (59.5 - y) / 120.0, 0.7]);
        let pictures = lit(&sheet, &space, &rows, &[at(30.0, 40.0), at(90.0, 70.0)]);
        let mut widths = Vec::new();
        for (picture, (x, y), half) in [(&pictures[0], (30, 40), 0..60), (&pictures[1], (90, 70), 60..120)] {
            let row = |x: usize| picture.pixels[y * 120 + x][0];
            let peak = half.clone().max_by(|&a, &b| row(a).total_cmp(&row(b))).unwrap();
            assert!(peak.abs_diff(x) <= 1, "peak at {peak}, lamp over {x}");
            widths.push(half.filter(|&x| row(x) > 0.5 * row(peak)).count());
        }
        assert!(widths[1] * 4 < widths[0], "half widths of paper and foil: {widths:?}");
    }

    #[test]
    fn a_fine_mixture_is_lit_like_the_mean_of_its_parts() {
        let space = Space::half_angle(16);
        let rows = rows(&space, [&|t| 0.3 - 0.1 * t, &|t| 2.0 / (0.1 + t)]);
        let quarter = sheet(80, 40, |x, y| (x + 2 * y) % 4 == 0);
        let lights = [Light::Point([0.2, 0.1, 1.0]), Light::Far([-1.0, 0.5, 1.0])];
        let picture = |sheet: &Sheet| {
            let print = Source::Print {
                dots: sheet.dots(),
                space: &space,
                stacks: &rows,
                area: Area::whole(sheet.dots()),
            };
            flat(&print, &lights, 20, 10, &Silent).unwrap()
        };
        let (mixed, none, all) =
            (picture(&quarter), picture(&sheet(80, 40, |_, _| false)), picture(&sheet(80, 40, |_, _| true)));
        for light in 0..2 {
            for i in 0..200 {
                let expected = 0.75 * none[light].pixels[i][0] + 0.25 * all[light].pixels[i][0];
                assert!((mixed[light].pixels[i][0] / expected - 1.0).abs() < 1e-4);
            }
        }
    }

    #[test]
    fn pictures_do_not_depend_on_the_number_of_threads() {
        let space = Space::half_angle(8);
        let rows = rows(&space, [&|t| 1.0 + t, &|t| 0.3 * t]);
        let sheet = sheet(61, 33, |x, y| (x * y) % 3 == 1);
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| lit(&sheet, &space, &rows, &[Light::Point([0.1, 0.2, 0.9])]))
        };
        assert_eq!(with(1), with(3));
    }

    #[test]
    fn lights_below_the_sheet_and_tables_without_angles_are_refused() {
        let space = Space::half_angle(2);
        let rows = rows(&space, [&|_| 1.0, &|_| 1.0]);
        let sheet = sheet(2, 2, |_, _| false);
        let print = Source::Print {
            dots: sheet.dots(),
            space: &space,
            stacks: &rows,
            area: Area::whole(sheet.dots()),
        };
        let lights = [Light::Far([0.0, 0.0, 1.0]), Light::Point([0.0, 0.0, -1.0])];
        assert!(matches!(flat(&print, &lights, 2, 2, &Silent), Err(PreviewError::Light { light: 1, .. })));
        let bare = Space::tabulated(&[1.0, 1.0], &[1.0, 1.0]).unwrap();
        let print = Source::Print {
            dots: sheet.dots(),
            space: &bare,
            stacks: &rows,
            area: Area::whole(sheet.dots()),
        };
        assert!(matches!(flat(&print, &[], 2, 2, &Silent), Err(PreviewError::NoAngles { columns: 6 })));
    }
}
