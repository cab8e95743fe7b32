//! A document or a sheet lying flat under lights, seen from straight above.
//!
//! Method: the eye is orthographic, so the view is the normal everywhere and the half angle is half the light's
//! polar angle. Each pixel's mean reflectance is read once and looked up for every light:
//! `L = f(theta_h) E cos_i`, E = 1 at the middle of the picture when it faces the light, falling with the square
//! of the distance from a light at a point.
//! Cost: reading the source, then one search among the angles and six multiply-adds for each light and pixel.
//! Limits: lights have no size, so a highlight is as sharp as the material.

use rayon::prelude::*;

use crate::observe::Observer;

use super::source::{Scratch, Source};
use super::{PreviewError, Radiance};

/// A light over the picture. x points right, y to the top of the picture, z to the eye; the unit of length is
/// the picture's longer side and the origin its middle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Light {
    /// Infinitely far away in this direction (any length, z > 0).
    Far([f64; 3]),
    /// At this point (z > 0). Highlights lie beneath it and roam as it moves.
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

    /// Half angle (radians) and `E cos_i` at a point of the sheet.
    pub fn at(self, x: f64, y: f64) -> (f64, f64) {
        let (to, falloff) = match self {
            Light::Far(v) => (v, 1.0),
            Light::Point(p) => {
                let to = [p[0] - x, p[1] - y, p[2]];
                (to, dot(p, p) / dot(to, to))
            }
        };
        let across = to[0].hypot(to[1]);
        (0.5 * across.atan2(to[2]), falloff * to[2] / dot(to, to).sqrt())
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The two angles around `theta` and how far between them it is; the ends hold outside.
pub(crate) fn bracket(angles: &[f64], theta: f64) -> (usize, usize, f64) {
    let above = angles.partition_point(|&a| a <= theta);
    if above == 0 {
        (0, 0, 0.0)
    } else if above == angles.len() {
        (above - 1, above - 1, 0.0)
    } else {
        (above - 1, above, (theta - angles[above - 1]) / (angles[above] - angles[above - 1]))
    }
}

/// Places averaged along each axis of a picture's pixel when a document is finer than the picture.
pub const DOCUMENT_SAMPLES: usize = 4;

/// Renders `source` as `width` x `height` pixels under each of `lights` by itself; one picture a light.
///
/// # Errors
/// When the source's tabulation has no half angles, its tables do not fit each other, or a light is below the
/// sheet.
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
