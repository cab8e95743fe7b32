//! The stages from outside.

mod damaged_stages;
mod dove;
mod views;
