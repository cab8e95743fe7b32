//! The stacks that can be used, in the form the solver needs.

use inks::{InkSet, Library, Stack};

use crate::brdf::{self, Space, Table};
use crate::solve::{Hull, LAYER_PRICE, MixtureError};

/// The stacks that can be printed with the available inks, and their curves.
#[derive(Clone, Debug, PartialEq)]
pub struct Printable {
    /// The stacks, each once; at most 255 besides the substrate.
    pub stacks: Vec<Stack>,
    /// Their reflectance in 1/sr, one per row, in the tabulation of the document.
    pub curves: Table,
}

impl Printable {
    /// The stacks of a library that need only these inks, in a half-angle space.
    pub fn from_library(library: &Library, at_hand: &InkSet, space: &Space) -> Printable {
        let entries = library.at_hand(at_hand);
        let stacks = entries.iter().map(|entry| entry.stack.clone()).collect();
        Printable { stacks, curves: brdf::rows(space, entries) }
    }
}

/// Stacks and their hulls, with and without the price of their layers.
pub(super) struct Candidates {
    pub stacks: Vec<Stack>,
    pub inks: Vec<InkSet>,
    pub curves: Table,
    /// With the price of the layers, which decides ties.
    pub priced: Hull,
    /// Without the price, for reported distances.
    pub free: Hull,
}

impl Candidates {
    pub fn new(space: &Space, printable: &Printable) -> Result<Candidates, MixtureError> {
        let Printable { stacks, curves } = printable;
        let price: Vec<f64> = stacks.iter().map(|s| LAYER_PRICE * s.layers().len() as f64).collect();
        Ok(Candidates {
            inks: stacks.iter().map(|s| InkSet::of(s.layers().iter().copied())).collect(),
            stacks: stacks.clone(),
            curves: curves.clone(),
            priced: Hull::new(space, curves, &price)?,
            free: Hull::new(space, curves, &vec![0.0; stacks.len()])?,
        })
    }

    pub fn len(&self) -> usize {
        self.stacks.len()
    }

    /// Only these stacks.
    pub fn subset(&self, keep: &[usize]) -> Candidates {
        let mut curves = Table::new(self.curves.columns());
        keep.iter().for_each(|&k| curves.push(self.curves.row(k)));
        Candidates {
            stacks: keep.iter().map(|&k| self.stacks[k].clone()).collect(),
            inks: keep.iter().map(|&k| self.inks[k]).collect(),
            curves,
            priced: self.priced.subset(keep),
            free: self.free.subset(keep),
        }
    }

    /// The reflectance (1/sr) of a mixture.
    pub fn reflectance(&self, weights: impl Iterator<Item = f64>) -> Vec<f64> {
        let mut row = vec![0.0; self.curves.columns()];
        for (curve, w) in self.curves.rows().zip(weights) {
            if w != 0.0 {
                crate::solve::vector::add_scaled(&mut row, w, curve);
            }
        }
        row
    }
}
