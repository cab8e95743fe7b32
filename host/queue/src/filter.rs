//! The filter: pages in, jobs in the printer's language out, one for each sheet.
//!
//! Problem: the print system hands over PDF or pictures of pages, of any size, with margins this printer
//! cannot print on.
//! Method: a PDF is drawn by Ghostscript, which also tells what drew each pixel; each page becomes art as if
//! it were a picture given to `foilpress layers`: text keeps its outline, reserved colours are inks of their
//! own if wanted, everything else is halftoned in process inks. A page with spot colours that name inks is
//! separated, too, and the plates of these are layers. The whole page is halftoned, as `foilpress layers`
//! does it, so both make the same dots. It is fitted to the sheet that is given, and drawn as large as it is
//! printed ([`press::layout::fit`]); a print queue's page has a sheet of its own size. What lies on the
//! margins is told in millimetres.
//! Cost: the page at a bit or four bytes a pixel, and what [`art`] costs; for documents that may have spot
//! colours, one more drawing of all pages at a low resolution; for those that may have gradients that
//! Ghostscript leaves out, a run without output; where pages get another scale than the one before, one more
//! start.
//! Limits: documents of 1 GB and 1000 pages. Transparency is gone when a page has been drawn, so white cannot
//! follow it.

mod page;

use std::io::{self, BufReader, Read, Write};
use std::path::Path;

use inks::Library;
use protocol::ink::Ink;
use tempfile::NamedTempFile;

use super::options::NoChoice;
use super::raster::{self, RasterError};
use art::pdf::{DrawError, Drawer, Drawing, Interpreter, Part, Survey, Suspected};
use art::process::{MOST_PAGES, ProcessError};
use make::options::{Choices, Spots, is_chosen};
use observe::{Diagnosis, Fault, Observer};
use page::{Laid, Of, Press};
use press::layout::Cut;
use press::layout::fit::FitError;
use press::pipeline::JobError;

/// The largest document.
pub const LARGEST: u64 = 1 << 30;

/// A page that is enlarged has at most the area of so many sheets. Source: at four bytes a dot, nine of A4 are
/// 1.1 GB.
const MOST_SHEETS: f64 = 9.0;

/// How pictures without a page begin, and how their files end.
const PICTURES: [(&[u8], &str); 2] = [(b"\xff\xd8\xff", ".jpg"), (b"\x89PNG", ".png")];

/// Why a document is not printed.
#[derive(Debug, thiserror::Error)]
pub enum FilterError {
    /// The options of the job.
    #[error(transparent)]
    Choice(#[from] NoChoice),
    /// A kind that is not read.
    #[error(
        "the document is neither PDF nor raster, JPEG or PNG; install the print system's filters to \
     convert other files"
    )]
    Kind,
    /// Nothing to print, as where no page was selected.
    #[error("the document is empty; select pages that it has")]
    Empty,
    /// Reading or writing.
    #[error("cannot {what}")]
    Io {
        /// What was tried.
        what: &'static str,
        /// What the system says.
        #[source]
        source: io::Error,
    },
    /// No Ghostscript.
    #[error("Ghostscript cannot be started; install it (Debian: apt install ghostscript)")]
    NoGhostscript(#[source] io::Error),
    /// It failed.
    #[error("Ghostscript could not draw the document: {0}")]
    Ghostscript(String),
    /// No page, as of a damaged or encrypted document.
    #[error("the document cannot be printed: {0}")]
    NoPage(String),
    /// Pages were chosen that it does not have; how many it has.
    #[error("there is nothing to print: the pages of the document are 1 to {0}, and none of them was chosen")]
    NotChosen(usize),
    /// Raster pages.
    #[error(transparent)]
    Raster(#[from] RasterError),
    /// A page of a size that the printer does not take.
    #[error("page {page} is {width:.0} x {length:.0} mm: {problem}; choose a paper in the print dialog")]
    Paper {
        /// Page, from 1.
        page: usize,
        /// Its width in mm.
        width: f64,
        /// Its length in mm.
        length: f64,
        /// Why the printer does not take it.
        problem: String,
    },
    /// A page that cannot be laid on the sheet.
    #[error("page {page} cannot be laid on the sheet")]
    Fit {
        /// Page, from 1.
        page: usize,
        /// Why not.
        source: FitError,
    },
    /// A page that would be drawn far larger than its sheet.
    #[error(
        "page {page} would be {width:.0} x {length:.0} mm as it is to be printed, more than {MOST_SHEETS} \
         sheets; make it smaller, or have it fitted to the sheet"
    )]
    Large {
        /// Page, from 1.
        page: usize,
        /// Its width in mm as it would be drawn.
        width: f64,
        /// Its length.
        length: f64,
    },
    /// Nothing to print, though something is drawn.
    #[error(
        "there is nothing to print: everything on page {page} lies on the margins, where the printer cannot print ({beyond}); move it \
         further in, have it fitted to the sheet, or print it in its middle with FoilpressPosition=Centre"
    )]
    Margins {
        /// Page, from 1.
        page: usize,
        /// How far it lies beyond what can be printed.
        beyond: Cut,
    },
    /// Foil without consent.
    #[error(
        "page {page} asks for {}; the ink codes of the foils are inferred and were never seen on hardware, so foil is \
         printed only with the option FoilpressFoils=On",
        .ink.name()
    )]
    Foil {
        /// Page, from 1.
        page: usize,
        /// The foil.
        ink: Ink,
    },
    /// The document.
    #[error("the document is larger than 1 GB; print fewer pages at once")]
    TooLarge,
    /// Its pages.
    #[error("the document has more than {MOST_PAGES} pages; print fewer at once")]
    TooManyPages,
    /// The plates of a document.
    #[error("cannot read the document's spot colours")]
    Plates(#[source] Diagnosis),
    /// A spot colour of which it is not clear whether it names an ink.
    #[error(
        "a spot colour of the document may be meant as an ink; FoilpressSpots=Off prints it in process inks"
    )]
    Spot(#[source] Diagnosis),
    /// The art.
    #[error("page {page} cannot be printed")]
    Layers {
        /// Page, from 1.
        page: usize,
        /// What is the matter.
        source: Diagnosis,
    },
    /// A page with more inks than the printer holds.
    #[error(
        "page {page} cannot be printed: {text}; FoilpressSpots=Off prints spot colours in process inks, and \
         FoilpressInks=NoBlack mixes other colours without black"
    )]
    Cartridges {
        /// Page, from 1.
        page: usize,
        /// What the rule says.
        text: String,
    },
    /// Its job.
    #[error("page {page} cannot be printed")]
    Job {
        /// Page, from 1.
        page: usize,
        /// What is the matter.
        source: JobError,
    },
}

fn io_error(what: &'static str) -> impl FnOnce(io::Error) -> FilterError {
    move |source| FilterError::Io { what, source }
}

/// Where a page lies on its sheet, in millimetres: its corner from that of the sheet, and its sides as they
/// are printed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lies {
    /// From the left.
    pub left: f64,
    /// From the top.
    pub top: f64,
    /// Width.
    pub width: f64,
    /// Length.
    pub length: f64,
}

/// What became of a document.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Filtered {
    /// Jobs that were written, one for each sheet.
    pub jobs: usize,
    /// How pages were turned, scaled and cut, in words.
    pub laid: Vec<String>,
    /// Whether anything that is drawn was cut.
    pub is_cut: bool,
    /// Where the first page lies that is printed, if it was laid on a sheet.
    pub lies: Option<Lies>,
}

/// Makes jobs of a document. A page on which nothing is drawn becomes no job, with a note.
///
/// `document` is read from its start; `file` is where it can be read again, if it is a file.
pub fn run(
    mut document: impl Read,
    file: Option<&Path>,
    choices: &Choices,
    library: &Library,
    out: &mut dyn Write,
    observer: &dyn Observer,
) -> Result<Filtered, FilterError> {
    let mut head = [0; 4];
    document.read_exact(&mut head).map_err(|error| match error.kind() {
        io::ErrorKind::UnexpectedEof => FilterError::Empty,
        _ => io_error("read the document")(error),
    })?;
    let mut press = Press::new((choices, library), out, observer);
    if head == raster::SYNC {
        pictures(raster::Reader::behind_sync(BufReader::with_capacity(1 << 16, document)), &mut press)?;
    } else if raster::APPLE.starts_with(&head) {
        let mut rest = [0; raster::APPLE.len() - 4];
        let read = document.read_exact(&mut rest);
        if read.is_err() || !raster::APPLE.ends_with(&rest) {
            return Err(FilterError::Kind);
        }
        let document = BufReader::with_capacity(1 << 16, document);
        pictures(raster::Reader::behind_apple(document)?, &mut press)?;
    } else if let Some((_, ending)) = PICTURES.iter().find(|(magic, _)| head.starts_with(magic)) {
        let job = match file {
            Some(path) => press.picture(path)?,
            None => press.picture(spooled(&mut head.chain(document), ending)?.path())?,
        };
        press.write(&job)?;
    } else if head.starts_with(b"%PDF") || head.starts_with(b"%!") {
        match file {
            Some(path) => pages(path, &mut press)?,
            None => pages(spooled(&mut head.chain(document), ".pdf")?.path(), &mut press)?,
        }
    } else {
        return Err(FilterError::Kind);
    }
    press.out.flush().map_err(io_error("write the job"))?;
    press.without_white();
    match press.in_margins {
        Some((page, beyond)) if press.jobs == 0 => Err(FilterError::Margins { page, beyond }),
        None if press.pages > 0 && !(1..=press.pages).any(|page| is_chosen(&choices.pages, page)) => {
            Err(FilterError::NotChosen(press.pages))
        }
        _ => Ok(press.filtered()),
    }
}

/// A document as a file, which Ghostscript would make of it, too.
fn spooled(document: &mut dyn Read, ending: &str) -> Result<NamedTempFile, FilterError> {
    let made = tempfile::Builder::new().suffix(ending).tempfile();
    let mut file = made.map_err(io_error("keep the document"))?;
    let length =
        io::copy(&mut document.take(LARGEST + 1), &mut file).map_err(io_error("keep the document"))?;
    if length > LARGEST { Err(FilterError::TooLarge) } else { Ok(file) }
}

/// Pictures of pages, from the print system.
fn pictures(mut reader: raster::Reader<impl Read>, press: &mut Press<'_>) -> Result<(), FilterError> {
    let (mut number, mut row) = (0, Vec::new());
    while let Some(page) = reader.next_page()? {
        number += 1;
        within_limit(number)?;
        let (size, dpi) = ((page.width, page.height), f64::from(page.dpi));
        let mut rgb = Vec::with_capacity(3 * page.width * page.height);
        for _ in 0..page.height {
            reader.row(&mut row)?;
            rgb.extend_from_slice(&row);
        }
        if !press.wants(number) {
            continue;
        }
        let laid = press.laid(number, mm(size, dpi), Of::Raster)?;
        let drawn = art::Page::plain(rgb, page.width);
        let (bounds, dpi) = (drawn.bounds(), dpi / laid.fit.scale);
        // Of a PDF the print system has mirrored the pages itself.
        let mirrored = press.choices.mirror;
        let art = |name: &str, options: &art::Options| drawn.art(name, dpi, options);
        let job = press.page(number, &laid, (size, dpi, bounds), mirrored, art)?;
        for _ in 0..page.copies {
            press.write(&job)?;
        }
    }
    Ok(())
}

/// Width and length of so many pixels in millimetres.
fn mm((width, height): (usize, usize), dpi: f64) -> (f64, f64) {
    (25.4 * width as f64 / dpi, 25.4 * height as f64 / dpi)
}

/// The pages of a PDF or PostScript file.
fn pages(path: &Path, press: &mut Press<'_>) -> Result<(), FilterError> {
    if let Some(doubt) = art::pdf::cut_short(path) {
        press.observer.note(&doubt);
    }
    let suspected = Suspected::of(path).map_err(io_error("read the document"))?;
    let whole = |interpreter| Survey { pages: Vec::new(), interpreter };
    let Survey { pages, interpreter } = match press.choices.spots {
        Spots::None if suspected.gradients => whole(art::pdf::interpreter(path)),
        Spots::None => whole(Interpreter::Usual),
        _ if suspected.spots => art::pdf::survey(path, press.part(), press.observer).map_err(|error| {
            match of_document(error) {
                error if error.fault() == Fault::Name => FilterError::Spot(error),
                error => FilterError::Plates(error),
            }
        })?,
        _ if suspected.gradients => whole(art::pdf::interpreter(path)),
        _ => whole(Interpreter::Usual),
    };
    if interpreter == Interpreter::Older {
        press.observer.note(art::pdf::OLDER);
    }
    if pages.iter().all(|page| page.spots.is_empty()) {
        return drawn((path, interpreter), (None, suspected.overprint), press);
    }
    for (number, surveyed) in (1..).zip(&pages) {
        if !press.wants(number) {
            continue;
        }
        if surveyed.spots.is_empty() {
            drawn((path, interpreter), (Some(number), suspected.overprint), press)?;
            continue;
        }
        // To a dot, as other pages are measured.
        let dpi = f64::from(press.choices.dpi);
        let size = mm((side(dpi * surveyed.inches.0), side(dpi * surveyed.inches.1)), dpi);
        let laid = press.laid(number, size, Of::Document)?;
        let in_page = |error| FilterError::Layers { page: number, source: of_document(error) };
        let part = press.part();
        let page =
            art::pdf::separated(path, interpreter, (number, part), dpi * laid.fit.scale).map_err(in_page)?;
        let spots: Vec<&str> = page.spots().collect();
        if !spots.is_empty() {
            press.observer.note(&format!("page {number}: {} printed as inks", spots.join(", ")));
        }
        let (size, bounds) = (page.size, page.bounds());
        let art = |name: &str, options: &art::Options| page.art(name, dpi, options).map_err(of_document);
        let job = press.page(number, &laid, (size, dpi, bounds), false, art)?;
        press.write(&job)?;
    }
    Ok(())
}

/// So many pixels, as whole ones.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a cast of floats saturates")]
fn side(pixels: f64) -> usize {
    pixels.round() as usize
}

/// An error without the name of the file where the document is kept, which its owner never sees.
fn of_document(error: Diagnosis) -> Diagnosis {
    error.calling_it("this document")
}

/// Refuses a document that shows pages for ever.
fn within_limit(number: usize) -> Result<(), FilterError> {
    if number > MOST_PAGES as usize { Err(FilterError::TooManyPages) } else { Ok(()) }
}

/// Pages as Ghostscript draws them, or one of them.
fn drawn(
    (path, interpreter): (&Path, Interpreter),
    (only, overprints): (Option<usize>, bool),
    press: &mut Press<'_>,
) -> Result<(), FilterError> {
    let dpi = f64::from(press.choices.dpi);
    let first = only.unwrap_or(1);
    // Pages from a number on, drawn so many times as large.
    let begin = |number: usize, scale: f64, part: Part| {
        let page = |number: usize| u32::try_from(number).unwrap_or(u32::MAX);
        let last = only.map_or(MOST_PAGES + 1, page);
        Drawer::begin(&Drawing {
            path,
            interpreter,
            pages: Some((page(number), last)).filter(|_| only.is_some() || number > 1),
            part,
            dpi: (dpi * scale, dpi * scale),
            overprints,
            // Print systems draw sheets, not transparent ones.
            has_ground: false,
        })
    };
    let (mut number, mut scale) = (first, 1.0);
    let mut drawer = begin(number, scale, press.part()).map_err(undrawn)?;
    // How a page is laid that is drawn again, for its size is known best before that.
    let mut known: Option<Laid> = None;
    while let Some(size) = drawer.next_page().map_err(undrawn)? {
        within_limit(number)?;
        if !press.wants(number) {
            drawer.page(size).map_err(undrawn)?;
            number += 1;
            continue;
        }
        let laid = match known.take() {
            Some(laid) => laid,
            None => {
                let laid = press.laid(number, mm(size, dpi * scale), Of::Document)?;
                // A page is as large as it should be if it is so to a pixel.
                let pixel = 1.0 / size.0.max(size.1).max(1) as f64;
                if (laid.fit.scale / scale - 1.0).abs() > pixel {
                    scale = laid.fit.scale;
                    drawer = begin(number, scale, press.part()).map_err(undrawn)?;
                    known = Some(laid);
                    continue;
                }
                laid
            }
        };
        let page = drawer.page(size).map_err(undrawn)?;
        let bounds = page.bounds();
        let art = |name: &str, options: &art::Options| page.art(name, dpi, options);
        let job = press.page(number, &laid, (size, dpi, bounds), false, art)?;
        press.write(&job)?;
        number += 1;
    }
    let said = drawer.end().map_err(undrawn)?;
    if number == first {
        return Err(FilterError::NoPage(art::pdf::no_page(
            &said,
            only.and_then(|page| u32::try_from(page).ok()),
        )));
    }
    if let Some(damage) = art::pdf::damaged(&said) {
        press.observer.note(&damage);
    }
    Ok(())
}

/// Why there is no drawing.
fn undrawn(error: DrawError) -> FilterError {
    match error {
        DrawError::Process(ProcessError::Start(error)) => FilterError::NoGhostscript(error),
        DrawError::Process(ProcessError::Failed(why)) => match art::pdf::impossible_size(&why) {
            Some(size) => FilterError::NoPage(size),
            None => FilterError::Ghostscript(observe::with_causes(&ProcessError::Failed(why))),
        },
        DrawError::Process(error) => FilterError::Ghostscript(observe::with_causes(&error)),
        DrawError::Folder(source) => FilterError::Io { what: "make a temporary folder", source },
        DrawError::Read(source) => FilterError::Io { what: "read what Ghostscript draws", source },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::{parse, read};
    use observe::Silent;
    use press::inspect::{inspect, sheets};
    use std::sync::Mutex;

    /// Keeps what is told.
    #[derive(Default)]
    struct Notes(Mutex<Vec<String>>);

    impl Observer for Notes {
        fn begin(&self, _: &str, _: u64) {}
        fn advance(&self, _: u64) {}
        fn end(&self) {}
        fn note(&self, text: &str) {
            self.0.lock().unwrap().push(text.into());
        }
    }

    /// A whole postcard, white but for black rectangles (x0, y0, x1, y1) in pixels of the sheet.
    fn raster(dpi: u32, black: &[[usize; 4]]) -> Vec<u8> {
        let (width, height) = (2362 * dpi / 600, 3496 * dpi / 600);
        let mut stream = b"RaS2".to_vec();
        let mut header = vec![0; 1796];
        let fields = [
            (276, dpi),
            (280, dpi),
            (372, width),
            (376, height),
            (384, 8),
            (388, 8),
            (392, width),
            (400, 18),
        ];
        for (at, value) in fields {
            header[at..at + 4].copy_from_slice(&value.to_be_bytes());
        }
        stream.extend(header);
        for y in 0..height as usize {
            let row: Vec<u8> = (0..width as usize)
                .map(|x| {
                    if black.iter().any(|&[x0, y0, x1, y1]| (x0..x1).contains(&x) && (y0..y1).contains(&y)) {
                        0
                    } else {
                        255
                    }
                })
                .collect();
            stream.push(0);
            for part in row.chunks(128).filter(|part| part.len() > 1) {
                stream.push((257 - part.len()) as u8);
                stream.extend(part);
            }
            if row.len() % 128 == 1 {
                stream.extend([0, row[row.len() - 1]]);
            }
        }
        stream
    }

    fn filtered(stream: Vec<u8>, choices: &Choices) -> (Vec<u8>, Vec<String>) {
        let (mut out, notes) = (Vec::new(), Notes::default());
        run(io::Cursor::new(stream), None, choices, &Library::builtin(), &mut out, &notes).unwrap();
        (out, notes.0.into_inner().unwrap())
    }

    #[test]
    fn a_page_becomes_its_dots_without_the_margins_and_blank_pages_become_nothing() {
        let usual = read(&[], None).unwrap();
        let pages = [raster(600, &[[1000, 500, 1400, 800]]), raster(600, &[])[4..].to_vec()].concat();
        let (job, notes) = filtered(pages, &usual);
        assert_eq!(sheets(&job).len(), 1);
        let seen = inspect(&job, &Silent);
        assert!(seen.inspection.complete);
        assert_eq!(seen.inspection.setup.paper, Some("postcard"));
        let [pass] = &seen.inspection.passes[..] else { panic!("{:?}", seen.inspection.passes) };
        let bounds = pass.bounds.unwrap();
        // A postcard's margins are 80 dots at the left and 71 at the top.
        assert_eq!(
            (pass.ink, bounds.x, bounds.y, bounds.width, bounds.height),
            ("black", 920, 429, 400, 300)
        );
        assert_eq!(pass.dots, 400 * 300);
        assert!(notes.iter().any(|note| note.contains("page 2 is blank")), "{notes:?}");
    }

    #[test]
    fn pages_that_the_document_does_not_have_are_not_called_blank() {
        let usual = read(&[], None).unwrap();
        let pages =
            [raster(300, &[[500, 250, 700, 400]]), raster(300, &[[500, 250, 700, 400]])[4..].to_vec()];
        let chosen = |pages: &[u8], chosen| {
            let choices = Choices { pages: vec![chosen], ..usual.clone() };
            run(io::Cursor::new(pages), None, &choices, &Library::builtin(), &mut Vec::new(), &Silent)
        };
        assert!(matches!(chosen(&pages.concat(), 3..=9), Err(FilterError::NotChosen(2))));
        assert!(matches!(chosen(&pages.concat(), 2..=9), Ok(Filtered { jobs: 1, .. })));
        assert!(matches!(chosen(b"\x89PNG\r\n", 2..=2), Err(FilterError::NotChosen(1))));
    }

    #[test]
    fn a_draft_is_the_same_page_at_half_the_resolution() {
        let usual = read(&[], None).unwrap();
        let (job, _) = filtered(raster(300, &[[500, 250, 700, 400]]), &usual);
        let seen = inspect(&job, &Silent);
        let bounds = seen.inspection.passes[0].bounds.unwrap();
        // The top margin is no whole number of these pixels.
        assert_eq!((bounds.x, bounds.width, bounds.height), (920, 400, 300));
        assert!(bounds.y.abs_diff(429) <= 1, "{bounds:?}");
    }

    #[test]
    fn the_choices_of_the_dialog_are_in_the_job() {
        let options = parse("MediaType=Cardboard FoilpressCurl=Off FoilpressWhite=Under FoilpressFinish=All");
        let choices = read(&options, None).unwrap();
        let (job, _) = filtered(raster(600, &[[1000, 500, 1400, 800]]), &choices);
        let seen = inspect(&job, &Silent).inspection;
        assert_eq!((seen.setup.media, seen.setup.curl_correction), (Some("cardboard"), Some(false)));
        let passes: Vec<(&str, u64)> = seen.passes.iter().map(|pass| (pass.ink, pass.dots)).collect();
        assert_eq!(passes, [("white", 400 * 300), ("black", 400 * 300), ("finish", 2202 * 3082)]);
    }

    #[test]
    fn colours_that_the_user_names_are_inks_of_their_own() {
        let passes = |options: &str| {
            let choices = read(&parse(options), None).unwrap();
            let (job, _) = filtered(raster(600, &[[1000, 500, 1400, 800]]), &choices);
            let passes = inspect(&job, &Silent).inspection.passes;
            passes.iter().map(|pass| (pass.ink, pass.dots)).collect::<Vec<_>>()
        };
        assert_eq!(passes("FoilpressColour=#000000=gold"), [("metallic-gold", 400 * 300)]);
        assert_eq!(passes("FoilpressColour=Custom.ff0000=white,000000=gold"), [("metallic-gold", 400 * 300)]);
        // 20 steps beside the black of the page.
        assert_eq!(passes("FoilpressColour=#141414=gold"), [("black", 400 * 300)]);
        let near = "FoilpressColour=#141414=gold FoilpressTolerance=20";
        assert_eq!(passes(near), [("metallic-gold", 400 * 300)]);
    }

    #[test]
    fn a_page_that_comes_as_a_picture_is_mirrored_about_its_middle_and_moved_where_it_is_wanted() {
        let place = |options: &str| {
            let choices = read(&parse(options), None).unwrap();
            let (job, _) = filtered(raster(600, &[[1000, 500, 1400, 800]]), &choices);
            let bounds = inspect(&job, &Silent).inspection.passes[0].bounds.unwrap();
            assert_eq!((bounds.width, bounds.height), (400, 300));
            (bounds.x, bounds.y)
        };
        assert_eq!(place(""), (920, 429));
        // What is 920 dots from the left of 2202 is as far from the right.
        assert_eq!(place("MirrorPrint=True"), (2202 - 920 - 400, 429));
        // An inch and two from the corner of the sheet.
        assert_eq!(place("FoilpressPosition=1x2in"), (600 - 80, 1200 - 71));
        assert_eq!(place("FoilpressPosition=Centre"), ((2202 - 400) / 2, (3082 - 300) / 2));
        assert_eq!(place("FoilpressPosition=1x2in mirror=true"), (600 - 80, 1200 - 71));
    }

    #[test]
    fn what_lies_on_the_margins_is_told_in_millimetres() {
        let usual = read(&[], None).unwrap();
        // 71 rows at the top, 80 dots at the left; 2 mm are 47 dots.
        let marks = [[1000, 71 - 47, 1100, 300], [80 - 47, 1000, 200, 1100]];
        let (_, notes) = filtered(raster(600, &marks), &usual);
        assert!(
            notes
                .iter()
                .any(|note| note.contains("2.0 mm at the left, 2.0 mm at the top lies on the margins")),
            "{notes:?}"
        );
    }

    #[test]
    fn a_page_that_does_not_go_in_is_refused_with_its_size() {
        let usual = read(&[], None).unwrap();
        let (library, mut out) = (Library::builtin(), io::sink());
        let press = Press::new((&usual, &library), &mut out, &Silent);
        let error = press.laid(3, (297.0, 210.0), Of::Document).unwrap_err().to_string();
        assert!(error.contains("page 3 is 297 x 210 mm") && error.contains("215.9 x 355.6 mm"), "{error}");
    }

    #[test]
    fn what_is_no_document_is_refused() {
        let usual = read(&[], None).unwrap();
        for wrong in [&b"GIF89a"[..], b"", b"%P"] {
            let result = run(
                io::Cursor::new(wrong.to_vec()),
                None,
                &usual,
                &Library::builtin(),
                &mut io::sink(),
                &Silent,
            );
            assert!(matches!(result, Err(FilterError::Kind | FilterError::Empty)));
        }
    }
}
