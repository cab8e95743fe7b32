//! A file of art, to the reader of its kind, or the name of an ink.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| properties::art::check(bytes));
