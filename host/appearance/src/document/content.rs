//! What a document is, and the choices in reading one.

use std::path::Path;
use std::sync::Arc;

use files::shelf::{Disk, Shelf};
use serde::{Deserialize, Serialize};

use crate::materials::{Factored, Materials, Surfaces, Uniform};
use crate::views::Views;

/// The most bytes in one file, as memory must hold it: an uncompressed 16-bit RGBA image of the largest page
/// has 0.3 GB.
pub const MOST_BYTES: u64 = 1 << 30;

/// Default number of half-angle samples per curve.
pub const SAMPLES: usize = 32;

/// Side of the square that a single material fills on paper by default, in millimetres.
pub(super) const SWATCH_MM: f64 = 50.0;

/// How the numbers of a colour map are encoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ColourSpace {
    /// The transfer curve of IEC 61966-2-1.
    Srgb,
    /// Proportional to reflectance.
    Linear,
}

/// The choices in reading a document.
#[derive(Clone, Debug)]
pub struct Options {
    /// The material to read from a file with several: its number, counted from 0, or its name.
    pub material: Option<String>,
    /// Encoding of the colour maps, where it differs from the usual one of the file format.
    pub colour_space: Option<ColourSpace>,
    /// Samples of the half angle, 1 to 4096.
    pub samples: usize,
    /// Where its files stand.
    pub shelf: Arc<dyn Shelf>,
}

impl Default for Options {
    fn default() -> Options {
        Options { material: None, colour_space: None, samples: SAMPLES, shelf: Arc::new(Disk) }
    }
}

/// The pixels of a document.
#[derive(Debug)]
pub enum Content {
    /// A surface for every pixel.
    Surfaces(Surfaces),
    /// Bases and their weight maps, already factored.
    Factored(Factored),
    /// One material everywhere.
    Uniform(Uniform),
}

/// A document of materials. See the module documentation.
#[derive(Debug)]
pub struct Document {
    /// The name of the sample, material or file.
    pub name: String,
    /// Its materials.
    pub content: Content,
    /// Width and height on paper in millimetres, if the document gives them.
    pub size_mm: Option<(f64, f64)>,
    /// What the reader assumed, in sentences.
    pub notes: Vec<String>,
    /// SHA-256 over the files read (their names and bytes), in hexadecimal.
    pub digest: String,
    /// What two pictures it shows, if it was made of two.
    pub views: Option<Views>,
}

impl Document {
    /// Its pixels.
    pub fn materials(&self) -> &dyn Materials {
        match &self.content {
            Content::Surfaces(surfaces) => surfaces,
            Content::Factored(factored) => factored,
            Content::Uniform(uniform) => uniform,
        }
    }

    /// Bases and maps, if the document is already factored.
    pub fn as_factored(&self) -> Option<&Factored> {
        match &self.content {
            Content::Factored(factored) => Some(factored),
            _ => None,
        }
    }
}

/// Endings of the folders that this program writes.
const ENDINGS: [&str; 6] = ["foil", "mix", "dots", "sheet", "passes", "print"];

/// The name of what is stored at a path: a file's without its ending, a folder's as it is, dots included, without an ending of
/// this program's own.
pub fn name_of(shelf: &dyn Shelf, path: &Path) -> String {
    let whole = std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf());
    let own = || whole.extension().is_some_and(|ending| ENDINGS.iter().any(|own| ending == *own));
    let name = if shelf.is_folder(path) && !own() { whole.file_name() } else { whole.file_stem() };
    name.map_or_else(|| "document".into(), |name| name.to_string_lossy().into_owned())
}

/// Checks that a size on paper is plausible: from one dot to 10 metres.
pub(super) fn check_size_mm(size: [f64; 2]) -> Result<(), String> {
    match size.iter().find(|mm| !(0.04..=10_000.0).contains(*mm)) {
        Some(mm) => {
            Err(format!("size_mm: {mm} is not a length on paper; expected 0.04 to 10000 millimetres"))
        }
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_keep_their_dots_and_files_lose_their_endings() {
        let folder = tempfile::tempdir().unwrap();
        for (name, expected) in
            [("leaf.v2", "leaf.v2"), ("leaf.v2.foil", "leaf.v2"), ("leaf", "leaf"), ("rust.print", "rust")]
        {
            let path = folder.path().join(name);
            std::fs::create_dir(&path).unwrap();
            assert_eq!(name_of(&Disk, &path), expected);
        }
        assert_eq!(name_of(&Disk, Path::new("of/leaf.v2.binary")), "leaf.v2");
    }
}
