//! Where a job stands, kept so that a reset of the board at any instant leaves it, to the byte.
//!
//! Problem: a reset in the middle of a sheet costs the sheet, unless the board knows afterwards how much of it the printer
//! has. Method: the engine's checkpoint goes into one of two slots in turn, with a number and a checksum, so that a reset
//! during a write leaves the other. Every byte that crosses the port after it leaves a mark in a ring, written by whatever
//! sends it. After a reset the marks behind the last checkpoint are counted. Only when a slot is written are the marks
//! before it cleared.
//!
//! Cost: 64 bytes for each checkpoint and a byte for each mark. Limits: fewer than [`MARKS`] bytes may cross between two
//! checkpoints. The board says whether the memory is its own, and holds what it held ([`Memory`]).

use core::sync::atomic::{Ordering, compiler_fence};

use protocol::link::frame::checksum;

use crate::engine::Checkpoint;

/// Marks in the ring, as a power of two: more than two buffers of any sender.
pub const MARKS_BITS: u8 = 12;
/// Marks in the ring.
pub const MARKS: usize = 1 << MARKS_BITS;

/// Bytes of a place for a checkpoint: checksum of the rest, number, position in the ring, length of what follows.
pub const SLOT: usize = 64;
const HEAD: usize = 11;

/// Memory that outlives a reset. Writes happen in the order in which they are asked for.
pub trait Memory {
    /// The two slots.
    fn slots(&self) -> [[u8; SLOT]; 2];
    /// Writes slot 0 or 1.
    fn write(&mut self, which: usize, slot: [u8; SLOT]);
    /// Whether there is a mark at this place, below [`MARKS`].
    fn is_marked(&self, at: usize) -> bool;
    /// Sets or clears the mark at this place, below [`MARKS`].
    fn mark(&mut self, at: usize, set: bool);
}

/// The checkpoints of this run.
pub struct Keeper<M> {
    memory: M,
    number: u32,
    /// Position in the ring that belongs to the last checkpoint.
    place: usize,
    last: Option<Checkpoint>,
}

impl<M: Memory> Keeper<M> {
    /// Looks for what an earlier run has left; `known` says whether the memory is what such a run left there. To be called
    /// before anything is sent.
    pub fn new(mut memory: M, known: bool) -> (Self, Option<Checkpoint>) {
        let slots = memory.slots();
        let found = slots.iter().filter_map(read).filter(|_| known);
        // Numbers follow each other and may wrap.
        let found = found.reduce(|a, b| if b.0.wrapping_sub(a.0) == 1 { b } else { a });
        let Some((number, place, mut checkpoint)) = found else {
            (0..2).for_each(|which| memory.write(which, [0; SLOT]));
            (0..MARKS).for_each(|at| memory.mark(at, false));
            return (Keeper { memory, number: 0, place: 0, last: None }, None);
        };
        let crossed = (0..MARKS).take_while(|at| memory.is_marked((place + at) % MARKS)).count();
        #[expect(clippy::cast_possible_truncation, reason = "at most MARKS")]
        let count = crossed as u32;
        checkpoint.progress.printed = checkpoint.progress.printed.wrapping_add(count);
        let mut keeper = Keeper { memory, number, place, last: None };
        keeper.store(checkpoint, place + crossed);
        // What a reset left between a slot and the clearing of its marks would be counted a turn of the ring later.
        (0..MARKS).for_each(|at| keeper.memory.mark(at, false));
        (keeper, Some(checkpoint))
    }

    /// Where in the ring the next mark belongs.
    pub fn place(&self) -> usize {
        self.place
    }

    /// Keeps a checkpoint; `place` is the number of marks made so far, or that modulo [`MARKS`].
    pub fn store(&mut self, checkpoint: Checkpoint, place: usize) {
        let place = place % MARKS;
        if self.last == Some(checkpoint) && self.place == place {
            return;
        }
        let number = self.number.wrapping_add(1);
        let Some(slot) = write(number, place, checkpoint) else { return };
        self.number = number;
        self.memory.write((number % 2) as usize, slot);
        compiler_fence(Ordering::SeqCst);
        // Only now the marks before it are no longer needed.
        for at in 0..place.wrapping_sub(self.place) % MARKS {
            self.memory.mark((self.place + at) % MARKS, false);
        }
        (self.place, self.last) = (place, Some(checkpoint));
    }

    /// Marks a byte that the processor has sent, after `sent` others since the last checkpoint.
    pub fn mark(&mut self, sent: usize) {
        self.memory.mark((self.place + sent) % MARKS, true);
    }
}

/// A slot of this checkpoint; none if it should ever be longer than a slot.
fn write(number: u32, place: usize, checkpoint: Checkpoint) -> Option<[u8; SLOT]> {
    let mut slot = [0; SLOT];
    slot[4..8].copy_from_slice(&number.to_le_bytes());
    slot[8..10].copy_from_slice(&u16::try_from(place).ok()?.to_le_bytes());
    let Checkpoint { progress, ends_at, needs_reset } = checkpoint;
    let used = postcard::to_slice(&(progress, ends_at, needs_reset), &mut slot[HEAD..]).ok()?.len();
    slot[10] = u8::try_from(used).ok()?;
    let sum = checksum(&slot[4..]);
    slot[..4].copy_from_slice(&sum.to_le_bytes());
    Some(slot)
}

/// Number, position in the ring and checkpoint of a slot, if it is whole.
fn read(slot: &[u8; SLOT]) -> Option<(u32, usize, Checkpoint)> {
    let word = |at: usize| u32::from_le_bytes([slot[at], slot[at + 1], slot[at + 2], slot[at + 3]]);
    if word(0) != checksum(&slot[4..]) {
        return None;
    }
    let body = slot.get(HEAD..HEAD + usize::from(slot[10]))?;
    let (progress, ends_at, needs_reset) = postcard::from_bytes(body).ok()?;
    let place = usize::from(u16::from_le_bytes([slot[8], slot[9]]));
    Some((word(4), place, Checkpoint { progress, ends_at, needs_reset }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use protocol::link::message::{Fault, JobState, Progress};
    use std::vec::Vec;

    /// A board's memory, until the board has written so many bytes.
    struct Board<'a> {
        held: &'a mut Held,
        left: usize,
    }

    struct Held {
        slots: [[u8; SLOT]; 2],
        marks: Vec<bool>,
    }

    impl Board<'_> {
        fn writes(&mut self) -> bool {
            let lives = self.left > 0;
            self.left = self.left.saturating_sub(1);
            lives
        }
    }

    impl Memory for Board<'_> {
        fn slots(&self) -> [[u8; SLOT]; 2] {
            self.held.slots
        }

        fn write(&mut self, which: usize, slot: [u8; SLOT]) {
            for (at, byte) in slot.into_iter().enumerate() {
                if self.writes() {
                    self.held.slots[which][at] = byte;
                }
            }
        }

        fn is_marked(&self, at: usize) -> bool {
            self.held.marks[at]
        }

        fn mark(&mut self, at: usize, set: bool) {
            if self.writes() {
                self.held.marks[at] = set;
            }
        }
    }

    fn at(printed: u32) -> Checkpoint {
        let progress = Progress {
            job: 7,
            state: JobState::Printing,
            accepted: printed,
            limit: printed,
            printed,
            pass: 0,
            row: 0,
        };
        Checkpoint { progress, ends_at: Some(printed), needs_reset: printed.is_multiple_of(2) }
    }

    proptest! {
        /// Wherever a reset comes, in a slot, between a slot and its marks or among them, the count of bytes is right.
        #[test]
        fn a_reset_at_any_instant_leaves_the_count(
            lives in prop::collection::vec(
                (0usize..20_000, prop::collection::vec((0usize..3000, any::<bool>()), 1..8)),
                1..8,
            ),
            rubbish in any::<u8>(),
        ) {
            let mut held = Held { slots: [[rubbish; SLOT]; 2], marks: std::vec![rubbish > 99; MARKS] };
            let mut crossed = 0;
            let (mut keeper, none) = Keeper::new(Board { held: &mut held, left: usize::MAX }, false);
            prop_assert_eq!(none, None);
            keeper.store(at(0), 0);
            for (left, turns) in lives {
                let (mut keeper, found) = Keeper::new(Board { held: &mut held, left }, true);
                prop_assert_eq!(found.map(|found| found.progress.printed), Some(crossed));
                for (count, again) in turns {
                    for sent in 0..count {
                        if keeper.memory.left == 0 {
                            break;
                        }
                        keeper.mark(sent);
                        crossed += 1;
                    }
                    let place = keeper.place() + count;
                    keeper.store(at(crossed), place);
                    if again {
                        keeper.store(at(crossed), place);
                    }
                    if keeper.memory.left == 0 {
                        break;
                    }
                }
            }
            let found = Keeper::new(Board { held: &mut held, left: usize::MAX }, true).1;
            prop_assert_eq!(found.map(|found| found.progress.printed), Some(crossed));
        }

        #[test]
        fn a_slot_says_what_was_written_and_a_damaged_one_nothing(
            number in any::<u32>(), place in 0..MARKS, printed in any::<u32>(), byte in 0..SLOT, bit in 0u32..8,
        ) {
            let mut slot = write(number, place, at(printed)).expect("a checkpoint goes into a slot");
            prop_assert_eq!(read(&slot), Some((number, place, at(printed))));
            slot[byte] ^= 1 << bit;
            prop_assert_eq!(read(&slot), None);
        }
    }

    #[test]
    fn the_largest_checkpoint_goes_into_a_slot() {
        let all = u32::MAX;
        let progress = Progress {
            job: all,
            state: JobState::Stopped(Fault::PaperOut),
            accepted: all,
            limit: all,
            printed: all,
            pass: u8::MAX,
            row: u16::MAX,
        };
        assert!(
            write(all, MARKS - 1, Checkpoint { progress, ends_at: Some(all), needs_reset: true }).is_some()
        );
    }

    #[test]
    fn numbers_wrap() {
        let mut held = Held { slots: [[0; SLOT]; 2], marks: std::vec![false; MARKS] };
        held.slots[1] = write(u32::MAX, 0, at(1)).expect("a slot");
        held.slots[0] = write(0, 0, at(2)).expect("a slot");
        assert_eq!(Keeper::new(Board { held: &mut held, left: 0 }, true).1, Some(at(2)));
    }

    #[test]
    fn another_images_memory_is_made_empty() {
        let mut held =
            Held { slots: [write(5, 3, at(9)).expect("a slot"); 2], marks: std::vec![true; MARKS] };
        let (keeper, found) = Keeper::new(Board { held: &mut held, left: usize::MAX }, false);
        assert_eq!((found, keeper.place()), (None, 0));
        assert!(held.slots == [[0; SLOT]; 2] && held.marks.iter().all(|set| !set));
    }
}
