//! The engine's work in turns, between which others may run.
//!
//! A slice of the engine's work takes up to 0.4 ms on the microcontroller, and a page is millions of them; the link has to be
//! answered within 5 ms meanwhile. So the engine works for 0.2 ms and for the slice under way, and then others run.

use crate::engine::Engine;

/// The length of a turn, in µs. The sender has bytes for ten times as long.
const TURN_US: u64 = 200;

/// What came of a turn.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Turn {
    /// There may be more work: let others run, and take another turn.
    pub more: bool,
    /// The port had nothing to send and has something now.
    pub wake_port: bool,
}

/// Lets the engine work for a turn, by a clock in µs.
pub fn work(engine: &mut Engine<'_>, now_us: impl Fn() -> u64) -> Turn {
    let (empty, end_us) = (engine.output().is_empty(), now_us() + TURN_US);
    let mut more = engine.work();
    while more && now_us() < end_us {
        more = engine.work();
    }
    Turn { more, wake_port: empty && !engine.output().is_empty() }
}
