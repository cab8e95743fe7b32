//! Choosing cartridges: the printer holds seven, the library has more.
//!
//! Problem: of all inks, the seven whose mixtures are nearest to the document, in mean squared distance over a sample.
//! Method: branch and bound. Without an ink no mixture gets nearer, so the loss of a set of inks bounds that of every part of
//! it. A set whose mixtures use few enough inks needs no further look; otherwise one of the inks in use has to go, and
//! each is left out in turn, the cheapest first, while those tried before are kept. Mixtures that do not use the ink that is
//! left out are not fitted again.
//! Cost: some dozens of sets instead of all 792 of seven from twelve, 50 microseconds for each mixture that changes.
//! Limits: exact for the sample, within 0.1 % of its distance, and up to weights below 0.5 %, which are not printed;
//! [`Precision::EXACT`] does without these two for several times the sets.

use inks::InkSet;
use protocol::ink::Ink;

use super::fitted::{Fitted, Targets};
use crate::gamut::candidates::Candidates;
use crate::gamut::error::GamutError;
use crate::gamut::prune::PRUNED;
use crate::gamut::result::report::GivenUp;
use crate::solve::MixtureError;
use observe::Observer;

/// How exactly cartridges are chosen.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Precision {
    /// Sets whose mean squared distances differ by less than this share are equally good.
    tie: f64,
    /// Weights below this need no cartridge.
    least: f64,
}

impl Precision {
    /// For a print: 0.1 % of the distance, and weights that are printed.
    pub const PRINT: Precision = Precision { tie: 0.002, least: PRUNED };
    /// For advice on what to buy and load: as far as the solver goes.
    pub const EXACT: Precision = Precision { tie: 1e-6, least: 0.0 };
}

/// Cartridges that were chosen.
pub(crate) struct Cartridges {
    /// The stacks that they print.
    pub stacks: Vec<usize>,
    /// Their inks.
    pub inks: InkSet,
    /// Inks left out that would serve, those that are missed most first.
    pub given_up: Vec<GivenUp>,
    /// Root mean square distance with all inks, and with those chosen.
    pub all: f64,
    pub chosen: f64,
}

/// The best cartridges, at most `most`.
pub(crate) fn choose(
    candidates: &Candidates,
    targets: &Targets,
    most: usize,
    precision: Precision,
    observer: &dyn Observer,
) -> Result<Cartridges, GamutError> {
    let failed = |source| GamutError::Mixture { what: "choosing cartridges".into(), source };
    observer.begin("choosing cartridges", 1);
    let everything = InkSet::of((0..candidates.len()).flat_map(|k| candidates.inks[k].iter()));
    let mut search = Search { candidates, targets, most, precision, best: None };
    let root = search.fit(everything, None).map_err(failed)?.ok_or(GamutError::Cartridges { most })?;
    let (all, wanted) = (root.loss.sqrt(), root.inks(candidates, precision.least));
    search.branch(everything, InkSet::EMPTY, root).map_err(failed)?;
    let Some((inks, fitted)) = search.best.take() else {
        return Err(GamutError::Cartridges { most });
    };
    // Only inks in use, so that a pixel outside the sample cannot need another cartridge.
    let inks = InkSet::of(fitted.inks(candidates, precision.least).iter().filter(|&ink| inks.contains(ink)));
    let chosen = fitted.loss.sqrt();
    let mut given_up = Vec::new();
    for ink in wanted.iter().filter(|&ink| !inks.contains(ink)) {
        if let Some(with) = search.fit(inks.with(ink), None).map_err(failed)? {
            given_up.push(GivenUp { ink, with: with.loss.sqrt(), without: chosen });
        }
    }
    given_up.sort_by(|a, b| a.with.total_cmp(&b.with));
    observer.advance(1);
    observer.end();
    Ok(Cartridges { stacks: stacks_of(candidates, inks), inks, given_up, all, chosen })
}

/// The part of a distance that is not worth a cartridge (decisions/clamp-and-seven-cartridges.md).
const SPARED: f64 = 0.01;
/// What reports show as 0.0000, so that nobody can tell it from nothing.
const SHOWN: f64 = 5e-5;

/// Whether a distance is no worse than another for what is seen: within 1 % of it, or shown as equal.
pub(crate) fn is_as_good(without: f64, with: f64) -> bool {
    without <= with + (SPARED * with).max(SHOWN)
}

/// The cartridges without those that bring nothing, one after another, the cheapest first: in the end none is left whose removal
/// keeps the distance [as good](is_as_good). Returns those left out, too, each with the distances around its removal.
pub(crate) fn needed(
    candidates: &Candidates,
    targets: &Targets,
    mut cartridges: Cartridges,
) -> Result<(Cartridges, Vec<GivenUp>), GamutError> {
    let failed = |source| GamutError::Mixture { what: "leaving out a cartridge".into(), source };
    let mut spared = Vec::new();
    let mut fitted = targets.fit(candidates, &cartridges.stacks, None).map_err(failed)?;
    loop {
        let mut cheapest: Option<(Ink, Vec<usize>, Fitted)> = None;
        for ink in cartridges.inks.iter() {
            let stacks = stacks_of(candidates, cartridges.inks.without(ink));
            if stacks.is_empty() {
                continue;
            }
            let less = targets.fit(candidates, &stacks, Some(&fitted)).map_err(failed)?;
            if cheapest.as_ref().is_none_or(|(.., best)| less.loss < best.loss) {
                cheapest = Some((ink, stacks, less));
            }
        }
        let with = fitted.loss.sqrt();
        let Some((ink, stacks, less)) = cheapest.filter(|(.., less)| is_as_good(less.loss.sqrt(), with))
        else {
            break;
        };
        let without = less.loss.sqrt();
        spared.push(GivenUp { ink, with, without });
        cartridges.inks = cartridges.inks.without(ink);
        (cartridges.stacks, cartridges.chosen, fitted) = (stacks, without, less);
    }
    // Of the others only those that would be seen, beside the ones that are left.
    let mut given_up = Vec::new();
    for GivenUp { ink, .. } in std::mem::take(&mut cartridges.given_up) {
        let stacks = stacks_of(candidates, cartridges.inks.with(ink));
        let with = targets.fit(candidates, &stacks, None).map_err(failed)?.loss.sqrt();
        if !is_as_good(cartridges.chosen, with) {
            given_up.push(GivenUp { ink, with, without: cartridges.chosen });
        }
    }
    given_up.sort_by(|a, b| a.with.total_cmp(&b.with));
    cartridges.given_up = given_up;
    Ok((cartridges, spared))
}

/// What each of the chosen cartridges is worth: the distance without it, with the other ones. The one that is missed most
/// comes first.
pub(crate) fn worth(
    candidates: &Candidates,
    targets: &Targets,
    cartridges: &Cartridges,
) -> Result<Vec<GivenUp>, GamutError> {
    let failed = |source| GamutError::Mixture { what: "leaving out a cartridge".into(), source };
    let with = targets.fit(candidates, &cartridges.stacks, None).map_err(failed)?;
    let mut worth = Vec::new();
    for ink in cartridges.inks.iter() {
        let stacks = stacks_of(candidates, cartridges.inks.without(ink));
        if stacks.is_empty() {
            continue;
        }
        let without = targets.fit(candidates, &stacks, Some(&with)).map_err(failed)?;
        worth.push(GivenUp { ink, with: cartridges.chosen, without: without.loss.sqrt() });
    }
    worth.sort_by(|a, b| b.without.total_cmp(&a.without));
    Ok(worth)
}

fn stacks_of(candidates: &Candidates, inks: InkSet) -> Vec<usize> {
    (0..candidates.len()).filter(|&k| candidates.inks[k].iter().all(|ink| inks.contains(ink))).collect()
}

struct Search<'a> {
    candidates: &'a Candidates,
    targets: &'a Targets,
    most: usize,
    precision: Precision,
    best: Option<(InkSet, Fitted)>,
}

impl Search<'_> {
    /// The targets fitted to the stacks of some inks, if there are any.
    fn fit(&self, inks: InkSet, before: Option<&Fitted>) -> Result<Option<Fitted>, MixtureError> {
        let stacks = stacks_of(self.candidates, inks);
        if stacks.is_empty() {
            return Ok(None);
        }
        self.targets.fit(self.candidates, &stacks, before).map(Some)
    }

    /// Searches the parts of `inks` that have all of `kept`; `fitted` is what all of `inks` do.
    fn branch(&mut self, inks: InkSet, kept: InkSet, fitted: Fitted) -> Result<(), MixtureError> {
        let bounded = |best: &(InkSet, Fitted)| fitted.loss >= best.1.loss * (1.0 - self.precision.tie);
        if kept.len() > self.most || self.best.as_ref().is_some_and(bounded) {
            return Ok(());
        }
        let used = fitted.inks(self.candidates, self.precision.least);
        if used.len() <= self.most {
            self.best = Some((inks, fitted));
            return Ok(());
        }
        let mut without: Vec<(Ink, Fitted)> = Vec::new();
        for ink in used.iter().filter(|&ink| !kept.contains(ink)) {
            if let Some(less) = self.fit(inks.without(ink), Some(&fitted))? {
                without.push((ink, less));
            }
        }
        without.sort_by(|a, b| a.1.loss.total_cmp(&b.1.loss));
        let mut kept = kept;
        for (ink, less) in without {
            self.branch(inks.without(ink), kept, less)?;
            kept = kept.with(ink);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::Space;
    use crate::gamut::candidates::Printable;
    use crate::materials::Surface;
    use inks::Library;
    use observe::Silent;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(testing::cases(6))]

        /// Against every set of three of seven inks, each fitted from nothing.
        #[test]
        fn no_other_cartridges_are_better(
            surfaces in prop::collection::vec((prop::array::uniform3(0f32..0.8), 0.02f32..0.9, 0.05f32..0.4), 5..12),
        ) {
            let space = Space::half_angle(12);
            let at_hand: InkSet = "process,MS,finish,primer".parse().unwrap();
            let printable = Printable::from_library(&Library::builtin(), &at_hand, &space);
            let candidates = Candidates::new(&space, &printable, 0.3).unwrap();
            let rows = surfaces.iter().map(|&(diffuse, f0, alpha)| {
                let surface = Surface { diffuse, f0: [f0, 0.8 * f0, 0.6 * f0], alpha };
                candidates.free.target(&space.row(&surface.curve(space.angles()))).unwrap()
            });
            let targets = Targets { importance: (0..surfaces.len()).map(|i| 1.0 + i as f64).collect(), rows: rows.collect() };
            let chosen = choose(&candidates, &targets, 3, Precision::PRINT, &Silent).unwrap();
            let mut best = f64::INFINITY;
            for bits in 0u32..1 << at_hand.len() {
                let inks = InkSet::of(at_hand.iter().enumerate().filter(|(i, _)| bits >> i & 1 == 1).map(|(_, ink)| ink));
                if inks.len() == 3 {
                    best = targets.fit(&candidates, &stacks_of(&candidates, inks), None).unwrap().loss.min(best);
                }
            }
            let used = InkSet::of(chosen.stacks.iter().flat_map(|&k| candidates.inks[k].iter()));
            prop_assert!(used.len() <= 3);
            // Ties within 0.1 %, and weights below 0.5 % of a fourth ink, do not count.
            prop_assert!(chosen.chosen <= best.sqrt() * 1.003 + 1e-6, "{} {}", chosen.chosen, best.sqrt());
            prop_assert!(chosen.all <= chosen.chosen + 1e-9);
            // Neither counts where it has to be exact: the solver's gap alone is left.
            let exact = choose(&candidates, &targets, 3, Precision::EXACT, &Silent).unwrap();
            prop_assert!((exact.chosen.powi(2) - best).abs() <= 3e-8, "{} {}", exact.chosen, best.sqrt());
            // Every set without one of those that are needed is worse to see, fitted from nothing.
            let (needed, spared) = needed(&candidates, &targets, choose(&candidates, &targets, 3, Precision::EXACT, &Silent).unwrap()).unwrap();
            prop_assert_eq!(needed.inks.len() + spared.len(), exact.inks.len());
            for ink in needed.inks.iter() {
                let stacks = stacks_of(&candidates, needed.inks.without(ink));
                let without = targets.fit(&candidates, &stacks, None).unwrap().loss.sqrt();
                // The solver's gap beside the limit.
                prop_assert!(without > needed.chosen + (0.0099 * needed.chosen).max(4.9e-5) - 1e-6, "{ink:?} {without}");
            }
            for left in worth(&candidates, &targets, &exact).unwrap() {
                let fewer = stacks_of(&candidates, exact.inks.without(left.ink));
                let again = targets.fit(&candidates, &fewer, None).unwrap().loss;
                prop_assert!((left.without.powi(2) - again).abs() < 1e-6, "{left:?} {again}");
                prop_assert!(left.without.powi(2) >= exact.chosen.powi(2) - 3e-8, "{left:?}");
            }
        }
    }

    /// A paper, a grey that two inks print all but alike, and a target between: one of the inks is enough.
    #[test]
    fn a_cartridge_that_brings_nothing_is_left_out() {
        use crate::brdf::Table;
        let space = Space::half_angle(8);
        let stacks: Vec<inks::Stack> = ["substrate", "K", "C"].map(|s| s.parse().unwrap()).to_vec();
        let used = |level: f64| {
            let mut curves = Table::new(space.columns());
            for level in [0.27, 0.02, level] {
                curves.push(&vec![level; space.columns()]);
            }
            let candidates = Candidates::new(&space, &Printable::new(stacks.clone(), curves), 0.0).unwrap();
            // Darker than either ink.
            let row = candidates.free.target(&vec![0.01; space.columns()]).unwrap();
            let targets = Targets { rows: vec![row.clone(), row], importance: vec![1.0, 1.0] };
            let all = choose(&candidates, &targets, 7, Precision::EXACT, &Silent).unwrap();
            let (inks, (needed, spared)) = (all.inks, needed(&candidates, &targets, all).unwrap());
            assert_eq!(spared.len(), inks.len() - needed.inks.len());
            needed.inks.iter().map(Ink::name).collect::<Vec<_>>()
        };
        // The darkest that there is, whichever it is, and nothing beside it.
        assert_eq!(used(0.0201), ["black"]);
        assert_eq!(used(0.0199), ["cyan"]);
    }
}
