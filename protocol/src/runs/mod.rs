//! Pass streams: one pass as on/off runs, along the band walk or across the rows.
//!
//! Problem: to a raster coder a halftoned plane looks like noise, because its clusters follow the walk or are cells on a
//! lattice. Sent as packed rows, eight planes of an A4 page are some 25 MB. Along the walk, a plane halftoned along it is
//! a sequence of runs that are never shorter than the minimum cluster; across the rows, cells are runs of whole cells
//! that are the same in several rows.
//!
//! Method: every band of [`Walk`](crate::walk::Walk) is coded on its own, in one of four forms: nothing (blank
//! bands), runs along the walk or across the rows with adaptive Rice codes, or rows packed as the printer packs them. The
//! last ensures that nothing ever costs more than in the printer's own language; and a microcontroller decodes rows in a quarter
//! of the time, so runs have to be half as long. The decoder holds one band (38 KB for
//! 4800 dots), the tables of two tiles (16 KB) and some counters, and takes its input in any portions.
//!
//! Cost: encoding and decoding walk each inked dot once; blank dots are skipped by the run. On eight clustered
//! planes of a full page the streams are a sixth to a seventh of the packed rows
//! (`docs/decisions/pass-streams.md` has the figures, and the codecs that were rejected).
//!
//! Limits: a band is rebuilt from its own bytes alone, so what repeats from band to band is coded again.
//!
//! # Format
//!
//! ```text
//! stream  = { band }, until the bands of the walk are complete
//! band    = 00 count                     count (1..=255) blank bands
//!         | 01 minimum codes             runs
//!         | 02 { row }                   rows, as many as the band is high
//!         | 03 side codes                runs across the rows, side 1..=255
//! row     = 00 count                     count (1..=64) rows like the one above (blank above the first)
//!         | varint(2 * length + 1) data  length bytes of PackBits; length 0: a blank row
//!         | varint(2 * length) data      length (> 0) plain bytes
//! ```
//!
//! Row data end with the last byte that is not zero; what follows is blank. Varints are those of the messages:
//! seven bits to a byte, low bits first, at most two bytes here.
//!
//! *Runs* alternate, off first, from the first dot of the band along the walk to the last. The first run stands as
//! 20 plain bits and may be 0. Every other run is its length less `minimum` as a Rice code with parameter k: the
//! quotient by 2^k as that many ones and a zero, then k bits of remainder; a quotient of 20 or more is 20 ones
//! and 20 plain bits of the whole value instead. Off and on runs each keep a count and a sum (4 and 32 at the
//! start of a band): k is the smallest with count * 2^k >= sum; afterwards the value, at most 8 * 2^k and at most 2^20 of it, is
//! added to the sum and 1 to the count, and at a count of 64 both are halved. A run may be said to be longer than
//! what is left of the band, and is then cut. Bits are filled from the top of each byte; the rest of the last byte
//! is zero.
//!
//! *Runs across* (form 3): a row's kind in two bits, then its runs from left to right, off first, then how many further
//! rows of the band are like it; until the band is complete. The first bit of the kind says that the runs are those of the
//! difference (exclusive or) from the row above, which is blank above the first; the second that they are measured in
//! cells of `side` dots. The first run is measured in dots and may be 0. Every other is its length less 1 (dot or
//! cell). Numbers are Rice codes as above, but with fewer ones: 8 ones and a zero announce 14 plain bits, in a code of
//! cells a run measured in dots, which follows as in a row of the same kind in dots; 9 ones mean all that is left of the
//! row or the band. Each kind has a count and a sum for its first runs (4 and 32), its off and its on runs (4 and 32 in
//! dots, 4 and 8 in cells); the numbers of rows have one pair (4 and 8). A row is complete when it has as many dots as the
//! page is wide, and what would go beyond is cut.
//!
//! # Example
//!
//! A plane of two bands, of which the first is blank, takes its way through a stream. A band of unknown form is a defect:
//!
//! ```
//! use protocol::runs::{self, Decoder, Defect, MAX_BAND, Step};
//! use protocol::walk::Placed;
//!
//! let walk = Placed::whole(128, 128);
//! let mut plane = vec![0; 128 / 8 * 128];
//! plane[16 * 64..].fill(0b1111_0000);
//! let mut stream = Vec::new();
//! runs::encode(&walk, &plane, &mut vec![0; MAX_BAND], |band| stream.extend(band)).unwrap();
//! assert!(stream.len() < 16);
//!
//! let (mut decoder, mut memory) = (Decoder::new(walk), vec![0; runs::band_bytes(128)]);
//! let (read, step) = decoder.step(&stream, &mut memory).unwrap();
//! assert_eq!(step, Step::Blank { y: 0, rows: 64 });
//! let (_, step) = decoder.step(&stream[read..], &mut memory).unwrap();
//! assert_eq!(step, Step::Band { y: 64, rows: 64, reach: 16 });
//! assert_eq!(memory, plane[16 * 64..]);
//!
//! decoder.restart();
//! assert_eq!(decoder.step(&[9], &mut memory), Err(Defect::Form));
//! ```

mod across;
mod bit_writer;
mod canvas;
mod decode;
mod encode;
mod encode_across;
mod header;
mod rice;
mod rows;

pub use decode::{Decoder, Step};
pub use encode::{MAX_BAND, NoRoom, encode};
pub use header::{Header, HeaderError, MAX_HEADER};

/// Bytes of a row of `width` dots.
pub fn stride(width: u16) -> usize {
    usize::from(width).div_ceil(8)
}

/// Bytes of memory for one band of `width` dots across, as [`Decoder::step`] needs it.
pub fn band_bytes(width: u16) -> usize {
    stride(width) * usize::from(crate::walk::EDGE)
}

/// What is wrong with a stream.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Defect {
    /// A band begins with an unknown form.
    Form,
    /// A count of bands or rows is 0 or more than remain, or the side of cells is 0.
    Count,
    /// A row is longer than the page is wide, has dots beyond its width, or ends in the middle of a run.
    Row,
    /// The memory for a band is smaller than [`band_bytes`].
    Memory,
}

/// First byte of a band.
mod form {
    pub const BLANK: u8 = 0;
    pub const RUNS: u8 = 1;
    pub const ROWS: u8 = 2;
    pub const ACROSS: u8 = 3;
}

/// Bytes of the widest row.
const MAX_STRIDE: usize = 1235;

/// Runs that are decoded before others may run: 6 µs each at most on a microcontroller.
const MOST_RUNS: u32 = 64;

/// Bits of the first run and of an escaped one: the largest band has 65535 x 64 dots at most in theory, and
/// 9880 x 64 on this printer.
const PLAIN_BITS: u32 = 20;

#[cfg(test)]
mod tests;
