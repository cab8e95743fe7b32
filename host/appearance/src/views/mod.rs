//! Two pictures in one print: one is seen from most sides, the other in the reflection of the light.
//!
//! Problem: what the eye sees of a print straight on and what it sees in the reflection are two numbers a
//! place, and the stacks decide both at once. Paper under finish is as bright as bare paper beside the
//! light, and five times as bright in it.
//! Method: [`reach`] finds how bright and how dark mixtures of the stacks can be in one view *whatever*
//! they are in the other. Between these limits the luminance of a pixel straight on follows the first
//! picture, that in the reflection the second, so neither shows in the view of the other. The result is an
//! ordinary factored document: bases are the corners of the limits, for each corner of the first picture's
//! colours, and weight maps are products ([`open`]). Everything after it is as for any document.
//! Cost: a few milliseconds for the limits, one pass over the pictures.
//! Limits: both views are judged by luminance at one half angle each; the second picture is printed in its
//! lightness, because a reflection takes its colour from the metal or the finish. How much of a picture
//! still shows in the wrong view is measured on the dots (`press::preview::contrasts`).
//! Source: Hersch et al. 2003 print metal inks beside standard ones in one picture; here the choice is left
//! to the hull of the stacks, and the second picture is a target of its own.

use maths::Maths;

mod exposures;
mod open;
mod reach;

pub use open::{Pictures, ViewsError, open};
pub use reach::{Reach, reach};

/// The half angle, in radians, at which the first picture is judged: lamp at 45 degrees, eye above (CIE 15,
/// ISO 13655).
pub const STRAIGHT: f64 = 22.5 * std::f64::consts::PI / 180.0;

/// The half angle at which the second is judged: the eye where the print mirrors the lamp.
pub const REFLECTION: f64 = 0.0;

/// The least difference in lightness, of 1 from black to white, with which a picture is worth a print: what
/// the ink of a watermark has. Weaker ones are refused.
pub const FAINTEST: f64 = 0.1;

/// What is known of the pictures of a document, beside its bases and maps.
#[derive(Clone, Debug, PartialEq)]
pub struct Views {
    /// The names of the pictures: straight on, in the reflection.
    pub names: [String; 2],
    /// For each basis, the luminance of both pictures, 0 to 1, where the basis has full weight.
    pub shown: Vec<[f64; 2]>,
    /// The luminance (1/sr) of white straight on: the brightest stack.
    pub white: f64,
}

/// The difference in lightness of two luminances under a white, as the cube root of 1976's L*: 1 from black
/// to white.
#[must_use]
pub fn contrast(dark: f64, bright: f64, white: f64) -> f64 {
    let root = |luminance: f64| (luminance.max(0.0) / white).cube_root();
    root(bright) - root(dark)
}
