//! Errors of reading and composing art.
//!
//! Each error states the file, what was found, and what to do in terms of settings ([`observe::Diagnosis`]).

use std::fmt;
use std::path::Path;

use appearance::gamut::GamutError;
use halftone::HalftoneError;
use observe::{Diagnosis, Fault};
use protocol::ink::Ink;
use sheet::{MOST_PASSES, SheetError};

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

/// An error about a file.
pub(super) fn wrong(path: &Path, problem: impl Into<String>) -> Diagnosis {
    Diagnosis::of_file(path, problem)
}

/// Makes errors of the operating system errors about a file.
pub(super) fn io<'a>(path: &'a Path, attempt: &'static str) -> impl Fn(std::io::Error) -> Diagnosis + 'a {
    move |source| wrong(path, format!("cannot {attempt}")).because(source)
}

/// The name of a file, channel or layer is that of no ink; `suggestion` is the nearest known name.
pub(super) fn unknown_ink(path: &Path, part: NamedPart, name: &str, suggestion: Option<&str>) -> Diagnosis {
    let meant = suggestion.map_or(String::new(), |s| format!(" (did you mean `{s}`?)"));
    Diagnosis::new(Fault::Name, format!("{part} `{name}` names no ink{meant}"))
        .about(path)
        .hint(part.remedy())
        .hint(format!("the inks are {}", Ink::ALL.map(Ink::name).join(", ")))
}

/// Neither the file nor the settings state a size, and in the measure that is assumed the art is larger than the page. `fits_mm` is
/// the largest width that fits.
pub(super) fn no_size(
    (path, lacks, dpi): (&Path, &str, &str),
    (pixels, measure): ((f64, f64), &str),
    size_mm: (f64, f64),
    room_mm: (f64, f64),
    fits_mm: f64,
) -> Diagnosis {
    let problem = format!(
        "{} states no {lacks}; its {:.0} x {:.0} {measure} would be {:.1} x {:.1} mm, but the page has room for {:.1} x {:.1} mm",
        path.display(),
        pixels.0,
        pixels.1,
        size_mm.0,
        size_mm.1,
        room_mm.0,
        room_mm.1
    );
    let diagnosis = Diagnosis::new(Fault::Setting, problem);
    match largest(fits_mm) {
        None => nothing_fits(diagnosis),
        Some(size) => diagnosis.hint("set its resolution or its size").set("dpi", dpi).set("size", size),
    }
}

/// At the size that its file states, the art is larger than the page. `says` is the resolution that the file of a picture states;
/// a drawing states its size.
pub(super) fn beyond(
    path: &Path,
    says: Option<(f64, f64)>,
    size_mm: (f64, f64),
    room_mm: (f64, f64),
    fits_mm: f64,
) -> Diagnosis {
    let stated = says.map_or("is ".into(), |says| format!("states {}, so it is ", resolution_in_words(says)));
    let problem = format!(
        "{} {stated}{:.1} x {:.1} mm, but the page has room for {:.1} x {:.1} mm",
        path.display(),
        size_mm.0,
        size_mm.1,
        room_mm.0,
        room_mm.1
    );
    let diagnosis = Diagnosis::new(Fault::Setting, problem);
    let correct = if says.is_some() { "correct its resolution, " } else { "" };
    match largest(fits_mm) {
        None => nothing_fits(diagnosis),
        Some(size) => {
            let diagnosis = diagnosis
                .hint(format!("print it smaller, {correct}use larger paper, or crop it"))
                .set("size", size);
            let diagnosis = if says.is_some() { diagnosis.set("dpi", "") } else { diagnosis };
            diagnosis.set("paper", "").set("crop", "")
        }
    }
}

/// The largest width that fits, in words, if any does.
fn largest(fits_mm: f64) -> Option<String> {
    let below = (10.0 * fits_mm).floor() / 10.0;
    (below > 0.0).then(|| format!("{below}mm"))
}

/// What to do where the room is full.
fn nothing_fits(diagnosis: Diagnosis) -> Diagnosis {
    diagnosis
        .hint("nothing fits there: print fewer copies with a smaller gap, or use larger paper")
        .set("repeat", "")
        .set("gap", "")
        .set("paper", "")
}

/// Several pages, counted from 1, hold art, and none was chosen.
pub(super) fn several_pages(path: &Path, pages: &[u32]) -> Diagnosis {
    /// Names that a message has room for: some two lines.
    const NAMED: usize = 8;
    let named: Vec<String> = pages.iter().take(NAMED).map(u32::to_string).collect();
    let more = if pages.len() > NAMED { ", …" } else { "" };
    let problem = format!("{} has art on {} pages ({}{more})", path.display(), pages.len(), named.join(", "));
    Diagnosis::new(Fault::Setting, problem)
        .hint("choose one of them, or name an ink for each page")
        .set("page", pages.first().unwrap_or(&1).to_string())
        .set("pages", "white,gold,black")
}

/// The art is larger than anything of which a page can be cut; sizes in mm.
pub(super) fn too_large(size: (f64, f64), most: (f64, f64), fits_mm: f64) -> Diagnosis {
    let problem = format!(
        "the art is {:.1} x {:.1} mm; even cropped it can be at most {:.1} x {:.1} mm",
        size.0, size.1, most.0, most.1
    );
    Diagnosis::new(Fault::Setting, problem)
        .hint("print it smaller")
        .set("size", largest(fits_mm).unwrap_or_default())
}

/// The art is smaller than a dot; its size in mm.
pub(super) fn too_small(width: f64, height: f64) -> Diagnosis {
    Diagnosis::new(
        Fault::Setting,
        format!("the art is {width:.4} x {height:.4} mm, less than a dot (0.0423 mm)"),
    )
    .hint("set a larger size or a lower resolution")
    .set("size", "")
    .set("dpi", "")
}

/// No layer has a dot.
pub(super) fn nothing(reason: impl fmt::Display) -> Diagnosis {
    Diagnosis::new(Fault::Nothing, format!("there is nothing to print: {reason}"))
}

/// All that a page has is for a cutter.
pub(super) fn all_for_a_cutter(path: &Path) -> Diagnosis {
    nothing(format!("all that {} has is for a cutter, which is never printed", path.display())).hint(
        "--cut-lines FILE.svg writes it beside a print; to print it, give its spot colour the name of an ink",
    )
}

/// Everything drawn is white, and the settings ask for no white.
pub(super) fn only_white(name: &str) -> Diagnosis {
    nothing(format!("{name} is drawn in nothing but white, which is bare paper"))
        .hint("print white wherever the art is not transparent")
        .set("white", "alpha")
}

/// A layer asks for a foil that is not among the allowed inks.
pub(super) fn foil(layer: &str, ink: Ink) -> Diagnosis {
    let problem = format!(
        "{layer} asks for {}; the codes of the foils are inferred and were never tested on hardware, so foils print only if they \
         are among the allowed inks",
        ink.name()
    );
    Diagnosis::new(Fault::Setting, problem).hint("allow it").set("inks", format!("+{}", ink.name()))
}

/// More passes than a sheet can take; the inks from the paper up.
pub(super) fn too_many_passes(passes: usize, inks: &str) -> Diagnosis {
    let problem = format!("the art needs {passes} passes ({inks}), but a sheet can take {MOST_PASSES}");
    Diagnosis::new(Fault::Setting, problem).hint("print some inks fewer times").set("passes", "")
}

/// A required program is not installed; `install` is how to install it.
pub(super) fn no_program(path: &Path, program: &str, install: &str) -> Diagnosis {
    let problem = format!("reading it needs {program}, which is not installed");
    Diagnosis::new(Fault::Missing, problem).about(path).hint(install)
}

/// The colours cannot be fitted to the process inks.
pub(super) fn unfitted(source: impl Into<GamutError>) -> Diagnosis {
    Diagnosis::new(Fault::Setting, "cannot fit the colours to the process inks").because(source.into())
}

/// The colours cannot be halftoned.
pub(super) fn not_halftoned(source: HalftoneError) -> Diagnosis {
    Diagnosis::new(Fault::Setting, "cannot halftone the colours").because(source)
}

/// The stacks of the art are invalid.
pub(super) fn no_sheet(source: SheetError) -> Diagnosis {
    Diagnosis::new(Fault::Setting, "cannot lay the inks on each other").because(source)
}

/// Pixels per inch, in words.
pub(super) fn resolution_in_words((x, y): (f64, f64)) -> String {
    if (x - y).abs() < 0.5 { format!("{x:.0} dpi") } else { format!("{x:.0} x {y:.0} dpi") }
}
/// An ink of which the library does not say how small its clusters may be.
pub(super) fn no_cluster(ink: Ink) -> Diagnosis {
    let problem = format!("the ink library does not say how small clusters of {} may be", ink.name());
    Diagnosis::new(Fault::Setting, problem)
        .hint(
            "add the ink with its `minimum_cluster` to the library, leave it out, or choose another halftone",
        )
        .set("halftone", "cells")
}

/// An error about a page that has art, of which the ink that is named for it gets nothing.
pub(super) fn no_dot(path: &Path, page: &str, ink: Ink) -> Diagnosis {
    let problem = format!(
        "{page} has art, but {} gets no dot of it: nothing on it is dark enough to be ink",
        ink.name()
    );
    wrong(path, problem).hint("draw it in black, or in one colour on nothing")
}
