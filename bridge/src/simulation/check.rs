//! Whether a waveform keeps to its timing.

use super::{Edge, Line};
use crate::port::Timing;
use std::vec::Vec;

/// A strobe that broke a rule; all times in ns.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Violation {
    /// Data had not been stable long enough before nStrobe fell.
    Setup {
        /// Of the strobe.
        at: u64,
        /// How long they had been.
        stable: u64,
    },
    /// nStrobe was low too briefly.
    Strobe {
        /// Of the strobe.
        at: u64,
        /// How long it was.
        low: u64,
    },
    /// Data changed too early after nStrobe rose.
    Hold {
        /// Of the strobe.
        at: u64,
        /// After how long.
        held: u64,
    },
    /// nStrobe fell while Busy was high or a status line showed a fault.
    NotReady {
        /// Of the strobe.
        at: u64,
    },
    /// Data changed while the printer was still busy with them.
    ChangedWhileBusy {
        /// Of the change.
        at: u64,
    },
}

/// Every strobe of forward mode in `edges` that breaks `timing`.
pub fn check(edges: &[Edge], timing: &Timing) -> Vec<Violation> {
    let mut violations = Vec::new();
    let (mut data_at, mut fall_at, mut rise_at) = (0, None::<u64>, None::<u64>);
    let (mut busy, mut paper_out, mut select, mut fault, mut power, mut forward) = (0, 0, 1, 1, 1, true);
    for &Edge { at, line, level } in edges {
        match line {
            Line::Busy => busy = level,
            Line::PaperOut => paper_out = level,
            Line::Select => select = level,
            Line::Fault => fault = level,
            Line::Power => power = level,
            Line::SelectIn => forward = level == 0,
            Line::Data => {
                if forward && busy == 1 {
                    violations.push(Violation::ChangedWhileBusy { at });
                }
                match (fall_at, rise_at) {
                    (Some(fall), None) => violations.push(Violation::Hold { at: fall, held: 0 }),
                    (_, Some(rise)) if at - rise < u64::from(timing.hold) => {
                        violations.push(Violation::Hold { at: rise, held: at - rise });
                    }
                    _ => {}
                }
                data_at = at;
            }
            Line::Strobe if level == 0 && forward => {
                if at - data_at < u64::from(timing.setup) {
                    violations.push(Violation::Setup { at, stable: at - data_at });
                }
                if busy == 1 || paper_out == 1 || select == 0 || fault == 0 || power == 0 {
                    violations.push(Violation::NotReady { at });
                }
                (fall_at, rise_at) = (Some(at), None);
            }
            Line::Strobe if level == 1 => {
                if let Some(fall) = fall_at
                    && at - fall < u64::from(timing.strobe)
                {
                    violations.push(Violation::Strobe { at: fall, low: at - fall });
                }
                rise_at = fall_at.take().map(|_| at);
            }
            _ => {}
        }
    }
    violations
}
