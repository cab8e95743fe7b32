//! PDF and PostScript pages, through Ghostscript as a process.
//!
//! Problem: pages have spot plates and transparent backgrounds, and their languages are large. A document
//! has several pages, and nothing of it may be lost in silence.
//! Method: one page is drawn with the kind of each pixel ([`Drawer`]), on a transparent background. Drafts
//! tell of all pages only where the document may have spot colours ([`Suspected`]), has several pages, or
//! is printed in a size that is not its own. If several hold art, the user chooses one, or names an ink for
//! each. A page with spot colours that name inks is separated at its final number of dots.
//! Cost: that of Ghostscript, and a tenth for what becomes of it. Limits: a time limit for each page
//! ([`process`](crate::read::process)).

mod complaint;
pub mod conversion;
mod draw;
mod drawer;
mod eps;
mod ghostscript;
mod objects;
mod optional;
mod plates;
mod suspected;

use std::fs::File;
use std::io::{Read as _, Seek as _, SeekFrom};
use std::path::{Path, PathBuf};

use protocol::ink::{Ink, Kind};

use crate::artwork::{Artwork, Layer};
use crate::error::{all_for_a_cutter, io, no_dot, nothing, several_pages, wrong};
use crate::options::{Options, Pages};
use crate::read::coverage::Scan;
use crate::read::file;
use crate::read::names::{self, stem};
use crate::read::size::{self, Unstated};
use draw::{DRAFT, Drafts, Leaf};
use files::scratch::Scratch;
use files::shelf::Disk;
use observe::{Diagnosis, Observer};
use readers::Raster;

pub use complaint::{OLDER, cut_short, damaged, impossible_size, no_page};
pub use draw::Part;
pub use drawer::{DrawError, Drawer, Drawing};
pub use ghostscript::{Interpreter, command, interpreter, order, page_count};
pub use plates::{Separated, Survey, Surveyed, separated, survey};
pub use suspected::Suspected;

/// How far from the beginning of a file readers look for the header of a PDF. Source: Adobe's implementation
/// note 13 to PDF 1.7, appendix H.
const HEADER: usize = 1024;

/// Whether these are the first bytes of a document for [`read`].
pub(crate) fn is_document(start: &[u8]) -> bool {
    is_pdf(start) || start.starts_with(b"%!") || start.starts_with(eps::WITH_PREVIEW)
}

/// Whether these are the first bytes of a PDF. Spoolers and mail programs write a few lines before its
/// header.
fn is_pdf(start: &[u8]) -> bool {
    let other = || {
        readers::is_picture(start) || start.trim_ascii_start().starts_with(b"<") || start.starts_with(b"%!")
    };
    start.starts_with(b"%PDF")
        || start[..start.len().min(HEADER)].windows(5).any(|word| word == b"%PDF-") && !other()
}

/// Reads a document.
pub(crate) fn read(path: &Path, options: &Options, observer: &dyn Observer) -> Result<Artwork, Diagnosis> {
    if !options.shelf.is_disk() || cfg!(target_family = "wasm") {
        let problem = "it is drawn by Ghostscript, which reads files on disk, on a computer that has it";
        return Err(
            wrong(path, problem).hint("print it with the program foilpress, or export it as SVG or PNG")
        );
    }
    let folder = Scratch::new().map_err(io(path, "make a folder for its pages"))?;
    let Some(bare) = from_its_header(path, &folder).map_err(io(path, "read it"))? else {
        return drawn(path, options, observer);
    };
    let (bare_name, name) = (bare.display().to_string(), path.display().to_string());
    let mut art = drawn(&bare, options, observer).map_err(|error| error.calling_it(&name))?;
    art.notes.iter_mut().for_each(|note| *note = note.replace(&bare_name, &name));
    Ok(art)
}

/// A copy of a PDF without what spoolers and mail programs write before it, of the same name: its places
/// count from its header, and to Ghostscript they would be wrong. `None` if nothing stands there.
fn from_its_header(path: &Path, folder: &Scratch) -> std::io::Result<Option<PathBuf>> {
    let mut file = File::open(path)?;
    let mut start = Vec::new();
    (&mut file).take(HEADER as u64).read_to_end(&mut start)?;
    let header = is_pdf(&start).then(|| start.windows(5).position(|word| word == b"%PDF-")).flatten();
    let Some(at) = header.filter(|at| *at > 0) else { return Ok(None) };
    file.seek(SeekFrom::Start(at as u64))?;
    let copy = folder.path().join(path.file_name().unwrap_or_default());
    std::io::copy(&mut file, &mut File::create(&copy)?)?;
    Ok(Some(copy))
}

/// What is drawn of a document.
fn drawn(path: &Path, options: &Options, observer: &dyn Observer) -> Result<Artwork, Diagnosis> {
    let only = options.page();
    observer.begin("reading pages", 2);
    let suspected = Suspected::of(path).map_err(io(path, "read it"))?;
    let drawn = match suspected.spots || options.size.is_some() || matches!(options.pages, Pages::Inks(_)) {
        true => None,
        false => drawn_at_once(path, suspected, options)?,
    };
    observer.advance(1);
    let (mut art, said, interpreter) = match drawn {
        Some(drawn) => drawn,
        None => {
            let folder = Scratch::new().map_err(io(path, "make a folder for its pages"))?;
            let (Drafts { leaves, said }, interpreter) = draw::drafts(path, only, Part::CropBox, &folder)?;
            let first = leaves.first().ok_or_else(|| wrong(path, no_page(&said, only)))?;
            let document =
                Document { path, interpreter, folder: &folder, options, overprints: suspected.overprint };
            let art = match &options.pages {
                Pages::Number(_) => document.page(first)?,
                Pages::Only => document.only_page(&leaves)?,
                Pages::Inks(inks) => document.pages_of_inks(&leaves, inks, observer)?,
            };
            (art, said, interpreter)
        }
    };
    observer.end();
    let place = |note: String| format!("{}: {note}", path.display());
    art.notes.extend(complaint::replaced_fonts(&said).map(place));
    let spots = art.layers.iter().any(|layer| layer.ink.kind() != Kind::Process);
    art.notes.extend(optional::notes(path, spots));
    art.notes.extend(
        damaged(&said).or_else(|| cut_short(path)).map(|doubt| format!("{}: {doubt}", path.display())),
    );
    if interpreter == Interpreter::Older {
        art.notes.push(format!("{}: {OLDER}", path.display()));
    }
    Ok(art)
}

/// The page of a document that has no spot colours, as it is large, what Ghostscript said, and what read
/// it; `None` if there is a choice of pages.
fn drawn_at_once(
    path: &Path,
    suspected: Suspected,
    options: &Options,
) -> Result<Option<(Artwork, String, Interpreter)>, Diagnosis> {
    let interpreter = if suspected.gradients { interpreter(path) } else { Interpreter::Usual };
    let drawing = Drawing {
        path,
        interpreter,
        pages: options.page().map(|page| (page, page)),
        part: Part::CropBox,
        dpi: resolution(options),
        overprints: suspected.overprint,
        has_ground: true,
    };
    let failed = |error| undrawn(path, error);
    let mut drawer = Drawer::begin(&drawing).map_err(failed)?;
    let Some(dots) = drawer.next_page().map_err(failed)? else {
        return Err(wrong(path, no_page(&drawer.end().map_err(failed)?, options.page())));
    };
    let mut notes = Vec::new();
    sized(path, dots, options, &mut notes)?;
    let page = drawer.page(dots).map_err(failed)?;
    if drawer.next_page().map_err(failed)?.is_some() {
        return Ok(None);
    }
    let said = drawer.end().map_err(failed)?;
    let mut art = page.at(&stem(path), dots, options);
    art.notes.splice(..0, notes);
    Ok(Some((art, said, interpreter)))
}

/// Pixels an inch, across and down, at which a page of a document has a pixel for each dot.
fn resolution(options: &Options) -> (f64, f64) {
    let dpi = size::DPI * options.scale;
    (dpi * options.across.max(1) as f64, dpi)
}

/// Refuses a page of so many dots that is too large to be read or printed.
fn sized(
    path: &Path,
    (width, length): (usize, usize),
    options: &Options,
    notes: &mut Vec<String>,
) -> Result<(), Diagnosis> {
    let side = |dots| u32::try_from(dots).map_err(|_| wrong(path, "its page is too large"));
    file::PICTURE.check(path, (side(width)?, side(length)?))?;
    let across = options.across.max(1) as f64;
    let unstated = Unstated::Drawing { rounded_mm: size::MM };
    let pixels = (width as f64 / across, length as f64);
    // It is drawn as large as it is printed.
    let dpi = size::DPI * options.scale;
    size::dots(path, pixels, Some((dpi, dpi)), unstated, options, notes).map(|_| ())
}

/// Why a document is not drawn.
fn undrawn(path: &Path, error: DrawError) -> Diagnosis {
    match error {
        DrawError::Process(error) => draw::failed(path, error),
        DrawError::Folder(source) => io(path, "make a folder for its pages")(source),
        DrawError::Read(source) => io(path, "read its page")(source),
    }
}

/// The only page that holds art; the first if none does.
fn only<'a>(path: &Path, leaves: &'a [Leaf]) -> Result<&'a Leaf, Diagnosis> {
    let drawn: Vec<&Leaf> = leaves.iter().filter(|leaf| leaf.drawn).collect();
    match drawn[..] {
        [] => Ok(&leaves[0]),
        [one] => Ok(one),
        _ => Err(several_pages(path, &drawn.iter().map(|leaf| leaf.number).collect::<Vec<u32>>())),
    }
}

/// Width and length in millimetres of the page that would be read, to a dot.
pub(crate) fn size_mm(path: &Path, options: &Options) -> Result<(f64, f64), Diagnosis> {
    let folder = Scratch::new().map_err(io(path, "make a folder for its pages"))?;
    let bare = from_its_header(path, &folder).map_err(io(path, "read it"))?;
    let bare = bare.as_deref().unwrap_or(path);
    let drafts = Scratch::new().map_err(io(path, "make a folder for its pages"))?;
    let (Drafts { leaves, said }, _) = draw::drafts(bare, options.page(), Part::CropBox, &drafts)
        .map_err(|error| error.calling_it(&path.display().to_string()))?;
    let first = leaves.first().ok_or_else(|| wrong(path, no_page(&said, options.page())))?;
    let leaf = if options.pages == Pages::Only { only(path, &leaves)? } else { first };
    let mm = |draft: f64| (size::DPI * draft / DRAFT).round() * size::MM;
    Ok((mm(leaf.size.0), mm(leaf.size.1)))
}

/// A document and how it is read.
struct Document<'a> {
    path: &'a Path,
    interpreter: Interpreter,
    folder: &'a Scratch,
    options: &'a Options,
    overprints: bool,
}

impl Document<'_> {
    /// The only page that holds art; the first if none does.
    fn only_page(&self, leaves: &[Leaf]) -> Result<Artwork, Diagnosis> {
        let leaf = only(self.path, leaves)?;
        let mut art = self.page(leaf)?;
        if leaves.len() > 1 {
            art.notes.push(format!(
                "{}: page {} of {} is read; the others are blank",
                self.path.display(),
                leaf.number,
                leaves.len()
            ));
        }
        Ok(art)
    }

    /// One page: plates if spot colours name inks, else a picture.
    fn page(&self, leaf: &Leaf) -> Result<Artwork, Diagnosis> {
        let name = stem(self.path);
        let mut notes = Vec::new();
        let dpi = self.dpi(leaf, &mut notes)?;
        if !plates::layers(self.path, &self.path.display(), &leaf.spots, &mut notes)?.is_empty() {
            // The plates tell of the other spots themselves.
            let source = (self.path, self.interpreter);
            let separated =
                plates::separated_part(source, leaf.number, Part::CropBox, (dpi, self.overprints))?;
            let has_cuts = separated.has_cuts();
            let mut art = separated.whole(&name, self.options);
            if art.layers.is_empty() && art.colour.is_none() {
                let nothing = nothing("no plate of the page has a dot");
                return Err(if has_cuts { all_for_a_cutter(self.path) } else { nothing });
            }
            notes.retain(|note| !art.notes.contains(note));
            art.notes.append(&mut notes);
            return Ok(art);
        }
        let mut art = self.drawn(leaf, dpi)?;
        art.notes.append(&mut notes);
        Ok(art)
    }

    /// What a page draws, with the kind of each pixel.
    fn drawn(&self, leaf: &Leaf, dpi: (f64, f64)) -> Result<Artwork, Diagnosis> {
        let drawing = Drawing {
            path: self.path,
            interpreter: self.interpreter,
            pages: Some((leaf.number, leaf.number)),
            part: Part::CropBox,
            dpi,
            overprints: self.overprints,
            has_ground: true,
        };
        let (page, dots) = plates::drawn(self.path, &drawing)?;
        Ok(page.at(&stem(self.path), dots, self.options))
    }

    /// One layer for each page, by the rules for pictures that are named after inks.
    fn pages_of_inks(
        &self,
        leaves: &[Leaf],
        inks: &[Ink],
        observer: &dyn Observer,
    ) -> Result<Artwork, Diagnosis> {
        let path = self.path;
        let beyond = leaves.iter().skip(inks.len()).find(|leaf| leaf.drawn);
        if let Some(leaf) = beyond {
            let problem =
                format!("page {} has art, but an ink is named for {} pages only", leaf.number, inks.len());
            return Err(wrong(path, problem));
        }
        if leaves.len() < inks.len() {
            let problem =
                format!("it has {} pages, but {} inks are named for them", leaves.len(), inks.len());
            return Err(wrong(path, problem));
        }
        let first = &leaves[0];
        let mut notes = Vec::new();
        let dpi = self.dpi(first, &mut notes)?;
        let mut art: Option<Artwork> = None;
        observer.begin("drawing pages", inks.len() as u64);
        for (leaf, &ink) in leaves.iter().zip(inks) {
            if (leaf.size.0 - first.size.0).abs() > 1.0 || (leaf.size.1 - first.size.1).abs() > 1.0 {
                let mm = |(x, y): (f64, f64)| format!("{:.0} x {:.0} mm", x * 25.4 / DRAFT, y * 25.4 / DRAFT);
                let problem = format!(
                    "page {} is {}, but page {} is {}",
                    leaf.number,
                    mm(leaf.size),
                    first.number,
                    mm(first.size)
                );
                return Err(wrong(path, problem).hint("the pages of one print have one size"));
            }
            let name = format!("page {}", leaf.number);
            let scan = self.layer(leaf, dpi)?;
            let dots = (scan.width as usize, scan.height as usize);
            let named = names::of_page(inks, leaf.number, ink);
            let art = art.get_or_insert_with(|| Artwork::blank(&stem(path), dots));
            art.add(scan, &name, named, false, self.options);
            if leaf.drawn && art.layers.last().is_none_or(Layer::is_blank) {
                return Err(no_dot(path, &name, ink));
            }
            observer.advance(1);
        }
        observer.end();
        let mut art = art.ok_or_else(|| nothing("no ink is named"))?;
        art.opaque = Some(art.drawn.clone());
        art.notes.append(&mut notes);
        Ok(art)
    }

    /// A page as coverage.
    fn layer(&self, leaf: &Leaf, dpi: (f64, f64)) -> Result<Scan, Diagnosis> {
        let drawn = draw::picture((self.path, self.interpreter), leaf.number, dpi, self.folder)?;
        let mut picture = file::picture(&Disk, &drawn, None)?;
        picture.to_srgb()?;
        let rgba = picture.colours.map_or_else(Vec::new, Raster::into_rgba);
        Ok(Scan::of_page(self.path, picture.size, &rgba))
    }

    /// The resolution at which a page has its final number of dots: that of the printer, as in a print
    /// queue, unless a size is set. The program that draws rounds the sides of a page as the printer needs
    /// it.
    fn dpi(&self, leaf: &Leaf, notes: &mut Vec<String>) -> Result<(f64, f64), Diagnosis> {
        let unstated = Unstated::Drawing { rounded_mm: leaf.rounded_mm };
        let dots = size::dots(self.path, leaf.size, Some((DRAFT, DRAFT)), unstated, self.options, notes)?;
        if self.options.size.is_none() {
            return Ok(resolution(self.options));
        }
        Ok((DRAFT * dots.0 as f64 / leaf.size.0, DRAFT * dots.1 as f64 / leaf.size.1))
    }
}
