//! Choosing stacks for a document out of all that the rules allow.
//!
//! Problem: the model tells hundreds of stacks apart, of which a document gains by a few, and some of the
//! usual ones print badly.
//! Method: a sample is fitted to all stacks of the chosen cartridges. Of those beyond the usual ones, the
//! ones with the largest shares stay, and so do those with the largest shares where no stack may be used
//! that a rule advises against: what takes such a stack's place has no share beside it. Then the stacks
//! advised against are left out, all of them or those in least use first, as long as the sample stays
//! within 1 % of the distance it had. Cost: one fit of the sample, and one of the targets concerned for
//! each such stack.

use super::fitted::{Fitted, Targets};
use crate::gamut::candidates::Candidates;
use crate::solve::MixtureError;

/// The most stacks beyond the usual ones (decisions/metric-that-knows-light.md).
const MOST_EXTRA: usize = 24;
/// The share of the document from which a stack is worth it (decisions/metric-that-knows-light.md).
const WORTH: f64 = 0.002;

/// How much the mean squared distance may grow for the sake of stacks that print well: 1 % of the distance.
const SLACK: f64 = 1.01 * 1.01;
/// The growth that nobody sees, in squared distance: a hundredth of what is barely visible, squared.
const UNSEEN: f64 = 1e-8;

/// Which of the stacks `allowed` to mix from.
pub(crate) fn choose(
    candidates: &Candidates,
    allowed: &[usize],
    targets: &Targets,
) -> Result<Vec<usize>, MixtureError> {
    let fitted = targets.fit(candidates, allowed, None)?;
    let shares = targets.shares(&fitted);
    let mut extra = worthwhile(candidates, allowed, &shares);
    let without_warned =
        |some: &[usize]| -> Vec<usize> { some.iter().copied().filter(|&k| !candidates.warned[k]).collect() };
    let free = without_warned(allowed);
    let (mut instead, mut without) = (Vec::new(), None);
    if !free.is_empty() && allowed.iter().any(|&k| candidates.warned[k] && shares[k] > 0.0) {
        // Afresh: what is left of a mixture without most of it may be no good start.
        let fitted = targets.fit(candidates, &free, None)?;
        instead = worthwhile(candidates, &free, &targets.shares(&fitted));
        without = Some(fitted);
        instead.retain(|k| !extra.contains(k));
        extra.extend(&instead);
    }
    let mut chosen: Vec<usize> =
        allowed.iter().copied().filter(|k| !candidates.extra[*k] || extra.contains(k)).collect();

    let mut fitted = targets.fit(candidates, &chosen, Some(&fitted))?;
    let most = fitted.loss * SLACK + UNSEEN;
    // Takes them instead, if the sample stays near enough.
    let take = |some: Vec<usize>, start: Option<&Fitted>, chosen: &mut Vec<usize>, fitted: &mut Fitted| {
        if some.is_empty() || some.len() == chosen.len() {
            return Ok(some.len() == chosen.len());
        }
        let less = targets.fit(candidates, &some, start.or(Some(fitted)))?;
        let near = less.loss <= most;
        if near {
            (*chosen, *fitted) = (some, less);
        }
        Ok::<_, MixtureError>(near)
    };
    if !take(without_warned(&chosen), without.as_ref(), &mut chosen, &mut fitted)? {
        let shares = targets.shares(&fitted);
        let mut warned: Vec<usize> = chosen.iter().copied().filter(|&k| candidates.warned[k]).collect();
        warned.sort_by(|&a, &b| shares[a].total_cmp(&shares[b]).then(a.cmp(&b)));
        for stack in warned {
            let others = chosen.iter().copied().filter(|&k| k != stack).collect();
            take(others, None, &mut chosen, &mut fitted)?;
        }
    }
    // What was to take the place of stacks that had to stay is not offered.
    let shares = targets.shares(&fitted);
    let needed = chosen.iter().copied().filter(|k| !instead.contains(k) || shares[*k] >= WORTH).collect();
    take(needed, None, &mut chosen, &mut fitted)?;
    Ok(chosen)
}

/// The stacks beyond the usual ones that are worth it, those with the largest shares first.
fn worthwhile(candidates: &Candidates, allowed: &[usize], shares: &[f64]) -> Vec<usize> {
    let mut extra: Vec<usize> =
        allowed.iter().copied().filter(|&k| candidates.extra[k] && shares[k] >= WORTH).collect();
    extra.sort_by(|&a, &b| shares[b].total_cmp(&shares[a]).then(a.cmp(&b)));
    extra.truncate(MOST_EXTRA);
    extra
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::{Space, Table};
    use crate::gamut::candidates::Printable;
    use inks::Stack;

    /// Substrate, a usual stack that is advised against, its neighbour beyond the list, and one that nobody
    /// needs.
    #[test]
    fn stacks_that_print_badly_go_where_a_neighbour_serves() {
        let space = Space::half_angle(8);
        let stacks: Vec<Stack> = ["substrate", "C+M+Y+F", "C+K+F", "K"].map(|s| s.parse().unwrap()).to_vec();
        let chosen = |neighbour: f64, target: f64| {
            let mut curves = Table::new(space.columns());
            for level in [0.27, 0.004, neighbour, 0.02] {
                curves.push(&vec![level; space.columns()]);
            }
            let warned = vec![false, true, false, false];
            let printable = Printable { usual: 2, warned, ..Printable::new(stacks.clone(), curves) };
            let candidates = Candidates::new(&space, &printable, 0.0).unwrap();
            let row = candidates.free.target(&vec![target; space.columns()]).unwrap();
            let targets = Targets { rows: vec![row], importance: vec![1.0], counted: vec![(0, 1.0)] };
            choose(&candidates, &[0, 1, 2, 3], &targets).unwrap()
        };
        // Just as dark: it takes the place of the one that prints badly.
        assert_eq!(chosen(0.004, 0.003), [0, 2]);
        // A little lighter: it has no share beside the other, and is found all the same.
        assert_eq!(chosen(0.004_01, 0.003), [0, 2]);
        // Not nearly: what prints badly is needed, and the other is no help.
        assert_eq!(chosen(0.03, 0.003), [0, 1]);
        // Nothing but the substrate is needed, and a usual stack stays if no rule is against it.
        assert_eq!(chosen(0.03, 0.27), [0]);
    }
}
