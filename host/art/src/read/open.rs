//! Reads art from files: chooses the reader by what a file holds, and joins several files into one artwork.
//!
//! Method: the first bytes tell PDF, PostScript, SVG and files of layers from pictures, of which names say
//! what they print ([`inks_by_name`]). Of several files each is the layer of an ink, and so is each page of a
//! TIFF for which inks are named. Cost: that of the readers; files are read in pairs, so both cores work and
//! at most two layers are in memory as bytes. Limits: layers must have the same size in pixels.

use std::path::{Path, PathBuf};

use files::shelf::{Kind, Shelf};
use observe::{Diagnosis, Observer};
use protocol::ink::Ink;
use rayon::prelude::*;
use readers::Request;
use readers::resolution::Dpi;

use crate::artwork::Artwork;
use crate::error::{NamedPart, io, nothing, unknown_ink, wrong};
use crate::options::{Options, Pages};
use crate::read::coverage::Scan;
use crate::read::file;
use crate::read::inks_by_name::{self, Layers, Source};
use crate::read::layered;
use crate::read::names::{self, stem};
use crate::read::pdf;
use crate::read::picture;
use crate::read::size::{self, Unstated};
use crate::read::svg;

/// File extensions of pictures.
const PICTURES: [&str; 11] = ["png", "tif", "tiff", "jpg", "jpeg", "pgm", "pbm", "ppm", "bmp", "gif", "webp"];

/// File extensions of art that is not read as one of several layers.
const OTHERS: [&str; 17] = [
    "ai", "avif", "cdr", "eps", "heic", "jp2", "jxl", "kra", "ora", "pdf", "ps", "psb", "psd", "svg", "svgz",
    "tga", "xcf",
];

/// The most pictures in a folder: several for each cartridge, so that a folder of photographs, which is a
/// mistake, would be refused.
const MOST_FILES: usize = 64;

/// Reads art: several pictures named after their inks, a folder of them, a TIFF with named channels, an SVG with named
/// layers, a PDF or PostScript page, or one picture.
///
/// # Errors
/// Damaged files, unknown inks, layers of different sizes, art without a size. Each error names the file and what to do. Art without a
/// dot is left to [`compose`](crate::compose()).
pub fn open(paths: &[PathBuf], options: &Options, observer: &dyn Observer) -> Result<Artwork, Diagnosis> {
    let shelf = &*options.shelf;
    for path in paths {
        if shelf.kind(path).is_ok_and(|kind| kind == Kind::Other) {
            return Err(wrong(path, "it is a pipe or a device").hint("save the art as an ordinary file"));
        }
    }
    let mut art = match paths {
        [] => {
            return Err(nothing("no file was given"));
        }
        [folder] if shelf.is_folder(folder) => {
            without_pages(folder, options)?;
            let Listing { pictures, others } = listing(shelf, folder)?;
            // Resolved, so that `.` has a name as well.
            let own = std::path::absolute(folder).unwrap_or_else(|_| folder.clone());
            let mut art = named_files(&stem(&own), &pictures, options, observer)?;
            art.notes.extend(left_out(folder, &others));
            art
        }
        [file] => open_file(file, options, observer)?,
        files => {
            without_pages(&files[0], options)?;
            named_files(&common_name(files), files, options, observer)?
        }
    };
    art = art.turned(options.turn);
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

/// Whether a path is plainly art for [`open`], judged by its name: a drawing, a page, a picture, or a folder of pictures named after
/// inks. Serves commands that expect something else and want to point here.
pub fn is_art(shelf: &dyn Shelf, path: &Path) -> bool {
    if shelf.is_folder(path) {
        return listing(shelf, path)
            .is_ok_and(|listing| listing.pictures.iter().all(|file| names::ink(&stem(file)).is_some()));
    }
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    ["svg", "pdf", "ps", "eps", "ora", "kra"].contains(&extension.as_str())
        || PICTURES.contains(&extension.as_str())
}

fn open_file(file: &Path, options: &Options, observer: &dyn Observer) -> Result<Artwork, Diagnosis> {
    let shelf = &*options.shelf;
    let start = file::start(shelf, file)?;
    if pdf::is_document(&start) {
        return pdf::read(file, options, observer);
    }
    let is_tiff = readers::is_tiff(&start);
    if let (true, Pages::Inks(inks)) = (is_tiff, &options.pages) {
        return pages_of_inks(file, inks, options, observer);
    }
    if !is_tiff {
        without_pages(file, options)?;
    }
    if svg::is_svg(shelf, file, &start) {
        return svg::read(file, options, observer);
    }
    let bytes = file::whole(shelf, file, file::MOST)?;
    if readers::is_layered(&start) {
        return layered::read(file, bytes, options, observer);
    }
    // One layer, or colours that stand for inks, are no four plates.
    let is_one = !is_tiff && (options.reserves() || names::ink(&stem(file)).is_some());
    let planes: Option<&dyn Fn(&str) -> bool> = if is_one { None } else { Some(&inks_by_name::is_wanted) };
    if let Some((dots, notes)) = finer_than_dots(file, &bytes, options) {
        let finest = (dots.0 as u32, dots.1 as u32);
        let asked = Request { finest: Some(finest), planes, ..file::PICTURE };
        let mut picture = file::picture_of(file, bytes, &asked)?;
        picture.to_srgb()?;
        picture.notes.extend(notes);
        return Ok(picture::artwork_of(picture, dots, options));
    }
    let asked = Request { page: options.page(), planes, ..file::PICTURE };
    inks_by_name::artwork(file::picture_of(file, bytes, &asked)?, options)
}

/// Pixels from which a picture is made smaller while it is read: the dots of the largest sheet, so what most
/// pictures have stays in memory. Source: 203.2 x 320.5 mm (Legal) at 600 dpi.
const LARGE: u64 = 4800 * 7572;

/// The dots of a large picture that has more pixels than dots, and nothing but colours, and what is said of its
/// size.
fn finer_than_dots(file: &Path, bytes: &[u8], options: &Options) -> Option<((usize, usize), Vec<String>)> {
    let name = stem(file);
    let is_plain = !options.reserves() && names::ink(&name).is_none() && names::closest(&name).is_none();
    if !is_plain || readers::is_tiff(bytes) || options.pages != Pages::Only {
        return None;
    }
    let ((width, height), resolution) = readers::stated(bytes, file)?;
    if u64::from(width) * u64::from(height) <= LARGE {
        return None;
    }
    let sides = (f64::from(width), f64::from(height));
    // What is wrong about its size is told where it is read as a whole.
    let unstated = Unstated::FillRoom;
    let mut notes = Vec::new();
    let dots = size::dots(file, sides, resolution, unstated, options, &mut notes).ok()?;
    (dots.0 < width as usize || dots.1 < height as usize).then_some((dots, notes))
}

/// Refuses a choice of pages where there are none.
fn without_pages(path: &Path, options: &Options) -> Result<(), Diagnosis> {
    if options.pages == Pages::Only {
        return Ok(());
    }
    Err(wrong(path, "it has no pages to choose from")
        .hint("pages are those of one PDF, PostScript or TIFF file"))
}

/// What a folder holds, sorted by name.
struct Listing {
    /// Pictures that are read as layers.
    pictures: Vec<PathBuf>,
    /// Other files that seem to be art.
    others: Vec<PathBuf>,
}

fn listing(shelf: &dyn Shelf, folder: &Path) -> Result<Listing, Diagnosis> {
    let (mut files, mut others) = (Vec::new(), Vec::new());
    for (name, kind) in shelf.list(folder).map_err(io(folder, "list it"))? {
        if name.starts_with('.') || kind != Kind::File {
            continue;
        }
        let path = folder.join(name);
        let extension = path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase);
        let extension = extension.unwrap_or_default();
        if PICTURES.contains(&extension.as_str()) {
            files.push(path);
        } else if OTHERS.contains(&extension.as_str()) {
            others.push(path);
        }
    }
    if files.is_empty() {
        let found = left_out(folder, &others).map_or(String::new(), |note| format!(" ({note})"));
        let problem = format!("there is no picture in the folder{found}");
        return Err(wrong(folder, problem).hint("name pictures white.png, gold.png, …"));
    }
    if files.len() > MOST_FILES {
        let problem = format!("the folder has {} pictures; expected at most {MOST_FILES}", files.len());
        return Err(wrong(folder, problem));
    }
    Ok(Listing { pictures: files, others })
}

/// A note on the files of a folder that are left out, if there are any.
fn left_out(folder: &Path, others: &[PathBuf]) -> Option<String> {
    /// Names that a message has room for: some two lines.
    const NAMED: usize = 8;
    let mut names: Vec<_> =
        others.iter().take(NAMED).filter_map(|file| Some(file.file_name()?.to_string_lossy())).collect();
    if others.len() > NAMED {
        names.push("…".into());
    }
    (!names.is_empty()).then(|| {
        format!(
            "{}: left out {}; in a folder only pictures are layers: export each as PNG",
            folder.display(),
            names.join(", ")
        )
    })
}

/// One layer for each file; each file is named after its ink.
fn named_files(
    name: &str,
    files: &[PathBuf],
    options: &Options,
    observer: &dyn Observer,
) -> Result<Artwork, Diagnosis> {
    let source = |path: &PathBuf| {
        let ink = stem(path);
        let named =
            names::ink(&ink).ok_or_else(|| unknown_ink(path, NamedPart::File, &ink, names::closest(&ink)))?;
        let start = file::start(&*options.shelf, path)?;
        let kinds = [
            (svg::is_svg(&*options.shelf, path, &start), "SVG"),
            (pdf::is_document(&start), "PDF or PostScript"),
            (readers::is_layered(&start), "OpenRaster or Krita's own format"),
        ];
        if let Some((_, kind)) = kinds.into_iter().find(|(is, _)| *is) {
            let problem = format!("it is {kind}, which is read alone and cannot be one of several layers");
            return Err(wrong(path, problem).hint("export it as PNG, or draw all layers in it"));
        }
        Ok(Source { page: options.page(), ..Source::of_file(path, named) })
    };
    let sources: Vec<Source> = files.iter().map(source).collect::<Result<_, _>>()?;
    layers(name, &sources, None, options, observer)
}

/// One layer for each page of a TIFF.
fn pages_of_inks(
    file: &Path,
    inks: &[Ink],
    options: &Options,
    observer: &dyn Observer,
) -> Result<Artwork, Diagnosis> {
    let pages = readers::pages(&file::whole(&*options.shelf, file, file::MOST)?);
    if pages != inks.len() {
        let problem = format!("it has {pages} pages, but {} inks are named for them", inks.len());
        return Err(wrong(file, problem));
    }
    let source = |(page, &ink): (u32, &Ink)| Source {
        path: file.to_path_buf(),
        page: Some(page),
        label: format!("page {page}"),
        named: names::of_page(inks, page, ink),
    };
    let sources: Vec<Source> = (1..).zip(inks).map(source).collect();
    layers(&stem(file), &sources, None, options, observer)
}

/// One layer for each source, all of one size. The resolution that any of them states is `stated` where it is known.
fn layers(
    name: &str,
    sources: &[Source],
    stated: Option<Dpi>,
    options: &Options,
    observer: &dyn Observer,
) -> Result<Artwork, Diagnosis> {
    observer.begin("reading layers", sources.len() as u64);
    let mut layers = Layers::new(name, stated, options);
    for pair in sources.chunks(2) {
        let read = |source: &Source| {
            Ok(Scan::of_picture(file::picture(&*options.shelf, &source.path, source.page)?))
        };
        let scans: Vec<Result<Scan, Diagnosis>> = pair.par_iter().map(read).collect();
        for (scan, source) in scans.into_iter().zip(pair) {
            let scan = scan?;
            if layers.learns_of(&scan) {
                observer.end();
                return self::layers(name, sources, scan.dpi, options, observer);
            }
            layers.add(scan, source)?;
            observer.advance(1);
        }
    }
    observer.end();
    layers.artwork()
}

/// A name for a job of several files: that of their folder, unless it is the current one.
fn common_name(files: &[PathBuf]) -> String {
    let folder = files[0].parent().filter(|parent| files.iter().all(|file| file.parent() == Some(parent)));
    folder
        .and_then(Path::file_name)
        .map_or_else(|| "layers".into(), |name| name.to_string_lossy().into_owned())
}
