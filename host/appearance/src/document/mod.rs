//! Documents of materials: texture folders, glTF files, measured BRDFs, factored documents and built-in samples.
//!
//! Whatever the file, the result is a [`Document`]: pixels, their materials, and the size on paper. Input is untrusted:
//! every reader checks sizes before it allocates, and reports damage as an error that names the file and the field.
//! Whatever a reader had to assume (the colour space of a map, a channel it left out, relief it turned into roughness) is
//! recorded in [`Document::notes`].

mod archive;
mod average;
mod colours;
mod content;
mod curve;
mod error;
pub mod foil;
mod folder;
mod gltf;
mod gonio;
#[cfg(test)]
mod hostile;
mod inputs;
mod materialx;
mod merl;
mod mtl;
mod names;
mod open;
pub(crate) mod picture;
mod relief;
mod rgl;
mod sample;
pub(crate) mod source;
mod spectrum;
pub(crate) mod texture;
mod usd;

pub use content::{ColourSpace, Content, Document, MOST_BYTES, Options, SAMPLES, name_of};
pub use error::DocumentError;
pub use open::{measured, open};
pub use sample::write_sample;
pub use texture::same_shape;

pub use crate::materials::{Materials, Surface};
