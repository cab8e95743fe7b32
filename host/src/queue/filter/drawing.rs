//! Ghostscript at work: the pages of a document as pictures, through a pipe.

use std::io::{BufReader, Read};
use std::path::Path;
use std::process::{ChildStdout, Command, Stdio};

use press::process::{self, Process, ProcessError};

use super::FilterError;

/// Ghostscript at work. Each page has the time limit of [`process::limit`]; while a page is printed there is none.
pub(super) struct Drawing {
    process: Process,
    pages: BufReader<ChildStdout>,
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
    pub(super) fn begin(path: &Path, page: Option<usize>, dpi: u16) -> Result<Drawing, FilterError> {
        let mut command = Command::new("gs");
        command
            .args(["-q", "-dSAFER", "-dBATCH", "-dNOPAUSE", "-dNOINTERPOLATE", "-sDEVICE=ppmraw"])
            .args(page.into_iter().flat_map(|n| [format!("-dFirstPage={n}"), format!("-dLastPage={n}")]))
            .arg(format!("-r{dpi}"))
            .args(["-sstdout=%stderr", "-sOutputFile=%stdout", "-f"])
            .arg(path)
            .stdout(Stdio::piped());
        let mut process = Process::start(&mut command, process::limit()).map_err(failed)?;
        let Some(pages) = process.output() else {
            return Err(FilterError::Ghostscript("its pipe cannot be had".into()));
        };
        // A page is 100 MB: through the usual 64 KB the two programs mostly wait for each other. What is refused is slower.
        #[cfg(target_os = "linux")]
        let _ = rustix::pipe::fcntl_setpipe_size(&pages, 1 << 20);
        Ok(Drawing { process, pages: BufReader::with_capacity(1 << 18, pages) })
    }

    /// Width and height of the next page in pixels.
    pub(super) fn next_page(&mut self) -> Result<Option<(usize, usize)>, FilterError> {
        self.process.advance();
        let mut byte = [0];
        let cannot = |source| FilterError::Io { what: "read what Ghostscript draws", source };
        if self.pages.read(&mut byte).map_err(cannot)? == 0 {
            return Ok(None);
        }
        // `P6`, then width, height and depth apart by white space or comment lines, then one byte of white space.
        let mut numbers = Vec::new();
        let (mut word, mut comment, mut length) = (String::new(), false, 0);
        word.push(char::from(byte[0]));
        while numbers.len() < 4 {
            self.read(&mut byte)?;
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

    /// The pixels of the page, red, green and blue, row by row.
    pub(super) fn pixels(&mut self, (width, height): (usize, usize)) -> Result<Vec<u8>, FilterError> {
        let mut rgb = vec![0; 3 * width * height];
        self.read(&mut rgb)?;
        self.process.pause();
        Ok(rgb)
    }

    /// Fills the bytes. Output that ends early is told by its limit if that has passed.
    fn read(&mut self, bytes: &mut [u8]) -> Result<(), FilterError> {
        self.pages.read_exact(bytes).map_err(|source| match self.process.passed() {
            Some(error) => failed(error),
            None => FilterError::Io { what: "read what Ghostscript draws", source },
        })
    }

    /// Sees to it that all was drawn.
    pub(super) fn end(self) -> Result<(), FilterError> {
        self.process.advance();
        self.process.end(|| false).map(drop).map_err(failed)
    }
}
