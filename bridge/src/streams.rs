//! A job of pass streams as bytes of the printer's language, a row at a time.
//!
//! Nothing is written before the first band is complete, so a job that is cancelled or turns out to be no job by
//! then has not touched a sheet.

use protocol::link::message::DefectKind;
use protocol::rgl::JobWriter;
use protocol::rgl::job::ROW_ROOM;
use protocol::runs::{Decoder, Defect, Header, HeaderError, MAX_HEADER, Step, band_bytes, stride};

/// Room for whatever one slice of work writes: the longest row, 9880 dots.
pub(crate) const WRITE_ROOM: usize = ROW_ROOM + 1235;

/// Bytes of a stream read in one slice of work: some hundred runs, so that a slice takes well below a
/// millisecond on a microcontroller.
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
    /// Rows `next..end` of the band are to be written, or so many blank ones.
    Rows {
        next: u16,
        end: u16,
    },
    Blank(u16),
    /// The job is complete.
    Ended,
}

pub(crate) struct Streams<'m> {
    band: &'m mut [u8],
    decoder: Decoder,
    writer: Option<JobWriter>,
    stage: Stage,
    begun: bool,
    in_pass: bool,
    stride: usize,
    row: u16,
    head: [u8; MAX_HEADER],
    head_length: usize,
}

impl<'m> Streams<'m> {
    pub(crate) fn new(band: &'m mut [u8]) -> Self {
        Streams {
            band,
            decoder: Decoder::new(0, 0),
            writer: None,
            stage: Stage::Header,
            begun: false,
            in_pass: false,
            stride: 0,
            row: 0,
            head: [0; MAX_HEADER],
            head_length: 0,
        }
    }

    /// Forgets everything: the next byte is that of a header.
    pub(crate) fn restart(&mut self) {
        self.writer = None;
        self.stage = Stage::Header;
        (self.begun, self.in_pass, self.head_length, self.row) = (false, false, 0, 0);
    }

    /// Whether every byte of the job has been written.
    pub(crate) fn ended(&self) -> bool {
        matches!(self.stage, Stage::Ended)
    }

    /// Pass and row that come next.
    pub(crate) fn position(&self) -> (u8, u16) {
        // At most 32 passes.
        let passes = self.writer.as_ref().map_or(0, JobWriter::passes) as u8;
        (passes.saturating_sub(1), self.row)
    }

    /// Does a little work.
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
                    self.in_pass = false;
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
                    Some(Step::Band { y, rows }) => {
                        (self.row, self.stage) = (y, Stage::Rows { next: 0, end: rows })
                    }
                    Some(Step::End) => {}
                }
            }
            Stage::Rows { .. } | Stage::Blank(_) if !self.begun => {
                worked.written = writer.begin(out).map_err(|_| DefectKind::Forbidden)?;
                self.begun = true;
            }
            Stage::Rows { .. } | Stage::Blank(_) if !self.in_pass => {
                worked.written = writer.next_pass(out).map_err(|_| DefectKind::Forbidden)?;
                self.in_pass = true;
            }
            Stage::Blank(rows) => {
                writer.blank_rows(rows).map_err(|_| DefectKind::Stream)?;
                self.row += rows;
                self.stage = Stage::Read;
            }
            Stage::Rows { next, end } => {
                let at = usize::from(next) * self.stride;
                let row = self.band.get(at..at + self.stride).ok_or(DefectKind::TooLarge)?;
                worked.written = writer.row(row, out).map_err(|_| DefectKind::Stream)?;
                self.row += 1;
                self.stage = if next + 1 < end { Stage::Rows { next: next + 1, end } } else { Stage::Read };
            }
        }
        Ok(worked)
    }

    /// The bytes that end the job behind what has been written; nothing if that is nothing.
    pub(crate) fn cancel(&mut self, out: &mut [u8; WRITE_ROOM]) -> usize {
        let begun = self.begun;
        self.stage = Stage::Ended;
        // Nothing in the writer can refuse it: there is room, and any order of a writer's own can be ended.
        self.writer.as_mut().filter(|_| begun).map_or(0, |writer| writer.cancel(out).unwrap_or(0))
    }

    /// Takes bytes of the header until it is complete.
    fn collect(&mut self, input: &[u8]) -> Result<usize, DefectKind> {
        for (i, &byte) in input.iter().enumerate() {
            *self.head.get_mut(self.head_length).ok_or(DefectKind::Header)? = byte;
            self.head_length += 1;
            let read = Header::read(&self.head[..self.head_length]).map_err(|error| match error {
                HeaderError::Unknown => DefectKind::Header,
                HeaderError::Forbidden(_) => DefectKind::Forbidden,
            })?;
            if let Some((header, _)) = read {
                if band_bytes(header.columns()) > self.band.len() {
                    return Err(DefectKind::TooLarge);
                }
                let writer =
                    JobWriter::new(*header.setup(), header.rows()).map_err(|_| DefectKind::Forbidden)?;
                self.writer = Some(writer);
                self.decoder.resize(header.columns(), header.rows());
                self.stride = stride(header.columns());
                self.stage = Stage::Read;
                return Ok(i + 1);
            }
        }
        Ok(input.len())
    }
}
