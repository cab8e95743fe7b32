//! Cutting a job short where the device takes the printer's bytes as they are.
//!
//! Problem: part of a job that is no longer wanted has been sent. Cut off anywhere, the printer would read the next job
//! as the rest of a row.
//! Method: to the end of the command under way, past what must be followed by a row, then the shortest legal ending,
//! both by [`protocol::rgl::Track`], as in the bridge.

use protocol::rgl::Track;

/// The bytes to send behind the first `at` bytes of a legal job so that the sheet, if one has begun, comes out and the
/// printer is ready for the next job. Nothing if the job had not begun or was already over.
pub fn ending(job: &[u8], at: usize) -> Vec<u8> {
    let at = at.min(job.len());
    let mut track = Track::new();
    let mut end = at;
    let mut can_end = at == 0 || track.follow(&job[..at]) == Some(at);
    while !can_end && end < job.len() {
        can_end = track.follow(&job[end..=end]).is_some();
        end += 1;
    }
    // What is no legal job is sent as it is.
    if !can_end || track.is_foreign() {
        return job[at..].to_vec();
    }
    [&job[at..end], &track.ending()[..]].concat()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inspect::inspect;
    use crate::job::stream::write_job;
    use crate::separate::Pass;
    use observe::Silent;
    use proptest::prelude::*;
    use protocol::ink::Ink;
    use protocol::paper::Paper;
    use protocol::rgl::Page;
    use sheet::Plane;

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
