//! Streams of Ghostscript's drivers for these printers (`md5k`, `md2k`): another dialect, for reading only.
//!
//! Problem: owners have such streams and print them raw. They are jobs, although not by the strict reader's grammar.
//! Method: this reader parses the commands that the dialect writes differently; all others are parsed as usual. It checks
//! the order only where a sheet depends on it: a complete setup, a back-feed between passes, one form feed, an end.
//!
//! ```text
//! job   = [reset] select-rgl setup raster-start [compression] pass { back-feed pass } FF raster-end leave-rgl [reset]
//! pass  = ink-select { [compression] [skip] row }
//! ```
//! Setup commands come in any order, each once. No page width is declared, so the paper's own width applies.
//! Limits: nobody has reported on `md5k` with hardware. A PackBits header `80`, which `md2k` writes for runs of 129 and
//! other software ignores, is refused. Jobs with an econo ribbon are refused too, because no known ink has its code.

use protocol::ink::Ink;
use protocol::rgl::{Command, Compression, Fault, PaperCode, Resolution, Step, parse};
use protocol::{packbits, paper};

use super::report::{Inspected, PassReport, Setup, measure, mode_name};
use crate::separate::Pass;
use crate::simulate::Canvas;
use observe::Observer;

const ESC: u8 = 0x1b;
const SUB: u8 = 0x1a;

/// Every stream of the dialect begins like this after an optional reset: it selects the printer's language, then adjusts the
/// line feed by zero, which the strict grammar forbids.
const OPENING: [u8; 9] = [ESC, b'%', 0x80, b'A', ESC, SUB, 0, 0, b'L'];

/// Rows that the drivers send beyond the declared length.
const SPARE_ROWS: u32 = 1;

/// Whether a stream begins like this dialect.
pub(super) fn begins(stream: &[u8]) -> bool {
    stream.strip_prefix(&[ESC, b'e']).unwrap_or(stream).starts_with(&OPENING)
}

/// A command of the dialect.
enum Item<'a> {
    /// A command of the strict grammar.
    Known(Command<'a>),
    /// A row, and the byte at which it begins.
    Offset(usize, &'a [u8]),
    /// A command without effect on the dots: feed source, print mode, adjustments.
    Ignored,
}

/// The command at the start of `bytes` and its length; or the fault and its offset.
fn step(bytes: &[u8]) -> Result<(Item<'_>, usize), (Fault, usize)> {
    let known = |command, length| Ok((Item::Known(command), length));
    match *bytes {
        [ESC, b'*', b't', code, b'R', ref rest @ ..] => {
            let resolution = Resolution::from_code(code).ok_or((Fault::ResolutionCode, 3))?;
            known(Command::Resolution(resolution), if rest.first() == Some(&0) { 6 } else { 5 })
        }
        [ESC, SUB, 0, 0, b'L'] | [ESC, SUB, 0, 0, b'L', ..] => Ok((Item::Ignored, 5)),
        [ESC, SUB, 0 | 1, 0, b'A', ..] | [ESC, SUB, _, 0, b'U', ..] => Ok((Item::Ignored, 5)),
        [ESC, b'&', b'l', 1 | 2, 0, b'H', ..] => Ok((Item::Ignored, 6)),
        [ESC, b'*', b'r', 1, b'A', ..] => known(Command::RasterStart, 5),
        [ESC, b'*', b'b', low, high, b'T', ref rest @ ..] => {
            let length = usize::from(u16::from_le_bytes([low, high]));
            let (offset, data) = rest.split_at_checked(2).ok_or((Fault::Truncated, bytes.len()))?;
            let data = data.get(..length).ok_or((Fault::Truncated, bytes.len()))?;
            Ok((Item::Offset(usize::from(u16::from_le_bytes([offset[0], offset[1]])), data), 8 + length))
        }
        _ => match parse(bytes) {
            Ok(Step::Command(command, length)) => known(command, length),
            Ok(Step::More(_)) => Err((Fault::Truncated, bytes.len())),
            Err(refusal) => Err((refusal.fault, refusal.at)),
        },
    }
}

/// The length of the first sheet's job, including the command that leaves the printer's language; `None` if the job is
/// incomplete.
pub(super) fn first_sheet(stream: &[u8]) -> Option<usize> {
    let mut at = 0;
    loop {
        let (item, length) = step(stream.get(at..)?).ok()?;
        at += length;
        if matches!(item, Item::Known(Command::LeaveRgl)) {
            return Some(at);
        }
    }
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Stage {
    Before,
    Setup,
    Raster,
    Pass,
    BackFed,
    Ejected,
    RasterEnded,
    Left,
}

struct Reader {
    stage: Stage,
    setup: Setup,
    resolution: Option<Resolution>,
    paper: Option<PaperCode>,
    compression: Option<Compression>,
    ejected: bool,
    /// The next row of the pass.
    row: u32,
    open: Option<(Ink, PassReport, Canvas)>,
    reports: Vec<PassReport>,
    passes: Vec<Pass>,
    line: Vec<u8>,
}

/// Inspects one sheet's job.
pub(super) fn inspect(stream: &[u8], observer: &dyn Observer) -> Inspected {
    observer.begin("inspect", stream.len() as u64);
    let mut reader = Reader {
        stage: Stage::Before,
        setup: Setup::default(),
        resolution: None,
        paper: None,
        compression: None,
        ejected: false,
        row: 0,
        open: None,
        reports: Vec::new(),
        passes: Vec::new(),
        line: Vec::new(),
    };
    let mut at = 0;
    let fault = loop {
        if at == stream.len() {
            break (reader.stage != Stage::Left).then_some((Fault::Truncated, at));
        }
        let result = step(&stream[at..]).and_then(|(item, length)| {
            reader.take(item, at, length).map(|()| length).map_err(|fault| (fault, 0))
        });
        match result {
            Ok(length) => at += length,
            Err((fault, within)) => break Some((fault, at + within)),
        }
    };
    reader.close(at);
    observer.end();
    Inspected::of(stream, Some("Ghostscript"), reader.setup, (reader.reports, reader.passes), fault)
}

/// Declares a value, which must not be declared twice.
fn once<T>(place: &mut Option<T>, value: T) -> Result<(), Fault> {
    if place.is_some() {
        return Err(Fault::Repeated);
    }
    *place = Some(value);
    Ok(())
}

impl Reader {
    fn take(&mut self, item: Item<'_>, at: usize, length: usize) -> Result<(), Fault> {
        use Stage::{BackFed, Before, Ejected, Left, Pass, Raster, RasterEnded, Setup};
        let command = match item {
            Item::Ignored if self.stage == Setup => return Ok(()),
            Item::Ignored => return Err(Fault::OutOfOrder),
            Item::Offset(offset, data) => return self.put_row(offset, Compression::Plain, data, false),
            Item::Known(command) => command,
        };
        let setup = &mut self.setup;
        match (self.stage, command) {
            (Before, Command::Reset) if at == 0 => {}
            (Before, Command::SelectRgl) => self.stage = Setup,
            (Setup, Command::Resolution(resolution)) => {
                once(&mut self.resolution, resolution)?;
                setup.resolution = Some(resolution.dpi());
            }
            (Setup, Command::Media(media)) => once(&mut setup.media, media.name())?,
            (Setup, Command::Paper(code)) => once(&mut self.paper, code)?,
            (Setup, Command::Length(rows)) if setup.length == 0 && rows > 0 => setup.length = rows,
            (Setup, Command::Mode(mode)) => once(&mut setup.mode, mode_name(mode))?,
            (Setup, Command::CurlCorrection(on)) => once(&mut setup.curl_correction, on)?,
            (Setup, Command::Cartridges(list)) => {
                once(&mut setup.cartridges, list.inks().iter().map(|ink| ink.name()).collect())?;
            }
            (Setup, Command::RasterStart) => self.start()?,
            (Raster | BackFed, Command::InkSelect { ink, last }) => {
                self.begin(ink, last, at);
                self.stage = Pass;
            }
            (Pass, Command::InkSelect { .. }) => return Err(Fault::MissingBackFeed),
            (Pass, Command::BackFeed) => {
                self.close(at);
                self.stage = BackFed;
            }
            (Raster | Pass | BackFed, Command::Compression(compression)) => {
                self.compression = Some(compression)
            }
            (Pass, Command::Skip(rows)) => self.row += u32::from(rows),
            (Pass, Command::Row { last, data }) => {
                let compression = self.compression.ok_or(Fault::NoCompression)?;
                return self.put_row(0, compression, data, last);
            }
            (BackFed, Command::FormFeed | Command::RasterEnd) => return Err(Fault::BackFeedWithoutPass),
            (Raster, Command::FormFeed | Command::RasterEnd) => return Err(Fault::NoPass),
            // The sheet may be ejected before or after the end of the raster data.
            (Pass, Command::FormFeed) => {
                self.close(at);
                (self.stage, self.ejected) = (Ejected, true);
            }
            (Pass, Command::RasterEnd) => {
                self.close(at);
                self.stage = RasterEnded;
            }
            (Ejected, Command::RasterEnd) => self.stage = RasterEnded,
            (RasterEnded, Command::FormFeed) if !self.ejected => self.ejected = true,
            (RasterEnded, Command::LeaveRgl) if self.ejected => self.stage = Left,
            (RasterEnded, Command::LeaveRgl) => return Err(Fault::MissingFormFeed),
            // Some of the drivers omit the end of the sheet.
            (Pass, Command::Reset | Command::LeaveRgl) => return Err(Fault::MissingFormFeed),
            (Left, Command::Reset) if length == 2 => {}
            (Left, _) => return Err(Fault::AfterJob),
            _ => return Err(Fault::OutOfOrder),
        }
        Ok(())
    }

    /// Checks the setup and begins the raster data.
    fn start(&mut self) -> Result<(), Fault> {
        let resolution = self.resolution.ok_or(Fault::MissingResolution)?;
        let paper = self.paper.ok_or(Fault::MissingPaper)?;
        self.setup.media.ok_or(Fault::MissingMedia)?;
        self.setup.mode.ok_or(Fault::MissingMode)?;
        if self.setup.length == 0 {
            return Err(Fault::MissingLength);
        }
        if self.setup.length > resolution.along(paper::LARGEST.1) {
            return Err(Fault::PageSize);
        }
        self.setup.paper = paper::Paper::named().find(|named| named.code() == paper.code()).map(|p| p.name());
        self.stage = Stage::Raster;
        Ok(())
    }

    /// Dots across the printable area of the paper, at the job's resolution.
    fn width(&self) -> usize {
        let named = paper::Paper::named().find(|named| Some(named.code()) == self.paper.map(PaperCode::code));
        let width = named.map_or(paper::LARGEST.0, |paper| paper.width());
        usize::from(self.resolution.unwrap_or_default().across(width))
    }

    fn begin(&mut self, ink: Ink, last: bool, at: usize) {
        let canvas = Canvas::new(self.width(), self.setup.length.into(), (0, 0), usize::MAX, 1);
        let report = PassReport::begin(self.reports.len() + 1, ink, last, at);
        self.row = 0;
        self.open = Some((ink, report, canvas));
    }

    /// Takes a row that begins at byte `offset`. With `stays`, the next row has the same number.
    fn put_row(
        &mut self,
        offset: usize,
        compression: Compression,
        data: &[u8],
        stays: bool,
    ) -> Result<(), Fault> {
        if self.stage != Stage::Pass {
            return Err(Fault::NoPass);
        }
        let most = self.width().div_ceil(8);
        let Some((_, report, canvas)) = &mut self.open else { return Err(Fault::NoPass) };
        if self.row >= u32::from(self.setup.length) + SPARE_ROWS {
            return Err(Fault::BeyondLength);
        }
        self.line.clear();
        self.line.resize(most, 0);
        let line = self.line.get_mut(offset..).ok_or(Fault::BeyondWidth)?;
        match compression {
            Compression::Plain => {
                line.get_mut(..data.len()).ok_or(Fault::BeyondWidth)?.copy_from_slice(data);
                report.plain_rows += 1;
            }
            Compression::Packed => {
                packbits::unpack_into(data, line).map_err(|error| match error.kind {
                    packbits::ErrorKind::ReservedHeader => Fault::ReservedHeader,
                    packbits::ErrorKind::CutOff => Fault::PackedCutOff,
                    packbits::ErrorKind::TooLong => Fault::BeyondWidth,
                })?;
                report.packed_rows += 1;
            }
        }
        canvas.put(self.row, Some(Compression::Plain), &self.line);
        report.rows += 1;
        self.row += u32::from(!stays);
        Ok(())
    }

    fn close(&mut self, at: usize) {
        let Some((ink, mut report, canvas)) = self.open.take() else { return };
        let plane = canvas.into_plane();
        (report.dots, report.bounds) = measure(&plane, self.resolution.unwrap_or_default().dpi());
        report.bytes = at as u64 - report.offset;
        self.passes.push(Pass { ink, plane });
        self.reports.push(report);
    }
}
