//! The command line: one file for each subcommand.

pub mod output;
pub mod progress;
