//! What a material is, and how inks make it.
//!
//! The modules follow the data, and each uses only the ones before it: [`brdf`] holds curves and the metric that compares
//! them, [`weights`] fixed-point weight maps, [`solve`] the constrained least squares, [`materials`] what the pixels of a
//! document reflect, [`sample`] drawn materials to try things on, and [`wide`] loops over lanes. [`document`] reads and writes files of materials,
//! [`factor`] turns materials into bases and weights, [`gamut`] maps the bases to stacks of ink, [`edit`] changes them, and [`views`] makes a document of two pictures. Nothing
//! here knows about dots, pages or printers.
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests compare with the standard mathematics"))]
#![deny(unsafe_code)]
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_precision_loss,
    clippy::cast_sign_loss,
    reason = "numerical code: counts stay far below 2^52, rounding to f32 and to fixed point is the purpose of most casts"
)]

pub mod brdf;
pub mod document;
pub mod edit;
pub mod factor;
pub mod gamut;
pub mod materials;
pub mod sample;
pub mod solve;
pub mod srgb;
pub mod views;
pub mod weights;
pub mod wide;
