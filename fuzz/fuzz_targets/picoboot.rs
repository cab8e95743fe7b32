//! A boot loader that replies anything, while it is flashed.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| properties::picoboot::check(bytes));
