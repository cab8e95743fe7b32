//! A printer that shows anything on its lines, while it is asked.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| properties::talk::check(bytes));
