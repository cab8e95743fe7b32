//! The size of a document on paper, the plan in words, figures and as a page, and the bytes of a job.

pub mod loading;
pub mod page;
pub mod placement;
pub mod plan;
pub mod ribbon;
pub mod stream;
mod thin;
