//! The stacks that can be used, in the form the solver needs.

use inks::{InkSet, Library, Severity, Stack};
use maths::Maths;

use super::rare::Brightness;
use super::settings::GamutSettings;
use super::shine::Shine;
use crate::brdf::{self, Space, Table};
use crate::solve::{Hull, LAYER_PRICE, MixtureError, SMALL, Target};

/// The stacks that can be printed with the available inks, and their curves.
#[derive(Clone, Debug, PartialEq)]
pub struct Printable {
    /// The stacks, each once.
    pub stacks: Vec<Stack>,
    /// Their reflectance in 1/sr, one per row, in the tabulation of the document.
    pub curves: Table,
    /// How many of them, from the first, are always offered; the others only where a document gains by them.
    pub usual: usize,
    /// Whether a rule advises against each: such stacks are left out where that costs next to nothing.
    pub warned: Vec<bool>,
    /// The dots of a cluster of each.
    pub clusters: Vec<f64>,
}

impl Printable {
    /// Stacks that no rule is about, in small clusters.
    pub fn new(stacks: Vec<Stack>, curves: Table) -> Printable {
        let n = stacks.len();
        Printable { usual: n, warned: vec![false; n], clusters: vec![SMALL; n], stacks, curves }
    }

    /// The stacks of a library that need only these inks, in a half-angle space.
    pub fn from_library(library: &Library, at_hand: &InkSet, space: &Space) -> Printable {
        let entries = library.at_hand(at_hand);
        let stacks: Vec<Stack> = entries.iter().map(|entry| entry.stack.clone()).collect();
        let advised =
            |stack| library.broken_rules(stack).iter().any(|rule| rule.severity == Severity::Warning);
        let warned = stacks.iter().map(advised).collect();
        let clusters = clusters(library, &stacks);
        Printable { usual: stacks.len(), stacks, curves: brdf::rows(space, entries), warned, clusters }
    }

    /// Those, and every other stack that the rules allow and the library's model tells apart.
    pub fn combined(library: &Library, at_hand: &InkSet, space: &Space) -> Printable {
        let mut printable = Printable::from_library(library, at_hand, space);
        let others = library.combinations(at_hand);
        brdf::reflectances(&others, library, space).rows().for_each(|row| printable.curves.push(row));
        printable.warned.extend(others.iter().map(|_| false));
        printable.clusters.extend(clusters(library, &others));
        printable.stacks.extend(others);
        printable
    }
}

fn clusters(library: &Library, stacks: &[Stack]) -> Vec<f64> {
    stacks.iter().map(|stack| f64::from(library.minimum_cluster(stack))).collect()
}

/// Stacks and their hulls, with and without the price of their layers.
pub(super) struct Candidates {
    pub stacks: Vec<Stack>,
    pub inks: Vec<InkSet>,
    /// Whether each is offered only where a document gains by it.
    pub extra: Vec<bool>,
    /// Whether a rule advises against each.
    pub warned: Vec<bool>,
    pub curves: Table,
    /// The albedo of each stack.
    albedo: Vec<[f64; 3]>,
    /// How bright each is.
    pub brightness: Brightness,
    /// With the price of the layers, which decides ties.
    pub priced: Hull,
    /// Without the price, for reported distances.
    pub free: Hull,
    /// How many times light counts, where a document is sharper than the inks.
    pub shine: Option<Shine>,
}

impl Candidates {
    pub fn new(space: &Space, printable: &Printable, light: f64) -> Result<Candidates, MixtureError> {
        let Printable { stacks, curves, usual, warned, clusters } = printable;
        let price: Vec<f64> = stacks.iter().map(|s| LAYER_PRICE * s.layers().len() as f64).collect();
        Ok(Candidates {
            inks: stacks.iter().map(|s| InkSet::of(s.layers().iter().copied())).collect(),
            extra: (0..stacks.len()).map(|k| k >= *usual).collect(),
            warned: warned.clone(),
            stacks: stacks.clone(),
            curves: curves.clone(),
            albedo: curves.rows().map(|row| space.albedo(row)).collect(),
            brightness: Brightness::new(space, curves),
            priced: Hull::new(space, curves, &price, light)?.in_clusters(clusters),
            free: Hull::new(space, curves, &vec![0.0; stacks.len()], light)?.in_clusters(clusters),
            shine: None,
        })
    }

    /// Those that settings ask for.
    pub fn wanted(
        space: &Space,
        printable: &Printable,
        settings: &GamutSettings,
    ) -> Result<Candidates, MixtureError> {
        let mut all = Candidates::new(space, printable, settings.light)?;
        if !settings.hue {
            (all.priced, all.free) = (all.priced.without_hue(), all.free.without_hue());
        }
        Ok(all)
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
            extra: keep.iter().map(|&k| self.extra[k]).collect(),
            warned: keep.iter().map(|&k| self.warned[k]).collect(),
            albedo: keep.iter().map(|&k| self.albedo[k]).collect(),
            brightness: self.brightness.subset(keep),
            curves,
            priced: self.priced.subset(keep),
            free: self.free.subset(keep),
            shine: self.shine.clone(),
        }
    }

    /// A row (1/sr) as a target.
    pub fn target(&self, row: &[f64]) -> Result<Target, MixtureError> {
        let mut target = Target::default();
        self.aim(row.iter().copied(), &mut target)?;
        Ok(target)
    }

    /// Aims at a reflectance (1/sr).
    pub fn aim(
        &self,
        reflectance: impl ExactSizeIterator<Item = f64>,
        target: &mut Target,
    ) -> Result<(), MixtureError> {
        self.priced.aim(reflectance, target)?;
        if let Some(shine) = &self.shine {
            target.light = shine.times(&target.summary(&self.priced));
        }
        Ok(())
    }

    /// The distance in light between a mixture and a row of the space.
    pub fn light_distance(&self, weights: &[f64], space: &Space, row: &[f32]) -> f64 {
        let mut printed = [0.0; 3];
        for (albedo, &w) in self.albedo.iter().zip(weights).filter(|(_, w)| **w > 0.0) {
            printed.iter_mut().zip(albedo).for_each(|(sum, a)| *sum += w * a);
        }
        let both = space.albedo(row).into_iter().zip(printed);
        both.map(|(a, b)| (a.cube_root() - b.cube_root()).squared()).sum::<f64>().sqrt()
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
