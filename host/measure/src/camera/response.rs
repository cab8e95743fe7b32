//! The response of a camera: from the values in a file to numbers proportional to light.
//!
//! Problem: JPEG is not linear, and no file says how. Method: Debevec and Malik (1997): for pixels i in photographs j, `g(z_ij) =
//! ln E_i + ln t_j` in least squares with a smooth g over 256 levels and weights that fall toward black and white. Cost: one
//! system of 256 + `PIXELS` unknowns for each channel. Limits: needs several exposures; absolute levels come from the card.

use super::probe::Probe;
use crate::MeasureError;
use crate::linalg::Cholesky;

/// Levels of the files that have a response to recover: those of 8 bits; JPEG has no others that cameras
/// write.
const LEVELS: usize = 256;
/// Pixels that take part.
const PIXELS: usize = 160;
/// The first level whose tone is used.
const DARKEST: usize = 2;
/// Weight of smoothness over the logarithm of the level.
const SMOOTH: f64 = 0.3;

/// From values to numbers proportional to light.
#[derive(Clone, Debug)]
pub(crate) enum Response {
    /// Values are proportional to light.
    Linear,
    /// For each channel 256 numbers, for values from 0 to `white`.
    Table { levels: Box<[[f32; LEVELS]; 3]>, white: f32 },
}

impl Response {
    /// The number for a value of this channel.
    #[inline]
    pub(crate) fn linear(&self, c: usize, value: f32) -> f32 {
        match self {
            Response::Linear => value,
            Response::Table { levels, white } => {
                let at = (value / white * (LEVELS - 1) as f32).clamp(0.0, (LEVELS - 1) as f32);
                let i = (at as usize).min(LEVELS - 2);
                levels[c][i] + (at - i as f32) * (levels[c][i + 1] - levels[c][i])
            }
        }
    }

    /// How much the number changes from one value to the next, for the variance of rounding.
    #[inline]
    pub(crate) fn step(&self, c: usize, value: f32) -> f32 {
        match self {
            Response::Linear => 0.0,
            Response::Table { levels, white } => {
                let i = ((value / white * (LEVELS - 1) as f32) as usize).min(LEVELS - 2);
                levels[c][i + 1] - levels[c][i]
            }
        }
    }

    /// The least number of which rounding, with a standard deviation of 1 / sqrt(12) of a step, hides no more than one part in `certain`.
    pub(crate) fn least(&self, c: usize, certain: f32) -> f32 {
        match self {
            Response::Linear => 0.0,
            Response::Table { levels, .. } => {
                let is_clear =
                    |pair: &&[f32]| pair[0] > 0.0 && 12f32.sqrt() * pair[0] >= certain * (pair[1] - pair[0]);
                levels[c].windows(2).find(is_clear).map_or(levels[c][LEVELS - 1], |pair| pair[0])
            }
        }
    }

    /// Recovers the response from small copies of photographs with these relative exposures.
    pub(crate) fn recover(probes: &[Probe], exposures: &[f64], white: f32) -> Result<Response, MeasureError> {
        if probes.len() < 3 {
            return Err(MeasureError::Scene(format!(
                "{} photographs whose values are not linear; their response needs at least 3 exposures: take more, or develop RAW \
                 to linear 16-bit TIFF",
                probes.len()
            )));
        }
        let places = smooth_places(probes, white);
        let mut levels = Box::new([[0.0f32; LEVELS]; 3]);
        for (c, levels) in levels.iter_mut().enumerate() {
            *levels = channel(probes, exposures, white, &places, c).ok_or_else(|| {
                MeasureError::Scene(
                    "the response of the camera cannot be recovered: too few tones are in several photographs; take exposures a \
                     factor of 2 to 4 apart"
                        .into(),
                )
            })?;
        }
        Ok(Response::Table { levels, white })
    }
}

/// Blocks without edges whose tones spread over the levels, judged by the photograph in the middle.
fn smooth_places(probes: &[Probe], white: f32) -> Vec<usize> {
    let middle = &probes[probes.len() / 2];
    let even = |probe: &Probe, i: usize| {
        let x = i % probe.width;
        let (left, right) = (i.saturating_sub(usize::from(x > 0)), i + usize::from(x + 1 < probe.width));
        (0..3).all(|c| {
            let most = probe.mean[left][c].max(probe.mean[right][c]).max(probe.most[i][c]);
            let least = probe.mean[left][c].min(probe.mean[right][c]).min(probe.mean[i][c]);
            most - least < 0.03 * white
        })
    };
    let mut places: Vec<usize> =
        (0..middle.mean.len()).filter(|&i| probes.iter().all(|probe| even(probe, i))).collect();
    // In the order of all exposures together, so that dark and bright places count alike.
    let tone = |i: &usize| probes.iter().map(|probe| probe.mean[*i][1]).sum::<f32>();
    places.retain(|i| tone(i) > 0.02 * white);
    places.sort_by(|a, b| tone(a).total_cmp(&tone(b)));
    let step = (places.len() / PIXELS).max(1);
    places.into_iter().step_by(step).take(PIXELS).collect()
}

fn channel(
    probes: &[Probe],
    exposures: &[f64],
    white: f32,
    places: &[usize],
    c: usize,
) -> Option<[f32; LEVELS]> {
    let n = LEVELS + places.len();
    let (mut a, mut b) = (vec![0.0; n * n], vec![0.0; n]);
    let hat = |z: f64| (z.min((LEVELS - 1) as f64 - z) / 127.5).max(0.0) + 1e-3;
    let mut add = |entries: &[(usize, f64)], value: f64, weight: f64| {
        for &(i, u) in entries {
            for &(j, v) in entries {
                a[i * n + j] += weight * u * v;
            }
            b[i] += weight * u * value;
        }
    };
    let mut used = 0;
    for (k, &place) in places.iter().enumerate() {
        for (probe, exposure) in probes.iter().zip(exposures) {
            let z = f64::from(probe.mean[place][c] / white) * (LEVELS - 1) as f64;
            if !(DARKEST as f64..=249.0).contains(&z) {
                continue;
            }
            used += 1;
            let (i, part) = (z as usize, z.fract());
            add(&[(i, 1.0 - part), (i + 1, part), (LEVELS + k, -1.0)], exposure.ln(), hat(z));
        }
        // Keeps places without a usable tone determined.
        add(&[(LEVELS + k, 1.0)], 0.0, 1e-9);
    }
    for z in 1..LEVELS - 1 {
        // Over the logarithm of z, in which powers are straight.
        let at = z as f64 + 0.5;
        let (before, after) = (1.0 / (at / (at - 1.0)).ln(), 1.0 / ((at + 1.0) / at).ln());
        add(&[(z - 1, before), (z, -before - after), (z + 1, after)], 0.0, SMOOTH * at);
    }
    add(&[(LEVELS / 2, 1.0)], 0.0, 1e3);
    if used < 4 * places.len().max(10) / 3 {
        return None;
    }
    let g = Cholesky::new(&a, n)?.solve(&b);
    let mut levels = [0.0f32; LEVELS];
    let mut last = 0.0f32;
    for (level, g) in levels.iter_mut().zip(&g) {
        // More light never gives a smaller value.
        last = last.max((128.0 * g.exp()) as f32);
        *level = last;
    }
    // Below the first tones nothing is known but that light begins at 0.
    for z in 0..DARKEST {
        levels[z] = levels[DARKEST] * z as f32 / DARKEST as f32;
    }
    Some(levels)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::photo::Photo;
    use readers::Samples;

    fn taken(curve: impl Fn(f64) -> f64, exposure: f64) -> Photo {
        let (width, height) = (256, 64);
        let values = (0..width * height)
            .flat_map(|i| {
                let light = 0.002 * 600f64.powf((i % width) as f64 / 255.0);
                [(curve((light * exposure).min(1.0)) * 255.0).round() as u8; 3]
            })
            .collect();
        Photo { width, height, values: Samples::Eight(values) }
    }

    fn probe(photo: &Photo) -> Probe {
        Probe::new(photo, photo)
    }

    #[test]
    fn known_responses_are_recovered() {
        let srgb = |l: f64| if l <= 0.003_130_8 { 12.92 * l } else { 1.055 * l.powf(1.0 / 2.4) - 0.055 };
        let curves: [&dyn Fn(f64) -> f64; 3] = [&srgb, &|l: f64| l.powf(0.5), &|l: f64| l];
        for (which, curve) in curves.into_iter().enumerate() {
            let exposures = [0.25, 1.0, 4.0, 16.0];
            let probes: Vec<Probe> = exposures.iter().map(|&t| probe(&taken(curve, t))).collect();
            let response = Response::recover(&probes, &exposures, 255.0).unwrap();
            for (low, high) in [(0.05, 0.1), (0.1, 0.4), (0.2, 0.8)] {
                let linear = |l: f64| f64::from(response.linear(1, (curve(l) * 255.0) as f32));
                let ratio = linear(high) / linear(low) / (high / low);
                assert!((ratio - 1.0).abs() < 0.04, "curve {which}, {low} to {high}: {ratio}");
            }
        }
    }

    #[test]
    fn two_exposures_are_too_few() {
        let probes = [0.5, 1.0].map(|t| probe(&taken(|l| l, t)));
        let error = Response::recover(&probes, &[0.5, 1.0], 255.0).unwrap_err().to_string();
        assert!(error.contains("at least 3 exposures"), "{error}");
    }
}
