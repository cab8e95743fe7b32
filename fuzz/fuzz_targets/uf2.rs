//! Firmware images, whole and nearly so.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| properties::uf2::check(bytes));
