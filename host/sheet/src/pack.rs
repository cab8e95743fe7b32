//! Dots to one-bit planes and back, eight dots and eight passes at a time.
//!
//! Problem: a page has tens of millions of dots and each belongs to several passes.
//! Method: a table gives each stack its passes as bits; the bits of eight dots are an 8 x 8 matrix in one word, whose
//! transpose is one byte for each of eight passes. The way back is the same transpose. Rows are shared out over
//! the cores. Cost: about 4 ns for eight dots and eight passes. Source of the transpose: H. Warren, Hacker's Delight, 7-3.

use rayon::prelude::*;

use crate::Plane;

/// Rows handed out together.
const ROWS: usize = 64;

/// Bit j of byte i to bit i of byte j.
fn transpose(mut x: u64) -> u64 {
    for (shift, mask) in
        [(7, 0x00aa_00aa_00aa_00aa), (14, 0x0000_cccc_0000_cccc), (28, 0x0000_0000_f0f0_f0f0)]
    {
        let swap = (x ^ (x >> shift)) & mask;
        x ^= swap ^ (swap << shift);
    }
    x
}

/// A plane for each pass. `passes_of[stack]` has bit p set if the stack is in pass p, `passes` of them (16 at most).
pub fn pack(width: usize, index: &[u8], passes_of: &[u16; 256], passes: usize) -> Vec<Plane> {
    let (stride, length) = (width.div_ceil(8), index.len() / width);
    let mut planes: Vec<Plane> =
        (0..passes).map(|_| Plane { width, length, stride, bits: vec![0; stride * length] }).collect();
    // `slabs[i]` are the rows of slab i in each plane.
    let mut slabs: Vec<Vec<&mut [u8]>> = (0..length.div_ceil(ROWS)).map(|_| Vec::new()).collect();
    for plane in &mut planes {
        for (slab, rows) in slabs.iter_mut().zip(plane.bits.chunks_mut(stride * ROWS)) {
            slab.push(rows);
        }
    }
    slabs.par_iter_mut().zip(index.par_chunks(width * ROWS)).for_each(|(slab, dots)| {
        for (eight, planes) in slab.chunks_mut(8).enumerate() {
            let byte: [u8; 256] = std::array::from_fn(|stack| (passes_of[stack] >> (8 * eight)) as u8);
            for (row, dots) in dots.chunks_exact(width).enumerate() {
                let (whole, rest) = dots.as_chunks::<8>();
                let start = row * stride;
                for (at, dots) in whole.iter().enumerate() {
                    // Most dots are bare, and planes are blank before.
                    if *dots == [0; 8] && byte[0] == 0 {
                        continue;
                    }
                    let bits =
                        transpose(u64::from_be_bytes(dots.map(|dot| byte[usize::from(dot)]))).to_le_bytes();
                    for (plane, bits) in planes.iter_mut().zip(bits) {
                        plane[start + at] = bits;
                    }
                }
                if !rest.is_empty() {
                    let mut dots = [0; 8];
                    for (bits, &dot) in dots.iter_mut().zip(rest) {
                        *bits = byte[usize::from(dot)];
                    }
                    let bits = transpose(u64::from_be_bytes(dots)).to_le_bytes();
                    for (plane, bits) in planes.iter_mut().zip(bits) {
                        plane[start + whole.len()] = bits;
                    }
                }
            }
        }
    });
    planes
}

/// The planes that each of eight dots has, as bits; `at` is the place of their byte.
fn masks(planes: &[&Plane], at: usize) -> [usize; 8] {
    let mut masks = [0usize; 8];
    for (eight, planes) in planes.chunks(8).enumerate() {
        let mut bytes = [0u8; 8];
        for (byte, plane) in bytes.iter_mut().zip(planes) {
            *byte = plane.bits[at];
        }
        let bytes = u64::from_le_bytes(bytes);
        if bytes == 0 {
            continue;
        }
        let dots = transpose(bytes).to_be_bytes();
        for (mask, bits) in masks.iter_mut().zip(dots) {
            *mask |= usize::from(bits) << (8 * eight);
        }
    }
    masks
}

/// Whether no plane has any of eight dots.
fn is_blank(planes: &[&Plane], at: usize) -> bool {
    planes.iter().all(|plane| plane.bits[at] == 0)
}

/// How many dots have each combination of 16 planes at most, all of one size; bit p of an entry's number is plane p.
pub fn census(planes: &[&Plane], width: usize, length: usize) -> Vec<u64> {
    let stride = width.div_ceil(8);
    let none = || vec![0u64; 1 << planes.len()];
    let slabs = (0..length).into_par_iter().with_min_len(ROWS);
    slabs
        .fold(none, |mut counts, row| {
            for at in 0..stride {
                let dots = 8.min(width - 8 * at);
                if is_blank(planes, row * stride + at) {
                    counts[0] += dots as u64;
                    continue;
                }
                for &mask in &masks(planes, row * stride + at)[..dots] {
                    counts[mask] += 1;
                }
            }
            counts
        })
        .reduce(none, |a, b| a.into_iter().zip(b).map(|(a, b)| a + b).collect())
}

/// Stack numbers from planes of one size: `stack_of[mask]` for the dots with these passes, where the table says
/// [`NONE`] there is none. The error is the first such dot and its mask.
pub fn unpack(
    planes: &[&Plane],
    width: usize,
    length: usize,
    stack_of: &[u16],
) -> Result<Vec<u8>, (usize, usize)> {
    let stride = width.div_ceil(8);
    let mask_of = |row: usize, at: usize| masks(planes, row * stride + at);
    let bare = stack_of.first() == Some(&0);
    let mut index = vec![0u8; width * length];
    let bad = index
        .par_chunks_mut(width)
        .enumerate()
        .filter_map(|(row, dots)| {
            let mut bad = None;
            for (at, dots) in dots.chunks_mut(8).enumerate() {
                if bare && is_blank(planes, row * stride + at) {
                    continue;
                }
                for ((i, dot), mask) in dots.iter_mut().enumerate().zip(mask_of(row, at)) {
                    let stack = stack_of[mask];
                    *dot = stack as u8;
                    if stack == NONE && bad.is_none() {
                        bad = Some((row * width + at * 8 + i, mask));
                    }
                }
            }
            bad
        })
        .min();
    bad.map_or(Ok(index), Err)
}

/// No stack has these passes.
pub const NONE: u16 = u16::MAX;

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_bit_is_set_where_its_dot_is_in_its_pass(
            width in 1usize..70, length in 1usize..140, passes in 1usize..=16, seed in any::<u32>()
        ) {
            let random = |i: usize| ((i as u32 ^ seed).wrapping_mul(0x9e37_79b1) >> 9) as u16;
            let index: Vec<u8> = (0..width * length).map(|i| (random(i) % 200) as u8).collect();
            let passes_of: [u16; 256] = std::array::from_fn(|s| random(s + 1_000_000) & ((1u32 << passes) - 1) as u16);
            let planes = pack(width, &index, &passes_of, passes);
            prop_assert_eq!(planes.len(), passes);
            for (p, plane) in planes.iter().enumerate() {
                for y in 0..length {
                    for x in 0..plane.stride * 8 {
                        let bit = plane.bits[y * plane.stride + x / 8] >> (7 - x % 8) & 1 == 1;
                        let wanted = x < width && passes_of[usize::from(index[y * width + x])] >> p & 1 == 1;
                        prop_assert_eq!(bit, wanted, "pass {} at ({}, {})", p, x, y);
                    }
                }
            }
        }
    }
}
