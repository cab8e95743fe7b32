//! When to ask a printer for its device ID without having been told to.
//!
//! A printer is asked once each time it is switched on, after it has been ready for [`SETTLED_US`] without a break while
//! nobody used it and it was known to stand between two jobs. Only once, whatever comes of it: negotiating disturbs a printer that does not know IEEE 1284.

use protocol::link::message::Lines;

/// How long the printer must have been ready.
pub(crate) const SETTLED_US: u64 = 500_000;

/// Where the introduction stands.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Introduction {
    /// The printer is not ready, or someone uses it.
    Waiting,
    /// The printer has been ready since this time.
    ReadySince(u64),
    /// The printer has been asked since it was switched on.
    Asked,
}

/// What the lines call for.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Action {
    Nothing,
    /// Forget the device ID: the printer behind it was switched off, and may be another one by now.
    Forget,
    /// Ask for the device ID.
    Ask,
}

impl Introduction {
    /// Looks at the heeded lines. `free` says whether nobody uses the printer, and it may be asked.
    pub(crate) fn look(&mut self, lines: Lines, free: bool, now_us: u64) -> Action {
        if !lines.high(Lines::POWER) {
            let asked = core::mem::replace(self, Introduction::Waiting) == Introduction::Asked;
            return if asked { Action::Forget } else { Action::Nothing };
        }
        let ready = free && lines.fault().is_none() && !lines.high(Lines::BUSY);
        match *self {
            Introduction::Asked => {}
            _ if !ready => *self = Introduction::Waiting,
            Introduction::Waiting => *self = Introduction::ReadySince(now_us),
            Introduction::ReadySince(since) if now_us - since < SETTLED_US => {}
            Introduction::ReadySince(_) => {
                *self = Introduction::Asked;
                return Action::Ask;
            }
        }
        Action::Nothing
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_printer_is_asked_once_when_it_has_been_ready_and_free_for_half_a_second(
            looks in prop::collection::vec((0u8..24, any::<bool>(), 1_000u64..200_000), 1..300),
        ) {
            let mut introduction = Introduction::Waiting;
            let (mut now, mut ready_since, mut asked) = (0, None, false);
            for (lines, free, step) in looks {
                now += step;
                // Mostly idle; now and then a line shows something.
                let lines = if lines < 6 { Lines(Lines::IDLE.0 ^ 1 << lines) } else { Lines::IDLE };
                let free = free || step % 4 > 0;
                let (before, action) = (asked, introduction.look(lines, free, now));
                if !lines.high(Lines::POWER) {
                    (ready_since, asked) = (None, false);
                    prop_assert_eq!(action, if before { Action::Forget } else { Action::Nothing });
                    continue;
                }
                let ready = free && lines.fault().is_none() && !lines.high(Lines::BUSY);
                ready_since = ready.then(|| ready_since.unwrap_or(now));
                let due = !asked && ready_since.is_some_and(|since| now - since >= 500_000);
                prop_assert_eq!(action, if due { Action::Ask } else { Action::Nothing });
                asked |= due;
            }
        }
    }
}
