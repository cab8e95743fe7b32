//! Suggestions for a better print: undercoats, more white, other settings.
//!
//! Nothing here changes the print. A suggestion states a problem, the number of dots concerned, and a remedy.
//! Source: the vendor's guide and owners' reports, as the ink library's rules.

use inks::Stack;
use protocol::ink::{Ink, Kind};
use protocol::rgl::Media;

use super::separation::{COLOURS, InkLayer};
use crate::artwork::Above;

/// An ink is not worth a pass on fewer dots of a picture's colours than one in this many, for a pass takes
/// minutes and ribbon over the whole length.
const RARE: u64 = 1000;

/// An addition to the art that a user can accept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Accept {
    /// Solid cyan, magenta, yellow and black beneath every foil.
    FoilUndercoat,
    /// Primer, finish and primer between black and the white above it.
    EvenWhite,
    /// Three passes of white instead of one.
    WhiteThrice,
    /// White beneath the colours that are drawn over it.
    WhiteKept,
    /// Metallic silver beneath white.
    SilverUnderWhite,
}

impl Accept {
    /// Its name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Accept::FoilUndercoat => "foil-undercoat",
            Accept::EvenWhite => "even-white",
            Accept::WhiteThrice => "white-thrice",
            Accept::WhiteKept => "white-kept",
            Accept::SilverUnderWhite => "silver-under-white",
        }
    }

    /// Why it changes nothing, if it does not.
    fn idle(self) -> &'static str {
        match self {
            Accept::FoilUndercoat => "no foil lies on anything else than the solid process inks",
            Accept::EvenWhite => "no white lies directly on black",
            Accept::WhiteThrice => "no white is printed in one pass",
            Accept::WhiteKept => "no colours knock out white",
            Accept::SilverUnderWhite => "no white lies on the bare sheet",
        }
    }

    /// A note on an addition that was accepted and changes nothing.
    pub(super) fn note(self) -> String {
        format!("{} was accepted, but has no effect: {}", self.name(), self.idle())
    }
}

/// The change of a setting that follows a suggestion.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Remedy {
    /// Accept an addition to the art.
    Accept(Accept),
    /// Print with the settings of this medium.
    Media(Media),
    /// Print the inks in this order from the paper up.
    Order(Vec<Ink>),
    /// Print without this ink.
    Without(Ink),
}

/// Something that would improve the print.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Suggestion {
    /// The problem, its reason and its remedy.
    pub text: String,
    /// What to set.
    pub remedy: Remedy,
    /// Number of dots concerned.
    pub dots: u64,
}

/// Suggestions on stacks and their numbers of dots; `order` has the inks from the paper up.
pub(super) fn suggest(stacks: &[Stack], dots: &[u64], order: &[Ink]) -> Vec<Suggestion> {
    let about = |touches: &dyn Fn(&[Ink]) -> bool| -> u64 {
        stacks.iter().zip(dots).filter(|(stack, _)| touches(stack.layers())).map(|(_, dots)| dots).sum()
    };
    let process = |layers: &[Ink]| {
        Ink::ALL.into_iter().filter(|ink| ink.kind() == Kind::Process).all(|ink| layers.contains(&ink))
    };
    let bare_foil = about(&|layers| {
        layers.iter().position(|ink| ink.kind() == Kind::Foil).is_some_and(|foil| !process(&layers[..foil]))
    });
    let white_on_black = about(&|layers| layers.windows(2).any(|pair| pair == [Ink::Black, Ink::White]));
    let thin_white = about(&|layers| layers.iter().filter(|&&ink| ink == Ink::White).count() == 1);
    let bare_white = about(&|layers| {
        layers.first() == Some(&Ink::White) && layers.iter().filter(|&&ink| ink == Ink::White).count() == 1
    });
    let primed = about(&|layers| layers.contains(&Ink::Primer));
    let metal = |layers: &[Ink]| layers.iter().position(|ink| ink.kind() == Kind::Metallic);
    let metals = about(&|layers| metal(layers).is_some());
    let covered = about(&|layers| metal(layers).is_some_and(|metal| layers[metal..].contains(&Ink::Black)));
    // A little black on metal is lettering; metal mostly under black is a mistake.
    let hidden = if 2 * covered > metals { covered } else { 0 };
    let (metal_inks, others): (Vec<Ink>, Vec<Ink>) =
        order.iter().partition(|ink| ink.kind() == Kind::Metallic);
    let beneath = others.iter().rposition(|ink| ink.kind() == Kind::Process).map_or(0, |at| at + 1);
    let metal_above = [&others[..beneath], &metal_inks, &others[beneath..]].concat();
    [
        (
            bare_foil,
            "foil adheres and shines only on solid cyan, magenta, yellow and black",
            Remedy::Accept(Accept::FoilUndercoat),
        ),
        (
            white_on_black,
            "white directly on black has many missing dots; primer, finish and primer between them make it even",
            Remedy::Accept(Accept::EvenWhite),
        ),
        (thin_white, "one pass of white looks grey; three look nearly white", Remedy::Accept(Accept::WhiteThrice)),
        (
            bare_white,
            "on a dark ground, metallic silver beneath white hides it like several whites, as owners report",
            Remedy::Accept(Accept::SilverUnderWhite),
        ),
        (
            primed,
            "the media settings for plain paper can tear the primer ribbon; those for cardboard prevent it",
            Remedy::Media(Media::Cardboard),
        ),
        (
            hidden,
            "black covers most of the metallic ink; print the metallic ink above black, which is then left out beneath it",
            Remedy::Order(metal_above),
        ),
    ]
    .into_iter()
    .filter(|(dots, ..)| *dots > 0)
    .map(|(dots, text, remedy)| Suggestion { text: text.into(), remedy, dots })
    .collect()
}

/// A suggestion on white that colours knock out, if they do.
pub(super) fn knocked_out(lost: &[(Above, u64)]) -> Option<Suggestion> {
    let text = "the colours knock out the white beneath them, as layout programs do unless they are told to overprint; keep the white";
    let (_, dots) = *lost.iter().find(|(above, _)| *above == Above::Colours)?;
    Some(Suggestion { text: text.into(), remedy: Remedy::Accept(Accept::WhiteKept), dots })
}

/// Notes on white that the art draws beneath other things.
pub(super) fn white_beneath(kept: u64, lost: &[(Above, u64)]) -> impl Iterator<Item = String> {
    let kept = (kept > 0).then(|| format!("white is kept on {kept} dots beneath what is drawn over it"));
    let kinds = lost.iter().map(|(above, dots)| match above {
        Above::Colours => format!("{dots} dots of colours"),
        Above::Ink(ink) => format!("{dots} dots of {}", ink.name()),
        Above::Paper => format!("{dots} dots of shapes as white as paper"),
    });
    let kinds: Vec<String> = kinds.collect();
    let lost = (!kinds.is_empty()).then(|| format!("white makes room for {}", kinds.join(", ")));
    kept.into_iter().chain(lost)
}

/// Suggestions to leave out inks that plain colour needs on so few dots that nobody would miss them.
pub(super) fn rare(laid: &[InkLayer]) -> Vec<Suggestion> {
    let coloured: Vec<&InkLayer> = laid.iter().filter(|laid| laid.from == COLOURS).collect();
    let all: u64 = coloured.iter().map(|laid| laid.dots).sum();
    coloured
        .into_iter()
        .filter(|laid| laid.dots * RARE < all)
        .filter_map(|laid| {
            let ink = Ink::from_name(laid.ink)?;
            let text = format!(
                "the colours have hardly any {}; leaving it out saves a pass and a cartridge",
                laid.ink
            );
            Some(Suggestion { text, remedy: Remedy::Without(ink), dots: laid.dots })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn laid(ink: Ink, dots: u64, from: &str) -> InkLayer {
        InkLayer { ink: ink.name(), dots, from: from.into(), passes: 1 }
    }

    #[test]
    fn leaving_out_an_ink_on_hardly_any_dots_of_the_colours_is_suggested() {
        let laid = [
            laid(Ink::White, 3, "white.png"),
            laid(Ink::Cyan, 90_000, COLOURS),
            laid(Ink::Black, 9_910, COLOURS),
            laid(Ink::Yellow, 90, COLOURS),
        ];
        let [Suggestion { remedy, dots: 90, .. }] = &rare(&laid)[..] else { panic!("one suggestion") };
        assert_eq!(*remedy, Remedy::Without(Ink::Yellow));
    }

    #[test]
    fn few_dots_that_were_drawn_are_kept() {
        let laid = [laid(Ink::Cyan, 90_000, COLOURS), laid(Ink::Yellow, 3, "yellow.png")];
        assert!(rare(&laid).is_empty());
    }
}
