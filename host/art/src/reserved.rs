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

use protocol::ink::{Ink, Kind};
use rayon::prelude::*;

use super::artwork::{Layer, Shape};
use super::options::Options;
use super::{bitplane, resample};
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

/// An ink that the picture has elsewhere is on at least so many pixels, and its red, green and blue differ by at least so much.
const LEAST: u64 = 64;
const COLOURED: u8 = 48;

/// The largest difference that a file's depth and profile make to a pixel drawn in a reserved colour.
const EXACT: u8 = 2;

/// The reserved colours of a picture.
pub(super) struct Found {
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
pub(super) fn take(rgb: &mut [u8], size: (u32, u32), dots: (usize, usize), options: &Options) -> Found {
    let table = in_use(options);
    let (classes, edges) = classify(rgb.as_chunks::<3>().0, size.0 as usize, &table);
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
fn classify(pixels: &[[u8; 3]], width: usize, table: &[Reserved]) -> (Classes, Vec<(usize, u8)>) {
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
                && (0..3).any(|c| entry.colour[c].abs_diff(pixels[at][c]) > EXACT)
                && classes.is_alone(at)
        })
    };
    let edges_of = |classes: &Classes| {
        classes.changes(
            |class| class >= LOOSE,
            |class, at| {
                edge(pixels[at], classes.around(at), &colours)
                    .or_else(|| is_accidental(class, at, classes).then_some(OTHER))
            },
        )
    };
    let mut edges = edges_of(&classes);
    classes.apply(&edges);
    let thin = thin_lines(pixels, &classes, &colours);
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
fn thin_lines(pixels: &[[u8; 3]], classes: &Classes, colours: &[[u8; 3]]) -> Vec<(usize, u8)> {
    let mut counts = [0u64; 256];
    classes.of.iter().for_each(|&class| counts[usize::from(class & !LOOSE)] += 1);
    let has_colour = |[r, g, b]: [u8; 3]| r.max(g).max(b) - r.min(g).min(b) >= COLOURED;
    let is_known = |&class: &usize| counts[class] >= LEAST && has_colour(colours[class]);
    let inks: Vec<usize> = (1..colours.len()).filter(is_known).collect();
    classes.changes(
        |class| class == OTHER,
        |_, at| {
            let near = classes.around(at);
            let is_of = |&ink: &usize| edge(pixels[at], near | 1 << ink, colours) == Some(ink as u8);
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
fn edge(pixel: [u8; 3], seen: u32, colours: &[[u8; 3]]) -> Option<u8> {
    /// Largest squared distance from the line, in 8-bit steps: rounding and gamma-blended edges need this much.
    const OFF: i64 = 12 * 12;
    /// Sharpened edges may lie beyond an end of the line by its length divided by this; Lanczos and bicubic filters stay
    /// below a tenth.
    const BEYOND: i64 = 8;
    let vector =
        |a: [u8; 3], b: [u8; 3]| -> [i64; 3] { std::array::from_fn(|c| i64::from(b[c]) - i64::from(a[c])) };
    let dot = |a: [i64; 3], b: [i64; 3]| (0..3).map(|c| a[c] * b[c]).sum::<i64>();
    let mut best: Option<(i64, u8)> = None;
    for a in (0..colours.len()).filter(|a| seen & 1 << a != 0) {
        for b in (a + 1..colours.len()).filter(|b| seen & 1 << b != 0) {
            let (along, to) = (vector(colours[a], colours[b]), vector(colours[a], pixel));
            let (length, at) = (dot(along, along), dot(along, to));
            if at < -length / BEYOND || at > length + length / BEYOND {
                continue;
            }
            // The squared distance from the line, |to|^2 - at^2 / length.
            let off = dot(to, to) - at * at / length;
            let nearer = if 2 * at < length { a } else { b } as u8;
            if off <= OFF && best.is_none_or(|(least, _)| off < least) {
                best = Some((off, nearer));
            }
        }
    }
    best.map(|(_, class)| class)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A disc of one colour on another, softened over a pixel as drawing programs do.
    fn soft_disc(side: usize, colour: [u8; 3], ground: [u8; 3]) -> Vec<u8> {
        let middle = side as f64 / 2.0;
        (0..side * side)
            .flat_map(|at| {
                let (x, y) = ((at % side) as f64 + 0.5 - middle, (at / side) as f64 + 0.5 - middle);
                let inside = (side as f64 / 3.0 - x.hypot(y) + 0.5).clamp(0.0, 1.0);
                std::array::from_fn::<u8, 3, _>(|c| {
                    (inside * f64::from(colour[c]) + (1.0 - inside) * f64::from(ground[c])).round() as u8
                })
            })
            .collect()
    }

    fn plane(layer: &Layer) -> u64 {
        match &layer.shape {
            Shape::Solid(plane) => plane.dots(),
            Shape::Tone(_) => panic!("reserved colours have no tones"),
        }
    }

    #[test]
    fn colours_that_the_user_names_are_inks_and_several_of_one_ink_one_layer() {
        let side = 60;
        let mut pixels = soft_disc(side, [255, 0, 0], [255; 3]);
        // A bar of the other colour of the same ink, one of another ink, and one of the vendor's gold, which nobody asked for.
        for (y, colour) in [(2, [200, 0, 200]), (54, [0, 128, 0]), (58, [225, 160, 0])] {
            for at in y * side..(y + 2) * side {
                pixels[3 * at..3 * at + 3].copy_from_slice(&colour);
            }
        }
        let colours = vec![
            (Ink::MetallicGold, [255, 0, 0]),
            (Ink::White, [4, 124, 3]),
            (Ink::MetallicGold, [200, 0, 200]),
        ];
        let options = Options { colours, ..Options::default() };
        let size = (side as u32, side as u32);
        let found = take(&mut pixels, size, (side, side), &options);
        let inks: Vec<Ink> = found.layers.iter().map(|layer| layer.ink).collect();
        assert_eq!(inks, [Ink::MetallicGold, Ink::White]);
        let disc = std::f64::consts::PI * 20.0 * 20.0 + 120.0;
        let gold = plane(&found.layers[0]) as f64;
        assert!((gold - disc).abs() < 0.02 * disc, "{gold} dots of {disc}, soft edges included");
        assert_eq!(plane(&found.layers[1]), 120, "within the tolerance");
        let plain = pixels.as_chunks::<3>().0.iter().filter(|pixel| **pixel != [255; 3]).count();
        assert_eq!(plain, 120, "the vendor's gold is a plain colour here");
        let narrow = Options { tolerance: Some(0), ..options };
        let found = take(&mut [4, 125, 3].repeat(side * side), size, (side, side), &narrow);
        assert!(found.layers.is_empty());
    }

    #[test]
    fn softened_edges_leave_no_fringe_of_colour() {
        let side = 300;
        let area = std::f64::consts::PI * 100.0 * 100.0;
        for (at, entry) in TABLE.iter().enumerate() {
            for ground in [[255; 3], TABLE[(at + 1) % TABLE.len()].colour] {
                let mut rgb = soft_disc(side, entry.colour, ground);
                let found = take(
                    &mut rgb,
                    (300, 300),
                    (side, side),
                    &Options { reserved: true, ..Options::default() },
                );
                assert!(rgb.iter().all(|&v| v == 255), "{:?} on {ground:?} leaves colour", entry.ink);
                assert!(
                    found.layers.iter().all(|layer| layer.ink == entry.ink || ground != [255; 3]),
                    "an edge of {:?} on paper calls for another ink",
                    entry.ink
                );
                assert!(found.layers.len() <= 2, "{:?} on {ground:?} calls for a third ink", entry.ink);
                let layer = found.layers.iter().find(|layer| layer.ink == entry.ink).unwrap();
                let off = (plane(layer) as f64 - area).abs() / area;
                assert!(off < 0.005, "{:?}: {} dots, the disc has {area:.0}", entry.ink, plane(layer));
            }
        }
    }

    #[test]
    fn sharpened_edges_leave_no_fringe_of_colour_either() {
        // A black bar on the white, resampled with a filter that rings, as image programs do.
        let (white, bar) = ([230; 3], 180..300);
        let large = image::RgbImage::from_fn(480, 480, |x, y| {
            image::Rgb(if bar.contains(&x) && (90..390).contains(&y) { [0; 3] } else { white })
        });
        for filter in [image::imageops::FilterType::Lanczos3, image::imageops::FilterType::CatmullRom] {
            // 7 to 3: edges fall between pixels.
            let small = image::imageops::resize(&large, 206, 206, filter);
            assert!(small.pixels().any(|pixel| pixel.0[0] > 235), "the filter rings");
            let mut rgb = small.into_raw();
            let found =
                take(&mut rgb, (206, 206), (206, 206), &Options { reserved: true, ..Options::default() });
            assert!(rgb.iter().all(|&v| v == 255), "{filter:?} leaves colour");
            let inks: Vec<Ink> = found.layers.iter().map(|layer| layer.ink).collect();
            assert_eq!(inks, [Ink::White, Ink::Black], "{filter:?}");
            let wanted = (120.0 * 300.0) * (206.0f64 / 480.0).powi(2);
            assert!((plane(&found.layers[1]) as f64 - wanted).abs() < 0.02 * wanted);
        }
    }

    #[test]
    fn a_lone_pixel_of_metal_beside_colours_is_a_colour_and_a_line_of_it_is_metal() {
        // Within the tolerance, not exact.
        let silver = [197, 197, 197];
        let green = [40, 160, 60];
        let picture = |is_silver: &dyn Fn(usize, usize) -> bool| -> Vec<u8> {
            (0..400).flat_map(|at| if is_silver(at % 20, at / 20) { silver } else { green }).collect()
        };
        let two = |x, y| (x, y) == (9, 9) || (x, y) == (10, 10);
        let mut rgb = picture(&two);
        let found = take(&mut rgb, (20, 20), (20, 20), &Options { reserved: true, ..Options::default() });
        assert!(found.layers.is_empty() && rgb == picture(&two));
        let mut rgb = picture(&|x, y| y == 9 && x > 3);
        let found = take(&mut rgb, (20, 20), (20, 20), &Options { reserved: true, ..Options::default() });
        assert_eq!((found.layers[0].ink, plane(&found.layers[0])), (Ink::MetallicSilver, 16));
    }

    /// A line of which one pixel is covered wholly and those beside it in part, on black and on paper; no pixel of it lies in a square.
    #[test]
    fn a_thin_line_is_of_its_ink_with_its_softened_edges() {
        let gold = [225, 160, 0];
        for ground in [[0u8; 3], [255; 3]] {
            for shares in
                [[0.25, 1.0, 0.75], [0.0, 1.0, 0.5], [0.4, 1.0, 0.6], [0.0, 0.75, 0.6], [0.0, 0.8, 0.2]]
            {
                let pixel = |at: usize| -> [u8; 3] {
                    // And a square of it elsewhere.
                    if at % 40 < 9 && at / 40 < 9 {
                        return gold;
                    }
                    let share = (at % 40).checked_sub(19).and_then(|x| shares.get(x)).copied().unwrap_or(0.0);
                    std::array::from_fn(|c| {
                        (share * f64::from(gold[c]) + (1.0 - share) * f64::from(ground[c])).round() as u8
                    })
                };
                let mut rgb: Vec<u8> = (0..40 * 40).flat_map(pixel).collect();
                let found =
                    take(&mut rgb, (40, 40), (40, 40), &Options { reserved: true, ..Options::default() });
                let of_gold = found.layers.iter().find(|layer| layer.ink == Ink::MetallicGold).map(plane);
                let wide = shares.iter().filter(|&&share| share > 0.5).count() as u64;
                let half = shares.iter().filter(|&&share| share == 0.5).count() as u64;
                assert!(
                    of_gold.is_some_and(|dots| (81 + 40 * wide..=81 + 40 * (wide + half)).contains(&dots)),
                    "{of_gold:?} for {shares:?} on {ground:?}"
                );
                assert!(rgb.iter().all(|&v| v == 255), "{shares:?} on {ground:?}: process colours are left");
            }
        }
    }

    /// Lines a pixel wide beside squares of every ink: greys and pale colours stay what they are.
    #[test]
    fn thin_lines_in_grey_and_in_pale_colours_are_colour() {
        let squares = TABLE.map(|entry| entry.colour);
        for line in [[90; 3], [128; 3], [170; 3], [210; 3], [220, 221, 222], [250, 240, 214], [200, 226, 231]]
        {
            let pixel = |at: usize| match (at % 80, at / 80) {
                (60, _) => line,
                (x @ ..54, 2..13) if x % 9 < 8 => squares[x / 9],
                _ => [255; 3],
            };
            let mut rgb: Vec<u8> = (0..80 * 40).flat_map(pixel).collect();
            take(&mut rgb, (80, 40), (80, 40), &Options { reserved: true, ..Options::default() });
            let kept = (0..40).filter(|y| rgb[3 * (80 * y + 60)..][..3] == line).count();
            assert_eq!(kept, 40, "{line:?}");
        }
    }

    #[test]
    fn a_stray_grey_calls_for_silver_only_if_silver_is_at_hand() {
        let grey = [189, 193, 197].repeat(100);
        let with = |inks: &str| Options { reserved: true, inks: inks.parse().unwrap(), ..Options::default() };
        let mut rgb = grey.clone();
        let found = take(&mut rgb, (10, 10), (10, 10), &with("white,metallic-gold,process"));
        assert!(found.layers.is_empty() && rgb == grey);
        assert!(found.notes("art").iter().any(|note| note.contains("metallic-silver")));
        let found = take(&mut rgb, (10, 10), (10, 10), &with("metallic-silver"));
        assert_eq!(found.layers.iter().map(|layer| layer.ink).collect::<Vec<_>>(), [Ink::MetallicSilver]);
        assert!(rgb.iter().all(|&v| v == 255));
    }

    #[test]
    fn colours_within_the_tolerance_are_the_ink_and_others_are_not() {
        let (gold, off) = ([225, 160, 0], [225, 173, 0]);
        for (tolerance, wanted) in [(None, 1), (Some(13), 2), (Some(0), 1)] {
            let mut rgb = [gold, off].concat();
            let options = Options { reserved: true, tolerance, ..Options::default() };
            let found = take(&mut rgb, (2, 1), (2, 1), &options);
            assert_eq!(plane(&found.layers[0]), wanted, "tolerance {tolerance:?}");
        }
    }

    #[test]
    fn tolerances_of_the_table_do_not_overlap() {
        for (i, a) in TABLE.iter().enumerate() {
            for b in &TABLE[..i] {
                let apart = (0..3).any(|c| {
                    u16::from(a.colour[c].abs_diff(b.colour[c]))
                        > u16::from(a.tolerance) + u16::from(b.tolerance)
                });
                assert!(apart, "{:?} and {:?}", a.ink, b.ink);
            }
        }
    }
}
