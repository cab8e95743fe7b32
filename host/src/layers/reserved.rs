//! The vendor's reserved colours: a picture whose pixels name inks.
//!
//! Problem: owners draw white as 230,230,230 and gold as 225,160,0; drawing programs soften every edge, and a softened
//! edge is no reserved colour, so it would be printed as a fringe of process dots around the gold.
//! Method: pixels within the tolerance of an ink's colour, in each of red, green and blue, are that ink. Of the others,
//! those that lie on the straight line between two colours seen next to them (an ink and white, or two inks) are the
//! edge of those two and go to the nearer one. What is left is colour for the process inks.
//! Cost: 20 ns a pixel. Limits: edges softened over more than two pixels remain partly colour.
//! Source of the colours: the vendor's user's guide, in its English and its Japanese edition.

use inks::InkSet;
use protocol::ink::Ink;
use rayon::prelude::*;

use super::{Layer, Options, Shape, bits, raster};

/// A reserved colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reserved {
    /// The ink it stands for.
    pub ink: Ink,
    /// sRGB as drawn.
    pub colour: [u8; 3],
    /// How far each channel may be off. White and silver are 33 to 41 apart.
    pub tolerance: u8,
}

const fn reserved(ink: Ink, colour: [u8; 3], tolerance: u8) -> Reserved {
    Reserved { ink, colour, tolerance }
}

/// The vendor's table. Black is among it so that black lines stay solid.
pub const TABLE: [Reserved; 6] = [
    reserved(Ink::White, [230, 230, 230], 8),
    reserved(Ink::MetallicGold, [225, 160, 0], 12),
    reserved(Ink::MetallicSilver, [189, 193, 197], 12),
    reserved(Ink::MetallicMagenta, [163, 36, 115], 12),
    reserved(Ink::MetallicCyan, [0, 176, 201], 12),
    reserved(Ink::Black, [0, 0, 0], 8),
];

/// A pixel's place in the list of colours in use, white first; or one of these.
const OTHER: u8 = u8::MAX;
const PAPER: u8 = 0;

/// What was found.
pub(super) struct Found {
    pub layers: Vec<Layer>,
    /// Pixels of each layer, and how many of them by being edges.
    counts: Vec<(u64, u64)>,
    /// Edge pixels that became bare paper.
    bared: u64,
    /// Inks of the table that were not looked for.
    left_out: Vec<Ink>,
}

impl Found {
    /// What to tell.
    pub fn notes(&self, file: &str) -> Vec<String> {
        let mut notes = Vec::new();
        let edges: u64 = self.counts.iter().map(|(_, edges)| edges).sum();
        if edges + self.bared > 0 {
            notes.push(format!(
                "{file}: {} pixels lie between two colours, such as anti-aliased edges; {edges} became the ink next to \
                 them, {} bare paper",
                edges + self.bared, self.bared
            ));
        }
        for (layer, (pixels, _)) in self.layers.iter().zip(&self.counts) {
            if *pixels < 64 {
                notes.push(format!(
                    "{file}: only {pixels} pixels have the colour of {}; if that is chance, leave it out with --inks",
                    layer.ink.name()
                ));
            }
        }
        if !self.left_out.is_empty() {
            let names: Vec<_> = self.left_out.iter().map(|ink| ink.name()).collect();
            notes
                .push(format!("{file}: the reserved colours of {} are printed as colours", names.join(", ")));
        }
        if self.layers.is_empty() {
            notes.push(format!("{file}: there is no reserved colour in it"));
        }
        notes
    }
}

/// Takes the reserved colours out of a picture, leaving white, as layers at the dots.
pub(super) fn take(rgb: &mut [u8], size: (u32, u32), dots: (usize, usize), options: &Options) -> Found {
    let table = in_use(&options.inks, options.tolerance);
    let (width, height) = (size.0 as usize, size.1 as usize);
    let mut colours = vec![[255; 3]];
    colours.extend(table.iter().map(|entry| entry.colour));
    let mut class = vec![OTHER; width * height];
    class.par_iter_mut().zip(rgb.par_chunks_exact(3)).for_each(|(class, pixel)| {
        let off = |colour: [u8; 3]| (0..3).map(|c| colour[c].abs_diff(pixel[c])).max().unwrap_or(0);
        if *pixel == [255; 3] {
            *class = PAPER;
        } else if let Some((at, _)) = (1..)
            .zip(&table)
            .filter(|(_, entry)| off(entry.colour) <= entry.tolerance)
            .min_by_key(|(_, entry)| off(entry.colour))
        {
            *class = at;
        }
    });
    let edges: Vec<(usize, u8)> = (0..height)
        .into_par_iter()
        .flat_map_iter(|y| {
            let (class, rgb, colours) = (&class, &*rgb, &colours);
            (0..width).filter(move |x| class[y * width + x] == OTHER).filter_map(move |x| {
                let at = y * width + x;
                let pixel = [rgb[3 * at], rgb[3 * at + 1], rgb[3 * at + 2]];
                edge(pixel, around(class, width, height, x, y), colours).map(|class| (at, class))
            })
        })
        .collect();
    let mut counts = vec![(0u64, 0u64); colours.len()];
    for &(at, to) in &edges {
        class[at] = to;
        counts[usize::from(to)].1 += 1;
    }
    rgb.par_chunks_exact_mut(3).zip(&class).for_each(|(pixel, &class)| {
        if class != OTHER {
            pixel.fill(255);
        }
    });
    for &class in class.iter().filter(|&&class| class != OTHER) {
        counts[usize::from(class)].0 += 1;
    }
    let class = raster::nearest(class, size, dots);
    let layers = |(at, entry): (u8, &Reserved)| {
        let plane = bits::from_bytes(dots.0, &class, |class| class == at);
        let colour = entry.colour.map(|v| v.to_string()).join(",");
        (counts[usize::from(at)].0 > 0).then(|| Layer {
            ink: entry.ink,
            name: format!("the reserved colour {colour}"),
            place: None,
            shape: Shape::Solid(plane),
        })
    };
    let layers = (1..).zip(&table).filter_map(layers).collect();
    let left_out = TABLE.iter().map(|entry| entry.ink).filter(|&ink| !options.inks.contains(ink)).collect();
    let bared = counts[0].1;
    let counts = counts.into_iter().skip(1).filter(|(pixels, _)| *pixels > 0).collect();
    Found { layers, counts, bared, left_out }
}

fn in_use(inks: &InkSet, tolerance: Option<u8>) -> Vec<Reserved> {
    let with = |entry: &Reserved| Reserved { tolerance: tolerance.unwrap_or(entry.tolerance), ..*entry };
    TABLE.iter().filter(|entry| inks.contains(entry.ink)).map(with).collect()
}

/// The colours seen within two pixels, as bits.
fn around(class: &[u8], width: usize, height: usize, x: usize, y: usize) -> u32 {
    let mut seen = 0;
    for v in y.saturating_sub(2)..(y + 3).min(height) {
        for &class in &class[v * width..][x.saturating_sub(2)..(x + 3).min(width)] {
            if class != OTHER {
                seen |= 1 << class;
            }
        }
    }
    seen
}

/// The nearer of the two colours whose mixture the pixel is, if it is one of two that are seen around it.
fn edge(pixel: [u8; 3], seen: u32, colours: &[[u8; 3]]) -> Option<u8> {
    /// Squared distance from the line, in 8-bit steps, that rounding and gamma-blended edges need.
    const OFF: i64 = 12 * 12;
    let vector =
        |a: [u8; 3], b: [u8; 3]| -> [i64; 3] { std::array::from_fn(|c| i64::from(b[c]) - i64::from(a[c])) };
    let dot = |a: [i64; 3], b: [i64; 3]| (0..3).map(|c| a[c] * b[c]).sum::<i64>();
    let mut best: Option<(i64, u8)> = None;
    for a in (0..colours.len()).filter(|a| seen & 1 << a != 0) {
        for b in (a + 1..colours.len()).filter(|b| seen & 1 << b != 0) {
            let (along, to) = (vector(colours[a], colours[b]), vector(colours[a], pixel));
            let (length, at) = (dot(along, along), dot(along, to));
            if at < 0 || at > length {
                continue;
            }
            // |to|^2 - at^2 / length, the squared distance from the line.
            let off = dot(to, to) - at * at / length;
            let nearer = if 2 * at < length { a } else { b } as u8;
            if off <= OFF && best.is_none_or(|(least, _)| off < least) {
                best = Some((off, nearer));
            }
        }
    }
    best.map(|(_, class)| class)
}
