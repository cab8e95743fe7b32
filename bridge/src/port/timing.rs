//! The times of the forward direction.

use protocol::link::message::{Handshake, Lines, PortSettings};

/// Times around the strobe, in ns.
///
/// Every figure asked for anywhere (1284: 750/750/750; older interfaces: 500/500/500; FIFO hardware:
/// 600/600/450) is met by the default.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Timing {
    /// Data valid before nStrobe falls.
    pub setup: u32,
    /// nStrobe low.
    pub strobe: u32,
    /// Data kept after nStrobe rises.
    pub hold: u32,
    /// From nStrobe falling until Busy is believed: a printer may raise it that late, and reading it earlier
    /// loses bytes.
    pub settle: u32,
}

/// Settings with a time that no printer could follow: nothing may be shorter than 100 ns, and nStrobe must not
/// be low for longer than 500 µs (which no setting can ask for) nor Busy be believed before 100 ns.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct BadSettings;

impl Timing {
    /// 800 ns around the strobe: above the standard's 750, and a whole number of ticks of a 10 MHz clock.
    pub const DEFAULT: Timing = Timing { setup: 800, strobe: 800, hold: 800, settle: 500 };
    /// Older printers and short cables.
    pub const FAST: Timing = Timing { setup: 500, strobe: 500, hold: 500, settle: 500 };
    /// What the Linux driver does.
    pub const SAFE: Timing = Timing { setup: 1000, strobe: 1000, hold: 1000, settle: 1000 };
    /// Long cables, slow open-collector drivers.
    pub const SLOW: Timing = Timing { setup: 5000, strobe: 5000, hold: 5000, settle: 5000 };

    /// How long a printer may be busy without an error before that is called a fault: changing a ribbon by hand
    /// takes minutes.
    pub const PATIENCE_MS: u32 = 600_000;

    /// The shortest time worth asking for.
    const LEAST: u16 = 100;

    /// The times of these settings.
    pub fn from_settings(settings: &PortSettings) -> Result<Timing, BadSettings> {
        let PortSettings { setup_ns, strobe_ns, hold_ns, settle_ns, .. } = *settings;
        if [setup_ns, strobe_ns, hold_ns, settle_ns].iter().any(|&ns| ns < Self::LEAST) {
            return Err(BadSettings);
        }
        let [setup, strobe, hold, settle] = [setup_ns, strobe_ns, hold_ns, settle_ns].map(u32::from);
        Ok(Timing { setup, strobe, hold, settle })
    }

    /// The divider of a clock of `clock_hz`, in 1/256, that makes a tick at least an eighth of the longest of these times:
    /// for senders that give each time eight ticks.
    #[expect(clippy::cast_possible_truncation, reason = "at most 65.5 µs of cycles")]
    pub fn eighth(&self, clock_hz: u32) -> u32 {
        let longest = self.setup.max(self.strobe).max(self.hold).max(self.settle);
        // Whole clock cycles; one more, because a divider with a fraction may give eight ticks one cycle less than
        // eight times its value. At most 65.5 µs, so far below the range of a divider.
        let cycles = (u64::from(longest) * u64::from(clock_hz)).div_ceil(1_000_000_000) as u32 + 1;
        (cycles * 256).div_ceil(8).max(256)
    }

    /// These times with the Busy handshake and all lines heeded, as settings.
    pub fn settings(self) -> PortSettings {
        let ns = |time: u32| u16::try_from(time).unwrap_or(u16::MAX);
        PortSettings {
            setup_ns: ns(self.setup),
            strobe_ns: ns(self.strobe),
            hold_ns: ns(self.hold),
            settle_ns: ns(self.settle),
            handshake: Handshake::Busy,
            patience_s: u16::try_from(Self::PATIENCE_MS / 1000).unwrap_or(u16::MAX),
            heed: Lines::ALL,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn eight_ticks_of_the_clock_are_never_shorter_than_the_longest_time(
            times in prop::array::uniform4(100u32..=65_535),
            clock_mhz in 48u32..=266,
        ) {
            let [setup, strobe, hold, settle] = times;
            let divider = u64::from(Timing { setup, strobe, hold, settle }.eighth(clock_mhz * 1_000_000));
            let longest = u64::from(times.into_iter().max().unwrap_or(0));
            // A fractional divider skips or adds single cycles: eight ticks have eight times its value, rounded down.
            let cycles = 8 * divider / 256;
            prop_assert!(cycles * 1000 >= longest * u64::from(clock_mhz), "{} cycles", cycles);
            // And no more than two cycles longer, unless the clock itself is slower.
            prop_assert!(divider == 256 || (cycles - 2) * 1000 <= longest * u64::from(clock_mhz));
        }
    }
}
