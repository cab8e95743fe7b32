//! Where a job can be cut short, and how it is then brought to its end.
//!
//! Problem: a device that takes the printer's bytes as they are has got a part of a job that is not wanted any more; cut
//! off anywhere, the machine would take the next job for the rest of a row.
//! Method: that of the bridge's engine, for a job that is known whole: to the end of the command, past what has to be
//! followed by a row, then the shortest legal end.
//! Source: the job's grammar; that of the engine stands in `bridge/src/track.rs`.

use protocol::ink::Ink;
use protocol::rgl::encode::encode_into;
use protocol::rgl::{Command, Step, parse};

use super::ghostscript;

/// The bytes to send behind the first `at` bytes of a legal job so that the sheet, if one has begun, comes out and the
/// printer is ready for the next job. Nothing if the job had not begun or was already over.
pub fn ending(job: &[u8], at: usize) -> Vec<u8> {
    let foreign = ghostscript::begins(job);
    let (mut selected, mut raster, mut ejected, mut any_row) = (false, false, false, false);
    let mut pass: Option<(Ink, bool)> = None;
    let (mut back_fed, mut settled) = (false, true);
    let mut end = 0;
    while end < at || !settled {
        let rest = &job[end.min(job.len())..];
        let known = if foreign {
            ghostscript::command(rest)
        } else {
            match parse(rest) {
                Ok(Step::Command(command, length)) => Some((Some(command), length)),
                _ => None,
            }
        };
        // What is no legal job is sent as it is.
        let Some((command, length)) = known else { return job[at.min(job.len())..].to_vec() };
        end += length;
        settled = true;
        match command {
            Some(Command::Reset | Command::LeaveRgl) => (selected, raster, pass) = (false, false, None),
            Some(Command::SelectRgl) => selected = true,
            Some(Command::RasterStart) => raster = true,
            Some(Command::RasterEnd) => raster = false,
            Some(Command::FormFeed) => ejected = true,
            Some(Command::InkSelect { ink, last }) => (pass, back_fed) = (Some((ink, last)), false),
            Some(Command::BackFeed) => (back_fed, settled) = (true, false),
            Some(Command::Compression(_) | Command::Skip(_)) => settled = false,
            Some(Command::Row { .. }) | None if raster => any_row = true,
            _ => {}
        }
    }
    let mut out = job[at.min(end)..end].to_vec();
    if !selected {
        return out;
    }
    let mut tail = Vec::new();
    if raster {
        if let Some((ink, false)) = pass
            && !ejected
        {
            if !back_fed {
                tail.push(Command::BackFeed);
            }
            // The same ink, so that no cassette is changed.
            tail.push(Command::InkSelect { ink, last: true });
        }
        tail.push(Command::RasterEnd);
    }
    if any_row && !ejected {
        tail.push(Command::FormFeed);
    }
    tail.extend([Command::LeaveRgl, Command::Reset]);
    let mut room = [0; 16];
    for command in tail {
        // None of them is longer than five bytes.
        if let Ok(length) = encode_into(&command, &mut room) {
            out.extend_from_slice(&room[..length]);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inspect::inspect;
    use crate::job::stream::write_job;
    use crate::separate::{Pass, Plane};
    use observe::Silent;
    use proptest::prelude::*;
    use protocol::paper::Paper;
    use protocol::rgl::Page;

    /// A job of stripes, the page's own rows long.
    fn job(inks: &[Ink], rows: usize) -> Vec<u8> {
        let paper = Paper::Custom { width: 400, length: 60 };
        let passes: Vec<Pass> = (1..)
            .zip(inks)
            .map(|(every, &ink)| {
                let mut bits = vec![0; 50 * 60];
                for row in (0..rows).step_by(every) {
                    bits[row * 50..row * 50 + 7 * every].fill(0x1b ^ row as u8);
                }
                Pass { ink, plane: Plane { width: 400, length: 60, stride: 50, bits } }
            })
            .collect();
        let mut bytes = Vec::new();
        write_job(Page::plain(paper), None, &passes, &mut bytes, &Silent).unwrap();
        bytes
    }

    #[test]
    fn a_job_cut_after_any_byte_of_its_rows_becomes_a_whole_job_and_prints_nothing_else() {
        for inks in [
            &[Ink::White][..],
            &[Ink::Cyan, Ink::Black],
            &[Ink::White, Ink::Cyan, Ink::Magenta, Ink::Yellow, Ink::Black],
        ] {
            let job = job(inks, 40);
            let whole = inspect(&job, &Silent);
            let first = whole.inspection.passes[0].offset as usize + 20;
            for at in first..job.len() {
                let cut = [&job[..at], &ending(&job, at)].concat();
                let seen = inspect(&cut, &Silent);
                assert!(seen.inspection.error.is_none(), "after byte {at}: {:?}", seen.inspection.error);
                assert!(cut.len() <= job.len() + 24 && cut[..at] == job[..at]);
                let dots = |passes: &[Pass]| passes.iter().map(|pass| pass.plane.dots()).sum::<u64>();
                assert!(dots(&seen.passes) <= dots(&whole.passes));
            }
        }
    }

    #[test]
    fn before_a_row_no_sheet_comes_out_and_behind_the_job_nothing_is_added() {
        let job = job(&[Ink::White, Ink::Cyan], 40);
        assert!(ending(&job, 0).is_empty());
        let setup = inspect(&job, &Silent).inspection.passes[0].offset as usize;
        let end = ending(&job, setup);
        assert!(!end.contains(&0x0c) && end.ends_with(b"\x1b%\0X\x1be"), "{end:x?}");
        assert!(ending(&job, job.len()).is_empty());
    }

    proptest! {
        #[test]
        fn no_bytes_make_it_fail(bytes in prop::collection::vec(any::<u8>(), 0..200), at in 0usize..300) {
            ending(&bytes, at);
        }
    }
}
