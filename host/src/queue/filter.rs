//! The filter: pages in, jobs in the printer's language out, one for each sheet.
//!
//! Problem: the print system hands over PDF or pictures of pages, whole sheets with margins this machine cannot print on.
//! Method: a PDF is drawn by Ghostscript, row by row through a pipe; of each page the printable area is kept, and
//! becomes art as if it were a picture given to `foilpress layers`: black is solid black, reserved colours are inks of
//! their own if wanted, everything else is halftoned in process inks. What lies on the margins is told in millimetres.
//! Cost: the printable area at four bytes a pixel, and what [`layers`] costs.
//! Limits: sheets of the known papers, upright. Transparency is gone when a page has been drawn, so white cannot follow it.

use std::io::{self, BufReader, Read, Write};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use inks::{InkSet, Library};
use protocol::ink::Ink;
use protocol::paper::{LEFT, Paper};
use protocol::rgl::Page;

use super::options::{Choices, NoChoice};
use super::ppd;
use super::raster::{self, RasterError};
use crate::job::stream::{self, StreamError};
use crate::layers::{self, LayersError};
use crate::observe::Observer;
use crate::separate::{self, SeparateError, Severity};
use crate::sheet::{Sheet, SheetError};
use crate::simulate::Stock;

/// Pixels that differ from white by less than this are paper when margins are looked at.
const FAINT: u8 = 8;

/// Why a document is not printed.
#[derive(Debug, thiserror::Error)]
pub enum FilterError {
    /// The options of the job.
    #[error(transparent)]
    Choice(#[from] NoChoice),
    /// Neither PDF nor raster.
    #[error(
        "this is neither PDF nor PWG raster; the print system converts other files if its filters are installed"
    )]
    Kind,
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
    /// Raster pages.
    #[error(transparent)]
    Raster(#[from] RasterError),
    /// A page of no known size.
    #[error(
        "page {page} is {width:.0} x {length:.0} mm, which is none of the papers {}; choose one in the print dialog",
        ppd::papers()
    )]
    Paper {
        /// Page, from 1.
        page: usize,
        /// Its width in mm.
        width: f64,
        /// Its length in mm.
        length: f64,
    },
    /// The art.
    #[error("page {page}: {source}")]
    Layers {
        /// Page, from 1.
        page: usize,
        /// What is the matter.
        source: LayersError,
    },
    /// The rules of the inks.
    #[error("page {page} must not be printed: {why}")]
    Refused {
        /// Page, from 1.
        page: usize,
        /// The rule.
        why: String,
    },
    /// Its passes.
    #[error(transparent)]
    Separate(#[from] SeparateError),
    /// Its dots.
    #[error(transparent)]
    Sheet(#[from] SheetError),
    /// Its bytes.
    #[error(transparent)]
    Stream(#[from] StreamError),
}

fn io_error(what: &'static str) -> impl FnOnce(io::Error) -> FilterError {
    move |source| FilterError::Io { what, source }
}

/// Makes jobs of a document. A page on which nothing is drawn becomes no job, and is told.
///
/// `document` is read from its start; `file` is where it can be read again, if it is a file. Returns the number of jobs.
pub fn run(
    mut document: impl Read + Send + 'static,
    file: Option<&Path>,
    choices: &Choices,
    library: &Library,
    out: &mut dyn Write,
    observer: &dyn Observer,
) -> Result<usize, FilterError> {
    let mut head = [0; 4];
    document.read_exact(&mut head).map_err(io_error("read the document"))?;
    let mut press = Press { choices, library, out, observer, jobs: 0 };
    if head == raster::SYNC {
        let mut reader = raster::Reader::behind_sync(BufReader::with_capacity(1 << 16, document));
        let mut number = 0;
        while let Some(page) = reader.next_page()? {
            number += 1;
            let size = (page.width, page.height, page.dpi);
            let job = press.page(number, size, &mut |row| Ok(reader.row(row)?))?;
            for _ in 0..page.copies {
                press.write(&job)?;
            }
        }
    } else if head.starts_with(b"%PDF") || head.starts_with(b"%!") {
        let whole = io::Cursor::new(head).chain(document);
        let mut drawing = Drawing::begin(whole, file, choices.dpi)?;
        let mut number = 0;
        while let Some((width, height)) = drawing.next_page()? {
            number += 1;
            let job = press.page(number, (width, height, choices.dpi), &mut |row| {
                row.resize(3 * width, 0);
                drawing.pages.read_exact(row).map_err(io_error("read what Ghostscript draws"))
            })?;
            press.write(&job)?;
        }
        drawing.end()?;
    } else {
        return Err(FilterError::Kind);
    }
    press.out.flush().map_err(io_error("write the job"))?;
    Ok(press.jobs)
}

/// Ghostscript at work.
struct Drawing {
    child: Child,
    pages: BufReader<std::process::ChildStdout>,
    complaints: std::thread::JoinHandle<String>,
}

impl Drawing {
    fn begin(
        document: impl Read + Send + 'static,
        file: Option<&Path>,
        dpi: u16,
    ) -> Result<Drawing, FilterError> {
        let mut command = Command::new("gs");
        command
            .args(["-q", "-dSAFER", "-dBATCH", "-dNOPAUSE", "-dNOINTERPOLATE", "-sDEVICE=ppmraw"])
            .arg(format!("-r{dpi}"))
            .args(["-sstdout=%stderr", "-sOutputFile=%stdout", "-f"])
            .stdin(if file.is_some() { Stdio::null() } else { Stdio::piped() })
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        match file {
            Some(path) => command.arg(path),
            None => command.arg("-"),
        };
        let mut child = command.spawn().map_err(FilterError::NoGhostscript)?;
        if let Some(mut input) = child.stdin.take() {
            let mut document = document;
            // It says itself what it misses when the document is cut short.
            std::thread::spawn(move || io::copy(&mut document, &mut input));
        }
        let (Some(pages), Some(mut words)) = (child.stdout.take(), child.stderr.take()) else {
            return Err(FilterError::Ghostscript("its pipes cannot be had".into()));
        };
        let complaints = std::thread::spawn(move || {
            let mut text = String::new();
            let mut bytes = Vec::new();
            // Only the beginning is shown, but all is taken so that it never waits.
            if words.read_to_end(&mut bytes).is_ok() {
                text = String::from_utf8_lossy(&bytes).lines().take(3).collect::<Vec<_>>().join("; ");
            }
            text
        });
        Ok(Drawing { child, pages: BufReader::with_capacity(1 << 18, pages), complaints })
    }

    /// Width and height of the next page in pixels.
    fn next_page(&mut self) -> Result<Option<(usize, usize)>, FilterError> {
        let read = io_error("read what Ghostscript draws");
        let mut byte = [0];
        if self.pages.read(&mut byte).map_err(read)? == 0 {
            return Ok(None);
        }
        // `P6`, then width, height and depth apart by white space or comment lines, then one byte of white space.
        let mut numbers = Vec::new();
        let (mut word, mut comment, mut length) = (String::new(), false, 0);
        word.push(char::from(byte[0]));
        while numbers.len() < 4 {
            self.pages.read_exact(&mut byte).map_err(io_error("read what Ghostscript draws"))?;
            length += 1;
            match byte[0] {
                b'\n' if comment => comment = false,
                _ if comment => {}
                b'#' => comment = true,
                b if b.is_ascii_whitespace() && word.is_empty() => {}
                b if b.is_ascii_whitespace() => numbers.push(std::mem::take(&mut word)),
                b => word.push(char::from(b)),
            }
            if length > 4096 {
                break;
            }
        }
        let number = |at: usize| numbers.get(at).and_then(|word| word.parse::<usize>().ok());
        match (numbers.first().map(String::as_str), number(1), number(2), number(3)) {
            // The same bound as for raster pages.
            (Some("P6"), Some(w @ 1..=9000), Some(h @ 1..=9000), Some(255)) => Ok(Some((w, h))),
            (Some("P6"), Some(w), Some(h), Some(255)) => {
                Err(FilterError::Ghostscript(format!("a page of {w} x {h} pixels is larger than any sheet")))
            }
            _ => Err(FilterError::Ghostscript("it gave something that is no picture".into())),
        }
    }

    fn end(mut self) -> Result<(), FilterError> {
        let status = self.child.wait().map_err(io_error("wait for Ghostscript"))?;
        let words = self.complaints.join().unwrap_or_default();
        if status.success() { Ok(()) } else { Err(FilterError::Ghostscript(words)) }
    }
}

/// What makes jobs of pages.
struct Press<'a> {
    choices: &'a Choices,
    library: &'a Library,
    out: &'a mut dyn Write,
    observer: &'a dyn Observer,
    jobs: usize,
}

impl Press<'_> {
    fn write(&mut self, job: &[u8]) -> Result<(), FilterError> {
        if !job.is_empty() {
            self.out.write_all(job).map_err(io_error("write the job"))?;
            self.jobs += 1;
        }
        Ok(())
    }

    /// The job of a page, which gives its rows one after the other; empty if nothing is on it.
    fn page(
        &mut self,
        number: usize,
        (width, height, dpi): (usize, usize, u16),
        next_row: &mut dyn FnMut(&mut Vec<u8>) -> Result<(), FilterError>,
    ) -> Result<Vec<u8>, FilterError> {
        let points = |pixels: usize| pixels as f64 * 72.0 / f64::from(dpi);
        let paper = ppd::paper_of(points(width), points(height)).ok_or(FilterError::Paper {
            page: number,
            width: points(width) * 25.4 / 72.0,
            length: points(height) * 25.4 / 72.0,
        })?;
        let (rgba, beyond) = printable(paper, (width, height, dpi), next_row)?;
        if let Some(text) = beyond.words() {
            self.observer
                .note(&format!("page {number}: {text} lies on the margins, where this machine cannot print"));
        }
        let in_page = |source| FilterError::Layers { page: number, source };
        let choices = self.choices;
        // Black text is to be solid, whatever else is on the page.
        let mut spots = InkSet::EMPTY;
        if choices.colours.contains(Ink::Black) {
            spots = spots.with(Ink::Black);
        }
        if choices.spots {
            spots = layers::Options::default().inks;
        } else if choices.white == layers::White::Reserved {
            spots = spots.with(Ink::White);
        }
        let options = layers::Options {
            dpi: Some(f64::from(dpi)),
            reserved: !spots.is_empty(),
            inks: spots,
            ..layers::Options::default()
        };
        let (across, down) = (usize::from(paper.width()), usize::from(paper.length()));
        let size = (across * usize::from(dpi) / 600, down * usize::from(dpi) / 600);
        let name = format!("page {number}");
        let art = layers::picture(&name, size, rgba, &options).map_err(in_page)?;
        if art.drawn.dots() == 0 {
            self.observer.note(&format!("page {number} is blank; no sheet is made of it"));
            return Ok(Vec::new());
        }
        let inks = InkSet::of(spots.iter().chain(choices.colours.iter()).chain([Ink::White, Ink::Finish]));
        let settings = layers::Settings {
            inks,
            white: (choices.white != layers::White::None || !choices.spots).then_some(choices.white),
            finish: Some(choices.finish),
            ..layers::Settings::default()
        };
        let composed = layers::compose(&art, &settings, self.library, self.observer).map_err(in_page)?;
        for suggestion in &composed.suggestions {
            self.observer.note(&format!("page {number}: {}", suggestion.text));
        }
        let sheet = Sheet::new(paper, composed.piece.stacks().to_vec(), composed.piece.index().to_vec())?;
        let separation = separate::separate(&sheet, self.library.rules(), self.observer)?;
        if let Some(check) = separation.checks.iter().find(|check| check.severity == Severity::Error) {
            return Err(FilterError::Refused { page: number, why: check.with_stacks() });
        }
        let page =
            Page { media: choices.media, curl_correction: choices.curl_correction, ..Page::plain(paper) };
        let mut job = Vec::new();
        stream::write_job(page, None, &separation.passes, &mut job, self.observer)?;
        Ok(job)
    }
}

/// How far art reaches onto the margins, in pixels.
#[derive(Default)]
struct Beyond {
    sides: [usize; 4],
    dpi: u16,
}

impl Beyond {
    fn words(&self) -> Option<String> {
        let mm = |pixels: usize| pixels as f64 * 25.4 / f64::from(self.dpi);
        let said: Vec<String> = ["left", "top", "right", "bottom"]
            .iter()
            .zip(self.sides)
            .filter(|(_, pixels)| *pixels > 0)
            .map(|(side, pixels)| format!("{:.1} mm at the {side}", mm(pixels).max(0.1)))
            .collect();
        (!said.is_empty()).then(|| said.join(", "))
    }
}

/// The printable area of a page, opaque, four bytes a pixel, and what lies beyond it. A page that is a little smaller
/// than its paper is paper there.
fn printable(
    paper: Paper,
    (width, height, dpi): (usize, usize, u16),
    next_row: &mut dyn FnMut(&mut Vec<u8>) -> Result<(), FilterError>,
) -> Result<(Vec<u8>, Beyond), FilterError> {
    let scaled = |dots: u16| usize::from(dots) * usize::from(dpi) / 600;
    let (left, top) = (scaled(LEFT), scaled(paper.top()));
    let (across, down) = (scaled(paper.width()), scaled(paper.length()));
    // A page of another standard's size is as wide as its paper within 2 mm: what differs is at the right and below.
    debug_assert!(left + across <= scaled(Stock::of(paper).width));
    let mut rgba = vec![255; 4 * across * down];
    let mut beyond = Beyond { dpi, ..Beyond::default() };
    let drawn = |row: &[u8]| row.iter().any(|&v| v < 255 - FAINT);
    let mut row = Vec::new();
    for y in 0..height {
        next_row(&mut row)?;
        if y < top {
            if beyond.sides[1] == 0 && drawn(&row) {
                beyond.sides[1] = top - y;
            }
            continue;
        }
        if y - top >= down {
            if drawn(&row) {
                beyond.sides[3] = y - top - down + 1;
            }
            continue;
        }
        let inside = 3 * left.min(width)..3 * (left + across).min(width);
        let (before, behind) = (&row[..inside.start], &row[inside.end..]);
        if let Some(at) = before.iter().position(|&v| v < 255 - FAINT) {
            beyond.sides[0] = beyond.sides[0].max(left - at / 3);
        }
        if let Some(at) = behind.iter().rposition(|&v| v < 255 - FAINT) {
            beyond.sides[2] = beyond.sides[2].max(at / 3 + 1);
        }
        let out = &mut rgba[4 * across * (y - top)..][..4 * across];
        for (out, pixel) in out.as_chunks_mut::<4>().0.iter_mut().zip(row[inside].as_chunks::<3>().0) {
            out[..3].copy_from_slice(pixel);
        }
    }
    Ok((rgba, beyond))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inspect::{inspect, sheets};
    use crate::observe::Silent;
    use std::cell::RefCell;
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
        let usual = Choices::read(&[], None).unwrap();
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
    fn a_draft_is_the_same_page_at_half_the_resolution() {
        let usual = Choices::read(&[], None).unwrap();
        let (job, _) = filtered(raster(300, &[[500, 250, 700, 400]]), &usual);
        let seen = inspect(&job, &Silent);
        let bounds = seen.inspection.passes[0].bounds.unwrap();
        // The top margin is no whole number of these pixels.
        assert_eq!((bounds.x, bounds.width, bounds.height), (920, 400, 300));
        assert!(bounds.y.abs_diff(429) <= 1, "{bounds:?}");
    }

    #[test]
    fn the_choices_of_the_dialog_are_in_the_job() {
        let options = super::super::options::parse(
            "MediaType=Cardboard FoilpressCurl=Off FoilpressWhite=Under FoilpressFinish=All",
        );
        let choices = Choices::read(&options, None).unwrap();
        let (job, _) = filtered(raster(600, &[[1000, 500, 1400, 800]]), &choices);
        let seen = inspect(&job, &Silent).inspection;
        assert_eq!((seen.setup.media, seen.setup.curl_correction), (Some("cardboard"), Some(false)));
        let passes: Vec<(&str, u64)> = seen.passes.iter().map(|pass| (pass.ink, pass.dots)).collect();
        assert_eq!(passes, [("white", 400 * 300), ("black", 400 * 300), ("finish", 2202 * 3082)]);
    }

    #[test]
    fn what_lies_on_the_margins_is_told_in_millimetres() {
        let usual = Choices::read(&[], None).unwrap();
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
    fn a_page_of_no_known_paper_is_refused_with_its_size() {
        let read = RefCell::new(0);
        let usual = Choices::read(&[], None).unwrap();
        let library = Library::builtin();
        let mut press =
            Press { choices: &usual, library: &library, out: &mut io::sink(), observer: &Silent, jobs: 0 };
        let page = press.page(3, (1200, 1200, 600), &mut |_| {
            *read.borrow_mut() += 1;
            Ok(())
        });
        let error = page.unwrap_err().to_string();
        assert!(error.contains("page 3 is 51 x 51 mm") && error.contains("Postcard"), "{error}");
        assert_eq!(*read.borrow(), 0);
    }

    #[test]
    fn what_is_no_document_is_refused() {
        let usual = Choices::read(&[], None).unwrap();
        for wrong in [&b"GIF89a"[..], b"", b"%P"] {
            let result = run(
                io::Cursor::new(wrong.to_vec()),
                None,
                &usual,
                &Library::builtin(),
                &mut io::sink(),
                &Silent,
            );
            assert!(matches!(result, Err(FilterError::Kind | FilterError::Io { .. })));
        }
    }
}
