//! Pictures of materials: lit spheres, the lit sheet beside its target, and the difference between the two.
//!
//! Everything here uses one fact: reflectance is linear. A sphere under a light probe is a matrix (light transport)
//! times a curve. A pixel of the sheet is the mixture of its dots' curves, read at one half angle per light.
//! Units: radiance of a surface under irradiance 1 where it faces the light, linear Rec. 709.
//! Limits: one bounce, no shadows, no paper curl, BRDFs of the half angle only, an eye infinitely far away.
//!
//! [`sphere`] lights balls, [`Probe`] is the light around them, [`Source`] gives the reflectance of a document or a
//! sheet at each pixel, [`flat()`] lights it, [`fidelity()`] compares two sources as the eye does, and
//! [`gloss`] says what a gloss meter reads, [`Panels`] and [`materials_picture()`] lay the results out.

mod canvas;
mod contrasts;
mod error;
mod fidelity;
pub mod figures;
mod fine;
mod flat;
pub mod gloss;
pub mod inks;
mod light_tree;
mod materials_picture;
mod near;
mod probe;
mod radiance;
mod sheet_picture;
mod source;
mod spectrum;
pub mod sphere;
mod tone;
mod wear;

pub use canvas::{Heading, picture};
pub use contrasts::{Contrasts, contrasts};
pub use error::{LONGEST_SIDE, PreviewError};
pub use fidelity::{EYE, FidelityReport, fidelity, spot_mm};
pub use fine::{ENTRIES, Fine};
pub use flat::{Light, flat};
pub use materials_picture::{Swatch, materials_picture, mix_in_words};
pub use near::{Board, mirrored, near_picture};
pub use probe::Probe;
pub use radiance::Radiance;
pub use sheet_picture::{Panels, STANDARD_LIGHTS, TILTS};
pub use source::Source;
pub use spectrum::{Spectrum, spectrum};
pub use tone::ToneCurve;
pub use wear::{Moved, Wear, Worn};
