//! The program: [`cli`] for people, [`queue`] for the print system.
//!
//! It turns arguments into settings and results into words; the work is done by the crates below it: `appearance`, `press` and
//! `device`. `docs/code.md` leads from each command to its module.
#![forbid(unsafe_code)]

pub mod cli;
pub mod folders;
pub mod queue;
