//! Pass streams: as they come, and as they are made.
#![no_main]

#[path = "../properties/mod.rs"]
mod properties;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| properties::runs::check(bytes));
