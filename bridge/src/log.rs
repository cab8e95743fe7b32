//! Which piece of the log answers a host that asks for it from some byte on.
//!
//! A board keeps the last bytes of its log over the oldest and counts all it has written. What the host asks for may be gone,
//! or was never written, if it asks for the log of another run.

/// Where the piece begins and how many bytes it has, when `end` bytes were written, the last `kept` of them are there, and
/// the answer has room for so many. Always within what is there.
pub fn piece(from: u32, end: u32, kept: u32, room: usize) -> (u32, usize) {
    let oldest = end.saturating_sub(kept);
    let start = if from > end { oldest } else { from.max(oldest) };
    (start, room.min((end - start) as usize))
}

#[cfg(test)]
mod tests {
    use super::piece;
    use proptest::prelude::*;

    #[test]
    fn what_is_gone_or_never_was_is_answered_with_the_oldest() {
        assert_eq!(piece(0, 10, 100, 64), (0, 10));
        assert_eq!(piece(4, 10, 100, 3), (4, 3));
        assert_eq!(piece(10, 10, 100, 64), (10, 0));
        assert_eq!(piece(5, 500, 100, 64), (400, 64));
        assert_eq!(piece(501, 500, 100, 64), (400, 64), "another run's log");
    }

    proptest! {
        #[test]
        fn pieces_one_after_the_other_are_all_that_is_kept(from in any::<u32>(), end in any::<u32>(), kept in 1u32..5000, room in 1usize..200) {
            let (mut at, count) = piece(from, end, kept, room);
            prop_assert!(at >= end.saturating_sub(kept) && at <= end && count <= room);
            while at < end {
                let (start, count) = piece(at, end, kept, room);
                prop_assert!(start == at && count > 0);
                at += count as u32;
            }
            prop_assert_eq!(at, end);
        }
    }
}
