//! What a print needs that the art does not have: undercoats, more white, other settings.
//!
//! Nothing here is done unasked: a suggestion says what and why, how many dots it is about, and what to type to have it.
//! Source: the vendor's guide and owners' reports, as the ink library's rules.

use inks::{InkSet, Stack};
use protocol::ink::{Ink, Kind};
use serde::Serialize;

use super::{COLOURS, Laid, Settings};

/// An ink with fewer than one of so many of the dots of a picture's colours is not worth a pass.
const RARE: u64 = 1000;

/// A suggestion that the user accepts: what the plan adds to the art.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Accept {
    /// Solid cyan, magenta, yellow and black beneath every foil.
    FoilUndercoat,
    /// Primer, finish, primer between black and the white on it.
    EvenWhite,
    /// Three layers of white where there is one.
    WhiteThrice,
}

impl Accept {
    /// As typed.
    pub fn name(self) -> &'static str {
        match self {
            Accept::FoilUndercoat => "foil-undercoat",
            Accept::EvenWhite => "even-white",
            Accept::WhiteThrice => "white-thrice",
        }
    }
}

/// Something the print needs that the art does not have.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Suggestion {
    /// What and why.
    pub text: String,
    /// What to add to the command to have it.
    pub how: String,
    /// How many dots it is about.
    pub dots: u64,
}

/// What the stacks need; `order` are the inks from the paper up.
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
    let primed = about(&|layers| layers.contains(&Ink::Primer));
    let metal = |layers: &[Ink]| layers.iter().position(|ink| ink.kind() == Kind::Metallic);
    let metals = about(&|layers| metal(layers).is_some());
    let covered = about(&|layers| metal(layers).is_some_and(|metal| layers[metal..].contains(&Ink::Black)));
    // A little black on metal is lettering; most of the metal under black is a mistake.
    let hidden = if 2 * covered > metals { covered } else { 0 };
    let (metal_inks, others): (Vec<Ink>, Vec<Ink>) =
        order.iter().partition(|ink| ink.kind() == Kind::Metallic);
    let beneath = others.iter().rposition(|ink| ink.kind() == Kind::Process).map_or(0, |at| at + 1);
    let metal_above = [&others[..beneath], &metal_inks, &others[beneath..]].concat();
    let metal_above: Vec<_> = metal_above.into_iter().map(Ink::name).collect();
    let accept = |what: Accept| format!("--accept {}", what.name());
    [
        (
            bare_foil,
            "foil prints properly only on a solid of cyan, magenta, yellow and black, for grip and gloss",
            accept(Accept::FoilUndercoat),
        ),
        (
            white_on_black,
            "white straight on black is full of missing points; primer, finish and primer between them make it even",
            accept(Accept::EvenWhite),
        ),
        (thin_white, "one layer of white looks grey; three are nearly white", accept(Accept::WhiteThrice)),
        (
            primed,
            "primer can tear its ribbon on the settings for plain paper; those for cardboard cured it",
            "--media cardboard".into(),
        ),
        (
            hidden,
            "black covers most of the metallic ink; laid above black the metal is seen, and black is left out beneath it",
            format!("--order {}", metal_above.join(",")),
        ),
    ]
    .into_iter()
    .filter(|(dots, ..)| *dots > 0)
    .map(|(dots, text, how)| Suggestion { text: text.into(), how, dots })
    .collect()
}

/// Inks that plain colour asks for on so few dots that nobody would miss them; `allowed` are the inks that may be used.
pub(super) fn rare(laid: &[Laid], allowed: &InkSet) -> Vec<Suggestion> {
    let coloured: Vec<&Laid> = laid.iter().filter(|laid| laid.from == COLOURS).collect();
    let all: u64 = coloured.iter().map(|laid| laid.dots).sum();
    let without = |name: &str| {
        if *allowed == Settings::default().inks {
            return format!("--inks -{name}");
        }
        let others: Vec<_> = allowed.iter().map(Ink::name).filter(|&other| other != name).collect();
        format!("--inks {}", others.join(","))
    };
    coloured
        .into_iter()
        .filter(|laid| laid.dots * RARE < all)
        .map(|laid| Suggestion {
            text: format!(
                "the colours have next to no {}; without it a pass and a cartridge are saved",
                laid.ink
            ),
            how: without(laid.ink),
            dots: laid.dots,
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn laid(ink: Ink, dots: u64, from: &str) -> Laid {
        Laid { ink: ink.name(), dots, from: from.into(), passes: 1 }
    }

    #[test]
    fn an_ink_on_next_to_no_dots_of_the_colours_is_suggested_to_be_left_out() {
        let laid = [
            laid(Ink::White, 3, "white.png"),
            laid(Ink::Cyan, 90_000, COLOURS),
            laid(Ink::Black, 9_910, COLOURS),
            laid(Ink::Yellow, 90, COLOURS),
        ];
        let how = |allowed: &InkSet| {
            rare(&laid, allowed)
                .into_iter()
                .map(|suggestion| (suggestion.how, suggestion.dots))
                .collect::<Vec<_>>()
        };
        assert_eq!(how(&Settings::default().inks), [("--inks -yellow".to_owned(), 90)]);
        let some = InkSet::of([Ink::White, Ink::Cyan, Ink::Yellow, Ink::Black]);
        let [(words, 90)] = &how(&some)[..] else { panic!("one suggestion") };
        // What is typed means the same inks but that one.
        let typed: InkSet = words.strip_prefix("--inks ").unwrap().parse().unwrap();
        assert_eq!(typed, InkSet::of([Ink::White, Ink::Cyan, Ink::Black]));
    }

    #[test]
    fn few_dots_that_were_drawn_are_meant() {
        let laid = [laid(Ink::Cyan, 90_000, COLOURS), laid(Ink::Yellow, 3, "yellow.png")];
        assert!(rare(&laid, &Settings::default().inks).is_empty());
    }
}
