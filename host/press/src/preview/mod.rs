//! Pictures of materials: lit spheres, the lit sheet beside its target, and how far apart the two are.
//!
//! Everything here uses one fact: reflectance is linear. A sphere under a probe is a matrix (light transport)
//! times a curve; a pixel of the sheet is the mixture of its dots' curves looked up at one half angle per light.
//! Units: radiance of a surface under irradiance 1 where it faces the light, linear Rec. 709.
//! Limits: one bounce, no shadows, no paper curl, BRDFs of the half angle only; an eye infinitely far away.
//!
//! [`sphere`] lights balls, [`probe`] is the light around them, [`source`] says what lies at a pixel of a
//! document or a sheet, [`mod@flat`] lights it, [`fidelity()`] compares two of them as the eye would, [`tone`] turns
//! radiance to bytes, and [`sheet_picture()`] and [`materials_picture()`] lay the results out.

pub mod fidelity;
pub mod flat;
pub mod inks;
pub mod probe;
pub mod source;
pub mod sphere;
pub mod tone;

mod canvas;
mod materials_picture;
mod sheet_picture;

pub use fidelity::{Report, fidelity};
pub use flat::{Light, flat};
pub use materials_picture::{Swatch, materials_picture, mix_in_words};
pub use probe::Probe;
pub use sheet_picture::{STANDARD_LIGHTS, sheet_picture};
pub use source::{Source, stack_table};

use std::path::PathBuf;

use crate::sheet::Area;

/// The longest side of any picture made here, in pixels: larger than every sheet in dots.
pub const LONGEST_SIDE: usize = 8192;

/// Linear radiance, row by row from the top; the fourth value is how much of the pixel is covered (0 to 1), and
/// the colours are already multiplied by it.
#[derive(Clone, Debug, PartialEq)]
pub struct Radiance {
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// `width * height` values R, G, B, coverage.
    pub pixels: Vec<[f32; 4]>,
}

/// Why there is no picture.
#[derive(Debug, thiserror::Error)]
pub enum PreviewError {
    /// The tabulation has no half angles, so there is nothing to look a light up by.
    #[error(
        "a picture needs reflectance over the half angle; this tabulation of {columns} columns has no angles"
    )]
    NoAngles {
        /// Columns of the tabulation.
        columns: usize,
    },
    /// A table belongs to another tabulation, or has another number of rows.
    #[error("{what}: expected {expected}, found {found}")]
    Shape {
        /// Which table or list.
        what: &'static str,
        /// How many it should have.
        expected: usize,
        /// How many it has.
        found: usize,
    },
    /// The picture asked for is empty or absurdly large.
    #[error("a picture of {width} x {height} pixels; each side must be 1 to {LONGEST_SIDE}")]
    Size {
        /// Pixels across.
        width: usize,
        /// Pixels down.
        height: usize,
    },
    /// The area is empty or reaches beyond the sheet.
    #[error("the area at ({}, {}) of {} x {} dots is not within the sheet of {width} x {length} dots",
        area.left, area.top, area.width, area.length)]
    Area {
        /// The area.
        area: Area,
        /// Dots across the sheet.
        width: usize,
        /// Rows of the sheet.
        length: usize,
    },
    /// A light that cannot light the sheet.
    #[error("light {light}: {problem}")]
    Light {
        /// Which, counted from zero.
        light: usize,
        /// What is wrong with it.
        problem: &'static str,
    },
    /// The file is no usable light probe.
    #[error("{}: {problem}; expected a Radiance .hdr of a latitude-longitude panorama, twice as wide as high", path.display())]
    Probe {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        problem: String,
    },
}

pub(crate) fn check_size(width: usize, height: usize) -> Result<(), PreviewError> {
    if (1..=LONGEST_SIDE).contains(&width) && (1..=LONGEST_SIDE).contains(&height) {
        Ok(())
    } else {
        Err(PreviewError::Size { width, height })
    }
}
