//! The bridge: what stands between a USB link and the printer's IEEE 1284 port.
//!
//! This library is everything of it that has logic and nothing of it that has a board: the [`port`] talks to
//! pins through `embedded-hal`, the [`engine`] is a state machine without input or output. `no_std`, no
//! allocation, no `unsafe`; it runs in tests on a workstation exactly as it runs on a microcontroller.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(any(test, feature = "simulation"))]
extern crate std;

pub mod engine;
pub mod pinned;
pub mod port;
mod ring;
#[cfg(any(test, feature = "simulation"))]
pub mod simulation;
mod streams;
mod track;
