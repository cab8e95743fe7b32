//! Which cartridges to load, and which to replace on the way, when a job needs more than the printer holds.
//!
//! Method: the printer starts with the cartridges needed first; before a pass whose cartridge is missing, the one goes out
//! that is needed again last, or never. No other choice needs fewer changes (Belady, 1966).
//! Cost: negligible.

use protocol::ink::Ink;

use crate::separate::MOST_CARTRIDGES;

/// A cartridge to replace in the course of a job.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Change {
    /// The pass before which the printer pauses and asks, from 1.
    pub before_pass: usize,
    /// The one to take out.
    pub out: Ink,
    /// The one it asks for.
    pub wanted: Ink,
}

/// The cartridges to load before the first pass, in the order of their first use, and the changes on the way.
pub(super) fn loading(passes: &[Ink]) -> (Vec<Ink>, Vec<Change>) {
    let mut loaded: Vec<Ink> = Vec::new();
    for &ink in passes {
        if loaded.len() < MOST_CARTRIDGES && !loaded.contains(&ink) {
            loaded.push(ink);
        }
    }
    let first = loaded.clone();
    let mut changes = Vec::new();
    for (at, &wanted) in passes.iter().enumerate() {
        if loaded.contains(&wanted) {
            continue;
        }
        let next = |ink: Ink| passes[at..].iter().position(|&pass| pass == ink).unwrap_or(usize::MAX);
        // The printer is full here, or the cartridge would have been loaded at the start.
        if let Some(place) = (0..loaded.len()).max_by_key(|&place| next(loaded[place])) {
            changes.push(Change { before_pass: at + 1, out: loaded[place], wanted });
            loaded[place] = wanted;
        }
    }
    (first, changes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::HashMap;

    /// The fewest changes from here on, by trying all.
    fn fewest(passes: &[Ink], loaded: u16, known: &mut HashMap<(usize, u16), usize>) -> usize {
        let Some((&wanted, rest)) = passes.split_first() else { return 0 };
        if let Some(&changes) = known.get(&(passes.len(), loaded)) {
            return changes;
        }
        let bit = |ink: Ink| 1u16 << Ink::ALL.iter().position(|&other| other == ink).unwrap();
        let changes = if loaded & bit(wanted) != 0 {
            fewest(rest, loaded, known)
        } else {
            let out = Ink::ALL.into_iter().filter(|&ink| loaded & bit(ink) != 0).collect::<Vec<_>>();
            let after = |ink| fewest(rest, loaded & !bit(ink) | bit(wanted), known);
            1 + out.into_iter().map(after).min().unwrap()
        };
        known.insert((passes.len(), loaded), changes);
        changes
    }

    proptest! {
        #[test]
        fn every_pass_finds_its_cartridge_with_the_fewest_changes(inks in prop::collection::vec(0usize..10, 1..16)) {
            let passes: Vec<Ink> = inks.into_iter().map(|at| Ink::ALL[at]).collect();
            let (first, changes) = loading(&passes);
            let mut loaded = first.clone();
            for (number, ink) in (1..).zip(&passes) {
                for change in changes.iter().filter(|change| change.before_pass == number) {
                    prop_assert_eq!(change.wanted, *ink);
                    let place = loaded.iter().position(|&ink| ink == change.out);
                    prop_assert!(place.is_some() && !loaded.contains(ink));
                    loaded[place.unwrap()] = *ink;
                }
                prop_assert!(loaded.contains(ink) && loaded.len() <= MOST_CARTRIDGES);
            }
            let bits = first.iter().map(|ink| 1u16 << Ink::ALL.iter().position(|other| other == ink).unwrap()).sum();
            prop_assert_eq!(changes.len(), fewest(&passes, bits, &mut HashMap::new()));
        }
    }

    #[test]
    fn seven_inks_need_no_change_however_often_they_come() {
        let passes: Vec<Ink> = Ink::ALL[..7].iter().chain(&Ink::ALL[..7]).copied().collect();
        assert_eq!(loading(&passes), (Ink::ALL[..7].to_vec(), Vec::new()));
    }
}
