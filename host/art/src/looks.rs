//! What is seen on what: whether a stack that stands for a colour is read on its ground.
//!
//! Problem: the stack nearest to a colour may be as light as the ground, or on the other side of it: sand letters on slate were black.
//! Method: in Oklab, the way from the ground's colour to the letter's is compared with that from what is printed for the ground to the stack:
//! how far the second goes along the first. Colours are taken as a screen shows them, with its flare.
//! Cost: some nanoseconds for each pair of colours, 200 ns for each dot of a tone that shapes lie on. Limits: of a screened ground the mean
//! counts, and whether it has cells of the stack; a thin ground may be printed otherwise.

use inks::Stack;

use super::flat::Flat;
use super::intent::{Light, difference, oklab};
use super::solids::Solids;
use super::treatments::{CHOICES, Treatment};

/// The light that a screen reflects by itself: the viewing flare of IEC 61966-2-1. Without it 2 of 255 is as far from black as light grey is
/// from white.
const FLARE: f64 = 0.01;
/// Colours that differ by less hardly do.
const FAINT: f64 = 0.25;
/// And by less, not at all: text in the colour of its ground.
const HIDDEN: f64 = 0.02;

/// A stack stands for a colour on a ground if it differs from the ground in the colour's way, by at least this part of it, and by at most so many
/// times as much. On a ground that has cells of the same stack letters are read by lightness: where most of the difference is that, it is at least
/// that part of it.
const CONTRAST: f64 = 0.5;
const GLARING: f64 = 3.0;
const READ: f64 = 2.0 / 3.0;
/// Where no stack does, one that differs by so much: what is lighter than its ground is never printed darker than it.
const TRACE: f64 = 0.15;

/// How colours look, in Oklab: what stands for a colour must be seen on its ground as the colour would be.
#[derive(Default)]
pub(super) struct Looks<'a> {
    /// Each flat colour as a screen shows it, and what is printed for it as an area.
    asked: Vec<[f64; 3]>,
    printed: Vec<[f64; 3]>,
    /// The stacks of whose cells most of that is made, if it is screened.
    cells: Vec<Option<[u8; CHOICES]>>,
    /// Of each stack.
    stacks: Vec<[f64; 3]>,
    /// Of each dot that is a tone its colour, and both of these.
    tone: Option<Box<Tone<'a>>>,
}

type Tone<'a> = dyn Fn(usize) -> ([u8; 3], [[f64; 3]; 2]) + Sync + 'a;

impl<'a> Looks<'a> {
    /// How flat colours look that are printed so. `tone` tells the colour of a dot that is a tone.
    pub fn of(
        flat: &Flat,
        treatments: &[Treatment],
        stacks: &[Stack],
        solids: &'a Solids<'a>,
        tone: Option<impl Fn(usize) -> [u8; 3] + Sync + 'a>,
    ) -> Looks<'a> {
        let stacks: Vec<[f64; 3]> = stacks.iter().map(|stack| oklab(solids.body(stack))).collect();
        let printed = treatments.iter().zip(&flat.colours).map(|(treatment, &(_, colour))| match treatment {
            Treatment::Solid(stack) => stacks[usize::from(*stack)],
            Treatment::Shape(_) => oklab(solids.wanted(colour)),
        });
        let cells = treatments.iter().map(|treatment| match treatment {
            Treatment::Shape(shape) => Some(shape.solids),
            Treatment::Solid(_) => None,
        });
        let tone = tone.map(|tone| {
            let look = move |at: usize| {
                let colour = tone(at);
                (colour, [oklab(shown(colour)), oklab(solids.wanted(colour))])
            };
            Box::new(look) as Box<Tone<'a>>
        });
        Looks {
            asked: flat.colours.iter().map(|&(_, colour)| oklab(shown(colour))).collect(),
            printed: printed.collect(),
            cells: cells.collect(),
            stacks,
            tone,
        }
    }

    pub fn has_tones(&self) -> bool {
        self.tone.is_some()
    }

    /// How each of these stacks would be seen on a tone beside the colour that it stands for; and the tone.
    pub fn seen_on_tone(
        &self,
        own: u8,
        at: usize,
        stacks: [u8; CHOICES],
    ) -> Option<([Seen; CHOICES], [u8; 3])> {
        let (colour, ground) = self.tone.as_ref()?(at);
        Some((stacks.map(|stack| self.seen_on(own, ground, stack, false)), colour))
    }

    /// How a stack that stands for a colour would be seen on a flat colour beside it.
    pub fn seen(&self, own: u8, beside: u8, stack: u8) -> Seen {
        let ground = usize::from(beside);
        let is_cell = matches!(self.cells.get(ground), Some(Some(cells)) if cells.contains(&stack));
        let ground = self.asked.get(ground).zip(self.printed.get(ground));
        ground.map_or(Seen::AsAsked, |(&asked, &printed)| self.seen_on(own, [asked, printed], stack, is_cell))
    }

    fn seen_on(&self, own: u8, [asked, printed]: [[f64; 3]; 2], stack: u8, is_cell: bool) -> Seen {
        let Some((own, stack)) = self.asked.get(usize::from(own)).zip(self.stacks.get(usize::from(stack)))
        else {
            return Seen::AsAsked;
        };
        let way: [f64; 3] = std::array::from_fn(|i| own[i] - asked[i]);
        let found: [f64; 3] = std::array::from_fn(|i| stack[i] - printed[i]);
        let whole: f64 = way.iter().map(|v| v * v).sum();
        let along = (0..3).map(|i| way[i] * found[i]).sum::<f64>() / whole;
        let is_read = !is_cell || 2.0 * way[0] * way[0] < whole || found[0] / way[0] >= READ;
        match along {
            CONTRAST..=GLARING if is_read => Seen::AsAsked,
            TRACE..=GLARING => Seen::Faintly,
            _ => Seen::Otherwise,
        }
    }
}

/// How a stack is seen that stands for a colour.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Seen {
    /// As the colour would be, or a little more.
    AsAsked,
    /// Hardly.
    Faintly,
    /// Not at all, the other way, or far too much.
    Otherwise,
}

/// The light of a colour as a screen shows it.
fn shown(colour: [u8; 3]) -> Light {
    colour.map(|v| (f64::from(appearance::srgb::decode(f32::from(v) / 255.0)) + FLARE) / (1.0 + FLARE))
}

/// How far two colours are apart as a screen shows them.
pub(super) fn apart(a: [u8; 3], b: [u8; 3]) -> f64 {
    difference(shown(a), shown(b))
}

/// Whether colours hardly differ as a screen shows them.
pub(super) fn is_faint(a: [u8; 3], b: [u8; 3]) -> bool {
    apart(a, b) < FAINT
}

/// Whether nobody can tell two colours apart on a screen.
pub(super) fn is_hidden(a: [u8; 3], b: [u8; 3]) -> bool {
    apart(a, b) < HIDDEN
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Greys on a grey ground, and a stack of each lightness: closed forms along the axis of lightness.
    #[test]
    fn a_stack_is_seen_if_it_differs_from_the_ground_as_the_colour_does() {
        let grey = |lightness: f64| [lightness, 0.0, 0.0];
        let looks = |own: f64, ground: f64, cells: Option<[u8; CHOICES]>| Looks {
            asked: vec![grey(own), grey(ground)],
            printed: vec![grey(own), grey(ground)],
            cells: vec![None, cells],
            stacks: (0..=10).map(|tenth| grey(f64::from(tenth) / 10.0)).collect(),
            tone: None,
        };
        // On 0.5: 0.7 asks for 0.2 more, so 0.6 is half of it, 1.0 two and a half times, 0.5 and less are lost.
        let seen = |own: f64, cells| {
            let looks = looks(own, 0.5, cells);
            (0..=10).map(|stack| looks.seen(0, 1, stack)).collect::<Vec<_>>()
        };
        use Seen::{AsAsked, Faintly, Otherwise};
        assert_eq!(
            seen(0.7001, None)[4..],
            [Otherwise, Otherwise, Faintly, AsAsked, AsAsked, AsAsked, AsAsked]
        );
        assert_eq!(seen(0.3001, None)[..6], [AsAsked, AsAsked, AsAsked, AsAsked, AsAsked, Otherwise]);
        // A fifth of all is glaring for what asks for a twentieth.
        assert_eq!(seen(0.5501, None)[5..8], [Otherwise, AsAsked, Otherwise]);
        // Among its own cells half of the lightness is not read.
        assert_eq!(seen(0.3001, Some([4; CHOICES]))[3..5], [AsAsked, Faintly]);
    }
}
