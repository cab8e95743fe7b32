//! Placement on the page, the plan in words, and the bytes of a job.

pub mod placement;
pub mod plan;
pub mod stream;
