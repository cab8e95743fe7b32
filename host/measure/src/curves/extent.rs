//! What a curve predicts for pixels and lamps that have an extent, seen through a lens that blurs.
//!
//! A curve is ln f at the middles of bins over the square root of the half angle, with a cubic between them. Method: the mean over a few points
//! of pixel, blur and lamp. Cost: nine views a pixel, five times as many for a lamp with a width. Limits: a blur that is a normal distribution.

use std::f64::consts::FRAC_PI_2;

use crate::geometry::scene::{Scene, View};

/// Samples of a curve over the square root of the half angle: the first ends at 0.02 degrees and the last is
/// 2.8 degrees wide, so that a foil's peak, which is 5 degrees wide, has fifteen of them.
pub const BINS: usize = 64;
/// A blur in pixels below which the pixel's own extent counts most.
const SHARP: f64 = 0.5;

/// A pixel of a stack.
#[derive(Clone, Copy, Debug)]
pub struct Pixel {
    /// Place in the picture, at the pixel's centre.
    pub x: f64,
    /// Place in the picture, at the pixel's centre.
    pub y: f64,
    /// The series it is from, which is also the lamp.
    pub light: usize,
    /// Calibrated radiance: reflectance times irradiance.
    pub value: [f64; 3],
    /// Relative variance.
    pub variance: [f64; 3],
    /// A bit for each channel that is a lower bound.
    pub bound: u8,
    /// The first photograph of the series that is not full there, counted from the longest exposure.
    pub first: u8,
}

/// The middle of a bin in radians.
pub fn angle(bin: usize) -> f64 {
    FRAC_PI_2 * ((bin as f64 + 0.5) / BINS as f64).powi(2)
}

pub(crate) fn place(theta: f64) -> f64 {
    (theta / FRAC_PI_2).max(0.0).sqrt() * BINS as f64
}

/// A curve as ln f at the middles of the bins.
pub(crate) type Logs = [[f64; BINS]; 3];

/// f at an angle, for three channels: ln f is a cubic (Catmull and Rom) between samples, and even about 0 degrees.
pub(crate) fn value(curve: &Logs, theta: f64) -> [f64; 3] {
    let at = (place(theta) - 0.5).clamp(0.0, (BINS - 1) as f64);
    let (i, t) = ((at as usize).min(BINS - 2), at - (at as usize).min(BINS - 2) as f64);
    std::array::from_fn(|c| {
        let y = &curve[c];
        let (p, q) = (y[i], y[i + 1]);
        let (before, after) = (if i > 0 { y[i - 1] } else { p }, if i + 2 < BINS { y[i + 2] } else { q });
        let (m0, m1) = (0.5 * (q - before), 0.5 * (after - p));
        let (t2, t3) = (t * t, t * t * t);
        ((2.0 * t3 - 3.0 * t2 + 1.0) * p
            + (t3 - 2.0 * t2 + t) * m0
            + (3.0 * t2 - 2.0 * t3) * q
            + (t3 - t2) * m1)
            .exp()
    })
}

/// What a curve predicts for a pixel: the mean over its area and the lamp.
pub(crate) fn predicted(scene: &Scene, pixel: &Pixel, view: &View, curve: &Logs) -> [f64; 3] {
    // Beyond 30 degrees nothing is narrow.
    if view.theta > 0.52 {
        return value(curve, view.theta).map(|f| f * view.irradiance);
    }
    let (mut sum, mut all) = ([0.0; 3], 0.0);
    each_part(scene, pixel, |view, weight| {
        let f = value(curve, view.theta);
        for c in 0..3 {
            sum[c] += weight * f[c] * view.irradiance;
        }
        all += weight;
    });
    if all > 0.0 { sum.map(|s| s / all) } else { value(curve, view.theta).map(|f| f * view.irradiance) }
}

/// The share of a pixel's light, as a curve predicts it, that comes from half angles below this.
pub(crate) fn share_below(scene: &Scene, pixel: &Pixel, curve: &Logs, theta: f64) -> f64 {
    let (mut below, mut all) = (0.0, 0.0);
    each_part(scene, pixel, |view, weight| {
        let light = weight * value(curve, view.theta)[1] * view.irradiance;
        all += light;
        below += if view.theta < theta { light } else { 0.0 };
    });
    if all > 0.0 { below / all } else { 0.0 }
}

/// What parts of a pixel see under parts of the lamp, and the weight of each. Across the picture three points stand for the pixel and the lens'
/// blur together, with their variance: even ones for a pixel alone, those of Gauss and Hermite for a blur.
fn each_part(scene: &Scene, pixel: &Pixel, mut each: impl FnMut(View, f64)) {
    let lamp = scene.diameter(pixel.light) / 2.0;
    // Points of a disc with its mean and variance.
    let lamps: &[[f64; 2]] = if lamp > 0.0 {
        &[[0.0, 0.0], [0.707, 0.0], [-0.707, 0.0], [0.0, 0.707], [0.0, -0.707]]
    } else {
        &[[0.0, 0.0]]
    };
    let variance = 1.0 / 12.0 + scene.blur() * scene.blur();
    let (reach, middle) = if scene.blur() < SHARP {
        ((1.5 * variance).sqrt(), 1.0 / 3.0)
    } else {
        ((3.0 * variance).sqrt(), 2.0 / 3.0)
    };
    let points = [(-reach, 0.5 - 0.5 * middle), (0.0, middle), (reach, 0.5 - 0.5 * middle)];
    for (j, high) in points {
        for (i, wide) in points {
            for off in lamps {
                let off = off.map(|d| d * lamp);
                if let Some(view) =
                    scene.seen_under([pixel.x + i, pixel.y + j], pixel.light, pixel.first, off)
                {
                    each(view, wide * high);
                }
            }
        }
    }
}

/// By how much pixel, blur and lamp soften ln f at a place, as a curve tells.
pub(crate) fn softened(scene: &Scene, [x, y]: [f64; 2], light: usize, first: u8, curve: &Logs) -> f64 {
    let Some(view) = scene.seen(x, y, light, first) else { return 0.0 };
    let pixel = Pixel { x, y, light, value: [0.0; 3], variance: [0.0; 3], bound: 0, first };
    let soft: f64 = predicted(scene, &pixel, &view, curve).iter().sum();
    let sharp: f64 = value(curve, view.theta).iter().map(|f| f * view.irradiance).sum();
    let ln = (soft / sharp).ln();
    if ln.is_finite() { ln } else { 0.0 }
}
