//! Reads art from files: chooses the reader by what a file holds, and joins several files into one artwork.
//!
//! Method: the first bytes tell PDF, PostScript, TIFF, SVG and JPEG apart. A picture whose name is that of an ink is a
//! layer; any other picture is colour for the process inks. Cost: that of the readers; files are read in pairs, so both
//! cores work and at most two layers are in memory as bytes. Limits: layers must have the same size in pixels.

use std::io::Read;
use std::path::{Path, PathBuf};

use observe::Observer;
use rayon::prelude::*;

use super::artwork::Artwork;
use super::coverage::{self, Scan};
use super::error::{LayersError, io, wrong};
use super::names::{self, stem};
use super::options::Options;
use super::resolution::Dpi;
use super::size::{self, Unstated};
use super::{cmyk, pdf, picture, svg, tiff};

/// File extensions of pictures.
const PICTURES: [&str; 8] = ["png", "tif", "tiff", "jpg", "jpeg", "pgm", "pbm", "ppm"];

/// The most pictures in a folder.
const MOST_FILES: usize = 64;

/// Reads art: several pictures named after their inks, a folder of them, a TIFF with named channels, an SVG with named
/// layers, a PDF or PostScript page, or one picture.
///
/// # Errors
/// Damaged files, unknown inks, layers of different sizes, art without a size, art without a dot. Each error names the
/// file and what to do.
pub fn open(paths: &[PathBuf], options: &Options, observer: &dyn Observer) -> Result<Artwork, LayersError> {
    let mut art = match paths {
        [] => {
            let reason = "no file was given".into();
            return Err(LayersError::Nothing { reason });
        }
        [folder] if folder.is_dir() => {
            let files = pictures_in(folder)?;
            // Resolved, so that `.` has a name as well.
            let own = std::path::absolute(folder).unwrap_or_else(|_| folder.clone());
            named_files(&stem(&own), &files, options, observer)?
        }
        [file] => open_file(file, options, observer)?,
        files => named_files(&common_name(files), files, options, observer)?,
    };
    art.across = options.across.max(1);
    art.name.retain(|c| !c.is_control());
    if art.name.trim().is_empty() {
        art.name = "art".into();
    }
    for note in &art.notes {
        observer.note(note);
    }
    Ok(art)
}

/// Whether a path is plainly art for [`open`], judged by its name: a drawing or a page, a picture named after an ink, or
/// a folder of such pictures. Serves commands that expect something else and want to point here.
pub fn is_art(path: &Path) -> bool {
    if path.is_dir() {
        return pictures_in(path)
            .is_ok_and(|files| files.iter().all(|file| names::ink(&stem(file)).is_some()));
    }
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    ["svg", "pdf", "ps", "eps"].contains(&extension.as_str())
        || PICTURES.contains(&extension.as_str()) && names::ink(&stem(path)).is_some()
}

fn open_file(file: &Path, options: &Options, observer: &dyn Observer) -> Result<Artwork, LayersError> {
    let mut start = Vec::new();
    let opened = std::fs::File::open(file).map_err(io(file, "open it"))?;
    opened.take(1 << 12).read_to_end(&mut start).map_err(io(file, "read it"))?;
    if start.starts_with(b"%PDF") || start.starts_with(b"%!") {
        return pdf::read(file, options, observer);
    }
    if (start.starts_with(b"II*\0") || start.starts_with(b"MM\0*"))
        && let Some(art) = tiff::read(file, options)?
    {
        return Ok(art);
    }
    if svg::is_svg(file, &start) {
        return svg::read(file, options, observer);
    }
    if !options.reserved && names::ink(&stem(file)).is_some() {
        return named_files(&stem(file), &[file.to_path_buf()], options, observer);
    }
    if start.starts_with(b"\xff\xd8")
        && let Some(art) = cmyk::read_jpeg(file, options)?
    {
        return Ok(art);
    }
    let pixels = picture::read(file)?;
    let mut art = picture::artwork(&stem(file), pixels, options)?;
    if let Some(known) = names::closest(&stem(file)).filter(|_| !options.reserved) {
        art.notes.push(format!(
            "{}: printed as a picture in process inks; if it is a layer, name it {known}.png",
            file.display()
        ));
    }
    Ok(art)
}

/// The pictures in a folder, sorted by name.
fn pictures_in(folder: &Path) -> Result<Vec<PathBuf>, LayersError> {
    let listed = io(folder, "list it");
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(&listed)? {
        let path = entry.map_err(&listed)?.path();
        let extension = path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase);
        let hidden = path.file_name().is_some_and(|name| name.to_string_lossy().starts_with('.'));
        if extension.is_some_and(|e| PICTURES.contains(&e.as_str())) && !hidden && path.is_file() {
            files.push(path);
        }
    }
    if files.is_empty() {
        return Err(wrong(folder, "there is no picture in the folder; name pictures white.png, gold.png, …"));
    }
    if files.len() > MOST_FILES {
        let problem = format!("the folder has {} pictures; expected at most {MOST_FILES}", files.len());
        return Err(wrong(folder, problem));
    }
    files.sort();
    Ok(files)
}

/// One layer for each file; each file is named after its ink.
fn named_files(
    name: &str,
    files: &[PathBuf],
    options: &Options,
    observer: &dyn Observer,
) -> Result<Artwork, LayersError> {
    let named: Vec<names::Named> = files
        .iter()
        .map(|path| {
            let name = stem(path);
            names::ink(&name).ok_or_else(|| LayersError::UnknownInk {
                path: path.clone(),
                suggestion: names::closest(&name),
                name,
            })
        })
        .collect::<Result<_, _>>()?;
    observer.begin("reading layers", files.len() as u64);
    let mut first: Option<First> = None;
    let mut art: Option<Artwork> = None;
    let mut notes = Vec::new();
    for (files, named) in files.chunks(2).zip(named.chunks(2)) {
        let scans: Vec<_> = files.par_iter().map(|file| coverage::scan(file)).collect();
        for (scan, named) in scans.into_iter().zip(named) {
            let scan = scan?;
            let dots = match &first {
                Some(first) => first.check(&scan, options)?,
                None => first.insert(First::new(&scan, options, &mut notes)?).dots,
            };
            let file =
                scan.path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
            art.get_or_insert_with(|| Artwork::blank(name, dots)).add(scan, &file, *named, false, options);
            observer.advance(1);
        }
    }
    observer.end();
    // Every caller gives at least one file, so there is art.
    let mut art = art.ok_or_else(|| LayersError::Nothing { reason: "no file was given".into() })?;
    art.notes.splice(0..0, notes);
    Ok(art)
}

/// The first of several layers, whose size the others must have.
struct First {
    path: PathBuf,
    pixels: (u32, u32),
    dpi: Option<Dpi>,
    size: String,
    dots: (usize, usize),
}

impl First {
    fn new(scan: &Scan, options: &Options, notes: &mut Vec<String>) -> Result<First, LayersError> {
        let sides = (f64::from(scan.width), f64::from(scan.height));
        Ok(First {
            path: scan.path.clone(),
            pixels: (scan.width, scan.height),
            dpi: scan.dpi,
            size: scan.size_at(options.dpi),
            dots: size::dots(&scan.path, sides, scan.dpi, Unstated::PixelPerDot, options, notes)?,
        })
    }

    /// Checks that another layer has the same size, and returns that size in dots.
    fn check(&self, other: &Scan, options: &Options) -> Result<(usize, usize), LayersError> {
        // A layer without a resolution takes that of the first. If two state different ones, one of them is wrong.
        let overridden = options.dpi.is_some() || options.size.is_some();
        let apart = self
            .dpi
            .zip(other.dpi)
            .is_some_and(|(a, b)| !overridden && ((a.0 - b.0).abs() > 0.5 || (a.1 - b.1).abs() > 0.5));
        if self.pixels == (other.width, other.height) && !apart {
            return Ok(self.dots);
        }
        Err(LayersError::Sizes {
            found: other.size_at(options.dpi),
            path: other.path.clone(),
            first: self.path.clone(),
            expected: self.size.clone(),
        })
    }
}

/// A name for a job of several files: that of their folder, unless it is the current one.
fn common_name(files: &[PathBuf]) -> String {
    let folder = files[0].parent().filter(|parent| files.iter().all(|file| file.parent() == Some(parent)));
    folder
        .and_then(Path::file_name)
        .map_or_else(|| "layers".into(), |name| name.to_string_lossy().into_owned())
}
