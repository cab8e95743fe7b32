//! What is compared: a printed sheet with its document, and photographs that show it.

use std::path::PathBuf;

use appearance::brdf::Space;
use appearance::factor::Factored;
use inks::Library;
use sheet::{Area, DotMap};

use crate::geometry::marks::Mark;
use crate::geometry::sheet_marks::PrintedMark;

/// What was printed, and of what.
pub struct ComparedPrint<'a> {
    /// The dots of the whole sheet, marks included.
    pub sheet: &'a DotMap,
    /// The library that predicts them.
    pub library: &'a Library,
    /// The document, where there is one.
    pub document: Option<ComparedDocument<'a>>,
}

/// The tabulation of stacks: so fine that reading between its angles is exact to a thousandth, as a document's own is not.
pub fn space() -> Space {
    Space::half_angle(512)
}

/// A document and where it is on the sheet.
pub struct ComparedDocument<'a> {
    /// The document.
    pub document: &'a Factored,
    /// Its mixture of stacks, tabulated as [`space`] says.
    pub mapped: &'a Factored,
    /// One copy of it.
    pub area: Area,
}

/// A photograph that shows the sheet. It is read again to be compared, so that many do not fill the memory.
pub(super) struct SheetPhoto {
    pub path: PathBuf,
    pub name: String,
    pub light: usize,
    pub size: (usize, usize),
    pub bent: bool,
    /// What blurs it, in mm of the sheet.
    pub blur: [f64; 2],
    pub marks: Vec<(Mark, PrintedMark)>,
}
