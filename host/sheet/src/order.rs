//! The fewest passes in which every stack finds its layers in order.
//!
//! Problem: passes print one above the other, so a list of inks serves a stack if the stack's layers are a subsequence
//! of it; the shortest list that serves all stacks is a shortest common supersequence.
//! Method: iterative deepening. A state is how far each stack has come; printing an ink moves on every stack that waits
//! for it, which never hurts. For each ink the most often any one stack still needs it is a lower bound, summed
//! over inks; it is exact unless two stacks want two inks in opposite orders. Inks are tried in the
//! customary order from the paper up, so of all shortest lists the first in that order is found.
//! Cost: microseconds for the stacks that occur. Limits: after `MOST_STATES` states the search is given up for a
//! list that serves all stacks but may not be shortest, and says so.

use std::collections::HashMap;

use inks::Stack;
use protocol::ink::{Ink, Kind};

/// States looked at before giving up.
const MOST_STATES: usize = 200_000;

/// A list of passes.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Order {
    /// The inks, first printed first.
    pub inks: Vec<Ink>,
    /// Whether no shorter list exists.
    pub shortest: bool,
}

/// The customary place of an ink: undercoats first, opaque below transparent, clear coat last.
pub fn customary(ink: Ink) -> (u8, u8) {
    let kind = match ink.kind() {
        Kind::Primer => 0,
        Kind::White => 1,
        Kind::Metallic => 2,
        Kind::Foil => 3,
        Kind::Process => 4,
        Kind::Finish => 5,
    };
    // Black last among the process inks, as printers do.
    (kind, if ink == Ink::Black { u8::MAX } else { ink as u8 })
}

/// The passes that lay down all of these stacks, lowest first.
pub fn passes_of(stacks: &[Stack]) -> Vec<Ink> {
    order(&stacks.iter().map(Stack::layers).collect::<Vec<_>>()).inks
}

/// Passes for stacks given by their layers, bottom to top.
pub fn order(stacks: &[&[Ink]]) -> Order {
    let mut wanted: Vec<&[Ink]> = Vec::new();
    for &stack in stacks {
        let served = |by: &[Ink]| embed(stack, by).is_some();
        if !stack.is_empty() && !wanted.iter().any(|w| served(w)) {
            wanted.retain(|w| embed(w, stack).is_none());
            wanted.push(stack);
        }
    }
    let mut inks: Vec<Ink> = wanted.iter().flat_map(|w| w.iter().copied()).collect();
    inks.sort_by_key(|&ink| customary(ink));
    inks.dedup();
    let mut search = Search { wanted, inks, failed: HashMap::new(), states: 0, found: Vec::new() };
    let start = vec![0u8; search.wanted.len()];
    let mut length = search.bound(&start);
    loop {
        match search.reach(&start, length) {
            Some(true) => return Order { inks: search.found, shortest: true },
            Some(false) => length += 1,
            None => return Order { inks: search.any(start), shortest: false },
        }
    }
}

/// The first places in `passes` where `layers` are found in order.
pub fn embed(layers: &[Ink], passes: &[Ink]) -> Option<Vec<usize>> {
    let mut places = Vec::with_capacity(layers.len());
    let mut from = 0;
    for layer in layers {
        let at = from + passes[from..].iter().position(|pass| pass == layer)?;
        places.push(at);
        from = at + 1;
    }
    Some(places)
}

struct Search<'a> {
    wanted: Vec<&'a [Ink]>,
    /// The inks in use, in customary order.
    inks: Vec<Ink>,
    /// States from which so many more passes were not enough.
    failed: HashMap<Vec<u8>, usize>,
    states: usize,
    found: Vec<Ink>,
}

impl Search<'_> {
    /// At least so many more passes.
    fn bound(&self, state: &[u8]) -> usize {
        let needs = |ink: Ink| {
            let rest = self.wanted.iter().zip(state).map(|(w, &at)| &w[usize::from(at)..]);
            rest.map(|rest| rest.iter().filter(|&&layer| layer == ink).count()).max().unwrap_or(0)
        };
        self.inks.iter().map(|&ink| needs(ink)).sum()
    }

    /// The state after a pass of `ink`; `None` if no stack waits for it.
    fn print(&self, state: &[u8], ink: Ink) -> Option<Vec<u8>> {
        let mut next = state.to_vec();
        let mut moved = false;
        for (at, wanted) in next.iter_mut().zip(&self.wanted) {
            if wanted.get(usize::from(*at)) == Some(&ink) {
                *at += 1;
                moved = true;
            }
        }
        moved.then_some(next)
    }

    /// Whether the end can be reached in `passes` more; `None` when the states are used up.
    fn reach(&mut self, state: &[u8], passes: usize) -> Option<bool> {
        let bound = self.bound(state);
        if bound == 0 {
            return Some(true);
        }
        if bound > passes || self.failed.get(state).is_some_and(|&enough| enough >= passes) {
            return Some(false);
        }
        self.states += 1;
        if self.states > MOST_STATES {
            return None;
        }
        for i in 0..self.inks.len() {
            let ink = self.inks[i];
            let Some(next) = self.print(state, ink) else { continue };
            self.found.push(ink);
            if self.reach(&next, passes - 1)? {
                return Some(true);
            }
            self.found.pop();
        }
        self.failed.insert(state.to_vec(), passes);
        Some(false)
    }

    /// A list that serves all, each pass the one that leaves the least to do.
    fn any(&self, mut state: Vec<u8>) -> Vec<Ink> {
        let mut inks = Vec::new();
        while self.bound(&state) > 0 {
            let step = |&ink: &Ink| self.print(&state, ink).map(|next| (ink, next));
            let rest = |next: &[u8]| {
                let layers = self.wanted.iter().zip(next).map(|(w, &at)| w.len() - usize::from(at));
                (self.bound(next), layers.sum::<usize>())
            };
            let Some((ink, next)) = self.inks.iter().filter_map(step).min_by_key(|(_, next)| rest(next))
            else {
                break;
            };
            inks.push(ink);
            state = next;
        }
        inks
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Tries every list of passes, shortest first.
    fn shortest_by_trying(stacks: &[Vec<Ink>], inks: &[Ink]) -> usize {
        let mut lists = vec![Vec::new()];
        for length in 0.. {
            if lists.iter().any(|list| stacks.iter().all(|stack| embed(stack, list).is_some())) {
                return length;
            }
            lists = lists
                .iter()
                .flat_map(|list: &Vec<Ink>| inks.iter().map(|&ink| [list.as_slice(), &[ink]].concat()))
                .collect();
        }
        unreachable!()
    }

    proptest! {
        #[test]
        fn no_list_of_passes_is_shorter(
            stacks in prop::collection::vec(prop::collection::vec(0usize..3, 0..5), 1..6)
        ) {
            let inks = [Ink::Cyan, Ink::Finish, Ink::Primer];
            let stacks: Vec<Vec<Ink>> =
                stacks.iter().map(|s| s.iter().map(|&i| inks[i]).collect()).collect();
            let order = order(&stacks.iter().map(Vec::as_slice).collect::<Vec<_>>());
            prop_assert!(order.shortest);
            prop_assert!(stacks.iter().all(|stack| embed(stack, &order.inks).is_some()));
            prop_assert_eq!(order.inks.len(), shortest_by_trying(&stacks, &inks));
        }

        #[test]
        fn tangled_stacks_are_served_in_bounded_time(
            stacks in prop::collection::vec(prop::collection::vec(0usize..13, 0..9), 1..60)
        ) {
            let stacks: Vec<Vec<Ink>> =
                stacks.iter().map(|s| s.iter().map(|&i| Ink::ALL[i]).collect()).collect();
            // Only the greedy way out is meant here; the search itself is stopped at once.
            let wanted: Vec<&[Ink]> = stacks.iter().map(Vec::as_slice).collect();
            let search = Search {
                inks: Ink::ALL.to_vec(), failed: HashMap::new(), states: 0, found: Vec::new(), wanted,
            };
            let inks = search.any(vec![0; stacks.len()]);
            prop_assert!(stacks.iter().all(|stack| embed(stack, &inks).is_some()));
        }
    }

    #[test]
    fn the_customary_order_breaks_ties_and_an_ink_may_come_twice() {
        use Ink::*;
        let list = |stacks: &[&[Ink]]| order(stacks).inks;
        assert_eq!(list(&[&[Finish], &[Black], &[Cyan], &[Primer]]), [Primer, Cyan, Black, Finish]);
        assert_eq!(list(&[&[MetallicSilver, Cyan], &[Cyan, Finish], &[]]), [MetallicSilver, Cyan, Finish]);
        let even_white: &[Ink] = &[Black, Primer, Finish, Primer, White];
        assert_eq!(list(&[even_white]), even_white);
        assert_eq!(list(&[&[Cyan, White], &[White, Cyan]]), [White, Cyan, White]);
        assert!(list(&[&[]]).is_empty());
    }
}
