//! The library from outside: its figures, its rules, folders and archives of it.

#![allow(clippy::disallowed_methods, reason = "tests compare with the standard mathematics")]

mod archives;
mod folders;
mod physics;
mod published;
mod rules;
