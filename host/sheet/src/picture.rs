//! Pictures of exact dots as files.
//!
//! A picture that is data must come back bit by bit: a file with another size, depth or kind than expected is
//! refused ([`readers::exact`]).

use std::io::BufReader;
use std::path::Path;

use files::shelf::{Disk, Shelf as _};
use files::{FileError, io, write};
use readers::exact::{self, Exact, Inexact};

/// A picture with so many pixels per inch across and down, as the bytes of a PNG.
///
/// # Errors
/// Data of another size than the picture's.
pub fn encoded(size: (usize, usize), dpi: (u16, u16), kind: Exact, data: &[u8]) -> std::io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    exact::write(&mut bytes, size, Some(dpi), kind, data)?;
    Ok(bytes)
}

/// Writes a picture with so many pixels per inch across and down.
pub fn write_png(
    path: &Path,
    size: (usize, usize),
    dpi: (u16, u16),
    kind: Exact,
    data: &[u8],
) -> Result<(), FileError> {
    write(path, |out| exact::write(out, size, Some(dpi), kind, data))
}

/// Reads a picture that must be of this size and kind; for an indexed one the colours may differ, not their
/// number.
pub fn read_png(path: &Path, size: (usize, usize), kind: Exact) -> Result<Vec<u8>, FileError> {
    let file = Disk.open(path).map_err(io(path, "open"))?;
    exact::read(BufReader::new(file), size, kind).map_err(|error| {
        let path = path.to_path_buf();
        match error {
            Inexact::Damaged(source) => FileError::Png { path, source },
            Inexact::Other { expected, found } => FileError::Kind { path, expected, found },
        }
    })
}
