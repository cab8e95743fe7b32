//! Relightable pictures: a document, its mixture of inks or the printed dots, under any light and from any direction.
//!
//! [`Lit`] is what is lit: a few curves over the half angle and a weight for each of them at every place. A [`Scene`] says
//! where the eye and the lights are and how the sheet is held. [`Renderer`] makes a picture of both, and [`page`] writes a
//! page that makes the same pictures in a browser, where they follow the hand. [`glb`] writes what is lit for other programs.
//! [`Lit::with_dot_gain`] adds what light does inside the paper, [`Renderer::seen_from`] what an eye does at a distance. [`display`] lays a screen over a printed grid of stacks and shows what is seen.
//! Units: metres, radians; x points right, y up, z to the eye that looks straight at the sheet. The origin is the middle of
//! the sheet. Radiance is that of a surface under irradiance 1 where it faces the light, linear Rec. 709.

#![allow(clippy::disallowed_methods, reason = "pictures decide no dot; what does, forbids them again")]
#![forbid(unsafe_code)]
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_precision_loss,
    clippy::cast_sign_loss,
    reason = "pixel arithmetic: sides are below 8192 and checked at the input; rounding to f32 and to bytes is the purpose of \
              most casts"
)]

mod coat;
pub mod display;
mod error;

mod footprint;
mod gain;
mod glb;
mod light;
mod lit;
pub mod page;
mod ray;
mod render;
mod scene;
mod surroundings;
mod viewing_distance;

pub use error::ViewError;
pub use gain::{DOT_GAIN, places_for_dot_gain};
pub use glb::{Glb, glb};
pub use lit::{Lit, fit, mapped};
pub use render::Renderer;
pub use scene::{Camera, Light, Pose, Scene, direction, proportions};
pub use viewing_distance::finer;
