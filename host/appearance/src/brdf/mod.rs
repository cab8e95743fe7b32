//! Reflectance as rows of numbers, and the distance people see between two of them.

pub mod analytic;
pub mod plot;
pub mod space;
pub mod stacks;

pub use inks::Curve;
pub use space::{Space, SpaceError, Table};
