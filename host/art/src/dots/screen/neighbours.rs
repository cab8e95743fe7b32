//! Colours that are nearly one print alike: the mean of a mixture, as an eye sees it, in Oklab.

use super::mixtures::{Rules, shares};
use super::tests::{INKS, inks};
use super::*;
use crate::colour::bound::{is_full_black, is_paper, seen};
use crate::colour::intent::{Intent, Light, difference, luminance};
use appearance::weights::ONE;
use palette::color_difference::Ciede2000;
use proptest::prelude::*;

/// A difference that is barely visible.
const BARELY: f64 = 0.02;

/// From a solid to what is fitted beside it are 16 values; the first of them may be seen, side by side.
const STEEP: f64 = 0.05;

/// The mixtures of some inks and the light of each stack in their order.
struct Eye<'a> {
    mixtures: Mixtures<'a, 16>,
    bodies: Vec<Light>,
}

impl<'a> Eye<'a> {
    fn new((fit, solids): &'a (Fit, Solids<'a>)) -> Eye<'a> {
        let mixtures = Mixtures::new(fit, solids);
        let bodies = mixtures.order.iter().take(fit.stacks.len());
        let bodies = bodies.map(|&number| solids.body(&fit.stacks[usize::from(number)])).collect();
        Eye { mixtures, bodies }
    }

    /// The mean of such shares.
    fn mean(&self, shares: &[u16; 16]) -> Light {
        let parts = || shares.iter().map(|&share| f64::from(share) / f64::from(ONE)).zip(&self.bodies);
        std::array::from_fn(|c| parts().map(|(share, body)| share * body[c]).sum())
    }

    /// The shares of a colour, and those of a flat one.
    fn shares(&self, colour: [u8; 3], drawn: bool) -> [[u16; 16]; 2] {
        [self.mixtures.stops(colour, drawn), self.mixtures.flat(colour, drawn)].map(|stops| shares(&stops))
    }

    /// Whether specks are dropped as they should be from a colour.
    fn check(&self, colour: [u8; 3], drawn: bool) {
        let [whole, flat] = self.shares(colour, drawn);
        let least = self.mixtures.rules.least;
        if is_paper(colour) || is_full_black(colour) {
            return;
        }
        for (&before, &after) in whole.iter().zip(&flat) {
            assert!(before < least || after >= before, "{colour:?} has less than {whole:?}: {flat:?}");
        }
        let off = |shares: &[u16; 16]| {
            let [before, after] = [&whole, shares].map(|shares| seen(self.mixtures.mean(shares)));
            ((before.l - after.l).abs(), before.difference(after))
        };
        let (lighter, apart) = off(&flat);
        assert!(lighter <= 1.0 && apart <= 1.0, "{colour:?} differs by {lighter}, {apart}");
        let [before, after] = [whole, flat].map(|shares| self.mean(&shares));
        let speck = f64::from(least) / f64::from(ONE);
        let lighter = luminance(after) - luminance(before);
        assert!(lighter.abs() < speck, "{colour:?} is lighter by {lighter}");
        // No speck shows more than one of paper on the darkest stack.
        let darkest = self.bodies[0];
        let most = difference(darkest, darkest.map(|v| v + speck * (1.0 - v)));
        let off = difference(before, after);
        assert!(off < most, "{colour:?} differs by {off}, not {most}");
    }
}

/// The colours within twelve steps of a corner of sRGB.
fn near_corners() -> impl Iterator<Item = [u8; 3]> {
    let off = || (0..=12u8).flat_map(|r| (0..=12u8).flat_map(move |g| (0..=12u8).map(move |b| [r, g, b])));
    (0..8).flat_map(move |bits| {
        off().map(move |off| std::array::from_fn(|c| if bits >> c & 1 > 0 { 255 - off[c] } else { off[c] }))
    })
}

#[test]
fn what_is_nearly_a_corner_has_no_specks() {
    let eye = Eye::new(&INKS);
    assert_eq!(near_corners().count(), 17_576);
    for colour in near_corners() {
        eye.check(colour, false);
        eye.check(colour, true);
    }
}

/// A step of red, green and blue is no edge, in any lattice.
#[test]
fn what_is_nearly_a_corner_prints_like_its_neighbours() {
    for intent in [Intent::Auto, Intent::Perceptual, Intent::Colorimetric] {
        let inks = inks(intent);
        let eye = Eye::new(&inks);
        let seen = |colour, drawn| eye.mean(&eye.shares(colour, drawn)[0]);
        let mut most = 0.0;
        for (colour, drawn) in near_corners().flat_map(|colour| [(colour, false), (colour, true)]) {
            let own = seen(colour, drawn);
            for steps in 1..8 {
                // A step from the corner in some of the three.
                let next = std::array::from_fn(|c| match (steps >> c & 1, colour[c]) {
                    (0, v) => v,
                    (_, v @ ..128) => v + 1,
                    (_, v) => v - 1,
                });
                let off = difference(own, seen(next, drawn));
                most = f64::max(most, off);
                assert!(off < STEEP, "{intent:?}, {drawn}: {colour:?} and {next:?} differ by {off}");
            }
        }
        println!("{intent:?}: {most}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(20_000))]

    #[test]
    fn any_colour_prints_like_its_neighbours_and_has_no_specks(
        colour: [u8; 3], c in 0usize..3, drawn: bool, fifths in 4u16..=6
    ) {
        let mut eye = Eye::new(&INKS);
        let mut next = colour;
        next[c] = next[c].saturating_add(1);
        let [own, other] = [colour, next].map(|colour| eye.mean(&eye.shares(colour, drawn)[0]));
        let off = difference(own, other);
        prop_assert!(off < BARELY, "{:?} and {:?} differ by {}", colour, next, off);
        eye.mixtures.rules.least = Rules::USUAL.least / 5 * fifths;
        eye.check(colour, drawn);
    }
}
