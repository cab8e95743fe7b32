//! A print client that says anything, to the server.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| properties::ipp::check(bytes));
