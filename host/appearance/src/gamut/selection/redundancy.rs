//! Stacks that the others can stand for.
//!
//! Problem: a stack inside the hull of the others prints nothing that a mixture of them does not, yet it
//! costs cartridges, passes and time to measure.
//! Method: each stack is fitted by eq. 1 to mixtures of the others. The one that is missed least is left
//! out, the stacks whose mixtures used it are fitted again, and so on while the one missed least is missed
//! by less than the limit. At the end all those left out are fitted to the stacks that stay, which is what
//! leaving them all out costs.
//! Cost: a millisecond for each fit; a few fits for each stack left out.
//! Limits: greedy, so another set might be larger. A mixture looks like the stack from afar; near by it
//! shows dots.

use inks::Stack;
use rayon::prelude::*;

use crate::brdf::Space;
use crate::gamut::candidates::{Candidates, Printable};
use crate::gamut::error::GamutError;
use crate::gamut::rare::LEAST;
use crate::solve::{Best, Mixer};

/// A stack against the mixtures of others.
#[derive(Clone, Debug, PartialEq)]
pub struct LeftOut {
    /// The stack.
    pub stack: Stack,
    /// Distance to the best mixture of all other stacks: what leaving out this one alone costs.
    pub alone: f64,
    /// Distance to the best mixture of the stacks that stay; `None` if this one stays.
    pub together: Option<f64>,
    /// That mixture, largest weight first; of all others if this one stays.
    pub mixture: Vec<(Stack, f64)>,
}

struct Search<'a> {
    candidates: &'a Candidates,
    /// The stacks that stay so far.
    stays: Vec<bool>,
}

impl Search<'_> {
    /// The best mixture of the stacks that stay, without this one.
    fn fit(&self, stack: usize) -> Result<(Vec<usize>, Best), GamutError> {
        let failed =
            |source| GamutError::Mixture { what: format!("{}", self.candidates.stacks[stack]), source };
        let others: Vec<usize> = (0..self.stays.len()).filter(|&k| k != stack && self.stays[k]).collect();
        let hull = self.candidates.free.subset(&others);
        let target = hull.target(self.candidates.curves.row(stack)).map_err(failed)?;
        let best = Mixer::new().best(&hull, &target).map_err(failed)?;
        Ok((others, best))
    }

    fn mixture(&self, others: &[usize], best: &Best) -> Vec<(Stack, f64)> {
        let used = others.iter().zip(&best.weights).filter(|(_, w)| **w >= LEAST);
        let mut mixture: Vec<_> = used.map(|(&k, &w)| (self.candidates.stacks[k].clone(), w)).collect();
        mixture.sort_by(|a, b| b.1.total_cmp(&a.1));
        mixture
    }
}

/// All stacks, in their order, with what leaving them out costs in the metric with this weight of light.
/// Stacks are left out together while each is missed by at most `limit`. The bare substrate always stays.
///
/// # Errors
/// Fewer than two stacks, or curves that cannot be fitted.
pub fn redundancy(
    space: &Space,
    printable: &Printable,
    light: f64,
    limit: f64,
) -> Result<Vec<LeftOut>, GamutError> {
    if printable.stacks.len() < 2 {
        return Err(GamutError::NothingPrintable);
    }
    let failed = |source| GamutError::Mixture { what: "the stacks".into(), source };
    let candidates = Candidates::new(space, printable, light).map_err(failed)?;
    let count = candidates.len();
    let mut search = Search { candidates: &candidates, stays: vec![true; count] };
    let fit_all = |search: &Search<'_>, which: &[usize]| {
        which.par_iter().map(|&k| search.fit(k)).collect::<Result<Vec<_>, GamutError>>()
    };
    let all: Vec<usize> = (0..count).collect();
    let mut fits = fit_all(&search, &all)?;
    let mut found: Vec<LeftOut> = fits
        .iter()
        .enumerate()
        .map(|(k, (others, best))| LeftOut {
            stack: candidates.stacks[k].clone(),
            alone: best.fit.objective,
            together: None,
            mixture: search.mixture(others, best),
        })
        .collect();
    let may_go = |k: usize| !candidates.stacks[k].layers().is_empty();
    loop {
        let staying = (0..count).filter(|&k| search.stays[k] && may_go(k));
        let distance = |k: usize| fits[k].1.fit.objective;
        let next = staying.min_by(|&a, &b| distance(a).total_cmp(&distance(b)));
        let Some(next) = next.filter(|&k| distance(k) <= limit) else { break };
        search.stays[next] = false;
        // The stacks whose mixture had it, those left out before too: one of them may now be missed by too
        // much.
        let concerned: Vec<usize> = (0..count)
            .filter(|&k| {
                let (others, best) = &fits[k];
                k != next && others.iter().zip(&best.weights).any(|(&other, &w)| other == next && w > 0.0)
            })
            .collect();
        let again = fit_all(&search, &concerned)?;
        let missed =
            concerned.iter().zip(&again).any(|(&k, fit)| !search.stays[k] && fit.1.fit.objective > limit);
        if missed {
            search.stays[next] = true;
            // It has to stay; nothing else was decided by it.
            fits[next].1.fit.objective = f64::INFINITY;
            continue;
        }
        concerned.into_iter().zip(again).for_each(|(k, fit)| fits[k] = fit);
    }
    for k in (0..count).filter(|&k| !search.stays[k]) {
        found[k].together = Some(fits[k].1.fit.objective);
        found[k].mixture = search.mixture(&fits[k].0, &fits[k].1);
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::Table;
    use crate::solve::{Columns, Gram, Simplex};
    use inks::{InkSet, Library};

    /// The squared distance of a row to the convex hull of others in plain reflectance, by one quadratic:
    /// zero if and only if the row is a mixture.
    fn outside(rows: &Table, row: usize) -> f64 {
        let others: Vec<usize> = (0..rows.len()).filter(|&k| k != row).collect();
        let mut hull = Table::new(rows.columns());
        others.iter().for_each(|&k| hull.push(rows.row(k)));
        let (mut products, mut weights) = (vec![0.0; others.len()], vec![0.0; others.len()]);
        Columns::of_rows(&hull).products(rows.row(row), &mut products);
        Simplex::new().solve(&Gram::of_rows(&hull), &products, &mut weights).unwrap();
        let (mut off, mut size) = (0.0, 0.0);
        for (column, &own) in rows.row(row).iter().enumerate() {
            let mixed: f64 = weights.iter().enumerate().map(|(k, w)| w * hull.row(k)[column]).sum();
            (off, size) = (off + (mixed - own).powi(2), size + own * own);
        }
        // Relative to the row, whose peak may be large.
        off / size
    }

    /// Some stacks of the library, and two that are mixtures of them.
    #[test]
    fn mixtures_are_found_and_nothing_else() {
        let space = Space::half_angle(24);
        let library = Library::builtin();
        let inks: InkSet = "C,Y,MS".parse().unwrap();
        let mut printable = Printable::from_library(&library, &inks, &space);
        let real = printable.stacks.len();
        for (a, b, part) in [(0, 1, 0.3), (1, 2, 0.6)] {
            let rows = printable.curves.row(a).iter().zip(printable.curves.row(b));
            let mixed: Vec<f64> = rows.map(|(x, y)| part * x + (1.0 - part) * y).collect();
            printable.curves.push(&mixed);
            printable.stacks.push(Stack::new(vec![protocol::ink::Ink::White; printable.stacks.len()]));
            printable.warned.push(false);
        }
        let found = redundancy(&space, &printable, 0.0, 1e-4).unwrap();
        for (k, stack) in found.iter().enumerate() {
            let miss = outside(&printable.curves, k);
            assert_eq!(stack.alone < 1e-4, miss < 1e-6, "{}: {} {miss}", stack.stack, stack.alone);
            assert_eq!(stack.together.is_some(), k >= real, "{}: {stack:?}", stack.stack);
        }
        let mixture = &found[real].mixture;
        assert!((mixture[0].1 - 0.7).abs() < 1e-2 && mixture[0].0 == printable.stacks[1], "{mixture:?}");
    }

    /// What is left out is still within the limit of what stays, fitted anew.
    #[test]
    fn together_they_stay_within_the_limit() {
        let space = Space::half_angle(16);
        let inks: InkSet = "process,MS".parse().unwrap();
        let printable = Printable::from_library(&Library::builtin(), &inks, &space);
        let limit = 0.02;
        let found = redundancy(&space, &printable, 0.0, limit).unwrap();
        let stays: Vec<usize> = (0..found.len()).filter(|&k| found[k].together.is_none()).collect();
        assert!(stays.len() < found.len() && found[0].together.is_none(), "{found:?}");
        let candidates = Candidates::new(&space, &printable, 0.0).unwrap();
        let hull = candidates.free.subset(&stays);
        for (k, stack) in found.iter().enumerate() {
            let Some(together) = stack.together else { continue };
            let again = Mixer::new().best(&hull, &hull.target(printable.curves.row(k)).unwrap()).unwrap();
            assert!(
                together <= limit && (together - again.fit.objective).abs() < 1e-6,
                "{}: {stack:?}",
                stack.stack
            );
            assert!(stack.alone <= together + 1e-9);
        }
    }
}
