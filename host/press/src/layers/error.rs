//! Why art could not be read or composed, with the file, what was found, and what to do.

use std::path::PathBuf;

use protocol::ink::Ink;

use crate::halftone::HalftoneError;
use crate::sheet::SheetError;
use appearance::gamut::GamutError;

/// Why art could not be read or composed.
#[derive(Debug, thiserror::Error)]
pub enum LayersError {
    /// The system refused.
    #[error("{}: cannot {attempt}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What was tried.
        attempt: &'static str,
        /// What the system said.
        source: std::io::Error,
    },
    /// A file is damaged, of no known kind, or of a kind that cannot be meant.
    #[error("{}: {problem}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong, what was expected, and what to do.
        problem: String,
    },
    /// A file among several names no ink.
    #[error(
        "{}: `{name}` names no ink{}; name each file after its ink, such as white.png, gold.png, silver-foil.png; \
         the inks are {}",
        path.display(), hint(suggestion), Ink::ALL.map(Ink::name).join(", ")
    )]
    UnknownInk {
        /// The file.
        path: PathBuf,
        /// The name in it: the file's stem, a channel's or a layer's name.
        name: String,
        /// What may have been meant.
        suggestion: Option<&'static str>,
    },
    /// No file says how large it is, nor does the user, and drawn for the printer it would be larger than the page.
    #[error(
        "{} says no resolution; its {} x {} pixels at 600 dpi would be {:.1} x {:.1} mm, and the page has room for {:.1} x \
         {:.1} mm; give its true resolution, such as --dpi 1200, or --size {}mm for the largest that fits",
        path.display(), pixels.0, pixels.1, size_mm.0, size_mm.1, room_mm.0, room_mm.1, below(*fits_mm)
    )]
    NoSize {
        /// The file.
        path: PathBuf,
        /// Pixels across and down.
        pixels: (u32, u32),
        /// Its width and height at 600 dpi, in mm.
        size_mm: (f64, f64),
        /// Width and height that the page has room for, in mm.
        room_mm: (f64, f64),
        /// The width at which it fits, in mm.
        fits_mm: f64,
    },
    /// As large as a file says it is, it is larger than the page.
    #[error(
        "{} says {}, so it is {:.1} x {:.1} mm, and the page has room for {:.1} x {:.1} mm; give --size {}mm for the largest \
         that fits, --dpi if the file is wrong, a larger --paper, or --crop to cut",
        path.display(), resolution(*says), size_mm.0, size_mm.1, room_mm.0, room_mm.1, below(*fits_mm)
    )]
    Beyond {
        /// The file.
        path: PathBuf,
        /// Pixels in an inch across and down, as it says.
        says: (f64, f64),
        /// Its width and height, in mm.
        size_mm: (f64, f64),
        /// Width and height that the page has room for, in mm.
        room_mm: (f64, f64),
        /// The width at which it fits, in mm.
        fits_mm: f64,
    },
    /// Two layers are not of one size.
    #[error(
        "{} is {found} and {} is {expected}; layers lie on each other pixel by pixel, so export them all at one size",
        path.display(), first.display()
    )]
    Sizes {
        /// The file that differs.
        path: PathBuf,
        /// Its size.
        found: String,
        /// The first file.
        first: PathBuf,
        /// Its size.
        expected: String,
    },
    /// More dots than any sheet has.
    #[error(
        "the art is {width_mm:.1} x {height_mm:.1} mm; the largest page prints {most_width_mm:.1} x {most_height_mm:.1} mm; \
         give --size {}mm for the largest that fits", below(*fits_mm)
    )]
    TooLarge {
        /// Its width in mm.
        width_mm: f64,
        /// Its height in mm.
        height_mm: f64,
        /// The most in mm.
        most_width_mm: f64,
        /// The most in mm.
        most_height_mm: f64,
        /// The width at which it fits the page, in mm.
        fits_mm: f64,
    },
    /// Less than a dot.
    #[error(
        "{width_mm:.4} x {height_mm:.4} mm is less than a dot (0.0423 mm); give a larger --size or a smaller --dpi"
    )]
    TooSmall {
        /// Its width in mm.
        width_mm: f64,
        /// Its height in mm.
        height_mm: f64,
    },
    /// No layer has a dot.
    #[error("there is nothing to print: {reason}")]
    Nothing {
        /// Why.
        reason: String,
    },
    /// A setting does not fit the art.
    #[error("{option}: {problem}")]
    Setting {
        /// The option as typed.
        option: &'static str,
        /// What is wrong, and what to do.
        problem: String,
    },
    /// More layers than a dot can hold, or more passes than a sheet survives.
    #[error(
        "{passes} layers ({inks}) are more than the {} a sheet can take; print fewer --passes",
        crate::separate::MOST_PASSES
    )]
    Passes {
        /// How many.
        passes: usize,
        /// Their inks from the paper up.
        inks: String,
    },
    /// A program that is needed is not there.
    #[error("{}: {program} is needed to read it and is not installed; {install}", path.display())]
    Program {
        /// The file to be read.
        path: PathBuf,
        /// The program.
        program: &'static str,
        /// How to install it.
        install: &'static str,
    },
    /// Fitting colours to the process inks.
    #[error("cannot fit the colours to the process inks")]
    Gamut(#[from] GamutError),
    /// Halftoning.
    #[error(transparent)]
    Halftone(#[from] HalftoneError),
    /// The stacks do not make a dot map.
    #[error(transparent)]
    Sheet(#[from] SheetError),
}

fn hint(suggestion: &Option<&'static str>) -> String {
    suggestion.map_or(String::new(), |s| format!(", did you mean `{s}`?"))
}

/// A length in mm with one decimal, never longer than it is.
fn below(mm: f64) -> f64 {
    (10.0 * mm).floor() / 10.0
}

/// Pixels in an inch, in words.
pub(super) fn resolution((x, y): (f64, f64)) -> String {
    if (x - y).abs() < 0.5 { format!("{x:.0} dpi") } else { format!("{x:.0} x {y:.0} dpi") }
}
