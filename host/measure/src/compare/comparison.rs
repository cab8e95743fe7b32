//! The result of a comparison: figures of every photograph, and pictures to look at.

use serde::Serialize;

use super::figures::{Errors, Factor};
use super::passes::PassOff;

/// A comparison: figures that do not depend on pictures.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// Whether there is a document to compare with.
    pub document: bool,
    /// Middle and size of what was compared, in mm of the sheet's frame.
    pub middle_mm: [f64; 2],
    /// Its size.
    pub size_mm: [f64; 2],
    /// The lens.
    pub lens: LensFigures,
    /// Each photograph.
    pub photos: Vec<PhotoFigures>,
    /// Passes that lie beside their place.
    pub passes: Vec<PassOff>,
    /// Root mean square of the photographs' errors.
    pub errors: Errors,
    /// What is doubtful, and what to do.
    pub warnings: Vec<String>,
}

/// The lens as solved.
#[derive(Clone, Debug, Serialize)]
pub struct LensFigures {
    /// Focal length in pixels.
    pub focal_px: f64,
    /// Its relative standard error.
    pub focal_error: f64,
    /// Angle of view across the width.
    pub field_of_view_deg: f64,
    /// Radial terms over the distance from the middle in focal lengths.
    pub radial: [f64; 2],
}

/// One photograph.
#[derive(Clone, Debug, Serialize)]
pub struct PhotoFigures {
    /// File name.
    pub name: String,
    /// Marks that were found.
    pub marks: usize,
    /// Where the camera was, in mm of the sheet's frame.
    pub camera_mm: [f64; 3],
    /// Its standard error.
    pub camera_error_mm: f64,
    /// The camera's axes right, down and forward, on the sheet.
    pub camera_axes: [[f64; 3]; 3],
    /// Distance of the marks' corners from where they should be, in pixels.
    pub residual_px: f64,
    /// Where the lamp was.
    pub light_mm: [f64; 3],
    /// Angle of incidence, angle to the camera and half angle in the middle, in degrees.
    pub angles_deg: [f64; 3],
    /// Least and largest half angle.
    pub half_angles_deg: [f64; 2],
    /// Factor from the file's values, 0 to 1, to radiance under irradiance 1.
    pub scale: [f64; 3],
    /// Standard deviation of what blurs the photograph, across and down the sheet.
    pub blur_mm: [f64; 2],
    /// How far the paper at the marks deviates from the lamp's fall-off.
    pub paper_deviation: f64,
    /// Share of the compared spots that were seen and not clipped.
    pub seen: f64,
    /// Errors.
    pub errors: Errors,
    /// Stacks that are brighter or darker than the library says.
    pub stacks: Vec<Factor>,
}

/// The pictures of one photograph, laid flat, as JPEG.
pub struct Pictures {
    /// The photograph.
    pub photo: Vec<u8>,
    /// The predicted print.
    pub print: Vec<u8>,
    /// The document and its mixture of stacks.
    pub document: Option<(Vec<u8>, Vec<u8>)>,
    /// Photograph against print.
    pub difference: Vec<u8>,
}
