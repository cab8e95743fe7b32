//! The two sides of equation 1 in the form the metric needs: the stacks that can be mixed, and a target.
//!
//! Problem: the metric compares cube roots of reflected radiance, weighted by column; tables hold
//! reflectance.
//! Method: both are converted to radiance once, targets also to cube roots, and checked, so that the solver
//! ([`super::Mixer`]) receives only finite numbers of 0 or more. With a weight for light, three more
//! columns hold the albedo of each channel ([`Space::albedo`]); it is linear in the mixture like every
//! other column. Then a mixture also pays for its grain: `Σ_k a_k D_k^2`, D_k being the distance of stack k
//! by itself, is the variance of its dots and the square of what it misses.
//! Cost: one multiplication per number and one cube root per column of a target. Limits: radiance below a
//! trillionth of the brightest stack counts as that much, since the cube root has no finite slope at 0.
//! Source: the appendix of the 2009 paper.

use crate::brdf::{Space, Table};

use super::columns::Columns;
use super::hue::{Aim, COLUMNS, Hue, in_places};
use super::root::inverse_cbrt;
use super::simplex::SimplexError;
use super::vector::add_scaled;
use crate::wide::wide;
use maths::Maths as _;

/// The number of columns is a multiple of this, so that sums are equal on every processor.
const LANES: usize = 8;

/// Price of one layer of ink, in units of squared distance. It decides between mixtures that would look
/// alike: a tenth of what is barely visible, squared.
pub(crate) const LAYER_PRICE: f64 = 1e-6;

/// The part of the variance of a stack that is seen where mixtures are chosen: that of one with a share of
/// a tenth. Of mixtures that look the same it prefers the one with the least grain; rare stacks are judged
/// afterwards, by what is seen of theirs.
/// Source: clusters of three dots with a share a lie sqrt(a) / .127 mm apart, and the contrast sensitivity
/// exp(-f / 5.17 cycles a degree) at .5 m passes exp(-26.6 sqrt(a)) of the variance.
const GRAIN: f64 = 0.0002;

/// Dots of a cluster of process inks. Source: the built-in library.
pub(crate) const SMALL: f64 = 4.0;

/// The part of the variance of a stack with this share that an eye sees at .5 m. Source: as for [`GRAIN`].
pub(crate) fn seen_of_share(share: f64) -> f64 {
    (-26.6 * share.sqrt()).exponential()
}

/// Darkest radiance that differs from black, relative to the brightest radiance of any stack: its cube root
/// is 1e-4 of the brightest one's, so that nobody sees it.
pub(super) const DARKEST: f64 = 1e-12;

/// Why there is no mixture.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MixtureError {
    /// There are no stacks.
    #[error("there is no stack to mix from")]
    NoStacks,
    /// The stacks or the target belong to another tabulation.
    #[error("{what} has {found} columns, but the space has {expected}")]
    Columns {
        /// A stack or the target.
        what: &'static str,
        /// Columns of the space.
        expected: usize,
        /// Columns found.
        found: usize,
    },
    /// The number of prices or weights differs from the number of stacks.
    #[error("{stacks} stacks need one price and one weight each; found {found}")]
    Length {
        /// Stacks.
        stacks: usize,
        /// Numbers given.
        found: usize,
    },
    /// A reflectance is not a number, infinite or negative.
    #[error("{what}, column {column}: the reflectance {value} is not a finite number of 0 or more")]
    Value {
        /// A stack or the target.
        what: &'static str,
        /// The column.
        column: usize,
        /// The value.
        value: f64,
    },
    /// Products of the numbers overflow.
    #[error(transparent)]
    Simplex(#[from] SimplexError),
}

/// Stacks that can be mixed: reflected radiance, weights of the columns, prices.
#[derive(Clone, Debug)]
pub struct Hull {
    /// For each column of the space, the factor from reflectance to radiance.
    radiance: Vec<f64>,
    /// For each configuration, the factor from radiance to its share in the albedo; empty without a weight
    /// for light.
    light: Vec<f64>,
    pub(super) hue: Option<Hue>,
    pub(super) weight: Vec<f64>,
    pub(super) rows: Table,
    /// The same rows by column.
    pub(super) by_column: Columns,
    pub(super) price: Vec<f64>,
    pub(super) darkest: f64,
    /// The cube roots of every stack by itself, by column, and the squares of their weighted lengths, without
    /// light and of light alone.
    looks: Columns,
    sizes: Vec<[f64; 2]>,
    /// What the squared distance of every stack from the target counts in a mixture, by its share:
    /// [`GRAIN`] or, without a weight for light, nothing.
    grain: f64,
}

/// A target: its radiance and the cube roots of it.
#[derive(Clone, Debug, Default)]
pub struct Target {
    pub(super) radiance: Vec<f64>,
    pub(super) root: Vec<f64>,
    /// Its hue away from the highlight, if the hull knows it.
    pub(super) hue: Option<Aim>,
    /// How many times the weight that the hull gives to light it has for this target.
    pub(crate) light: f64,
}

impl Target {
    /// Integral of the cube root of the target's radiance over the metric's measure, all channels.
    pub(crate) fn brightness(&self, hull: &Hull) -> f64 {
        let curve = self.root.iter().zip(&hull.weight).take(hull.curve_columns());
        curve.map(|(root, w)| root * w * w).sum()
    }

    /// The number of its columns.
    pub(crate) fn columns(&self) -> usize {
        self.root.len()
    }

    /// The weighted cube roots of evenly spaced columns: a rough measure of how far two targets are apart.
    pub(crate) fn summary<const N: usize>(&self, hull: &Hull) -> [f32; N] {
        let m = self.root.len();
        let column = |i: usize| (2 * i + 1) * m / (2 * N);
        std::array::from_fn(|i| (self.root[column(i)] * hull.weight[column(i)]) as f32)
    }
}

/// Appends the albedo of each channel to the radiances of a row, given the share of each configuration.
fn append_albedo(light: &[f64], radiance: &mut Vec<f64>) {
    if light.is_empty() {
        return;
    }
    let mut albedo = [0.0; 3];
    for (&q, f) in light.iter().zip(radiance.chunks_exact(3)) {
        albedo.iter_mut().zip(f).for_each(|(a, &f)| *a += q * f);
    }
    radiance.extend(albedo);
}

impl Hull {
    /// The hull of stacks given as reflectance rows of `space` (1/sr), with the price of each in units of
    /// squared distance. Prices decide ties; 0 for none. `light` is the weight of the distance in light
    /// beside that of eqs. 2-3, which is all there is if it is 0 or the space has no half angles.
    pub fn new(space: &Space, curves: &Table, price: &[f64], light: f64) -> Result<Hull, MixtureError> {
        let m = space.columns();
        if curves.is_empty() {
            return Err(MixtureError::NoStacks);
        }
        if curves.columns() != m {
            return Err(MixtureError::Columns { what: "a stack", expected: m, found: curves.columns() });
        }
        if price.len() != curves.len() {
            return Err(MixtureError::Length { stacks: curves.len(), found: price.len() });
        }
        let shares = space.light().iter().zip(space.radiance().chunks_exact(3)).map(|(q, c)| q / c[0]);
        let light_of_radiance: Vec<f64> = if light > 0.0 { shares.collect() } else { Vec::new() };
        let mut weight = space.weight().to_vec();
        if !light_of_radiance.is_empty() {
            weight.extend([light; 3]);
        }
        let hue = if light_of_radiance.is_empty() { None } else { Hue::new(space, weight.len()) };
        if hue.is_some() {
            // Hue is compared by itself.
            weight.extend([0.0; COLUMNS]);
        }
        // Columns of no weight, so that the loops over them have no rest.
        weight.resize(weight.len().next_multiple_of(LANES), 0.0);
        let mut rows = Table::new(weight.len());
        let mut brightest = 0.0f64;
        let mut radiance = Vec::with_capacity(weight.len());
        for row in curves.rows() {
            radiance.clear();
            for (j, (&f, c)) in row.iter().zip(space.radiance()).enumerate() {
                if !(f.is_finite() && f >= 0.0) {
                    return Err(MixtureError::Value { what: "a stack", column: j, value: f });
                }
                radiance.push(f * c);
                brightest = brightest.max(f * c);
            }
            let dark = hue.as_ref().map(|hue| hue.columns(hue.mean(&radiance), in_places(SMALL)));
            append_albedo(&light_of_radiance, &mut radiance);
            radiance.extend(dark.into_iter().flatten());
            radiance.resize(weight.len(), 0.0);
            rows.push(&radiance);
        }
        let darkest = DARKEST * if brightest > 0.0 { brightest } else { 1.0 };
        let darkest = darkest.max(f64::MIN_POSITIVE);
        let (looks, sizes) = looks(&rows, &weight, m, darkest);
        Ok(Hull {
            radiance: space.radiance().to_vec(),
            grain: if light_of_radiance.is_empty() { 0.0 } else { GRAIN },
            light: light_of_radiance,
            hue,
            weight,
            by_column: Columns::of_rows(&rows),
            rows,
            price: price.to_vec(),
            darkest,
            looks,
            sizes,
        })
    }

    /// The hull of some of the stacks.
    pub(crate) fn subset(&self, stacks: &[usize]) -> Hull {
        let mut rows = Table::new(self.rows.columns());
        stacks.iter().for_each(|&k| rows.push(self.rows.row(k)));
        let price = stacks.iter().map(|&k| self.price[k]).collect();
        let (looks, sizes) = looks(&rows, &self.weight, self.curve_columns(), self.darkest);
        Hull {
            radiance: self.radiance.clone(),
            light: self.light.clone(),
            hue: self.hue.clone(),
            weight: self.weight.clone(),
            by_column: Columns::of_rows(&rows),
            rows,
            price,
            darkest: self.darkest,
            looks,
            sizes,
            grain: self.grain,
        }
    }

    /// The same stacks in clusters of so many dots each, of which those of a new hull have [`SMALL`].
    pub(crate) fn in_clusters(mut self, dots: &[f64]) -> Hull {
        if let Some(hue) = &self.hue {
            let mut rows = Table::new(self.rows.columns());
            for (row, &dots) in self.rows.rows().zip(dots) {
                let mut row = row.to_vec();
                let columns = hue.columns(std::array::from_fn(|c| row[hue.first + c]), in_places(dots));
                row[hue.first..][..COLUMNS].copy_from_slice(&columns);
                rows.push(&row);
            }
            self.by_column = Columns::of_rows(&rows);
            self.rows = rows;
        }
        self
    }

    /// The same where hue has no price.
    pub(crate) fn without_hue(self) -> Hull {
        Hull { hue: None, ..self }
    }

    /// The same with multiples of the constants of hue, in their order, and of the price of grain; in
    /// clusters of [`SMALL`] dots.
    #[cfg(test)]
    pub(crate) fn with_constants(mut self, times: [f64; 5]) -> Hull {
        let constants = self.hue.iter_mut().flat_map(|hue| &mut hue.constants);
        constants.zip(times).for_each(|(constant, times)| *constant *= times);
        self.grain *= times[4];
        let dots = vec![SMALL; self.len()];
        self.in_clusters(&dots)
    }

    /// Number of stacks.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Always false: a hull has at least one stack.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Number of columns, those of light and those without weight included.
    pub(super) fn columns(&self) -> usize {
        self.rows.columns()
    }

    /// Number of columns of eqs. 2-3, which come first.
    pub(super) fn curve_columns(&self) -> usize {
        self.radiance.len()
    }

    /// A target from a row of reflectance (1/sr). Values below 0 count as 0.
    pub fn target(&self, reflectance: &[f64]) -> Result<Target, MixtureError> {
        let mut target = Target::default();
        self.aim(reflectance.iter().copied(), &mut target)?;
        Ok(target)
    }

    /// Like [`Hull::target`], but reuses the memory of an existing target.
    pub(crate) fn aim(
        &self,
        reflectance: impl ExactSizeIterator<Item = f64>,
        target: &mut Target,
    ) -> Result<(), MixtureError> {
        let expected = self.radiance.len();
        if reflectance.len() != expected {
            return Err(MixtureError::Columns { what: "the target", expected, found: reflectance.len() });
        }
        target.radiance.clear();
        target
            .radiance
            .extend(reflectance.zip(&self.radiance).map(|(f, c)| if f < 0.0 { 0.0 } else { f * c }));
        target.light = 1.0;
        target.hue = self.hue.as_ref().map(|hue| hue.aim(hue.mean(&target.radiance)));
        append_albedo(&self.light, &mut target.radiance);
        target.radiance.resize(self.columns(), 0.0);
        target.root.resize(self.columns(), 0.0);
        let (radiance, roots) = (&target.radiance[..], &mut target.root[..]);
        wide(
            #[inline(always)]
            || {
                for (root, &t) in roots.iter_mut().zip(radiance) {
                    // Values too small for the root count as black.
                    let r = inverse_cbrt(if t > f64::MIN_POSITIVE { t } else { f64::MIN_POSITIVE });
                    *root = t * r * r;
                }
            },
        );
        match target.radiance.iter().position(|t| !t.is_finite()) {
            Some(column) => {
                Err(MixtureError::Value { what: "the target", column, value: target.radiance[column] })
            }
            None => Ok(()),
        }
    }

    /// Whether a mixture keeps the hue of a target in the dark, as far as people would call it the same.
    pub(crate) fn keeps_hue(&self, weights: &[f64], target: &Target) -> bool {
        let (Some(hue), Some(aim)) = (&self.hue, &target.hue) else { return true };
        let mut mean = [0.0; 3];
        for (row, &w) in self.rows.rows().zip(weights).filter(|(_, w)| **w > 0.0) {
            mean.iter_mut().zip(&row[hue.first..]).for_each(|(mean, f)| *mean += w * f);
        }
        hue.is_kept(aim, mean)
    }

    /// The weights of the columns for a target.
    #[inline(always)]
    pub(super) fn weigh(&self, target: &Target, weight: &mut Vec<f64>) {
        weight.clear();
        weight.extend_from_slice(&self.weight);
        if !self.light.is_empty() {
            weight[self.curve_columns()..][..3].iter_mut().for_each(|weight| *weight *= target.light);
        }
    }

    /// The squared distance of every stack by itself from a target whose columns have these weights, light
    /// included.
    #[inline(always)]
    pub(super) fn apart(&self, target: &Target, weight: &[f64], wanted: &mut [f64], out: &mut [f64]) {
        let mut size = 0.0;
        for ((wanted, root), weight) in wanted.iter_mut().zip(&target.root).zip(weight) {
            let weighted = root * weight;
            *wanted = weighted * weight;
            size += weighted * weighted;
        }
        self.looks.multiply(wanted, out);
        let light = target.light * target.light;
        for (out, [own, own_light]) in out.iter_mut().zip(&self.sizes) {
            let squared = own + light * own_light + size - 2.0 * *out;
            *out = if squared > 0.0 { squared } else { 0.0 };
        }
    }

    /// What each stack adds to the square under the root of the objective, by its share, given how far it
    /// is from the target by itself: grain and its price.
    #[inline(always)]
    pub(super) fn costs(&self, apart: &[f64], out: &mut [f64]) {
        for ((out, apart), price) in out.iter_mut().zip(apart).zip(&self.price) {
            *out = self.grain * apart + price;
        }
    }

    /// The reflected radiance of a mixture.
    #[inline(always)]
    pub(super) fn mix(&self, weights: &[f64], out: &mut [f64]) {
        out.fill(0.0);
        for (k, &w) in weights.iter().enumerate() {
            if w != 0.0 {
                add_scaled(out, w, self.rows.row(k));
            }
        }
    }
}

/// The cube roots of stacks by column, and the squares of the weighted lengths of each: of the first
/// `curve` columns, and of those of light.
fn looks(rows: &Table, weight: &[f64], curve: usize, darkest: f64) -> (Columns, Vec<[f64; 2]>) {
    let mut looks = Table::new(rows.columns());
    let mut sizes = Vec::new();
    for row in rows.rows() {
        let look: Vec<f64> = row.iter().map(|&f| root_of(f.max(darkest))).collect();
        let length = |range: std::ops::Range<usize>| {
            let columns = look[range.clone()].iter().zip(&weight[range]);
            columns.map(|(root, weight)| (root * weight).squared()).sum()
        };
        sizes.push([length(0..curve), length(curve..look.len())]);
        looks.push(&look);
    }
    (Columns::of_rows(&looks), sizes)
}

/// The cube root of a normal positive number.
#[inline(always)]
fn root_of(f: f64) -> f64 {
    let r = inverse_cbrt(f);
    f * r * r
}
