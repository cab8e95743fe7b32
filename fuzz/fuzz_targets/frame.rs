//! Bytes of a cable: frames, damaged frames, and what is inside them.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| properties::frame::check(bytes));
