//! Frames: one message on the wire is `COBS(postcard(message) ‖ CRC-32) ‖ 00`.
//!
//! COBS removes every zero from the frame, so a zero on the wire always ends a frame, and a reader that has lost its
//! place finds it again at the next zero. The checksum is CRC-32/ISO-HDLC (used by Ethernet and zip), little-endian.
//! In frames of at most [`MAX`] bytes it detects every burst of up to 32 bits and every error of up to three bits.
//!
//! Cost: one pass over the bytes on either side, and one buffer of [`MAX`] bytes in the reader.
//!
//! # Example
//!
//! The line damages one of two messages. The reader reports it, and the other arrives:
//!
//! ```
//! use protocol::link::frame::{self, Damage, Read, Reader};
//! use protocol::link::message::{SCHEMA, ToBridge, VERSION};
//!
//! let hello = ToBridge::Hello { version: VERSION, schema: SCHEMA };
//! let mut buffer = [0; frame::MAX];
//! let length = frame::write(&hello, &mut buffer).unwrap();
//! // A zero first ends whatever the line held before.
//! let mut line = [&[0], &buffer[..length], &buffer[..length]].concat();
//! line[3] ^= 0x20;
//!
//! let mut reader = Reader::new();
//! let Read::Damaged(Damage::Checksum, rest) = reader.read(&line) else { panic!() };
//! let Read::Message(message, rest) = reader.read(rest) else { panic!() };
//! assert_eq!(frame::decode(message), Ok(hello));
//! assert_eq!(reader.read(rest), Read::More);
//! ```

use crc::{CRC_32_ISO_HDLC, Crc, Table};
use heapless::Vec;
use postcard::ser_flavors::crc::CrcModifier;
use postcard::ser_flavors::{Cobs, Slice};
use serde::{Deserialize, Serialize};

/// The longest frame, with its closing zero.
pub const MAX: usize = 1024;

/// The longest message inside a frame: what [`MAX`] leaves after the zero, COBS's one byte in 254 and the checksum.
pub const MAX_MESSAGE: usize = MAX - 1 - (MAX - 1).div_ceil(255) - CHECKSUM;

const CHECKSUM: usize = 4;

/// A kilobyte of table, shared by every reader and writer.
static CRC: Crc<u32, Table<1>> = Crc::<u32, Table<1>>::new(&CRC_32_ISO_HDLC);

/// CRC-32/ISO-HDLC, as in the frames. Also used to tell two job files apart.
pub fn checksum(bytes: &[u8]) -> u32 {
    CRC.checksum(bytes)
}

/// Why a message could not be written.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct TooLong;

/// Writes one frame to the beginning of `buffer` and returns its length. A buffer of [`MAX`] bytes is enough
/// for every message that fits a frame.
pub fn write<T: Serialize + ?Sized>(message: &T, buffer: &mut [u8]) -> Result<usize, TooLong> {
    let room = buffer.len().min(MAX);
    let slice = Cobs::try_new(Slice::new(&mut buffer[..room])).map_err(|_| TooLong)?;
    let writer = CrcModifier::new(slice, CRC.digest());
    postcard::serialize_with_flavor(message, writer).map(|frame: &mut [u8]| frame.len()).map_err(|_| TooLong)
}

/// What is wrong with bytes that should have been a frame.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Damage {
    /// More than [`MAX`] bytes without a zero.
    TooLong,
    /// Not COBS.
    Coding,
    /// Too short to hold a checksum, or the checksum differs.
    Checksum,
}

/// The result of reading some bytes. Every case returns the input that is still unread.
#[derive(PartialEq, Eq, Debug)]
pub enum Read<'r, 'i> {
    /// All of the input was read and no frame has ended.
    More,
    /// A frame: the message's bytes without the checksum.
    Message(&'r [u8], &'i [u8]),
    /// A damaged frame was dropped; reading continues after its end.
    Damaged(Damage, &'i [u8]),
}

/// Finds frames in bytes that arrive in any portions.
///
/// Bytes before the first zero may be the rest of an older conversation; if they are no frame they are skipped without
/// a report.
pub struct Reader {
    /// The frame under way without its closing zero; after it has ended, the message in it.
    buffer: Vec<u8, { MAX - 1 }>,
    state: State,
    /// Whether the end of a frame has been seen, so that what follows should be a frame.
    synchronised: bool,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum State {
    /// The buffer holds what has come of the frame under way.
    Filling,
    /// The frame under way is longer than the buffer: skip to its end.
    Overlong,
    /// The buffer holds a frame that has ended.
    Ended,
}

impl Default for Reader {
    fn default() -> Self {
        Self::new()
    }
}

impl Reader {
    /// A reader that has seen nothing.
    pub const fn new() -> Self {
        Reader { buffer: Vec::new(), state: State::Filling, synchronised: false }
    }

    /// Forgets a frame under way: the link was cut and starts again.
    pub fn reset(&mut self) {
        self.buffer.clear();
        self.state = State::Filling;
        self.synchronised = false;
    }

    /// Reads up to the end of one frame. Call again with the unread rest until [`Read::More`].
    pub fn read<'r, 'i>(&'r mut self, mut input: &'i [u8]) -> Read<'r, 'i> {
        loop {
            let Some(end) = input.iter().position(|&byte| byte == 0) else {
                self.keep(input);
                return Read::More;
            };
            self.keep(&input[..end]);
            input = &input[end + 1..];
            let overlong = self.state == State::Overlong;
            let synchronised = core::mem::replace(&mut self.synchronised, true);
            self.state = State::Ended;
            if self.buffer.is_empty() && !overlong {
                // A sender may write extra zeros to be understood after a cut.
                continue;
            }
            let found = if overlong { Err(Damage::TooLong) } else { self.open() };
            match found {
                Ok(()) => return Read::Message(&self.buffer, input),
                Err(damage) if synchronised => return Read::Damaged(damage, input),
                Err(_) => continue,
            }
        }
    }

    fn keep(&mut self, bytes: &[u8]) {
        if self.state == State::Ended {
            self.buffer.clear();
            self.state = State::Filling;
        }
        // The closing zero is not kept, so the longest frame fills the buffer.
        if self.state == State::Filling && self.buffer.extend_from_slice(bytes).is_err() {
            self.state = State::Overlong;
        }
    }

    /// Undoes COBS in place, checks, and leaves the message in the buffer.
    fn open(&mut self) -> Result<(), Damage> {
        let length = cobs::decode_in_place(&mut self.buffer).map_err(|_| Damage::Coding)?;
        self.buffer.truncate(length);
        let (message, sum) = self.buffer.split_last_chunk::<CHECKSUM>().ok_or(Damage::Checksum)?;
        if CRC.checksum(message).to_le_bytes() != *sum {
            return Err(Damage::Checksum);
        }
        self.buffer.truncate(length - CHECKSUM);
        Ok(())
    }
}

/// An undamaged message was not understood: this version does not know its kind or the value of a field, or the message
/// is longer than its kind.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Unknown;

/// The message in the bytes of [`Read::Message`]; borrows from them.
pub fn decode<'a, T: Deserialize<'a>>(message: &'a [u8]) -> Result<T, Unknown> {
    match postcard::take_from_bytes(message) {
        Ok((value, [])) => Ok(value),
        _ => Err(Unknown),
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use proptest::prelude::*;
    use std::{vec, vec::Vec};

    fn framed(message: &[u8]) -> Vec<u8> {
        let mut buffer = [0; MAX];
        let length = write(message, &mut buffer).unwrap();
        buffer[..length].to_vec()
    }

    /// Every message and every kind of damage in `bytes`, read in pieces of the given sizes.
    fn read_all(bytes: &[u8], mut sizes: impl Iterator<Item = usize>) -> Vec<Result<Vec<u8>, Damage>> {
        let mut reader = Reader::new();
        let mut found = Vec::new();
        let mut left = bytes;
        while !left.is_empty() {
            let (mut piece, rest) = left.split_at(sizes.next().unwrap_or(usize::MAX).clamp(1, left.len()));
            left = rest;
            loop {
                match reader.read(piece) {
                    Read::More => break,
                    Read::Message(message, rest) => {
                        found.push(Ok(decode::<&[u8]>(message).unwrap().to_vec()));
                        piece = rest;
                    }
                    Read::Damaged(damage, rest) => {
                        found.push(Err(damage));
                        piece = rest;
                    }
                }
            }
        }
        found
    }

    /// COBS by its definition: each block is a length byte and that many bytes less one without a zero; a
    /// block of 254 bytes stands for no zero behind it, so an empty one follows, at the very end too.
    fn cobs_by_definition(bytes: &[u8]) -> Vec<u8> {
        let mut coded = Vec::new();
        let parts: Vec<&[u8]> = bytes.split(|&byte| byte == 0).collect();
        for part in parts {
            let mut blocks = part.chunks(254).peekable();
            if part.is_empty() {
                coded.push(1);
            }
            while let Some(block) = blocks.next() {
                coded.push(block.len() as u8 + 1);
                coded.extend(block);
                if block.len() == 254 && blocks.peek().is_none() {
                    coded.push(1);
                }
            }
        }
        coded
    }

    /// CRC-32 bit by bit.
    fn crc_by_definition(bytes: &[u8]) -> u32 {
        !bytes.iter().fold(!0u32, |crc, &byte| {
            (0..8).fold(crc ^ u32::from(byte), |crc, _| {
                (crc >> 1) ^ (0xedb8_8320 & (0u32.wrapping_sub(crc & 1)))
            })
        })
    }

    #[test]
    fn the_longest_message_makes_the_longest_frame_and_one_byte_more_is_refused() {
        // postcard puts the length of a slice in two bytes here.
        let longest = vec![7u8; MAX_MESSAGE - 2];
        assert_eq!(framed(&longest).len(), MAX);
        assert_eq!(read_all(&framed(&longest), core::iter::empty()), [Ok(longest.clone())]);
        let mut buffer = [0; 2 * MAX];
        assert_eq!(write(&[7u8; MAX_MESSAGE - 1][..], &mut buffer), Err(TooLong));
        assert_eq!(write(&longest[..], &mut buffer[..MAX - 1]), Err(TooLong));
    }

    /// The link was cut in the middle of a frame that was too long: the first frame of the next one is read.
    #[test]
    fn after_a_reset_nothing_is_left_of_an_overlong_frame() {
        let mut reader = Reader::new();
        assert_eq!(reader.read(&[&[0][..], &[7; MAX + 1]].concat()), Read::More);
        reader.reset();
        let frame = framed(b"after");
        assert!(
            matches!(reader.read(&frame), Read::Message(message, []) if decode::<&[u8]>(message) == Ok(b"after"))
        );
    }

    #[test]
    fn an_overlong_frame_is_reported_once_and_the_next_one_is_read() {
        let mut bytes = framed(b"before");
        bytes.extend(vec![1; 5 * MAX]);
        bytes.push(0);
        bytes.extend(framed(b"after"));
        let expected = [Ok(b"before".to_vec()), Err(Damage::TooLong), Ok(b"after".to_vec())];
        assert_eq!(read_all(&bytes, core::iter::empty()), expected);
        assert_eq!(read_all(&bytes, core::iter::repeat(1)), expected);
    }

    #[test]
    fn rubbish_before_the_first_zero_is_not_an_error() {
        let mut bytes = b"login: \xff\x31".to_vec();
        bytes.push(0);
        bytes.extend(framed(b"hello"));
        assert_eq!(read_all(&bytes, core::iter::empty()), [Ok(b"hello".to_vec())]);
    }

    #[test]
    fn a_first_frame_needs_no_zero_before_it() {
        assert_eq!(read_all(&framed(b"hello"), core::iter::empty()), [Ok(b"hello".to_vec())]);
    }

    proptest! {
        #[test]
        fn a_frame_is_cobs_of_message_and_checksum_and_a_zero(message in prop::collection::vec(any::<u8>(), 0..=1000)) {
            let mut body = [0; MAX];
            let length = postcard::to_slice(&message[..], &mut body).unwrap().len();
            let mut body = body[..length].to_vec();
            body.extend(crc_by_definition(&body).to_le_bytes());
            let mut expected = cobs_by_definition(&body);
            expected.push(0);
            prop_assert_eq!(framed(&message), expected);
        }

        #[test]
        fn portions_do_not_matter(
            messages in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..300), 1..8),
            sizes in prop::collection::vec(1usize..70, 1..40),
        ) {
            let bytes: Vec<u8> = messages.iter().flat_map(|message| framed(message)).collect();
            let expected: Vec<_> = messages.into_iter().map(Ok).collect();
            prop_assert_eq!(&read_all(&bytes, sizes.into_iter().cycle()), &expected);
            prop_assert_eq!(&read_all(&bytes, core::iter::repeat(1)), &expected);
        }

        #[test]
        fn a_flipped_bit_costs_at_most_the_frames_it_touches(
            messages in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..300), 3..6),
            position in any::<prop::sample::Index>(),
            bit in 0u8..8,
        ) {
            let frames: Vec<Vec<u8>> = messages.iter().map(|message| framed(message)).collect();
            let mut bytes = frames.concat();
            let at = position.index(bytes.len());
            bytes[at] ^= 1 << bit;
            let found: Vec<_> = read_all(&bytes, core::iter::empty()).into_iter().flatten().collect();
            // A flip inside a frame loses it; a flip of a closing zero joins two frames and loses both.
            prop_assert!(found.len() + 2 >= messages.len());
            let mut left = messages.iter();
            for message in &found {
                prop_assert!(left.any(|sent| sent == message), "a message that nobody sent");
            }
        }

        #[test]
        fn no_bytes_make_the_reader_fail(bytes in prop::collection::vec(any::<u8>(), 0..4000)) {
            let mut reader = Reader::new();
            let mut left = &bytes[..];
            loop {
                match reader.read(left) {
                    Read::More => break,
                    Read::Message(_, rest) | Read::Damaged(_, rest) => {
                        prop_assert!(rest.len() < left.len());
                        left = rest;
                    }
                }
            }
        }
    }
}
