//! Scenarios that join every part; the tests themselves stand in `tests/`.

#![allow(clippy::disallowed_methods, reason = "tests compare with the standard mathematics")]

#[cfg(unix)]
pub mod emulated;
pub mod planes;
pub mod rig;
pub mod served;
