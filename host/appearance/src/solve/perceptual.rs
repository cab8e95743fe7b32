//! What mixtures and targets look like: cube roots of radiance, in which the metric is Euclidean.

use super::hull::{Hull, Target};
use super::root::inverse_cbrt;
use maths::Maths;

impl Target {
    /// Cube root of the radiance, column by column.
    pub(crate) fn roots(&self) -> &[f64] {
        &self.root
    }

    /// Moves the target in cube roots. A root below 0 is no radiance, but still a point to measure the distance to.
    pub(crate) fn shift(&mut self, by: impl Iterator<Item = f64>) {
        for ((root, radiance), by) in self.root.iter_mut().zip(&mut self.radiance).zip(by) {
            *root += by;
            *radiance = root.max(0.0).cubed();
        }
    }
}

impl Hull {
    /// Cube roots of the radiance of a mixture; `out` has a place for each column of the hull.
    pub(crate) fn roots(&self, weights: &[f64], out: &mut [f64]) {
        self.mix(weights, out);
        for root in out {
            let f = root.max(self.darkest);
            let r = inverse_cbrt(f);
            *root = f * r * r;
        }
    }

    /// The root of the metric's weight of each column.
    pub(crate) fn metric(&self) -> &[f64] {
        &self.weight
    }
}
