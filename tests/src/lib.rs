//! Scenarios that join every part; the tests themselves stand in `tests/`.

#[cfg(unix)]
pub mod emulated;
pub mod planes;
pub mod rig;
pub mod served;
