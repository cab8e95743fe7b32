//! The dots of one ink: one bit each.

use crate::Area;

/// One bit for each dot of the printable area, 8 dots to a byte, most significant bit left, 1 = ink.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Plane {
    /// Dots across.
    pub width: usize,
    /// Rows.
    pub length: usize,
    /// Bytes a row, `width / 8` rounded up; the spare bits at the right are 0.
    pub stride: usize,
    /// The rows from the top.
    pub bits: Vec<u8>,
}

impl Plane {
    /// Whether no dot has ink.
    pub fn is_blank(&self) -> bool {
        self.bits.iter().all(|&byte| byte == 0)
    }

    /// How many dots have ink.
    pub fn dots(&self) -> u64 {
        self.bits.iter().map(|byte| u64::from(byte.count_ones())).sum()
    }

    /// The dots of each row of an area, eight a byte, the first one highest. Those after the last are 0.
    ///
    /// # Panics
    /// If the area leaves the plane, which is a bug of the caller.
    pub fn rows_in(&self, area: Area) -> impl Iterator<Item = impl Iterator<Item = u8>> {
        let Area { left, top, width, length } = area;
        let (first, shift) = (left / 8, left % 8);
        let rows = self.bits.chunks_exact(self.stride.max(1)).skip(top).take(length);
        rows.map(move |row| {
            (0..width.div_ceil(8)).map(move |i| {
                let next = row.get(first + i + 1).copied().unwrap_or(0);
                let [eight, _] = (u16::from_be_bytes([row[first + i], next]) << shift).to_be_bytes();
                let beyond = (8 * (i + 1)).saturating_sub(width);
                eight >> beyond << beyond
            })
        })
    }

    /// How many dots of an area have ink.
    pub fn dots_in(&self, area: &Area) -> u64 {
        let width = area.width.min(self.width.saturating_sub(area.left));
        self.rows_in(Area { width, ..*area }).flatten().map(|eight| u64::from(eight.count_ones())).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_dots_of_an_area_are_counted_one_by_one(
            width in 1usize..70, length in 1usize..9, seed: u32, corner: (u8, u8), size: (u8, u8)
        ) {
            let ink = |x: usize, y: usize| ((x * 9 + y) as u32 ^ seed).wrapping_mul(0x9e37_79b1) >> 19 & 1 == 1;
            let stride = width.div_ceil(8);
            let mut bits = vec![0u8; stride * length];
            for (x, y) in (0..length).flat_map(|y| (0..width).map(move |x| (x, y))).filter(|&(x, y)| ink(x, y)) {
                bits[y * stride + x / 8] |= 0x80 >> (x % 8);
            }
            let (left, top) = (usize::from(corner.0) % width, usize::from(corner.1) % length);
            let (wide, long) = (usize::from(size.0) % (width - left + 1), usize::from(size.1) % (length - top + 1));
            let wanted = (top..top + long).flat_map(|y| (left..left + wide).map(move |x| (x, y))).filter(|&(x, y)| ink(x, y));
            let area = Area { left, top, width: wide, length: long };
            prop_assert_eq!(Plane { width, length, stride, bits }.dots_in(&area), wanted.count() as u64);
        }
    }
}
