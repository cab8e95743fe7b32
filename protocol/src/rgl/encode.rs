//! One command as bytes.
//!
//! The bytes of each command: `docs/rgl.md`, sections "Setup", "Passes", "Rows" and "End of a job".

use super::command::{Command, Compression};
use super::fault::Fault;

pub(super) const ESC: u8 = 0x1b;
pub(super) const SUB: u8 = 0x1a;
pub(super) const FF: u8 = 0x0c;
/// The flag of the last pass's ink-select.
pub(super) const LAST: u8 = 0x80;
/// The largest adjustment of the print head's drive, in either direction.
pub(super) const MOST_DRIVE: u8 = 50;

/// Writes a command to the start of `out` and returns its length.
///
/// Errors: [`Fault::NoRoom`]; for what [`parse`](super::parse::parse) would refuse, [`Fault::Adjustment`],
/// [`Fault::ZeroShift`], [`Fault::ZeroSkip`] and [`Fault::EmptyRow`]; [`Fault::BeyondWidth`] for a row of more than 65535
/// bytes.
pub fn encode_into(command: &Command<'_>, out: &mut [u8]) -> Result<usize, Fault> {
    let value = |letters: [u8; 2], value: u16, end: u8| {
        let [low, high] = value.to_le_bytes();
        [ESC, letters[0], letters[1], low, high, end]
    };
    let adjust = |value: u8, end: u8| [ESC, SUB, value, 0, end];
    match *command {
        Command::Reset => put(out, &[ESC, b'e'], &[]),
        Command::SelectRgl => put(out, &[ESC, b'%', 0x80, b'A'], &[]),
        // The driver sends one byte too many here, and so does every stream the hardware has printed.
        Command::Resolution(r) => put(out, &[ESC, b'*', b't', r.code(), b'R', 0], &[]),
        Command::Media(media) => put(out, &value(*b"&l", u16::from_le_bytes(media.code()), b'M'), &[]),
        Command::Paper(paper) => put(out, &value(*b"&l", paper.code().into(), b'A'), &[]),
        Command::Length(rows) => put(out, &value(*b"&l", rows, b'P'), &[]),
        Command::Width(dots) => put(out, &value(*b"&a", dots, b'M'), &[]),
        Command::LineFeed(0) | Command::HeadDrive(0) => Err(Fault::Adjustment),
        Command::HeadDrive(by) if by.unsigned_abs() > MOST_DRIVE => Err(Fault::Adjustment),
        Command::ShiftX(0) | Command::ShiftY(0) => Err(Fault::ZeroShift),
        Command::Skip(0) => Err(Fault::ZeroSkip),
        Command::LineFeed(by) => put(out, &adjust(by as u8, b'L'), &[]),
        Command::HeadDrive(by) => put(out, &adjust(by as u8, b'V'), &[]),
        Command::Cartridges(list) => {
            let mut barcodes = [0; super::command::MAX_CARTRIDGES];
            for (place, ink) in barcodes.iter_mut().zip(list.inks()) {
                *place = ink.barcode();
            }
            let count = list.inks().len();
            #[expect(clippy::cast_possible_truncation, reason = "at most seven")]
            let number = count as u16;
            put(out, &value(*b"&l", number, b'C'), &barcodes[..count])
        }
        Command::ShiftX(dots) => put(out, &value(*b"&a", dots, b'L'), &[]),
        Command::ShiftY(rows) => put(out, &value(*b"&l", rows, b'E'), &[]),
        Command::BuiltInGloss => put(out, &adjust(0, b'O'), &[]),
        Command::CurlCorrection(on) => put(out, &adjust(u8::from(!on), b'C'), &[]),
        Command::Mode(mode) => put(out, &[ESC, b'*', b'r', mode.code(), b'U'], &[]),
        Command::RasterStart => put(out, &[ESC, b'*', b'r', 0, b'A'], &[]),
        Command::InkSelect { ink, last } => {
            put(out, &[ESC, SUB, ink.code(), if last { LAST } else { 0 }, b'r'], &[])
        }
        Command::BackFeed => put(out, &adjust(0, FF), &[]),
        Command::Compression(Compression::Plain) => put(out, &value(*b"*b", 0, b'M'), &[]),
        Command::Compression(Compression::Packed) => put(out, &value(*b"*b", 2, b'M'), &[]),
        Command::Skip(rows) => put(out, &value(*b"*b", rows, b'Y'), &[]),
        Command::Row { data: [], .. } => Err(Fault::EmptyRow),
        Command::Row { last, data } => {
            let length = u16::try_from(data.len()).map_err(|_| Fault::BeyondWidth)?;
            put(out, &value(*b"*b", length, if last { b'V' } else { b'W' }), data)
        }
        Command::RasterEnd => put(out, &[ESC, b'*', b'r', b'C'], &[]),
        Command::FormFeed => put(out, &[FF], &[]),
        Command::LeaveRgl => put(out, &[ESC, b'%', 0, b'X'], &[]),
    }
}

fn put(out: &mut [u8], head: &[u8], data: &[u8]) -> Result<usize, Fault> {
    let length = head.len() + data.len();
    let place = out.get_mut(..length).ok_or(Fault::NoRoom)?;
    place[..head.len()].copy_from_slice(head);
    place[head.len()..].copy_from_slice(data);
    Ok(length)
}
