//! How much of a plane is too thin for its ink.
//!
//! Method: the dots that lie in no solid square of `side` x `side` dots (an opening by a square): hairlines, specks and tips,
//! but not the steps of a slanted edge. Cost: two passes over the dots.

use sheet::Plane;

/// How many dots lie in no solid square of this side (at least 1), and how many there are.
pub(super) fn thin(plane: &Plane, side: usize) -> (u64, u64) {
    let (width, length, stride) = (plane.width, plane.length, plane.stride);
    let has = |row: &[u8], x: usize| row[x / 8] << (x % 8) & 0x80 != 0;
    // heights[x]: how many dots with ink stand above each other ending in this row, `side` at most.
    let mut heights = vec![0usize; width];
    // until[x]: dots of column x are covered by a square in this row and the `until - 1` above.
    let mut covered = vec![0u64; width.div_ceil(64) * length];
    let words = width.div_ceil(64);
    for (y, row) in plane.bits.chunks_exact(stride.max(1)).enumerate() {
        let mut run = 0;
        for (x, height) in heights.iter_mut().enumerate() {
            *height = if has(row, x) { (*height + 1).min(side) } else { 0 };
            run = if *height == side { run + 1 } else { 0 };
            if run >= side {
                // The square whose last dot is (x, y). Only its new column matters while the run goes on.
                let first = if run == side { x + 1 - side } else { x };
                for above in y + 1 - side..=y {
                    for column in first..=x {
                        covered[above * words + column / 64] |= 1 << (column % 64);
                    }
                }
            }
        }
    }
    let solid: u64 = covered.iter().map(|word| u64::from(word.count_ones())).sum();
    let all = plane.dots();
    (all - solid, all)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn plane(width: usize, length: usize, dot: impl Fn(usize, usize) -> bool) -> Plane {
        let stride = width.div_ceil(8);
        let mut bits = vec![0u8; stride * length];
        for y in 0..length {
            for x in (0..width).filter(|&x| dot(x, y)) {
                bits[y * stride + x / 8] |= 0x80 >> (x % 8);
            }
        }
        Plane { width, length, stride, bits }
    }

    proptest! {
        #[test]
        fn a_dot_is_thin_when_no_solid_square_holds_it(
            width in 1usize..70, length in 1usize..24, side in 1usize..5, seed: u32, dense in 1u32..8,
        ) {
            let dot = |x: usize, y: usize| {
                let n = ((x as u32 + 97 * y as u32) ^ seed).wrapping_mul(0x9e37_79b1);
                (n >> 13) % 8 < dense || (x / 6 + y / 5).is_multiple_of(2)
            };
            let plane = plane(width, length, dot);
            let inside = |x: usize, y: usize| x < width && y < length && dot(x, y);
            let solid = |x: usize, y: usize| {
                (x..x + side).all(|x| (y..y + side).all(|y| inside(x, y)))
            };
            let held = |x: usize, y: usize| {
                (x.saturating_sub(side - 1)..=x).any(|left| (y.saturating_sub(side - 1)..=y).any(|top| solid(left, top)))
            };
            let all: Vec<(usize, usize)> =
                (0..length).flat_map(|y| (0..width).map(move |x| (x, y))).filter(|&(x, y)| dot(x, y)).collect();
            let want = all.iter().filter(|&&(x, y)| !held(x, y)).count() as u64;
            prop_assert_eq!(thin(&plane, side), (want, all.len() as u64));
        }
    }

    #[test]
    fn hairlines_are_thin_and_slanted_edges_are_not() {
        let hairline = plane(200, 40, |_, y| y == 20);
        assert_eq!(thin(&hairline, 4), (200, 200));
        let triangle = plane(200, 200, |x, y| x + y < 200);
        let (few, all) = thin(&triangle, 4);
        assert!(few * 100 < all, "{few} of {all}");
    }
}
