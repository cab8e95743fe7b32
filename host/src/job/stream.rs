//! The bytes of a job.
//!
//! Passes go row by row through the writer the bridge uses; a page is never held in a second form. Passes without a
//! dot are left out: what the machine does with them was never measured, and they would cost a cassette change.

use std::io::{self, Write};

use protocol::ink::Ink;
use protocol::rgl::job::{COMMAND_ROOM, ROW_ROOM};
use protocol::rgl::{Fault, FoilConsent, JobSetup, JobWriter, Page};

use crate::observe::Observer;
use crate::separate::Pass;
use crate::simulate::words;

/// Why a job cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum StreamError {
    /// No pass has a dot.
    #[error("there is nothing to print: no pass has a dot")]
    NothingToPrint,
    /// A plane is not the page's size.
    #[error("pass {pass} ({ink}) has {width} x {length} dots, but the page has {page_width} x {page_length}")]
    Size {
        /// Number of the pass, from 1.
        pass: usize,
        /// Its ink.
        ink: &'static str,
        /// Its dots across.
        width: usize,
        /// Its rows.
        length: usize,
        /// The page's dots across.
        page_width: usize,
        /// The page's rows.
        page_length: usize,
    },
    /// The job is one that must not be sent.
    #[error("this job must not be sent: {}", words(*.0))]
    Forbidden(Fault),
    /// A row cannot be sent.
    #[error("pass {pass} ({ink}), row {row}: {}", words(*fault))]
    Row {
        /// Number of the pass, from 1.
        pass: usize,
        /// Its ink.
        ink: &'static str,
        /// Number of the row, from 0.
        row: usize,
        /// What is wrong with it.
        fault: Fault,
    },
    /// The output does not take the bytes.
    #[error("cannot write the job")]
    Output(#[from] io::Error),
}

/// What was written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Written {
    /// The inks of the passes that were sent, in order.
    pub passes: Vec<Ink>,
    /// Bytes.
    pub bytes: u64,
}

/// Writes the job that prints `passes` in this order. Planes are the page's size at the page's resolution; rows that
/// the page's shift would push off the sheet must be blank. A pass without a dot is left out.
pub fn write_job(
    page: Page,
    foil: Option<FoilConsent>,
    passes: &[Pass],
    out: &mut impl Write,
    observer: &dyn Observer,
) -> Result<Written, StreamError> {
    /// Bytes gathered before they go out.
    const CHUNK: usize = 1 << 16;

    let (width, length) = (usize::from(page.width()), usize::from(page.length()));
    let stride = width.div_ceil(8);
    for (i, pass) in passes.iter().enumerate() {
        let plane = &pass.plane;
        if (plane.width, plane.length, plane.stride, plane.bits.len())
            != (width, length, stride, stride * length)
        {
            return Err(StreamError::Size {
                pass: i + 1,
                ink: pass.ink.name(),
                width: plane.width,
                length: plane.length,
                page_width: width,
                page_length: length,
            });
        }
    }
    let printing: Vec<(usize, &Pass)> =
        passes.iter().enumerate().filter(|(_, pass)| pass.plane.bits.iter().any(|&byte| byte != 0)).collect();
    if printing.is_empty() {
        return Err(StreamError::NothingToPrint);
    }
    let inks: Vec<Ink> = printing.iter().map(|(_, pass)| pass.ink).collect();
    let setup = JobSetup::new(page, &inks, foil).map_err(StreamError::Forbidden)?;
    let rows = page.length() - page.resolution.along(page.shift_y).min(page.length());
    let mut writer = JobWriter::new(setup, rows).map_err(StreamError::Forbidden)?;

    observer.begin("printer language", (printing.len() * length) as u64);
    let room = (ROW_ROOM + stride).max(COMMAND_ROOM);
    let mut buffer = vec![0; CHUNK + room];
    let mut filled = writer.begin(&mut buffer).map_err(StreamError::Forbidden)?;
    let mut bytes = 0;
    for &(number, pass) in &printing {
        filled += writer.next_pass(&mut buffer[filled..]).map_err(StreamError::Forbidden)?;
        for (y, row) in pass.plane.bits.chunks_exact(stride).enumerate() {
            if y >= usize::from(rows) {
                if row.iter().all(|&byte| byte == 0) {
                    continue;
                }
                let ink = pass.ink.name();
                return Err(StreamError::Row { pass: number + 1, ink, row: y, fault: Fault::BeyondLength });
            }
            filled += writer.row(row, &mut buffer[filled..]).map_err(|fault| StreamError::Row {
                pass: number + 1,
                ink: pass.ink.name(),
                row: y,
                fault,
            })?;
            if filled >= CHUNK {
                out.write_all(&buffer[..filled])?;
                bytes += filled as u64;
                filled = 0;
            }
            if y % 1024 == 1023 {
                observer.advance(1024);
            }
        }
        observer.advance((length % 1024) as u64);
    }
    if filled + COMMAND_ROOM > buffer.len() {
        out.write_all(&buffer[..filled])?;
        bytes += filled as u64;
        filled = 0;
    }
    filled += writer.end(&mut buffer[filled..]).map_err(StreamError::Forbidden)?;
    out.write_all(&buffer[..filled])?;
    out.flush()?;
    observer.end();
    Ok(Written { passes: inks, bytes: bytes + filled as u64 })
}
