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
