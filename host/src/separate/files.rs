//! Passes on disk.
