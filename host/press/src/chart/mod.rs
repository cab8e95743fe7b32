//! Charts: dot maps made by the program itself, to look at inks, to measure them, and to measure the printer.
//!
//! [`ramp()`] and [`ladder`] are figures 2 and 5 of the 2009 paper, [`stacks`] lays all stacks side by side for measuring,
//! [`halftones`] the halftones, [`registration()`] shows how far passes are apart, [`calibration()`] where the printer starts and how far it feeds.
//! [`first()`] and [`heads`] try a printer and its cartridges for a few millimetres of ribbon. Each gives
//! a [`DotMap`](sheet::DotMap) that is laid out and printed like any other.

pub mod calibration;
mod error;
pub mod first;
mod methods;
pub mod ramp;
mod registration;
mod room;
mod sketch;
mod steps;

pub use calibration::calibration;
pub use error::ChartError;
pub use first::{first, heads};
pub use methods::{halftones, size_of_halftones};
pub use ramp::ramp;
pub use registration::registration;
pub use room::check_room;
pub use steps::{Can, ladder, size_of_ladder, stacks};

#[cfg(test)]
mod tests;
