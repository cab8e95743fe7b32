//! What tests of several crates share.
//!
//! [`needs`] leaves a test out where this computer lacks something, and sees to it that nobody overlooks that; [`program`] runs
//! the program in a folder of its own, and [`browser`] scripts for its pages; [`damage`] spoils good files for the tests of
//! readers, and [`device`] is a device that takes bytes as they are.
#![forbid(unsafe_code)]

pub mod browser;
pub mod damage;
pub mod device;
pub mod program;

pub use needs;

use proptest::test_runner::Config;

/// What a property test with cases dearer or cheaper than usual tries: so many where others try 64, and in proportion where
/// `PROPTEST_CASES` asks for more.
pub fn cases(of_64: u32) -> Config {
    let usual = Config::default();
    Config {
        cases: (u64::from(of_64) * u64::from(usual.cases) / 64).clamp(1, u32::MAX.into()) as u32,
        ..usual
    }
}

/// Whether everything is tried as it stands, not only as much as a change should wait for: `cargo xtask test --full`.
pub fn is_full() -> bool {
    std::env::var_os("FOILPRESS_FULL").is_some_and(|value| !value.is_empty())
}
