//! Everything joined, a module for each scenario.

#![allow(clippy::disallowed_methods, reason = "tests compare with the standard mathematics")]

mod bridge;
mod corpora;
mod documents;
#[cfg(unix)]
mod emulator;
mod golden;
mod link;
mod pass_streams;
#[cfg(unix)]
mod queue;
mod reference_renderer;
#[cfg(unix)]
mod serve;
#[cfg(unix)]
mod shown;
