//! Pass streams: as they come, and as they are made.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| properties::runs::check(bytes));
