//! A job of which a printer may hold a part, judged by what the bridge says of it.

use protocol::link::message::{JobState, PastJob, Progress};

/// A job of which a printer may hold a part.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Unfinished {
    /// Its number, as it is shown to people.
    pub job: String,
    /// The start of the bridge in which its first byte left; unknown if the fact cannot be read.
    pub boot: Option<u32>,
}

/// What a bridge's own answer says of an unfinished job.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Standing {
    /// It ended in an orderly way: the printer is ready.
    Ended {
        /// Bytes that crossed the port.
        printed: u32,
        /// Whether these were all.
        whole: bool,
    },
    /// The bridge still has it, or resets the printer by itself before anything else.
    WithBridge,
    /// The bridge has lost its memory: the printer needs a reset.
    ResetOwed,
}

impl Unfinished {
    /// Whether it was noted in this start of the bridge. It may not have begun there yet; only its sender closes it.
    pub(crate) fn is_of(&self, boot: Option<u32>) -> bool {
        self.boot.is_some() && self.boot == boot
    }

    /// Judges by what the bridge, in its start `boot`, says of its last job and remembers of those before. A bridge takes a new
    /// job only when the last one has ended, so within one start another job in its place proves that this one has.
    pub(crate) fn standing<'p>(
        &self,
        boot: u32,
        progress: &Progress,
        past: impl IntoIterator<Item = &'p PastJob>,
    ) -> Standing {
        let is_this = |job: u32| u32::from_str_radix(&self.job, 16) == Ok(job) && job != 0;
        let past = past.into_iter().find(|past| is_this(past.job));
        let (state, printed, this) = match past {
            Some(past) => (past.state, past.printed, true),
            None => (progress.state, progress.printed, is_this(progress.job)),
        };
        match state {
            JobState::Done if this => Standing::Ended { printed, whole: true },
            JobState::Cancelled | JobState::Broken(_) if this => Standing::Ended { printed, whole: false },
            _ if this => Standing::WithBridge,
            JobState::None => Standing::ResetOwed,
            // It may have been lost; then the bridge still knows that it has to reset the printer.
            _ if self.boot == Some(boot) => Standing::WithBridge,
            _ => Standing::ResetOwed,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn progress(job: u32, state: JobState) -> Progress {
        Progress { job, state, accepted: 0, limit: 0, printed: 9, pass: 0, row: 0 }
    }

    #[test]
    fn a_bridge_that_shows_the_job_or_has_not_restarted_needs_no_reset_from_outside() {
        let job = Unfinished { job: "0000000a".into(), boot: Some(5) };
        let ended = |whole| Standing::Ended { printed: 9, whole };
        for (boot, job_shown, state, expected) in [
            (5, 0xa, JobState::Printing, Standing::WithBridge),
            (6, 0xa, JobState::Printing, Standing::WithBridge),
            (5, 0xa, JobState::Lost, Standing::WithBridge),
            (6, 0xa, JobState::Done, ended(true)),
            (6, 0xa, JobState::Cancelled, ended(false)),
            (5, 0xb, JobState::Done, Standing::WithBridge),
            (6, 0xb, JobState::Done, Standing::ResetOwed),
            (6, 0xb, JobState::Printing, Standing::ResetOwed),
            (6, 0, JobState::None, Standing::ResetOwed),
            // Numbers of starts are drawn, and one may come twice.
            (5, 0, JobState::None, Standing::ResetOwed),
        ] {
            assert_eq!(
                job.standing(boot, &progress(job_shown, state), &[]),
                expected,
                "{boot} {job_shown:x} {state:?}"
            );
        }
        let unknown = Unfinished { boot: None, ..job };
        assert_eq!(unknown.standing(5, &progress(0xb, JobState::Done), &[]), Standing::ResetOwed);
    }

    #[test]
    fn a_bridge_that_remembers_how_the_job_ended_decides_behind_other_jobs_and_restarts() {
        let job = Unfinished { job: "0000000a".into(), boot: Some(5) };
        let other = PastJob { job: 0xb, state: JobState::Done, printed: 4 };
        for (state, expected) in [
            (JobState::Done, Standing::Ended { printed: 7, whole: true }),
            (JobState::Cancelled, Standing::Ended { printed: 7, whole: false }),
            (JobState::Lost, Standing::WithBridge),
        ] {
            let past = [other, PastJob { job: 0xa, state, printed: 7 }];
            for shown in [JobState::Done, JobState::Printing, JobState::Lost] {
                assert_eq!(job.standing(6, &progress(0xc, shown), &past), expected, "{state:?}, {shown:?}");
            }
        }
    }
}
