//! The contents of a stream: its setup, its passes, its faults.
//!
//! Problem: a job file must be understood and judged without a printer.
//! Method: the strict reader of the printer's language reads the bytes alone, whatever cartridges and sheet are loaded. The
//! dialect of Ghostscript's drivers is also read, leniently. A report includes everything before the first fault.
//! Cost: one look at each byte, one bit for each dot and pass. Limits: only the first fault is found.

mod ending;
mod ghostscript;
mod report;
mod strict;

use std::ops::Range;

use observe::Observer;

pub use ending::ending;
pub use report::{Bounds, Inspected, Inspection, PassReport, Setup, StreamError};

/// The sheets of a stream: one job each, since a driver writes the pages of a document one after another.
///
/// A stream that is not a job, or whose last job is incomplete, counts as a sheet as well; only [`inspect`] judges.
pub fn sheets(stream: &[u8]) -> Vec<Range<usize>> {
    let mut sheets = Vec::new();
    let mut at = 0;
    while at < stream.len() || sheets.is_empty() {
        let rest = &stream[at..];
        let length = if ghostscript::begins(rest) {
            ghostscript::first_sheet(rest)
        } else {
            strict::first_sheet(rest)
        };
        let end = at + length.unwrap_or(rest.len());
        sheets.push(at..end);
        at = end;
    }
    sheets
}

/// Inspects one sheet's job. Faults are part of the result.
pub fn inspect(stream: &[u8], observer: &dyn Observer) -> Inspected {
    if ghostscript::begins(stream) {
        ghostscript::inspect(stream, observer)
    } else {
        strict::inspect(stream, observer)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::stream::write_job;
    use crate::separate::Pass;
    use observe::Silent;
    use protocol::ink::Ink;
    use protocol::paper::Paper;
    use protocol::rgl::{Fault, Media, Page};
    use sheet::Plane;

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
        assert_eq!(error.to_string(), format!("byte {back_feed}: another pass begins without a back-feed"));
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
