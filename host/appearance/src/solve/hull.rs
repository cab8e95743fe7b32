//! The two sides of equation 1 in the form the metric needs: the stacks that can be mixed, and a target.
//!
//! Problem: the metric compares cube roots of reflected radiance, weighted by column; tables hold reflectance.
//! Method: both are converted to radiance once, targets also to cube roots, and checked, so that the solver
//! ([`super::Mixer`]) receives only finite numbers of 0 or more. With a weight for light, three more columns hold the albedo
//! of each channel ([`Space::albedo`]); it is linear in the mixture like every other column.
//! Cost: one multiplication per number and one cube root per column of a target. Limits: radiance below a trillionth of
//! the brightest stack counts as that much, since the cube root has no finite slope at 0.
//! Source: the appendix of the 2009 paper.

use crate::brdf::{Space, Table};

use super::columns::Columns;
use super::hue::{Aim, Hue};
use super::root::inverse_cbrt;
use super::simplex::SimplexError;
use super::vector::add_scaled;
use crate::wide::wide;

/// The number of columns is a multiple of this, so that sums are equal on every processor.
const LANES: usize = 8;

/// Price of one layer of ink, in units of squared distance. It decides between mixtures that would look
/// alike: a tenth of what is barely visible, squared.
pub(crate) const LAYER_PRICE: f64 = 1e-6;

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
    /// For each configuration, the factor from radiance to its share in the albedo; empty without a weight for light.
    light: Vec<f64>,
    pub(super) hue: Option<Hue>,
    pub(super) weight: Vec<f64>,
    pub(super) rows: Table,
    /// The same rows by column.
    pub(super) by_column: Columns,
    pub(super) price: Vec<f64>,
    pub(super) darkest: f64,
}

/// A target: its radiance and the cube roots of it.
#[derive(Clone, Debug, Default)]
pub struct Target {
    pub(super) radiance: Vec<f64>,
    pub(super) root: Vec<f64>,
    /// Its hue away from the highlight, if the hull knows it.
    pub(super) hue: Option<Aim>,
}

impl Target {
    /// Integral of the cube root of the target's radiance over the metric's measure, all channels.
    pub(crate) fn brightness(&self, hull: &Hull) -> f64 {
        let curve = self.root.iter().zip(&hull.weight).take(hull.curve_columns());
        curve.map(|(root, w)| root * w * w).sum()
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
    /// The hull of stacks given as reflectance rows of `space` (1/sr), with the price of each in units of squared distance.
    /// Prices decide ties; 0 for none. `light` is the weight of the distance in light beside that of eqs. 2-3, which is all
    /// there is if it is 0 or the space has no half angles.
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
            weight.extend([0.0; 3]);
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
            let dark = hue.as_ref().map(|hue| hue.mean(&radiance));
            append_albedo(&light_of_radiance, &mut radiance);
            radiance.extend(dark.into_iter().flatten());
            radiance.resize(weight.len(), 0.0);
            rows.push(&radiance);
        }
        let darkest = DARKEST * if brightest > 0.0 { brightest } else { 1.0 };
        Ok(Hull {
            radiance: space.radiance().to_vec(),
            light: light_of_radiance,
            hue,
            weight,
            by_column: Columns::of_rows(&rows),
            rows,
            price: price.to_vec(),
            darkest: darkest.max(f64::MIN_POSITIVE),
        })
    }

    /// The hull of some of the stacks.
    pub(crate) fn subset(&self, stacks: &[usize]) -> Hull {
        let mut rows = Table::new(self.rows.columns());
        stacks.iter().for_each(|&k| rows.push(self.rows.row(k)));
        let price = stacks.iter().map(|&k| self.price[k]).collect();
        let by_column = Columns::of_rows(&rows);
        let (radiance, light, hue) = (self.radiance.clone(), self.light.clone(), self.hue.clone());
        Hull {
            radiance,
            light,
            hue,
            weight: self.weight.clone(),
            by_column,
            rows,
            price,
            darkest: self.darkest,
        }
    }

    /// The same without hue in the dark.
    #[cfg(test)]
    pub(crate) fn blind_to_hue(self) -> Hull {
        self.with_hue([0.0, 1.0, 1.0])
    }

    /// The same with multiples of the weight of hue, of the light at which it counts half, and of what is added before it is compared.
    #[cfg(test)]
    pub(crate) fn with_hue(mut self, times: [f64; 3]) -> Hull {
        let constants = self.hue.iter_mut().flat_map(|hue| &mut hue.constants);
        constants.zip(times).for_each(|(constant, times)| *constant *= times);
        self
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

    /// The distance between a mixture and a target, with light and hue in the dark.
    pub(crate) fn distance(&self, weights: &[f64], target: &Target) -> f64 {
        let mut mix = vec![0.0; self.columns()];
        self.mix(weights, &mut mix);
        let mut sum = 0.0;
        for ((w, &f), root) in self.weight.iter().zip(&mix).zip(&target.root) {
            let f = f.max(self.darkest);
            let r = inverse_cbrt(f);
            let d = w * (f * r * r - root);
            sum += d * d;
        }
        if let (Some(hue), Some(aim)) = (&self.hue, &target.hue) {
            let (mut missed, mut pull) = ([0.0; 3], [0.0; 3]);
            aim.compare(std::array::from_fn(|c| mix[hue.first + c]), &mut missed, &mut pull);
            sum += missed.iter().map(|m| m * m).sum::<f64>();
        }
        sum.sqrt()
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
