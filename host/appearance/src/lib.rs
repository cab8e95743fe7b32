//! What a material is, and how inks make it.
//!
//! The modules stand in the order of the data: [`brdf`] holds curves and the metric that compares them, [`document`] reads
//! materials, [`factor`] turns them into bases and [`weights`], [`gamut`] maps the bases to stacks of ink with the solvers of
//! [`solve`]. [`sample`] draws documents to try all of it on. Nothing here knows dots, pages or printers.
#![deny(unsafe_code)]

pub mod brdf;
pub mod document;
pub mod factor;
pub mod gamut;
pub mod sample;
pub mod solve;
pub mod weights;
