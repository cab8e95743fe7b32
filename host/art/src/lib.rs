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
mod colour;
mod dots;
mod error;
mod options;
mod read;
mod window;

pub use artwork::{Above, Artwork, Layer, Shape};
pub use colour::Colour;
pub use colour::intent::Intent;
pub use dots::compose::{
    Accept, Composed, Finish, GAMMAS, InkLayer, MOST_CHOKE_MM, Order, Remedy, Report, Settings, Suggestion,
    Text, compose,
};
pub use dots::trace::Path as CutPath;
pub use dots::white::White;
pub use options::{Options, Pages, Room, TOLERANCES};
pub use read::open::{is_art, open};
pub use read::page::Page;
pub use read::seen::{Seen, seen};
pub use read::svg::DRAWING;
pub use read::{names, object_type, pdf, process};
pub use window::Window;

#[cfg(test)]
mod tests;
