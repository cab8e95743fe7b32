//! From the packets of a printer interface to jobs of the engine.
//!
//! Problem: the class knows no jobs, only bytes, a reset, and a host that goes away. Method: bytes go to the engine as they
//! come. While it takes none, because a job of the link is open or its memory is full, the packet in hand is offered again
//! every millisecond; no other is read meanwhile, which is a NAK to the host, so nothing is lost. A job is over
//!
//! * behind the reset that ends every job in the printer's language: the engine sees it go by;
//! * when the host resets the interface: what has not begun is dropped;
//! * when the host is gone: nobody will send the rest;
//! * after a silence, once everything that came has been sent to the printer: 300 s with a sheet in it (a
//!   program that computes a page while it prints is silent for minutes at worst), 5 s without.
//!
//! A job that breaks off is brought to a legal end or, if it was never in the printer's language, left as it is.

use crate::engine::Engine;

/// The most bytes of a packet.
pub const PACKET: usize = 64;

/// Between two offers of the packet in hand.
const AGAIN_US: u64 = 1000;

/// Between two checks whether a job only waits for more.
const CHECK_US: u64 = 1_000_000;

/// Checks in a row after which a job with a sheet in the printer is ended, and after which one without is.
const CHECKS: [u32; 2] = [300, 5];

/// Why no more of a job comes.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum End {
    /// The host has reset the interface.
    Reset,
    /// The host is gone.
    Gone,
}

/// What the intake waits for.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Next {
    /// A packet, or this time in µs.
    Packet(u64),
    /// This time in µs; no packet may come before it.
    Time(u64),
}

/// What becomes of the bytes of a printer interface.
pub struct Intake {
    /// The packet in hand, or the last one.
    packet: [u8; PACKET],
    /// What of it the engine has not taken.
    left: core::ops::Range<usize>,
    /// When the packet in hand is offered again, or else when the next check is due.
    due_us: u64,
    /// Checks since the last packet at which the job only waited.
    waited: u32,
}

impl Intake {
    /// Nothing has come.
    pub const fn new() -> Self {
        Intake { packet: [0; PACKET], left: 0..0, due_us: 0, waited: 0 }
    }

    /// The host has configured the interface.
    pub fn connect(&mut self, now_us: u64) {
        self.drop_packet(now_us);
        self.waited = 0;
    }

    /// What to wait for. Then one of the following, and this again.
    pub fn next(&self) -> Next {
        if self.left.is_empty() { Next::Packet(self.due_us) } else { Next::Time(self.due_us) }
    }

    /// Where to put the next packet. Only when [`Intake::next`] allows one.
    pub fn buffer(&mut self) -> &mut [u8; PACKET] {
        &mut self.packet
    }

    /// A packet of so many bytes has come to the [buffer](Intake::buffer).
    pub fn receive(&mut self, count: usize, engine: &mut Engine<'_>, now_us: u64) {
        self.waited = 0;
        self.left = 0..count.min(PACKET);
        self.offer(engine, now_us);
    }

    /// No more of the present job comes.
    pub fn end(&mut self, end: End, engine: &mut Engine<'_>, now_us: u64) {
        self.drop_packet(now_us);
        match end {
            End::Reset => engine.local_reset(),
            End::Gone => engine.local_end(),
        }
    }

    /// The time that [`Intake::next`] has named has come.
    pub fn wake(&mut self, engine: &mut Engine<'_>, now_us: u64) {
        if !self.left.is_empty() {
            return self.offer(engine, now_us);
        }
        self.due_us = now_us + CHECK_US;
        let limit = match engine.local_waits() {
            None => {
                self.waited = 0;
                return;
            }
            Some(true) => CHECKS[0],
            Some(false) => CHECKS[1],
        };
        self.waited += 1;
        if self.waited >= limit {
            self.end(End::Gone, engine, now_us);
        }
    }

    /// Offers the packet in hand for as long as the engine takes some of it.
    fn offer(&mut self, engine: &mut Engine<'_>, now_us: u64) {
        while !self.left.is_empty() {
            let count = engine.local(&self.packet[self.left.clone()]);
            if count == 0 {
                self.due_us = now_us + AGAIN_US;
                return;
            }
            self.left.start += count;
        }
        self.drop_packet(now_us);
    }

    /// Forgets the packet in hand.
    fn drop_packet(&mut self, now_us: u64) {
        self.left = 0..0;
        self.due_us = now_us + CHECK_US;
    }
}

impl Default for Intake {
    fn default() -> Self {
        Self::new()
    }
}
