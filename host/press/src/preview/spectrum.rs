//! The radially averaged power spectrum of printed dots.
//!
//! Problem: see whether a halftone keeps its power at frequencies that the eye does not resolve.
//! Method: each dot counts as a value of its stack, such as the cube root of its luminance. Of at most 64 windows of 256 dots
//! (10.8 mm) that lie evenly, the eight whose content changes least over their area are transformed (Hann's window, mean
//! removed), and the power is averaged over rings. White noise of the same variance is 1 everywhere.
//! Cost: 3 ms a transform. Limits: what the document shows in a window counts as halftone, so even windows are chosen, and
//! below half a cycle a millimetre its content prevails; rings say nothing of directions.
//! Source: Ulichney, Digital Halftoning (1987), chapter 3.

use std::f64::consts::TAU;

use rayon::prelude::*;

use sheet::{DOTS_PER_MM, DotMap};

/// Side of a window in dots.
const WINDOW: usize = 256;
/// Smaller rectangles have no spectrum.
const LEAST: usize = 128;
/// Windows along each side, and how many of them are used.
const PLACES: usize = 8;
const USED: usize = 8;
/// Side of the squares whose means tell how even a window is.
const BLOCK: usize = 64;
/// Rings from frequency 0 to the finest that dots can show.
const RINGS: usize = 64;

/// A spectrum.
#[derive(Clone, Debug, PartialEq)]
pub struct Spectrum {
    /// The middle of each ring in cycles a millimetre, and the power there relative to white noise of the same variance.
    pub rings: Vec<(f64, f64)>,
}

/// The spectrum of dots by a value for each of their stacks; `None` where nothing varies, or for less than 128 dots a side.
pub fn spectrum(dots: &DotMap, values: &[f64]) -> Option<Spectrum> {
    let side = dots.width().min(dots.length()).min(WINDOW);
    if side < LEAST || values.len() < dots.stacks().len() {
        return None;
    }
    let starts = |length: usize| {
        let count = (length / side).clamp(1, PLACES);
        (0..count).map(move |i| (length - side) * (2 * i + 1) / (2 * count))
    };
    let mut windows: Vec<(f64, Vec<f64>)> = starts(dots.length())
        .flat_map(|top| starts(dots.width()).map(move |left| (left, top)))
        .collect::<Vec<_>>()
        .into_par_iter()
        .map(|corner| {
            let window = read(dots, values, corner, side);
            (unevenness(&window, side), window)
        })
        .filter(|(uneven, _)| uneven.is_finite())
        .collect();
    windows.sort_by(|a, b| a.0.total_cmp(&b.0));
    let sums: Vec<Vec<(f64, u32)>> =
        windows.par_iter().take(USED).map(|(_, window)| rings(window, side)).collect();
    let total: f64 = sums.iter().flatten().map(|ring| ring.0).sum();
    let count: u32 = sums.iter().flatten().map(|ring| ring.1).sum();
    if total <= 0.0 {
        return None;
    }
    let mean = total / f64::from(count);
    let ring = |i: usize| {
        let (power, count) = sums.iter().fold((0.0, 0), |sum, of| (sum.0 + of[i].0, sum.1 + of[i].1));
        let cycles = (i as f64 + 0.5) / RINGS as f64 * 0.5 * DOTS_PER_MM;
        (count > 0).then(|| (cycles, power / f64::from(count) / mean))
    };
    Some(Spectrum { rings: (0..RINGS).filter_map(ring).collect() })
}

fn read(dots: &DotMap, values: &[f64], (left, top): (usize, usize), side: usize) -> Vec<f64> {
    let row = |y: usize| &dots.index()[(top + y) * dots.width() + left..][..side];
    (0..side).flat_map(|y| row(y).iter().map(|&dot| values[usize::from(dot)])).collect()
}

/// The variance of the means over blocks as a share of the variance of the dots; infinite where nothing varies.
fn unevenness(window: &[f64], side: usize) -> f64 {
    let variance = |values: &[f64]| {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64
    };
    let blocks = side / BLOCK;
    let block = |i: usize| {
        let (x, y) = (i % blocks * BLOCK, i / blocks * BLOCK);
        let row = |dy: usize| window[(y + dy) * side + x..][..BLOCK].iter().sum::<f64>();
        (0..BLOCK).map(row).sum::<f64>() / (BLOCK * BLOCK) as f64
    };
    let all = variance(window);
    let means: Vec<f64> = (0..blocks * blocks).map(block).collect();
    if all > 1e-12 { variance(&means) / all } else { f64::INFINITY }
}

/// The sum of the power in each ring and the number of frequencies in it; the last one holds the corners beyond the rings.
fn rings(window: &[f64], side: usize) -> Vec<(f64, u32)> {
    let mean = window.iter().sum::<f64>() / window.len() as f64;
    let hann = |i: usize| 0.5 - 0.5 * (TAU * (i as f64 + 0.5) / side as f64).cos();
    let bell: Vec<f64> = (0..side).map(hann).collect();
    let value = |i: usize| (window[i] - mean) * bell[i % side] * bell[i / side];
    let values: Vec<f64> = (0..window.len()).map(value).collect();
    let mut sums = vec![(0.0, 0); RINGS + 1];
    for (i, power) in spectra::power(&values, side).into_iter().enumerate().skip(1) {
        let cycles = |at: usize| at.min(side - at) as f64 / side as f64;
        let radius = cycles(i % side).hypot(cycles(i / side));
        let ring = ((2.0 * radius * RINGS as f64) as usize).min(RINGS);
        // The window smears frequency 0 over its neighbours.
        if radius * side as f64 > 2.0 {
            sums[ring].0 += f64::from(power);
            sums[ring].1 += 1;
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;
    use inks::Stack;

    fn map(width: usize, length: usize, dot: impl FnMut(usize) -> u8) -> DotMap {
        let stacks = vec![Stack::SUBSTRATE, "K".parse().unwrap()];
        DotMap::new(width, length, stacks, (0..width * length).map(dot).collect()).unwrap()
    }

    #[test]
    fn stripes_have_their_power_at_their_frequency() {
        let found = spectrum(&map(600, 520, |i| u8::from(i % 600 % 8 < 4)), &[1.0, 0.0]).unwrap();
        let (cycles, power) = found.rings.iter().copied().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
        assert!((cycles - DOTS_PER_MM / 8.0).abs() < 0.2, "{cycles}");
        assert!(power > 10.0, "{power}");
    }

    #[test]
    fn white_noise_is_one_everywhere() {
        // The finaliser of a well-known generator, so that neighbours have nothing in common.
        let noise = |i: usize| {
            let mut x = (i as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            u8::from((x ^ (x >> 31)).is_multiple_of(4))
        };
        let found = spectrum(&map(1536, 1536, noise), &[0.3, 0.9]).unwrap();
        for (cycles, power) in found.rings.into_iter().skip(2) {
            assert!((power - 1.0).abs() < 0.25, "{power} at {cycles}");
        }
    }

    #[test]
    fn what_does_not_vary_or_is_too_small_has_none() {
        assert_eq!(spectrum(&map(600, 600, |_| 1), &[1.0, 0.0]), None);
        assert_eq!(spectrum(&map(600, 600, |i| (i % 2) as u8), &[1.0, 1.0]), None);
        assert_eq!(spectrum(&map(100, 600, |i| (i % 2) as u8), &[1.0, 0.0]), None);
        assert!(spectrum(&map(130, 200, |i| (i % 3 % 2) as u8), &[1.0, 0.0]).is_some());
    }

    /// Even windows are chosen: a step in the document beside them leaves no low frequencies.
    #[test]
    fn uneven_windows_are_left_out() {
        let fine = |i: usize| u8::from((i % 1536 + i / 1536).is_multiple_of(2));
        let stepped = |i: usize| if i / 1536 < 512 { u8::from(i % 256 < 128) } else { fine(i) };
        let found = spectrum(&map(1536, 1536, stepped), &[1.0, 0.0]).unwrap();
        assert!(found.rings.iter().take(8).all(|ring| ring.1 < 0.01), "{:?}", &found.rings[..8]);
    }
}
