//! Spot-colour art to a [`DotMap`](crate::sheet::DotMap): flat layers in named inks, white beneath, finish on top.
//!
//! Problem: most sheets are decals and cards, drawn as one picture for each ink, as one picture in reserved colours,
//! or as a drawing with named layers; each dot must end as one stack of inks.
//! Method: [`open`] reads whatever holds the art into [`Artwork`], one plane for each layer at 600 dpi and, for plain
//! pictures, their colours. [`compose`](compose()) adds white and finish, halftones what has tones, and makes every
//! combination of layers that occurs a stack, in an order the ink library's rules decide unless the art does.
//! Cost: a page in three layers about a second; see the parts. Limits: 16 layers, the largest page.
//! Nothing is guessed in silence: what was decided on the user's behalf is among [`Artwork::notes`].

mod bits;
mod cmyk;
mod colour;
pub mod compose;
mod distance;
pub mod error;
pub mod names;
mod order;
pub mod pdf;
pub mod raster;
pub mod reserved;
mod svg;
mod tiff;
pub mod white;
mod window;

use std::path::{Path, PathBuf};

use inks::InkSet;
use protocol::ink::{Ink, Kind};
use rayon::prelude::*;

use crate::layout::Size;
use crate::separate::Plane;
use observe::Observer;

pub use colour::Colour;
pub use compose::{Accept, Composed, Finish, Order, Report, Settings, Suggestion, compose};
pub use error::LayersError;
pub use white::White;
pub use window::Window;

use raster::{Coverage, Scan, Unstated};

/// Endings of the names of pictures.
const PICTURES: [&str; 8] = ["png", "tif", "tiff", "jpg", "jpeg", "pgm", "pbm", "ppm"];

/// Coverage from which a dot is ink.
const THRESHOLD: u8 = 128;
/// Coverage of pixels that are plainly paper, up to here, and plainly ink, beyond 255 minus it.
const PLAIN: u8 = 8;

/// How art is to be read.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Size on paper, whatever the file says.
    pub size: Option<Size>,
    /// Resolution in pixels an inch, whatever the file says.
    pub dpi: Option<f64>,
    /// Take the vendor's reserved colours for their inks.
    pub reserved: bool,
    /// How far a pixel may be from a reserved colour in each of red, green and blue; each ink's own when not given.
    pub tolerance: Option<u8>,
    /// Page of a PDF or PostScript file, from 1.
    pub page: u32,
    /// Layers that keep their tones and are halftoned; the others are solid or nothing.
    pub halftone: InkSet,
    /// The inks that reserved colours may call for.
    pub inks: InkSet,
    /// What the page has room for: art without a size of its own fits it.
    pub room: Room,
}

/// What a page has room for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Room {
    /// Dots across.
    pub width: usize,
    /// Dots down.
    pub length: usize,
    /// Whether art may be larger, because the page cuts it.
    pub cut: bool,
}

impl Default for Room {
    /// The largest page, which does not cut.
    fn default() -> Room {
        let (width, length) = protocol::paper::LARGEST;
        Room { width: width.into(), length: length.into(), cut: false }
    }
}

impl Options {
    /// The same for art that knows its size better than in pixels: what is too large for the page is the layout's
    /// business, which says what would be cut.
    fn sized(&self) -> Options {
        Options { room: Room { cut: true, ..self.room }, ..self.clone() }
    }
}

impl Default for Options {
    fn default() -> Options {
        Options {
            size: None,
            dpi: None,
            reserved: false,
            tolerance: None,
            page: 1,
            halftone: InkSet::EMPTY,
            inks: InkSet::default().with(Ink::White),
            room: Room::default(),
        }
    }
}

/// What a layer prints.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// Ink or none.
    Solid(Plane),
    /// How much ink, 0 to 255, a byte a dot.
    Tone(Vec<u8>),
}

/// One layer of art.
#[derive(Clone, Debug, PartialEq)]
pub struct Layer {
    /// Its ink.
    pub ink: Ink,
    /// Where it comes from: a file's or layer's name.
    pub name: String,
    /// Its place from the paper up, if its name begins with a number.
    pub place: Option<u32>,
    /// Where it prints.
    pub shape: Shape,
}

/// Art at 600 dpi. See the module text.
#[derive(Clone, Debug, PartialEq)]
pub struct Artwork {
    /// What to call it.
    pub name: String,
    /// Dots across.
    pub width: usize,
    /// Rows.
    pub length: usize,
    /// The layers in the order they were given.
    pub layers: Vec<Layer>,
    /// Colours for the process inks, of plain pictures and of what is no reserved colour.
    pub colour: Option<Colour>,
    /// Dots on which something is drawn: neither pure white nor transparent, or ink of a layer.
    pub drawn: Plane,
    /// Dots that are not transparent, when the art has transparency.
    pub opaque: Option<Plane>,
    /// What was decided on the user's behalf, in sentences.
    pub notes: Vec<String>,
}

/// Reads art: several pictures named after their inks, a folder of them, a TIFF with named channels, an SVG with named
/// layers, a PDF or PostScript page, or one picture.
///
/// # Errors
/// With the file and what to do: damage, unknown inks, different sizes, no size, nothing in it.
pub fn open(paths: &[PathBuf], options: &Options, observer: &dyn Observer) -> Result<Artwork, LayersError> {
    let mut art = match paths {
        [] => {
            let reason = "no file was given".into();
            return Err(LayersError::Nothing { reason });
        }
        [folder] if folder.is_dir() => {
            let files = pictures_in(folder)?;
            // `.` has a name, too.
            let own = std::path::absolute(folder).unwrap_or_else(|_| folder.clone());
            named_files(&stem(&own), &files, options, observer)?
        }
        [file] => one(file, options, observer)?,
        files => named_files(&common_name(files), files, options, observer)?,
    };
    art.name.retain(|c| !c.is_control());
    if art.name.trim().is_empty() {
        art.name = "art".into();
    }
    for note in &art.notes {
        observer.note(note);
    }
    Ok(art)
}

/// Whether a path is clearly art for [`open`], by its name: a drawing or a page, a picture named after an ink, a folder of
/// such pictures. For those who were given it and expected something else.
pub fn is_art(path: &Path) -> bool {
    if path.is_dir() {
        return pictures_in(path)
            .is_ok_and(|files| files.iter().all(|file| names::ink(&stem(file)).is_some()));
    }
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    ["svg", "pdf", "ps", "eps"].contains(&extension.as_str())
        || PICTURES.contains(&extension.as_str()) && names::ink(&stem(path)).is_some()
}

/// Art from a page in memory, drawn at `dpi` pixels an inch: sRGB without transparency, three bytes a pixel, row by
/// row from the top.
///
/// # Errors
/// `rgb` of another size than `size`, or sides of no or more than 65535 dots.
pub fn page(
    name: &str,
    size: (usize, usize),
    dpi: u16,
    rgb: Vec<u8>,
    options: &Options,
) -> Result<Artwork, LayersError> {
    let problem = || raster::wrong(Path::new(name), format!("{} x {} pixels are no page", size.0, size.1));
    if Some(rgb.len()) != size.0.checked_mul(size.1).and_then(|pixels| pixels.checked_mul(3)) {
        return Err(problem());
    }
    let side = |pixels: usize| u32::try_from(pixels).map_err(|_| problem());
    let dots = page_dots(size, dpi.into()).ok_or_else(problem)?;
    Ok(colour::flat(name, name, (side(size.0)?, side(size.1)?), dots, rgb, options))
}

/// The dots of a page of so many pixels.
fn page_dots(pixels: (usize, usize), dpi: f64) -> Option<(usize, usize)> {
    let side = |pixels: usize| {
        let dots = (pixels as f64 * 600.0 / dpi).round();
        (1.0..=65535.0).contains(&dots).then_some(dots as usize)
    };
    Some((side(pixels.0)?, side(pixels.1)?))
}

fn one(file: &Path, options: &Options, observer: &dyn Observer) -> Result<Artwork, LayersError> {
    use std::io::Read;
    let mut start = Vec::new();
    let opened = std::fs::File::open(file).map_err(raster::io(file, "open it"))?;
    opened.take(1 << 12).read_to_end(&mut start).map_err(raster::io(file, "read it"))?;
    if start.starts_with(b"%PDF") || start.starts_with(b"%!") {
        return pdf::read(file, options, observer);
    }
    if (start.starts_with(b"II*\0") || start.starts_with(b"MM\0*"))
        && let Some(art) = tiff::spots(file, options)?
    {
        return Ok(art);
    }
    if svg::is_svg(&start) {
        return svg::read(file, options, observer);
    }
    if !options.reserved && names::ink(&stem(file)).is_some() {
        return named_files(&stem(file), &[file.to_path_buf()], options, observer);
    }
    if start.starts_with(b"\xff\xd8")
        && let Some(art) = cmyk::jpeg(file, options)?
    {
        return Ok(art);
    }
    let picture = colour::read(file)?;
    let mut art = colour::artwork(&stem(file), picture, options)?;
    if let Some(known) = names::closest(&stem(file)).filter(|_| !options.reserved) {
        art.notes.push(format!(
            "{}: printed as a picture in process inks; if it is a layer, name it {known}.png",
            file.display()
        ));
    }
    Ok(art)
}

/// The pictures in a folder, by name.
fn pictures_in(folder: &Path) -> Result<Vec<PathBuf>, LayersError> {
    const MOST: usize = 64;
    let listed = raster::io(folder, "list it");
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
        return Err(raster::wrong(
            folder,
            "there is no picture in the folder; name them white.png, gold.png, …",
        ));
    }
    if files.len() > MOST {
        return Err(raster::wrong(folder, format!("{} pictures are no layers of one sheet", files.len())));
    }
    files.sort();
    Ok(files)
}

/// One layer a file, each named after its ink.
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
    // Two at a time: both cores work and no more than two layers are in memory as bytes.
    for (files, named) in files.chunks(2).zip(named.chunks(2)) {
        let scans: Vec<_> = files.par_iter().map(|file| raster::scan(file)).collect();
        for (scan, named) in scans.into_iter().zip(named) {
            let scan = scan?;
            let dots = match &first {
                Some(first) => first.fits(&scan, options)?,
                None => first.insert(First::new(&scan, options, &mut notes)?).dots,
            };
            let file =
                scan.path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
            art.get_or_insert_with(|| Artwork::blank(name, dots)).add(scan, &file, *named, false, options);
            observer.advance(1);
        }
    }
    observer.end();
    // There is a file, so there is art.
    let mut art = art.ok_or_else(|| LayersError::Nothing { reason: "no file was given".into() })?;
    art.notes.splice(0..0, notes);
    Ok(art)
}

/// The first of several layers: the others must be of its size.
struct First {
    path: PathBuf,
    pixels: (u32, u32),
    density: Option<raster::Density>,
    size: String,
    dots: (usize, usize),
}

impl First {
    fn new(scan: &Scan, options: &Options, notes: &mut Vec<String>) -> Result<First, LayersError> {
        let sides = (f64::from(scan.width), f64::from(scan.height));
        Ok(First {
            path: scan.path.clone(),
            pixels: (scan.width, scan.height),
            density: scan.density,
            size: scan.size(),
            dots: raster::dots(&scan.path, sides, scan.density, Unstated::IsDots, options, notes)?,
        })
    }

    /// The size in dots, if another layer is of the same.
    fn fits(&self, other: &Scan, options: &Options) -> Result<(usize, usize), LayersError> {
        // A layer without a resolution follows the first; two that differ cannot both be right.
        let told = options.dpi.is_some() || options.size.is_some();
        let apart = self
            .density
            .zip(other.density)
            .is_some_and(|(a, b)| !told && ((a.0 - b.0).abs() > 0.5 || (a.1 - b.1).abs() > 0.5));
        if self.pixels == (other.width, other.height) && !apart {
            return Ok(self.dots);
        }
        Err(LayersError::Sizes {
            found: other.size(),
            path: other.path.clone(),
            first: self.path.clone(),
            expected: self.size.clone(),
        })
    }
}

impl Artwork {
    /// Art of so many dots on which nothing is drawn.
    fn blank(name: &str, (width, length): (usize, usize)) -> Artwork {
        Artwork {
            name: name.into(),
            width,
            length,
            layers: Vec::new(),
            colour: None,
            drawn: bits::blank(width, length),
            opaque: None,
            notes: Vec::new(),
        }
    }

    /// Adds a layer. `plate` says that the coverage is a printing plate's: process inks have tones, and blank plates are
    /// nothing to speak of.
    fn add(&mut self, scan: Scan, name: &str, named: names::Named, plate: bool, options: &Options) {
        if plate && scan.coverage.iter().all(|&c| c == 0) {
            return;
        }
        let (layer, mut notes) = layer(scan, name, named, plate, (self.width, self.length), options);
        match &layer.shape {
            Shape::Solid(plane) => bits::add(&mut self.drawn, plane),
            Shape::Tone(tones) => {
                bits::add(&mut self.drawn, &bits::from_bytes(self.width, tones, |c| c > PLAIN))
            }
        }
        self.layers.push(layer);
        self.notes.append(&mut notes);
    }
}

/// The ink that a layer, channel or plate of a file names. One that names none is left out with a note, unless it looks
/// like a slip of the pen.
fn named_part(
    path: &Path,
    name: &str,
    what: &str,
    notes: &mut Vec<String>,
) -> Result<Option<names::Named>, LayersError> {
    let named = names::ink(name);
    if named.is_none() {
        if let suggestion @ Some(_) = names::closest(name) {
            return Err(LayersError::UnknownInk { path: path.to_path_buf(), name: name.into(), suggestion });
        }
        notes.push(format!("{}: {what} `{name}` names no ink: left out", path.display()));
    }
    Ok(named)
}

/// A layer from its coverage, and what there is to say about it.
fn layer(
    scan: Scan,
    name: &str,
    named: names::Named,
    plate: bool,
    (width, length): (usize, usize),
    options: &Options,
) -> (Layer, Vec<String>) {
    let mut notes = Vec::new();
    match scan.by {
        Coverage::Dark => {}
        Coverage::Opaque => notes.push(format!("{name}: ink is where it is not transparent")),
        Coverage::DarkAndOpaque => notes.push(format!(
            "{name}: drawn in several colours on a transparent ground; ink is where it is dark, its light parts are left out"
        )),
    }
    let toned = plate && named.ink.kind() == Kind::Process && has_tones(&scan.coverage);
    if toned {
        notes.push(format!("{name}: the plate has tones, so it is printed as dots"));
    }
    let tones = toned || options.halftone.contains(named.ink);
    if !tones && (width, length) != (scan.width as usize, scan.height as usize) {
        notes.push(format!(
            "{name}: {} become {width} x {length} dots; at 600 dpi edges would be exactly as drawn",
            scan.size()
        ));
    }
    if !tones && let Some(note) = neither(name, &scan.coverage) {
        notes.push(note);
    }
    let coverage = raster::resample(scan.coverage, (scan.width, scan.height), (width, length));
    let layer =
        Layer { ink: named.ink, name: name.into(), place: named.place, shape: shape(width, coverage, tones) };
    if let Shape::Solid(plane) = &layer.shape
        && plane.dots() == 0
    {
        notes.push(format!("{}: nothing in it is dark enough to be ink; draw layers in black", layer.name));
    }
    (layer, notes)
}

/// Coverage as a layer's shape.
fn shape(width: usize, coverage: Vec<u8>, tones: bool) -> Shape {
    if tones {
        Shape::Tone(coverage)
    } else {
        Shape::Solid(bits::from_bytes(width, &coverage, |c| c >= THRESHOLD))
    }
}

/// What the threshold did to pixels that are neither ink nor paper, if there are any.
fn neither(name: &str, coverage: &[u8]) -> Option<String> {
    let between = coverage.par_iter().filter(|&&c| c > PLAIN && c < 255 - PLAIN).count();
    let inked = coverage.par_iter().filter(|c| (THRESHOLD..255 - PLAIN).contains(c)).count();
    let share = 100.0 * between as f64 / coverage.len().max(1) as f64;
    let advice = if share > 5.0 { "; if these are tones, not edges, print them with --halftone" } else { "" };
    (between > 0).then(|| {
        format!(
            "{name}: {between} pixels ({share:.2} %) are neither ink nor paper, such as anti-aliased edges; {inked} of \
             them are dark enough to be ink, the others are left out{advice}"
        )
    })
}

/// Whether coverage has tones, not only edges: more than a twentieth of what is not bare is neither full nor none.
fn has_tones(coverage: &[u8]) -> bool {
    let inked = coverage.par_iter().filter(|&&c| c > PLAIN).count();
    let between = coverage.par_iter().filter(|&&c| c > PLAIN && c < 255 - PLAIN).count();
    20 * between > inked
}

/// A file's name without its ending.
fn stem(path: &Path) -> String {
    path.file_stem().map_or_else(|| "art".into(), |stem| stem.to_string_lossy().into_owned())
}

/// What to call a job of several files: their folder, unless they lie in the current one.
fn common_name(files: &[PathBuf]) -> String {
    let folder = files[0].parent().filter(|parent| files.iter().all(|file| file.parent() == Some(parent)));
    folder
        .and_then(Path::file_name)
        .map_or_else(|| "layers".into(), |name| name.to_string_lossy().into_owned())
}

#[cfg(test)]
mod tests;
