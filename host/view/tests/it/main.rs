//! Pictures and pages against others who make the same.

mod browser;
mod reference;
