//! The stages from outside.

#![allow(clippy::disallowed_methods, reason = "tests compare with the standard mathematics")]

mod damaged_stages;
mod dove;
mod views;
