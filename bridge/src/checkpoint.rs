//! Where a job stands, kept so that a reset of the board at any instant leaves it, to the byte.
//!
//! Problem: a reset in the middle of a sheet costs the sheet, unless the board knows afterwards how much of it the printer
//! has. Method: the engine's checkpoint goes into one of two slots in turn, with a number and a checksum, so that a reset
//! during a write leaves the other. Every byte that crosses the port after it leaves a mark in a ring, written by whatever
//! sends it. After a reset the marks behind the last checkpoint are counted. Only when a slot is written are the marks
//! before it cleared. How earlier jobs have ended changes once in a job, so it has two slots of its own, written before the
//! checkpoint that follows from it.
//!
//! Cost: 64 bytes for each checkpoint, a byte for each mark, 288 bytes at the end of each job. Limits: fewer than [`MARKS`] bytes may cross between two
//! checkpoints. The board says whether the memory is its own, and holds what it held ([`Memory`]).

use core::ops::Range;
use core::sync::atomic::{Ordering, compiler_fence};

use protocol::link::frame::checksum;
use protocol::link::message::{PAST, PastJob, Progress};
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::engine::Checkpoint;
use crate::standing::Standing;

/// Marks in the ring, as a power of two: more than two buffers of any sender.
pub const MARKS_BITS: u8 = 12;
/// Marks in the ring.
pub const MARKS: usize = 1 << MARKS_BITS;

/// Bytes of a place for a checkpoint: checksum of the rest, number, position in the ring, length of what follows.
pub const SLOT: usize = 64;
/// Bytes of a place for what is remembered of earlier jobs.
pub const PAST_SLOT: usize = 288;
const HEAD: usize = 12;

/// What of a checkpoint changes with every byte.
type Position = (Progress, Option<u32>, Standing, bool, bool, bool);

/// Memory that outlives a reset. Writes happen in the order in which they are asked for.
pub trait Memory {
    /// The two slots.
    fn slots(&self) -> [[u8; SLOT]; 2];
    /// Writes slot 0 or 1.
    fn write(&mut self, which: usize, slot: [u8; SLOT]);
    /// The two slots for earlier jobs.
    fn past(&self) -> [[u8; PAST_SLOT]; 2];
    /// Writes slot 0 or 1 of these.
    fn write_past(&mut self, which: usize, slot: [u8; PAST_SLOT]);
    /// Whether there is a mark at this place, below [`MARKS`].
    fn is_marked(&self, at: usize) -> bool;
    /// Sets the mark at this place, below [`MARKS`].
    fn mark(&mut self, at: usize);
    /// Clears the marks at these places, all below [`MARKS`].
    fn clear(&mut self, places: Range<usize>);
}

/// The checkpoints of this run.
pub struct CheckpointStore<M> {
    memory: M,
    number: u32,
    /// Position in the ring that belongs to the last checkpoint.
    place: usize,
    last: Option<Checkpoint>,
    /// What was last written of earlier jobs, and its number.
    past: [PastJob; PAST],
    past_number: u32,
}

impl<M: Memory> CheckpointStore<M> {
    /// Looks for what an earlier run has left; `known` says whether the memory is what such a run left there. To be called
    /// before anything is sent.
    pub fn new(mut memory: M, known: bool) -> (Self, Option<Checkpoint>) {
        let found = newest(&memory.slots()).filter(|_| known);
        let Some((number, place, position)) = found else {
            (0..2).for_each(|which| memory.write(which, [0; SLOT]));
            (0..2).for_each(|which| memory.write_past(which, [0; PAST_SLOT]));
            memory.clear(0..MARKS);
            let past = [PastJob::NONE; PAST];
            return (CheckpointStore { memory, number: 0, place: 0, last: None, past, past_number: 0 }, None);
        };
        // A slot may say anything.
        let place = place % MARKS;
        let (past_number, _, past) = newest(&memory.past()).unwrap_or((0, 0, [PastJob::NONE; PAST]));
        let crossed = (0..MARKS).take_while(|at| memory.is_marked((place + at) % MARKS)).count();
        #[expect(clippy::cast_possible_truncation, reason = "at most MARKS")]
        let count = crossed as u32;
        let (mut progress, ends_at, standing, one_way, flowing, from_store): Position = position;
        progress.printed = progress.printed.wrapping_add(count);
        let checkpoint = Checkpoint { progress, ends_at, standing, one_way, flowing, from_store, past };
        let mut checkpoints = CheckpointStore { memory, number, place, last: None, past, past_number };
        checkpoints.store(checkpoint, place + crossed);
        // What a reset left between a slot and the clearing of its marks would be counted a turn of the ring later.
        checkpoints.memory.clear(0..MARKS);
        (checkpoints, Some(checkpoint))
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
        // First: a job that has ended and is not remembered would be open again behind a reset.
        if checkpoint.past != self.past {
            let number = self.past_number.wrapping_add(1);
            if let Some(slot) = write(number, 0, &checkpoint.past) {
                self.memory.write_past((number % 2) as usize, slot);
                compiler_fence(Ordering::SeqCst);
                (self.past_number, self.past) = (number, checkpoint.past);
            }
        }
        let number = self.number.wrapping_add(1);
        let Checkpoint { progress, ends_at, standing, one_way, flowing, from_store, .. } = checkpoint;
        let position: Position = (progress, ends_at, standing, one_way, flowing, from_store);
        let Some(slot) = write(number, place, &position) else { return };
        self.number = number;
        self.memory.write((number % 2) as usize, slot);
        compiler_fence(Ordering::SeqCst);
        // Only now the marks before it are no longer needed.
        if place < self.place {
            self.memory.clear(self.place..MARKS);
            self.memory.clear(0..place);
        } else {
            self.memory.clear(self.place..place);
        }
        (self.place, self.last) = (place, Some(checkpoint));
    }

    /// Marks a byte that the processor has sent, after `sent` others since the last checkpoint.
    pub fn mark(&mut self, sent: usize) {
        self.memory.mark((self.place + sent) % MARKS);
    }
}

/// A slot with this in it; none if it should ever be longer than a slot.
fn write<const N: usize>(number: u32, place: usize, held: &impl Serialize) -> Option<[u8; N]> {
    let mut slot = [0; N];
    slot[4..8].copy_from_slice(&number.to_le_bytes());
    slot[8..10].copy_from_slice(&u16::try_from(place).ok()?.to_le_bytes());
    let used = postcard::to_slice(held, &mut slot[HEAD..]).ok()?.len();
    slot[10..12].copy_from_slice(&u16::try_from(used).ok()?.to_le_bytes());
    let sum = checksum(&slot[4..]);
    slot[..4].copy_from_slice(&sum.to_le_bytes());
    Some(slot)
}

/// Number, position in the ring and content of a slot, if it is whole.
fn read<const N: usize, T: DeserializeOwned>(slot: &[u8; N]) -> Option<(u32, usize, T)> {
    let word = |at: usize| u32::from_le_bytes([slot[at], slot[at + 1], slot[at + 2], slot[at + 3]]);
    let half = |at: usize| usize::from(u16::from_le_bytes([slot[at], slot[at + 1]]));
    if word(0) != checksum(&slot[4..]) {
        return None;
    }
    let body = slot.get(HEAD..HEAD + half(10))?;
    Some((word(4), half(8), postcard::from_bytes(body).ok()?))
}

/// The same of the slot that was written last.
fn newest<const N: usize, T: DeserializeOwned>(slots: &[[u8; N]; 2]) -> Option<(u32, usize, T)> {
    // Numbers follow each other and may wrap.
    slots.iter().filter_map(read).reduce(|a, b| if b.0.wrapping_sub(a.0) == 1 { b } else { a })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use protocol::link::message::{Defect, DefectKind, Fault, JobState};
    use std::vec::Vec;

    /// A board's memory, until the board has written so many bytes.
    struct Board<'a> {
        held: &'a mut Held,
        left: usize,
    }

    struct Held {
        slots: [[u8; SLOT]; 2],
        past: [[u8; PAST_SLOT]; 2],
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

        fn past(&self) -> [[u8; PAST_SLOT]; 2] {
            self.held.past
        }

        fn write_past(&mut self, which: usize, slot: [u8; PAST_SLOT]) {
            for (at, byte) in slot.into_iter().enumerate() {
                if self.writes() {
                    self.held.past[which][at] = byte;
                }
            }
        }

        fn is_marked(&self, at: usize) -> bool {
            self.held.marks[at]
        }

        fn mark(&mut self, at: usize) {
            if self.writes() {
                self.held.marks[at] = true;
            }
        }

        fn clear(&mut self, places: Range<usize>) {
            for at in places {
                if self.writes() {
                    self.held.marks[at] = false;
                }
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
        Checkpoint {
            progress,
            ends_at: Some(printed),
            standing: match printed % 3 {
                0 => Standing::AtRest,
                1 => Standing::InSheet(printed),
                _ => Standing::Unknown { job: printed, due: printed.is_multiple_of(2) },
            },
            one_way: printed.is_multiple_of(5),
            flowing: printed.is_multiple_of(7),
            from_store: printed.is_multiple_of(11),
            past: [PastJob::NONE; PAST],
        }
    }

    fn position(checkpoint: Checkpoint) -> Position {
        let Checkpoint { progress, ends_at, standing, one_way, flowing, from_store, .. } = checkpoint;
        (progress, ends_at, standing, one_way, flowing, from_store)
    }

    fn held() -> Held {
        Held { slots: [[0; SLOT]; 2], past: [[0; PAST_SLOT]; 2], marks: std::vec![false; MARKS] }
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
            let mut held = Held {
                slots: [[rubbish; SLOT]; 2],
                past: [[rubbish; PAST_SLOT]; 2],
                marks: std::vec![rubbish > 99; MARKS],
            };
            let mut crossed = 0;
            let (mut checkpoints, none) = CheckpointStore::new(Board { held: &mut held, left: usize::MAX }, false);
            prop_assert_eq!(none, None);
            checkpoints.store(at(0), 0);
            for (left, turns) in lives {
                let (mut checkpoints, found) = CheckpointStore::new(Board { held: &mut held, left }, true);
                prop_assert_eq!(found.map(|found| found.progress.printed), Some(crossed));
                for (count, again) in turns {
                    for sent in 0..count {
                        if checkpoints.memory.left == 0 {
                            break;
                        }
                        checkpoints.mark(sent);
                        crossed += 1;
                    }
                    let place = checkpoints.place() + count;
                    checkpoints.store(at(crossed), place);
                    if again {
                        checkpoints.store(at(crossed), place);
                    }
                    if checkpoints.memory.left == 0 {
                        break;
                    }
                }
            }
            let found = CheckpointStore::new(Board { held: &mut held, left: usize::MAX }, true).1;
            prop_assert_eq!(found.map(|found| found.progress.printed), Some(crossed));
        }

        #[test]
        fn a_slot_says_what_was_written_and_a_damaged_one_nothing(
            number in any::<u32>(), place in 0..MARKS, printed in any::<u32>(), byte in 0..SLOT, bit in 0u32..8,
        ) {
            let held = position(at(printed));
            let mut slot: [u8; SLOT] = write(number, place, &held).expect("a checkpoint goes into a slot");
            prop_assert_eq!(read(&slot), Some((number, place, held)));
            slot[byte] ^= 1 << bit;
            prop_assert_eq!(read::<SLOT, Position>(&slot), None);
        }

        /// Jobs end one after the other, and a reset comes anywhere. An open job behind it is the one that was open, or one whose
        /// end is remembered; and none that had ended before is forgotten.
        #[test]
        fn a_reset_at_any_instant_leaves_how_jobs_have_ended(lives in prop::collection::vec((0usize..9000, 1u32..6), 1..8)) {
            let mut held = held();
            let (mut checkpoints, _) = CheckpointStore::new(Board { held: &mut held, left: usize::MAX }, false);
            let mut now = at(0);
            now.progress.job = 1;
            checkpoints.store(now, 0);
            for (left, jobs) in lives {
                let (mut checkpoints, found) = CheckpointStore::new(Board { held: &mut held, left }, true);
                now = found.expect("a checkpoint");
                if checkpoints.memory.left == 0 {
                    continue;
                }
                for _ in 0..jobs {
                    let job = now.progress.job;
                    let ended = PastJob { job, state: JobState::Done, printed: job };
                    if now.past[0] != ended {
                        now.past.rotate_right(1);
                        now.past[0] = ended;
                    }
                    // The driver looks when the next job is open already.
                    now.progress.job = job + 1;
                    checkpoints.store(now, 0);
                }
            }
            let found = CheckpointStore::new(Board { held: &mut held, left: usize::MAX }, true).1.expect("a checkpoint");
            let open = found.progress.job;
            let last = found.past[0].job;
            prop_assert!(last == open || last == open - 1, "open {open}, last ended {last}");
            let ended: Vec<u32> = found.past.iter().map(|past| past.job).take_while(|&job| job > 0).collect();
            prop_assert!(ended.iter().zip((1..=last).rev()).all(|(&job, expected)| job == expected), "{ended:?}");
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
        let standing = Standing::Unknown { job: all, due: true };
        let position: Position = (progress, Some(all), standing, true, true, true);
        assert!(write::<SLOT>(all, MARKS - 1, &position).is_some());
        let state = JobState::Broken(Defect { at: all, what: DefectKind::Truncated });
        let past = [PastJob { job: all, state, printed: all }; PAST];
        assert!(write::<PAST_SLOT>(all, 0, &past).is_some());
        let position: Position = (Progress { state, ..progress }, Some(all), standing, true, true, true);
        assert!(write::<SLOT>(all, MARKS - 1, &position).is_some());
    }

    #[test]
    fn numbers_wrap() {
        let mut held = held();
        held.slots[1] = write(u32::MAX, 0, &position(at(1))).expect("a slot");
        held.slots[0] = write(0, 0, &position(at(2))).expect("a slot");
        assert_eq!(CheckpointStore::new(Board { held: &mut held, left: 0 }, true).1, Some(at(2)));
    }

    #[test]
    fn another_images_memory_is_made_empty() {
        let mut held = held();
        held.slots = [write(5, 3, &position(at(9))).expect("a slot"); 2];
        held.marks.fill(true);
        let (checkpoints, found) = CheckpointStore::new(Board { held: &mut held, left: usize::MAX }, false);
        assert_eq!((found, checkpoints.place()), (None, 0));
        assert!(held.slots == [[0; SLOT]; 2] && held.marks.iter().all(|set| !set));
    }
}
