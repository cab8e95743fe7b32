//! What is promised to users, each sentence with a name, and how often each was put to the test.
//!
//! A promise that nothing endangers is kept by anything. So whoever lives in the world notes each moment in
//! which a promise could have broken: which, by which door bytes were asked for, and where the board took the
//! printer to stand. A run prints that table. A cell that cannot be reached has a reason ([`cannot`]).

use std::collections::BTreeMap;
use std::fmt::Write as _;

/// A promise, and where it is given.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Promise {
    /// Guide, 6: "The program sends only one whole legal job." What reaches the printer behind a part of a
    /// sheet is a reset.
    NothingIntoAnotherSheet,
    /// Guide, 6: "It never sends a job a second time by itself."
    NothingTwice,
    /// Guide, 6: "What it calls *printed* has crossed the printer's own port", and all of it, byte for byte.
    PrintedIsAtThePrinter,
    /// Guide, 6: "If the printer or the bridge loses power in the middle, the sheet is lost, and the program
    /// says so."
    LossIsTold,
    /// Guide, 6, and wiring: a pulled data cable, a crash or a restart of the board by its watchdog costs
    /// nothing.
    HarmlessCostsNothing,
    /// Guide, 6: "or end the sheet; the printer is ready for the next job".
    EndedSheetIsLegal,
    /// Guide, 6: between jobs, and only there, the printer is asked for its status.
    NoQuestionInASheet,
    /// Guide, 6: a sheet that is said to be out is out.
    OutIsOut,
    /// Guide, 6: a job that stays on disk can be resumed until it has ended.
    EveryJobEnds,
    /// Decision "print alone": what the flash does not hold any more is told as broken.
    StoredIsWholeOrBroken,
}

impl Promise {
    /// All of them.
    pub const ALL: [Promise; 10] = [
        Promise::NothingIntoAnotherSheet,
        Promise::NothingTwice,
        Promise::PrintedIsAtThePrinter,
        Promise::LossIsTold,
        Promise::HarmlessCostsNothing,
        Promise::EndedSheetIsLegal,
        Promise::NoQuestionInASheet,
        Promise::OutIsOut,
        Promise::EveryJobEnds,
        Promise::StoredIsWholeOrBroken,
    ];
}

/// A promise that was not kept.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Broken {
    /// Which.
    pub promise: Promise,
    /// In which step.
    pub step: u64,
    /// What was found.
    pub found: String,
}

/// By which way bytes were asked for.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Door {
    /// A job of the program over the link.
    Link,
    /// A job of an operating system through the plain printer interface.
    Plain,
    /// A stored job that a program has printed.
    Stored,
    /// A stored job that the button has started.
    Button,
    /// A question to the printer.
    Question,
}

impl Door {
    /// All of them.
    pub const ALL: [Door; 5] = [Door::Link, Door::Plain, Door::Stored, Door::Button, Door::Question];
}

/// Where the board took the printer to stand.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum State {
    /// It did not know.
    Unknown,
    /// Between two jobs.
    AtRest,
    /// In a sheet.
    InSheet,
    /// The board was down.
    Down,
}

impl State {
    /// All of them.
    pub const ALL: [State; 4] = [State::Unknown, State::AtRest, State::InSheet, State::Down];
}

/// How often each promise was endangered.
#[derive(Clone, Default, Debug)]
pub struct Table(BTreeMap<(Promise, Door, State), u64>);

impl Table {
    /// A promise could break now.
    pub fn note(&mut self, promise: Promise, door: Door, state: State) {
        *self.0.entry((promise, door, state)).or_default() += 1;
    }

    /// Adds another run's.
    pub fn add(&mut self, other: &Table) {
        for (key, count) in &other.0 {
            *self.0.entry(*key).or_default() += count;
        }
    }

    /// How often this was the case.
    pub fn count(&self, promise: Promise, door: Door, state: State) -> u64 {
        self.0.get(&(promise, door, state)).copied().unwrap_or(0)
    }

    /// How often a promise was endangered, whatever the door and the state.
    pub fn total(&self, promise: Promise) -> u64 {
        self.0.iter().filter(|((which, ..), _)| *which == promise).map(|(_, count)| count).sum()
    }

    /// Doors and states in which a promise was never endangered though it can be, and cells that were reached
    /// though they cannot be. A single cell may be so rare that it is chance.
    pub fn gaps(&self) -> Vec<String> {
        let mut gaps = Vec::new();
        let cells = || Door::ALL.into_iter().flat_map(|door| State::ALL.map(|state| (door, state)));
        for promise in Promise::ALL {
            for (door, state) in cells() {
                let count = self.count(promise, door, state);
                if let Some(why) = cannot(promise, door, state).filter(|_| count > 0) {
                    gaps.push(format!("{promise:?} by {door:?} in {state:?}: {count} times, though {why}"));
                }
            }
            let mut all = |name: String, of: &dyn Fn(Door, State) -> bool| {
                let own = cells()
                    .filter(|&(door, state)| of(door, state) && cannot(promise, door, state).is_none());
                let counts: Vec<u64> = own.map(|(door, state)| self.count(promise, door, state)).collect();
                if !counts.is_empty() && counts.iter().all(|count| *count == 0) {
                    gaps.push(format!("{promise:?} {name}: never"));
                }
            };
            Door::ALL.into_iter().for_each(|one| all(format!("by {one:?}"), &|door, _| door == one));
            State::ALL.into_iter().for_each(|one| all(format!("in {one:?}"), &|_, state| state == one));
        }
        gaps
    }

    /// The table as text: a row for each promise and door, a column for each state; `-` where there can be
    /// nothing.
    pub fn text(&self) -> String {
        let mut text = format!("{:<24} {:<9}", "endangered", "by");
        for state in State::ALL {
            let _ = write!(text, " {:>9}", format!("{state:?}"));
        }
        for promise in Promise::ALL {
            for door in Door::ALL {
                if State::ALL.iter().all(|&state| cannot(promise, door, state).is_some()) {
                    continue;
                }
                let _ = write!(text, "\n{:<24} {:<9}", format!("{promise:?}"), format!("{door:?}"));
                for state in State::ALL {
                    let count = match cannot(promise, door, state) {
                        Some(_) => "-".into(),
                        None => self.count(promise, door, state).to_string(),
                    };
                    let _ = write!(text, " {count:>9}");
                }
            }
        }
        text
    }
}

/// The doors and states in which each promise is tried, as rows of a document's table.
pub fn tried() -> String {
    let mut text = String::new();
    for promise in Promise::ALL {
        let mut rows: Vec<(Vec<State>, Vec<String>)> = Vec::new();
        for door in Door::ALL {
            let is_tried = |state: &State| cannot(promise, door, *state).is_none();
            let states: Vec<State> = State::ALL.into_iter().filter(is_tried).collect();
            match rows.iter_mut().find(|(known, _)| *known == states) {
                _ if states.is_empty() => {}
                Some((_, doors)) => doors.push(format!("{door:?}")),
                None => rows.push((states, vec![format!("{door:?}")])),
            }
        }
        for (states, doors) in rows {
            let states: Vec<String> = states.iter().map(|state| format!("{state:?}")).collect();
            let _ = writeln!(text, "| {promise:?} | {} | {} |", doors.join(", "), states.join(", "));
        }
    }
    text
}

/// Why a promise cannot be endangered by this door in this state, if it cannot.
pub fn cannot(promise: Promise, door: Door, state: State) -> Option<&'static str> {
    use Promise::*;
    match (promise, door, state) {
        (NothingIntoAnotherSheet, _, State::AtRest) => {
            Some("the board would take a printer with a part of a sheet to have none")
        }
        (NothingIntoAnotherSheet, _, State::Down) => Some("nobody asks a board that is down"),
        (NothingTwice, Door::Plain | Door::Button | Door::Question, _) => {
            Some("such a job has no number of its own")
        }
        (NothingTwice, Door::Stored, State::Down) => Some("its host asks the board, which is down"),
        (PrintedIsAtThePrinter, Door::Plain | Door::Button | Door::Question, _) => {
            Some("nobody is told how such a job has ended")
        }
        (PrintedIsAtThePrinter, _, State::Down) => Some("a board that is down tells nothing"),
        (LossIsTold, Door::Plain | Door::Button | Door::Question, _) => {
            Some("nobody is told how such a job has ended")
        }
        (LossIsTold, _, State::Down) => Some("a board that is down tells nothing"),
        (HarmlessCostsNothing, Door::Plain | Door::Button | Door::Question, _) => {
            Some("nobody is told how such a job has ended")
        }
        (HarmlessCostsNothing, _, State::Down) => Some("no job is open at a board that is down"),
        (EndedSheetIsLegal, Door::Question, _) => Some("a question is not ended early"),
        (EndedSheetIsLegal, _, State::Unknown | State::AtRest | State::Down) => {
            Some("of a sheet that is ended a part has crossed")
        }
        (NoQuestionInASheet, Door::Link | Door::Plain | Door::Stored | Door::Button, _) => {
            Some("it is about questions")
        }
        (NoQuestionInASheet, _, State::AtRest) => {
            Some("the board would take a printer with a part of a sheet to have none")
        }
        (NoQuestionInASheet, _, State::Down) => Some("nobody asks a board that is down"),
        (OutIsOut, Door::Plain | Door::Stored | Door::Button | Door::Question, _) => {
            Some("the program waits for sheets of its own jobs only")
        }
        (OutIsOut, _, State::Down) => Some("nobody asks a board that is down"),
        (EveryJobEnds, Door::Question, _) => Some("it is about jobs"),
        (EveryJobEnds, Door::Plain | Door::Button, _) => Some("such a job is known to the board alone"),
        (StoredIsWholeOrBroken, Door::Link | Door::Plain | Door::Question, _) => {
            Some("it is about stored jobs")
        }
        (StoredIsWholeOrBroken, _, State::Unknown | State::AtRest | State::Down) => {
            Some("it is judged in its sheet")
        }
        _ => None,
    }
}
