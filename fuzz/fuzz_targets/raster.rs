//! Pages of raster, to the reader that print queues and the server share.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| properties::raster::check(bytes));
