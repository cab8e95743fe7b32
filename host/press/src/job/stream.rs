//! The bytes of a job.
//!
//! Passes go row by row through the writer the bridge uses; a page is never held in a second form. Passes without a
//! dot are left out: what the printer does with them was never measured, and they would cost a cartridge change.

use std::io::{self, Write};

use protocol::ink::Ink;
use protocol::rgl::job::{COMMAND_ROOM, ROW_ROOM};
use protocol::rgl::{Fault, FoilConsent, JobSetup, JobWriter, Page};

use super::fault::words;
use crate::separate::Pass;
use observe::Observer;

/// Why a job cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum StreamError {
    /// No pass has a dot.
    #[error("there is nothing to print: no pass has a dot, all of it is bare paper")]
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
    /// The printer's language or the rules on foil forbid the job.
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

/// Whether every plane is the page's size.
fn fits(page: Page, passes: &[Pass]) -> Result<(), StreamError> {
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
    Ok(())
}

/// Writes the job that prints `passes` in this order. Planes are the page's size at the page's resolution; rows that
/// the page's shift would push off the sheet must be blank. A pass without a dot is left out.
///
/// # Errors
/// Nothing to print, a plane or a row that does not fit the page, a job that must not be sent, or an output that fails.
pub fn write_job(
    page: Page,
    foil: Option<FoilConsent>,
    passes: &[Pass],
    out: &mut impl Write,
    observer: &dyn Observer,
) -> Result<Written, StreamError> {
    /// Bytes gathered before they go out.
    const CHUNK: usize = 1 << 16;

    fits(page, passes)?;
    let (length, stride) = (usize::from(page.length()), usize::from(page.width()).div_ceil(8));
    let printing: Vec<(usize, &Pass)> =
        passes.iter().enumerate().filter(|(_, pass)| !pass.plane.is_blank()).collect();
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

#[cfg(test)]
mod tests {
    use super::*;
    use observe::Silent;
    use protocol::paper::Paper;
    use protocol::rgl::{Command, Resolution, Step, parse};
    use sheet::Plane;

    const PAPER: Paper = Paper::Custom { width: 40, length: 30 };

    fn pass(ink: Ink, width: usize, dots: &[(usize, usize)]) -> Pass {
        let stride = width.div_ceil(8);
        let mut bits = vec![0; stride * 30];
        for &(x, y) in dots {
            bits[y * stride + x / 8] |= 0x80 >> (x % 8);
        }
        Pass { ink, plane: Plane { width, length: 30, stride, bits } }
    }

    fn write(page: Page, passes: &[Pass]) -> Result<(Written, Vec<u8>), StreamError> {
        let mut bytes = vec![];
        let written = write_job(page, None, passes, &mut bytes, &Silent)?;
        Ok((written, bytes))
    }

    fn commands(bytes: &[u8]) -> Vec<Command<'_>> {
        let (mut at, mut all) = (0, vec![]);
        while let Ok(Step::Command(command, length)) = parse(&bytes[at..]) {
            all.push(command);
            at += length;
        }
        assert_eq!(at, bytes.len());
        all
    }

    #[test]
    fn passes_without_a_dot_are_left_out_and_the_last_printing_one_is_announced() {
        let passes = [pass(Ink::Cyan, 40, &[]), pass(Ink::White, 40, &[(3, 3)]), pass(Ink::Black, 40, &[])];
        let (written, bytes) = write(Page::plain(PAPER), &passes).unwrap();
        assert_eq!((written.passes, written.bytes), (vec![Ink::White], bytes.len() as u64));
        let commands = commands(&bytes);
        assert!(commands.contains(&Command::InkSelect { ink: Ink::White, last: true }));
        assert!(!commands.contains(&Command::BackFeed));
    }

    #[test]
    fn nothing_at_all_is_no_job() {
        assert!(matches!(write(Page::plain(PAPER), &[]), Err(StreamError::NothingToPrint)));
        let blank = [pass(Ink::Cyan, 40, &[])];
        assert!(matches!(write(Page::plain(PAPER), &blank), Err(StreamError::NothingToPrint)));
    }

    #[test]
    fn forbidden_jobs_leave_no_byte() {
        let mut bytes = vec![];
        let mut refused = |page, pass: Pass| match write_job(page, None, &[pass], &mut bytes, &Silent) {
            Err(StreamError::Forbidden(fault)) => fault,
            other => panic!("{other:?}"),
        };
        let fine = Page { resolution: Resolution::Dpi1200, ..Page::plain(PAPER) };
        assert_eq!(refused(fine, pass(Ink::White, 80, &[(1, 1)])), Fault::SpotResolution);
        assert_eq!(
            refused(Page::plain(PAPER), pass(Ink::GoldFoil, 40, &[(1, 1)])),
            Fault::FoilWithoutConsent
        );
        assert!(bytes.is_empty());
        let consent = Some(FoilConsent::given_by_the_user());
        write_job(Page::plain(PAPER), consent, &[pass(Ink::GoldFoil, 40, &[(1, 1)])], &mut bytes, &Silent)
            .unwrap();
    }

    #[test]
    fn planes_of_another_size_and_dots_beyond_the_page_are_named() {
        let text = |page, passes: &[Pass]| write(page, passes).unwrap_err().to_string();
        assert_eq!(
            text(Page::plain(PAPER), &[pass(Ink::Cyan, 40, &[]), pass(Ink::White, 48, &[(0, 0)])]),
            "pass 2 (white) has 48 x 30 dots, but the page has 40 x 30"
        );
        let down = Page { shift_y: 2, ..Page::plain(PAPER) };
        assert!(write(down, &[pass(Ink::White, 40, &[(0, 27)])]).is_ok());
        assert_eq!(
            text(down, &[pass(Ink::White, 40, &[(0, 28)])]),
            "pass 1 (white), row 28: the row lies beyond the page's length"
        );
        let right = Page { shift_x: 2, ..Page::plain(PAPER) };
        assert!(write(right, &[pass(Ink::White, 40, &[(37, 0)])]).is_ok());
        assert_eq!(
            text(right, &[pass(Ink::White, 40, &[(38, 0)])]),
            "pass 1 (white), row 0: the row reaches beyond the page's width"
        );
    }

    #[test]
    fn an_output_that_fails_is_reported() {
        struct Full;
        impl Write for Full {
            fn write(&mut self, _: &[u8]) -> io::Result<usize> {
                Err(io::ErrorKind::StorageFull.into())
            }
            fn flush(&mut self) -> io::Result<()> {
                Ok(())
            }
        }
        let written =
            write_job(Page::plain(PAPER), None, &[pass(Ink::White, 40, &[(0, 0)])], &mut Full, &Silent);
        assert!(matches!(written, Err(StreamError::Output(_))));
    }

    #[test]
    fn a_job_larger_than_the_buffer_is_the_same_row_by_row() {
        // Incompressible rows: every byte differs from its neighbours, so that the buffer runs over many times.
        let paper = Paper::A4;
        let (width, length, stride) = (4800, 6372, 600);
        let mut bits: Vec<u8> =
            (0..stride * length).map(|i| (i as u32).wrapping_mul(2_654_435_761).to_be_bytes()[0]).collect();
        bits.chunks_mut(stride).skip(400).for_each(|row| row.fill(0));
        let plane = Plane { width, length, stride, bits: bits.clone() };
        let (_, bytes) = write(Page::plain(paper), &[Pass { ink: Ink::Black, plane }]).unwrap();
        assert!(bytes.len() > 3 << 16);
        let sent: Vec<u8> = commands(&bytes)
            .iter()
            .scan(false, |packed, command| {
                let mut row = vec![0; stride];
                match *command {
                    Command::Compression(c) => *packed = c == protocol::rgl::Compression::Packed,
                    Command::Row { data, .. } if *packed => {
                        protocol::packbits::unpack_into(data, &mut row).unwrap();
                        return Some(row);
                    }
                    Command::Row { data, .. } => {
                        row[..data.len()].copy_from_slice(data);
                        return Some(row);
                    }
                    _ => {}
                }
                Some(vec![])
            })
            .flatten()
            .collect();
        assert!(sent == bits[..400 * stride]);
    }
}
