//! The printer's side of a negotiation: it tells its device ID and its status in nibble mode, a step at each look at the host's lines.
//!
//! Method: the host waits for the printer in every phase of IEEE 1284's nibble mode, so the processor may look as seldom as the standard's
//! 35 ms allow. The mode's number is read when nAutoFd has risen behind its strobe; it still stands then. Bytes may come from event 27
//! on, for which the host waits, too. Limits: device ID (mode 4) and plain nibbles (mode 0); all others are refused.

/// The host's lines.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Host {
    /// Data1..Data8.
    pub data: u8,
    /// nAutoFd.
    pub auto_feed: bool,
    /// nSelectIn.
    pub select_in: bool,
}

/// The lines that tell how a printer is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Status {
    /// PError.
    pub paper_out: bool,
    /// Select.
    pub select: bool,
    /// nFault.
    pub fault: bool,
}

impl Status {
    /// Paper, on line, no fault.
    pub const READY: Status = Status { paper_out: false, select: true, fault: true };
}

/// All lines of the printer's.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Own {
    /// nAck.
    pub ack: bool,
    /// Busy.
    pub busy: bool,
    /// The others.
    pub status: Status,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Phase {
    Forward,
    /// Events 1 and 2 are past: the host strobes the mode.
    Asked,
    /// It may take the next nibble, this one of all.
    Offering(usize),
    /// It takes this one.
    Telling(usize),
    /// Event 22 is past.
    Leaving,
    /// Event 25.
    Left,
}

/// What the host asks for.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Mode {
    /// The device ID, behind its length.
    Id,
    /// What the printer has to say.
    Plain,
    Unknown,
}

/// A printer that negotiates.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Nibble {
    phase: Phase,
    mode: Mode,
}

impl Default for Nibble {
    fn default() -> Self {
        Nibble { phase: Phase::Forward, mode: Mode::Unknown }
    }
}

impl Nibble {
    /// Whether bytes may come: from the printer's last answer in a negotiation on.
    pub fn takes_bytes(&self) -> bool {
        matches!(self.phase, Phase::Forward | Phase::Left)
    }

    /// Whether the host has taken all of what the printer had to say.
    pub fn has_said(&self) -> bool {
        self.mode == Mode::Plain && matches!(self.phase, Phase::Leaving | Phase::Left)
    }

    /// What the printer's lines are to be from now on, if they change. `status` is how they are outside of a negotiation; `id` is the device
    /// ID without its length, `say` what the printer has to say.
    pub fn look(&mut self, host: Host, status: Status, id: &str, say: &[u8]) -> Option<Own> {
        let answered = self.phase == Phase::Asked && host.select_in && host.auto_feed;
        if answered {
            self.mode = match host.data {
                4 => Mode::Id,
                0 => Mode::Plain,
                _ => Mode::Unknown,
            };
        }
        let length = (id.len() as u16 + 2).to_be_bytes();
        let (head, rest) = match self.mode {
            Mode::Id => (&length[..], id.as_bytes()),
            Mode::Plain => (&[][..], say),
            Mode::Unknown => (&[][..], &[][..]),
        };
        let nibbles = 2 * (head.len() + rest.len());
        let offer = |next| {
            let none = next >= nibbles;
            // XFlag says yes by 1, but to plain nibble mode by 0.
            let status = Status { paper_out: none, select: self.mode == Mode::Id, fault: none };
            Own { ack: true, busy: false, status }
        };
        let known = Status { paper_out: true, select: true, fault: true };
        let (phase, own) = match self.phase {
            Phase::Forward if host.select_in && !host.auto_feed => {
                (Phase::Asked, Own { ack: false, busy: false, status: known })
            }
            Phase::Asked if answered => (Phase::Offering(0), offer(0)),
            Phase::Offering(next) if host.select_in && !host.auto_feed && next < nibbles => {
                let byte = head.iter().chain(rest).nth(next / 2).copied().unwrap_or(0);
                let nibble = byte >> (4 * (next % 2)) & 0xf;
                let bit = |bit: u8| nibble >> bit & 1 == 1;
                let status = Status { fault: bit(0), select: bit(1), paper_out: bit(2) };
                (Phase::Telling(next), Own { ack: false, busy: bit(3), status })
            }
            Phase::Telling(last) if host.select_in && host.auto_feed => {
                (Phase::Offering(last + 1), offer(last + 1))
            }
            Phase::Asked | Phase::Offering(_) | Phase::Telling(_) if !host.select_in => {
                (Phase::Leaving, Own { ack: false, busy: false, status: known })
            }
            Phase::Leaving if !host.auto_feed => (Phase::Left, Own { ack: true, busy: false, status }),
            Phase::Left if host.auto_feed => {
                *self = Nibble::default();
                return None;
            }
            _ => return None,
        };
        self.phase = phase;
        Some(own)
    }
}
