//! The program as its users run it, a module for each subject.

#![allow(clippy::disallowed_methods, reason = "tests compare with the standard mathematics")]

#[cfg(unix)]
mod art;
mod bad_input;
mod browser;
mod cli;
mod compare;
mod display;
mod edit;
mod escapes;
mod exports;
mod layers;
mod libraries;
#[cfg(unix)]
mod limits;
mod measure;
#[cfg(unix)]
mod missing;
mod page;
mod preview;
mod report;
mod roads;
mod scans;
mod send;
mod sources;
mod text;
mod threads;
mod views;
mod words;
