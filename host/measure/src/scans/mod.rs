//! Scans of charts to what printed dots become and where a printer puts them.
//!
//! `scan` lays a scan over the dots that were printed. [`ramp`] reads dot gain and the smallest cluster that holds from the ramp chart, by
//! the `edges` of its dots; [`registration`] how a printer places and feeds. [`resolution`] is what the files themselves state.

mod edges;
pub mod ramp;
pub mod registration;
pub mod resolution;
mod scan;
