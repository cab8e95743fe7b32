//! Choosing cartridges: the printer holds seven, the library has more.
//!
//! Problem: of all inks, the seven whose mixtures are nearest to the document, in mean squared distance
//! over a sample.
//! Method: branch and bound. Without an ink no mixture gets nearer, so the loss of a set of inks bounds
//! that of every part of it. A set whose mixtures use few enough inks needs no further look; otherwise one
//! of the inks in use has to go, and each is left out in turn, the cheapest first, while those tried before
//! are kept. Mixtures that do not use the ink that is left out are not fitted again. Of sets within 1 % the
//! one stays that keeps hues, and then the one whose worst material is served best. Then a cartridge stays
//! only if some material that counts gets better by what half of barely visible is, or hues come back: a
//! viewer judges materials, not a mean over the sheet.
//! Cost: some dozens of sets instead of all 792 of seven from twelve, 50 microseconds for each mixture that
//! changes.
//! Limits: exact for the sample, within 1 % of its distance, and up to weights below 0.5 %, which need no
//! cartridge; [`Precision::EXACT`] does without these two for several times the sets.

use inks::InkSet;
use protocol::ink::Ink;

use super::fitted::{Fitted, Service, Targets};
use crate::gamut::candidates::Candidates;
use crate::gamut::error::GamutError;
use crate::gamut::rare::LEAST;
use crate::solve::MixtureError;
use observe::Observer;

/// How exactly cartridges are chosen.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Precision {
    /// Sets whose mean squares differ by less than this share are equally good, and hues and the material
    /// that is worst served decide.
    tie: f64,
    /// Weights below this need no cartridge.
    least: f64,
}

impl Precision {
    /// For a print: 1 % of the distance, and weights that are printed.
    pub const PRINT: Precision = Precision { tie: 0.02, least: LEAST };
    /// For advice on what to buy and load: as far as the solver goes.
    pub const EXACT: Precision = Precision { tie: 1e-6, least: 0.0 };
}

/// Cartridges that were chosen.
pub(crate) struct Cartridges {
    /// The stacks that they print.
    pub stacks: Vec<usize>,
    /// Their inks.
    pub inks: InkSet,
    /// What they do.
    pub fitted: Fitted,
    /// Inks left out for the number of cartridges that some material would gain by, those that are missed
    /// most first.
    pub given_up: Vec<(Ink, Service)>,
    /// The root mean square of the objective with all inks.
    pub all: f64,
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
    let mut search = Search { candidates, targets, most, precision, least: f64::INFINITY, best: None };
    let root = search.fit(everything, None).map_err(failed)?.ok_or(GamutError::Cartridges { most })?;
    let (all, wanted) = (root.loss.sqrt(), root.inks(candidates, precision.least));
    search.branch(everything, InkSet::EMPTY, root).map_err(failed)?;
    let Some((inks, fitted)) = search.best.take() else {
        return Err(GamutError::Cartridges { most });
    };
    // Only inks in use, so that a pixel outside the sample cannot need another cartridge.
    let inks = InkSet::of(fitted.inks(candidates, precision.least).iter().filter(|&ink| inks.contains(ink)));
    let mut given_up = Vec::new();
    for ink in wanted.iter().filter(|&ink| !inks.contains(ink)) {
        if let Some(with) = search.fit(inks.with(ink), None).map_err(failed)? {
            given_up.extend(targets.service(&with, &fitted).map(|service| (ink, service)));
        }
    }
    observer.advance(1);
    observer.end();
    Ok(Cartridges { stacks: stacks_of(candidates, inks), inks, fitted, given_up, all })
}

/// The cartridges without those that bring nothing to any material, one after another, the one of least use
/// first; in the room that this leaves, up to `most`, those that were given up. Returns those left out,
/// too, each with the material that it would have served most.
pub(crate) fn needed(
    candidates: &Candidates,
    targets: &Targets,
    mut cartridges: Cartridges,
    most: usize,
) -> Result<(Cartridges, Vec<(Ink, Service)>), GamutError> {
    let failed = |source| GamutError::Mixture { what: "leaving out a cartridge".into(), source };
    let gain = |service: &Service| service.without - service.with;
    let mut spared = Vec::new();
    let mut others = InkSet::of(std::mem::take(&mut cartridges.given_up).into_iter().map(|(ink, _)| ink));
    loop {
        let mut idle: Option<(Ink, Vec<usize>, Fitted, Service)> = None;
        for ink in cartridges.inks.iter() {
            let stacks = stacks_of(candidates, cartridges.inks.without(ink));
            if stacks.is_empty() {
                continue;
            }
            let less = targets.fit(candidates, &stacks, Some(&cartridges.fitted)).map_err(failed)?;
            let Some(service) = targets.service(&cartridges.fitted, &less) else { continue };
            if !service.is_worth_it && idle.as_ref().is_none_or(|(_, _, best, _)| less.loss < best.loss) {
                idle = Some((ink, stacks, less, service));
            }
        }
        if let Some((ink, stacks, less, service)) = idle {
            spared.push((ink, service));
            cartridges.inks = cartridges.inks.without(ink);
            (cartridges.stacks, cartridges.fitted) = (stacks, less);
            continue;
        }
        // Of the others only those that some material would gain by, beside the ones that are left.
        let mut given_up: Vec<(Ink, Service, Fitted)> = Vec::new();
        for ink in others.iter() {
            let stacks = stacks_of(candidates, cartridges.inks.with(ink));
            let with = targets.fit(candidates, &stacks, None).map_err(failed)?;
            let service = targets.service(&with, &cartridges.fitted);
            given_up
                .extend(service.filter(|service| service.is_worth_it).map(|service| (ink, service, with)));
        }
        given_up.sort_by(|a, b| gain(&b.1).total_cmp(&gain(&a.1)));
        if cartridges.inks.len() >= most || given_up.is_empty() {
            cartridges.given_up = given_up.into_iter().map(|(ink, service, _)| (ink, service)).collect();
            return Ok((cartridges, spared));
        }
        let (ink, _, fitted) = given_up.swap_remove(0);
        (cartridges.inks, cartridges.fitted) = (cartridges.inks.with(ink), fitted);
        cartridges.stacks = stacks_of(candidates, cartridges.inks);
        others = others.without(ink);
    }
}

/// What each of the chosen cartridges does for the material that it serves most. The one that is missed
/// most comes first.
pub(crate) fn worth(
    candidates: &Candidates,
    targets: &Targets,
    cartridges: &Cartridges,
) -> Result<Vec<(Ink, Service)>, GamutError> {
    let failed = |source| GamutError::Mixture { what: "leaving out a cartridge".into(), source };
    let mut worth = Vec::new();
    for ink in cartridges.inks.iter() {
        let stacks = stacks_of(candidates, cartridges.inks.without(ink));
        if stacks.is_empty() {
            continue;
        }
        let without = targets.fit(candidates, &stacks, Some(&cartridges.fitted)).map_err(failed)?;
        worth.extend(targets.service(&cartridges.fitted, &without).map(|service| (ink, service)));
    }
    let gain = |(_, service): &(Ink, Service)| service.without - service.with;
    worth.sort_by(|a, b| gain(b).total_cmp(&gain(a)));
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
    /// The least loss of a set that is small enough, and of those within a tie of it the one that serves
    /// its worst material best.
    least: f64,
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
        if kept.len() > self.most || fitted.loss > self.least * (1.0 + self.precision.tie) {
            return Ok(());
        }
        let used = fitted.inks(self.candidates, self.precision.least);
        if used.len() <= self.most {
            self.least = self.least.min(fitted.loss);
            let is_tied = |best: &(InkSet, Fitted)| best.1.loss <= self.least * (1.0 + self.precision.tie);
            let is_worse =
                |best: &(InkSet, Fitted)| self.targets.worst(&best.1) <= self.targets.worst(&fitted);
            if !self.best.as_ref().is_some_and(|best| is_tied(best) && is_worse(best)) {
                self.best = Some((inks, fitted));
            }
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
            let n = surfaces.len();
            let counted = (0..n).map(|i| (i, 1.0 / n as f64)).collect();
            let targets = Targets { importance: (0..n).map(|i| 1.0 + i as f64).collect(), rows: rows.collect(), counted };
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
            // Ties within 1 %, and weights below 0.5 % of a fourth ink, do not count.
            let distance = chosen.fitted.loss.sqrt();
            prop_assert!(distance <= best.sqrt() * 1.013 + 1e-6, "{distance} {}", best.sqrt());
            prop_assert!(chosen.all <= distance + 1e-9);
            // Neither counts where it has to be exact: what is left are hollows in which fits from one
            // start end.
            let exact = choose(&candidates, &targets, 3, Precision::EXACT, &Silent).unwrap();
            prop_assert!(exact.fitted.loss <= 1.01 * best + 3e-8, "{} {best}", exact.fitted.loss);
            // Every one that is needed serves some material, fitted from nothing.
            let (inks, worth) = (exact.inks, worth(&candidates, &targets, &exact).unwrap());
            let (needed, spared) = needed(&candidates, &targets, exact, 3).unwrap();
            let is_spared = |ink: Ink| spared.iter().any(|(spared, _)| *spared == ink);
            prop_assert!(needed.inks.len() <= 3 && inks.iter().all(|ink| needed.inks.contains(ink) || is_spared(ink)));
            for (ink, service) in &spared {
                prop_assert!(service.without - service.with < 0.005, "{ink:?}");
            }
            for ink in needed.inks.iter() {
                let stacks = stacks_of(&candidates, needed.inks.without(ink));
                let without = targets.fit(&candidates, &stacks, None).unwrap();
                prop_assert!(targets.service(&needed.fitted, &without).unwrap().is_worth_it, "{ink:?}");
            }
            prop_assert!(worth.windows(2).all(|w| w[0].1.without - w[0].1.with >= w[1].1.without - w[1].1.with));
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
            let targets = Targets {
                rows: vec![row.clone(), row],
                importance: vec![1.0, 1.0],
                counted: vec![(0, 0.5), (1, 0.5)],
            };
            let all = choose(&candidates, &targets, 7, Precision::EXACT, &Silent).unwrap();
            let (inks, (needed, spared)) = (all.inks, needed(&candidates, &targets, all, 7).unwrap());
            assert_eq!(spared.len(), inks.len() - needed.inks.len());
            needed.inks.iter().map(Ink::name).collect::<Vec<_>>()
        };
        // The darkest that there is, whichever it is, and nothing beside it.
        assert_eq!(used(0.0201), ["black"]);
        assert_eq!(used(0.0199), ["cyan"]);
    }
}
