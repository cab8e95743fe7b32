//! Numbers that look random, each computed by itself: the sequence of SplitMix64.
//!
//! Problem: marks of a chart are the same for ever, and dots that are worn away do not depend on who computes which row. Generators of
//! libraries give their numbers one after the other. Cost: two multiplications a number. Limits: not for secrets.
//! Source: G. Steele, D. Lea, C. Flood, Fast splittable pseudorandom number generators, 2014.

/// Number `n`, from 0, of the sequence that begins with this seed: uniform in 64 bits.
pub(crate) fn nth(seed: u64, n: u64) -> u64 {
    let mut z = seed.wrapping_add(n.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    /// The numbers of the authors' program.
    #[test]
    fn the_sequence_is_the_published_one() {
        let found = [0, 1, 2].map(|n| super::nth(0, n));
        assert_eq!(found, [0xe220_a839_7b1d_cdaf, 0x6e78_9e6a_a1b9_65f4, 0x06c4_5d18_8009_454f]);
    }
}
