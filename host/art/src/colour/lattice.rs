//! The lattice of colours for which mixtures of the stacks are found, and the mixtures between its nodes.
//!
//! Problem: to find a mixture takes a microsecond, a page has thirty million dots.
//! Method: 17 x 17 x 17 colours have theirs, once for each intent in use. A pixel is interpolated among the four corners of the
//! tetrahedron around it. An interpolated mixture is a mixture, so every pixel is printable.
//! Text and drawings name inks by the primaries of sRGB, none of which is printable as it looks. So that a tint does not differ
//! from its solid in hue, the lines from white to the primaries, and between neighbouring primaries, are tints of those stacks. Other
//! lattices run into these stacks at the primaries only ([`with_tints`]). Both do so over so many nodes that no step of a ramp is
//! seen, for a solid may lie 30 in CIEDE2000 from what is printed beside it.
//! Cost: 60 ms for the nodes, 20 ns a pixel. Limits: colours between nodes are as exact as the interpolation.

use inks::Stack;
use maths::Maths;
use protocol::ink::Ink;
use rayon::prelude::*;

use crate::colour::intent::{Hull, Intent, Light};
use crate::colour::tetrahedra::Even;
use appearance::brdf::Space;
use appearance::gamut::{InkMix, Printable};
use appearance::weights::{ONE, WeightError, WeightMaps, quantise};

/// Nodes along an edge of the lattice: every 16th of 8 bits and the last, as ICC tables have, so that
/// 4,913 colours are all a picture needs.
pub(crate) const NODES: usize = 17;
/// Nodes of the lattice of one intent.
pub(crate) const ALL: usize = NODES * NODES * NODES;

/// The node below a value, and how far the value lies above it in 1/256 of the way between nodes, in the `light` of what is a part of
/// full: mixtures add in light, so a colour that the inks reach is as exact between nodes as at them.
pub(crate) fn step(value: usize, light: impl Fn(f64) -> f64) -> (usize, u32) {
    let node = (value * (NODES - 1) / 255).min(NODES - 2);
    let level = |node: usize| light(node as f64 / (NODES - 1) as f64);
    let (low, high) = (level(node), level(node + 1));
    let part = (light(value as f64 / 255.0) - low) / (high - low);
    (node, (part * 256.0).round().clamp(0.0, 256.0) as u32)
}

/// The mixtures of the nodes, to interpolate between.
pub(crate) struct Nodes {
    /// The weights of each node in groups of eight, padded with zeros.
    lanes: Vec<[u16; 8]>,
    /// Groups of a node.
    each: usize,
    /// Channel of the largest weight of each node.
    largest: Vec<usize>,
}

impl Nodes {
    pub fn new(maps: &WeightMaps) -> Nodes {
        let each = maps.channels().div_ceil(8);
        let nodes = || maps.data().chunks_exact(maps.channels());
        let lanes = nodes().flat_map(|node| {
            (0..each).map(move |lane| {
                std::array::from_fn(|at| node.get(8 * lane + at).copied().unwrap_or_default())
            })
        });
        let largest = nodes().map(|node| (0..node.len()).max_by_key(|&at| node[at]).unwrap_or(0)).collect();
        Nodes { lanes: lanes.collect(), each, largest }
    }

    /// Scratch space for [`Nodes::between`].
    pub fn scratch(&self) -> Vec<[u16; 8]> {
        vec![[0; 8]; self.each]
    }

    /// The mixture between nodes of the lattice number `lattice`: along the edges of the cube from its lowest to its highest
    /// corner, first along the axis with the largest fraction. `sums` is scratch space for the groups of a node.
    #[inline]
    pub fn between(&self, lattice: usize, at: [(usize, u32); 3], sums: &mut [[u16; 8]], out: &mut [u16]) {
        let [x, y, z] = at;
        let mut axes = [(x.1, NODES * NODES), (y.1, NODES), (z.1, 1)];
        for (a, b) in [(0, 1), (1, 2), (0, 1)] {
            if axes[a].0 < axes[b].0 {
                axes.swap(a, b);
            }
        }
        let mut node = lattice * ALL + (x.0 * NODES + y.0) * NODES + z.0;
        let mut nearest = (0, node);
        let mut last = 256;
        sums.fill([0; 8]);
        for (next, step) in axes.into_iter().chain([(0, 0)]) {
            let part = last - next;
            if part == 256 {
                return out.copy_from_slice(&self.of(node).as_flattened()[..out.len()]);
            }
            if part > 0 {
                for (sums, weights) in sums.iter_mut().zip(self.of(node)) {
                    for (sum, &weight) in sums.iter_mut().zip(weights) {
                        *sum += ((u32::from(weight) * (part << 8)) >> 16) as u16;
                    }
                }
                nearest = nearest.max((part, node));
            }
            (last, node) = (next, node + step);
        }
        // Rounding down leaves less than four units a channel; they go to the largest weight of the nearest node.
        let total: u16 = sums.as_flattened().iter().sum();
        sums.as_flattened_mut()[self.largest[nearest.1]] += ONE - total;
        out.copy_from_slice(&sums.as_flattened()[..out.len()]);
    }

    /// The weights of every node, padded with zeros.
    pub fn weights(&self) -> impl Iterator<Item = &[u16]> {
        self.lanes.chunks_exact(self.each).map(|lanes| lanes.as_flattened())
    }

    fn of(&self, node: usize) -> &[[u16; 8]] {
        &self.lanes[node * self.each..][..self.each]
    }
}

/// How far inside the cube nodes are still tints in part. A test moves each by a fifth.
#[derive(Clone, Copy)]
pub(crate) struct Near {
    /// In nodes from an edge of the cube.
    pub edge: f64,
    /// For the lines from white, as a share of the distance from white.
    pub hue: f64,
    /// In nodes from a solid, where nothing is a tint but what is near that.
    pub corner: f64,
}

impl Near {
    pub const USUAL: Near = Near { edge: 4.0, hue: 1.0 / 4.0, corner: 6.0 };
}

/// Up to so many nodes between its channels a colour is about grey: colours whose channels differ by less than a node lie between such
/// nodes only, and there is nothing less but none.
const GREY: usize = 1;

/// What a colour is made of as tints: paper, a primary, and the secondary towards which its hue is turned.
pub(crate) struct Tint {
    /// Which of red, green and blue have all of their light, a bit each, and the share of each.
    parts: [(usize, f64); 3],
    /// How much of the colour is printed so, from none to 1 on the edges where no fit is wanted.
    part: f64,
}

impl Tint {
    /// The tint nearest to a node; `None` for greys.
    pub fn of(node: [usize; 3], near: Near, amount: impl Fn(f64) -> f64) -> Option<Tint> {
        let mut order = [(node[0], 4), (node[1], 2), (node[2], 1)];
        order.sort_by_key(|&(level, _)| std::cmp::Reverse(level));
        let [most, middle, least] = order.map(|(level, _)| level as f64);
        if most == 0.0 || (most == least && order[0].0 < NODES - 1) {
            return None;
        }
        let towards = |[most, middle, least]: [f64; 3]| {
            if most > least { (middle - least) / (most - least) } else { 1.0 }
        };
        let along = towards([most, middle, least]);
        let (dark, pale) = ((NODES - 1) as f64 - most, least);
        let off_line = along.min(1.0 - along) / near.hue;
        let part = level(1.0 - dark / near.edge) * (1.0 - off_line.min(pale / near.edge)).max(0.0);
        let amount = [most, middle, least].map(|level| amount(level / (NODES - 1) as f64));
        let (paper, second) = (amount[2] / amount[0], towards(amount));
        let (primary, secondary) = (order[0].1, order[0].1 | order[1].1);
        let ink = 1.0 - paper;
        Some(Tint { parts: [(7, paper), (secondary, ink * second), (primary, ink * (1.0 - second))], part })
    }

    /// The solid of a primary at its own node, and in part at those near it.
    pub fn of_corner(node: [usize; 3], near: Near) -> Option<Tint> {
        let last = NODES - 1;
        let (mut corner, mut off) = (0, 0);
        for level in node {
            let is_far = 2 * level > last;
            corner = 2 * corner + usize::from(is_far);
            off = off.max(if is_far { last - level } else { level });
        }
        let part = level(1.0 - off as f64 / near.corner);
        // White and black are fitted, as all greys are.
        let is_primary = (1..7).contains(&corner);
        is_primary.then_some(Tint { parts: [(corner, 1.0), (7, 0.0), (7, 0.0)], part })
    }
}

/// A part that begins and ends level: what is beside a dark solid is much lighter soon.
fn level(part: f64) -> f64 {
    let part = part.max(0.0);
    part * part * (3.0 - 2.0 * part)
}

/// Prints the edges of a lattice on which no fit is wanted: from white to each of the six primaries and from cyan, magenta and
/// yellow to the red, green and blue beside them. Along them are the two stacks that the ends name, in shares that change evenly with
/// the `amount` of the values of red, green and blue. If that is the value itself, 30 % cyan is cyan on 30 % of the dots; if it is light, a
/// pink with a fifth of green's and blue's light is paper on a fifth of its dots. Nodes near them are such tints in part, so that a
/// shading that ends there has no step. With [`Tint::of_corner`] only the six primaries are printed so.
pub(crate) fn with_tints(
    mix: InkMix,
    lattice: usize,
    tint: impl Fn([usize; 3]) -> Option<Tint>,
    named: impl Fn([u8; 3]) -> Option<Stack>,
) -> Result<InkMix, WeightError> {
    let mut wider = Wider::new(mix);
    // The corners without black: red, green and blue are a bit each.
    let corners: [Option<usize>; 8] = std::array::from_fn(|bits| {
        let colour = [4, 2, 1].map(|bit| if bits & bit > 0 { 255 } else { 0 });
        (bits > 0).then(|| named(colour)).flatten().map(|stack| wider.channel(&stack))
    });
    wider.changed(|node, out| {
        let Some(node) = node.checked_sub(lattice * ALL).filter(|&node| node < ALL) else { return };
        let at = [node / (NODES * NODES), node / NODES % NODES, node % NODES];
        let Some(Tint { parts, part }) = tint(at) else { return };
        let parts = parts.map(|(corner, share)| (corners[corner], share));
        if part == 0.0 || parts.iter().any(|&(corner, share)| corner.is_none() && share > 0.0) {
            return;
        }
        out.iter_mut().for_each(|weight| *weight *= 1.0 - part);
        for (corner, share) in parts {
            if let Some(corner) = corner {
                out[corner] += part * share;
            }
        }
    })
}

/// Mixtures with further channels, each of which is nothing but a stack.
struct Wider {
    stacks: Vec<Stack>,
    maps: WeightMaps,
    matrix: Vec<Vec<u16>>,
}

impl Wider {
    fn new(InkMix { stacks, maps, matrix }: InkMix) -> Wider {
        Wider { stacks, maps, matrix }
    }

    /// The channel that is nothing but a stack.
    fn channel(&mut self, stack: &Stack) -> usize {
        let number = self.stacks.iter().position(|known| known == stack).unwrap_or_else(|| {
            self.stacks.push(stack.clone());
            self.matrix.iter_mut().for_each(|shares| shares.push(0));
            self.stacks.len() - 1
        });
        self.matrix.iter().position(|shares| shares[number] == ONE).unwrap_or_else(|| {
            let mut shares = vec![0; self.stacks.len()];
            shares[number] = ONE;
            self.matrix.push(shares);
            self.matrix.len() - 1
        })
    }

    /// The mixtures after `change` of those that it changes; it is told the number of each and its weights, which sum to 1.
    fn changed(self, change: impl Fn(usize, &mut [f64])) -> Result<InkMix, WeightError> {
        let Wider { stacks, maps, matrix } = self;
        let (old, channels) = (maps.channels(), matrix.len());
        let mut data = vec![0; maps.data().len() / old * channels];
        let nodes = data.chunks_exact_mut(channels).zip(maps.data().chunks_exact(old));
        for (node, (out, weights)) in nodes.enumerate() {
            let mut wanted: Vec<f64> =
                weights.iter().map(|&weight| f64::from(weight) / f64::from(ONE)).collect();
            wanted.resize(channels, 0.0);
            let before = wanted.clone();
            change(node, &mut wanted);
            out[..old].copy_from_slice(weights);
            if wanted != before {
                wanted.iter_mut().for_each(|weight| *weight *= f64::from(ONE));
                quantise(&wanted, out);
            }
        }
        let maps = WeightMaps::new(maps.width(), maps.height(), channels, data)?;
        Ok(InkMix { stacks, maps, matrix })
    }
}

/// The colours of the nodes, in order of intent, red, green and blue.
pub(crate) struct Lattice {
    /// What each stack looks like and what is printed for each node, between black and paper.
    stacks: Vec<Light>,
    light: Vec<Light>,
    /// The numbers of black and of paper.
    ends: (usize, usize),
}

/// Paper's number among the stacks, and that of the stack that prints black. Black ink is preferred: text in three inks is never
/// sharp.
pub(crate) fn ends(printable: &Printable, space: &Space) -> (usize, usize) {
    let bright = |row: &[f64]| row.iter().zip(space.weight()).map(|(r, w)| r * w).sum::<f64>();
    let bare = printable.stacks.iter().position(|stack| stack.layers().is_empty()).unwrap_or(0);
    let black = printable.stacks.iter().position(|stack| *stack == Stack::new([Ink::Black]));
    let darkest = || {
        (0..printable.stacks.len())
            .min_by(|&a, &b| bright(printable.curves.row(a)).total_cmp(&bright(printable.curves.row(b))))
    };
    (bare, black.or_else(darkest).unwrap_or(0))
}

impl Lattice {
    /// The lattices of these intents. Values are brightened by the exponent 1 / `gamma` first.
    pub fn new(space: &Space, printable: &Printable, intents: &[Intent], gamma: f64) -> Lattice {
        let (bare, dark) = ends(printable, space);
        let [paper, black] = [bare, dark].map(|end| printable.curves.row(end));
        // The raking end of the curves: the body's colour without the surface's gloss.
        let body = |row: &[f64]| -> Light {
            let from = row.len() - 3;
            std::array::from_fn(|c| {
                (row[from + c] - black[from + c]) / (paper[from + c] - black[from + c]).max(1e-9)
            })
        };
        let stacks: Vec<Light> = printable.curves.rows().map(body).collect();
        let hull = Hull::new(&stacks);
        let level = |i: usize| (i as f64 / (NODES - 1) as f64).power(1.0 / gamma);
        let level: [f64; NODES] =
            std::array::from_fn(|i| f64::from(appearance::srgb::decode(level(i) as f32)));
        let light = intents.iter().flat_map(|&intent| {
            let nodes: Vec<Light> = (0..ALL)
                .into_par_iter()
                .map(|node| {
                    let colour =
                        [node / (NODES * NODES), node / NODES % NODES, node % NODES].map(|i| level[i]);
                    hull.map(colour, intent)
                })
                .collect();
            nodes
        });
        let light = light.collect();
        Lattice { stacks, light, ends: (dark, bare) }
    }

    /// The mixtures of all nodes, of the stacks of `printable`.
    pub fn mixtures(&self, printable: &Printable) -> Result<InkMix, WeightError> {
        let even = Even::new(&self.stacks, self.ends);
        let stacks = printable.stacks.clone();
        let n = stacks.len();
        let mut data = vec![0; n * self.light.len()];
        data.par_chunks_exact_mut(n).zip(&self.light).enumerate().for_each(|(node, (out, &light))| {
            let [r, g, b] = [node / (NODES * NODES) % NODES, node / NODES % NODES, node % NODES];
            let is_grey = r.max(g).max(b) - r.min(g).min(b) <= GREY;
            let mut wanted = vec![0.0; n];
            for (stack, share) in if is_grey { even.about_grey(light) } else { even.shares(light) } {
                wanted[stack] += share * f64::from(ONE);
            }
            quantise(&wanted, out);
        });
        let maps = WeightMaps::new(NODES * NODES, self.light.len() / (NODES * NODES), n, data)?;
        let matrix = (0..n).map(|q| (0..n).map(|p| if p == q { ONE } else { 0 }).collect()).collect();
        Ok(InkMix { stacks, maps, matrix })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn between_nodes_weights_are_those_of_the_tetrahedron(
            pixel: [u8; 3], seed: u32, channels in 1usize..20, lattice in 0usize..2
        ) {
            let random = |i: usize| f64::from((i as u32 ^ seed).wrapping_mul(0x9e37_79b1) >> 11);
            let mut data = vec![0; 2 * ALL * channels];
            for (node, out) in data.chunks_exact_mut(channels).enumerate() {
                let weights: Vec<f64> = (0..channels).map(|q| random(channels * node + q)).collect();
                quantise(&weights, out);
            }
            let maps = WeightMaps::new(NODES * NODES, 2 * NODES, channels, data).unwrap();
            let (nodes, at) = (Nodes::new(&maps), pixel.map(|v| step(usize::from(v), |v| v)));
            let (mut sums, mut out) = (nodes.scratch(), vec![0; channels]);
            nodes.between(lattice, at, &mut sums, &mut out);
            prop_assert_eq!(out.iter().map(|&w| u32::from(w)).sum::<u32>(), u32::from(ONE));
            // The barycentric form: a corner for each axis that is at least as far along as the fraction says.
            let mut exact = vec![0.0; channels];
            let mut levels = vec![0, 256];
            levels.extend(at.map(|(_, part)| part));
            levels.sort_unstable();
            for pair in levels.windows(2) {
                let node = at.iter().fold(0, |node, &(n, part)| node * NODES + n + usize::from(part > pair[0]));
                let share = f64::from(pair[1] - pair[0]) / 256.0;
                exact.iter_mut().zip(maps.at(lattice * ALL + node)).for_each(|(sum, &w)| *sum += share * f64::from(w));
            }
            for (&out, &exact) in out.iter().zip(&exact) {
                let off = f64::from(out) - exact;
                prop_assert!(off > -4.0 && off <= 4.0 * channels as f64, "{} is not {}", out, exact);
            }
        }

        #[test]
        fn a_value_lies_between_its_nodes(value in 0usize..256) {
            let (node, part) = step(value, |v| v);
            let at = (node as f64 + f64::from(part) / 256.0) / (NODES - 1) as f64;
            prop_assert!((at - value as f64 / 255.0).abs() < 1.0 / 4000.0);
        }
    }

    proptest! {
        /// So what is kept for the nodes about grey is kept for these colours.
        #[test]
        fn colours_that_differ_by_less_than_a_node_lie_between_nodes_about_grey(
            base in 0u8..=255, off in prop::array::uniform3(0u8..=15)
        ) {
            let at = off.map(|off| step(usize::from(base.saturating_add(off)), |v| v));
            let mut axes = [0, 1, 2];
            axes.sort_by_key(|&axis| std::cmp::Reverse(at[axis].1));
            let mut node = at.map(|(node, _)| node);
            let about_grey = |node: [usize; 3]| {
                node.iter().max().unwrap() - node.iter().min().unwrap() <= GREY
            };
            let mut last = 256;
            for next in axes.map(|axis| at[axis].1).into_iter().chain([0]).zip(axes.map(Some).into_iter().chain([None])) {
                prop_assert!(last == next.0 || about_grey(node), "{node:?}");
                last = next.0;
                if let Some(axis) = next.1 {
                    node[axis] += 1;
                }
            }
        }
    }
}
