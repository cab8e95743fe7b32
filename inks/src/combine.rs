//! Stacks beyond the list of a library: what its model and its rules allow.
//!
//! Problem: a modelled library lists some dozens of stacks, but its figures describe every order of its layers, and the best
//! stack for a document may not be on the list.
//! Method: all sets of up to three inks, laid in one order that is the same for all stacks, that break no rule, not even a
//! note. With one order a sheet needs one pass for each ink. Of stacks that the model sees alike one is enough: one on the
//! list, or else the one with the fewest layers. Cost: one evaluation of the model for each set that the rules allow, one or
//! two hundred. Limits: a library with a measured stack offers only what was measured.

use maths::Maths;
use std::collections::HashSet;

use protocol::ink::Ink;

use crate::curve::Curve;
use crate::library::{Entry, Library};
use crate::lobes::Lobes;
use crate::provenance::{Provenance, Trust};
use crate::read::grid;
use crate::set::InkSet;
use crate::stack::Stack;

/// The most layers of a stack that is not on the list.
const MOST_LAYERS: usize = 3;

/// Inks from the lowest to the uppermost.
const UPWARDS: [Ink; 13] = [
    Ink::Primer,
    Ink::White,
    Ink::MetallicSilver,
    Ink::MetallicGold,
    Ink::MetallicCyan,
    Ink::MetallicMagenta,
    Ink::SilverFoil,
    Ink::GoldFoil,
    Ink::Cyan,
    Ink::Magenta,
    Ink::Yellow,
    Ink::Black,
    Ink::Finish,
];

impl Library {
    /// Whether every stack of the library is modelled.
    fn is_modelled(&self) -> bool {
        self.entries().iter().all(|entry| entry.lobes.is_some())
    }

    /// What a stack reflects (1/sr) at the given angles (radians, ascending): as the library lists it, or as its model says if
    /// all of it is modelled.
    pub fn curve_of(&self, stack: &Stack, theta: &[f64]) -> Option<Curve> {
        match self.entry(stack) {
            Some(entry) => Some(entry.curve_at(theta)),
            None if self.is_modelled() => self.optics().lobes(stack).ok().map(|lobes| lobes.curve(theta)),
            None => None,
        }
    }

    /// What is known of a stack that is not on the list but may be printed, because the model describes it and no rule forbids it.
    pub fn beyond_list(&self, stack: &Stack) -> Option<Entry> {
        let new = self.entry(stack).is_none() && stack.layers().len() <= MOST_LAYERS;
        let in_order = stack.layers().is_sorted_by(|below, above| is_above(*above, *below));
        if !(new
            && in_order
            && self.is_modelled()
            && self.trust() == Trust::All
            && self.broken_rules(stack).is_empty())
        {
            return None;
        }
        let lobes = self.optics().lobes(stack).ok()?;
        Some(Entry {
            number: self.entries().len(),
            stack: stack.clone(),
            curve: lobes.curve(&grid()),
            uncertainty: None,
            lobes: Some(lobes),
            provenance: Provenance::Modelled {
                model: self.optics().model.name.clone(),
                parameters: self.optics().parameters(stack),
            },
        })
    }

    /// Stacks of these inks that are not on the list and look like none that is: empty if a stack was measured, or if only
    /// measured ones may be used.
    pub fn combinations(&self, inks: &InkSet) -> Vec<Stack> {
        if !self.is_modelled() || self.trust() != Trust::All {
            return Vec::new();
        }
        let mut seen: HashSet<Vec<u64>> =
            self.at_hand(inks).iter().filter_map(|entry: &&Entry| entry.lobes.as_ref()).map(look).collect();
        let order: Vec<Ink> = UPWARDS.into_iter().filter(|&ink| inks.contains(ink)).collect();
        let mut found = Vec::new();
        let mut shorter = vec![Vec::new()];
        for _ in 0..MOST_LAYERS {
            let longer = shorter.iter().flat_map(|layers: &Vec<Ink>| {
                let above = order.iter().filter(|ink| layers.last().is_none_or(|top| is_above(**ink, *top)));
                above.map(|&ink| layers.iter().copied().chain([ink]).collect())
            });
            // A rule that a stack breaks is broken by whatever lies on it, too.
            let allowed: Vec<Vec<Ink>> = longer
                .filter(|layers: &Vec<Ink>| self.broken_rules(&Stack::new(layers.clone())).is_empty())
                .collect();
            for layers in &allowed {
                let stack = Stack::new(layers.clone());
                let lobes = self.optics().lobes(&stack);
                if self.entry(&stack).is_none() && lobes.is_ok_and(|lobes| seen.insert(look(&lobes))) {
                    found.push(stack);
                }
            }
            shorter = allowed;
        }
        found
    }
}

/// Whether an ink lies above another one.
fn is_above(ink: Ink, other: Ink) -> bool {
    let place = |ink: Ink| UPWARDS.iter().position(|&known| known == ink);
    place(ink) > place(other)
}

/// The reflectance at a few angles, rounded on a logarithmic scale to a thousandth.
fn look(lobes: &Lobes) -> Vec<u64> {
    let at = [0.0, 0.03, 0.1, 0.3, 0.8].into_iter().flat_map(|theta| lobes.at(theta));
    // Adding 0 turns a negative zero into the positive one.
    at.map(|f| ((1000.0 * f.max(1e-9).logarithm()).round() + 0.0).to_bits()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn combinations_keep_the_rules_and_are_new_to_the_eye() {
        let library = Library::builtin();
        for inks in [InkSet::default(), InkSet::ALL, "process".parse().unwrap(), InkSet::EMPTY] {
            let found = library.combinations(&inks);
            let theta = [0.0, 0.05, 0.2, 0.6];
            let mut all: Vec<Vec<[f64; 3]>> =
                library.at_hand(&inks).iter().map(|entry| entry.curve_at(&theta).rgb().to_vec()).collect();
            for stack in &found {
                assert!(library.broken_rules(stack).is_empty() && library.entry(stack).is_none(), "{stack}");
                assert!(inks.contains_all(stack.layers()) && stack.layers().len() <= MOST_LAYERS, "{stack}");
                assert!(stack.layers().windows(2).all(|pair| is_above(pair[1], pair[0])), "{stack}");
                let curve = library.curve_of(stack, &theta).unwrap().rgb().to_vec();
                let alike = |other: &Vec<[f64; 3]>| {
                    let both = other.iter().flatten().zip(curve.iter().flatten());
                    both.into_iter().all(|(a, b)| (a / b).ln().abs() < 3e-4)
                };
                assert!(!all.iter().any(alike), "{stack}");
                all.push(curve);
            }
            assert_eq!(found.is_empty(), inks.is_empty());
        }
    }

    /// With one order for all stacks no ink needs a second pass.
    #[test]
    fn the_stacks_on_the_list_have_the_same_order() {
        for entry in Library::builtin().entries() {
            assert!(
                entry.stack.layers().windows(2).all(|pair| is_above(pair[1], pair[0])),
                "{}",
                entry.stack
            );
        }
    }

    /// What prints may use can be looked up, with the curve that prints are predicted with; the rest cannot.
    #[test]
    fn stacks_beyond_the_list_are_those_that_are_offered() {
        let library = Library::builtin();
        let theta = [0.0, 0.2, 0.9];
        for stack in library.combinations(&InkSet::ALL) {
            let entry = library.beyond_list(&stack).unwrap_or_else(|| panic!("{stack}"));
            assert_eq!(library.curve_of(&stack, &theta).unwrap(), entry.curve_at(&theta), "{stack}");
        }
        for other in ["MS+C", "C+MS", "K+C", "substrate", "C+M+Y+K", "MS+SF"] {
            assert!(library.beyond_list(&other.parse().unwrap()).is_none(), "{other}");
        }
        let measured = library.trusting(Trust::Measured);
        assert!(measured.beyond_list(&"MS+K+F".parse().unwrap()).is_none());
    }

    #[test]
    fn black_with_colour_under_finish_is_among_them() {
        let found = Library::builtin().combinations(&"process,finish".parse().unwrap());
        for stack in ["C+K", "C+K+F", "M+Y+K"] {
            assert!(found.contains(&stack.parse().unwrap()), "{stack} {found:?}");
        }
    }
}
