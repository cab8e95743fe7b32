//! Reserved colours, the vendor's and those that the user names: a picture whose pixels name inks.
//!
//! Problem: owners draw white as 230,230,230 and gold as 225,160,0. Drawing programs soften every edge, and the colour of
//! a soft edge is not reserved, so it would print as a fringe of process dots around the gold. Worse, the soft edge of black
//! on white passes through the grey that stands for silver.
//! Method: a pixel within the tolerance of an ink's colour, in each of red, green and blue, is that ink. Any other pixel,
//! and any pixel outside a square of four pixels of the same ink, may be an edge. It is the edge of two colours (an ink and
//! white, or two inks) if both occur near it and its own colour lies on the straight line between them, or slightly beyond
//! the ends, as sharpening leaves it; it then takes the nearer one. A lone pixel near the colour of a metal is
//! accidental, and what is exactly in an ink's colour beside its like is a thin line of it. So is a line of which no
//! pixel has the colour, if the ink is no grey and the picture has it elsewhere. All other pixels are colour for the process inks.
//! Cost: 2 ns a pixel, and 10 ns more for possible edges. Limits: edges softer than two pixels remain partly colour, and thin lines
//! in a colour between black and gold are gold.
//! Source of the colours: the vendor's user's guide, English and Japanese editions.

mod classes;
#[cfg(test)]
mod tests;

use protocol::ink::{Ink, Kind};
use rayon::prelude::*;

use crate::artwork::{Layer, Shape};
use crate::dots::bitplane;
use crate::dots::resample;
use crate::options::Options;
use classes::{BLOCK, Classes, LOOSE, OTHER, PAPER};

/// A reserved colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Reserved {
    /// The ink it stands for.
    ink: Ink,
    /// sRGB as drawn.
    colour: [u8; 3],
    /// The largest difference in each channel. White and silver differ by 33 to 41.
    tolerance: u8,
}

const fn reserved(ink: Ink, colour: [u8; 3], tolerance: u8) -> Reserved {
    Reserved { ink, colour, tolerance }
}

/// The vendor's table. It includes black so that black lines stay solid.
const TABLE: [Reserved; 6] = [
    reserved(Ink::White, [230, 230, 230], 8),
    reserved(Ink::MetallicGold, [225, 160, 0], 12),
    reserved(Ink::MetallicSilver, [189, 193, 197], 12),
    reserved(Ink::MetallicMagenta, [163, 36, 115], 12),
    reserved(Ink::MetallicCyan, [0, 176, 201], 12),
    reserved(Ink::Black, [0, 0, 0], 8),
];

/// The tolerance of a colour that the user names: that of the vendor's metals.
const NAMED: u8 = 12;

/// What decides about pixels that are not plainly of an ink. A test moves each of these by a fifth.
#[derive(Clone, Copy, Debug)]
struct Rules {
    /// An ink that the picture has elsewhere is on at least so many pixels, and its red, green and blue differ by at least so much.
    least: u64,
    coloured: u8,
    /// The largest difference that a file's depth and profile make to a pixel drawn in a reserved colour.
    exact: u8,
    /// The largest distance of an edge from the line between its colours, in 8-bit steps: rounding and gamma-blended edges need this much.
    off: f64,
    /// Sharpened edges may lie beyond an end of the line by this part of its length; Lanczos and bicubic filters stay below a tenth.
    beyond: f64,
}

impl Rules {
    const USUAL: Rules = Rules { least: 64, coloured: 48, exact: 2, off: 12.0, beyond: 0.125 };
}

/// The reserved colours of a picture.
pub(crate) struct Found {
    pub layers: Vec<Layer>,
    /// Pixels of each layer, and the number of edges among them.
    counts: Vec<(u64, u64)>,
    /// Edge pixels that became bare paper.
    bared: u64,
    /// Inks of the table that are not allowed.
    left_out: Vec<Ink>,
}

impl Found {
    /// Notes for the user.
    pub fn notes(&self, file: &str) -> Vec<String> {
        let mut notes = Vec::new();
        let edges: u64 = self.counts.iter().map(|(_, edges)| edges).sum();
        if edges + self.bared > 0 {
            notes.push(format!(
                "{file}: {} pixels lie between two colours, such as anti-aliased edges; {edges} became the ink next to \
                 them, and {} became bare paper",
                edges + self.bared, self.bared
            ));
        }
        for (layer, (pixels, _)) in self.layers.iter().zip(&self.counts) {
            if *pixels < 64 {
                notes.push(format!(
                    "{file}: only {pixels} pixels have the colour of {}; if this is accidental, do not allow that ink",
                    layer.ink.name()
                ));
            }
        }
        if !self.left_out.is_empty() {
            let names: Vec<_> = self.left_out.iter().map(|ink| ink.name()).collect();
            notes
                .push(format!("{file}: the reserved colours of {} print as plain colours", names.join(", ")));
        }
        if self.layers.is_empty() {
            notes.push(format!("{file}: the picture has no reserved colour"));
        }
        notes
    }
}

/// Takes the reserved colours out of a picture: their pixels become white, and layers at the dots.
pub(crate) fn take(rgb: &mut [u8], size: (u32, u32), dots: (usize, usize), options: &Options) -> Found {
    take_by(Rules::USUAL, rgb, size, dots, options)
}

/// The same by these rules.
fn take_by(rules: Rules, rgb: &mut [u8], size: (u32, u32), dots: (usize, usize), options: &Options) -> Found {
    let table = in_use(options);
    let (classes, edges) = classify(rules, rgb.as_chunks::<3>().0, size.0 as usize, &table);
    let mut counts = vec![(0u64, 0u64); 1 + table.len()];
    for &(_, to) in edges.iter().filter(|(_, to)| *to != OTHER) {
        counts[usize::from(to)].1 += 1;
    }
    let mut class = classes.of;
    let pixels_of = blank(rgb.as_chunks_mut::<3>().0, &mut class);
    counts.iter_mut().zip(pixels_of).for_each(|(count, pixels)| count.0 = pixels);
    let class = resample::classes(class, size, dots);
    let bared = counts[0].1;
    let (mut layers, mut of_inks) = (Vec::new(), Vec::new());
    for (first, ink) in table.iter().map(|entry| entry.ink).enumerate() {
        if table[..first].iter().any(|entry| entry.ink == ink) {
            continue;
        }
        // Several colours of one ink are one layer.
        let of_ink: Vec<(u8, &Reserved)> = (1..)
            .zip(&table)
            .filter(|&(at, entry)| entry.ink == ink && counts[usize::from(at)].0 > 0)
            .collect();
        if of_ink.is_empty() {
            continue;
        }
        let plane = bitplane::from_bytes(dots.0, &class, |class| of_ink.iter().any(|&(at, _)| at == class));
        let colours: Vec<String> =
            of_ink.iter().map(|(_, entry)| entry.colour.map(|v| v.to_string()).join(",")).collect();
        let name = format!("the reserved colour {}", colours.join(" and "));
        layers.push(Layer { ink, name, place: None, shape: Shape::Solid(plane) });
        let all = of_ink.iter().map(|&(at, _)| counts[usize::from(at)]);
        of_inks.push(all.fold((0, 0), |sum, count| (sum.0 + count.0, sum.1 + count.1)));
    }
    let vendors = TABLE.iter().map(|entry| entry.ink).filter(|_| options.reserved);
    let left_out = vendors.filter(|&ink| !options.inks.contains(ink)).collect();
    Found { layers, counts: of_inks, bared, left_out }
}

/// The class of every pixel, and the pixels whose class was that of an edge or accidental, with their new class.
fn classify(
    rules: Rules,
    pixels: &[[u8; 3]],
    width: usize,
    table: &[Reserved],
) -> (Classes, Vec<(usize, u8)>) {
    let mut classes = Classes { of: by_colour(pixels, table), width };
    // No softened edge has exactly the colour of an ink pixel after pixel, unless that is grey: a thin line has.
    let is_exact = |class: u8, at: usize| {
        let entry = usize::from(class).checked_sub(1).and_then(|at| table.get(at));
        let is_grey = |[r, g, b]: [u8; 3]| r == g && g == b && r > 0;
        entry.is_some_and(|entry| entry.colour == pixels[at] && !is_grey(entry.colour))
    };
    let loose = classes.changes(
        |class| class != PAPER && class != OTHER,
        |class, at| {
            let is_line = || is_exact(class, at) && !classes.is_alone(at);
            (!classes.in_a_square(at) && !is_line()).then_some(class | LOOSE)
        },
    );
    classes.apply(&loose);
    let mut colours = vec![[255; 3]];
    colours.extend(table.iter().map(|entry| entry.colour));
    let is_accidental = |class: u8, at: usize, classes: &Classes| {
        let place = usize::from(class & !LOOSE);
        place.checked_sub(1).and_then(|at| table.get(at)).is_some_and(|entry| {
            entry.ink.kind() == Kind::Metallic
                && (0..3).any(|c| entry.colour[c].abs_diff(pixels[at][c]) > rules.exact)
                && classes.is_alone(at)
        })
    };
    let edges_of = |classes: &Classes| {
        classes.changes(
            |class| class >= LOOSE,
            |class, at| {
                edge(rules, pixels[at], classes.around(at), &colours)
                    .or_else(|| is_accidental(class, at, classes).then_some(OTHER))
            },
        )
    };
    let mut edges = edges_of(&classes);
    classes.apply(&edges);
    let thin = thin_lines(rules, pixels, &classes, &colours);
    classes.apply(&thin);
    if !thin.is_empty() {
        // Now their ink is near their own softened edges.
        let beside = edges_of(&classes);
        classes.apply(&beside);
        edges = [edges, thin, beside].concat();
    }
    (classes, edges)
}

/// Lines so thin that no pixel has their colour: what is nowhere three pixels wide and is more than half an ink that the picture has elsewhere, on a
/// colour near it. Greys and silver are no such inks: thin lines in grey are grey.
fn thin_lines(rules: Rules, pixels: &[[u8; 3]], classes: &Classes, colours: &[[u8; 3]]) -> Vec<(usize, u8)> {
    let mut counts = [0u64; 256];
    classes.of.iter().for_each(|&class| counts[usize::from(class & !LOOSE)] += 1);
    let has_colour = |[r, g, b]: [u8; 3]| r.max(g).max(b) - r.min(g).min(b) >= rules.coloured;
    let is_known = |&class: &usize| counts[class] >= rules.least && has_colour(colours[class]);
    let inks: Vec<usize> = (1..colours.len()).filter(is_known).collect();
    classes.changes(
        |class| class == OTHER,
        |_, at| {
            let near = classes.around(at);
            let is_of = |&ink: &usize| edge(rules, pixels[at], near | 1 << ink, colours) == Some(ink as u8);
            let may_be = near != 0 && !classes.in_three(at);
            let ink = may_be.then(|| inks.iter().copied().filter(|ink| near & 1 << ink == 0).find(is_of));
            ink.flatten().map(|ink| ink as u8)
        },
    )
}

/// The class of every pixel by its own colour: paper, an entry of the table from 1, or [`OTHER`].
fn by_colour(pixels: &[[u8; 3]], table: &[Reserved]) -> Vec<u8> {
    let mut of = vec![OTHER; pixels.len()];
    of.par_chunks_mut(BLOCK).zip(pixels.par_chunks(BLOCK)).for_each(|(of, pixels)| {
        if pixels.as_flattened().iter().fold(255, |all, byte| all & byte) == 255 {
            of.fill(PAPER);
            return;
        }
        for (class, pixel) in of.iter_mut().zip(pixels) {
            let off = |colour: [u8; 3]| (0..3).map(|c| colour[c].abs_diff(pixel[c])).max().unwrap_or(0);
            if *pixel == [255; 3] {
                *class = PAPER;
            } else if let Some((at, _)) = (1..)
                .zip(table)
                .filter(|(_, entry)| off(entry.colour) <= entry.tolerance)
                .min_by_key(|(_, entry)| off(entry.colour))
            {
                *class = at;
            }
        }
    });
    of
}

/// Makes every pixel with a class white, takes the [`LOOSE`] mark off its class, and counts the pixels of each class.
fn blank(pixels: &mut [[u8; 3]], class: &mut [u8]) -> [u64; 256] {
    let blocks = class.par_chunks_mut(1 << 12).zip(pixels.par_chunks_mut(1 << 12));
    blocks
        .fold(
            || [0u64; 256],
            |mut counts, (class, pixels)| {
                for (class, pixel) in class.iter_mut().zip(pixels).filter(|(class, _)| **class != OTHER) {
                    *class &= !LOOSE;
                    *pixel = [255; 3];
                    counts[usize::from(*class)] += 1;
                }
                counts
            },
        )
        .reduce(|| [0; 256], |a, b| std::array::from_fn(|class| a[class] + b[class]))
}

/// The colours that the user names, and those of the vendor's whose inks are allowed, with this tolerance if one is set.
fn in_use(options: &Options) -> Vec<Reserved> {
    let named = options.colours.iter().map(|&(ink, colour)| reserved(ink, colour, NAMED));
    let vendors = TABLE.into_iter().filter(|entry| options.reserved && options.inks.contains(entry.ink));
    let with =
        |entry: Reserved| Reserved { tolerance: options.tolerance.unwrap_or(entry.tolerance), ..entry };
    named.chain(vendors).map(with).collect()
}

/// The class of an edge pixel: the nearer of two colours around it whose mixture it is; `None` if it is no such mixture.
/// `seen` has a bit for each colour around the pixel.
fn edge(rules: Rules, pixel: [u8; 3], seen: u32, colours: &[[u8; 3]]) -> Option<u8> {
    let vector =
        |a: [u8; 3], b: [u8; 3]| -> [f64; 3] { std::array::from_fn(|c| f64::from(b[c]) - f64::from(a[c])) };
    let dot = |a: [f64; 3], b: [f64; 3]| (0..3).map(|c| a[c] * b[c]).sum::<f64>();
    let mut best: Option<(f64, u8)> = None;
    for a in (0..colours.len()).filter(|a| seen & 1 << a != 0) {
        for b in (a + 1..colours.len()).filter(|b| seen & 1 << b != 0) {
            let (along, to) = (vector(colours[a], colours[b]), vector(colours[a], pixel));
            let (length, at) = (dot(along, along), dot(along, to));
            if at < -length * rules.beyond || at > length * (1.0 + rules.beyond) {
                continue;
            }
            // The squared distance from the line.
            let off = dot(to, to) - at * at / length;
            let nearer = if 2.0 * at < length { a } else { b } as u8;
            if off <= rules.off * rules.off && best.is_none_or(|(least, _)| off < least) {
                best = Some((off, nearer));
            }
        }
    }
    best.map(|(_, class)| class)
}
