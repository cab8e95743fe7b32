//! Hue in the dark, beside the metric of equation 1.
//!
//! Problem: cube roots of little light differ little, so away from the highlight a black that is three times as red as blue is as
//! near to a dark target as one that is as blue as red; panes of one facade came out wine-red beside navy. Eyes see hue relative
//! to the light that there is.
//! Method: [`Space::dark`] gives the mean reflectance f away from the highlight, linear in the mixture, in three more columns.
//! Chromaticities `x = (f + e) / mean(f + e)` of mixture and target are compared: `w^2 |x - x'|^2` is added to the objective. The
//! weight w falls as the target gets lighter, where equation 1 sees hue itself, and e is what no eye tells from black. It is a
//! rational function, so results are equal on every machine.
//! Cost: one division a step, and columns that would be padding otherwise. Limits: not convex by itself; one hue for all of the
//! dark.

use crate::brdf::Space;

/// Weight of a difference in chromaticity beside a difference in cube roots, for a black target.
const HUE: f64 = 0.032;
/// Mean reflectance (1/sr) of a target whose hue counts half as much: a matt surface of 3 %.
const LIGHT: f64 = 0.01;
/// Reflectance (1/sr) that is added before hues are compared: a fifth of the darkest stack's.
const BLACK: f64 = 0.0003;

/// Where a hull has the mean reflectance of the dark.
#[derive(Clone, Debug)]
pub(super) struct Hue {
    /// The first of its three columns.
    pub first: usize,
    /// For each configuration, the factor from radiance to its share in the mean.
    shares: Vec<f64>,
    /// [`HUE`], [`LIGHT`] and [`BLACK`], or what a test puts in their place.
    pub constants: [f64; 3],
}

/// What is aimed at.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Aim {
    chromaticity: [f64; 3],
    weight: f64,
    black: f64,
}

/// The hue of a mixture beside that aimed at.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Missed {
    chromaticity: [f64; 3],
    /// The weight over the mean reflectance.
    slope: f64,
}

/// Chromaticity of a reflectance to which so much is added, and its mean.
#[inline(always)]
fn chromaticity(f: [f64; 3], black: f64) -> ([f64; 3], f64) {
    let f = f.map(|f| f + black);
    let mean = (f[0] + f[1] + f[2]) * (1.0 / 3.0);
    let per = 1.0 / mean;
    (f.map(|f| f * per), mean)
}

impl Hue {
    /// With its columns from `first` on; `None` if the space has no half angles.
    pub fn new(space: &Space, first: usize) -> Option<Hue> {
        let shares: Vec<f64> =
            space.dark().iter().zip(space.radiance().chunks_exact(3)).map(|(q, c)| q / c[0]).collect();
        (!shares.is_empty()).then_some(Hue { first, shares, constants: [HUE, LIGHT, BLACK] })
    }

    /// The mean reflectance of a row of radiances.
    #[inline(always)]
    pub fn mean(&self, radiance: &[f64]) -> [f64; 3] {
        let mut mean = [0.0; 3];
        for (&q, f) in self.shares.iter().zip(radiance.chunks_exact(3)) {
            mean.iter_mut().zip(f).for_each(|(mean, &f)| *mean += q * f);
        }
        mean
    }

    /// What to aim at for a target of this mean reflectance.
    pub fn aim(&self, mean: [f64; 3]) -> Aim {
        let [hue, light, black] = self.constants;
        let (chromaticity, level) = chromaticity(mean, black);
        Aim { chromaticity, weight: hue / (1.0 + level / light), black }
    }
}

impl Aim {
    /// The weighted difference of a mixture's hue, its slope, and `pull`, their product: half the gradient.
    #[inline(always)]
    pub fn compare(&self, mean: [f64; 3], residual: &mut [f64], pull: &mut [f64]) -> Missed {
        let (chromaticity, level) = chromaticity(mean, self.black);
        let slope = self.weight / level;
        let mut along = 0.0;
        for c in 0..3 {
            residual[c] = self.weight * (chromaticity[c] - self.chromaticity[c]);
            along += residual[c] * chromaticity[c];
        }
        for c in 0..3 {
            pull[c] = slope * (residual[c] - along * (1.0 / 3.0));
        }
        Missed { chromaticity, slope }
    }
}

impl Missed {
    /// How the weighted difference changes with the mixture: turns a stack's mean reflectance `from` into its row of the
    /// quadratic.
    #[inline(always)]
    pub fn scale(&self, from: &[f64], to: &mut [f64]) {
        let mean = (from[0] + from[1] + from[2]) * (1.0 / 3.0);
        for c in 0..3 {
            to[c] = self.slope * (from[c] - self.chromaticity[c] * mean);
        }
    }
}
