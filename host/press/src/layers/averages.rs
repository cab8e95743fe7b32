//! The colours between which dots are halftoned: averages of pixels in linear light.
//!
//! Problem: no cluster of dots is finer than 300 dpi, and a finer picture would alias. Letters in an average would bleed into the
//! tone around them.
//! Method: pixels are averaged to at most one for two dots along each side. Dots that are fixed, white and black among them, do
//! not count beside others; where there are only such, a neighbour's colour takes their place. Whether text or a drawing
//! has a pixel's colour decides how it is mixed.
//! Cost: 5 ns a pixel that is not bare. Limits: where sides are no multiples, pixels at borders count twice.

use rayon::prelude::*;

use super::colour::Colour;
use super::flat::{BLACK, Flat, WHITE, is_tone};
use super::kinds::Kind;

/// The colours of pixels averaged to at most one pixel for two dots along each side; `pixel` says what drew one, in which colour,
/// and `fixed` whether one besides white and black does not count.
pub(super) fn averaged(
    pixel: impl Fn(usize) -> (Kind, [u8; 3]) + Sync,
    fixed: impl Fn(usize) -> bool + Sync,
    flat: &Flat,
    size: (usize, usize),
    dots: (usize, usize),
) -> Colour {
    let to = (size.0.min(dots.0.div_ceil(2)), size.1.min(dots.1.div_ceil(2)));
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
        _ if from == to => at..at + 1,
        true => 2 * at..(2 * at + 2).min(from),
        false => at * from / to..((at + 1) * from).div_ceil(to),
    };
    let mut rgb = vec![255; to.0 * to.1 * 3];
    let mut drawn = vec![false; to.0 * to.1];
    let counts = |at: usize| flat.index[at] > BLACK && !fixed(at);
    // Pixels of which nothing counts.
    let mut plain = vec![true; to.0 * to.1];
    let rows = rgb.par_chunks_exact_mut(to.0 * 3).zip(drawn.par_chunks_exact_mut(to.0));
    rows.zip(plain.par_chunks_exact_mut(to.0)).enumerate().for_each(|(y, ((rgb, drawn), plain))| {
        let rows = span(y, size.1, to.1);
        if flat.index[rows.start * size.0..rows.end * size.0].iter().fold(0, |most, &dot| most.max(dot))
            == WHITE
        {
            return;
        }
        for (x, out) in rgb.as_chunks_mut::<3>().0.iter_mut().enumerate() {
            let columns = span(x, size.0, to.0);
            let at = || rows.clone().flat_map(|y| columns.clone().map(move |x| y * size.0 + x));
            let toned = at().find(|&at| counts(at));
            plain[x] = toned.is_none();
            // Flat colours are drawn wherever they come from, and so are shadings.
            drawn[x] = toned.is_some_and(|at| !is_tone(flat.index[at]) || pixel(at).0 != Kind::Picture);
            let (mut sum, mut count) = ([0u64; 3], 0);
            for at in at().filter(|&at| toned.is_none() || counts(at)) {
                sum.iter_mut()
                    .zip(pixel(at).1)
                    .for_each(|(sum, v)| *sum += u64::from(linear[usize::from(v)]));
                count += 1;
            }
            *out = sum.map(|sum| coded[((sum + count / 2) / count) as usize]);
        }
    });
    spread(&mut rgb, &mut drawn, &plain, to.0);
    if !drawn.contains(&true) {
        drawn.clear();
    }
    Colour { width: to.0, height: to.1, rgb, drawn, ..Colour::default() }
}

/// Gives plain pixels beside others the colour of one of these: the halftone interpolates between pixels, and a tone must
/// not fade towards an edge because white is beyond it.
fn spread(rgb: &mut [u8], drawn: &mut [bool], plain: &[bool], width: usize) {
    let height = plain.len() / width;
    let busy: Vec<bool> = plain.par_chunks_exact(width).map(|row| row.contains(&false)).collect();
    let beside = |at: usize, sides: usize| at.saturating_sub(1)..(at + 2).min(sides);
    let taken: Vec<(usize, usize)> = (0..height)
        .into_par_iter()
        .filter(|&y| busy[beside(y, height)].contains(&true))
        .flat_map_iter(|y| {
            (0..width).filter_map(move |x| {
                let at = y * width + x;
                let mut near = beside(y, height).flat_map(|v| beside(x, width).map(move |u| v * width + u));
                plain[at].then(|| near.find(|&near| !plain[near])).flatten().map(|from| (at, from))
            })
        })
        .collect();
    for (at, from) in taken {
        rgb.copy_within(3 * from..3 * from + 3, 3 * at);
        drawn[at] = drawn[from];
    }
}

#[cfg(test)]
mod tests {
    use super::super::flat::TONE;
    use super::*;

    #[test]
    fn averages_are_of_light_not_of_numbers() {
        // Of greys: white and black, and what is like them, are not averaged.
        let checks: Vec<[u8; 3]> =
            (0..64 * 64).map(|at| if (at % 64 + at / 64) % 2 == 0 { [235; 3] } else { [20; 3] }).collect();
        let half = Colour::of(&checks, (64, 64), (64, 64)).unwrap();
        assert_eq!((half.width, half.height), (32, 32));
        // sRGB of half the light, .831 and .007.
        assert!(half.rgb.iter().all(|&v| v == 173), "{:?}", &half.rgb[..6]);
        let same = Colour::of(&checks, (64, 64), (128, 128)).unwrap();
        assert_eq!(same.rgb, checks.concat(), "300 dpi stays as it is");
    }

    #[test]
    fn a_tone_does_not_fade_towards_white_letters() {
        let page: Vec<[u8; 3]> =
            (0..40 * 40).map(|at| if (at % 40) % 13 < 5 { [255; 3] } else { [40, 60, 90] }).collect();
        let colour = Colour::of(&page, (40, 40), (40, 40)).unwrap();
        let colour = colour.averages((40, 40), None);
        assert!(
            colour.rgb.as_chunks::<3>().0.iter().all(|pixel| *pixel == [40, 60, 90] || *pixel == [255; 3])
        );
        for (at, pixel) in page.iter().enumerate().filter(|(_, pixel)| **pixel != [255; 3]) {
            let (x, y) = (at % 40 / 2, at / 40 / 2);
            let near = (y.saturating_sub(1)..(y + 2).min(20))
                .flat_map(|v| (x.saturating_sub(1)..(x + 2).min(20)).map(move |u| 20 * v + u));
            for near in near {
                assert_eq!(colour.rgb[3 * near..3 * near + 3], *pixel);
            }
        }
    }

    /// Letters that are fixed to a solid do not darken the tint around them.
    #[test]
    fn a_tone_is_not_mixed_with_letters_that_are_fixed() {
        let (letter, tint) = ([139, 0, 0], [255, 210, 220]);
        let is_letter = |at: usize| (at % 40) % 13 < 5;
        let page: Vec<[u8; 3]> = (0..40 * 40).map(|at| if is_letter(at) { letter } else { tint }).collect();
        let colour = Colour::of(&page, (40, 40), (40, 40)).unwrap();
        let fixed: Vec<u8> = (0..40 * 40).map(|at| if is_letter(at) { 3 } else { TONE }).collect();
        let mixed = colour.averages((40, 40), None);
        assert!(mixed.rgb.as_chunks::<3>().0.iter().any(|pixel| *pixel != letter && *pixel != tint));
        let apart = colour.averages((40, 40), Some(&fixed));
        // What the halftone of a dot of the tint reads: its own pixel and those beside it.
        for at in (0..40 * 40).filter(|&at| !is_letter(at)) {
            let (x, y) = (at % 40 / 2, at / 40 / 2);
            for near in x.saturating_sub(1)..(x + 2).min(20) {
                assert_eq!(apart.rgb[3 * (20 * y + near)..][..3], tint, "at {x}, {y}, read from {near}");
            }
        }
    }

    /// Nor do letters that will be fixed whatever they lie on: dark ones, and pale ones on a shading with more ink than paper.
    #[test]
    fn a_shading_is_not_mixed_with_letters() {
        let is_letter = |at: usize| (at % 40) % 13 < 5;
        for (letter, ground, mixed) in
            [([60, 0, 90], 230, false), ([230, 235, 240], 60, false), ([230, 235, 240], 200, true)]
        {
            // More greys than a palette holds, so that they are tones.
            let shading = |at: usize| [ground + (at / 40 / 2) as u8; 3].map(|v| v - (at % 40 / 2 % 13) as u8);
            let pixel = |at: usize| {
                let ([r, g, b], tag) =
                    if is_letter(at) { (letter, Kind::TEXT) } else { (shading(at), Kind::PICTURE) };
                [tag, r, g, b]
            };
            let page: Vec<[u8; 4]> = (0..40 * 40).map(pixel).collect();
            let colour = Colour::of(&page, (40, 40), (40, 40)).unwrap();
            let beside = (0..40 * 40).filter(|&at| !is_letter(at));
            let found = beside.map(|at| &colour.rgb[3 * (at / 40 / 2 * 20 + at % 40 / 2)..][..3]);
            let strange = found.filter(|rgb| rgb.iter().any(|&v| v.abs_diff(ground + 4) > 17)).count();
            assert_eq!(strange > 0, mixed, "{letter:?} on {ground}");
        }
    }
}
