//! Spectra as colours.
//!
//! Method: the colour matching functions (fits by Wyman, Sloan and Shirley 2013) under an equal-energy light, each channel normalised so
//! that a flat 1 is (1, 1, 1). Cost: a few exponentials a wavelength. Limits: a spectrum of few wavelengths is what its samples are,
//! nothing between.

use maths::Maths;

/// For each wavelength (nm, ascending), its weights in linear Rec. 709 red, green and blue. The weights of each colour sum
/// to one. `None` unless the wavelengths cover the visible range and lie within it.
pub fn rgb_weights(wavelengths: &[f32]) -> Option<Vec<[f64; 3]>> {
    let nm: Vec<f64> = wavelengths.iter().map(|&v| f64::from(v)).collect();
    if nm.windows(2).any(|w| w[0] >= w[1]) || *nm.first()? > 430.0 || *nm.last()? < 650.0 {
        return None;
    }
    /// From XYZ to linear Rec. 709. Source: IEC 61966-2-1.
    const FROM_XYZ: [[f64; 3]; 3] =
        [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]];
    let mut weights: Vec<[f64; 3]> = (0..nm.len())
        .map(|i| {
            let width = 0.5 * (nm[(i + 1).min(nm.len() - 1)] - nm[i.saturating_sub(1)]);
            let xyz = matching(nm[i]);
            FROM_XYZ.map(|row| width * (0..3).map(|k| row[k] * xyz[k]).sum::<f64>())
        })
        .collect();
    for c in 0..3 {
        let sum: f64 = weights.iter().map(|w| w[c]).sum();
        // No wavelength that the eye sees.
        if sum.is_nan() || sum < 1.0 {
            return None;
        }
        weights.iter_mut().for_each(|w| w[c] /= sum);
    }
    Some(weights)
}

/// The CIE 1931 colour matching functions at a wavelength in nm, as sums of asymmetric Gaussians.
fn matching(nm: f64) -> [f64; 3] {
    let lobe = |centre: f64, below: f64, above: f64| {
        let t = (nm - centre) / if nm < centre { below } else { above };
        (-0.5 * t * t).exponential()
    };
    [
        1.056 * lobe(599.8, 37.9, 31.0) + 0.362 * lobe(442.0, 16.0, 26.7) - 0.065 * lobe(501.1, 20.4, 26.2),
        0.821 * lobe(568.8, 46.9, 40.5) + 0.286 * lobe(530.9, 16.3, 31.1),
        1.217 * lobe(437.0, 11.8, 36.0) + 0.681 * lobe(459.0, 26.0, 13.8),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colour_matching_knows_red_green_and_blue_light() {
        let nm: Vec<f32> = (0..81).map(|i| 380.0 + 5.0 * i as f32).collect();
        let weights = rgb_weights(&nm).unwrap();
        let at = |wanted: f32| weights[nm.iter().position(|&v| v == wanted).unwrap()];
        assert!(at(630.0)[0] > 4.0 * at(630.0)[1].abs().max(at(630.0)[2].abs()));
        assert!(at(530.0)[1] > 4.0 * at(530.0)[2].abs() && at(530.0)[0] < 0.0);
        assert!(at(450.0)[2] > 10.0 * at(450.0)[1].abs());
    }

    #[test]
    fn wavelengths_that_nobody_sees_have_no_colour() {
        assert!(rgb_weights(&[1.0, 1000.0]).is_none());
        assert!(rgb_weights(&[450.0, 550.0]).is_none() && rgb_weights(&[550.0, 450.0, 650.0]).is_none());
        let three = rgb_weights(&[430.0, 550.0, 650.0]).unwrap();
        for c in 0..3 {
            assert!((three.iter().map(|w| w[c]).sum::<f64>() - 1.0).abs() < 1e-12);
        }
    }
}
