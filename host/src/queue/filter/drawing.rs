//! Ghostscript at work: the pages of a document with the kind of each pixel, through a pipe.

use std::io::{self, BufReader, Read};
use std::path::Path;
use std::process::{Child, ChildStdout, Command, Stdio};
use std::thread::{self, JoinHandle};

use tempfile::NamedTempFile;

use super::{FilterError, io_error};
use press::layers::kinds;

/// Memory for a page's bands: with less, Ghostscript reads its list of objects once for each of many bands.
const BANDS: usize = 100_000_000;

/// Ghostscript at work.
pub(super) struct Drawing {
    child: Child,
    pages: BufReader<ChildStdout>,
    complaints: JoinHandle<String>,
    /// Read by the process.
    _conversions: NamedTempFile,
}

impl Drawing {
    /// Begins to draw a document, or one page of it.
    pub(super) fn begin(path: &Path, page: Option<usize>, dpi: u16) -> Result<Drawing, FilterError> {
        let conversions = kinds::conversions().map_err(io_error("keep the conversion of colours"))?;
        let mut command = Command::new("gs");
        command
            .args(["-q", "-dSAFER", "-dBATCH", "-dNOPAUSE", "-dNOINTERPOLATE"])
            .arg(format!("-sDEVICE={}", kinds::DEVICE))
            .arg(format!("-sSourceObjectICC={}", conversions.path().display()))
            .arg(format!("-dBufferSpace={BANDS}"))
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
        Ok(Drawing {
            child,
            pages: BufReader::with_capacity(1 << 18, pages),
            complaints,
            _conversions: conversions,
        })
    }

    /// Width and height of the next page in pixels.
    pub(super) fn next_page(&mut self) -> Result<Option<(usize, usize)>, FilterError> {
        match kinds::header(&mut self.pages).map_err(io_error("read what Ghostscript draws"))? {
            // The same bound as for raster pages.
            Some((w, h)) if !(1..=9000).contains(&w) || !(1..=9000).contains(&h) => {
                Err(FilterError::Ghostscript(format!("a page of {w} x {h} pixels is larger than any sheet")))
            }
            size => Ok(size),
        }
    }

    /// The pixels of the page, each with its tag, row by row.
    pub(super) fn pixels(&mut self, (width, height): (usize, usize)) -> Result<Vec<u8>, FilterError> {
        let mut pixels = vec![0; kinds::BYTES * width * height];
        self.pages.read_exact(&mut pixels).map_err(io_error("read what Ghostscript draws"))?;
        Ok(pixels)
    }

    /// Sees to it that all was drawn.
    pub(super) fn end(mut self) -> Result<(), FilterError> {
        let status = self.child.wait().map_err(io_error("wait for Ghostscript"))?;
        let words = self.complaints.join().unwrap_or_default();
        if status.success() { Ok(()) } else { Err(FilterError::Ghostscript(words)) }
    }
}
