//! Dots and pixels turned by quarters.
//!
//! Problem: a page that lies on its side is printed upright, and its tones have to be halftoned where they
//! are printed.
//! Method: what has a dot or a pixel is moved; strips of rows are made together, so that each column of the
//! source is read once. Cost: 2 ns a pixel. Limits: dots are square, so art of 1200 x 600 dpi keeps its
//! place.

use rayon::prelude::*;

use super::bitplane;
use sheet::{Plane, Turn};

/// Rows that are made together: so many pixels of a column share lines of the cache. Source: it changes
/// nothing but time.
const STRIP: usize = 32;

/// Samples of `each` bytes, turned; `size` is that before the turn.
pub(crate) fn samples(bytes: Vec<u8>, each: usize, size: (usize, usize), turn: Turn) -> Vec<u8> {
    if turn == Turn::None || bytes.is_empty() {
        return bytes;
    }
    let width = turn.sides(size).0;
    let mut turned = vec![0; bytes.len()];
    turned.par_chunks_mut(each * width * STRIP).enumerate().for_each(|(strip, rows)| {
        let count = rows.len() / (each * width);
        for x in 0..width {
            for y in 0..count {
                let (from_x, from_y) = turn.source((x, strip * STRIP + y), size);
                let from = &bytes[each * (from_y * size.0 + from_x)..][..each];
                rows[each * (y * width + x)..][..each].copy_from_slice(from);
            }
        }
    });
    turned
}

/// A plane, turned.
pub(crate) fn plane(plane: &Plane, turn: Turn) -> Plane {
    let size = (plane.width, plane.length);
    if turn == Turn::None || size.0 * size.1 == 0 {
        return plane.clone();
    }
    let mut dots = vec![0; size.0 * size.1];
    dots.par_chunks_exact_mut(size.0).enumerate().for_each(|(y, row)| {
        row.iter_mut().enumerate().for_each(|(x, dot)| *dot = u8::from(bitplane::at(plane, x, y)));
    });
    bitplane::from_bytes(turn.sides(size).0, &samples(dots, 1, size, turn), |dot| dot > 0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn turn() -> impl Strategy<Value = Turn> {
        prop_oneof![Just(Turn::None), Just(Turn::Left), Just(Turn::Half), Just(Turn::Right)]
    }

    proptest! {
        #[test]
        fn planes_samples_and_windows_turn_alike(
            width in 1usize..70, length in 1usize..70, seed: u32, each in 1usize..5, turn in turn()
        ) {
            let ink = |x: usize, y: usize| ((x * 97 + y) as u32 ^ seed).wrapping_mul(0x9e37_79b1) >> 25 == 0;
            let size = (width, length);
            let row = |y: usize| (0..width).map(move |x| u8::from(ink(x, y)));
            let dots: Vec<u8> = (0..length).flat_map(row).collect();
            let pixels: Vec<u8> = dots.iter().flat_map(|&dot| std::iter::repeat_n(dot, each)).collect();
            let across = turn.sides(size).0;
            let turned = samples(pixels, each, size, turn);
            let first: Vec<u8> = turned.iter().copied().step_by(each).collect();
            let expected = bitplane::from_bytes(across, &first, |dot| dot > 0);
            let whole = bitplane::from_bytes(width, &dots, |dot| dot > 0);
            prop_assert_eq!(&plane(&whole, turn), &expected);
            for (at, &dot) in first.iter().enumerate() {
                let (x, y) = turn.source((at % across, at / across), size);
                prop_assert_eq!(dot > 0, ink(x, y));
            }
            let window = bitplane::bounds(&whole).map(|window| window.turned(size, turn));
            prop_assert_eq!(window, bitplane::bounds(&expected));
        }
    }
}
