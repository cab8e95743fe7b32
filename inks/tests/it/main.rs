//! The library from outside: its figures, its rules, folders and archives of it.

mod archives;
mod folders;
mod physics;
mod published;
mod rules;
