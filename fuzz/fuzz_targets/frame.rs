//! Bytes of a cable: frames, damaged frames, and what is inside them.
#![no_main]

#[path = "../properties/mod.rs"]
mod properties;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| properties::frame::check(bytes));
