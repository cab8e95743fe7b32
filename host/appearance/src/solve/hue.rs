//! Hue in the dark, beside the metric of equation 1.
//!
//! Problem: cube roots of little light differ little, so away from the highlight a black that is three
//! times as red as blue is as near to a dark target as one that is as blue as red; panes of one facade came
//! out wine-red beside navy. Eyes see hue relative to the light that there is.
//! Method: [`Space::dark`] gives the mean reflectance f away from the highlight, linear in the mixture, in
//! three more columns. Chromaticities `x = (f + e) / mean(f + e)` of mixture and target are compared: `h =
//! x - x'`. A mixture has them on a mean only: where it has its green from one bright dot in fifty, there
//! are places without, and they are violet. So the variance over places of the size in which an eye tells
//! hues counts beside the mean: `u^2 = |h|^2 + sum_k a_k q_k |r_k|^2`, where `r_k = (f_k - x mean(f_k)) /
//! mean(f)` (all f with e added) is what a dot of stack k does to a place's chromaticity. Moments of the
//! stacks in four more columns make that linear, too: `sum_k a_k q_k |r_k|^2 = (S - 2 x T + |x|^2 mean(T))
//! / mean(f)^2` with S of `q_k |f_k|^2` and T of `q_k mean(f_k) f_k`. The part q_k of the variance that
//! places have depends on the size of the clusters in which a stack is printed ([`in_places`]). The price
//! is `mu H(u)` with `H(u) = u - .05` beyond .1 and `u^2 / .2` below (P. J. Huber 1964): a norm, whose
//! slope stays the same however far the mixture is off in light, and not a square, whose price fades where
//! nothing else can be done either. What nobody sees costs next to nothing. A step of the solver has the
//! quadratic that touches the price of h at the last mixture and lies above it; the variance has its slope
//! alone.
//! Cost: a division and a root a step, and seven columns. Limits: not convex by itself; one hue for all of
//! the dark.

use crate::brdf::Space;
use maths::Maths as _;

/// The price of a difference in chromaticity, in the unit of the metric. Source: on a black of L* 7 an
/// error of .55 in green (a difference of .6) is 7 units of CIELAB; on a matt mid grey a unit is d = .0072,
/// so this is .083 for each.
const HUE: f64 = 0.1;
/// Differences up to this count by their square. Source: a sixth of that error, about a unit of CIELAB,
/// which is hardly seen.
const FELT: f64 = 0.1;
/// Reflectance (1/sr) that is added before hues are compared: a fifth of the darkest stack's, which no eye
/// tells from black.
const BLACK: f64 = 0.0003;
/// Dots of a place. Source: chromatic gratings are seen to some 4 cycles a degree, half a period of which
/// is a millimetre at .5 m (K. T. Mullen 1985).
const PLACE: f64 = 24.0 * 24.0;
/// Clusters of a stack in a place from which on they are spread evenly, as a halftone does, and not by
/// chance: what is left of their variance falls by the square of their number. Source: so does the power of
/// blue noise below its frequency (R. Ulichney 1988).
const EVEN: f64 = 1.5;

/// The part of a stack's variance that places have, if its clusters have so many dots: that at a share of a
/// tenth, as for the grain of luminance.
pub(super) fn in_places(dots: f64) -> f64 {
    dots / PLACE / (1.0 + (0.1 * PLACE / (EVEN * dots)).squared())
}

/// The columns of hue: mean reflectance (3), S, and T (3).
pub(super) const COLUMNS: usize = 7;

/// Where a hull has the mean reflectance of the dark.
#[derive(Clone, Debug)]
pub(super) struct Hue {
    /// The first of its [`COLUMNS`].
    pub first: usize,
    /// For each configuration, the factor from radiance to its share in the mean.
    shares: Vec<f64>,
    /// [`HUE`], [`FELT`], [`BLACK`] and 1 for the variance, or what a test puts in their place.
    pub constants: [f64; 4],
}

/// What is aimed at: a chromaticity.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Aim([f64; 3]);

/// The hue of a mixture beside that aimed at.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Missed {
    chromaticity: [f64; 3],
    off: [f64; 3],
    /// One over the mean reflectance.
    per: f64,
    /// Half the gradient of the variance over places, by mean reflectance and moments.
    varies: [f64; COLUMNS],
    /// How much the square of the difference counts in the quadratic that touches the price.
    weight: f64,
    /// The price.
    pub price: f64,
}

/// Chromaticity of a reflectance to which so much is added, and one over its mean.
#[inline(always)]
fn chromaticity(f: [f64; 3], black: f64) -> ([f64; 3], f64) {
    let f = f.map(|f| f + black);
    let per = 3.0 / (f[0] + f[1] + f[2]);
    (f.map(|f| f * per), per)
}

impl Hue {
    /// With its columns from `first` on; `None` if the space has no half angles.
    pub fn new(space: &Space, first: usize) -> Option<Hue> {
        let shares: Vec<f64> =
            space.dark().iter().zip(space.radiance().chunks_exact(3)).map(|(q, c)| q / c[0]).collect();
        (!shares.is_empty()).then_some(Hue { first, shares, constants: [HUE, FELT, BLACK, 1.0] })
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

    /// What a stack of this mean reflectance, whose variance places have this part of, has in the columns
    /// of hue.
    pub fn columns(&self, mean: [f64; 3], part: f64) -> [f64; COLUMNS] {
        let f = mean.map(|f| f + self.constants[2]);
        let grey = part * f.iter().sum::<f64>() / 3.0;
        let square = part * f.iter().map(|f| f * f).sum::<f64>();
        [mean[0], mean[1], mean[2], square, grey * f[0], grey * f[1], grey * f[2]]
    }

    /// What to aim at for a target of this mean reflectance.
    pub fn aim(&self, mean: [f64; 3]) -> Aim {
        Aim(chromaticity(mean, self.constants[2]).0)
    }

    /// The hue of a mixture, given its columns, beside that aimed at.
    #[inline(always)]
    pub fn compare(&self, aim: &Aim, columns: &[f64]) -> Missed {
        let [hue, felt, black, place] = self.constants;
        let (x, per) = chromaticity([columns[0], columns[1], columns[2]], black);
        let (square, t) = (columns[3], &columns[4..COLUMNS]);
        let (xx, xt) = (0..3).fold((0.0, 0.0), |(xx, xt), c| (xx + x[c] * x[c], xt + x[c] * t[c]));
        let grey = (t[0] + t[1] + t[2]) * (1.0 / 3.0);
        let per2 = per * per;
        let variance = (square - 2.0 * xt + xx * grey) * per2;
        let variance = if variance > 0.0 { variance } else { 0.0 };
        // Chromaticity depends on the mean reflectance: by_x is half of its gradient.
        let by_x: [f64; 3] = std::array::from_fn(|c| (x[c] * grey - t[c]) * per2);
        let along = (by_x[0] * x[0] + by_x[1] * x[1] + by_x[2] * x[2] + variance) * (1.0 / 3.0);
        let mut varies = [0.0; COLUMNS];
        for c in 0..3 {
            varies[c] = place * per * (by_x[c] - along);
            varies[4 + c] = place * per2 * (xx * (1.0 / 6.0) - x[c]);
        }
        varies[3] = 0.5 * place * per2;
        let off: [f64; 3] = std::array::from_fn(|c| x[c] - aim.0[c]);
        let far = (off[0] * off[0] + off[1] * off[1] + off[2] * off[2] + place * variance).sqrt();
        let huber = if far > felt { far - 0.5 * felt } else { 0.5 * far * far / felt };
        let weight = hue / if far > felt { far } else { felt };
        Missed { chromaticity: x, off, per, varies, weight, price: hue * huber }
    }

    /// Whether the hue of a mixture with this mean reflectance is near enough to be that aimed at: red and
    /// blue beside green within half and one and a half of what they should be.
    pub fn is_kept(&self, aim: &Aim, mean: [f64; 3]) -> bool {
        let own = mean.map(|f| f + self.constants[2]);
        [0, 2].into_iter().all(|c| (0.5..=1.5).contains(&(own[c] * aim.0[1] / (own[1] * aim.0[c]))))
    }
}

impl Missed {
    /// Half the gradient of the price, by the mixture's columns of hue, where it counts `times`.
    #[inline(always)]
    pub fn pull(&self, times: f64, pull: &mut [f64]) {
        let slope = times * self.weight * self.per;
        let along = (0..3).map(|c| self.off[c] * self.chromaticity[c]).sum::<f64>() * (1.0 / 3.0);
        pull.iter_mut().zip(&self.varies).for_each(|(pull, varies)| *pull = times * self.weight * varies);
        pull.iter_mut().zip(&self.off).for_each(|(pull, off)| *pull += slope * (off - along));
    }

    /// How the difference changes with the mixture: turns a stack's mean reflectance `from` into its row of
    /// the quadratic, where the price counts `times`.
    #[inline(always)]
    pub fn scale(&self, times: f64, from: &[f64], to: &mut [f64]) {
        let mean = (from[0] + from[1] + from[2]) * (1.0 / 3.0);
        let slope = (times * self.weight).sqrt() * self.per;
        let stacks = to.iter_mut().zip(from).zip(&self.chromaticity);
        stacks.for_each(|((to, from), c)| *to = slope * (from - c * mean));
    }
}
