//! The figures of a stream: its setup, its passes, its first fault.

use protocol::ink::Ink;
use protocol::rgl::{Fault, Mode};
use serde::Serialize;

use crate::job::fault::words;
use crate::separate::Pass;
use sheet::Plane;

/// The figures of a stream. Offsets are in bytes from its start; dots and rows are at the job's resolution.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Inspection {
    /// Length of the stream.
    pub bytes: u64,
    /// `Ghostscript` for the dialect of its drivers; `None` for ours, which is that of the established open driver.
    pub dialect: Option<&'static str>,
    /// Whether it is one complete legal job.
    pub complete: bool,
    /// What the setup declares.
    pub setup: Setup,
    /// The passes in the order of printing, including empty ones.
    pub passes: Vec<PassReport>,
    /// The first fault.
    pub error: Option<StreamError>,
}

/// What a setup declares; missing declarations are `None`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Setup {
    /// Dots per inch across and along.
    pub resolution: Option<(u16, u16)>,
    /// Media type.
    pub media: Option<&'static str>,
    /// Paper, by its code and declared size.
    pub paper: Option<&'static str>,
    /// Page width in dots.
    pub width: u16,
    /// Page length in rows.
    pub length: u16,
    /// Shift to the right in dots.
    pub shift_x: u16,
    /// Shift downwards in rows.
    pub shift_y: u16,
    /// Whether curl is corrected.
    pub curl_correction: Option<bool>,
    /// Whether the printer's built-in gloss is requested.
    pub built_in_gloss: bool,
    /// Transfer mode: `blackRaster`, `colourPlane` or `multiPlane`.
    pub mode: Option<&'static str>,
    /// Names of the inks in the cartridge list.
    pub cartridges: Option<Vec<&'static str>>,
}

/// The figures of one pass.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PassReport {
    /// From 1.
    pub number: usize,
    /// Name of the ink.
    pub ink: &'static str,
    /// Its code in the stream.
    pub code: u8,
    /// The barcode of its cartridge.
    pub barcode: u8,
    /// The part number of its cartridge.
    pub cartridge: &'static str,
    /// Whether it was announced as the last.
    pub last: bool,
    /// Dots printed.
    pub dots: u64,
    /// The smallest rectangle around them, including the shift; `None` for an empty pass.
    pub bounds: Option<Bounds>,
    /// Rows sent.
    pub rows: u32,
    /// Packed rows among them.
    pub packed_rows: u32,
    /// Plain rows among them.
    pub plain_rows: u32,
    /// Offset of its first byte.
    pub offset: u64,
    /// Its length in bytes.
    pub bytes: u64,
}

impl PassReport {
    /// A pass that has just begun, at offset `at`.
    pub(super) fn begin(number: usize, ink: Ink, last: bool, at: usize) -> PassReport {
        PassReport {
            number,
            ink: ink.name(),
            code: ink.code(),
            barcode: ink.barcode(),
            cartridge: ink.part(),
            last,
            dots: 0,
            bounds: None,
            rows: 0,
            packed_rows: 0,
            plain_rows: 0,
            offset: at as u64,
            bytes: 0,
        }
    }
}

/// A rectangle of dots inside the printable area.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Bounds {
    /// First column.
    pub x: usize,
    /// First row.
    pub y: usize,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// The same in mm from the top left corner of the printable area: x, y, width, height.
    pub mm: [f64; 4],
}

/// The first fault of a stream.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, thiserror::Error)]
#[error("byte {offset}: {words}")]
pub struct StreamError {
    /// Offset of the byte.
    pub offset: u64,
    /// The fault's number.
    pub fault: u8,
    /// The fault in words.
    pub words: &'static str,
}

/// An inspected stream: its figures, and the dots of each pass.
#[derive(Clone, Debug)]
pub struct Inspected {
    /// The figures.
    pub inspection: Inspection,
    /// One pass for each of [`Inspection::passes`]; planes cover the printable area, with shifts applied.
    pub passes: Vec<Pass>,
}

impl Inspected {
    pub(super) fn of(
        stream: &[u8],
        dialect: Option<&'static str>,
        setup: Setup,
        (reports, passes): (Vec<PassReport>, Vec<Pass>),
        fault: Option<(Fault, usize)>,
    ) -> Inspected {
        let error = fault.map(|(fault, offset)| StreamError {
            offset: offset as u64,
            fault: fault.number(),
            words: words(fault),
        });
        let bytes = stream.len() as u64;
        let complete = error.is_none();
        let inspection = Inspection { bytes, dialect, complete, setup, passes: reports, error };
        Inspected { inspection, passes }
    }
}

/// The name of a transfer mode.
pub(super) fn mode_name(mode: Mode) -> &'static str {
    match mode {
        Mode::BlackRaster => "blackRaster",
        Mode::ColourPlane => "colourPlane",
        Mode::MultiPlane => "multiPlane",
    }
}

/// The number of dots of a plane and the rectangle around them.
pub(super) fn measure(plane: &Plane, dpi: (u16, u16)) -> (u64, Option<Bounds>) {
    let mut columns = vec![0u8; plane.stride];
    let (mut dots, mut first, mut last) = (0, None, 0);
    for (y, row) in plane.bits.chunks_exact(plane.stride).enumerate() {
        let in_row: u64 = row.iter().map(|byte| u64::from(byte.count_ones())).sum();
        if in_row > 0 {
            dots += in_row;
            first.get_or_insert(y);
            last = y;
            columns.iter_mut().zip(row).for_each(|(column, byte)| *column |= byte);
        }
    }
    let bounds = first.and_then(|y| {
        let left = columns.iter().position(|&byte| byte != 0)?;
        let right = columns.iter().rposition(|&byte| byte != 0)?;
        let x = left * 8 + columns[left].leading_zeros() as usize;
        let end = right * 8 + 8 - columns[right].trailing_zeros() as usize;
        let (width, height) = (end - x, last + 1 - y);
        let across = |dots: usize| dots as f64 * 25.4 / f64::from(dpi.0);
        let along = |rows: usize| rows as f64 * 25.4 / f64::from(dpi.1);
        Some(Bounds { x, y, width, height, mm: [across(x), along(y), across(width), along(height)] })
    });
    (dots, bounds)
}
