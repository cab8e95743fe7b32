//! Ghostscript at work: the pages of a document as pictures, through a pipe.

use std::io::{self, BufReader, Read};
use std::path::Path;
use std::process::{Child, ChildStdout, Command, Stdio};
use std::thread::{self, JoinHandle};

use super::{FilterError, io_error};

/// Ghostscript at work.
pub(super) struct Drawing {
    child: Child,
    pages: BufReader<ChildStdout>,
    complaints: JoinHandle<String>,
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
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        let mut child = command.spawn().map_err(FilterError::NoGhostscript)?;
        let (Some(pages), Some(mut words)) = (child.stdout.take(), child.stderr.take()) else {
            return Err(FilterError::Ghostscript("its pipes cannot be had".into()));
        };
        // A page is 100 MB: through the usual 64 KB the two programs mostly wait for each other. What is refused is slower.
        #[cfg(target_os = "linux")]
        let _ = rustix::pipe::fcntl_setpipe_size(&pages, 1 << 20);
        let complaints = thread::spawn(move || {
            let mut bytes = Vec::new();
            // Only the beginning is shown, but all is taken so that it never waits. What cannot be read is not shown.
            let _ = (&mut words).take(1 << 14).read_to_end(&mut bytes);
            let _ = io::copy(&mut words, &mut io::sink());
            String::from_utf8_lossy(&bytes).lines().take(3).collect::<Vec<_>>().join("; ")
        });
        Ok(Drawing { child, pages: BufReader::with_capacity(1 << 18, pages), complaints })
    }

    /// Width and height of the next page in pixels.
    pub(super) fn next_page(&mut self) -> Result<Option<(usize, usize)>, FilterError> {
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

    /// The pixels of the page, red, green and blue, row by row.
    pub(super) fn pixels(&mut self, (width, height): (usize, usize)) -> Result<Vec<u8>, FilterError> {
        let mut rgb = vec![0; 3 * width * height];
        self.pages.read_exact(&mut rgb).map_err(io_error("read what Ghostscript draws"))?;
        Ok(rgb)
    }

    /// Sees to it that all was drawn.
    pub(super) fn end(mut self) -> Result<(), FilterError> {
        let status = self.child.wait().map_err(io_error("wait for Ghostscript"))?;
        let words = self.complaints.join().unwrap_or_default();
        if status.success() { Ok(()) } else { Err(FilterError::Ghostscript(words)) }
    }
}
