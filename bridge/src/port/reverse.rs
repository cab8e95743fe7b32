//! Negotiation and nibble mode: bytes from the printer over its five status lines.
//!
//! Problem: the standard gives a printer 35 ms for each of its answers, and everything else has to go on meanwhile. Method: a
//! [`Conversation`] is taken up again and again, each time for a few hundred looks at the lines, and remembers its event. A
//! printer that answers at once is read without a pause.
//!
//! The data lines stay outputs, so one-way buffers do. A printer that does not know IEEE 1284 does not answer
//! the first step within 35 ms; the lines then go back to where they were and forward printing goes on.
//! The event numbers are the standard's.
//!
//! Cost: [`Port::converse`] looks at the lines [`LOOKS`] times at most, a microsecond apart. Limits: the printer's time counts
//! from call to call, so a caller that comes late gives it longer.

use super::{AckPin, DataBus, Port};
use core::convert::Infallible;
use embedded_hal::delay::DelayNs;
use embedded_hal::digital::{InputPin, OutputPin};
use protocol::link::message::Lines;

/// Why nothing could be read.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum ReverseError {
    /// The printer is busy, so its buffered data are not to be risked; or its supply is absent.
    NotIdle,
    /// No answer to the negotiation: not a 1284 device, or switched off.
    OneWay,
    /// The printer negotiates but does not offer this mode.
    Refused,
    /// It stopped in the middle. What had come until then stands in the buffer: so many bytes.
    Silent(usize),
}

/// What the printer is to send.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Reverse {
    /// Its device ID as it sends it, two length bytes and text. The length bytes are not believed (printers send them in either
    /// order, or wrong): it ends where the printer says that there is no more.
    DeviceId,
    /// What it has to say now, often nothing. An answer to a question may take the printer seconds: ask again.
    Answer,
}

impl Reverse {
    /// The extensibility byte: device ID in nibble mode, or nibble mode.
    fn mode(self) -> u8 {
        match self {
            Reverse::DeviceId => 0x04,
            Reverse::Answer => 0x00,
        }
    }
}

/// Limit of the standard for every answer of the printer, in µs, and what the Linux driver adds to it.
const ANSWER_US: u64 = 40_000;

/// Between two looks, in µs.
const LOOK_US: u32 = 1;

/// Looks at the lines before [`Port::converse`] returns to its caller: an RP2040 takes 10 µs for each, and no
/// task may keep it for a millisecond.
const LOOKS: u32 = 75;

/// What the printer is waited for.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Event {
    /// Nothing yet: the conversation has not begun.
    Begin,
    /// Event 2: it knows IEEE 1284.
    Known,
    /// Events 5 and 6: it has taken the mode.
    Mode,
    /// Event 9: a nibble is on the lines.
    Nibble,
    /// Event 11: it has seen that the nibble was read.
    Read,
    /// Event 24, on the way back.
    Leaving,
    /// Event 27.
    Left,
}

/// A conversation in the reverse direction.
pub struct Conversation {
    what: Reverse,
    event: Event,
    /// Since when the event is waited for, by the caller's clock.
    since_us: u64,
    /// The lower half of the byte under way.
    low: Option<u8>,
    /// Bytes in the buffer.
    count: usize,
    /// What to report when the port is back in compatibility mode.
    outcome: Result<usize, ReverseError>,
}

impl Conversation {
    /// One that has not begun.
    pub fn new(what: Reverse) -> Self {
        Conversation { what, event: Event::Begin, since_us: 0, low: None, count: 0, outcome: Ok(0) }
    }

    /// The way back out of one that somebody else has begun: event 22, which [rest](Port::rest) makes, was
    /// now. Nothing is read, so its outcome is [`ReverseError::NotIdle`].
    pub fn way_back(now_us: u64) -> Self {
        let outcome = Err(ReverseError::NotIdle);
        Conversation {
            event: Event::Leaving,
            since_us: now_us,
            outcome,
            ..Conversation::new(Reverse::Answer)
        }
    }
}

impl<D, O, I, A, T> Port<D, O, I, A, T>
where
    D: DataBus,
    O: OutputPin<Error = Infallible>,
    I: InputPin<Error = Infallible>,
    A: AckPin,
    T: DelayNs,
{
    /// Goes on with a conversation: the same buffer each time, which gets as much as fits. Returns how many bytes have come, once
    /// the port is back in compatibility mode; until then, call it again soon.
    pub fn converse(
        &mut self,
        talk: &mut Conversation,
        buffer: &mut [u8],
        now_us: u64,
    ) -> Option<Result<usize, ReverseError>> {
        for _ in 0..LOOKS {
            let lines = self.lines();
            if !lines.heeding(self.heed).high(Lines::POWER) {
                self.rest();
                return Some(Err(ReverseError::NotIdle));
            }
            if self.has_come(talk, lines) {
                talk.since_us = now_us;
                if self.go_on(talk, lines, buffer) {
                    return Some(talk.outcome);
                }
            } else if now_us.saturating_sub(talk.since_us) >= ANSWER_US {
                talk.since_us = now_us;
                if self.give_up(talk) {
                    return Some(talk.outcome);
                }
            } else {
                self.delay.delay_us(LOOK_US);
            }
        }
        None
    }

    /// Whether the lines show the event.
    fn has_come(&self, talk: &Conversation, lines: Lines) -> bool {
        let ack = lines.high(Lines::ACK);
        match talk.event {
            Event::Begin => true,
            Event::Known => lines.high(Lines::PAPER_OUT | Lines::SELECT | Lines::FAULT) && !ack,
            Event::Nibble | Event::Leaving => !ack,
            // The other lines are valid before nAck moves.
            Event::Mode | Event::Read | Event::Left => ack,
        }
    }

    /// Takes the step behind the event; true at the end.
    fn go_on(&mut self, talk: &mut Conversation, lines: Lines, buffer: &mut [u8]) -> bool {
        match talk.event {
            Event::Begin => {
                if lines.high(Lines::BUSY) {
                    talk.outcome = Err(ReverseError::NotIdle);
                    return true;
                }
                self.pins.data.put(talk.what.mode());
                self.delay.delay_us(10);
                let (Ok(()), Ok(())) = (self.pins.select_in.set_high(), self.pins.auto_feed.set_low());
                talk.event = Event::Known;
            }
            Event::Known => {
                let Ok(()) = self.pins.strobe.set_low();
                self.delay.delay_us(5);
                let (Ok(()), Ok(())) = (self.pins.strobe.set_high(), self.pins.auto_feed.set_high());
                talk.event = Event::Mode;
            }
            // XFlag: 0 says yes to plain nibble mode, which every 1284 device has, and no to everything else.
            Event::Mode if lines.high(Lines::SELECT) != (talk.what != Reverse::Answer) => {
                self.leave(talk, Err(ReverseError::Refused));
            }
            Event::Mode => self.next_byte(talk, lines, buffer),
            Event::Nibble => {
                let bits = [Lines::FAULT, Lines::SELECT, Lines::PAPER_OUT, Lines::BUSY];
                let nibble = bits
                    .iter()
                    .enumerate()
                    .fold(0, |nibble, (i, &line)| nibble | u8::from(lines.high(line)) << i);
                let Ok(()) = self.pins.auto_feed.set_high();
                if let Some(low) = talk.low.take() {
                    buffer[talk.count] = low | nibble << 4;
                    talk.count += 1;
                } else {
                    talk.low = Some(nibble);
                }
                talk.event = Event::Read;
            }
            Event::Read if talk.low.is_some() => self.ask_nibble(talk),
            Event::Read => self.next_byte(talk, lines, buffer),
            Event::Leaving => {
                let Ok(()) = self.pins.auto_feed.set_low();
                talk.event = Event::Left;
            }
            Event::Left => {
                self.rest();
                return true;
            }
        }
        false
    }

    /// The printer has not come to the event in its time; true at the end. One that does not follow is left behind by force,
    /// which the standard allows at any time.
    fn give_up(&mut self, talk: &mut Conversation) -> bool {
        match talk.event {
            Event::Begin | Event::Known => talk.outcome = Err(ReverseError::OneWay),
            Event::Mode => {
                self.leave(talk, Err(ReverseError::OneWay));
                return false;
            }
            Event::Nibble | Event::Read => {
                self.leave(talk, Err(ReverseError::Silent(talk.count)));
                return false;
            }
            Event::Leaving | Event::Left => {}
        }
        self.rest();
        true
    }

    /// Event 7 for the next byte, if there is one and it has room.
    fn next_byte(&mut self, talk: &mut Conversation, lines: Lines, buffer: &[u8]) {
        if talk.count == buffer.len() || lines.high(Lines::FAULT) {
            self.leave(talk, Ok(talk.count));
        } else {
            self.ask_nibble(talk);
        }
    }

    fn ask_nibble(&mut self, talk: &mut Conversation) {
        let Ok(()) = self.pins.auto_feed.set_low();
        talk.event = Event::Nibble;
    }

    /// Event 22.
    fn leave(&mut self, talk: &mut Conversation, outcome: Result<usize, ReverseError>) {
        let (Ok(()), Ok(())) = (self.pins.select_in.set_low(), self.pins.auto_feed.set_high());
        (talk.event, talk.outcome) = (Event::Leaving, outcome);
    }
}
