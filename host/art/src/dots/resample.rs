//! From a picture's pixels to dots of 600 dpi.
//!
//! Problem: a line of one pixel is half a dot wide at 1200 dpi. Under the middles of the dots it comes and goes.
//! Method: the pixels of a dot are those whose middles lie in it; where pixels are no finer than dots, the one under its middle. Of
//! classes, the one that most pixels of a dot have is taken, and nothing (class 0) only if more than half have it. The coverage of a solid
//! layer is the average of a dot's pixels. So a line that covers half of its dots is whole: at 1200 dpi every line.
//! Tones, and coverage where there are fewer pixels than dots, are interpolated (a triangle filter).
//! Cost: nothing where pixels are dots; otherwise that of [`readers::resized`], or 2 ns a pixel. Limits:
//! lines thinner than half a dot are lost, and a pattern of single pixels becomes solid.

use std::ops::Range;

use rayon::prelude::*;

use crate::error::resolution_in_words;
use crate::options::Options;

/// Tones at the dots.
pub(crate) fn tones(coverage: Vec<u8>, from: (u32, u32), to: (usize, usize)) -> Vec<u8> {
    if sides(from) == to {
        return coverage;
    }
    readers::resized(coverage, from, (to.0 as u32, to.1 as u32))
}

/// Coverage at the dots of a layer that is cut at half.
pub(crate) fn solid(coverage: Vec<u8>, from: (u32, u32), to: (usize, usize)) -> Vec<u8> {
    let (width, length) = sides(from);
    if width < to.0 || length < to.1 {
        return tones(coverage, from, to);
    }
    at_dots(coverage, from, to, |pixels| {
        let sum: usize = pixels.iter().map(|&pixel| usize::from(pixel)).sum();
        ((2 * sum + pixels.len()) / (2 * pixels.len())) as u8
    })
}

/// Classes at the dots.
pub(crate) fn classes(bytes: Vec<u8>, from: (u32, u32), to: (usize, usize)) -> Vec<u8> {
    at_dots(bytes, from, to, |pixels| {
        if pixels.iter().all(|&pixel| pixel == pixels[0]) {
            return pixels[0];
        }
        pixels.sort_unstable();
        let runs = || pixels.chunk_by(|a, b| a == b);
        let most = runs().filter(|run| run[0] > 0).max_by_key(|run| run.len());
        let nothing = pixels.iter().filter(|&&pixel| pixel == 0).count();
        most.filter(|_| 2 * nothing <= pixels.len()).map_or(0, |run| run[0])
    })
}

/// What is said of edges that are drawn in other pixels than dots; `from` says in which.
pub(crate) fn note(name: &str, from: String, to: (usize, usize), options: &Options) -> String {
    let dpi = resolution_in_words((600.0 * options.across.max(1) as f64, 600.0));
    format!(
        "{name}: resampled from {from} to {} x {} dots; draw at {dpi} to keep edges exactly as drawn",
        to.0, to.1
    )
}

fn sides(size: (u32, u32)) -> (usize, usize) {
    (size.0 as usize, size.1 as usize)
}

/// For each dot, what `of` makes of its pixels.
fn at_dots(
    bytes: Vec<u8>,
    from: (u32, u32),
    to: (usize, usize),
    of: impl Fn(&mut [u8]) -> u8 + Sync,
) -> Vec<u8> {
    let from = sides(from);
    if from == to {
        return bytes;
    }
    let columns: Vec<Range<usize>> = (0..to.0).map(|x| pixels(x, from.0, to.0)).collect();
    let mut dots = vec![0; to.0 * to.1];
    dots.par_chunks_mut(to.0.max(1)).enumerate().for_each(|(y, row)| {
        let mut found = Vec::new();
        for (dot, columns) in row.iter_mut().zip(&columns) {
            found.clear();
            for v in pixels(y, from.1, to.1) {
                found.extend_from_slice(&bytes[v * from.0..][columns.clone()]);
            }
            *dot = of(&mut found);
        }
    });
    dots
}

/// The pixels of a dot along one side; at least one.
pub(crate) fn pixels(dot: usize, from: usize, to: usize) -> Range<usize> {
    if from <= to {
        let at = (2 * dot + 1) * from / (2 * to);
        return at..at + 1;
    }
    // A pixel's middle is half a pixel behind its beginning.
    let first = |dot: usize| (2 * dot * from + to - 1) / (2 * to);
    first(dot)..first(dot + 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_line_is_whole_where_it_covers_half_of_its_dots_and_nowhere_else() {
        for (finer, thick) in [(2, 1), (2, 2), (2, 3), (3, 1), (3, 2), (4, 1), (4, 2), (5, 4)] {
            let (width, length) = (10, 20 * finer);
            for at in 0..=length - thick {
                let pixels: Vec<u8> = (0..width * length)
                    .map(|pixel| 7 * u8::from((at..at + thick).contains(&(pixel / width))))
                    .collect();
                let inked =
                    |y: usize| (finer * y..finer * (y + 1)).filter(|v| (at..at + thick).contains(v)).count();
                let wanted: Vec<u8> =
                    (0..20).flat_map(|y| [7 * u8::from(2 * inked(y) >= finer); 10]).collect();
                let size = (width as u32, length as u32);
                let found = classes(pixels.clone(), size, (10, 20));
                assert_eq!(found, wanted, "{thick} pixels of {finer} at {at}");
                assert!(finer > 2 || wanted.contains(&7));
                // A layer that is cut at half has the same dots.
                let cover = solid(pixels.iter().map(|&pixel| pixel / 7 * 255).collect(), size, (10, 20));
                assert!(cover.iter().zip(&wanted).all(|(&cover, &dot)| (cover >= 128) == (dot > 0)));
            }
        }
    }

    proptest! {
        #[test]
        fn each_pixel_belongs_to_the_dot_its_middle_lies_in(to in 1usize..50, more in 1usize..100) {
            let from = to + more;
            let mut next = 0;
            for dot in 0..to {
                let range = pixels(dot, from, to);
                prop_assert!(range.start == next && !range.is_empty());
                for pixel in range.clone() {
                    let middle = (pixel as f64 + 0.5) * to as f64 / from as f64;
                    prop_assert!(middle > dot as f64 - 1e-9 && middle < (dot + 1) as f64 + 1e-9, "{} in {}", middle, dot);
                }
                next = range.end;
            }
            prop_assert_eq!(next, from);
        }
    }
}
