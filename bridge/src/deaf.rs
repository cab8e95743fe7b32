//! A USB controller that hears nothing any more, and when the board restarts because of it.
//!
//! Problem: a bus error within a packet to the host can stop the RP2040's controller for good (erratum RP2040-E15, seen behind hubs),
//! and a USB stack that waits for something else does not look at a bus reset. The board prints on, but no computer finds it until its
//! supply is taken, which costs the sheet. Method: the controller is looked at every [`LOOK_MS`]. A bus reset that nobody has
//! served for a second (`UNSERVED_MS`), and a board that had an address, has lost it by a reset, and gets no other for five (`UNADDRESSED_MS`) although
//! the host sends its frames, ask for a restart, which keeps a job to the byte.
//! Cost: a board that a host does not address on purpose restarts once. Limits: whether E15 shows itself like this has been seen
//! on no board.
//! Source: RP2040 data sheet, appendix B; USB 2.0, 9.2.6.2: a host waits 10 ms behind a reset, and gives up a request after 5 s.

/// Between two looks.
pub const LOOK_MS: u32 = 10;

/// A stack serves a reset within a millisecond, or within the 400 that the erase of a flash sector may take at most.
const UNSERVED_MS: u32 = 1000;

/// Hosts address a device within half a second of its reset, or try again.
const UNADDRESSED_MS: u32 = 5000;

/// What the controller shows at a look.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Shown {
    /// A bus reset waits to be served.
    pub reset: bool,
    /// The device's address, 0 for none.
    pub address: u8,
    /// The number of the host's last frame.
    pub frame: u16,
}

/// Watches a controller.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Deaf {
    unserved_ms: u32,
    unaddressed_ms: u32,
    addressed: bool,
    frame: u16,
}

impl Deaf {
    /// Nothing was seen yet.
    pub const fn new() -> Deaf {
        Deaf { unserved_ms: 0, unaddressed_ms: 0, addressed: false, frame: 0 }
    }

    /// A look; returns whether the board is to restart.
    pub fn look(&mut self, shown: Shown) -> bool {
        let Shown { reset, address, frame } = shown;
        self.unserved_ms = if reset { self.unserved_ms + LOOK_MS } else { 0 };
        self.addressed |= address != 0;
        if address != 0 || reset {
            self.unaddressed_ms = 0;
        } else if self.addressed && frame != self.frame {
            self.unaddressed_ms += LOOK_MS;
        }
        self.frame = frame;
        self.unserved_ms > UNSERVED_MS || self.unaddressed_ms > UNADDRESSED_MS
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// After how many ms a controller that shows this asks for a restart, if within a minute.
    fn restarts(deaf: &mut Deaf, shown: impl Fn(u16) -> Shown) -> Option<u32> {
        (1..=60_000 / LOOK_MS).find(|&look| deaf.look(shown(look as u16))).map(|look| look * LOOK_MS)
    }

    #[test]
    fn a_reset_that_nobody_serves_restarts_the_board_and_an_erase_of_the_flash_does_not() {
        let waits = |frame| Shown { reset: true, address: 5, frame };
        let after = restarts(&mut Deaf::new(), waits);
        assert!(after.is_some_and(|ms| (800..=1200).contains(&ms)), "{after:?}");
        let mut deaf = Deaf::new();
        for _ in 0..100 {
            // 400 ms of an erase, and a look between two of them.
            assert!((0..40).all(|look| !deaf.look(waits(look))));
            assert!(!deaf.look(Shown { reset: false, address: 5, frame: 0 }));
        }
    }

    #[test]
    fn a_controller_that_hears_no_host_restarts_once_and_one_without_a_host_never() {
        let unaddressed = |frame| Shown { reset: false, address: 0, frame };
        let mut deaf = Deaf::new();
        // On a charger, or not enumerated yet.
        assert_eq!(restarts(&mut deaf, unaddressed), None);
        deaf.look(Shown { reset: false, address: 9, frame: 0 });
        // The cable is pulled, and no frame comes.
        assert_eq!(restarts(&mut deaf, |_| unaddressed(7)), None);
        // The host is there.
        let after = restarts(&mut deaf, unaddressed);
        assert!(after.is_some_and(|ms| (4000..=6000).contains(&ms)), "{after:?}");
        assert_eq!(restarts(&mut Deaf::new(), unaddressed), None, "behind the restart");
    }

    #[test]
    fn an_ordinary_enumeration_and_an_ordinary_day_never_restart_it() {
        let mut deaf = Deaf::new();
        for round in 0..200u16 {
            for look in 0..300 {
                let (reset, address) = (look < 1, if look < 100 { 0 } else { 3 });
                assert!(!deaf.look(Shown { reset, address, frame: round * 300 + look }));
            }
        }
    }
}
