//! What tests of several crates share.
//!
//! [`needs`] leaves a test out where this computer lacks something, and sees to it that nobody overlooks that; [`program`] runs
//! the program in a folder of its own, and [`browser`] scripts for its pages; [`damage`] spoils good files for the tests of
//! readers.
#![forbid(unsafe_code)]

pub mod browser;
pub mod damage;
pub mod program;

pub use needs;
