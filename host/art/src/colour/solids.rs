//! Stacks as solid colours: which stack a flat colour names, and what a stack looks like.
//!
//! Problem: programs write the inks as the primaries of sRGB, none of which is printable in sRGB's sense.
//! Method: a table of the eight corners of sRGB. What a stack reflects is read at the raking end of its curve, where there is no
//! gloss. Cost: nothing. Limits: the process inks.

use inks::Stack;
use protocol::ink::Ink;

use crate::colour::intent::{Light, difference};
use crate::colour::lattice::ends;
use appearance::brdf::Space;
use appearance::gamut::Printable;

/// How far from a colour its solid may be, in Oklab.
const NEAR: f64 = 0.1;

/// The stacks as solid colours.
pub(crate) struct Solids<'a> {
    printable: &'a Printable,
    /// Numbers of the bare paper and of the stack that prints black.
    bare: usize,
    black: usize,
}

impl Solids<'_> {
    pub(crate) fn new<'a>(printable: &'a Printable, space: &Space) -> Solids<'a> {
        let (bare, black) = ends(printable, space);
        Solids { printable, bare, black }
    }

    /// The stack that a colour names: white and black, and cyan, magenta, yellow, red, green and blue at full strength, as
    /// drawing programs and the conversion from CMYK write the inks. None of the six is printable in sRGB's sense.
    pub(crate) fn named(&self, colour: [u8; 3]) -> Option<Stack> {
        if colour.iter().any(|&v| v != 0 && v != 255) {
            return None;
        }
        let stacks = &self.printable.stacks;
        match colour {
            [0, 0, 0] => Some(stacks[self.black].clone()),
            _ => {
                let filters = [Ink::Cyan, Ink::Magenta, Ink::Yellow];
                let inks: Vec<Ink> =
                    filters.into_iter().zip(colour).filter(|(_, v)| *v == 0).map(|(ink, _)| ink).collect();
                let stack = Stack::new(inks);
                stacks.contains(&stack).then_some(stack)
            }
        }
    }

    /// What a stack reflects at the raking end of its curve, relative to paper: the body's colour without the surface's gloss.
    pub(crate) fn body(&self, stack: &Stack) -> Light {
        match self.printable.stacks.iter().position(|known| known == stack) {
            Some(at) => self.relative(at),
            None => [1.0; 3],
        }
    }

    /// What a stack reflects between black and paper, as the colours of art are: 0 and 1.
    pub(crate) fn light(&self, stack: &Stack) -> Light {
        let (own, black) = (self.body(stack), self.relative(self.black));
        std::array::from_fn(|c| (own[c] - black[c]) / (1.0 - black[c]))
    }

    /// The stack that looks most like a colour, if it is at most [`NEAR`] from it; never bare paper.
    pub(crate) fn nearest(&self, colour: [u8; 3]) -> Option<&Stack> {
        let black = self.relative(self.black);
        let light = colour.map(|v| f64::from(appearance::srgb::decode(f32::from(v) / 255.0)));
        let wanted = std::array::from_fn(|c| black[c] + light[c] * (1.0 - black[c]));
        let inked = (0..self.printable.stacks.len()).filter(|&at| at != self.bare);
        let apart = inked.map(|at| (difference(self.relative(at), wanted), at));
        let (_, at) = apart.min_by(|a, b| a.0.total_cmp(&b.0)).filter(|nearest| nearest.0 <= NEAR)?;
        Some(&self.printable.stacks[at])
    }

    fn relative(&self, stack: usize) -> Light {
        let [row, paper] = [stack, self.bare].map(|stack| self.printable.curves.row(stack));
        std::array::from_fn(|c| row[row.len() - 3 + c] / paper[row.len() - 3 + c])
    }
}
