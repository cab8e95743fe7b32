//! A single half-angle curve as a document of one material.

use std::path::Path;

use inks::Curve;

use super::content::{Content, Document, SWATCH_MM};
use super::error::DocumentError;
use super::source::Source;
use crate::brdf::Space;
use crate::materials::Uniform;

/// The longest curve file, in bytes: 65,536 rows, which is the most that a curve may have, of 256 characters
/// each.
pub(super) const MOST_BYTES: u64 = 16 << 20;

/// Opens a curve file.
pub(super) fn open(path: &Path, space: Space, mut source: Source<'_>) -> Result<Document, DocumentError> {
    let bytes = source.read(path, MOST_BYTES)?;
    let header =
        String::from_utf8_lossy(bytes.split(|&b| b == b'\n').next().unwrap_or_default()).to_ascii_lowercase();
    let curve = Curve::from_csv(&bytes[..], path).map_err(|error| match header.contains("theta") {
        true => DocumentError::from(error),
        false => DocumentError::Settings {
            path: path.to_path_buf(),
            problem:
                "line 1 is not the header `theta_h_deg,r,g,b` of a curve; readings of a gloss meter or a \
                      spectrophotometer become one with `foilpress inks from`"
                    .into(),
        },
    })?;
    document(&curve, path, space, source)
}

/// Opens a table of measurements of at most so many bytes, which `parse` averages over the difference angle.
pub(super) fn averaged(
    path: &Path,
    space: Space,
    mut source: Source<'_>,
    most_bytes: u64,
    parse: impl Fn(&[u8], &Path) -> Result<Curve, DocumentError>,
) -> Result<Document, DocumentError> {
    let bytes = source.read(path, most_bytes)?;
    let averaged = parse(&bytes, path)?;
    source.note(
        "an isotropic material: measurements are averaged over the difference angle to a curve of the half angle".into(),
    );
    document(&averaged, path, space, source)
}

/// The document of a curve read from `path`: a square of [`SWATCH_MM`] on a side.
pub(super) fn document(
    curve: &Curve,
    path: &Path,
    space: Space,
    source: Source<'_>,
) -> Result<Document, DocumentError> {
    let uniform = Uniform::new(space, curve).map_err(|error| DocumentError::Field {
        path: path.to_path_buf(),
        field: "reflectance".into(),
        problem: error.to_string(),
    })?;
    let name = source.name_of(path);
    let (notes, digest) = source.finish();
    Ok(Document {
        name,
        content: Content::Uniform(uniform),
        size_mm: Some((SWATCH_MM, SWATCH_MM)),
        notes,
        digest,
        views: None,
    })
}
