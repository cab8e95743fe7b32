//! Ghostscript at work on a document: drafts of its pages, and a page as a picture.
//!
//! Method: a draft at a low resolution tells the size of each page, whether anything is drawn on it, and its plates. Nothing
//! is anti-aliased. Cost: some 0.1 s a page for drafts, seconds for a page. Limits: the time limit of [`process`] for each
//! page; Ghostscript can read only the file (its safer mode).

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use super::complaint;
use super::eps::{self, Bounds};
use super::ghostscript::{self, Interpreter};
use crate::error::{io, no_program, wrong};
use crate::read::coverage::Scan;
use crate::read::file;
use crate::read::names::stem;
use crate::read::process::{self, MOST_PAGES, Process, ProcessError};
use files::scratch::Scratch;
use files::shelf::Disk;
use observe::Diagnosis;

/// Resolution of drafts.
pub(super) const DRAFT: f64 = 36.0;

/// What a size is rounded by that only the draft tells: a pixel of it, which cannot be told closer.
const ROUNDED_MM: f64 = 25.4 / DRAFT;

/// Has Ghostscript say the size of each page in points at its end: a draft rounds it to its own pixels.
const SAYS_SIZES: &str = "<< /EndPage { exch pop 2 ne dup { (%%PageSize:) print currentpagedevice /PageSize get \
    { ( ) print 20 string cvs print } forall (\\n) print flush } if } >> setpagedevice";

/// What to do without Ghostscript.
const NO_GHOSTSCRIPT: &str = "install it (Debian, Ubuntu: apt install ghostscript; macOS: brew install ghostscript; Windows: the 64-bit \
    installer from ghostscript.com, in its usual folder), or export the page as PNG";

/// The most spot colours of a document that have plates of their own; it is ten without this, and never more.
const SPOTS: &str = "-dMaxSpots=60";

/// The plates that every page has.
pub(super) const PROCESS: [&str; 4] = ["Cyan", "Magenta", "Yellow", "Black"];

/// A page of a document, as its draft shows it.
pub(super) struct Leaf {
    /// Its number, from 1.
    pub number: u32,
    /// Width and height in pixels of [`DRAFT`] an inch, with their fractions if they are known.
    pub size: (f64, f64),
    /// What the size may be rounded by, in millimetres.
    pub rounded_mm: f64,
    /// Whether anything but white is drawn on it.
    pub drawn: bool,
    /// Its plates beside those of [`PROCESS`] that are not blank.
    pub spots: Vec<String>,
}

/// What the drafts of a document tell.
pub(super) struct Drafts {
    /// Its pages; none if it cannot be read.
    pub leaves: Vec<Leaf>,
    /// What the program said.
    pub said: String,
}

/// The part of a page to draw.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Part {
    /// The part that is meant to be seen: of a page in PDF its crop box, of an EPS file its bounding box.
    CropBox,
    /// The whole sheet.
    Sheet,
}

/// Draws a page on a transparent ground, as PNG.
///
/// # Errors
/// As [`drafts`].
pub(super) fn picture(
    (path, interpreter): (&Path, Interpreter),
    page: u32,
    dpi: (f64, f64),
    folder: &Scratch,
) -> Result<PathBuf, Diagnosis> {
    let picture = folder.path().join("page.png");
    let options = [pages((page, page)), cropped(path, Part::CropBox)?].concat();
    ghostscript((path, interpreter), &options, "pngalpha", dpi, &picture, || false)?;
    Ok(picture)
}

/// Drafts of all pages, or of one, and the interpreter that draws most of the document.
///
/// # Errors
/// A document that cannot be read or that takes too long, or no Ghostscript.
pub(super) fn drafts(
    path: &Path,
    only: Option<u32>,
    part: Part,
    folder: &Scratch,
) -> Result<(Drafts, Interpreter), Diagnosis> {
    let usual = leaves((path, Interpreter::Usual), only, part, folder)?;
    if complaint::lacks_pattern(&usual.said) {
        let again = Scratch::new().map_err(io(path, "make a folder for its pages"))?;
        // If it fails, there is a drawing already.
        if let Ok(older) = leaves((path, Interpreter::Older), only, part, &again)
            && older.leaves.len() == usual.leaves.len()
            && complaint::is_better(&older.said, &usual.said)
        {
            return Ok((older, Interpreter::Older));
        }
    }
    Ok((usual, Interpreter::Usual))
}

/// The options for these pages, from the first to the last.
pub(super) fn pages((first, last): (u32, u32)) -> Vec<String> {
    vec![format!("-dFirstPage={first}"), format!("-dLastPage={last}")]
}

/// The options for a part of a page; what they run stands at their end.
pub(super) fn crop(path: &Path, part: Part) -> std::io::Result<Vec<String>> {
    if part == Part::Sheet {
        return Ok(Vec::new());
    }
    let cropped = match eps::bounds(path)? {
        None => Vec::new(),
        Some(Bounds::InHeader) => vec!["-dEPSCrop".into()],
        // Ghostscript looks for it in the header alone.
        Some(Bounds::AtEnd([left, bottom, right, top])) => vec![
            "-dFIXEDMEDIA".into(),
            format!("-dDEVICEWIDTHPOINTS={}", right - left),
            format!("-dDEVICEHEIGHTPOINTS={}", top - bottom),
            "-c".into(),
            format!("<< /Install {{ {} {} translate }} >> setpagedevice", -left, -bottom),
        ],
    };
    Ok([vec!["-dUseCropBox".into()], cropped].concat())
}

fn cropped(path: &Path, part: Part) -> Result<Vec<String>, Diagnosis> {
    crop(path, part).map_err(io(path, "read it"))
}

fn leaves(
    (path, interpreter): (&Path, Interpreter),
    only: Option<u32>,
    part: Part,
    folder: &Scratch,
) -> Result<Drafts, Diagnosis> {
    let place = |number: u32| match only {
        Some(_) => folder.path().join("draft.tif"),
        None => folder.path().join(format!("draft{number}.tif")),
    };
    let to = if only.is_some() { place(1) } else { folder.path().join("draft%d.tif") };
    let options = [
        vec!["-sCompression=lzw".into(), SPOTS.into()],
        only.map_or_else(Vec::new, |page| pages((page, page))),
        cropped(path, part)?,
    ]
    .concat();
    let options = [options, vec!["-c".into(), SAYS_SIZES.into()]].concat();
    let mut begun = 0;
    let progressed = || {
        let next = begun < MOST_PAGES && place(begun + 1).exists();
        begun += u32::from(next);
        next && only.is_none()
    };
    let said = ghostscript((path, interpreter), &options, "tiffsep", (DRAFT, DRAFT), &to, progressed);
    if only.is_none() && place(MOST_PAGES + 1).exists() {
        return Err(wrong(path, format!("it has more than {MOST_PAGES} pages"))
            .hint("print one of them")
            .set("page", "1"));
    }
    let said = said?;
    let mut plates = plates(path, folder)?;
    let sizes = sizes(&said);
    let mut leaves = Vec::new();
    for number in only.map_or(1..=u32::MAX, |number| number..=number) {
        let draft = place(number);
        let Some((width, height)) = file::size(&draft) else { break };
        let (mut drawn, mut spots) = (false, Vec::new());
        for (name, plate) in plates.remove(&stem(&draft)).unwrap_or_default() {
            // A page paints every pixel it touches, so a draft misses nothing.
            if Scan::of_picture(file::picture(&Disk, &plate, None)?).coverage.iter().any(|&c| c > 0) {
                drawn = true;
                if !PROCESS.contains(&name.as_str()) {
                    spots.push(name);
                }
            }
        }
        // Of a document in PDF only the pages that are drawn have an end.
        let stated = if sizes.len() == 1 { sizes.first() } else { sizes.get(number as usize - 1) };
        let draft = (width.into(), height.into());
        let (size, rounded_mm) = exact(draft, stated).map_or((draft, ROUNDED_MM), |size| (size, 0.0));
        leaves.push(Leaf { number, size, rounded_mm, drawn, spots });
    }
    Ok(Drafts { leaves, said })
}

/// The sizes of pages that Ghostscript says ([`SAYS_SIZES`]), in points.
fn sizes(said: &str) -> Vec<(f64, f64)> {
    let size = |line: &str| {
        let mut sides = line.split_whitespace().map(str::parse);
        Some((sides.next()?.ok()?, sides.next()?.ok()?))
    };
    said.lines().filter_map(|line| size(line.strip_prefix("%%PageSize:")?)).collect()
}

/// What the size of a draft was rounded from, if that is what is stated: what a document says of itself may be wrong.
fn exact(draft: (f64, f64), stated: Option<&(f64, f64)>) -> Option<(f64, f64)> {
    let points = 72.0 / DRAFT;
    let near = |&(x, y): &(f64, f64)| (x - draft.0).abs() <= 1.0 && (y - draft.1).abs() <= 1.0;
    // A page may lie on its side.
    let ways = stated.into_iter().flat_map(|&(x, y)| [(x / points, y / points), (y / points, x / points)]);
    ways.into_iter().find(near)
}

/// The names and files of the plates beside a separated page, such as `page(Gold Foil).tif` or `page(Wei%DF).tif`.
pub(super) fn plates_beside(page: &Path, folder: &Scratch) -> Result<Vec<(String, PathBuf)>, Diagnosis> {
    Ok(plates(page, folder)?.remove(&stem(page)).unwrap_or_default())
}

/// The plates of all separated pages, by the name of the page.
fn plates(path: &Path, folder: &Scratch) -> Result<HashMap<String, Vec<(String, PathBuf)>>, Diagnosis> {
    let mut plates: HashMap<String, Vec<(String, PathBuf)>> = HashMap::new();
    for entry in std::fs::read_dir(folder.path()).map_err(io(path, "list its plates"))? {
        let file = entry.map_err(io(path, "list its plates"))?.path();
        let name = stem(&file);
        if let Some((page, plate)) = name.strip_suffix(')').and_then(|name| name.split_once('(')) {
            plates.entry(page.to_owned()).or_default().push((decoded(plate), file));
        }
    }
    plates.values_mut().for_each(|plates| plates.sort());
    Ok(plates)
}

/// The name of a plate from that of its file, where Ghostscript writes `%XX` for every byte that may not be in a file name.
fn decoded(plate: &str) -> String {
    process::unescaped(plate.as_bytes(), b'%')
}

/// Separates a page into a TIFF for each plate beside `to`. Returns what Ghostscript says of them. If `overprints`, nothing that is drawn
/// takes ink off another plate, unless the document says so itself.
pub(super) fn separate(
    (path, interpreter): (&Path, Interpreter),
    page: u32,
    part: Part,
    dpi: (f64, f64),
    to: &Path,
    overprints: bool,
) -> Result<String, Diagnosis> {
    let mut options =
        [pages((page, page)), cropped(path, part)?, vec!["-dPrintSpotCMYK".into(), SPOTS.into()]].concat();
    if overprints {
        options.extend(["-c".into(), "true setoverprint".into()]);
    }
    ghostscript((path, interpreter), &options, "tiffsep", dpi, to, || false)
}

/// Runs Ghostscript on a document; `progressed` tells whether it has begun another page.
fn ghostscript(
    (path, interpreter): (&Path, Interpreter),
    options: &[String],
    device: &str,
    dpi: (f64, f64),
    to: &Path,
    progressed: impl FnMut() -> bool,
) -> Result<String, Diagnosis> {
    let drawing = [
        "-dTextAlphaBits=1".into(),
        "-dGraphicsAlphaBits=1".into(),
        format!("-r{:.4}x{:.4}", dpi.0, dpi.1),
        format!("-sDEVICE={device}"),
        // It runs in the folder: what the folder's path has of `%` would be a number of pages.
        format!("-sOutputFile={}", to.file_name().unwrap_or_default().display()),
    ];
    let folder = to.parent().unwrap_or(Path::new("."));
    let command = ghostscript::command(path, interpreter, folder, drawing.iter().chain(options));
    run(path, command, progressed)
}

/// Runs a program to its end and returns what it said.
fn run(path: &Path, mut command: Command, progressed: impl FnMut() -> bool) -> Result<String, Diagnosis> {
    let begun = Process::start(command.stdout(Stdio::null()), process::limit());
    begun.and_then(|process| process.end(progressed)).map_err(|error| failed(path, error))
}

/// What Ghostscript says of a file that it does not find.
const NOT_FOUND: &str = "/undefinedfilename";

/// Why a document cannot be drawn.
pub(super) fn failed(path: &Path, error: ProcessError) -> Diagnosis {
    match error {
        ProcessError::Start(error) if error.kind() == std::io::ErrorKind::NotFound => {
            no_program(path, "Ghostscript", NO_GHOSTSCRIPT)
        }
        ProcessError::Start(source) => io(path, "start a program to read it")(source),
        ProcessError::Io(source) => io(path, "wait for the program that reads it")(source),
        ProcessError::Failed(why) => {
            if let Some(size) = complaint::impossible_size(&why) {
                return wrong(path, size);
            }
            let diagnosis = wrong(path, format!("cannot be read: {why}"));
            if path.to_str().is_none() && why.contains(NOT_FOUND) {
                diagnosis.hint(
                    "the name of the file is not UTF-8, so Ghostscript does not find it; rename the file",
                )
            } else {
                diagnosis
            }
        }
        error @ (ProcessError::TooLong(_) | ProcessError::TooLongAltogether(_)) => {
            wrong(path, error.to_string())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plate_has_the_name_that_ghostscript_says() {
        for (file, name) in [
            ("Gold Foil", "Gold Foil"),
            ("Red%2FOrange", "Red/Orange"),
            ("PANTONE 100%25", "PANTONE 100%"),
            ("Wei%C3%9F", "Wei\u{df}"),
            // No UTF-8, so Latin-1, as old programs write it.
            ("Wei%DF", "Wei\u{df}"),
            ("100%", "100%"),
            ("%4", "%4"),
            ("%+1%g1", "%+1%g1"),
        ] {
            assert_eq!(decoded(file), name);
        }
        assert_eq!(process::text(b"caf\xe9\ncaf\xc3\xa9\n"), "caf\u{e9}\ncaf\u{e9}\n");
    }

    #[test]
    fn a_page_has_the_size_that_is_said_of_it_unless_its_draft_is_another() {
        let said = "noise\n%%PageSize: 595.276 841.89\n%%PageSize: x 1\n%%PageSize: 612 792\n%%PageSize: 7";
        assert_eq!(sizes(said), [(595.276, 841.89), (612.0, 792.0)]);
        let a4 = (595.276, 841.89);
        assert_eq!(exact((298.0, 421.0), Some(&a4)), Some((297.638, 420.945)));
        assert_eq!(exact((421.0, 298.0), Some(&a4)), Some((420.945, 297.638)));
        assert_eq!(exact((306.0, 396.0), Some(&a4)), None);
        assert_eq!(exact((298.0, 421.0), None), None);
        assert_eq!(exact((298.0, 421.0), Some(&(f64::NAN, 1.0))), None);
    }
}
