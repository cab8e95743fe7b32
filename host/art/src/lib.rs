//! Flat art in named inks to dots: one picture for each ink, white beneath the art, finish on top.
//!
//! Problem: most sheets are decals and cards. They are drawn as one picture for each ink, as one picture in reserved
//! colours, or as a drawing with named layers. Each dot must end up with one stack of inks.
//! Method: [`open`] reads the files into [`Artwork`]: one plane for each layer at 600 dpi and, for plain pictures, their
//! colours. [`compose`](compose()) adds white and finish, halftones layers that have tones, and makes a stack of every
//! combination of layers that occurs. The art gives the order of the inks; if it does not, the ink library's rules do.
//! Cost: about a second for a page in three layers; see the modules. Limits: 16 layers, the largest page.
//! [`Artwork::notes`] reports everything the readers had to assume.
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests compare with the standard mathematics"))]
#![deny(unsafe_code)]
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_precision_loss,
    clippy::cast_sign_loss,
    reason = "pixel arithmetic: sides and values are bounded by checks at the input (pages fit in u16, pictures in 2^28 pixels, \
              stacks in u8), and checked casts in loops over dots would cost time and hide the arithmetic"
)]

mod artwork;
mod bitplane;
mod colour;
mod compose;
mod coverage;
mod cut_lines;
mod distance;
mod edges;
mod error;
mod even;
mod file;
mod fine;
mod fit;
mod indexed_page;
mod inks_by_name;
mod intent;
mod key;
mod lattice;
mod layered;
pub mod names;
pub mod object_type;
mod open;
mod options;
mod order;
mod page;
pub mod pdf;
mod picture;
mod pixels;
pub mod process;
mod resample;
mod reserved;
mod scans;
mod size;
mod solids;
mod svg;
mod svg_kinds;
mod tones;
mod trace;
mod white;
mod window;

pub use artwork::{Artwork, Layer, Shape};
pub use colour::Colour;
pub use compose::{
    Accept, Composed, Finish, GAMMAS, InkLayer, MOST_CHOKE_MM, Order, Remedy, Report, Settings, Suggestion,
    Text, compose,
};
pub use intent::Intent;
pub use open::{is_art, open};
pub use options::{Options, Pages, Room, TOLERANCES};
pub use page::Page;
pub use svg::DRAWING;
pub use trace::Path as CutPath;
pub use white::White;
pub use window::Window;

#[cfg(test)]
mod tests;
