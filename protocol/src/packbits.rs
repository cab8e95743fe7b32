//! PackBits as the printer's established driver writes it.
//!
//! Problem: many byte sequences unpack to the same row, and ours must equal the driver's byte for byte.
//! Method: cut the row into runs of one byte and runs of changing bytes exactly as that driver does (a run never grows
//! beyond 128 bytes; the first of several equal bytes after a literal stays in the literal), join neighbouring literals
//! while they stay within 128 bytes, and write each with its header.
//! Cost: one walk over the row, no memory besides the output.
//! Limits: header `80` is never written, and refused when read, because drivers disagree about its meaning.
//! Source: streams of the established driver, all of which this module reproduces byte for byte.

use crate::scan;

/// The longest run one header can stand for.
const LONGEST: usize = 128;

/// Whether to compare eight bytes at a time. A microcontroller loads them one by one and is slower that way.
const WIDE: bool = cfg!(target_pointer_width = "64");

/// Packs `row` into `out`. Returns the number of bytes written, or `None` if `out` is too small for the result; the
/// content of `out` is arbitrary then. With an `out` one byte shorter than `row`, `Some` means that packing gained.
pub fn pack_into(row: &[u8], out: &mut [u8]) -> Option<usize> {
    let mut written = 0;
    // The joined literal not written yet: row[literal..at].
    let mut literal = 0;
    let mut at = 0;
    while at < row.len() {
        let (length, repeat) = segment(&row[at..]);
        if repeat {
            written = put_literal(&row[literal..at], out, written)?;
            #[expect(
                clippy::cast_possible_truncation,
                reason = "the length is 2 to 128, so the header 255 to 129"
            )]
            let header = (257 - length) as u8;
            *out.get_mut(written)? = header;
            *out.get_mut(written + 1)? = row[at];
            written += 2;
            literal = at + length;
        } else if at + length - literal > LONGEST {
            written = put_literal(&row[literal..at], out, written)?;
            literal = at;
        }
        at += length;
    }
    put_literal(&row[literal..], out, written)
}

/// The first run of a non-empty row and whether it repeats one byte. A single byte counts as literal.
fn segment(row: &[u8]) -> (usize, bool) {
    let row = &row[..row.len().min(LONGEST)];
    if row.len() >= 2 && row[1] == row[0] {
        return (scan::same(row, row[0]), true);
    }
    (literal(row), false)
}

/// Bytes before the first that equals the one before it.
fn literal(row: &[u8]) -> usize {
    const ONES: u64 = u64::from_le_bytes([1; 8]);
    let mut at = 0;
    while WIDE
        && let (Some(these), Some(next)) = (row[at..].first_chunk::<8>(), row[at + 1..].first_chunk::<8>())
    {
        let differing = u64::from_le_bytes(*these) ^ u64::from_le_bytes(*next);
        // The high bit of each zero byte; those above the lowest may be wrong, the lowest is right.
        let equal = differing.wrapping_sub(ONES) & !differing & (ONES << 7);
        if equal != 0 {
            return at + equal.trailing_zeros() as usize / 8 + 1;
        }
        at += 8;
    }
    row[at..].windows(2).position(|pair| pair[0] == pair[1]).map_or(row.len(), |i| at + i + 1)
}

fn put_literal(bytes: &[u8], out: &mut [u8], at: usize) -> Option<usize> {
    if bytes.is_empty() {
        return Some(at);
    }
    let end = at + 1 + bytes.len();
    let place = out.get_mut(at..end)?;
    #[expect(clippy::cast_possible_truncation, reason = "a literal has 1 to 128 bytes")]
    let header = (bytes.len() - 1) as u8;
    place[0] = header;
    place[1..].copy_from_slice(bytes);
    Some(end)
}

/// Why bytes are not a packed row. `at` is the position in the packed bytes.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Error {
    /// Position of the byte at fault.
    pub at: usize,
    /// What is wrong with it.
    pub kind: ErrorKind,
}

/// What is wrong with packed bytes.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum ErrorKind {
    /// Header `80`.
    ReservedHeader,
    /// The bytes that the header announces are missing.
    CutOff,
    /// The row is longer than the room for it.
    TooLong,
}

/// The runs of a packed row: (position of the header, bytes, how often each).
fn runs(packed: &[u8]) -> impl Iterator<Item = Result<(usize, &[u8], usize), Error>> {
    let mut at = 0;
    core::iter::from_fn(move || {
        let header = *packed.get(at)?;
        let start = at;
        let (bytes, times) = match header {
            0..=0x7f => (usize::from(header) + 1, 1),
            0x81..=0xff => (1, 257 - usize::from(header)),
            0x80 => {
                at = packed.len();
                return Some(Err(Error { at: start, kind: ErrorKind::ReservedHeader }));
            }
        };
        at = start + 1 + bytes;
        Some(match packed.get(start + 1..at) {
            Some(data) => Ok((start, data, times)),
            None => Err(Error { at: start, kind: ErrorKind::CutOff }),
        })
    })
}

/// Unpacks into `out` and returns the length of the row.
pub fn unpack_into(packed: &[u8], out: &mut [u8]) -> Result<usize, Error> {
    let mut length = 0;
    for run in runs(packed) {
        let (at, bytes, times) = run?;
        let end = length + bytes.len() * times;
        let place = out.get_mut(length..end).ok_or(Error { at, kind: ErrorKind::TooLong })?;
        if times == 1 {
            place.copy_from_slice(bytes);
        } else {
            place.fill(bytes[0]);
        }
        length = end;
    }
    Ok(length)
}

/// The length of the row and its last byte, without unpacking it; `(0, 0)` for no bytes at all.
pub fn measure(packed: &[u8]) -> Result<(usize, u8), Error> {
    let mut row = (0, 0);
    for run in runs(packed) {
        let (_, bytes, times) = run?;
        row = (row.0 + bytes.len() * times, bytes.last().copied().unwrap_or(0));
    }
    Ok(row)
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use proptest::prelude::*;
    use std::{vec, vec::Vec};

    /// What is sent for a row: packed when that is strictly shorter.
    fn sent(row: &[u8]) -> (bool, Vec<u8>) {
        let mut out = vec![0; row.len().saturating_sub(1)];
        match pack_into(row, &mut out) {
            Some(length) => (true, out[..length].to_vec()),
            None => (false, row.to_vec()),
        }
    }

    fn join(parts: &[&[u8]]) -> Vec<u8> {
        parts.concat()
    }

    #[test]
    fn the_worked_examples_come_out_byte_for_byte() {
        let different: Vec<u8> = (0..149u8).map(|i| i.wrapping_mul(3)).collect();
        let packed: &[(Vec<u8>, Vec<u8>)] = &[
            (vec![0xaa; 3], vec![0xfe, 0xaa]),
            (join(&[&[1, 2, 2, 2], &[3; 9]]), vec![0x01, 0x01, 0x02, 0xff, 0x02, 0xf8, 0x03]),
            (
                join(&[&[0, 0], &[0xff; 6], &[1, 2], &[0xff; 3]]),
                vec![0xff, 0x00, 0xfb, 0xff, 0x02, 0x01, 0x02, 0xff, 0xff, 0xff],
            ),
            (join(&[&[0; 5], &[0xff; 5]]), vec![0xfc, 0x00, 0xfc, 0xff]),
            (vec![0xff; 15], vec![0xf2, 0xff]),
            (join(&[&[0; 128], &[0x80]]), vec![0x81, 0x00, 0x00, 0x80]),
            (join(&[&[0; 129], &[0x80]]), vec![0x81, 0x00, 0x01, 0x00, 0x80]),
            (vec![0xff; 200], vec![0x81, 0xff, 0xb9, 0xff]),
            (
                join(&[&[0xff; 20], &different]),
                join(&[&[0xed, 0xff, 0x7f], &different[..128], &[0x14], &different[128..]]),
            ),
        ];
        for (row, want) in packed {
            assert_eq!(sent(row), (true, want.clone()));
        }
        for row in [&[0xaa][..], &[0xaa, 0xaa], &[1, 2, 3], &[1, 2, 2, 2, 2, 3, 4], &different[..139]] {
            assert_eq!(sent(row), (false, row.to_vec()));
        }
    }

    #[test]
    fn the_plain_example_would_be_eight_bytes_packed() {
        let mut out = [0; 16];
        assert_eq!(pack_into(&[1, 2, 2, 2, 2, 3, 4], &mut out), Some(8));
    }

    #[test]
    fn literals_are_joined_but_never_split_to_fill_up() {
        // 100 changing bytes, then a pair that only starts a new literal, then 40 more: 101 + 41 exceeds 128.
        let mut row: Vec<u8> = (0..100).collect();
        row.push(99);
        row.extend(100..140u8);
        let mut out = [0; 200];
        let length = pack_into(&row, &mut out).unwrap();
        assert_eq!((length, out[0], out[101]), (row.len() + 2, 99, 40));
    }

    #[test]
    fn hostile_headers_are_refused_with_their_position() {
        let mut out = [0; 8];
        let error = |packed: &[u8], out: &mut [u8]| unpack_into(packed, out).unwrap_err();
        assert_eq!(error(&[0xff, 1, 0x80, 2], &mut out), Error { at: 2, kind: ErrorKind::ReservedHeader });
        assert_eq!(error(&[0x00, 1, 0x05, 2], &mut out), Error { at: 2, kind: ErrorKind::CutOff });
        assert_eq!(error(&[0xff], &mut out), Error { at: 0, kind: ErrorKind::CutOff });
        assert_eq!(error(&[0x00, 1, 0x81, 2], &mut out), Error { at: 2, kind: ErrorKind::TooLong });
        assert_eq!(unpack_into(&[], &mut out), Ok(0));
    }

    proptest! {
        #[test]
        fn unpacking_gives_the_row_back(
            row in proptest::collection::vec(prop_oneof![Just(0u8), Just(0xff), any::<u8>()], 0..700),
        ) {
            let mut packed = vec![0; row.len() + row.len() / 2 + 1];
            let length = pack_into(&row, &mut packed).unwrap();
            let packed = &packed[..length];
            let mut back = vec![0; row.len()];
            prop_assert_eq!(unpack_into(packed, &mut back), Ok(row.len()));
            prop_assert_eq!(&back, &row);
            prop_assert_eq!(measure(packed), Ok((row.len(), row.last().copied().unwrap_or(0))));
            prop_assert!(!packed.is_empty() || row.is_empty());
        }

        #[test]
        fn runs_found_eight_bytes_at_a_time_are_those_found_one_by_one(
            row in proptest::collection::vec(prop_oneof![3 => Just(0xffu8), 1 => Just(0), 2 => 0..4u8, 1 => any::<u8>()], 1..300),
        ) {
            let one_by_one = |row: &[u8]| {
                let row = &row[..row.len().min(128)];
                let repeat = row.len() > 1 && row[0] == row[1];
                let end = (1..row.len()).find(|&i| (row[i] == row[i - 1]) != repeat);
                (end.unwrap_or(row.len()), repeat)
            };
            for start in 0..row.len() {
                prop_assert_eq!(segment(&row[start..]), one_by_one(&row[start..]));
            }
        }

        #[test]
        fn measuring_agrees_with_unpacking_on_any_bytes(packed in proptest::collection::vec(any::<u8>(), 0..40)) {
            let mut out = vec![0; 40 * 128];
            let unpacked = unpack_into(&packed, &mut out)
                .map(|n| (n, if n == 0 { 0 } else { out[n - 1] }));
            prop_assert_eq!(measure(&packed), unpacked);
        }
    }
}
