//! A bridge that says anything, to the workstation's session.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| properties::host::check(bytes));
