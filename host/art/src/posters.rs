//! Flat art made of pixels: drawings that arrive as pictures, in few colours that touch.
//!
//! Problem: text on a coloured ground, saved as pixels, is no photograph; screened as one it loses its edges.
//! Method: what hangs together is looked at as a whole. A pixel that is in none of its [main colours](super::main_colours) is a
//! [softened](super::softened) edge between two of them, white and black among them: it becomes the nearer one. The whole is flat
//! art if hardly any pixel is neither, but for [pictures amid it](super::islands). What is small, a letter or what is softened between black and white, may have the colours that
//! small shapes have in common. A colour that is nowhere three pixels wide and lies between two others may be an edge itself.
//! Cost: 3 ns a pixel of such art, more for its softened edges; photographs are given up after some thousand colours. Colours
//! that are nearly alike cost another pass.
//! Limits: [`MOST`] colours; what fades into a photograph, or has the noise of JPEG, stays a picture, and so does all that is joined to
//! text on a ground that is hardly apart from it.

use std::cell::LazyCell;
use std::ops::Range;

use super::flat::split;
use super::islands::{Sea, without};
use super::main_colours::{MOST, WHITE_AND_BLACK, apart, main_colours};
use super::pens;
use super::softened::{Edges, Widths, meant, thin_colours};

/// The most colours that a shape may have: white and black, its own, those of its edges, those in common, and those of pens.
pub(super) const MOST_KNOWN: usize = 3 * MOST + 2 + pens::MOST;
/// What has so many pixels or less is small: a letter, or what is softened between black and white.
pub(super) const SMALL: usize = 64 * 64;
/// At most this part of the pixels is neither a main colour nor between two; of thin lines, where they cross in three colours.
const STRAY: f64 = 0.01;
const STRAY_THIN: f64 = 0.1;
/// At most this part of the pixels is of pictures, and at most that part seems to be of neither a picture nor flat art while they are looked at.
const ISLANDS: f64 = 0.5;
const ALONE: f64 = 2.0 * STRAY;
/// The strokes of a small shape are black, and not grey, if at least one in so many pixels is nearly so.
const DARK: u64 = 20;
/// The most times that pictures are enlarged where edges are looked for.
pub(super) const MOST_ENLARGED: usize = 4;

/// A stretch of pixels, and the colour that it becomes.
pub(super) type Span = (Range<usize>, [u8; 3]);

/// What is known of a page before its shapes are looked at.
#[derive(Clone, Copy)]
pub(super) struct Known<'a> {
    /// Colours that small shapes may have.
    pub common: &'a [[u8; 3]],
    /// Whether all shapes are of thin lines and may have them.
    pub thin: bool,
    /// How many times pixels may have been enlarged.
    pub enlarged: usize,
}

/// What hangs together and is flat art.
pub(super) struct Poster {
    /// Its pixels, but for those of islands.
    pub spans: Vec<Span>,
    /// How many of these are neither a main colour nor between two.
    pub strays: u64,
    /// The pictures amid it, in order.
    pub islands: Vec<Range<usize>>,
}

/// What hangs together, if it is flat art. `stretches` are the pixels of it, in order. What is in one colour has no others.
pub(super) fn poster<const N: usize>(
    pixels: &[[u8; N]],
    width: usize,
    stretches: &[Range<usize>],
    Known { common, thin: all_thin, enlarged }: Known,
) -> Option<Poster> {
    let total: u64 = stretches.iter().map(|stretch| stretch.len() as u64).sum();
    let first = &pixels[stretches.first()?.start];
    let one = stretches.iter().all(|stretch| pixels[stretch.clone()].iter().all(|pixel| pixel == first));
    let widths = LazyCell::new(|| Widths::of(pixels, width, stretches, enlarged));
    let mut colours = main_colours(pixels, width, stretches, (total, enlarged), &widths).filter(|_| !one);
    let mut of_shape = usize::MAX;
    let is_small = total as usize <= SMALL * enlarged * enlarged;
    if all_thin || is_small {
        let is_bare = colours.is_none();
        let colours = colours.get_or_insert(WHITE_AND_BLACK.to_vec());
        if all_thin {
            // What pens drew is known; a line that covers half of its pixels is no colour.
            let mut thin = thin_colours(colours, &widths).into_iter();
            colours.retain(|_| thin.next() == Some(false));
        }
        // Strokes may be so thin that none of their pixels is black.
        of_shape = match is_bare && is_dark(pixels, stretches, total) {
            true => 1,
            // No pixel of a thin line may have its colour, though others of the shape do.
            false if all_thin => WHITE_AND_BLACK.len(),
            false => colours.len(),
        };
        let more: Vec<[u8; 3]> = common.iter().copied().filter(|colour| !colours.contains(colour)).collect();
        colours.extend(more);
    }
    let colours = colours?;
    let of_shape = of_shape.min(colours.len());
    let thin = thin_colours(&colours, &widths);
    let meant = meant(&colours, &thin);
    let edges = Edges { pixels, width, colours: &colours, of_shape, thin: &thin, meant: &meant, enlarged };
    let (mut spans, mut strays): (Vec<Span>, Vec<usize>) = (Vec::new(), Vec::new());
    let has_islands = !all_thin && !is_small;
    // Strays of pictures lie in rows, and those of edges that no two colours explain are one or two.
    let mut in_rows = 0;
    let share = if all_thin { STRAY_THIN } else { STRAY };
    let most = if has_islands { ISLANDS } else { share } * total as f64;
    for stretch in stretches {
        let mut at = stretch.start;
        for run in pixels[stretch.clone()].chunk_by(|a, b| a == b) {
            let own = split(&run[0]).1;
            let all = at..at + run.len();
            at = all.end;
            let known = colours.iter().position(|&colour| colour == own);
            if known.is_some_and(|known| !thin[known]) {
                push(&mut spans, all, own);
                continue;
            }
            for at in all {
                let colour = edges.colour(at, known, strays.len() as f64 <= share * total as f64);
                if colour.is_none() {
                    let third = strays.len().checked_sub(2 * enlarged).map(|third| strays[third]);
                    in_rows += usize::from(third == at.checked_sub(2 * enlarged));
                    strays.push(at);
                }
                let nearest =
                    || colours.iter().copied().min_by_key(|&known| apart(known, own)).unwrap_or(own);
                push(
                    &mut spans,
                    at..at + 1,
                    colour.unwrap_or_else(|| if all_thin { nearest() } else { own }),
                );
            }
            let alone = strays.len().saturating_sub(3 * in_rows);
            if strays.len() as f64 > most || has_islands && alone as f64 > ALONE * total as f64 {
                return None;
            }
        }
    }
    let mut islands = Vec::new();
    if has_islands {
        let is_wide = |colour| colours.iter().zip(&thin).any(|(&known, &thin)| known == colour && !thin);
        islands = Sea { pixels, width, stretches, strays: &strays, enlarged }.islands(is_wide);
        strays.retain(|at| {
            let island = islands.get(islands.partition_point(|island| island.end <= *at));
            island.is_none_or(|island| *at < island.start)
        });
        let land: usize = islands.iter().map(Range::len).sum();
        if land as f64 > ISLANDS * total as f64 || strays.len() as f64 > share * (total - land as u64) as f64
        {
            return None;
        }
        // Letters may be so thin that none of their pixels has their colour.
        let edges = Edges { of_shape: WHITE_AND_BLACK.len(), ..edges };
        spans = without(&spans, &islands)
            .flat_map(|(span, colour)| {
                let first = strays.partition_point(|&at| at < span.start);
                let is_stray = strays.get(first) == Some(&span.start);
                let colour_of = |at| edges.colour(at, None, true).unwrap_or(colour);
                match is_stray {
                    true => span.map(|at| (at..at + 1, colour_of(at))).collect(),
                    false => vec![(span, colour)],
                }
            })
            .collect();
    }
    edges.decide_strokes(&mut spans);
    Some(Poster { spans, strays: strays.len() as u64, islands })
}

/// Whether one in [`DARK`] pixels is more black than white.
fn is_dark<const N: usize>(pixels: &[[u8; N]], stretches: &[Range<usize>], total: u64) -> bool {
    let dark = |pixel: &&[u8; N]| split(pixel).1.iter().all(|&v| v < 110);
    let found = stretches.iter().map(|stretch| pixels[stretch.clone()].iter().filter(dark).count() as u64);
    found.sum::<u64>() * DARK >= total
}

/// Adds a span, or lengthens the last.
pub(super) fn push(spans: &mut Vec<Span>, pixels: Range<usize>, colour: [u8; 3]) {
    match spans.last_mut() {
        Some((last, known)) if *known == colour && last.end == pixels.start => last.end = pixels.end,
        _ => spans.push((pixels, colour)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const SIDE: usize = 96;

    /// The spans of a square picture that is one shape.
    fn all(pixels: &[[u8; 3]]) -> Option<Vec<[u8; 3]>> {
        let rows: Vec<Range<usize>> = (0..SIDE).map(|y| y * SIDE..(y + 1) * SIDE).collect();
        let mut out = vec![[0; 3]; pixels.len()];
        for (span, colour) in
            poster(pixels, SIDE, &rows, Known { common: &[], thin: false, enlarged: 1 })?.spans
        {
            out[span].fill(colour);
        }
        Some(out)
    }

    /// How much of a pixel a ring covers, in 8 x 8 places of it.
    fn ring(at: usize) -> f64 {
        let inside = |i: usize| {
            let place = |at: usize, i: usize| at as f64 + (i as f64 + 0.5) / 8.0 - SIDE as f64 / 2.0;
            let far = place(at % SIDE, i % 8).hypot(place(at / SIDE, i / 8));
            (18.0..26.0).contains(&far) || far < 6.0
        };
        (0..64).filter(|&i| inside(i)).count() as f64 / 64.0
    }

    /// Waves of light in few greys are a picture; panels and rings in as many are flat art.
    #[test]
    fn a_shading_in_few_colours_is_no_flat_art() {
        let grey = |level: f64| [(level / 15.0).round() as u8 * 15; 3];
        let wave =
            |x: usize, y: usize| 120.0 + 70.0 * (x as f64 / 19.0).sin() + 60.0 * (y as f64 / 23.0).cos();
        let panel = |x: usize, y: usize| f64::from(((x / 12 * 5 + y / 12 * 3) % 11) as u8) * 22.0;
        let picture = |level: &dyn Fn(usize, usize) -> f64| -> Vec<[u8; 3]> {
            (0..SIDE * SIDE).map(|at| grey(level(at % SIDE, at / SIDE))).collect()
        };
        assert!(all(&picture(&wave)).is_none());
        let panels = picture(&panel);
        assert_eq!(all(&panels).as_ref(), Some(&panels));
    }

    /// A softened drawing in two colours is cut where half a pixel is covered.
    fn is_cut(a: [u8; 3], b: [u8; 3]) {
        let pixels: Vec<[u8; 3]> = (0..SIDE * SIDE)
            .map(|at| {
                let share = ring(at);
                std::array::from_fn(|c| {
                    (f64::from(a[c]) * share + f64::from(b[c]) * (1.0 - share)).round() as u8
                })
            })
            .collect();
        let found = all(&pixels).expect("flat art");
        for (at, colour) in found.into_iter().enumerate() {
            let share = ring(at);
            if (share - 0.5).abs() > 0.02 {
                assert_eq!(colour, if share > 0.5 { a } else { b }, "{a:?} on {b:?}, covered by {share}");
            }
        }
    }

    proptest! {
        #[test]
        fn a_softened_drawing_in_two_colours_is_cut(a: [u8; 3], b: [u8; 3]) {
            prop_assume!((0..3).any(|c| a[c].abs_diff(b[c]) > 60));
            is_cut(a, b);
        }
    }

    #[test]
    fn nearly_black_and_nearly_white_are_colours_like_others() {
        let (black, white) = ([[0; 3], [5; 3], [0, 0, 1], [12, 9, 0]], [[255; 3], [250; 3], [255, 252, 244]]);
        for dark in black {
            for light in white.into_iter().chain([[200, 30, 30], [0, 0, 62], [255, 255, 0]]) {
                is_cut(dark, light);
                is_cut(light, dark);
            }
        }
    }

    /// Discs on panels on a ground, in colours of which several are hardly apart but do not touch.
    #[test]
    fn flat_colours_that_are_nearly_alike_are_told_apart() {
        let ground = [252; 3];
        let parts = [
            ([20; 3], [255; 3]),
            ([0, 60, 140], [250; 3]),
            ([255, 220, 0], [3; 3]),
            (ground, [8; 3]),
            ([235, 235, 230], [40; 3]),
            ([200, 30, 30], [30, 30, 36]),
        ];
        let at_part = |at: usize| {
            let (x, y) = (at % SIDE, at / SIDE);
            let (panel, disc) = parts[x / 32 + y / 48 * 3];
            let place = |v: usize, cell: usize, i: usize| {
                (v % cell) as f64 + (i as f64 + 0.5) / 8.0 - cell as f64 / 2.0
            };
            let inside = |i: usize| place(x, 32, i % 8).hypot(place(y, 48, i / 8)) < 9.3;
            let share = (0..64).filter(|&i| inside(i)).count() as f64 / 64.0;
            let on_panel = (3..29).contains(&(x % 32)) && (3..45).contains(&(y % 48));
            (if on_panel { panel } else { ground }, disc, share)
        };
        let pixels: Vec<[u8; 3]> = (0..SIDE * SIDE)
            .map(|at| {
                let (panel, disc, share) = at_part(at);
                std::array::from_fn(|c| {
                    (f64::from(disc[c]) * share + f64::from(panel[c]) * (1.0 - share)).round() as u8
                })
            })
            .collect();
        for (at, colour) in all(&pixels).expect("flat art").into_iter().enumerate() {
            let (panel, disc, share) = at_part(at);
            if (share - 0.5).abs() > 0.05 {
                assert_eq!(colour, if share > 0.5 { disc } else { panel }, "at {} {}", at % SIDE, at / SIDE);
            }
        }
    }

    /// A disc in a pale grey with a golden rim, on white: the rim is softened to each of them where it meets it.
    #[test]
    fn the_edge_of_a_rim_is_of_what_lies_beside_it() {
        let (gold, grey, white) = ([245, 197, 24], [244; 3], [255; 3]);
        let far = |at: usize| {
            let place = |v: usize| v as f64 + 0.5 - SIDE as f64 / 2.0;
            place(at % SIDE).hypot(place(at / SIDE))
        };
        let mixed = |a: [u8; 3], b: [u8; 3], share: f64| -> [u8; 3] {
            std::array::from_fn(|c| (f64::from(a[c]) * share + f64::from(b[c]) * (1.0 - share)).round() as u8)
        };
        let pixel = |at: usize| match far(at) {
            far @ ..35.0 => mixed(gold, grey, (far - 30.0 + 0.5).clamp(0.0, 1.0)),
            far => mixed(gold, white, (40.0 - far + 0.5).clamp(0.0, 1.0)),
        };
        let pixels: Vec<[u8; 3]> = (0..SIDE * SIDE).map(pixel).collect();
        let mut stretches: Vec<Range<usize>> = Vec::new();
        for at in (0..pixels.len()).filter(|&at| pixels[at] != white) {
            match stretches.last_mut() {
                Some(last) if last.end == at && at % SIDE > 0 => last.end = at + 1,
                _ => stretches.push(at..at + 1),
            }
        }
        let found = poster(&pixels, SIDE, &stretches, Known { common: &[], thin: false, enlarged: 1 });
        for (span, colour) in found.expect("flat art").spans {
            for at in span {
                let wanted = if far(at) < 35.0 { [gold, grey] } else { [gold, white] };
                assert!(wanted.contains(&colour), "{colour:?} at {}, {}", at % SIDE, at / SIDE);
            }
        }
    }

    /// Strokes that cover at most seven tenths of any pixel, in a colour that other shapes have.
    #[test]
    fn thin_strokes_in_a_common_colour_are_cut() {
        let (blue, white) = ([0, 0, 200], [255; 3]);
        let share = |x: usize| [0.0, 0.1, 0.6, 0.7, 0.3, 0.0, 0.45, 0.0][x % 8];
        let pixels: Vec<[u8; 3]> = (0..SIDE * SIDE)
            .map(|at| {
                let share = share(at % SIDE);
                std::array::from_fn(|c| {
                    (f64::from(blue[c]) * share + f64::from(white[c]) * (1.0 - share)).round() as u8
                })
            })
            .collect();
        let strokes: Vec<Range<usize>> = (0..16).map(|y| y * SIDE + 1..y * SIDE + 5).collect();
        let alone = poster(&pixels, SIDE, &strokes, Known { common: &[], thin: false, enlarged: 1 });
        assert!(alone.is_none(), "nobody knows the colour");
        let mut found = vec![white; pixels.len()];
        for (span, colour) in
            poster(&pixels, SIDE, &strokes, Known { common: &[[200, 0, 0], blue], thin: false, enlarged: 1 })
                .expect("flat art")
                .spans
        {
            found[span].fill(colour);
        }
        for at in strokes.into_iter().flatten() {
            assert_eq!(found[at], if share(at % SIDE) > 0.5 { blue } else { white }, "at {}", at % SIDE);
        }
    }

    /// A panel that is hardly apart from its ground, with a rim as a filter that sharpens leaves it: no shading.
    #[test]
    fn a_sharpened_rim_makes_no_shading_of_a_panel() {
        let (ground, panel) = ([250, 248, 240], [238; 3]);
        let rim = [[251, 249, 240], [252, 250, 241], [246, 245, 239], [236, 236, 237], [237; 3], [238; 3]];
        let pixels: Vec<[u8; 3]> = (0..SIDE * SIDE)
            .map(|at| {
                let far = |v: usize| (v as f64 - 47.5).abs();
                match far(at % SIDE).max(far(at / SIDE)) - 27.0 {
                    out if out >= 3.0 => ground,
                    out if out < -3.0 => panel,
                    out => rim[(2.5 - out).round() as usize],
                }
            })
            .collect();
        let found = all(&pixels).expect("flat art");
        assert_eq!((found[0], found[SIDE * SIDE / 2 + SIDE / 2]), (ground, panel));
    }

    #[test]
    fn colours_that_touch_stay_as_they_are() {
        let colours = [[255, 0, 0], [255, 255, 0], [30, 60, 90], [250, 240, 220]];
        let pixels: Vec<[u8; 3]> =
            (0..SIDE * SIDE).map(|at| colours[at % SIDE / 12 % 2 * 2 + at / SIDE / 9 % 2]).collect();
        assert_eq!(all(&pixels).as_ref(), Some(&pixels));
    }

    #[test]
    fn photographs_are_none() {
        let wave = |x: f64, y: f64, c: usize| {
            130.0 + 60.0 * (x / 9.0 + c as f64).sin() + 50.0 * (y / (11.0 + c as f64)).cos()
        };
        let smooth = |scale: usize, step: f64| -> Vec<[u8; 3]> {
            (0..SIDE * SIDE)
                .map(|at| {
                    let (x, y) = ((at % SIDE / scale * scale) as f64, (at / SIDE / scale * scale) as f64);
                    std::array::from_fn(|c| ((wave(x, y, c) / step).round() * step) as u8)
                })
                .collect()
        };
        // Fine, drawn larger than it is, with few levels, and a grey ramp.
        for (name, picture) in [
            ("fine", smooth(1, 1.0)),
            ("enlarged", smooth(4, 1.0)),
            ("enlarged, grey", smooth(4, 1.0).into_iter().map(|[v, ..]| [v; 3]).collect()),
            ("of 32 levels", smooth(1, 8.0)),
            ("ramp", (0..SIDE * SIDE).map(|at| [(at % SIDE * 2 + 20) as u8; 3]).collect()),
        ] {
            assert!(all(&picture).is_none(), "{name}");
        }
    }
}
