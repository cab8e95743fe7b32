//! Reading documents of materials: textures, glTF, measured BRDFs, factored files.
//!
//! Whatever the file, what comes out is a [`Document`]: pixels, their materials, and how large it is on paper.

pub mod materials;

pub use materials::{Materials, Surface};
