//! Bytes as commands: the exact inverse of [`encode_into`](super::encode::encode_into).
//!
//! [`parse`] reads the start of a slice and returns one command, or how many bytes it needs. It keeps no state, so a
//! stream may arrive in any portions: more bytes never change a result once given.
//!
//! The bytes of each command: `docs/rgl.md`, sections "Setup", "Passes", "Rows" and "End of a job".

use super::command::{Cartridges, Command, Compression, MAX_CARTRIDGES, Media, Mode, PaperCode, Resolution};
use super::encode::{ESC, FF, LAST, MOST_DRIVE, SUB};
use super::fault::{Fault, Refusal};
use crate::ink::Ink;
use heapless::Vec;

/// What is at the start of a slice.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Step<'a> {
    /// A command and its length in bytes.
    Command(Command<'a>, usize),
    /// The beginning of a command; at least this many bytes are needed, counted from its start.
    More(usize),
}

/// Reads the command at the start of `bytes`.
///
/// Errors: the fault and its position in `bytes`. The position is 0 if the command itself is unknown.
pub fn parse(bytes: &[u8]) -> Result<Step<'_>, Refusal> {
    let unknown = Err(Refusal::new(Fault::UnknownCommand, 0));
    match *bytes {
        [] => Ok(Step::More(1)),
        [FF, ..] => done(Command::FormFeed, 1),
        [ESC] => Ok(Step::More(2)),
        [ESC, b'e', ..] => done(Command::Reset, 2),
        [ESC, b'%', 0x80, b'A', ..] => done(Command::SelectRgl, 4),
        [ESC, b'%', 0, b'X', ..] => done(Command::LeaveRgl, 4),
        [ESC, b'%'] | [ESC, b'%', _] => Ok(Step::More(4)),
        [ESC, SUB, first, second, letter, ..] => special(first, second, letter),
        [ESC, SUB, ..] => Ok(Step::More(5)),
        [ESC, b'*', b't', code, b'R', tail, ..] => {
            let resolution = Resolution::from_code(code).ok_or(Refusal::new(Fault::ResolutionCode, 3))?;
            if tail != 0 {
                return Err(Refusal::new(Fault::ResolutionTail, 5));
            }
            done(Command::Resolution(resolution), 6)
        }
        [ESC, b'*', b't'] | [ESC, b'*', b't', _] | [ESC, b'*', b't', _, b'R'] => Ok(Step::More(6)),
        [ESC, b'*', b'r', b'C', ..] => done(Command::RasterEnd, 4),
        [ESC, b'*', b'r', code, b'U', ..] => {
            let mode = Mode::from_code(code).ok_or(Refusal::new(Fault::ModeCode, 3))?;
            done(Command::Mode(mode), 5)
        }
        [ESC, b'*', b'r', 0, b'A', ..] => done(Command::RasterStart, 5),
        [ESC, b'*', b'r'] => Ok(Step::More(4)),
        [ESC, b'*', b'r', _] => Ok(Step::More(5)),
        [ESC, b'*', b'b', low, high, letter, ..] => raster(u16::from_le_bytes([low, high]), letter, bytes),
        [ESC, b'&', b'l', low, high, letter, ..] => page([low, high], letter, bytes),
        [ESC, b'&', b'a', low, high, letter, ..] => {
            let dots = u16::from_le_bytes([low, high]);
            match letter {
                b'M' => done(Command::Width(dots), 6),
                b'L' if dots == 0 => Err(Refusal::new(Fault::ZeroShift, 3)),
                b'L' => done(Command::ShiftX(dots), 6),
                _ => unknown,
            }
        }
        [ESC, b'*' | b'&'] => Ok(Step::More(3)),
        [ESC, b'*', b'b', ..] | [ESC, b'&', b'l' | b'a', ..] => Ok(Step::More(6)),
        _ => unknown,
    }
}

fn done(command: Command<'_>, length: usize) -> Result<Step<'_>, Refusal> {
    Ok(Step::Command(command, length))
}

/// `ESC SUB first second letter`.
fn special<'a>(first: u8, second: u8, letter: u8) -> Result<Step<'a>, Refusal> {
    let command = match letter {
        b'r' => {
            let ink = Ink::from_code(first).ok_or(Refusal::new(Fault::InkCode, 2))?;
            if second != 0 && second != LAST {
                return Err(Refusal::new(Fault::LastPassFlag, 3));
            }
            return done(Command::InkSelect { ink, last: second == LAST }, 5);
        }
        b'L' | b'V' if first == 0 => return Err(Refusal::new(Fault::Adjustment, 2)),
        b'L' => Command::LineFeed(first as i8),
        b'V' if (first as i8).unsigned_abs() > MOST_DRIVE => return Err(Refusal::new(Fault::Adjustment, 2)),
        b'V' => Command::HeadDrive(first as i8),
        b'C' if first > 1 => return Err(Refusal::new(Fault::CurlCode, 2)),
        b'C' => Command::CurlCorrection(first == 0),
        b'O' | FF if first != 0 => return Err(Refusal::new(Fault::Filler, 2)),
        b'O' => Command::BuiltInGloss,
        FF => Command::BackFeed,
        _ => return Err(Refusal::new(Fault::UnknownCommand, 0)),
    };
    if second != 0 {
        return Err(Refusal::new(Fault::Filler, 3));
    }
    done(command, 5)
}

/// `ESC & l low high letter`.
fn page(value: [u8; 2], letter: u8, bytes: &[u8]) -> Result<Step<'_>, Refusal> {
    let number = u16::from_le_bytes(value);
    let command = match letter {
        b'M' => Command::Media(Media::from_code(value).ok_or(Refusal::new(Fault::MediaCode, 3))?),
        b'A' if value[1] != 0 => return Err(Refusal::new(Fault::Filler, 4)),
        b'A' => Command::Paper(PaperCode::from_code(value[0]).ok_or(Refusal::new(Fault::PaperCode, 3))?),
        b'P' => Command::Length(number),
        b'E' if number == 0 => return Err(Refusal::new(Fault::ZeroShift, 3)),
        b'E' => Command::ShiftY(number),
        b'C' => {
            let count = usize::from(number);
            if count == 0 || count > MAX_CARTRIDGES {
                return Err(Refusal::new(Fault::CartridgeCount, 3));
            }
            let Some(barcodes) = bytes.get(6..6 + count) else {
                return Ok(Step::More(6 + count));
            };
            let mut inks = Vec::<Ink, MAX_CARTRIDGES>::new();
            for (i, &barcode) in barcodes.iter().enumerate() {
                let ink = Ink::from_barcode(barcode).ok_or(Refusal::new(Fault::Barcode, 6 + i))?;
                inks.push(ink).map_err(|_| Refusal::new(Fault::CartridgeCount, 3))?;
            }
            let list = Cartridges::new(&inks).ok_or(Refusal::new(Fault::CartridgeCount, 3))?;
            return done(Command::Cartridges(list), 6 + count);
        }
        _ => return Err(Refusal::new(Fault::UnknownCommand, 0)),
    };
    done(command, 6)
}

/// `ESC * b low high letter`.
fn raster(number: u16, letter: u8, bytes: &[u8]) -> Result<Step<'_>, Refusal> {
    match letter {
        b'M' => match number {
            0 => done(Command::Compression(Compression::Plain), 6),
            2 => done(Command::Compression(Compression::Packed), 6),
            _ => Err(Refusal::new(Fault::CompressionCode, 3)),
        },
        b'Y' if number == 0 => Err(Refusal::new(Fault::ZeroSkip, 3)),
        b'Y' => done(Command::Skip(number), 6),
        b'V' | b'W' if number == 0 => Err(Refusal::new(Fault::EmptyRow, 3)),
        b'V' | b'W' => {
            let end = ROW_HEAD + usize::from(number);
            match bytes.get(ROW_HEAD..end) {
                Some(data) => done(Command::Row { last: letter == b'V', data }, end),
                None => Ok(Step::More(end)),
            }
        }
        _ => Err(Refusal::new(Fault::UnknownCommand, 0)),
    }
}

/// Bytes before the data of a row.
pub const ROW_HEAD: usize = 6;

#[cfg(test)]
mod tests {
    extern crate std;

    use super::super::encode::encode_into;
    use super::*;
    use crate::paper::Paper;
    use proptest::prelude::*;
    use std::{vec, vec::Vec};

    /// Every command with every kind of value, rows borrowed from `data`.
    fn commands(data: &[u8], number: u16, ink: Ink) -> Vec<Command<'_>> {
        let mut all = vec![
            Command::Reset,
            Command::SelectRgl,
            Command::Length(number),
            Command::Width(number),
            Command::LineFeed((number as i8).max(1)),
            Command::LineFeed((number as i8).min(-1)),
            Command::HeadDrive((number % 50) as i8 + 1),
            Command::HeadDrive(-((number % 50) as i8) - 1),
            Command::Cartridges(Cartridges::new(&Ink::ALL[..usize::from(number % 7) + 1]).unwrap()),
            Command::ShiftX(number.max(1)),
            Command::ShiftY(number.max(1)),
            Command::BuiltInGloss,
            Command::CurlCorrection(true),
            Command::CurlCorrection(false),
            Command::RasterStart,
            Command::InkSelect { ink, last: true },
            Command::InkSelect { ink, last: false },
            Command::BackFeed,
            Command::Compression(Compression::Plain),
            Command::Compression(Compression::Packed),
            Command::Skip(number.max(1)),
            Command::Row { last: true, data },
            Command::Row { last: false, data },
            Command::RasterEnd,
            Command::FormFeed,
            Command::LeaveRgl,
        ];
        all.extend((0..=255).filter_map(Resolution::from_code).map(Command::Resolution));
        all.extend((0..=255).filter_map(Mode::from_code).map(Command::Mode));
        all.extend((0..=255).filter_map(PaperCode::from_code).map(Command::Paper));
        all.extend(Media::all().map(Command::Media));
        all
    }

    #[test]
    fn commands_have_the_bytes_of_the_documented_example() {
        let bytes = |command: Command<'_>| {
            let mut out = [0; 32];
            let n = encode_into(&command, &mut out).unwrap();
            out[..n].to_vec()
        };
        assert_eq!(bytes(Command::SelectRgl), [0x1b, 0x25, 0x80, 0x41]);
        assert_eq!(bytes(Command::Resolution(Resolution::Dpi600)), [0x1b, 0x2a, 0x74, 0x03, 0x52, 0x00]);
        assert_eq!(bytes(Command::Media(Media::PlainTwice)), [0x1b, 0x26, 0x6c, 0x00, 0x02, 0x4d]);
        assert_eq!(
            bytes(Command::Paper(PaperCode::from_paper(Paper::A4))),
            [0x1b, 0x26, 0x6c, 0x04, 0x00, 0x41]
        );
        assert_eq!(bytes(Command::Length(6372)), [0x1b, 0x26, 0x6c, 0xe4, 0x18, 0x50]);
        assert_eq!(bytes(Command::Width(4800)), [0x1b, 0x26, 0x61, 0xc0, 0x12, 0x4d]);
        assert_eq!(bytes(Command::ShiftX(100)), [0x1b, 0x26, 0x61, 0x64, 0x00, 0x4c]);
        assert_eq!(bytes(Command::ShiftY(200)), [0x1b, 0x26, 0x6c, 0xc8, 0x00, 0x45]);
        assert_eq!(bytes(Command::LineFeed(-1)), [0x1b, 0x1a, 0xff, 0x00, 0x4c]);
        assert_eq!(bytes(Command::CurlCorrection(true)), [0x1b, 0x1a, 0x00, 0x00, 0x43]);
        assert_eq!(bytes(Command::Mode(Mode::ColourPlane)), [0x1b, 0x2a, 0x72, 0x04, 0x55]);
        assert_eq!(bytes(Command::RasterStart), [0x1b, 0x2a, 0x72, 0x00, 0x41]);
        assert_eq!(bytes(Command::InkSelect { ink: Ink::White, last: true }), [0x1b, 0x1a, 0x0b, 0x80, 0x72]);
        assert_eq!(bytes(Command::BackFeed), [0x1b, 0x1a, 0x00, 0x00, 0x0c]);
        assert_eq!(bytes(Command::Skip(40)), [0x1b, 0x2a, 0x62, 0x28, 0x00, 0x59]);
        assert_eq!(bytes(Command::Row { last: false, data: &[7] }), [0x1b, 0x2a, 0x62, 0x01, 0x00, 0x57, 7]);
        let list = Cartridges::new(&[Ink::Cyan, Ink::Magenta, Ink::Yellow, Ink::Black, Ink::Finish]).unwrap();
        assert_eq!(
            bytes(Command::Cartridges(list)),
            [0x1b, 0x26, 0x6c, 0x05, 0x00, 0x43, 0x03, 0x02, 0x01, 0x00, 0x13]
        );
    }

    #[test]
    fn what_would_not_be_read_back_is_not_written() {
        let fault = |command: Command<'_>| encode_into(&command, &mut [0; 16]).unwrap_err();
        for wrong in
            [Command::LineFeed(0), Command::HeadDrive(0), Command::HeadDrive(51), Command::HeadDrive(-128)]
        {
            assert_eq!(fault(wrong), Fault::Adjustment);
        }
        assert_eq!([fault(Command::ShiftX(0)), fault(Command::ShiftY(0))], [Fault::ZeroShift; 2]);
        assert_eq!(fault(Command::Skip(0)), Fault::ZeroSkip);
        assert_eq!(fault(Command::Row { last: true, data: &[] }), Fault::EmptyRow);
        assert_eq!(fault(Command::Row { last: true, data: &[1; 65536] }), Fault::BeyondWidth);
    }

    #[test]
    fn values_this_project_must_not_meet_are_refused_at_their_byte() {
        let refused = |bytes: &[u8]| parse(bytes).map_err(|r| (r.fault, r.at)).unwrap_err();
        assert_eq!(refused(&[0x41]), (Fault::UnknownCommand, 0));
        assert_eq!(refused(&[0x1b, 0x2a, 0x74, 5, 0x52, 0]), (Fault::ResolutionCode, 3));
        assert_eq!(refused(&[0x1b, 0x2a, 0x74, 3, 0x52, 0x1b]), (Fault::ResolutionTail, 5));
        assert_eq!(refused(&[0x1b, 0x26, 0x6c, 0x0a, 0, 0x4d]), (Fault::MediaCode, 3));
        assert_eq!(refused(&[0x1b, 0x26, 0x6c, 7, 0, 0x41]), (Fault::PaperCode, 3));
        assert_eq!(refused(&[0x1b, 0x2a, 0x72, 1, 0x55]), (Fault::ModeCode, 3));
        assert_eq!(refused(&[0x1b, 0x2a, 0x72, 1, 0x41]), (Fault::UnknownCommand, 0));
        for code in [0x0c, 0x0d, 0x19, 0x1a, 0x1b, 0x1c, 0x1d, 0x1e] {
            assert_eq!(refused(&[0x1b, 0x1a, code, 0, 0x72]), (Fault::InkCode, 2));
        }
        assert_eq!(refused(&[0x1b, 0x1a, 0, 1, 0x72]), (Fault::LastPassFlag, 3));
        assert_eq!(refused(&[0x1b, 0x1a, 1, 0, 0x0c]), (Fault::Filler, 2));
        assert_eq!(refused(&[0x1b, 0x1a, 51, 0, 0x56]), (Fault::Adjustment, 2));
        assert_eq!(refused(&[0x1b, 0x26, 0x6c, 8, 0, 0x43]), (Fault::CartridgeCount, 3));
        assert_eq!(refused(&[0x1b, 0x26, 0x6c, 2, 0, 0x43, 3, 99]), (Fault::Barcode, 7));
        assert_eq!(refused(&[0x1b, 0x2a, 0x62, 1, 0, 0x4d]), (Fault::CompressionCode, 3));
        assert_eq!(refused(&[0x1b, 0x2a, 0x62, 0, 0, 0x59]), (Fault::ZeroSkip, 3));
        assert_eq!(refused(&[0x1b, 0x2a, 0x62, 0, 0, 0x57]), (Fault::EmptyRow, 3));
        for vendor_only in [0x49, 0x55, 0x58] {
            assert_eq!(refused(&[0x1b, 0x1a, 0, 0, vendor_only]), (Fault::UnknownCommand, 0));
        }
        assert_eq!(refused(&[0x1b, 0x2a, 0x62, 1, 0, 0x54, 0, 0, 1]), (Fault::UnknownCommand, 0));
    }

    proptest! {
        #[test]
        fn what_is_written_is_read_back_from_any_prefix(
            data in proptest::collection::vec(any::<u8>(), 1..300),
            number in any::<u16>(),
            ink in 0..13usize,
        ) {
            for command in commands(&data, number, Ink::ALL[ink]) {
                let mut out = [0; 320];
                let length = encode_into(&command, &mut out).unwrap();
                // The byte after the command must not matter.
                prop_assert_eq!(parse(&out[..length + 1]), Ok(Step::Command(command, length)));
                for cut in 0..length {
                    match parse(&out[..cut]) {
                        Ok(Step::More(n)) => prop_assert!(n > cut && n <= length, "{:?} at {}", command, cut),
                        other => prop_assert!(false, "{:?} cut to {}: {:?}", command, cut, other),
                    }
                }
                for room in 0..length {
                    prop_assert_eq!(encode_into(&command, &mut out[..room]), Err(Fault::NoRoom));
                }
            }
        }

        #[test]
        fn what_is_read_is_written_back_to_the_same_bytes(
            head in prop_oneof![
                Just(vec![0x1b, 0x26, 0x6c]), Just(vec![0x1b, 0x26, 0x61]), Just(vec![0x1b, 0x1a]),
                Just(vec![0x1b, 0x2a, 0x62]), Just(vec![0x1b, 0x2a, 0x72]), Just(vec![0x1b, 0x2a, 0x74]), Just(vec![]),
            ],
            small in proptest::collection::vec(0..10u8, 2),
            letter in proptest::sample::select(b"MAPLVCEOUrRXYWT\x0c\x00".to_vec()),
            rest in proptest::collection::vec(0..32u8, 0..12),
        ) {
            let bytes = [head, small, vec![letter], rest].concat();
            if let Ok(Step::Command(command, length)) = parse(&bytes) {
                let mut out = [0; 64];
                prop_assert_eq!(encode_into(&command, &mut out), Ok(length));
                prop_assert_eq!(&out[..length], &bytes[..length]);
            }
        }

        #[test]
        fn a_verdict_does_not_change_when_more_bytes_follow(bytes in proptest::collection::vec(
            prop_oneof![Just(0x1bu8), Just(0x1a), Just(0x2a), Just(0x26), Just(0x6c), Just(0x62), Just(0x72), any::<u8>()], 0..12)
        ) {
            let mut last = None;
            for cut in 0..=bytes.len() {
                let now = parse(&bytes[..cut]);
                match now {
                    Ok(Step::More(n)) => prop_assert!(last.is_none() && n > cut),
                    verdict => {
                        if let Some(last) = last { prop_assert_eq!(verdict, last); }
                        last = Some(verdict);
                    }
                }
            }
        }
    }
}
