//! Reflectance as rows of numbers, and the distance people see between two of them.

pub mod space;

pub use inks::Curve;
pub use space::{Space, SpaceError, Table};
