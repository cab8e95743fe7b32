//! Plain colour to the process inks: a picture is a matte document.
//!
//! Problem: a photograph has millions of colours, a page has thirty million dots, and white must stay bare paper.
//! Method: sRGB is relative to the paper. White is bare paper, and black is black ink; without black ink, it is the darkest
//! stack of the allowed process inks. Other colours lie between the two in linear light. The gamut stage fits a lattice of
//! 17 x 17 x 17 such colours to the stacks (eq. 1 at every node; unprintable colours are clamped to the nearest
//! printable one). Pixels are interpolated among the four corners of a tetrahedron of the lattice, and the mixture of
//! stacks goes to the halftone stage. An interpolated mixture is a mixture, so every pixel is printable.
//! Cost: 50 ms for the lattice, 20 ns a pixel, 10 ns a dot. Pictures finer than 300 dpi are averaged to 300 dpi in linear
//! light, because no cluster of dots is finer. Limits: colours are clamped, not compressed; their accuracy is that of the
//! ink library.

use inks::{InkSet, Library, Stack};
use protocol::ink::{Ink, Kind};
use rayon::prelude::*;

use super::error::LayersError;
use crate::halftone::{self, halftone};
use appearance::brdf::{Space, Table};
use appearance::document::{Materials, SAMPLES};
use appearance::factor::Factored;
use appearance::gamut::{self, Gloss, InkMix, Intent, Printable};
use appearance::weights::{ONE, WeightMaps};
use observe::Observer;

/// Nodes along an edge of the lattice.
const NODES: usize = 17;

/// Colours to print with the process inks.
#[derive(Clone, Debug, PartialEq)]
pub struct Colour {
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// sRGB, three bytes a pixel; 255, 255, 255 is bare paper.
    pub rgb: Vec<u8>,
}

impl Colour {
    /// The same averaged to at most one pixel for two dots along each side.
    pub(super) fn averaged(self, dots: (usize, usize)) -> Colour {
        let to = (self.width.min(dots.0.div_ceil(2)), self.height.min(dots.1.div_ceil(2)));
        if to == (self.width, self.height) {
            return self;
        }
        // Sums of linear light in 16 bits a channel: exact enough to restore every 8-bit sRGB value.
        let linear: Vec<u32> = (0..=255u8)
            .map(|v| (65535.0 * appearance::srgb::decode(f32::from(v) / 255.0)).round() as u32)
            .collect();
        let coded: Vec<u8> = (0..=65535)
            .map(|light| {
                let above = linear.partition_point(|&v| v < light).clamp(1, 255);
                let nearer = light.abs_diff(linear[above]) <= light.abs_diff(linear[above - 1]);
                (if nearer { above } else { above - 1 }) as u8
            })
            .collect();
        // Whole pixels: pairs, or shared first and last pixels where the sides are no multiples. No dot shows the difference.
        let span = |at: usize, from: usize, to: usize| match from.div_ceil(2) == to {
            true => 2 * at..(2 * at + 2).min(from),
            false => at * from / to..((at + 1) * from).div_ceil(to),
        };
        let mut rgb = vec![0; to.0 * to.1 * 3];
        rgb.par_chunks_exact_mut(to.0 * 3).enumerate().for_each(|(y, row)| {
            let rows = span(y, self.height, to.1);
            for (x, out) in row.as_chunks_mut::<3>().0.iter_mut().enumerate() {
                let columns = span(x, self.width, to.0);
                let mut sum = [0u64; 3];
                for y in rows.clone() {
                    let line = &self.rgb[3 * (y * self.width + columns.start)..][..3 * columns.len()];
                    for pixel in line.as_chunks::<3>().0 {
                        sum.iter_mut()
                            .zip(pixel)
                            .for_each(|(sum, &v)| *sum += u64::from(linear[usize::from(v)]));
                    }
                }
                let count = (rows.len() * columns.len()) as u64;
                *out = sum.map(|sum| coded[((sum + count / 2) / count) as usize]);
            }
        });
        Colour { width: to.0, height: to.1, rgb }
    }

    /// Halftones the colours: stacks of process inks, and the stack of each dot.
    pub(super) fn halftone(
        &self,
        dots: (usize, usize),
        inks: &InkSet,
        library: &Library,
        observer: &dyn Observer,
    ) -> Result<(Vec<Stack>, Vec<u8>), LayersError> {
        let mix = self.mix(inks, library, observer)?;
        // Larger art was refused when its size was decided.
        let (width, height) = (dots.0 as u16, dots.1 as u16);
        let settings = halftone::Settings::from_library(&mix.stacks, library);
        Ok(halftone(&mix, (width, height), None, &settings, observer)?.into_parts())
    }

    /// The mixture of stacks at every pixel.
    fn mix(&self, inks: &InkSet, library: &Library, observer: &dyn Observer) -> Result<InkMix, LayersError> {
        let space = Space::half_angle(SAMPLES);
        let process = InkSet::of(inks.iter().filter(|ink| ink.kind() == Kind::Process));
        let printable = Printable::from_library(library, &process, &space);
        let lattice = Lattice::new(space, &printable);
        let mut bases = Table::new(lattice.space.columns());
        bases.push(&lattice.paper);
        let maps = WeightMaps::uniform(lattice.width(), lattice.height());
        let factored = Factored { space: lattice.space.clone(), bases, maps };
        let settings =
            gamut::Settings { intent: Intent::Clamp, gloss: Gloss::Keep, ..gamut::Settings::default() };
        let nodes = gamut::map(&factored, Some(&lattice), &printable, &settings, observer)?.mix;
        let channels = nodes.maps.channels();
        let mut data = vec![0u16; self.width * self.height * channels];
        let steps: [(usize, u32); 256] = std::array::from_fn(step);
        let lattice = Nodes::new(&nodes.maps);
        data.par_chunks_mut(channels << 12).zip(self.rgb.par_chunks(3 << 12)).for_each(|(out, rgb)| {
            let mut sums = vec![[0; 8]; lattice.each];
            for (out, pixel) in out.chunks_exact_mut(channels).zip(rgb.as_chunks::<3>().0) {
                lattice.between(pixel.map(|v| steps[usize::from(v)]), &mut sums, out);
            }
        });
        let maps =
            WeightMaps::new(self.width, self.height, channels, data).map_err(gamut::GamutError::from)?;
        Ok(InkMix { stacks: nodes.stacks, maps, matrix: nodes.matrix })
    }
}

/// The node below a value, and the distance of the value above it in 1/256 of the step between nodes.
fn step(value: usize) -> (usize, u32) {
    let at = value * (NODES - 1);
    let node = (at / 255).min(NODES - 2);
    (node, ((at - node * 255) * 256).div_euclid(255) as u32)
}

/// The mixtures of the lattice's nodes, to interpolate between.
struct Nodes {
    /// The weights of each node in groups of eight, padded with zeros.
    lanes: Vec<[u16; 8]>,
    /// Groups of a node.
    each: usize,
    /// Channel of the largest weight of each node.
    largest: Vec<usize>,
}

impl Nodes {
    fn new(maps: &WeightMaps) -> Nodes {
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

    /// The mixture between nodes: along the edges of the cube from its lowest to its highest corner, first along the axis
    /// with the largest fraction. `sums` is scratch space for the groups of a node.
    #[inline]
    fn between(&self, at: [(usize, u32); 3], sums: &mut [[u16; 8]], out: &mut [u16]) {
        let [x, y, z] = at;
        let mut axes = [(x.1, NODES * NODES), (y.1, NODES), (z.1, 1)];
        for (a, b) in [(0, 1), (1, 2), (0, 1)] {
            if axes[a].0 < axes[b].0 {
                axes.swap(a, b);
            }
        }
        let mut node = (x.0 * NODES + y.0) * NODES + z.0;
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

    fn of(&self, node: usize) -> &[[u16; 8]] {
        &self.lanes[node * self.each..][..self.each]
    }
}

/// The lattice as a document: one matte pixel for every node, in order of red, green and blue.
struct Lattice {
    space: Space,
    paper: Vec<f64>,
    black: Vec<f64>,
    /// Linear light of the nodes.
    light: [f64; NODES],
}

impl Lattice {
    fn new(space: Space, printable: &Printable) -> Lattice {
        let bright = |row: &[f64]| row.iter().zip(space.weight()).map(|(r, w)| r * w).sum::<f64>();
        let bare = printable.stacks.iter().position(|stack| stack.layers().is_empty()).unwrap_or(0);
        let black = printable.stacks.iter().position(|stack| stack.layers() == [Ink::Black]);
        let darkest = (0..printable.stacks.len())
            .min_by(|&a, &b| bright(printable.curves.row(a)).total_cmp(&bright(printable.curves.row(b))));
        // Prefer black ink: text in three inks is never sharp.
        let darkest = black.or(darkest).unwrap_or(0);
        let paper = printable.curves.row(bare).to_vec();
        let black = printable.curves.row(darkest).to_vec();
        let light =
            std::array::from_fn(|i| f64::from(appearance::srgb::decode(i as f32 / (NODES - 1) as f32)));
        Lattice { space, paper, black, light }
    }
}

impl Materials for Lattice {
    fn width(&self) -> usize {
        NODES * NODES
    }

    fn height(&self) -> usize {
        NODES
    }

    fn space(&self) -> &Space {
        &self.space
    }

    fn reflectance(&self, pixel: usize, out: &mut [f32]) {
        let light = [pixel / (NODES * NODES), pixel / NODES % NODES, pixel % NODES].map(|i| self.light[i]);
        for (at, out) in out.iter_mut().enumerate() {
            *out = (self.black[at] + light[at % 3] * (self.paper[at] - self.black[at])) as f32;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use observe::Silent;
    use proptest::prelude::*;

    #[test]
    fn greys_reflect_what_they_should_and_white_is_bare_paper() {
        let greys: Vec<u8> = (0..=255).collect();
        let colour = Colour { width: 256, height: 1, rgb: greys.iter().flat_map(|&v| [v; 3]).collect() };
        let (library, inks) = (Library::builtin(), InkSet::default());
        let mix = colour.mix(&inks, &library, &Silent).unwrap();
        let space = Space::half_angle(SAMPLES);
        let row = |stack: &str| {
            let entry = library.entry(&stack.parse().unwrap()).unwrap();
            space.row(&entry.curve_at(space.angles()))
        };
        let (paper, darkest) = (row("substrate"), row("K"));
        let mut shares = vec![0.0; mix.stacks.len()];
        for (pixel, &v) in greys.iter().enumerate() {
            mix.shares(pixel, &mut shares);
            let light = f64::from(appearance::srgb::decode(f32::from(v) / 255.0));
            // The raking half of the curve: the body's colour without the surface's gloss.
            let at = 3 * (SAMPLES - 1) + 1;
            let printed: f64 = mix
                .stacks
                .iter()
                .zip(&shares)
                .map(|(stack, share)| share * row(&stack.to_string())[at])
                .sum();
            let wanted = darkest[at] + light * (paper[at] - darkest[at]);
            assert!((printed - wanted).abs() < 0.02 * paper[at], "grey {v}: {printed}, not {wanted}");
        }
        mix.shares(255, &mut shares);
        assert_eq!(shares[0], 1.0, "white has no ink: {shares:?}");
    }

    #[test]
    fn averages_are_of_light_not_of_numbers() {
        let checks = (0..64 * 64).flat_map(|at| if (at % 64 + at / 64) % 2 == 0 { [255; 3] } else { [0; 3] });
        let colour = Colour { width: 64, height: 64, rgb: checks.collect() };
        let half = colour.clone().averaged((64, 64));
        assert_eq!((half.width, half.height), (32, 32));
        // sRGB of half the light.
        assert!(half.rgb.iter().all(|&v| v == 188), "{:?}", &half.rgb[..6]);
        assert_eq!(colour.clone().averaged((128, 128)), colour, "300 dpi stays as it is");
    }

    proptest! {
        #[test]
        fn between_nodes_weights_are_those_of_the_tetrahedron(pixel: [u8; 3], seed: u32, channels in 1usize..20) {
            let random = |i: usize| f64::from((i as u32 ^ seed).wrapping_mul(0x9e37_79b1) >> 11);
            let mut data = vec![0; NODES * NODES * NODES * channels];
            for (node, out) in data.chunks_exact_mut(channels).enumerate() {
                let weights: Vec<f64> = (0..channels).map(|q| random(channels * node + q)).collect();
                appearance::weights::quantise(&weights, out);
            }
            let maps = WeightMaps::new(NODES * NODES, NODES, channels, data).unwrap();
            let (nodes, at) = (Nodes::new(&maps), pixel.map(|v| step(usize::from(v))));
            let (mut sums, mut out) = (vec![[0; 8]; nodes.each], vec![0; channels]);
            nodes.between(at, &mut sums, &mut out);
            prop_assert_eq!(out.iter().map(|&w| u32::from(w)).sum::<u32>(), u32::from(ONE));
            // The barycentric form: a corner for each axis that is at least as far along as the fraction says.
            let mut exact = vec![0.0; channels];
            let mut levels = vec![0, 256];
            levels.extend(at.map(|(_, part)| part));
            levels.sort_unstable();
            for pair in levels.windows(2) {
                let node = at.iter().fold(0, |node, &(n, part)| node * NODES + n + usize::from(part > pair[0]));
                let share = f64::from(pair[1] - pair[0]) / 256.0;
                exact.iter_mut().zip(maps.at(node)).for_each(|(sum, &w)| *sum += share * f64::from(w));
            }
            for (&out, &exact) in out.iter().zip(&exact) {
                let off = f64::from(out) - exact;
                prop_assert!(off > -4.0 && off <= 4.0 * channels as f64, "{} is not {}", out, exact);
            }
        }

        #[test]
        fn a_value_lies_between_its_nodes(value in 0usize..256) {
            let (node, part) = step(value);
            let at = (node as f64 + f64::from(part) / 256.0) / (NODES - 1) as f64;
            prop_assert!((at - value as f64 / 255.0).abs() < 1.0 / 4000.0);
        }
    }
}
