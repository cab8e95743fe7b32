//! Ghostscript at work: the pages of a document with the kind of each pixel, through a pipe.

use std::io::{self, BufRead as _, BufReader};
use std::path::Path;
use std::process::{ChildStdout, Stdio};

use art::Page;
use art::object_type::{self, Order};
use art::pdf::{self, Interpreter, conversion};
use art::process::{self, Process, ProcessError};
use files::scratch::Scratch;

use super::{FilterError, io_error};

/// Ghostscript at work. Each page has the time limit of [`process::limit`]; while a page is printed there is none.
pub(super) struct Drawing {
    process: Process,
    pages: BufReader<ChildStdout>,
    /// Known from the first page on.
    order: Option<Order>,
    /// Where the process runs, and keeps files of its own, which it leaves behind when it is stopped.
    _scratch: Scratch,
}

/// Why there is no drawing.
fn failed(error: ProcessError) -> FilterError {
    match error {
        ProcessError::Start(error) => FilterError::NoGhostscript(error),
        error => FilterError::Ghostscript(observe::with_causes(&error)),
    }
}

impl Drawing {
    /// Begins to draw a document, or one page of it.
    pub(super) fn begin(
        path: &Path,
        interpreter: Interpreter,
        page: Option<usize>,
        dpi: u16,
    ) -> Result<Drawing, FilterError> {
        let scratch = Scratch::new().map_err(io_error("make a temporary folder"))?;
        conversion::write(scratch.path()).map_err(io_error("keep the conversion of colours"))?;
        let options =
            [format!("-sDEVICE={}", object_type::DEVICE), format!("-r{dpi}"), "-sOutputFile=%stdout".into()];
        let page = page.map(|n| [format!("-dFirstPage={n}"), format!("-dLastPage={n}")]);
        let options = options
            .into_iter()
            .chain(conversion::OPTIONS.map(String::from))
            .chain(page.into_iter().flatten());
        let mut command = pdf::command(path, interpreter, scratch.path(), options);
        command.stdout(Stdio::piped());
        let mut process = Process::start(&mut command, process::limit()).map_err(failed)?;
        let Some(pages) = process.output() else {
            return Err(FilterError::Ghostscript("its pipe cannot be had".into()));
        };
        // A page is 100 MB: through the usual 64 KB the two programs mostly wait for each other. What is refused is slower.
        #[cfg(target_os = "linux")]
        let _ = rustix::pipe::fcntl_setpipe_size(&pages, 1 << 20);
        let pages = BufReader::with_capacity(1 << 18, pages);
        Ok(Drawing { process, pages, order: None, _scratch: scratch })
    }

    /// Width and height of the next page in pixels, whatever they are.
    pub(super) fn next_page(&mut self) -> Result<Option<(usize, usize)>, FilterError> {
        self.process.advance();
        object_type::header(&mut self.pages).map_err(|source| self.cut_short(source))
    }

    /// The page.
    pub(super) fn page(&mut self, size: (usize, usize)) -> Result<Page, FilterError> {
        let order = match (self.order, self.pages.fill_buf()) {
            (Some(order), _) => order,
            (None, Ok(begun)) => pdf::order(begun).map_err(failed)?,
            (None, Err(source)) => return Err(self.cut_short(source)),
        };
        self.order = Some(order);
        let page = Page::read(&mut self.pages, order, size).map_err(|source| self.cut_short(source))?;
        self.process.pause();
        Ok(page)
    }

    /// Why output ends early: the time limit, if that has passed.
    fn cut_short(&self, source: io::Error) -> FilterError {
        match self.process.passed() {
            Some(error) => failed(error),
            None => FilterError::Io { what: "read what Ghostscript draws", source },
        }
    }

    /// Sees to it that all was drawn, and returns what Ghostscript said.
    pub(super) fn end(self) -> Result<String, FilterError> {
        self.process.advance();
        self.process.end(|| false).map_err(failed)
    }
}
