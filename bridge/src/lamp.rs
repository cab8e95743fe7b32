//! The lamp: what it says about the job.

use protocol::link::message::JobState;

/// Steps of a pattern, after which it begins again.
pub const STEPS: u32 = 32;

/// The length of a step, in ms.
pub const STEP_MS: u32 = 50;

/// Whether the lamp is lit in this step.
pub fn is_lit(state: JobState, step: u32) -> bool {
    pattern(state) >> (step % STEPS) & 1 == 1
}

/// The steps in which the lamp is lit, from the lowest bit.
fn pattern(state: JobState) -> u32 {
    match state {
        // One short blink: nothing to do.
        JobState::None | JobState::Done | JobState::Cancelled => 0x0000_0003,
        // Even flashing: a job is being printed.
        JobState::Printing | JobState::Cancelling => 0x3333_3333,
        // Two blinks: the printer wants attention.
        JobState::Stopped(_) => 0x0000_0c03,
        // Three blinks: the last job was damaged or lost.
        JobState::Broken(_) | JobState::Lost => 0x0030_0c03,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::link::message::{Defect, DefectKind, Fault};

    /// How often the lamp goes on in a pattern that repeats.
    fn blinks(state: JobState) -> usize {
        (0..STEPS).filter(|&step| is_lit(state, step) && !is_lit(state, step + STEPS - 1)).count()
    }

    #[test]
    fn the_blinks_are_those_of_the_manual() {
        for state in [JobState::None, JobState::Done, JobState::Cancelled] {
            assert_eq!(blinks(state), 1);
        }
        for state in [JobState::Printing, JobState::Cancelling] {
            assert_eq!(blinks(state), 8);
        }
        assert_eq!(blinks(JobState::Stopped(Fault::PaperOut)), 2);
        assert_eq!(blinks(JobState::Broken(Defect { at: 0, what: DefectKind::Header })), 3);
        assert_eq!(blinks(JobState::Lost), 3);
        // No pattern is dark or still.
        assert!((0..STEPS).any(|step| !is_lit(JobState::Printing, step)));
    }
}
