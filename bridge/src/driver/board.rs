//! What the driver needs of a board.

use crate::engine::Checkpoint;
use crate::port::Timing;
use protocol::link::message::{Lines, Progress};

/// Time since the board started.
pub trait Clock {
    /// In µs. Never goes back.
    fn now_us(&self) -> u64;
}

/// A sender that strobes bytes while the processor does something else: a PIO program with DMA, for example.
///
/// It keeps to the Busy handshake and strobes nothing while any of the status lines shows a fault or the printer's +5 V is
/// absent. A byte counts as sent once its strobe is over.
pub trait Sender {
    /// Sets the times around the strobe, from the next byte on. Only with nothing in flight.
    fn set_timing(&mut self, timing: &Timing);

    /// Connects nStrobe and the data lines to the sender; nStrobe is high before and after.
    fn connect(&mut self);

    /// Gives nStrobe and the data lines back to the processor; nStrobe is high and the data keep their levels. Only
    /// with nothing in flight.
    fn disconnect(&mut self);

    /// Whether the sender can take more bytes.
    fn has_room(&self) -> bool;

    /// Hands over bytes. Returns how many the sender took: at least one if it has room.
    fn give(&mut self, bytes: &[u8]) -> usize;

    /// Bytes that were handed over and not yet reported by [`Sender::sent`].
    fn in_flight(&self) -> usize;

    /// How many bytes have been sent since the last call.
    fn sent(&mut self) -> usize;

    /// Stops the sender and drops what it has not sent. Returns how many bytes have been sent since the last call of
    /// [`Sender::sent`]. A byte whose strobe has begun is finished and counts.
    fn stop(&mut self) -> usize;
}

/// Memory that survives a reset of the board.
pub trait Retained {
    /// Records that the processor itself has sent one more byte. The sender records its own.
    fn mark(&mut self);

    /// Keeps a checkpoint, which covers every byte that has been reported to the engine.
    fn store(&mut self, checkpoint: Checkpoint);
}

/// The rest of the board.
pub trait Board: Clock + Sender + Retained {
    /// The levels of the status lines, all read at one moment.
    fn lines(&mut self) -> Lines;

    /// Lets the output buffers drive the cable, or not; then pull-ups hold its control lines high.
    fn enable(&mut self, on: bool);

    /// Releases the printer's lines and restarts in the boot loader. A real board does not return from this.
    fn start_boot_loader(&mut self);

    /// Writes an event to the log.
    fn log(&mut self, event: Event);
}

/// What the driver writes to the log.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Event {
    /// Another job, or another state of the same job.
    Job(Progress),
    /// The printer has told its device ID, of so many bytes.
    DeviceId(usize),
    /// The printer was asked for its device ID and told none.
    NoDeviceId,
}

/// The books of a sender with two buffers: which of them is filled next, and how many bytes each still holds.
///
/// Buffers are filled and emptied in turn. A buffer is free again when its last byte has been sent, since DMA may read it
/// until then.
#[derive(Default)]
pub struct TwoBuffers {
    /// Bytes in each buffer that have not been sent.
    left: [u32; 2],
    /// The buffer to fill next: the older one, if both are in use.
    next: usize,
}

impl TwoBuffers {
    /// Two empty buffers.
    pub const fn new() -> Self {
        TwoBuffers { left: [0; 2], next: 0 }
    }

    /// The buffer to fill next, 0 or 1, if it is free.
    pub fn free(&self) -> Option<usize> {
        (self.left[self.next] == 0).then_some(self.next)
    }

    /// Records that the buffer [`free`](Self::free) has named was filled with `count` bytes, at least one.
    pub fn fill(&mut self, count: u32) {
        self.left[self.next] = count;
        self.next ^= 1;
    }

    /// Records that `count` more bytes have been sent.
    pub fn empty(&mut self, count: u32) {
        let older = count.min(self.left[self.next]);
        self.left[self.next] -= older;
        self.left[self.next ^ 1] -= count - older;
    }

    /// Bytes in both buffers that have not been sent.
    pub fn in_flight(&self) -> u32 {
        self.left[0] + self.left[1]
    }

    /// Forgets what is in the buffers.
    pub fn clear(&mut self) {
        self.left = [0; 2];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::VecDeque;

    proptest! {
        #[test]
        fn two_buffers_are_filled_and_emptied_in_turn(
            steps in prop::collection::vec((any::<bool>(), 1u32..40), 0..200),
        ) {
            let mut buffers = TwoBuffers::new();
            // Every byte in flight, by the buffer it is in.
            let mut flight: VecDeque<usize> = VecDeque::new();
            for (fill, count) in steps {
                match buffers.free() {
                    Some(buffer) if fill => {
                        prop_assert!(!flight.contains(&buffer), "a buffer in use was offered");
                        buffers.fill(count);
                        flight.extend((0..count).map(|_| buffer));
                    }
                    free => {
                        prop_assert_eq!(free.is_none(), flight.contains(&0) && flight.contains(&1));
                        let count = count.min(flight.len() as u32);
                        buffers.empty(count);
                        flight.drain(..count as usize);
                    }
                }
                prop_assert_eq!(buffers.in_flight() as usize, flight.len());
            }
            buffers.clear();
            prop_assert_eq!((buffers.in_flight(), buffers.free().is_some()), (0, true));
        }
    }
}
