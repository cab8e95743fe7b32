//! Memory and flash of any content, before a bridge starts.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| properties::kept::check(bytes));
