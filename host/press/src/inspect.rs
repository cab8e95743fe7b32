//! What is in a stream: its setup, its passes, its faults.
//!
//! Method: the strict reader, without a printer: whatever the cassettes and the sheet, the bytes alone are looked at.
//! What was read before a fault is reported with it.
//! Cost: one look at each byte, one bit for each dot and pass.
//! The dialect of Ghostscript's drivers is read too, leniently.

mod ending;
mod ghostscript;

use std::ops::Range;

pub use ending::ending;

use protocol::ink::Ink;
use protocol::rgl::{Command, Compression, Fault, Mode, Order, Step, parse};
use serde::Serialize;

use crate::job::fault::words;
use crate::separate::{Pass, Plane};
use crate::simulate::Canvas;
use observe::Observer;

/// A stream in figures. Offsets are in bytes from its start; dots and rows at the job's resolution.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Inspection {
    /// Length of the stream.
    pub bytes: u64,
    /// Whose dialect it is, if not that of the established open driver, which is ours: `Ghostscript`.
    pub dialect: Option<&'static str>,
    /// Whether it is one whole legal job.
    pub complete: bool,
    /// What the setup declares; parts that did not come are absent.
    pub setup: Setup,
    /// The passes in the order of printing, empty ones too.
    pub passes: Vec<PassReport>,
    /// The first fault.
    pub error: Option<StreamError>,
}

/// What a setup declares.
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
    /// Whether the machine's own gloss is asked for.
    pub built_in_gloss: bool,
    /// Transfer mode: `blackRaster`, `colourPlane` or `multiPlane`.
    pub mode: Option<&'static str>,
    /// Cassette list, inks by name.
    pub cassettes: Option<Vec<&'static str>>,
}

/// One pass in figures.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PassReport {
    /// From 1.
    pub number: usize,
    /// Name of the ink.
    pub ink: &'static str,
    /// Its code in the stream.
    pub code: u8,
    /// The barcode on its cassette.
    pub barcode: u8,
    /// The cassette's part number.
    pub cartridge: &'static str,
    /// Whether it was announced as the last.
    pub last: bool,
    /// Dots printed.
    pub dots: u64,
    /// The smallest rectangle around them, shift included; absent in an empty pass.
    pub bounds: Option<Bounds>,
    /// Rows sent.
    pub rows: u32,
    /// Of these, packed.
    pub packed_rows: u32,
    /// Of these, plain.
    pub plain_rows: u32,
    /// Offset of its first byte.
    pub offset: u64,
    /// Its length in bytes.
    pub bytes: u64,
}

impl PassReport {
    /// A pass of which nothing has come but its beginning, at offset `at`.
    fn begin(number: usize, ink: Ink, last: bool, at: usize) -> PassReport {
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

/// A rectangle of dots inside the printable area, and its place on paper.
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
    /// The same from the left edge of the printable area, in mm: x, y, width, height.
    pub mm: [f64; 4],
}

/// Where and why a stream is no legal job.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, thiserror::Error)]
#[error("byte {offset}: {words} (fault {fault})")]
pub struct StreamError {
    /// The byte.
    pub offset: u64,
    /// The fault's number.
    pub fault: u8,
    /// The fault in words.
    pub words: &'static str,
}

/// A stream looked at: figures, and the dots of each pass.
#[derive(Clone, Debug)]
pub struct Inspected {
    /// The figures.
    pub inspection: Inspection,
    /// The passes, one for each in [`Inspection::passes`]; planes cover the printable area, shifts applied.
    pub passes: Vec<Pass>,
}

/// A pass being read.
struct Open {
    report: PassReport,
    canvas: Canvas,
}

/// Where the sheets of a stream stand: several jobs may follow one another, as a driver writes the pages of a document.
///
/// A stream that is no job, or whose last job does not end, is in the result all the same; only [`inspect`] judges.
pub fn sheets(stream: &[u8]) -> Vec<Range<usize>> {
    let mut sheets = Vec::new();
    let mut at = 0;
    while at < stream.len() || sheets.is_empty() {
        let rest = &stream[at..];
        let length =
            if ghostscript::begins(rest) { ghostscript::first_sheet(rest) } else { first_sheet(rest) };
        let end = at + length.unwrap_or(rest.len());
        sheets.push(at..end);
        at = end;
    }
    sheets
}

/// The length of the first job, its final reset included.
fn first_sheet(stream: &[u8]) -> Option<usize> {
    let mut at = 0;
    let mut left = false;
    loop {
        match parse(stream.get(at..)?) {
            Ok(Step::Command(Command::Reset, length)) if left => return Some(at + length),
            _ if left => return Some(at),
            Ok(Step::Command(command, length)) => {
                left = command == Command::LeaveRgl;
                at += length;
            }
            _ => return None,
        }
    }
}

/// Looks at a stream. It never fails: what is wrong is part of the result.
pub fn inspect(stream: &[u8], observer: &dyn Observer) -> Inspected {
    if ghostscript::begins(stream) {
        return ghostscript::inspect(stream, observer);
    }
    observer.begin("inspect", stream.len() as u64);
    let mut reader = Reader { order: Order::new(), open: None, reports: Vec::new(), passes: Vec::new() };
    let (mut at, mut reported) = (0, 0);
    let fault = loop {
        if at == stream.len() {
            break (!reader.order.is_complete()).then_some((Fault::Truncated, at));
        }
        match parse(&stream[at..]) {
            Ok(Step::Command(command, length)) => {
                if let Err(refusal) = reader.order.accept(&command) {
                    break Some((refusal.fault, at + refusal.at));
                }
                reader.take(&command, at, length);
                at += length;
            }
            Ok(Step::More(_)) => break Some((Fault::Truncated, stream.len())),
            Err(refusal) => break Some((refusal.fault, at + refusal.at)),
        }
        if at - reported >= 1 << 16 {
            observer.advance((at - reported) as u64);
            reported = at;
        }
    };
    reader.close(at);
    observer.end();
    let setup = setup(&reader.order);
    Inspected::of(stream, None, setup, (reader.reports, reader.passes), fault)
}

impl Inspected {
    fn of(
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

struct Reader {
    order: Order,
    open: Option<Open>,
    reports: Vec<PassReport>,
    passes: Vec<Pass>,
}

impl Reader {
    /// A legal command at offset `at`.
    fn take(&mut self, command: &Command<'_>, at: usize, length: usize) {
        match *command {
            Command::InkSelect { ink, last } => self.begin(ink, last, at),
            Command::RasterStart if self.order.declared().mode == Some(Mode::BlackRaster) => {
                self.begin(Ink::Black, true, at + length);
            }
            Command::Row { data, .. } => {
                if let Some(open) = &mut self.open {
                    let compression = self.order.compression();
                    open.canvas.put(self.order.row(), compression, data);
                    open.report.rows += 1;
                    match compression {
                        Some(Compression::Packed) => open.report.packed_rows += 1,
                        _ => open.report.plain_rows += 1,
                    }
                }
            }
            Command::BackFeed | Command::RasterEnd => self.close(at),
            _ => {}
        }
    }

    fn begin(&mut self, ink: Ink, last: bool, at: usize) {
        let declared = self.order.declared();
        let shift = (declared.shift_x.into(), declared.shift_y.into());
        let canvas = Canvas::new(declared.width.into(), declared.length.into(), shift, usize::MAX, 1);
        let report = PassReport::begin(self.reports.len() + 1, ink, last, at);
        self.open = Some(Open { report, canvas });
    }

    fn close(&mut self, at: usize) {
        let Some(Open { mut report, canvas }) = self.open.take() else { return };
        let plane = canvas.into_plane();
        let dpi = self.order.declared().resolution.unwrap_or_default().dpi();
        (report.dots, report.bounds) = measure(&plane, dpi);
        report.bytes = at as u64 - report.offset;
        // The order knows the ink; the report only its name.
        self.passes.push(Pass { ink: self.order.ink(), plane });
        self.reports.push(report);
    }
}

fn setup(order: &Order) -> Setup {
    let declared = order.declared();
    let dpi = declared.resolution.map(|resolution| resolution.dpi());
    let paper = declared.paper.zip(dpi).map(|(code, (across, along))| {
        let width = u32::from(declared.width) * 600 / u32::from(across);
        let length = u32::from(declared.length) * 600 / u32::from(along);
        code.paper(width as u16, length as u16).name()
    });
    Setup {
        resolution: dpi,
        media: declared.media.map(|media| media.name()),
        paper,
        width: declared.width,
        length: declared.length,
        shift_x: declared.shift_x,
        shift_y: declared.shift_y,
        curl_correction: declared.curl,
        built_in_gloss: declared.gloss,
        mode: declared.mode.map(mode_name),
        cassettes: declared.cartridges.map(|list| list.inks().iter().map(|ink| ink.name()).collect()),
    }
}

fn mode_name(mode: Mode) -> &'static str {
    match mode {
        Mode::BlackRaster => "blackRaster",
        Mode::ColourPlane => "colourPlane",
        Mode::MultiPlane => "multiPlane",
    }
}

/// Dots of a plane and the rectangle around them.
fn measure(plane: &Plane, dpi: (u16, u16)) -> (u64, Option<Bounds>) {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::stream::write_job;
    use observe::Silent;
    use protocol::paper::Paper;
    use protocol::rgl::{Media, Page};

    const PAPER: Paper = Paper::Custom { width: 600, length: 300 };

    /// A rectangle of ink with its corners at (x, y) and (x + w, y + h).
    fn pass(ink: Ink, x: usize, y: usize, w: usize, h: usize) -> Pass {
        let mut bits = vec![0; 75 * 300];
        for row in y..y + h {
            for column in x..x + w {
                bits[row * 75 + column / 8] |= 0x80 >> (column % 8);
            }
        }
        Pass { ink, plane: Plane { width: 600, length: 300, stride: 75, bits } }
    }

    fn job(page: Page, passes: &[Pass]) -> Vec<u8> {
        let mut bytes = vec![];
        write_job(page, None, passes, &mut bytes, &Silent).unwrap();
        bytes
    }

    #[test]
    fn figures_are_those_of_the_rectangles_that_were_printed() {
        let passes = [pass(Ink::White, 30, 40, 101, 53), pass(Ink::Cyan, 7, 299, 1, 1)];
        let page = Page { shift_x: 6, media: Media::Cardboard, curl_correction: false, ..Page::plain(PAPER) };
        let bytes = job(page, &passes);
        let Inspected { inspection, passes: planes } = inspect(&bytes, &Silent);
        assert!(inspection.complete && inspection.error.is_none());
        let setup = &inspection.setup;
        assert_eq!(
            (setup.resolution, setup.media, setup.paper),
            (Some((600, 600)), Some("cardboard"), Some("custom"))
        );
        assert_eq!((setup.width, setup.length, setup.shift_x, setup.shift_y), (600, 300, 6, 0));
        assert_eq!((setup.curl_correction, setup.mode), (Some(false), Some("colourPlane")));

        let [white, cyan] = &inspection.passes[..] else { panic!("{:?}", inspection.passes) };
        assert_eq!((white.ink, white.code, white.barcode, white.cartridge), ("white", 0x0b, 16, "MDC-SCWH"));
        assert_eq!((white.dots, white.rows, white.packed_rows + white.plain_rows), (101 * 53, 53, 53));
        let bounds = white.bounds.unwrap();
        assert_eq!((bounds.x, bounds.y, bounds.width, bounds.height), (36, 40, 101, 53));
        let mm = [36.0, 40.0, 101.0, 53.0].map(|dots: f64| dots * 25.4 / 600.0);
        assert!(bounds.mm.iter().zip(mm).all(|(a, b)| (a - b).abs() < 1e-9), "{bounds:?}");
        assert_eq!(
            (cyan.dots, cyan.bounds.map(|b| (b.x, b.y, b.width, b.height))),
            (1, Some((13, 299, 1, 1)))
        );
        assert!(!white.last && cyan.last);

        // Between two passes stands the back-feed of five bytes, after the last one the end of the job.
        assert_eq!(bytes[white.offset as usize..][..5], [0x1b, 0x1a, 0x0b, 0x00, 0x72]);
        assert_eq!(cyan.offset, white.offset + white.bytes + 5);
        assert_eq!(cyan.offset + cyan.bytes + 11, bytes.len() as u64);

        assert_eq!(planes, [pass(Ink::White, 36, 40, 101, 53), pass(Ink::Cyan, 13, 299, 1, 1)]);
    }

    #[test]
    fn what_came_before_a_fault_is_reported_with_it() {
        let mut bytes = job(Page::plain(PAPER), &[pass(Ink::White, 0, 0, 8, 3), pass(Ink::Cyan, 0, 0, 8, 3)]);
        let back_feed = bytes.windows(5).position(|w| w == [0x1b, 0x1a, 0, 0, 0x0c]).unwrap();
        bytes.drain(back_feed..back_feed + 5);
        let Inspected { inspection, passes } = inspect(&bytes, &Silent);
        assert!(!inspection.complete);
        let error = inspection.error.unwrap();
        assert_eq!((error.offset, error.fault), (back_feed as u64, Fault::MissingBackFeed.number()));
        assert_eq!(
            error.to_string(),
            format!("byte {back_feed}: another pass begins without a back-feed (fault 46)")
        );
        assert_eq!((inspection.passes[0].dots, passes.len()), (24, 1));
    }

    #[test]
    fn nothing_at_all_is_a_stream_that_ends_too_early() {
        let seen = inspect(&[], &Silent).inspection;
        assert_eq!(seen.error.map(|error| (error.offset, error.fault)), Some((0, Fault::Truncated.number())));
    }

    #[test]
    fn the_figures_can_be_read_by_programs() {
        let seen = inspect(&job(Page::plain(PAPER), &[pass(Ink::White, 0, 0, 8, 3)]), &Silent).inspection;
        let json = serde_json::to_value(&seen).unwrap();
        assert_eq!(json["passes"][0]["ink"], "white");
        assert_eq!(json["passes"][0]["bounds"]["width"], 8);
        assert_eq!(json["error"], serde_json::Value::Null);
    }
}
