//! Where the printer stands: between two jobs, in a sheet, or nobody knows.
//!
//! Problem: a printer that has a part of a sheet takes whatever comes next as the rest of a row, and prints
//! it as text. It forgets that part when it is switched off, and keeps it when only a cable is pulled; a
//! board that has lost its supply has seen neither.
//! Method: one value and a method for each event that changes it. Bytes of a job leave only [in that job's
//! sheet](Standing::InSheet), which is entered [between two jobs](Standing::AtRest) and from nowhere else;
//! and a printer is known to be between two jobs by two events alone: a reset that it has noticed, and the
//! legal end of a job. The status question is a job of two bytes, number [`QUESTION`].
//!
//! Cost: eight bytes. Limits: what another computer does with this printer while the board has no supply it
//! does not see.
//! Source: `docs/decisions/where-the-printer-stands.md`.

use protocol::link::message::Standing as Told;
use serde::{Deserialize, Serialize};

/// The number of the status question, which is no job of anybody's.
pub const QUESTION: u32 = 0;

/// Where the printer stands.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum Standing {
    /// Nobody knows.
    Unknown {
        /// The job of which it may have a part, or 0.
        job: u32,
        /// The board has seen that job being lost: the printer is reset as soon as it can notice. Otherwise
        /// before the next byte.
        due: bool,
    },
    /// Between two jobs.
    AtRest,
    /// In the sheet of this job, whose bytes may have crossed.
    InSheet(u32),
}

impl Standing {
    /// Of a board that knows nothing.
    pub const UNKNOWN: Standing = Standing::Unknown { job: 0, due: false };

    /// The first byte of this job is about to leave. It may not unless the printer stands in its sheet now.
    pub fn enter(&mut self, job: u32) {
        if *self == Standing::AtRest {
            *self = Standing::InSheet(job);
        }
    }

    /// The last byte of this job's legal end has crossed. The end of another one says nothing.
    pub fn end(&mut self, job: u32) {
        if *self == Standing::InSheet(job) {
            *self = Standing::AtRest;
        }
    }

    /// This job's sheet ends, and not legally: the printer waits for a rest that never comes.
    pub fn tear(&mut self, job: u32) {
        if *self == Standing::InSheet(job) {
            *self = Standing::Unknown { job, due: job != QUESTION };
        }
    }

    /// A reset was carried out, and the printer had its supply before and behind it.
    pub fn reset(&mut self) {
        *self = Standing::AtRest;
    }

    /// The printer's supply was seen to be absent. `crossed`: a byte of the sheet it was in had crossed.
    pub fn lose_supply(&mut self, crossed: bool) {
        match *self {
            Standing::InSheet(job) if crossed => *self = Standing::Unknown { job, due: job != QUESTION },
            Standing::InSheet(_) | Standing::AtRest => *self = Standing::UNKNOWN,
            Standing::Unknown { .. } => {}
        }
    }

    /// The lines were set by hand, and may have strobed anything.
    pub fn disturb(&mut self) {
        if *self == Standing::AtRest {
            *self = Standing::UNKNOWN;
        }
    }

    /// The job of which the printer has a part, or may have; 0 if there is none.
    pub fn job(self) -> u32 {
        match self {
            Standing::Unknown { job, .. } | Standing::InSheet(job) => job,
            Standing::AtRest => 0,
        }
    }

    /// The same for the host.
    pub fn told(self) -> Told {
        match self {
            Standing::Unknown { .. } => Told::UNKNOWN,
            Standing::AtRest => Told::AT_REST,
            Standing::InSheet(_) => Told::IN_SHEET,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// What may happen, in any order.
    #[derive(Clone, Copy, Debug)]
    enum Event {
        Enter(u32),
        End(u32),
        Tear(u32),
        Reset,
        LoseSupply(bool),
        Disturb,
    }

    fn events() -> impl Strategy<Value = std::vec::Vec<Event>> {
        let one = prop_oneof![
            (0u32..5).prop_map(Event::Enter),
            (0u32..5).prop_map(Event::End),
            (0u32..5).prop_map(Event::Tear),
            Just(Event::Reset),
            any::<bool>().prop_map(Event::LoseSupply),
            Just(Event::Disturb),
        ];
        prop::collection::vec(one, 0..60)
    }

    proptest! {
        /// A sheet is entered between two jobs only, and only a reset and a legal end lead there.
        #[test]
        fn a_sheet_is_entered_behind_a_reset_or_a_legal_end_and_behind_nothing_else(events in events()) {
            let mut standing = Standing::UNKNOWN;
            for event in events {
                let before = standing;
                match event {
                    Event::Enter(job) => standing.enter(job),
                    Event::End(job) => standing.end(job),
                    Event::Tear(job) => standing.tear(job),
                    Event::Reset => standing.reset(),
                    Event::LoseSupply(crossed) => standing.lose_supply(crossed),
                    Event::Disturb => standing.disturb(),
                }
                match (before, standing) {
                    (before, after) if before == after => {}
                    (Standing::AtRest, Standing::InSheet(_)) => prop_assert!(matches!(event, Event::Enter(_))),
                    (_, Standing::InSheet(_)) => prop_assert!(false, "{before:?} to {standing:?} by {event:?}"),
                    (Standing::InSheet(job), Standing::AtRest) => match event {
                        Event::End(ended) => prop_assert_eq!(ended, job),
                        _ => prop_assert!(matches!(event, Event::Reset)),
                    },
                    (_, Standing::AtRest) => prop_assert!(matches!(event, Event::Reset)),
                    (Standing::InSheet(job), Standing::Unknown { job: part, .. }) => {
                        prop_assert!(part == job || matches!(event, Event::LoseSupply(false)));
                    }
                    (_, Standing::Unknown { job, due }) => prop_assert_eq!((job, due), (0, false)),
                }
            }
        }
    }
}
