//! What has to hold whatever the bytes: each target's `check` panics if it does not.
//!
//! The fuzzer calls one of these; the project's ordinary tests call all of them with the corpora.

pub mod art;
pub mod engine;
pub mod frame;
pub mod host;
pub mod ipp;
pub mod kept;
pub mod picoboot;
pub mod raster;
pub mod rgl;
pub mod runs;
pub mod talk;
pub mod uf2;
