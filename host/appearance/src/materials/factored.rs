//! A document as bases and weight maps: section 3.1 of the paper.

use super::pixels::Materials;
use crate::brdf::{Space, Table};
use crate::weights::{ONE, WeightMaps};

/// A factored document: the reflectance of each pixel is the weighted sum of the bases (section 3.1).
#[derive(Clone, Debug, PartialEq)]
pub struct Factored {
    /// The tabulation of the bases.
    pub space: Space,
    /// The bases, reflectance in 1/sr, one per row.
    pub bases: Table,
    /// Their weights; as many channels as bases.
    pub maps: WeightMaps,
}

impl Factored {
    /// The share of the document that each basis has: its mean weight. They sum to 1.
    pub fn shares(&self) -> Vec<f64> {
        let sums = self.maps.totals();
        let total: u64 = sums.iter().sum();
        sums.into_iter().map(|sum| sum as f64 / total as f64).collect()
    }
}

impl Materials for Factored {
    fn width(&self) -> usize {
        self.maps.width()
    }

    fn height(&self) -> usize {
        self.maps.height()
    }

    fn space(&self) -> &Space {
        &self.space
    }

    fn reflectance(&self, pixel: usize, out: &mut [f32]) {
        out.fill(0.0);
        self.add(pixel, 1.0, out);
    }

    fn add(&self, pixel: usize, part: f32, out: &mut [f32]) {
        for (&weight, basis) in self.maps.at(pixel).iter().zip(self.bases.rows()) {
            if weight > 0 {
                let weight = part * (f32::from(weight) / f32::from(ONE));
                for (out, &value) in out.iter_mut().zip(basis) {
                    *out += weight * value as f32;
                }
            }
        }
    }
}
