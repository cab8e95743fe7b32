//! What bridge and printer are asked outside of a job, and what their answers mean.
//!
//! [`query`] asks. [`status`] reads the printer's answer and [`cartridges`] compares it with what a job needs; [`log`] decodes
//! the firmware's log, and [`wiring`] names the fault behind what a loop-back plug shows.

pub mod cartridges;
#[cfg(feature = "log")]
pub mod log;
pub mod query;
pub mod status;
pub mod wiring;
