//! Errors of pictures.

use std::path::PathBuf;

use sheet::Area;

/// The longest side of any picture, in pixels: larger than every sheet in dots.
pub const LONGEST_SIDE: usize = 8192;

/// Why a picture cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum PreviewError {
    /// The tabulation has no half angles, which lights need.
    #[error(
        "a picture needs reflectance over the half angle, but this tabulation of {columns} columns has no angles"
    )]
    NoAngles {
        /// Columns of the tabulation.
        columns: usize,
    },
    /// A table of another tabulation or with a wrong number of rows.
    #[error("{what}: expected {expected}, found {found}")]
    Shape {
        /// The table or list.
        what: &'static str,
        /// The number it should have.
        expected: usize,
        /// The number it has.
        found: usize,
    },
    /// The picture would be empty or too large.
    #[error("the picture would be {width} x {height} pixels; each side must be 1 to {LONGEST_SIDE}")]
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
    /// A light that cannot shine on the sheet.
    #[error("light {light}: {problem}")]
    Light {
        /// Its number, from 0.
        light: usize,
        /// What is wrong.
        problem: &'static str,
    },
    /// The file is not a usable light probe.
    #[error("{}: {problem}; expected a Radiance .hdr or an OpenEXR file of a latitude-longitude panorama, twice as wide as high", path.display())]
    Probe {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        problem: String,
    },
}

/// Checks the sides of a picture.
pub(super) fn check_size(width: usize, height: usize) -> Result<(), PreviewError> {
    if (1..=LONGEST_SIDE).contains(&width) && (1..=LONGEST_SIDE).contains(&height) {
        Ok(())
    } else {
        Err(PreviewError::Size { width, height })
    }
}
