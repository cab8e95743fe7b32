//! Ghostscript at work: the pages of a document, row by row with the kind of each pixel, through a pipe.
//!
//! Problem: a page in pixels is 140 MB, and most of it is bare paper; written to disk and read back it
//! takes longer than it took to draw.
//! Method: one process draws the wanted pages, and [`Page`] keeps of the rows what matters while they
//! arrive. Whoever draws a page draws it so: layers, print queues and servers. A document that overprints
//! is drawn by two processes beside each other, one of which mixes what lies on each other as inks do
//! ([`Overprinted`]).
//! Cost: that of Ghostscript, beside it. Limits: each page has the time limit of [`process::limit`]; while
//! a page is printed there is none.

use std::io::{self, BufRead as _, BufReader, Read};
use std::path::Path;
use std::process::{ChildStdout, Stdio};

use super::conversion;
use super::draw::{Part, crop, pages};
use super::ghostscript::{self, Interpreter};
use crate::read::object_type::{self, Order};
use crate::read::page::Page;
use crate::read::process::{self, Process, ProcessError};
use files::scratch::Scratch;

/// Why there is no drawing.
#[derive(Debug, thiserror::Error)]
pub enum DrawError {
    /// The program that draws.
    #[error(transparent)]
    Process(#[from] ProcessError),
    /// A folder for its files.
    #[error("cannot make a folder for its pages")]
    Folder(#[source] io::Error),
    /// What it draws ends early or cannot be read.
    #[error("cannot read what Ghostscript draws")]
    Read(#[source] io::Error),
}

/// What is drawn of a document, and how.
#[derive(Clone, Copy)]
pub struct Drawing<'a> {
    /// Where it is.
    pub path: &'a Path,
    /// What reads it.
    pub interpreter: Interpreter,
    /// The first and the last page that are wanted, from 1; `None` for all.
    pub pages: Option<(u32, u32)>,
    /// What of each page is drawn.
    pub part: Part,
    /// Pixels an inch, across and down.
    pub dpi: (f64, f64),
    /// Whether something in it may overprint.
    pub overprints: bool,
    /// Whether bare paper is told apart from what is drawn in white.
    pub has_ground: bool,
}

/// Ghostscript at work.
pub struct Drawer {
    process: Process,
    pages: BufReader<ChildStdout>,
    /// Known from the first page on.
    order: Option<Order>,
    has_ground: bool,
    /// The same pages with what overprints.
    over: Option<Box<Drawer>>,
    /// Where the process runs, and keeps files of its own, which it leaves behind when it is stopped.
    _scratch: Scratch,
}

impl Drawer {
    /// Begins to draw.
    ///
    /// # Errors
    /// Ghostscript cannot be started.
    pub fn begin(drawing: &Drawing<'_>) -> Result<Drawer, DrawError> {
        let over = match drawing.overprints {
            true => Some(Box::new(Drawer::with(drawing, &conversion::OVERPRINT)?)),
            false => None,
        };
        Ok(Drawer { over, ..Drawer::with(drawing, &[])? })
    }

    /// Begins one process with these options.
    fn with(drawing: &Drawing<'_>, more: &[&str]) -> Result<Drawer, DrawError> {
        let &Drawing { path, interpreter, pages: wanted, part, dpi, has_ground, .. } = drawing;
        let scratch = Scratch::new().map_err(DrawError::Folder)?;
        conversion::write(scratch.path()).map_err(DrawError::Folder)?;
        let mut options = vec![
            format!("-sDEVICE={}", object_type::DEVICE),
            format!("-r{:.4}x{:.4}", dpi.0, dpi.1),
            "-sOutputFile=%stdout".into(),
            "-dTextAlphaBits=1".into(),
            "-dGraphicsAlphaBits=1".into(),
        ];
        options.extend(conversion::OPTIONS.iter().chain(more).map(|option| String::from(*option)));
        options.extend(wanted.map_or_else(Vec::new, pages));
        // What it runs stands last.
        options.extend(crop(path, part).map_err(DrawError::Folder)?);
        let mut command = ghostscript::command(path, interpreter, scratch.path(), options);
        command.stdout(Stdio::piped());
        let mut process = Process::start(&mut command, process::limit())?;
        let Some(pages) = process.output() else {
            return Err(ProcessError::Failed("its pipe cannot be had".into()).into());
        };
        // A page is 100 MB: through the usual 64 KB the two programs mostly wait for each other. What is
        // refused is slower.
        #[cfg(target_os = "linux")]
        let _ = rustix::pipe::fcntl_setpipe_size(&pages, 1 << 20);
        let pages = BufReader::with_capacity(1 << 18, pages);
        Ok(Drawer { process, pages, order: None, has_ground, over: None, _scratch: scratch })
    }

    /// Width and height of the next page in pixels, whatever they are.
    ///
    /// # Errors
    /// What is drawn ends early, or takes too long.
    pub fn next_page(&mut self) -> Result<Option<(usize, usize)>, DrawError> {
        self.process.advance();
        let size = object_type::header(&mut self.pages).map_err(|source| self.cut_short(source))?;
        if let Some(over) = &mut self.over
            && over.next_page()? != size
        {
            return Err(DrawError::Read(io::Error::other("two drawings of a page have different sizes")));
        }
        Ok(size)
    }

    /// The page of this size.
    ///
    /// # Errors
    /// What is drawn ends early, or takes too long.
    pub fn page(&mut self, size: (usize, usize)) -> Result<Page, DrawError> {
        let order = match (self.order, self.pages.fill_buf()) {
            (Some(order), _) => order,
            (None, Ok(begun)) => ghostscript::order(begun)?,
            (None, Err(source)) => return Err(self.cut_short(source)),
        };
        self.order = Some(order);
        let page = match &mut self.over {
            Some(over) => {
                let mut pages =
                    Overprinted { plain: &mut self.pages, over: &mut over.pages, order, read: Vec::new() };
                let page = Page::read(&mut pages, order, size, self.has_ground);
                over.process.pause();
                page
            }
            None => Page::read(&mut self.pages, order, size, self.has_ground),
        };
        let page = page.map_err(|source| self.cut_short(source))?;
        self.process.pause();
        Ok(page)
    }

    /// Why output ends early: the time limit, if that has passed.
    fn cut_short(&self, source: io::Error) -> DrawError {
        let over = || self.over.as_ref().and_then(|over| over.process.passed());
        self.process.passed().or_else(over).map_or(DrawError::Read(source), DrawError::Process)
    }

    /// Sees to it that all was drawn, and returns what Ghostscript said.
    ///
    /// # Errors
    /// It failed.
    pub fn end(self) -> Result<String, DrawError> {
        if let Some(over) = self.over {
            over.end()?;
        }
        self.process.advance();
        Ok(self.process.end(|| false)?)
    }
}

/// The least difference in light by which a dot is one that overprinting changes. Source: colours that go
/// through inks in 8 bits and back differ by up to .03; a test draws 17 x 17 x 17 colours.
const CHANGED: f32 = 0.05;

/// The pixels of a page as they are drawn, but where overprinting changes them: there they are mixed as inks.
struct Overprinted<'a> {
    plain: &'a mut BufReader<ChildStdout>,
    over: &'a mut BufReader<ChildStdout>,
    order: Order,
    read: Vec<u8>,
}

impl Read for Overprinted<'_> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        /// Pixels at once, so that they stay in the cache.
        const PIXELS: usize = 1 << 14;
        let whole = out.len().min(object_type::BYTES * PIXELS) / object_type::BYTES * object_type::BYTES;
        let out = &mut out[..whole];
        self.plain.read_exact(out)?;
        self.read.resize(whole, 0);
        self.over.read_exact(&mut self.read)?;
        let tag = self.order.tag();
        let light = |v: u8| appearance::srgb::decode(f32::from(v) / 255.0);
        for (pixel, over) in
            out.as_chunks_mut::<{ object_type::BYTES }>().0.iter_mut().zip(self.read.as_chunks().0)
        {
            let is_other = |at: usize| at != tag && (light(pixel[at]) - light(over[at])).abs() > CHANGED;
            if pixel != over && (0..object_type::BYTES).any(is_other) {
                *pixel = *over;
            }
        }
        Ok(whole)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::exports::pdf;
    use std::fmt::Write as _;
    use testing::needs::ghostscript;

    /// All nodes of a lattice of sRGB beside something that overprints.
    #[test]
    fn colours_beside_what_overprints_stay_as_they_are() {
        if !ghostscript() {
            return;
        }
        let level = |n: usize| (n * 255 / 16) as u8;
        let mut marks = String::new();
        // A point for each, in rows of 142 from the bottom.
        for at in 0..17 * 17 * 17 {
            let [r, g, b] = [at / 289, at / 17 % 17, at % 17].map(|n| f64::from(level(n)) / 255.0);
            writeln!(marks, "{r:.5} {g:.5} {b:.5} rg {} {} 1 1 re f", at % 142, at / 142).unwrap();
        }
        marks += "/G gs 0 0 1 0 k 0 60 9 5 re f 1 0 0 0 k 4 60 5 5 re f";
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("art.pdf");
        std::fs::write(&path, pdf(&[], &marks, "/ExtGState << /G << /OP true /op true /OPM 1 >> >>"))
            .unwrap();
        let drawn = |overprints: bool| {
            let drawing = Drawing {
                path: &path,
                interpreter: Interpreter::Usual,
                pages: None,
                part: Part::Sheet,
                dpi: (72.0, 72.0),
                overprints,
                has_ground: false,
            };
            let mut drawer = Drawer::begin(&drawing).unwrap();
            assert_eq!(drawer.next_page().unwrap(), Some((142, 85)));
            let page = drawer.page((142, 85)).unwrap();
            assert_eq!(drawer.next_page().unwrap(), None);
            drawer.end().unwrap();
            page.pixels()
        };
        let [plain, over] = [false, true].map(drawn);
        let at = |pixels: &[u8], x: usize, y: usize| -> [u8; 3] {
            std::array::from_fn(|c| pixels[4 * ((84 - y) * 142 + x) + 1 + c])
        };
        assert_eq!(
            [at(&over, 2, 62), at(&over, 6, 62)],
            [[255, 255, 0], [0, 255, 0]],
            "cyan over yellow is green"
        );
        assert_eq!(at(&plain, 6, 62), [0, 255, 255]);
        for n in 0..17 * 17 * 17 {
            let wanted = [n / 289, n / 17 % 17, n % 17].map(level);
            assert_eq!(at(&over, n % 142, n / 142), wanted);
        }
    }
}
