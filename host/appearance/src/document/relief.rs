//! Relief as roughness: what flat paper can show of a normal map.
//!
//! Problem: paper is flat. A bumpy surface scatters a highlight by its bumps as well as by its microfacets; a print can
//! only imitate the latter.
//! Method: within a window, the slopes of the normal map act as an additional distribution of facets. Squared widths add:
//! `alpha'^2 = alpha^2 + 2 var`, where `var` is the variance of the slope about its mean along one axis (here the mean of
//! both axes), as for Gaussian slopes. The window is [`WINDOW`] pixels of the base colour: smaller bumps become roughness,
//! larger shapes are lost. A variance does not depend on sign conventions (+Y up or down), and z follows from x and y, so
//! maps with two channels work too.
//! Cost: a few additions and two roots per pixel for any window (running sums). Limits: isotropic; the mean slope is dropped.
//! Source: filtering of slope moments in rendering, as in Olano & Baker 2010 (LEAN mapping).

use super::texture::Plane;
use maths::Maths;

/// Side of the window in pixels: about a millimetre if the document fills the page.
pub const WINDOW: usize = 7;

/// The steepest slope, an angle of 84 degrees; steeper ones are clamped, for they would be walls, which a
/// relief of heights does not have.
const STEEPEST: f32 = 10.0;

/// The largest variance: whatever has more is as rough as a surface can be, see [`widened`].
const MOST: f32 = 0.5;

/// The slope variance (mean of both axes), at most [`MOST`], about the local mean, in a square window of `2 radius + 1` pixels that is cut off
/// at the borders. `x` and `y` are the stored components, 0 to 1, and have the same size; `scale` multiplies the decoded
/// components like glTF's normal scale.
pub fn slope_variance(x: &Plane, y: &Plane, scale: f32, radius: usize) -> Plane {
    let (width, height) = (x.width(), x.height());
    let slope = |pixel: usize| {
        let (x, y) = (2.0 * x.at(pixel) - 1.0, 2.0 * y.at(pixel) - 1.0);
        let z = (1.0 - x * x - y * y).max(0.0).sqrt().max(1.0 / STEEPEST);
        [x * scale / z, y * scale / z].map(|s| s.clamp(-STEEPEST, STEEPEST))
    };
    Plane::coded((width, height), (0.0, MOST), |top, out| {
        // Per column: running sums of s_x, s_y and s_x^2 + s_y^2 over the rows of the window.
        let mut columns = vec![[0.0f64; 3]; width];
        let add = |columns: &mut [[f64; 3]], y: usize, sign: f64| {
            for (sum, pixel) in columns.iter_mut().zip(y * width..) {
                let [sx, sy] = slope(pixel).map(f64::from);
                sum[0] += sign * sx;
                sum[1] += sign * sy;
                sum[2] += sign * (sx * sx + sy * sy);
            }
        };
        for y in top.saturating_sub(radius)..(top + radius).min(height) {
            add(&mut columns, y, 1.0);
        }
        for (row, out) in out.chunks_exact_mut(width).enumerate() {
            let y = top + row;
            if y + radius < height {
                add(&mut columns, y + radius, 1.0);
            }
            if row > 0 && y > radius {
                add(&mut columns, y - radius - 1, -1.0);
            }
            let rows = (y + radius + 1).min(height) - y.saturating_sub(radius);
            let mut sum = [0.0f64; 3];
            for column in &columns[..radius.min(width)] {
                (0..3).for_each(|k| sum[k] += column[k]);
            }
            for (x, out) in out.iter_mut().enumerate() {
                if let Some(column) = columns.get(x + radius) {
                    (0..3).for_each(|k| sum[k] += column[k]);
                }
                if let Some(column) = x.checked_sub(radius + 1).map(|x| &columns[x]) {
                    (0..3).for_each(|k| sum[k] -= column[k]);
                }
                let across = (x + radius + 1).min(width) - x.saturating_sub(radius);
                let n = (rows * across) as f64;
                let both = sum[2] / n - (sum[0] / n).squared() - (sum[1] / n).squared();
                *out = (0.5 * both).max(0.0) as f32;
            }
        }
    })
}

/// A microfacet width plus a slope variance: `sqrt(alpha^2 + 2 var)`.
pub fn widened(alpha: f32, variance: f32) -> f32 {
    (alpha * alpha + 2.0 * variance).sqrt()
}

/// The note about a normal map.
pub fn note(name: &str) -> String {
    format!(
        "{name}: paper is flat; bumps within {WINDOW} pixels are printed as roughness, larger relief is lost"
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn encode(slope: f32) -> f32 {
        // A slope along one axis, as a stored component.
        0.5 + 0.5 * slope / (1.0 + slope * slope).sqrt()
    }

    #[test]
    fn a_tilted_plane_has_no_variance_and_a_ridge_has_its_own() {
        let flat = Plane::new(40, 30, vec![0.5; 1200]);
        let tilted = Plane::new(40, 30, vec![encode(0.4); 1200]);
        assert!(slope_variance(&tilted, &flat, 1.0, 3).values().all(|v| v.abs() < 1e-6));
        // Alternating slopes of +0.3 and -0.3: within 7 columns, 4 of one sign and 3 of the other.
        let ridges =
            Plane::new(40, 30, (0..1200).map(|i| encode(if i % 2 == 0 { 0.3 } else { -0.3 })).collect());
        let var = slope_variance(&ridges, &flat, 1.0, 3);
        let expected = 0.5 * 0.09 * (1.0 - (1.0f32 / 7.0).powi(2));
        assert!((var.at(15 * 40 + 20) - expected).abs() < 1e-5, "{} {expected}", var.at(620));
    }

    proptest! {
        #[test]
        fn running_sums_are_the_variance_of_the_window(
            w in 1usize..20, h in 1usize..90, radius in 0usize..6, seed in any::<u32>(),
        ) {
            let noise = |i: usize, k: u32| {
                let v = (i as u32 + 7).wrapping_mul(2_654_435_761 ^ k).wrapping_add(seed).wrapping_mul(747_796_405);
                0.2 + 0.6 * (v >> 8) as f32 / (1u32 << 24) as f32
            };
            let x = Plane::new(w, h, (0..w * h).map(|i| noise(i, 1)).collect());
            let y = Plane::new(w, h, (0..w * h).map(|i| noise(i, 2)).collect());
            let found = slope_variance(&x, &y, 0.7, radius);
            let slope = |i: usize| {
                let (x, y) = (f64::from(2.0 * x.at(i) - 1.0), f64::from(2.0 * y.at(i) - 1.0));
                let z = (1.0 - x * x - y * y).max(0.01).sqrt();
                [0.7 * x / z, 0.7 * y / z]
            };
            for cy in 0..h {
                for cx in 0..w {
                    let mut all = Vec::new();
                    for y in cy.saturating_sub(radius)..(cy + radius + 1).min(h) {
                        for x in cx.saturating_sub(radius)..(cx + radius + 1).min(w) {
                            all.push(slope(y * w + x));
                        }
                    }
                    let n = all.len() as f64;
                    let mean = [0, 1].map(|k| all.iter().map(|s| s[k]).sum::<f64>() / n);
                    let var = all.iter().map(|s| (s[0] - mean[0]).powi(2) + (s[1] - mean[1]).powi(2)).sum::<f64>()
                        / (2.0 * n);
                    prop_assert!((f64::from(found.at(cy * w + cx)) - var.min(0.5)).abs() < 1e-5);
                }
            }
        }
    }
}
