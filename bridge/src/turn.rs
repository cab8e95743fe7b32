//! The engine's work in turns, between which others may run.
//!
//! A slice of the engine's work takes up to 0.4 ms on the microcontroller, and a page is millions of them; the link has to be
//! answered within 5 ms meanwhile. So the engine works for 0.2 ms and for the slice under way, and then others run. The link has room for
//! one packet of 64 bytes; where a job is hardly shorter than what it becomes, that is too little for a turn, and turns are shorter.

use crate::engine::Engine;

/// The length of a turn, in µs. The sender has bytes for ten times as long.
const TURN_US: u64 = 200;

/// Its length while data run short: a byte takes the port 2.4 µs, a packet more than 150.
const SHORT_US: u64 = 50;

/// What came of a turn.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Turn {
    /// There may be more work: let others run, and take another turn.
    pub more: bool,
    /// The port had nothing to send and has something now.
    pub wake_port: bool,
    /// A job waits to begin, which has to be noted first.
    pub wake_store: bool,
}

/// Lets the engine work for a turn, by a clock in µs.
pub fn work(engine: &mut Engine<'_>, now_us: impl Fn() -> u64) -> Turn {
    let length_us = if engine.runs_short() { SHORT_US } else { TURN_US };
    let (empty, end_us) = (engine.output().is_empty(), now_us() + length_us);
    let mut more = engine.work();
    while more && now_us() < end_us {
        more = engine.work();
    }
    let wake_store = engine.waits_to_begin().is_some();
    Turn { more, wake_port: empty && !engine.output().is_empty(), wake_store }
}
