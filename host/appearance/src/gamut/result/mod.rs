//! What a mapping gives: the mix that the halftoner reads, its files, and facts about it.

pub(super) mod assemble;
pub mod files;
pub(super) mod mix;
pub(super) mod report;
pub(super) mod uncertainty;
