//! Reflectance as rows of numbers, and the distance people see between two of them.

mod compare;
pub mod plot;
mod space;
mod stacks;

pub use compare::{Difference, Largest, compare};
pub use space::{Space, SpaceError, Table};
pub use stacks::reflectances;
pub(crate) use stacks::rows;
