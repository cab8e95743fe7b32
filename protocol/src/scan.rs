//! Where bytes change, a machine word at a time.
//!
//! Problem: most of a row is blank or solid, and a microcontroller takes eight cycles to look at a byte. Method: whole words
//! where they are aligned, single bytes at both ends. Cost: six cycles a word there, and some forty for the beginning.

const WORD: usize = size_of::<usize>();

/// Bytes at the beginning of `bytes` that equal `value`.
pub(crate) fn same(bytes: &[u8], value: u8) -> usize {
    let is = |&&byte: &&u8| byte == value;
    let (head, words, _) = bytemuck::pod_align_to::<u8, usize>(bytes);
    let before = head.iter().take_while(is).count();
    if before < head.len() {
        return before;
    }
    let whole = words.iter().take_while(|&&word| word == usize::from_ne_bytes([value; WORD])).count();
    let at = before + whole * WORD;
    at + bytes[at..].iter().take_while(is).count()
}

/// `bytes` without the zeros at their end.
pub(crate) fn trim(bytes: &[u8]) -> &[u8] {
    let (_, words, tail) = bytemuck::pod_align_to::<u8, usize>(bytes);
    let mut end = bytes.len();
    if tail.iter().all(|&byte| byte == 0) {
        end -= tail.len() + words.iter().rev().take_while(|&&word| word == 0).count() * WORD;
    }
    let blank = bytes[..end].iter().rev().take_while(|&&byte| byte == 0).count();
    &bytes[..end - blank]
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    proptest! {
        #[test]
        fn runs_end_where_they_end(
            runs in prop::collection::vec((any::<bool>(), 0usize..40), 0..4),
            skip in 0usize..9,
            value in prop_oneof![Just(0u8), any::<u8>()],
        ) {
            let bytes: Vec<u8> =
                runs.iter().flat_map(|&(set, count)| core::iter::repeat_n(if set { value } else { 7 }, count)).collect();
            // At any alignment.
            let bytes = &bytes[skip.min(bytes.len())..];
            let differs = bytes.iter().position(|&byte| byte != value).unwrap_or(bytes.len());
            prop_assert_eq!(same(bytes, value), differs);
            let end = bytes.iter().rposition(|&byte| byte != 0).map_or(0, |last| last + 1);
            prop_assert_eq!(trim(bytes), &bytes[..end]);
        }
    }
}
