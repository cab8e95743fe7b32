//! The resolution that a picture's file states.
//!
//! Limits: cameras and programs that do not know it write 72 or 96, so whoever uses it has to check it.

use std::path::Path;

use readers::Format;

use crate::MeasureError;

/// Pixels per inch across and down as the file states them.
///
/// # Errors
/// A file that cannot be read.
pub fn dpi(path: &Path) -> Result<Option<[f64; 2]>, MeasureError> {
    let bytes =
        std::fs::read(path).map_err(|source| MeasureError::Io { path: path.to_path_buf(), source })?;
    let stated = Format::of(&bytes, path).ok().and_then(|format| format.resolution(&bytes));
    Ok(stated.map(|(across, down)| [across, down]))
}
