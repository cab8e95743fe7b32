//! The stages from outside.

mod damaged_stages;
mod views;
