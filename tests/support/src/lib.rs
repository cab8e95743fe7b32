//! What tests of several crates share.
//!
//! [`needs`] leaves a test out where this computer lacks something, and sees to it that nobody overlooks that; [`program`] runs
//! the program in a folder of its own, and [`browser`] scripts for its pages; [`damage`] spoils good files for the tests of
//! readers, and [`device`] is a device that takes bytes as they are.
#![forbid(unsafe_code)]

pub mod browser;
pub mod damage;
pub mod device;
pub mod ipp;
pub mod namespace;
pub mod program;
pub mod pwg;

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

/// As many of these as a change should wait for, drawn from what the property tests are drawn from; all of them where
/// [everything is tried](is_full).
pub fn drawn<T>(of: &[T], count: usize) -> impl Iterator<Item = &T> {
    let seed = std::env::var("PROPTEST_RNG_SEED").ok().and_then(|seed| seed.parse().ok()).unwrap_or(0u64);
    let count = if is_full() { of.len() } else { count.min(of.len()) };
    let first = seed.checked_rem(of.len() as u64).unwrap_or(0) as usize;
    of.iter().cycle().skip(first).take(count)
}

/// Whether everything is tried as it stands, not only as much as a change should wait for: `cargo xtask test --full`.
pub fn is_full() -> bool {
    std::env::var_os("FOILPRESS_FULL").is_some_and(|value| !value.is_empty())
}
