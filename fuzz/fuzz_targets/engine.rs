//! The bridge's engine: garbage on the link, and every order of calls.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| properties::engine::check(bytes));
