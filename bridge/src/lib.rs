//! The bridge between a USB link and the printer's IEEE 1284 port.
//!
//! This library holds all of the bridge's logic and nothing that depends on a board: the [`port`] drives pins through
//! `embedded-hal`, and the [`engine`] is a state machine without input or output. `no_std`, no allocation, no `unsafe`;
//! it runs in tests on a workstation exactly as it runs on a microcontroller. A conversion with `as` loses no bits, or
//! says at the place why none can be lost.
#![no_std]
#![forbid(unsafe_code)]
#![cfg_attr(not(test), warn(clippy::cast_possible_truncation))]

#[cfg(any(test, feature = "simulation"))]
extern crate std;

pub mod engine;
pub mod pinned;
pub mod port;
mod ring;
#[cfg(any(test, feature = "simulation"))]
pub mod simulation;
mod streams;
