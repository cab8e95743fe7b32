//! Properties that hold for any surface, and consequences of the published model.

use inks::albedo::{self, INCIDENCES};
use inks::{InkSet, Library, Lobes, Stack};
use proptest::prelude::*;
use protocol::ink::{Ink, Kind};

fn lobes(library: &Library, stack: &str) -> Lobes {
    library.optics().lobes(&stack.parse().unwrap()).unwrap()
}

#[test]
fn no_stack_creates_light_and_plain_paper_reflects_most_of_it() {
    let library = Library::builtin();
    let mut most = (0.0, Stack::SUBSTRATE, 0.0);
    for (quadrature, degrees) in albedo::standard().iter().zip(INCIDENCES) {
        for entry in library.entries() {
            for share in quadrature.of_curve(&entry.curve) {
                if share > most.0 {
                    most = (share, entry.stack.clone(), degrees);
                }
            }
        }
    }
    assert_eq!(most.1, Stack::SUBSTRATE);
    assert!((most.0 - 0.88).abs() < 0.005, "{most:?}");
}

#[test]
fn finish_makes_flakes_glossier_and_foil_less_glossy() {
    let library = Library::builtin();
    let peak = |stack: &str| lobes(&library, stack).at(0.0)[1];
    let gloss = |stack: &str| inks::gloss::units(&lobes(&library, stack));
    for flakes in ["MC", "MM", "MG", "MS"] {
        let coated = format!("{flakes}+F");
        assert!(peak(&coated) > 2.0 * peak(flakes) && gloss(&coated) > 2.0 * gloss(flakes), "{flakes}");
    }
    for foil in ["GF", "SF"] {
        let coated = format!("{foil}+F");
        assert!(peak(&coated) < peak(foil) && gloss(&coated) < gloss(foil), "{foil}");
    }
}

#[test]
fn foil_is_the_only_way_to_a_peak_above_two() {
    let library = Library::builtin();
    for entry in library.entries() {
        let foil = entry.stack.layers().iter().any(|ink| ink.kind() == Kind::Foil);
        let peak = entry.curve.at(0.0).into_iter().fold(0.0, f64::max);
        assert!(foil || peak < 2.0, "{}: {peak}", entry.stack);
    }
    assert!(lobes(&library, "P+SF").at(0.0)[1] > lobes(&library, "SF").at(0.0)[1]);
}

#[test]
fn process_inks_over_each_other_darken_in_any_order() {
    let library = Library::builtin();
    let (cmy, ycm) = (lobes(&library, "C+M+Y"), lobes(&library, "Y+C+M"));
    for c in 0..3 {
        assert!((cmy.kd[c] - ycm.kd[c]).abs() < 1e-12);
        assert!(cmy.kd[c] < lobes(&library, "C+M").kd[c] + 1e-12 && cmy.kd[c] < 0.015);
    }
}

#[test]
fn the_tabulated_curve_is_the_lobes() {
    for entry in Library::builtin().entries() {
        let lobes = entry.lobes.as_ref().unwrap();
        // To 80 degrees; beyond, a lobe grows as 1 / cos while its radiance vanishes.
        for n in 0..=200 {
            let theta = 1.4 * (f64::from(n) / 200.0).powi(2);
            let (table, exact) = (entry.curve.at(theta), lobes.at(theta));
            for c in 0..3 {
                let off = (table[c] / exact[c] - 1.0).abs();
                assert!(off < 1e-3, "{} at {theta}: {} {}", entry.stack, table[c], exact[c]);
            }
        }
    }
}

proptest! {
    /// For any inks in any order the model gives a result, and the result creates no light.
    #[test]
    fn no_sequence_of_layers_creates_light(inks in prop::collection::vec(0usize..13, 0..7)) {
        let library = Library::builtin();
        let layers: Vec<Ink> =
            inks.into_iter().map(|i| Ink::ALL[i]).filter(|&ink| ink != Ink::White).collect();
        let lobes = library.optics().lobes(&Stack::new(layers)).unwrap();
        let head_on = albedo::Albedo::new(0.5).sum(|t| lobes.at(t));
        for share in head_on {
            prop_assert!((0.0..=0.9).contains(&share), "{lobes:?}: {share}");
        }
        for lobe in &lobes.lobes {
            prop_assert!(lobe.alpha > 0.0 && lobe.alpha <= 1.0);
        }
    }

    #[test]
    fn available_stacks_need_only_available_inks(bits in prop::collection::vec(any::<bool>(), 13)) {
        let library = Library::builtin();
        let set = InkSet::of(Ink::ALL.into_iter().zip(&bits).filter(|(_, there)| **there).map(|(ink, _)| ink));
        let at_hand = library.at_hand(&set);
        prop_assert!(at_hand.first().is_some_and(|entry| entry.stack == Stack::SUBSTRATE));
        for entry in library.entries() {
            let usable = entry.stack.layers().iter().all(|&ink| set.contains(ink));
            prop_assert_eq!(usable, at_hand.iter().any(|other| other.number == entry.number));
        }
    }
}
