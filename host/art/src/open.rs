//! Reads art from files: chooses the reader by what a file holds, and joins several files into one artwork.
//!
//! Method: the first bytes tell PDF, PostScript, TIFF, SVG and JPEG apart. A picture whose name is that of an ink is a
//! layer, and so is a page of a TIFF for which an ink is named; any other picture is colour for the process inks. If only a
//! part of its name is an ink, it must also look like a layer. Cost: that of the readers; files are read in pairs, so both
//! cores work and at most two layers are in memory as bytes. Limits: layers must have the same size in pixels.

use std::io::Read;
use std::path::{Path, PathBuf};

use observe::{Diagnosis, Fault, Observer};
use protocol::ink::Ink;
use rayon::prelude::*;

use super::artwork::{Artwork, Layer};
use super::coverage::{self, Scan};
use super::error::{NamedPart, io, no_dot, nothing, unknown_ink, wrong};
use super::names::{self, stem};
use super::options::{Options, Pages};
use super::picture::Looks;
use super::size::{self, MOST_BYTES, Unstated};
use super::{cmyk, layered, pdf, picture, svg, tiff, tiff_pages};
use readers::resolution::Dpi;

/// File extensions of pictures.
const PICTURES: [&str; 11] = ["png", "tif", "tiff", "jpg", "jpeg", "pgm", "pbm", "ppm", "bmp", "gif", "webp"];

/// File extensions of art that is not read as one of several layers.
const OTHERS: [&str; 17] = [
    "ai", "avif", "cdr", "eps", "heic", "jp2", "jxl", "kra", "ora", "pdf", "ps", "psb", "psd", "svg", "svgz",
    "tga", "xcf",
];

/// The most pictures in a folder.
const MOST_FILES: usize = 64;

/// Reads art: several pictures named after their inks, a folder of them, a TIFF with named channels, an SVG with named
/// layers, a PDF or PostScript page, or one picture.
///
/// # Errors
/// Damaged files, unknown inks, layers of different sizes, art without a size. Each error names the file and what to do. Art without a
/// dot is left to [`compose`](super::compose()).
pub fn open(paths: &[PathBuf], options: &Options, observer: &dyn Observer) -> Result<Artwork, Diagnosis> {
    for path in paths {
        // A pipe would be waited for.
        if std::fs::metadata(path).is_ok_and(|found| !found.is_file() && !found.is_dir()) {
            return Err(wrong(path, "it is a pipe or a device").hint("save the art as an ordinary file"));
        }
    }
    let mut art = match paths {
        [] => {
            return Err(nothing("no file was given"));
        }
        [folder] if folder.is_dir() => {
            without_pages(folder, options)?;
            let Listing { pictures, others } = listing(folder)?;
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
pub fn is_art(path: &Path) -> bool {
    if path.is_dir() {
        return listing(path)
            .is_ok_and(|listing| listing.pictures.iter().all(|file| names::ink(&stem(file)).is_some()));
    }
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    ["svg", "pdf", "ps", "eps", "ora", "kra"].contains(&extension.as_str())
        || PICTURES.contains(&extension.as_str())
}

fn open_file(file: &Path, options: &Options, observer: &dyn Observer) -> Result<Artwork, Diagnosis> {
    let start = start_of(file)?;
    if pdf::is_document(&start) {
        return pdf::read(file, options, observer);
    }
    if tiff_pages::is_tiff(&start) {
        if let Pages::Inks(inks) = &options.pages {
            return pages_of_inks(file, inks, options, observer);
        }
        if let Some(art) = tiff::read(file, options)? {
            return Ok(art);
        }
    } else {
        without_pages(file, options)?;
    }
    if svg::is_svg(file, &start) {
        return svg::read(file, options, observer);
    }
    if layered::is_layered(&start) {
        return layered::read(file, options, observer);
    }
    let name = stem(file);
    let named = names::ink(&name).filter(|_| !options.reserves());
    let looks = named.map_or(Looks::Layer, |named| match picture::looks(file, options.page()) {
        Looks::Tones if options.tones.contains(named.ink) => Looks::Layer,
        looks => looks,
    });
    let is_exact = names::is_exact(&name);
    if let Some(named) = named
        && (looks == Looks::Layer || is_exact && names::is_whole(&name))
    {
        let mut art = named_files(&name, &[file.to_path_buf()], options, observer)?;
        if !is_exact || looks != Looks::Layer {
            art.notes.push(format!(
                "{} is printed as the layer {}, because of its name; rename it to print it as a picture",
                file.display(),
                named.ink.name()
            ));
        }
        return Ok(art);
    }
    if start.starts_with(b"\xff\xd8")
        && let Some(art) = cmyk::read_jpeg(file, options)?
    {
        return Ok(art);
    }
    let pixels = picture::read(file, options.page())?;
    let mut art = picture::artwork(&stem(file), pixels, options)?;
    let close = || names::closest(&stem(file)).map(|known| (known, "its name is that of no ink"));
    let why = match looks {
        Looks::Tones => "it has many tones and only a part of its name is an ink",
        _ => "it has colours and only a part of its name is an ink",
    };
    let part = named.map(|named| (named.ink.name(), why));
    let meant = part.or_else(close).filter(|_| !options.reserves() && art.drawn.dots() > 0);
    if let Some((known, why)) = meant {
        art.notes.push(format!(
            "{}: printed as a picture in process inks, because {why}; to print it as a layer of {known}, rename the file to \
             {known}.{}",
            file.display(),
            file.extension().unwrap_or_default().display()
        ));
    }
    Ok(art)
}

/// The first bytes of a file.
fn start_of(file: &Path) -> Result<Vec<u8>, Diagnosis> {
    let mut start = Vec::new();
    let opened = std::fs::File::open(file).map_err(io(file, "open it"))?;
    opened.take(1 << 12).read_to_end(&mut start).map_err(io(file, "read it"))?;
    Ok(start)
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

fn listing(folder: &Path) -> Result<Listing, Diagnosis> {
    let listed = io(folder, "list it");
    let (mut files, mut others) = (Vec::new(), Vec::new());
    for entry in std::fs::read_dir(folder).map_err(&listed)? {
        let path = entry.map_err(&listed)?.path();
        let extension = path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase);
        let hidden = path.file_name().is_some_and(|name| name.to_string_lossy().starts_with('.'));
        let extension = extension.unwrap_or_default();
        if hidden || !path.is_file() {
            continue;
        }
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
    files.sort();
    others.sort();
    Ok(Listing { pictures: files, others })
}

/// A note on the files of a folder that are left out, if there are any.
fn left_out(folder: &Path, others: &[PathBuf]) -> Option<String> {
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
        let start = start_of(path)?;
        let kinds = [
            (svg::is_svg(path, &start), "SVG"),
            (pdf::is_document(&start), "PDF or PostScript"),
            (layered::is_layered(&start), "OpenRaster or Krita's own format"),
        ];
        if let Some((_, kind)) = kinds.into_iter().find(|(is, _)| *is) {
            let problem = format!("it is {kind}, which is read alone and cannot be one of several layers");
            return Err(wrong(path, problem).hint("export it as PNG, or draw all layers in it"));
        }
        let label = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        Ok(Source { path: path.clone(), page: options.page(), label, named })
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
    let reading = io(file, "read it");
    if std::fs::metadata(file).map_err(&reading)?.len() > MOST_BYTES {
        return Err(wrong(file, "the file is larger than a gigabyte"));
    }
    let pages = tiff_pages::count(&std::fs::read(file).map_err(&reading)?);
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

/// Where a layer is.
struct Source {
    path: PathBuf,
    /// Page of a TIFF.
    page: Option<u32>,
    /// What notes call it.
    label: String,
    named: names::Named,
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
    let mut first: Option<First> = None;
    let mut art: Option<Artwork> = None;
    let mut notes = Vec::new();
    for sources in sources.chunks(2) {
        let scans: Vec<_> =
            sources.par_iter().map(|source| coverage::scan(&source.path, source.page)).collect();
        for (scan, source) in scans.into_iter().zip(sources) {
            let mut scan = scan?;
            if first.as_ref().is_some_and(|first| first.dpi.is_none()) && scan.dpi.is_some() {
                observer.end();
                return layers(name, sources, scan.dpi, options, observer);
            }
            scan.dpi = scan.dpi.or(stated);
            let dots = match &first {
                Some(first) => first.check(&scan, options)?,
                None => first.insert(First::new(&scan, options, &mut notes)?).dots,
            };
            let art = art.get_or_insert_with(|| Artwork::blank(name, dots));
            let drawn = source.page.is_some() && scan.coverage.iter().any(|&c| c > 0);
            art.add(scan, &source.label, source.named, false, options);
            if drawn && art.layers.last().is_none_or(Layer::is_blank) {
                return Err(no_dot(&source.path, &source.label, source.named.ink));
            }
            observer.advance(1);
        }
    }
    observer.end();
    // Every caller gives at least one file, so there is art.
    let mut art = art.ok_or_else(|| nothing("no file was given"))?;
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
    fn new(scan: &Scan, options: &Options, notes: &mut Vec<String>) -> Result<First, Diagnosis> {
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
    fn check(&self, other: &Scan, options: &Options) -> Result<(usize, usize), Diagnosis> {
        // A layer without a resolution has that of another. If two state different ones, one of them is wrong.
        let overridden = options.dpi.is_some() || options.size.is_some();
        let apart = self
            .dpi
            .zip(other.dpi)
            .is_some_and(|(a, b)| !overridden && ((a.0 - b.0).abs() > 0.5 || (a.1 - b.1).abs() > 0.5));
        if self.pixels == (other.width, other.height) && !apart {
            return Ok(self.dots);
        }
        let (path, found) = (other.path.display(), other.size_at(options.dpi));
        let problem = format!("{path} is {found}, but {} is {}", self.path.display(), self.size);
        Err(Diagnosis::new(Fault::File, problem)
            .hint("layers are printed one on another pixel by pixel, so export all of them at the same size"))
    }
}

/// A name for a job of several files: that of their folder, unless it is the current one.
fn common_name(files: &[PathBuf]) -> String {
    let folder = files[0].parent().filter(|parent| files.iter().all(|file| file.parent() == Some(parent)));
    folder
        .and_then(Path::file_name)
        .map_or_else(|| "layers".into(), |name| name.to_string_lossy().into_owned())
}
