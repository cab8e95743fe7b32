//! Some dots of a block: a bit each.

/// Side of a block in dots: the smallest number with eight divisors, which are the sides of cells, so that
/// blocks of any cells meet.
pub(crate) const BLOCK: usize = 24;

/// All dots of a row of a block.
pub(super) const FULL: u32 = (1 << BLOCK) - 1;

/// Some dots of a block, row by row, the leftmost in the lowest bit.
pub(super) type Mask = [u32; BLOCK];

/// Bits of so many dots from `left`.
pub(super) fn span(left: usize, dots: usize) -> u32 {
    (FULL >> (BLOCK - dots)) << left
}

/// The columns whose bits are set.
pub(super) fn bits(mut mask: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = mask.trailing_zeros();
        mask &= mask.wrapping_sub(1);
        (bit < u32::BITS).then_some(bit as usize)
    })
}
