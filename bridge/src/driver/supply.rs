//! Which fault the status lines show, once short dropouts of the printer's supply are filtered out.
//!
//! Problem: a printer that is switched off in a job has lost the job, so the bridge gives the sheet up; a spike on the +5 V
//! line must not cost a sheet. Method: the supply counts as gone when every reading of it has been low for
//! [`GONE_US`]. A shorter dropout, and the beginning of a longer one, is reported as [`Fault::Error`]: the job
//! stops and goes on. Limits: a dropout between two readings, one millisecond apart, is not seen.

use protocol::link::message::{Fault, Lines};

/// How long the supply must be absent before the printer counts as switched off.
pub(crate) const GONE_US: u64 = 20_000;

/// The printer's supply as it was read so far.
pub(crate) struct Supply {
    /// When it was last present.
    seen_us: u64,
}

impl Supply {
    /// A supply that is present at `now_us`.
    pub(crate) fn new(now_us: u64) -> Self {
        Supply { seen_us: now_us }
    }

    /// The fault that the lines show, which [`Lines::heeding`] has filtered.
    pub(crate) fn fault(&mut self, lines: Lines, now_us: u64) -> Option<Fault> {
        if lines.high(Lines::POWER) {
            self.seen_us = now_us;
        }
        match lines.fault() {
            Some(Fault::PowerOff) if now_us - self.seen_us < GONE_US => Some(Fault::Error),
            fault => fault,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const OFF: Lines = Lines(Lines::IDLE.0 & !Lines::POWER);

    proptest! {
        #[test]
        fn the_printer_is_off_only_after_twenty_milliseconds_without_a_reading_of_its_supply(
            readings in prop::collection::vec((any::<bool>(), 100u64..9_000), 1..200),
        ) {
            let mut supply = Supply::new(0);
            let (mut now, mut low_since) = (0, 0);
            for (on, step) in readings {
                now += step;
                if on {
                    low_since = now;
                }
                let expected = match on {
                    true => None,
                    false if now - low_since < 20_000 => Some(Fault::Error),
                    false => Some(Fault::PowerOff),
                };
                prop_assert_eq!(supply.fault(if on { Lines::IDLE } else { OFF }, now), expected);
            }
        }
    }

    #[test]
    fn a_slow_ramp_that_chatters_about_the_threshold_counts_from_the_last_high_reading() {
        let mut supply = Supply::new(0);
        // The level crosses the threshold again and again for 300 ms, and is never low for 20 ms.
        for ms in 0..300u64 {
            let lines = if ms % 19 == 0 { Lines::IDLE } else { OFF };
            assert_ne!(supply.fault(lines, ms * 1000), Some(Fault::PowerOff), "at {ms} ms");
        }
        // The last high reading was at 285 ms.
        assert_eq!(supply.fault(OFF, 304_999), Some(Fault::Error));
        assert_eq!(supply.fault(OFF, 305_000), Some(Fault::PowerOff));
        // The same on the way up: one high reading is enough, since a strobe needs all lines at that moment.
        assert_eq!(supply.fault(Lines::IDLE, 306_000), None);
        assert_eq!(supply.fault(OFF, 307_000), Some(Fault::Error));
    }

    #[test]
    fn other_faults_are_reported_at_once_and_the_supply_comes_first() {
        let mut supply = Supply::new(0);
        let paper_out = Lines(Lines::IDLE.0 | Lines::PAPER_OUT);
        assert_eq!(supply.fault(paper_out, 1), Some(Fault::PaperOut));
        let off = Lines(paper_out.0 & !Lines::POWER);
        assert_eq!(supply.fault(off, 2), Some(Fault::Error));
        assert_eq!(supply.fault(off, 20_001), Some(Fault::PowerOff));
    }
}
