//! From a picture to art: the names of its file and of its planes say which ink prints what.
//!
//! Problem: a picture is one layer, several plates, or colours for the process inks, and nothing in it says
//! so but names. Method: process plates and planes that name inks become layers, beside the colours if there
//! are any. A picture without planes is a layer if its file is named after an ink; if only a part of the name
//! is an ink, the picture must also look like a layer. All else is colour. Cost: that of what it becomes.
//! Limits: 16 layers are printed.

use std::path::{Path, PathBuf};

use observe::{Diagnosis, Fault};
use protocol::ink::Ink;
use readers::resolution::Dpi;
use readers::{Picture, Plane, PlaneKind, Process};

use crate::artwork::{Artwork, Layer};
use crate::error::{NamedPart, no_dot, nothing};
use crate::options::Options;
use crate::read::coverage::{Coverage, Scan};
use crate::read::cut_lines;
use crate::read::names::{self, Named, stem};
use crate::read::picture::{self, Looks};
use crate::read::size::{self, Unstated};

/// Whether an extra channel of this name is read as a plane: one of an ink, or one whose name is a slip of
/// one.
pub(crate) fn is_wanted(name: &str) -> bool {
    !cut_lines::is_cut(name) && (names::ink(name).is_some() || names::closest(name).is_some())
}

/// Art of one picture, or of the chosen page of one.
pub(crate) fn artwork(picture: Picture, options: &Options) -> Result<Artwork, Diagnosis> {
    if !picture.planes.is_empty() {
        return of_planes(picture, options);
    }
    let file = picture.name.clone();
    let name = stem(&file);
    let named = names::ink(&name).filter(|_| !options.reserves());
    let looks = named.map_or(Looks::Layer, |named| match picture::looks(picture.clone()) {
        Looks::Tones if options.tones.contains(named.ink) => Looks::Layer,
        looks => looks,
    });
    let is_exact = names::is_exact(&name);
    if let Some(named) = named
        && (looks == Looks::Layer || is_exact && names::is_whole(&name))
    {
        let mut layers = Layers::new(&name, None, options);
        let source = Source { page: options.page(), ..Source::of_file(&file, named) };
        layers.add(Scan::of_picture(picture), &source)?;
        let mut art = layers.artwork()?;
        if !is_exact || looks != Looks::Layer {
            art.notes.push(format!(
                "{} is printed as the layer {}, because of its name; rename it to print it as a picture",
                file.display(),
                named.ink.name()
            ));
        }
        return Ok(art);
    }
    let mut art = picture::artwork(picture, options)?;
    let close = || names::closest(&name).map(|known| (known, "its name is that of no ink"));
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

/// The ink of a process plate.
fn ink_of(plate: Process) -> Ink {
    match plate {
        Process::Cyan => Ink::Cyan,
        Process::Magenta => Ink::Magenta,
        Process::Yellow => Ink::Yellow,
        Process::Black => Ink::Black,
    }
}

/// Art of plates and spot channels, beside colours or alone.
fn of_planes(mut picture: Picture, options: &Options) -> Result<Artwork, Diagnosis> {
    let path = picture.name.clone();
    let (width, height) = picture.size;
    let mut notes = Vec::new();
    let planes = std::mem::take(&mut picture.planes);
    let named = |plane: &Plane| ink_of_plane(&path, plane, &mut notes);
    let inks: Vec<Option<Named>> = planes.iter().map(named).collect::<Result<_, _>>()?;
    if planes.iter().any(|plane| matches!(plane.kind, PlaneKind::Process(_))) {
        notes.push(of_cmyk(&path, picture.profile.is_some()));
    }
    let is_spot = |(plane, ink): (&Plane, &Option<Named>)| {
        ink.is_some() && matches!(plane.kind, PlaneKind::Plate { .. })
    };
    let spots = planes.iter().zip(&inks).any(is_spot);
    let unstated = if spots { Unstated::PixelPerDot } else { Unstated::FillRoom };
    let sides = (f64::from(width), f64::from(height));
    let dpi = picture.resolution;
    let dots = size::dots(&path, sides, dpi, unstated, options, &mut notes)?;
    let mut art = if picture.colours.is_none() {
        Artwork::blank(&stem(&path), dots)
    } else {
        picture.to_srgb()?;
        notes.append(&mut picture.notes);
        let mut art = picture::artwork_of(picture, dots, options);
        if let Some(colour) = art.colour.as_mut().filter(|_| art.layers.is_empty()) {
            // A spot channel lies under or over the picture, as it does with CMYK plates. A reserved colour stands instead of it.
            colour.overprints = true;
        }
        art
    };
    for (Plane { name, kind, samples }, named) in planes.into_iter().zip(inks) {
        if kind == PlaneKind::Opacity && samples.iter().any(|&a| a < 255) {
            art.opaque = Some(picture::plane_of::<1>(&samples, (width, height), dots, |&[a]| a > 0));
        }
        let Some(named) = named else { continue };
        let label = if matches!(kind, PlaneKind::Process(_)) { plate_of(named.ink) } else { name };
        let scan = Scan { path: path.clone(), width, height, dpi, coverage: samples, by: Coverage::Dark };
        art.add(scan, &label, named, true, options);
    }
    art.notes.append(&mut notes);
    Ok(art)
}

/// The ink that a plane prints, with notes on what is left out and on what was assumed.
fn ink_of_plane(path: &Path, plane: &Plane, notes: &mut Vec<String>) -> Result<Option<Named>, Diagnosis> {
    match plane.kind {
        PlaneKind::Process(plate) => Ok(Some(Named { place: None, ink: ink_of(plate) })),
        PlaneKind::Opacity => Ok(None),
        PlaneKind::Plate { .. } if cut_lines::is_cut(&plane.name) => {
            notes.push(cut_lines::note(&path.display(), "channel", &plane.name));
            Ok(None)
        }
        PlaneKind::Plate { inverted } => {
            let named = names::of_part(path, &plane.name, NamedPart::Channel, notes)?;
            if named.is_some() && inverted {
                let (path, name) = (path.display(), &plane.name);
                notes.push(format!("{path}: black is ink in channel `{name}`, as Photoshop displays it"));
            }
            Ok(named)
        }
    }
}

/// The name of a plate.
fn plate_of(ink: Ink) -> String {
    format!("the {} plate", ink.name())
}

/// A note on a CMYK picture.
fn of_cmyk(path: &Path, profile: bool) -> String {
    format!(
        "{}: CMYK, so its four plates are printed unchanged in cyan, magenta, yellow and black{}; convert it to sRGB to \
         match its colours to these inks",
        path.display(),
        if profile { ", without its colour profile, which describes other inks" } else { "" }
    )
}

/// Where a layer is, and its ink.
pub(crate) struct Source {
    /// Its file.
    pub path: PathBuf,
    /// Page of a TIFF.
    pub page: Option<u32>,
    /// What notes call it.
    pub label: String,
    pub named: Named,
}

impl Source {
    /// A file that is a layer.
    pub fn of_file(path: &Path, named: Named) -> Source {
        let label = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        Source { path: path.to_path_buf(), page: None, label, named }
    }
}

/// Layers that lie one on another pixel by pixel, so all have one size.
pub(crate) struct Layers<'a> {
    name: &'a str,
    options: &'a Options,
    /// The resolution of those that state none.
    stated: Option<Dpi>,
    first: Option<First>,
    art: Option<Artwork>,
    notes: Vec<String>,
}

impl Layers<'_> {
    /// No layer yet. `stated` is the resolution that any of them states, where it is known.
    pub fn new<'a>(name: &'a str, stated: Option<Dpi>, options: &'a Options) -> Layers<'a> {
        Layers { name, options, stated, first: None, art: None, notes: Vec::new() }
    }

    /// Whether this is the first layer that states a resolution, behind others.
    pub fn learns_of(&self, scan: &Scan) -> bool {
        scan.dpi.is_some() && self.first.as_ref().is_some_and(|first| first.dpi.is_none())
    }

    /// Adds a layer.
    ///
    /// # Errors
    /// Another size than that of the first, or a page with art that gets no dot of its ink.
    pub fn add(&mut self, mut scan: Scan, source: &Source) -> Result<(), Diagnosis> {
        scan.dpi = scan.dpi.or(self.stated);
        let dots = match &self.first {
            Some(first) => first.check(&scan, self.options)?,
            None => self.first.insert(First::new(&scan, self.options, &mut self.notes)?).dots,
        };
        let art = self.art.get_or_insert_with(|| Artwork::blank(self.name, dots));
        let drawn = source.page.is_some() && scan.coverage.iter().any(|&c| c > 0);
        art.add(scan, &source.label, source.named, false, self.options);
        if drawn && art.layers.last().is_none_or(Layer::is_blank) {
            return Err(no_dot(&source.path, &source.label, source.named.ink));
        }
        Ok(())
    }

    /// Art of all of them.
    ///
    /// # Errors
    /// There is none.
    pub fn artwork(self) -> Result<Artwork, Diagnosis> {
        let mut art = self.art.ok_or_else(|| nothing("no file was given"))?;
        art.notes.splice(0..0, self.notes);
        Ok(art)
    }
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
