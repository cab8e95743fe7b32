//! The printer's language: bytes to commands and back.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| properties::rgl::check(bytes));
