//! Photographs, scans and other readings to curves, as the program uses them.

#![allow(clippy::disallowed_methods, reason = "tests compare with the standard mathematics")]

mod can;
mod disturbed;
mod flat;
mod made;
mod narrow;
mod rendered;
mod renderer;
mod scans;
mod studio;
