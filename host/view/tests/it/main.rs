//! Pictures and pages against others who make the same.

#![allow(clippy::disallowed_methods, reason = "tests compare with the standard mathematics")]

mod browser;
mod reference;
