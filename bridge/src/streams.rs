//! From the pass streams of a job to bytes of the printer's language, a row at a time.
//!
//! Nothing is written before the first band is complete, so a job that is cancelled or turns out to be invalid before
//! that has not touched a sheet.

use heapless::Vec;
use protocol::link::message::DefectKind;
use protocol::rgl::JobWriter;
use protocol::rgl::job::ROW_ROOM;
use protocol::runs::{Decoder, Defect, Header, HeaderError, MAX_HEADER, Step, band_bytes, stride};

/// Room for whatever one slice of work writes: the longest row, 9880 dots.
pub(crate) const WRITE_ROOM: usize = ROW_ROOM + 1235;

/// Bytes of a stream read in one slice of work. The decoder pauses by itself; packed rows alone take as long as they have bytes.
const SLICE: usize = 64;

/// What a slice of work did.
pub(crate) struct Worked {
    /// Bytes of the input that were used.
    pub(crate) used: usize,
    /// Bytes written.
    pub(crate) written: usize,
    /// Whether more can be done without more input.
    pub(crate) progress: bool,
}

enum Stage {
    /// Collecting the header.
    Header,
    /// Reading a band.
    Read,
    /// Writing rows `next..end` of the band, so many bytes of each.
    Rows { next: u16, end: u16, reach: usize },
    /// Writing so many blank rows.
    Blank(u16),
    /// The job is complete.
    Ended,
}

/// What has been written of the job.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Written {
    Nothing,
    /// The setup and whole passes.
    Setup,
    /// The beginning of the pass under way.
    Pass,
}

/// The job under way.
pub(crate) struct Streams<'m> {
    band: &'m mut [u8],
    decoder: &'m mut Decoder,
    writer: Option<JobWriter>,
    stage: Stage,
    written: Written,
    stride: usize,
    row: u16,
    head: Vec<u8, MAX_HEADER>,
}

impl<'m> Streams<'m> {
    pub(crate) fn new(band: &'m mut [u8], decoder: &'m mut Decoder) -> Self {
        Streams {
            band,
            decoder,
            writer: None,
            stage: Stage::Header,
            written: Written::Nothing,
            stride: 0,
            row: 0,
            head: Vec::new(),
        }
    }

    #[cfg(any(test, feature = "simulation"))]
    pub(crate) fn into_memory(self) -> (&'m mut [u8], &'m mut Decoder) {
        (self.band, self.decoder)
    }

    /// Forgets everything: the next byte is that of a header.
    pub(crate) fn restart(&mut self) {
        self.writer = None;
        self.stage = Stage::Header;
        self.written = Written::Nothing;
        self.head.clear();
        self.row = 0;
    }

    /// Whether every byte of the job has been written.
    pub(crate) fn ended(&self) -> bool {
        matches!(self.stage, Stage::Ended)
    }

    /// Pass and row that come next.
    pub(crate) fn position(&self) -> (u8, u16) {
        let passes = self.writer.as_ref().map_or(0, JobWriter::passes);
        // At most 32 passes.
        (u8::try_from(passes.saturating_sub(1)).unwrap_or(u8::MAX), self.row)
    }

    /// Does a slice of work.
    pub(crate) fn work(&mut self, input: &[u8], out: &mut [u8; WRITE_ROOM]) -> Result<Worked, DefectKind> {
        let mut worked = Worked { used: 0, written: 0, progress: true };
        if let Stage::Header = self.stage {
            worked.used = self.collect(input)?;
            worked.progress = worked.used > 0;
            return Ok(worked);
        }
        let Some(writer) = &mut self.writer else {
            return Err(DefectKind::Header);
        };
        match self.stage {
            Stage::Header | Stage::Ended => worked.progress = false,
            Stage::Read if self.decoder.ended() => {
                if writer.passes() == writer.setup().passes().len() {
                    worked.written = writer.end(out).map_err(|_| DefectKind::Stream)?;
                    self.stage = Stage::Ended;
                } else {
                    self.decoder.restart();
                    if self.written == Written::Pass {
                        self.written = Written::Setup;
                    }
                }
            }
            Stage::Read => {
                let slice = &input[..input.len().min(SLICE)];
                let (used, step) = self.decoder.slice(slice, self.band).map_err(|defect| match defect {
                    Defect::Memory => DefectKind::TooLarge,
                    Defect::Form | Defect::Count | Defect::Row => DefectKind::Stream,
                })?;
                worked.used = used;
                match step {
                    None => {}
                    Some(Step::More) => worked.progress = used > 0,
                    Some(Step::Blank { y, rows }) => (self.row, self.stage) = (y, Stage::Blank(rows)),
                    Some(Step::Band { y, rows, reach }) => {
                        (self.row, self.stage) = (y, Stage::Rows { next: 0, end: rows, reach })
                    }
                    Some(Step::End) => {}
                }
            }
            Stage::Rows { .. } | Stage::Blank(_) if self.written == Written::Nothing => {
                worked.written = writer.begin(out).map_err(|_| DefectKind::Forbidden)?;
                self.written = Written::Setup;
            }
            Stage::Rows { .. } | Stage::Blank(_) if self.written == Written::Setup => {
                worked.written = writer.next_pass(out).map_err(|_| DefectKind::Forbidden)?;
                self.written = Written::Pass;
            }
            Stage::Blank(rows) => {
                writer.blank_rows(rows).map_err(|_| DefectKind::Stream)?;
                self.row += rows;
                self.stage = Stage::Read;
            }
            Stage::Rows { next, end, reach } => {
                let at = usize::from(next) * self.stride;
                let row = self.band.get(at..at + reach).ok_or(DefectKind::TooLarge)?;
                worked.written = writer.row(row, out).map_err(|_| DefectKind::Stream)?;
                self.row += 1;
                self.stage =
                    if next + 1 < end { Stage::Rows { next: next + 1, end, reach } } else { Stage::Read };
            }
        }
        Ok(worked)
    }

    /// Writes the bytes that end the job after what has been written: none if that is nothing.
    pub(crate) fn cancel(&mut self, out: &mut [u8; WRITE_ROOM]) -> usize {
        let begun = self.written != Written::Nothing;
        self.stage = Stage::Ended;
        // The writer cannot refuse: there is room, and every order it has written can be ended.
        self.writer.as_mut().filter(|_| begun).map_or(0, |writer| writer.cancel(out).unwrap_or(0))
    }

    /// Takes bytes of the header until it is complete.
    fn collect(&mut self, input: &[u8]) -> Result<usize, DefectKind> {
        for (i, &byte) in input.iter().enumerate() {
            self.head.push(byte).map_err(|_| DefectKind::Header)?;
            let read = Header::read(&self.head).map_err(|error| match error {
                HeaderError::Unknown => DefectKind::Header,
                HeaderError::Forbidden(_) => DefectKind::Forbidden,
            })?;
            if let Some((header, _)) = read {
                if band_bytes(header.columns()) > self.band.len() {
                    return Err(DefectKind::TooLarge);
                }
                let writer = JobWriter::new(header.setup().clone(), header.rows())
                    .map_err(|_| DefectKind::Forbidden)?;
                self.writer = Some(writer);
                self.decoder.begin(*header.walk());
                self.stride = stride(header.columns());
                self.stage = Stage::Read;
                return Ok(i + 1);
            }
        }
        Ok(input.len())
    }
}
