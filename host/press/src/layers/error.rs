//! Errors of reading and composing art.
//!
//! Each error states the file, what was found, and what to do in terms of settings. A program adds how its own user changes
//! a setting, from the values in the variants.

use std::fmt;
use std::path::{Path, PathBuf};

use protocol::ink::Ink;

use crate::halftone::HalftoneError;
use crate::sheet::SheetError;
use appearance::gamut::GamutError;

/// An error of reading or composing art.
#[derive(Debug, thiserror::Error)]
pub enum LayersError {
    /// The operating system reported an error.
    #[error("{}: cannot {attempt}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What was attempted.
        attempt: &'static str,
        /// The system's error.
        source: std::io::Error,
    },
    /// A file is damaged, of an unknown format, or unsuitable.
    #[error("{}: {problem}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong, what was expected, and what to do.
        problem: String,
    },
    /// The name of a file, channel or layer is that of no ink.
    #[error(
        "{}: {part} `{name}` names no ink{}; {}; the inks are {}",
        path.display(), hint(suggestion), part.remedy(), Ink::ALL.map(Ink::name).join(", ")
    )]
    UnknownInk {
        /// The file.
        path: PathBuf,
        /// What has the name.
        part: NamedPart,
        /// The name.
        name: String,
        /// The nearest known name.
        suggestion: Option<&'static str>,
    },
    /// Neither the file nor the settings state a size, and at 600 dpi the art is larger than the page.
    #[error(
        "{} states no resolution; its {} x {} pixels at 600 dpi would be {:.1} x {:.1} mm, but the page has room for {:.1} x \
         {:.1} mm; set its resolution or its size",
        path.display(), pixels.0, pixels.1, size_mm.0, size_mm.1, room_mm.0, room_mm.1
    )]
    NoSize {
        /// The file.
        path: PathBuf,
        /// Pixels across and down.
        pixels: (u32, u32),
        /// Its width and height at 600 dpi, in mm.
        size_mm: (f64, f64),
        /// Width and height of the room on the page, in mm.
        room_mm: (f64, f64),
        /// The largest width that fits, in mm.
        fits_mm: f64,
    },
    /// At the size that its file states, the art is larger than the page.
    #[error(
        "{} {}{:.1} x {:.1} mm, but the page has room for {:.1} x {:.1} mm; print it smaller, {}use larger paper, or crop it",
        path.display(), says.map_or("is ".into(), |says| format!("states {}, so it is ", resolution_in_words(says))),
        size_mm.0, size_mm.1, room_mm.0, room_mm.1,
        if says.is_some() { "correct its resolution, " } else { "" }
    )]
    Beyond {
        /// The file.
        path: PathBuf,
        /// Pixels per inch across and down, as the file of a picture states; a drawing states its size.
        says: Option<(f64, f64)>,
        /// Its width and height, in mm.
        size_mm: (f64, f64),
        /// Width and height of the room on the page, in mm.
        room_mm: (f64, f64),
        /// The largest width that fits, in mm.
        fits_mm: f64,
    },
    /// Several pages hold art, and none was chosen.
    #[error(
        "{} has art on {} pages ({}); choose one of them, or name an ink for each page",
        path.display(), pages.len(), listed(pages)
    )]
    Pages {
        /// The file.
        path: PathBuf,
        /// The pages that hold art, from 1.
        pages: Vec<u32>,
    },
    /// Two layers differ in size.
    #[error(
        "{} is {found}, but {} is {expected}; layers are printed one on another pixel by pixel, so export all of them at the \
         same size",
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
    /// The art is larger than anything of which a page can be cut.
    #[error(
        "the art is {width_mm:.1} x {height_mm:.1} mm; even cropped it can be at most {most_width_mm:.1} x \
         {most_height_mm:.1} mm; print it smaller"
    )]
    TooLarge {
        /// Its width in mm.
        width_mm: f64,
        /// Its height in mm.
        height_mm: f64,
        /// The largest width in mm.
        most_width_mm: f64,
        /// The largest height in mm.
        most_height_mm: f64,
        /// The largest width that fits, in mm.
        fits_mm: f64,
    },
    /// The art is smaller than a dot.
    #[error(
        "the art is {width_mm:.4} x {height_mm:.4} mm, less than a dot (0.0423 mm); set a larger size or a lower resolution"
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
    /// Everything drawn is white, and the settings ask for no white.
    #[error("there is nothing to print: {name} is drawn in nothing but white, which is bare paper")]
    White {
        /// Name of the art.
        name: String,
    },
    /// A setting does not suit the art.
    #[error("{setting}: {problem}")]
    Setting {
        /// The setting.
        setting: Setting,
        /// What is wrong, and what to do.
        problem: String,
    },
    /// A foil that is not among the allowed inks.
    #[error(
        "{layer} asks for {}; the codes of the foils are inferred and were never tested on hardware, so foils print only if \
         they are among the allowed inks", ink.name()
    )]
    Foil {
        /// The layer that asks for it.
        layer: String,
        /// The foil.
        ink: Ink,
    },
    /// More passes than a sheet can take.
    #[error(
        "the art needs {passes} passes ({inks}), but a sheet can take {}; print some inks fewer times",
        crate::separate::MOST_PASSES
    )]
    Passes {
        /// How many.
        passes: usize,
        /// Their inks from the paper up.
        inks: String,
    },
    /// A required program is not installed.
    #[error("{}: reading it needs {program}, which is not installed; {install}", path.display())]
    Program {
        /// The file to read.
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
    /// The stacks are invalid.
    #[error(transparent)]
    Sheet(#[from] SheetError),
}

fn hint(suggestion: &Option<&'static str>) -> String {
    suggestion.map_or(String::new(), |s| format!(" (did you mean `{s}`?)"))
}

/// What of art is named after an ink.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NamedPart {
    /// A file of one layer.
    File,
    /// A channel of a TIFF.
    Channel,
    /// A layer of a drawing.
    Layer,
    /// A spot colour of a page.
    Spot,
}

impl NamedPart {
    /// What its owner can do about a name.
    fn remedy(self) -> &'static str {
        match self {
            NamedPart::File => "name each file after its ink, such as white.png, gold.png, silver-foil.png",
            NamedPart::Channel => "rename the channel: after its ink, or so that it resembles no ink",
            NamedPart::Layer => {
                "rename the layer in the drawing: after its ink, or so that it resembles no ink"
            }
            NamedPart::Spot => {
                "rename the spot colour in the program that drew the page: after its ink, or so that it resembles no ink"
            }
        }
    }
}

impl fmt::Display for NamedPart {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            NamedPart::File => "file",
            NamedPart::Channel => "channel",
            NamedPart::Layer => "layer",
            NamedPart::Spot => "spot colour",
        })
    }
}

/// Numbers in words, the first few of many.
fn listed(numbers: &[u32]) -> String {
    const NAMED: usize = 8;
    let named: Vec<String> = numbers.iter().take(NAMED).map(u32::to_string).collect();
    named.join(", ") + if numbers.len() > NAMED { ", …" } else { "" }
}

/// Pixels per inch, in words.
pub(super) fn resolution_in_words((x, y): (f64, f64)) -> String {
    if (x - y).abs() < 0.5 { format!("{x:.0} dpi") } else { format!("{x:.0} x {y:.0} dpi") }
}

/// A setting of how layers become stacks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Setting {
    /// The inks that may be used.
    Inks,
    /// The order of the layers.
    Order,
    /// Where white goes.
    White,
    /// How far white is shrunk.
    Choke,
    /// How far white is spread.
    Spread,
    /// Where finish goes.
    Finish,
}

impl fmt::Display for Setting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Setting::Inks => "allowed inks",
            Setting::Order => "order of the layers",
            Setting::White => "white",
            Setting::Choke => "choke",
            Setting::Spread => "spread",
            Setting::Finish => "finish",
        })
    }
}

/// An error about a file.
pub(super) fn wrong(path: &Path, problem: impl Into<String>) -> LayersError {
    LayersError::File { path: path.to_path_buf(), problem: problem.into() }
}

/// Makes errors of the operating system errors about a file.
pub(super) fn io<'a>(path: &'a Path, attempt: &'static str) -> impl Fn(std::io::Error) -> LayersError + 'a {
    move |source| LayersError::Io { path: path.to_path_buf(), attempt, source }
}
