//! The plates of a page: spot colours that name inks, and the process plates.
//!
//! Problem: a spot colour may name an ink, or none; and one colour may be made of several spots (DeviceN),
//! of which some name inks.
//! Method: Ghostscript makes a plate of every spot. A spot that names a special ink is a layer of it. Every
//! other spot is printed by its process colours: its plate is added to the process plates, in the shares
//! that Ghostscript gives for its full tint. So a colour of several spots keeps each part. A name that
//! resembles that of an ink is an error, because a slip would cost ribbon. The layers of art and the print
//! queues use the same two functions, [`survey`] and [`separated`]. If a process plate has a dot, the page
//! is drawn once more with the kind of each pixel, and what lies beside the layers is the same as on any
//! page. On dots of layers the process plates say what overprints. What is for a cutter is left out; marks
//! that every plate has are printed on the plates that have more than these. Clear inks knock nothing out,
//! whatever the document says: what lies beneath them is drawn again from a document in which they paint
//! nothing ([`without`]). What is drawn over white knocks it out unless the document says otherwise, which
//! is the default of layout programs: one more run, of a document in which all overprints
//! ([`overprinting`]), tells where white would be ([`White`]).
//! Cost: seconds a page, twice if it has colours, once more for clear ink, and for white. Limits: where a
//! spot overprints, tints between none and full are taken as proportional; clear ink of a program in
//! PostScript, and of an encrypted document, knocks out.

use std::fmt::Display;
use std::path::{Path, PathBuf};

use protocol::ink::{Ink, Kind};
use rayon::prelude::*;

use super::conversion;
use super::draw::{DRAFT, Leaf, PROCESS, Part, drafts, plates_beside, separate};
use super::drawer::{Drawer, Drawing};
use super::ghostscript::Interpreter;
use super::objects::{self, overprinting, without};
use super::{Suspected, undrawn};
use crate::artwork::{Above, Artwork};
use crate::error::{NamedPart, io, unknown_ink, wrong};
use crate::options::Options;
use crate::read::coverage::{Coverage, Scan};
use crate::read::cut_lines;
use crate::read::file;
use crate::read::names::{self, Named};
use crate::read::object_type;
use crate::read::page::Page;
use crate::read::picture;
use crate::read::size;
use crate::window::Window;
use files::scratch::Scratch;
use files::shelf::Disk;
use observe::{Diagnosis, Observer};

/// Full ink in what Ghostscript says of a spot. Source: `frac_1` in Ghostscript's `gxfrac.h`, 0x7ff8.
const FULL: f64 = 32760.0;

/// What becomes of a spot.
enum Spot {
    /// It is a layer of an ink.
    Layer(Named),
    /// It is printed by its process colours.
    Process,
    /// It is for a cutter and not printed.
    Cut,
}

/// What becomes of a spot. One that names a process ink is printed by its process colours, like one that
/// names no ink; of the latter there is a note, which begins with `place`.
///
/// # Errors
/// A name that resembles that of an ink.
fn spot(path: &Path, place: &dyn Display, spot: &str, notes: &mut Vec<String>) -> Result<Spot, Diagnosis> {
    if cut_lines::is_cut(spot) {
        notes.push(cut_lines::note(place, "spot colour", spot));
        return Ok(Spot::Cut);
    }
    match names::ink(spot) {
        Some(named) if named.ink.kind() != Kind::Process => Ok(Spot::Layer(named)),
        Some(_) => Ok(Spot::Process),
        None => match names::closest(spot) {
            suggestion @ Some(_) => Err(unknown_ink(path, NamedPart::Spot, spot, suggestion)),
            None => {
                notes.push(format!(
                    "{place}: spot colour `{spot}` names no ink: printed by its process colours"
                ));
                Ok(Spot::Process)
            }
        },
    }
}

/// Of these spots, those that have plates of their own: layers of ink, and what is for a cutter.
pub(super) fn layers(
    path: &Path,
    place: &dyn Display,
    spots: &[String],
    notes: &mut Vec<String>,
) -> Result<Vec<String>, Diagnosis> {
    let mut found = Vec::new();
    for name in spots {
        if !matches!(spot(path, place, name, notes)?, Spot::Process) {
            found.push(name.clone());
        }
    }
    Ok(found)
}

/// What drafts tell of a whole document.
pub struct Survey {
    /// Its pages; none if only its gradients were looked at.
    pub pages: Vec<Surveyed>,
    /// The interpreter that draws most of it.
    pub interpreter: Interpreter,
}

/// What a draft tells of a page.
pub struct Surveyed {
    /// Its spot colours that are layers of ink and not blank.
    pub spots: Vec<String>,
    /// Its width and length in inches.
    pub inches: (f64, f64),
}

/// Looks at this part of all pages of a document. Notes name the page of a spot colour that names no ink.
///
/// # Errors
/// A document that Ghostscript cannot read, no Ghostscript, or a name that resembles that of an ink.
pub fn survey(path: &Path, part: Part, observer: &dyn Observer) -> Result<Survey, Diagnosis> {
    let folder = Scratch::new().map_err(io(path, "make a folder for its plates"))?;
    let (drafts, interpreter) = drafts(path, None, part, &folder)?;
    let mut notes = Vec::new();
    let page = |leaf: &Leaf| {
        let spots = layers(path, &format_args!("page {}", leaf.number), &leaf.spots, &mut notes)?;
        Ok(Surveyed { spots, inches: (leaf.size.0 / DRAFT, leaf.size.1 / DRAFT) })
    };
    let pages = drafts.leaves.iter().map(page).collect::<Result<_, _>>()?;
    notes.iter().for_each(|note| observer.note(note));
    Ok(Survey { pages, interpreter })
}

/// A page as plates: one for each spot colour that is a layer of ink, and the process plates for the rest.
pub struct Separated {
    /// Pixels across and down.
    pub size: (usize, usize),
    plates: Vec<(String, Named, Vec<u8>)>,
    /// What is printed beside the plates, with the kind of each pixel.
    rest: Option<Vec<u8>>,
    /// The plates for a cutter.
    cuts: Vec<Vec<u8>>,
    white: Option<White>,
    notes: Vec<String>,
}

/// White beneath what is drawn over it and knocks it out.
struct White {
    /// Its plate as if nothing did.
    whole: Vec<u8>,
    /// What lies on the dots where that is more than the plate.
    above: Vec<Option<Above>>,
}

/// Separates this part of a page, by its number from 1, at `dpi` pixels per inch into plates for the spot
/// colours of [`survey`] and the process plates.
///
/// # Errors
/// As [`open`](crate::open()).
pub fn separated(
    path: &Path,
    interpreter: Interpreter,
    (page, part): (usize, Part),
    dpi: f64,
) -> Result<Separated, Diagnosis> {
    let page = u32::try_from(page).map_err(|_| wrong(path, format!("there is no page {page}")))?;
    let overprints = Suspected::of(path).map_err(io(path, "read it"))?.overprint;
    separated_part((path, interpreter), page, part, ((dpi, dpi), overprints))
}

/// The only page of a drawing, and its pixels across and down.
pub(super) fn drawn(path: &Path, drawing: &Drawing<'_>) -> Result<(Page, (usize, usize)), Diagnosis> {
    let failed = |error| undrawn(path, error);
    let mut drawer = Drawer::begin(drawing).map_err(failed)?;
    let none = || wrong(path, "its page cannot be drawn");
    let size = drawer.next_page().map_err(failed)?.ok_or_else(none)?;
    let side = |pixels| u32::try_from(pixels).map_err(|_| none());
    file::PICTURE.check(path, (side(size.0)?, side(size.1)?))?;
    let page = drawer.page(size).map_err(failed)?;
    drawer.end().map_err(failed)?;
    Ok((page, size))
}

pub(super) fn separated_part(
    (path, interpreter): (&Path, Interpreter),
    page: u32,
    part: Part,
    (dpi, overprints): ((f64, f64), bool),
) -> Result<Separated, Diagnosis> {
    let mut notes = Vec::new();
    let folder = Scratch::new().map_err(io(path, "make a folder for its plates"))?;
    let first = Plates::read(path, (path, interpreter), page, part, dpi, false)?;
    let clear = |(plate, coverage): &&(String, Vec<u8>)| is_clear(plate) && coverage.iter().any(|&c| c > 0);
    let clear: Vec<(String, Vec<u8>)> = first.all.iter().filter(clear).cloned().collect();
    // From here on, what is drawn is the document without its clear inks.
    let apart = match clear.is_empty() {
        true => None,
        false => changed(path, path, &folder, "apart.pdf", |object| without(object, is_clear))?,
    };
    let source = apart.as_deref().unwrap_or(path);
    let Plates { said, size: (width, height), all: mut found } = match &apart {
        Some(apart) => Plates::read(path, (apart, interpreter), page, part, dpi, false)?,
        None => first,
    };
    if apart.is_some() {
        found.retain(|(plate, _)| !is_clear(plate));
        found.extend(clear);
    }
    let white = found.iter().find(|(plate, _)| is_white(plate)).map(|(plate, _)| plate.clone());
    let (mut plates, mut process, mut others, mut cuts) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for (plate, coverage) in found {
        if PROCESS.contains(&plate.as_str()) {
            process.push((plate, coverage));
        } else if coverage.iter().any(|&c| c > 0) || is_white(&plate) {
            match spot(path, &path.display(), &plate, &mut notes)? {
                Spot::Layer(named) => plates.push((plate, named, coverage)),
                Spot::Process => others.push((plate, coverage)),
                Spot::Cut => cuts.push(coverage),
            }
        }
    }
    let mut all: Vec<&mut Vec<u8>> = Vec::new();
    all.extend(process.iter_mut().map(|(_, coverage)| coverage));
    all.extend(plates.iter_mut().map(|(_, _, coverage)| coverage));
    all.extend(others.iter_mut().map(|(_, coverage)| coverage));
    all.extend(&mut cuts);
    if unregistered(&mut all) {
        let place = path.display();
        notes.push(format!(
            "{place}: marks in the registration colour are printed in the inks that the page has anyway"
        ));
    }
    let white = match white {
        Some(name) if all_above(&process, &plates).next().is_some() => {
            let over = changed(path, source, &folder, "over.pdf", overprinting)?;
            let over = over.as_deref().unwrap_or(source);
            let again = Plates::read(path, (over, interpreter), page, part, dpi, true)?;
            let whole = again.all.into_iter().find(|(plate, _)| *plate == name);
            whole.and_then(|(_, whole)| White::new(whole, &process, &plates))
        }
        _ => None,
    };
    plates.retain(|(_, named, coverage)| {
        coverage.iter().any(|&c| c > 0) || named.ink == Ink::White && white.is_some()
    });
    for (spot, coverage) in others {
        match full_tint(&said, &spot) {
            Some(tint) => add(&mut process, &coverage, tint),
            None => notes.push(format!(
                "{}: the process colours of spot colour `{spot}` are not known: left out",
                path.display()
            )),
        }
    }
    let mut rest = None;
    if process.iter().any(|(_, coverage)| coverage.par_iter().any(|&c| c > 0)) {
        // Like that of a page without spots, so that a spot changes nothing elsewhere.
        let pages = Some((page, page));
        let drawing = Drawing { path: source, interpreter, pages, part, dpi, overprints, has_ground: false };
        let (drawn, size) = drawn(path, &drawing)?;
        if size != (width as usize, height as usize) {
            return Err(wrong(path, "a page differs in size from its plates"));
        }
        let mut pixels = drawn.pixels();
        // What is clear is not part of the picture.
        let is_drawn = |(plate, ..): &&(String, Named, Vec<u8>)| apart.is_none() || !is_clear(plate);
        let own = plates.iter().filter(is_drawn).map(|(.., coverage)| coverage).chain(&cuts);
        overprint(&mut pixels, &own.collect::<Vec<_>>(), &process);
        rest = Some(pixels);
    }
    let size = (width as usize, height as usize);
    Ok(Separated { size, plates, rest, cuts, white, notes })
}

/// Takes marks in the registration colour, which every plate has alike, off all plates that have nothing
/// else. Whether there were any on such a plate. A page of nothing but marks keeps them.
fn unregistered(plates: &mut [&mut Vec<u8>]) -> bool {
    let Some(((first, others), count)) = plates.split_first().zip(plates.first().map(|plate| plate.len()))
    else {
        return false;
    };
    if others.is_empty() {
        return false;
    }
    let marks: Vec<bool> = (0..count)
        .into_par_iter()
        .map(|at| first[at] > 0 && others.iter().all(|other| other[at] == first[at]))
        .collect();
    let only = |plate: &Vec<u8>| plate.par_iter().zip(&marks).all(|(&c, &mark)| c == 0 || mark);
    let bare: Vec<bool> = plates.iter().map(|plate| only(plate)).collect();
    if !marks.contains(&true) || bare.iter().all(|&bare| bare) {
        return false;
    }
    for (plate, _) in plates.iter_mut().zip(&bare).filter(|(_, bare)| **bare) {
        plate.fill(0);
    }
    bare.contains(&true)
}

/// Whether a plate is of an ink that covers nothing.
fn is_clear(plate: &str) -> bool {
    !cut_lines::is_cut(plate)
        && names::ink(plate).is_some_and(|named| matches!(named.ink.kind(), Kind::Finish | Kind::Primer))
}

fn is_white(plate: &str) -> bool {
    !cut_lines::is_cut(plate) && names::ink(plate).is_some_and(|named| named.ink == Ink::White)
}

/// A document with other objects, as a file in `folder`; `None` if nothing is changed.
fn changed(
    path: &Path,
    source: &Path,
    folder: &Scratch,
    name: &str,
    change: impl Fn(&[u8]) -> Option<Vec<u8>>,
) -> Result<Option<PathBuf>, Diagnosis> {
    let bytes = objects::bytes(source).map_err(io(path, "read it"))?;
    let Some(changed) = objects::changed(&bytes, change) else { return Ok(None) };
    let to = folder.path().join(name);
    std::fs::write(&to, changed).map_err(io(path, "keep a copy of it"))?;
    Ok(Some(to))
}

/// The plates that Ghostscript makes of a page.
struct Plates {
    /// What it says of them.
    said: String,
    size: (u32, u32),
    /// The name of each and its coverage, blank ones among them.
    all: Vec<(String, Vec<u8>)>,
}

impl Plates {
    /// Those of a page of `source`, which is `path` or made of it.
    fn read(
        path: &Path,
        source: (&Path, Interpreter),
        page: u32,
        part: Part,
        dpi: (f64, f64),
        overprints: bool,
    ) -> Result<Plates, Diagnosis> {
        let folder = Scratch::new().map_err(io(path, "make a folder for its plates"))?;
        let full = folder.path().join("page.tif");
        let said = separate(source, page, part, dpi, &full, overprints)?;
        let size = file::size(&full).ok_or_else(|| wrong(path, format!("there is no page {page}")))?;
        let mut all = Vec::new();
        for (plate, plate_file) in plates_beside(&full, &folder)? {
            let scan = Scan::of_picture(file::picture(&Disk, &plate_file, None)?);
            if (scan.width, scan.height) != size {
                return Err(wrong(
                    path,
                    format!("plate {plate} of page {page} differs in size from the page"),
                ));
            }
            all.push((plate, scan.coverage));
        }
        Ok(Plates { said, size, all })
    }
}

/// The plates that may lie over white, with what each has on its dots.
fn all_above<'a>(
    process: &'a [(String, Vec<u8>)],
    plates: &'a [(String, Named, Vec<u8>)],
) -> impl Iterator<Item = (Above, &'a Vec<u8>)> {
    let special = plates.iter().filter(|(plate, ..)| !is_white(plate) && !is_clear(plate));
    let special = special.map(|(_, named, coverage)| (Above::Ink(named.ink), coverage));
    let colours = process.iter().map(|(_, coverage)| (Above::Colours, coverage));
    special.chain(colours).filter(|(_, coverage)| coverage.par_iter().any(|&c| c > 0))
}

impl White {
    /// Of its plate as if nothing knocked it out; `None` if nothing does.
    fn new(
        whole: Vec<u8>,
        process: &[(String, Vec<u8>)],
        plates: &[(String, Named, Vec<u8>)],
    ) -> Option<White> {
        let (_, _, own) = plates.iter().find(|(plate, ..)| is_white(plate))?;
        if whole.len() != own.len() {
            return None;
        }
        let mut above = vec![None; whole.len()];
        let lying: Vec<(Above, &Vec<u8>)> = all_above(process, plates).collect();
        above.par_iter_mut().enumerate().filter(|(at, _)| whole[*at] > own[*at]).for_each(|(at, above)| {
            let found = lying.iter().find(|(_, coverage)| coverage[at] > 0);
            *above = Some(found.map_or(Above::Paper, |(above, _)| *above));
        });
        above.par_iter().any(Option::is_some).then_some(White { whole, above })
    }

    /// Adds the white to `coverage` that does not make room for what lies on it, and says of how many dots
    /// that is so; the dots of the rest are counted by what lies on them.
    fn kept(&self, coverage: &mut [u8], options: &Options) -> (u64, Vec<(Above, u64)>) {
        let (mut kept, mut lost) = (0, Vec::<(Above, u64)>::new());
        for ((coverage, &whole), above) in coverage.iter_mut().zip(&self.whole).zip(&self.above) {
            let Some(above) = *above else { continue };
            let is_kept = match above {
                Above::Colours => options.keep_white,
                Above::Ink(ink) => options.over_white.contains(ink),
                Above::Paper => false,
            };
            if is_kept {
                *coverage = whole;
                kept += 1;
            } else {
                match lost.iter_mut().find(|(known, _)| *known == above) {
                    Some((_, dots)) => *dots += 1,
                    None => lost.push((above, 1)),
                }
            }
        }
        lost.sort_unstable();
        (kept, lost)
    }
}

/// Replaces what was drawn on the dots of layers, where it shows the layer, with what the process plates
/// have there.
fn overprint(pixels: &mut [u8], layers: &[&Vec<u8>], process: &[(String, Vec<u8>)]) {
    const ROWS: usize = 1 << 16;
    let of = |name: &str| process.iter().find(|(plate, _)| plate == name).map(|(_, coverage)| &coverage[..]);
    let inks = PROCESS.map(of);
    // As what is drawn beside the layers is converted.
    let taken: [u8; 256] =
        std::array::from_fn(|ink| (255.0 * conversion::taken(ink as f64 / 255.0)).round() as u8);
    let taken = |ink: u8| taken[usize::from(ink)];
    pixels.par_chunks_mut(object_type::BYTES * ROWS).enumerate().for_each(|(block, pixels)| {
        for (at, pixel) in (block * ROWS..).zip(pixels.as_chunks_mut::<{ object_type::BYTES }>().0) {
            if layers.iter().any(|coverage| coverage[at] > 0) {
                let [c, m, y, k] = inks.map(|ink| ink.map_or(0, |coverage| coverage[at]));
                let [_, rgb @ ..] = pixel;
                *rgb = [c, m, y].map(|ink| 255 - taken(ink).saturating_add(taken(k)));
            }
        }
    });
}

/// The process colours of a spot's full tint, as shares from 0 to 1 in the order of [`PROCESS`], from what
/// Ghostscript says: `%%SeparationColor: "NAME" 100% ink = C M Y K CMYK`.
fn full_tint(said: &str, spot: &str) -> Option<[f64; 4]> {
    said.lines().find_map(|line| {
        let (name, rest) = line.strip_prefix("%%SeparationColor: \"")?.split_once("\" 100% ink = ")?;
        if name != spot {
            return None;
        }
        let shares: Vec<f64> = rest.split_whitespace().map_while(|word| word.parse().ok()).collect();
        let shares: [f64; 4] = shares.try_into().ok()?;
        Some(shares.map(|share| (share / FULL).clamp(0.0, 1.0)))
    })
}

/// Adds a spot's plate to the process plates.
fn add(process: &mut [(String, Vec<u8>)], coverage: &[u8], tint: [f64; 4]) {
    for (plate, dots) in process {
        let Some(at) = PROCESS.iter().position(|name| name == plate) else { continue };
        let share = (tint[at] * 256.0).round() as u32;
        if share == 0 {
            continue;
        }
        for (dot, &spot) in dots.iter_mut().zip(coverage).filter(|(_, spot)| **spot > 0) {
            *dot = (u32::from(*dot) + (u32::from(spot) * share + 128) / 256).min(255) as u8;
        }
    }
}

impl Separated {
    /// The names of the spot colours that are printed as inks of their own.
    pub fn spots(&self) -> impl Iterator<Item = &str> {
        let has_any = |(_, named, coverage): &&(String, Named, Vec<u8>)| {
            named.ink.kind() != Kind::Process
                && (coverage.iter().any(|&c| c > 0) || named.ink == Ink::White && self.white.is_some())
        };
        self.plates.iter().filter(has_any).map(|(plate, ..)| plate.as_str())
    }

    /// Whether anything is for a cutter.
    pub(super) fn has_cuts(&self) -> bool {
        !self.cuts.is_empty()
    }

    /// The smallest rectangle around everything drawn, in pixels; `None` for a blank page.
    pub fn bounds(&self) -> Option<Window> {
        let plates = self.plates.iter();
        plates
            .filter_map(|(.., coverage)| Window::around(coverage, self.size.0, 1, 0))
            .chain(self.rest.iter().filter_map(|pixels| object_type::bounds(pixels, self.size.0)))
            .reduce(|all, window| all.join(&window))
    }

    /// The page as art, a layer for each plate. It is printed at so many pixels an inch.
    ///
    /// # Errors
    /// A page of no dots, or of more than 65535 on a side.
    pub fn art(self, name: &str, dpi: f64, options: &Options) -> Result<Artwork, Diagnosis> {
        let empty = || wrong(Path::new(name), "the page has no dots");
        let dots = size::page_dots(self.size, dpi).ok_or_else(empty)?;
        Ok(self.art_of(name, dots, options))
    }

    /// The same with a dot for each pixel.
    pub(super) fn whole(self, name: &str, options: &Options) -> Artwork {
        let dots = self.size;
        self.art_of(name, dots, options)
    }

    fn art_of(self, name: &str, dots: (usize, usize), options: &Options) -> Artwork {
        // The plates were read from TIFF files, whose sides fit in u32.
        let size = (self.size.0 as u32, self.size.1 as u32);
        let mut art = match self.rest {
            None => Artwork::blank(name, dots),
            Some(pixels) => {
                picture::opaque_artwork::<{ object_type::BYTES }>(name, name, size, dots, pixels, options)
            }
        };
        if let Some(colour) = &mut art.colour {
            colour.overprints = true;
        }
        for (plate, named, mut coverage) in self.plates {
            if let (Ink::White, Some(white)) = (named.ink, &self.white) {
                (art.white_kept, art.knocked_out) = white.kept(&mut coverage, options);
            }
            let scan = Scan {
                path: name.into(),
                width: size.0,
                height: size.1,
                dpi: None,
                coverage,
                by: Coverage::Dark,
            };
            art.add(scan, &plate, named, true, options);
        }
        if options.cut_lines {
            self.cuts.iter().for_each(|cut| art.add_cut(cut));
        }
        art.notes.extend(self.notes);
        art
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_of_all_plates_are_taken_off_those_that_have_nothing_else() {
        let of = |plates: [[u8; 4]; 3]| {
            let mut plates = plates.map(Vec::from);
            let mut all: Vec<&mut Vec<u8>> = plates.iter_mut().collect();
            (unregistered(&mut all), plates.map(|plate| [plate[0], plate[1], plate[2], plate[3]]))
        };
        let black = [255, 0, 90, 0];
        assert_eq!(of([[255, 0, 0, 0], black, [255, 0, 0, 0]]), (true, [[0; 4], black, [0; 4]]));
        // Marks on plates that all have art, no marks, and nothing but marks.
        for plates in
            [[[255, 1, 0, 0], black, [255, 0, 0, 7]], [[0, 1, 0, 0], [0; 4], [0; 4]], [[255, 0, 0, 0]; 3]]
        {
            assert_eq!(of(plates), (false, plates));
        }
    }

    #[test]
    fn what_ghostscript_says_of_a_spot_becomes_shares() {
        let said = "noise\n%%SeparationColor: \"Die \"line\"\" 100% ink = 0 32760 16380 0 CMYK\n";
        assert_eq!(full_tint(said, "Die \"line\""), Some([0.0, 1.0, 0.5, 0.0]));
        assert_eq!(full_tint(said, "Die"), None);
        assert_eq!(full_tint("%%SeparationColor: \"a\" 100% ink = 0 x", "a"), None);
    }

    #[test]
    fn a_spots_plate_is_added_in_its_shares_and_no_plate_overflows() {
        let mut process: Vec<(String, Vec<u8>)> =
            PROCESS.iter().map(|name| ((*name).to_owned(), vec![0, 100, 200])).collect();
        add(&mut process, &[255, 100, 255], [0.0, 1.0, 0.5, 0.0]);
        let of = |name: &str| process.iter().find(|(plate, _)| plate == name).unwrap().1.clone();
        assert_eq!(of("Cyan"), [0, 100, 200]);
        assert_eq!(of("Magenta"), [255, 200, 255]);
        assert_eq!(of("Yellow"), [128, 150, 255]);
    }
}
