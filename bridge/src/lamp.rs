//! The lamp: what it says about the job, for people without a screen.

use crate::engine::Engine;
use protocol::link::message::{Fault, JobState};

/// Steps of a pattern, after which it begins again.
pub const STEPS: u32 = 32;

/// The length of a step, in ms.
pub const STEP_MS: u32 = 50;

/// For how many steps nothing may cross the port before the printer counts as waiting for somebody: 30 s. A printer that asks for a
/// cartridge may just be busy, and so is one that fetches a cartridge or prints a row, for seconds.
const PATIENCE: u32 = 30_000 / STEP_MS;

/// What the lamp says.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Sign {
    /// Nothing to do.
    Idle,
    /// A stored job waits for the button.
    Waiting,
    /// A job is being stored.
    Storing,
    /// A job is being printed.
    Printing,
    /// The job is held with the button.
    Held,
    /// The printer wants somebody: a cartridge, paper, its cover closed, its switch.
    Attention,
    /// The last job was damaged or lost.
    Lost,
}

/// The lamp.
#[derive(Default)]
pub struct Lamp {
    step: u32,
    /// Bytes that had crossed the port, and for how many steps there have been so many.
    printed: u32,
    still: u32,
}

impl Lamp {
    /// A lamp at the beginning of a pattern.
    pub const fn new() -> Self {
        Lamp { step: 0, printed: 0, still: 0 }
    }

    /// Whether the lamp is lit in the next step.
    pub fn next(&mut self, engine: &Engine<'_>) -> bool {
        let progress = engine.progress();
        self.still = if progress.printed == self.printed { self.still.saturating_add(1) } else { 0 };
        self.printed = progress.printed;
        let sign =
            sign(progress.state, engine.waits_for_printer() && self.still >= PATIENCE, engine.stored_jobs());
        self.step = (self.step + 1) % STEPS;
        is_lit(sign, self.step)
    }
}

/// What the lamp says of a state; `stuck` that nothing has crossed the port for long, and how many jobs are stored.
fn sign(state: JobState, stuck: bool, stored: usize) -> Sign {
    match state {
        JobState::Stopped(Fault::Held) => Sign::Held,
        JobState::Stopped(_) => Sign::Attention,
        JobState::Printing | JobState::Cancelling if stuck => Sign::Attention,
        JobState::Printing | JobState::Cancelling => Sign::Printing,
        JobState::Storing => Sign::Storing,
        JobState::Broken(_) | JobState::Lost => Sign::Lost,
        JobState::None | JobState::Done | JobState::Cancelled | JobState::Stored if stored > 0 => {
            Sign::Waiting
        }
        JobState::None | JobState::Done | JobState::Cancelled | JobState::Stored => Sign::Idle,
    }
}

/// Whether the lamp is lit in this step.
fn is_lit(sign: Sign, step: u32) -> bool {
    pattern(sign) >> (step % STEPS) & 1 == 1
}

/// The steps in which the lamp is lit, from the lowest bit.
fn pattern(sign: Sign) -> u32 {
    match sign {
        // One short blink.
        Sign::Idle => 0x0000_0003,
        // One long blink, as long as it is dark.
        Sign::Waiting => 0x0000_ffff,
        // Even flashing.
        Sign::Printing => 0x3333_3333,
        // Flickering.
        Sign::Storing => 0x5555_5555,
        // Lit, with one short gap.
        Sign::Held => 0xffff_fff0,
        // Two blinks.
        Sign::Attention => 0x0000_0c03,
        // Three blinks.
        Sign::Lost => 0x0030_0c03,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::link::message::{Defect, DefectKind};

    const SIGNS: [Sign; 7] =
        [Sign::Idle, Sign::Waiting, Sign::Storing, Sign::Printing, Sign::Held, Sign::Attention, Sign::Lost];

    /// How often the lamp goes on in a pattern that repeats, and in how many steps it is lit.
    fn look(sign: Sign) -> (usize, usize) {
        let on = (0..STEPS).filter(|&step| is_lit(sign, step) && !is_lit(sign, step + STEPS - 1)).count();
        (on, (0..STEPS).filter(|&step| is_lit(sign, step)).count())
    }

    #[test]
    fn the_blinks_are_those_of_the_manual() {
        let expected = [(1, 2), (1, 16), (16, 16), (8, 16), (1, 28), (2, 4), (3, 6)];
        assert_eq!(SIGNS.map(look), expected);
    }

    #[test]
    fn every_state_has_a_sign() {
        let broken = JobState::Broken(Defect { at: 0, what: DefectKind::Header });
        for (state, stored, expected) in [
            (JobState::None, 0, Sign::Idle),
            (JobState::Done, 0, Sign::Idle),
            (JobState::Done, 1, Sign::Waiting),
            (JobState::Cancelled, 2, Sign::Waiting),
            (JobState::Stored, 1, Sign::Waiting),
            (JobState::Storing, 1, Sign::Storing),
            (JobState::Printing, 1, Sign::Printing),
            (JobState::Cancelling, 0, Sign::Printing),
            (JobState::Stopped(Fault::PaperOut), 1, Sign::Attention),
            (JobState::Stopped(Fault::Held), 1, Sign::Held),
            (broken, 1, Sign::Lost),
            (JobState::Lost, 1, Sign::Lost),
        ] {
            assert_eq!(sign(state, false, stored), expected, "{state:?}");
        }
        assert_eq!(sign(JobState::Printing, true, 0), Sign::Attention);
        assert_eq!(sign(JobState::Done, true, 0), Sign::Idle);
    }
}
