//! The mixture of every colour, in the form in which a threshold picks from it.
//!
//! Problem: thirty million dots each need the stack that their threshold picks from the mixture of their
//! colour.
//! Method: the stacks lie in order of lightness on [0, 1), the darkest first, each with its share;
//! [`Stops`] are where they end. So a threshold picks the stack whose number is how many stops it has
//! reached. Stops are linear in the shares: those of the nodes of the `lattice` are interpolated like
//! mixtures. In flat colours a share below [`Rules::least`] is dropped, since it would only be specks; the
//! stacks next to it in lightness have it. The colours that are the name of a stack are that stack.
//! Cost: 10 ns a colour. Limits: `N` stacks.

use inks::Stack;

use crate::colour::bound::{self, bound, seen};
use crate::colour::fit::Fit;
use crate::colour::intent::{Light, luminance};
use crate::colour::lattice::{ALL, NODES};
use crate::colour::solids::Solids;
use appearance::weights::ONE;

/// What decides about mixtures, and how dots hang together. A test moves each of these by a fifth.
#[derive(Clone, Copy)]
pub struct Rules {
    /// A share of a flat colour that is less is a speck.
    pub least: u16,
    /// The least difference in red, green or blue of the colours beside an edge.
    pub apart: u32,
    /// How much of what they can gain the stacks gain at an edge, in hundredths.
    pub part: u32,
    /// In pictures: how much more a stack is owed that the dot before and the dot above have, in dots; by
    /// halves for each.
    pub hold: f64,
    /// In pictures: how much more the darkest stack is owed than the palest where the threshold is lowest,
    /// in dots.
    pub noise: f64,
}

impl Rules {
    pub const USUAL: Rules =
        Rules { least: (ONE as u32 * 3 / 100) as u16, apart: 40, part: 75, hold: 0.8, noise: 0.5 };
}

/// Where each stack ends, in the order of [`Mixtures::stacks`]; [`ONE`] after the last.
pub type Stops<const N: usize> = [u16; N];

/// The mixtures of all colours.
pub struct Mixtures<'a, const N: usize> {
    solids: &'a Solids<'a>,
    pub rules: Rules,
    /// The stacks in the order of lightness.
    stacks: Vec<Stack>,
    /// Stops of the nodes of each lattice.
    nodes: Vec<Stops<N>>,
    /// Places of the 256 values between nodes.
    steps: [(usize, u32); 256],
    /// The lattice of pictures, and that of text and drawings.
    lattices: [usize; 2],
    /// The number in that order of the stack that each corner of sRGB names; red, green and blue are a bit
    /// each.
    named: [Option<usize>; 8],
    /// The light of each between black and paper.
    light: [Light; N],
    /// For each number in that order the number of the stack.
    pub order: [u8; N],
}

impl<'a, const N: usize> Mixtures<'a, N> {
    /// Of a fit with at most `N` stacks.
    pub fn new(fit: &Fit, solids: &'a Solids<'a>) -> Mixtures<'a, N> {
        let mut numbers: Vec<usize> = (0..fit.stacks.len()).collect();
        let of_each: Vec<f64> = fit.stacks.iter().map(|stack| luminance(solids.body(stack))).collect();
        numbers.sort_by(|&a, &b| of_each[a].total_cmp(&of_each[b]));
        let (mut order, mut light) = ([0; N], [[0.0; 3]; N]);
        for (at, &number) in numbers.iter().enumerate() {
            (order[at], light[at]) = (number as u8, solids.light(&fit.stacks[number]));
        }
        let nodes = fit.shares().map(|shares| {
            let sums = numbers.iter().scan(0, |sum, &q| {
                *sum += shares[q];
                Some(*sum)
            });
            let mut stops = [ONE; N];
            let total: u64 = shares.iter().sum();
            stops.iter_mut().zip(sums).for_each(|(stop, sum)| {
                *stop = ((sum * u64::from(ONE) + total / 2) / total.max(1)) as u16;
            });
            stops
        });
        let named = std::array::from_fn(|bits| {
            let stack = solids.named([4, 2, 1].map(|bit| if bits & bit > 0 { 255 } else { 0 }))?;
            numbers.iter().position(|&q| fit.stacks[q] == stack)
        });
        Mixtures {
            solids,
            rules: Rules::USUAL,
            stacks: numbers.iter().map(|&q| fit.stacks[q].clone()).collect(),
            nodes: nodes.collect(),
            steps: fit.steps,
            lattices: [0, fit.of_drawings],
            named,
            light,
            order,
        }
    }

    /// The stops of a colour that names a stack.
    #[inline(always)]
    fn named(&self, colour: [u8; 3]) -> Option<Stops<N>> {
        self.number_of_named(colour).map(alone)
    }

    /// Whether a colour names a stack.
    #[inline(always)]
    pub fn is_named(&self, colour: [u8; 3]) -> bool {
        self.number_of_named(colour).is_some()
    }

    #[inline(always)]
    fn number_of_named(&self, colour: [u8; 3]) -> Option<usize> {
        if colour.iter().any(|&v| v != 0 && v != 255) {
            return None;
        }
        self.named[colour.iter().fold(0, |bits, &v| 2 * bits + usize::from(v > 0))]
    }

    /// The stops of the colour of a label: its solid, if there is one.
    pub fn label(&self, colour: [u8; 3]) -> Stops<N> {
        let solid = self.solids.nearest(colour);
        let at = solid.and_then(|solid| self.stacks.iter().position(|known| known == solid));
        self.named(colour).or(at.map(alone)).unwrap_or_else(|| self.flat(colour, true))
    }

    /// The stops of a colour of a picture, or of text or a drawing.
    #[inline(always)]
    pub fn stops(&self, colour: [u8; 3], drawn: bool) -> Stops<N> {
        self.named(colour).unwrap_or_else(|| self.between(colour, drawn))
    }

    /// The stops between the nodes of the lattice.
    #[inline(always)]
    fn between(&self, colour: [u8; 3], drawn: bool) -> Stops<N> {
        let [x, y, z] = colour.map(|v| self.steps[usize::from(v)]);
        // How far each axis goes in the upper half and its step in the lower one: sorted as numbers,
        // without a branch.
        let axis = |far: u32, step: usize| far << 16 | step as u32;
        let [x_axis, y_axis, z_axis] = [axis(x.1, NODES * NODES), axis(y.1, NODES), axis(z.1, 1)];
        let (high, low) = (x_axis.max(y_axis), x_axis.min(y_axis));
        let (middle, least) = (low.max(z_axis), low.min(z_axis));
        let axes = [high.max(middle), high.min(middle), least, 0];
        let mut node = self.lattices[usize::from(drawn)] * ALL + (x.0 * NODES + y.0) * NODES + z.0;
        let mut sums = [0u16; N];
        let mut last = 256;
        for axis in axes {
            let (next, step) = (axis >> 16, axis & 0xffff);
            let part = last - next;
            if part == 256 {
                return self.nodes[node];
            }
            // Fewer than all parts: 16 bits, whose product's upper half is one operation for all stops.
            let part = (part << 8) as u16;
            for (sum, &stop) in sums.iter_mut().zip(&self.nodes[node]) {
                *sum += ((u32::from(stop) * u32::from(part)) >> 16) as u16;
            }
            (last, node) = (next, node + step as usize);
        }
        // Rounding down loses less than one unit at each of four nodes.
        sums.map(|sum| if sum > ONE - 4 { ONE } else { sum })
    }

    /// The stops of a flat colour.
    pub fn flat(&self, colour: [u8; 3], drawn: bool) -> Stops<N> {
        let name = match () {
            () if bound::is_full_black(colour) => self.named([0; 3]),
            () if bound::is_paper(colour) => self.named([255; 3]),
            () => None,
        };
        name.unwrap_or_else(|| stops(&self.without_specks(shares(&self.stops(colour, drawn)))))
    }

    /// Such shares without those that are less than [`Rules::least`], the smallest first. Each goes to the
    /// stacks next to it in lightness, a darker and a lighter one, in the parts that keep the lightness, or
    /// to the only one, unless that would be seen. So specks of several stacks may become one share that
    /// counts, and no share that counts shrinks.
    fn without_specks(&self, mut shares: [u16; N]) -> [u16; N] {
        let asked = seen(self.mean(&shares));
        let mut is_kept = [false; N];
        loop {
            let is_speck = |&q: &usize| !is_kept[q] && (1..self.rules.least).contains(&shares[q]);
            let Some(speck) = (0..N).filter(is_speck).min_by_key(|&q| shares[q]) else { return shares };
            is_kept[speck] = true;
            let without = self.without(shares, speck);
            if bound(asked, seen(self.mean(&without))) {
                shares = without;
            }
        }
    }

    /// Shares whose number `speck` has gone to its neighbours.
    fn without(&self, mut shares: [u16; N], speck: usize) -> [u16; N] {
        let has_any = |&q: &usize| shares[q] > 0;
        let (below, above) = ((0..speck).rev().find(has_any), (speck + 1..N).find(has_any));
        let (Some(dark), Some(pale)) = (below.or(above), above.or(below)) else { return shares };
        let light = |q: usize| luminance(self.light[q]);
        let (way, up) = (light(pale) - light(dark), light(speck) - light(dark));
        let lost = std::mem::take(&mut shares[speck]);
        let paler = if way > 0.0 { (f64::from(lost) * up / way).round() as u16 } else { 0 };
        shares[pale] += paler;
        shares[dark] += lost - paler;
        shares
    }

    /// The mean light of such shares.
    pub fn mean(&self, shares: &[u16; N]) -> Light {
        let mut mean = [0.0; 3];
        for (&share, light) in shares.iter().zip(&self.light).filter(|(share, _)| **share > 0) {
            let share = f64::from(share) / f64::from(ONE);
            mean.iter_mut().zip(light).for_each(|(mean, light)| *mean += share * light);
        }
        mean
    }

    /// The stack, in that order, that a threshold picks.
    #[inline(always)]
    pub fn pick(stops: &Stops<N>, threshold: u16) -> usize {
        let reached: u16 = stops.iter().map(|&stop| u16::from(stop <= threshold)).sum();
        reached.into()
    }
}

/// Whether one stack is all of a mixture.
#[inline(always)]
pub fn is_alone<const N: usize>(stops: &Stops<N>) -> bool {
    stops.iter().fold(true, |all, &stop| all & (stop == 0 || stop == ONE))
}

/// The stops of a stack alone.
fn alone<const N: usize>(stack: usize) -> Stops<N> {
    std::array::from_fn(|q| if q < stack { 0 } else { ONE })
}

/// The share of each stack.
pub fn shares<const N: usize>(stops: &Stops<N>) -> [u16; N] {
    std::array::from_fn(|q| stops[q] - if q > 0 { stops[q - 1] } else { 0 })
}

/// Where stacks with such shares end; what rounding leaves goes to the lightest that has any.
pub fn stops<const N: usize>(shares: &[u16; N]) -> Stops<N> {
    let mut sum = 0;
    let mut stops = shares.map(|share| {
        sum += share;
        sum
    });
    let last = shares.iter().rposition(|&share| share > 0).unwrap_or(0);
    stops[last..].fill(ONE);
    stops
}
