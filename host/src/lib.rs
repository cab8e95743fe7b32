//! The program: what people type, and what the print system starts.
//!
//! It turns arguments into settings and results into words; the work is done by the crates below it: `appearance`, `press`,
//! `device` and `queue`. `docs/code.md` leads from each command to its module.
//!
//! Casts that can lose a value are not allowed here: numbers come from command lines, print systems and raster headers, so
//! they are converted with a check or an error. `cast_possible_wrap` stays off: what becomes signed is a count of dots or
//! pixels on one page. Tests cast numbers of their own choice.
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests compare with the standard mathematics"))]
#![forbid(unsafe_code)]
#![cfg_attr(not(test), warn(clippy::cast_possible_truncation, clippy::cast_sign_loss))]

pub mod cli;
mod folders;
mod libraries;
mod own_inks;
