//! Ghostscript's command line, which of its two interpreters reads a PDF, and in which order it writes a pixel's bytes.
//!
//! Problem: layers of art and print queues must draw a document alike, with every version. Ghostscript 9.56 to 10.01 have two interpreters of
//! PDF. The usual one of 10.00 refuses every shading by a function of two variables (`ShadingType 1`) that has no matrix of
//! its own, which is how browsers write gradients that repeat, turn, or end within their shape. What is filled with it is
//! missing, Ghostscript ends well, and with `-q` it says nothing of it.
//! Method: one function begins every command. `-q` holds for the start only, so that the interpreter says at its end what it
//! left out. If that is a pattern, the document is tried with the older interpreter, which draws it unless it has complaints
//! of its own ([`complaint`](super::complaint)). Versions with one interpreter ignore the option and complain again.
//! Cost: a second draft of documents that lack a pattern; of others none. Limits: the older interpreter compares the
//! corners of a shading first, so narrow stripes may become one colour; a note says so.

use std::ffi::OsStr;
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use super::complaint;
use crate::read::object_type::{self, Order};
use crate::read::process::{self, Process, ProcessError};
use files::scratch::Scratch;

/// Memory for a page's bands in bytes: with less, Ghostscript reads its list of objects once for each of many bands.
const BANDS: usize = 100_000_000;

/// Lets the interpreter of PDF say what it left out. The greeting and the loading of Ghostscript's own files stay quiet.
const SPEAKS: &str = "userdict /QUIET false put";

/// Copies are the print system's affair, and since 10.04 each copy of a page with tags has its bytes in another order. PostScript asks for copies in
/// two ways.
const ONE_COPY: &str = "-dNumCopies=1";
/// A page that fits into memory loses its spot plates where something is transparent; in bands it keeps them.
const ALL_PLATES: &str = "-dMaxBitmap=0";
/// Pictures are drawn pixel by pixel, whatever the document asks for: interpolated, art in one bit has tones.
const AS_THEY_ARE: &str = "-dNOINTERPOLATE";
const NO_COPIES: &str = "userdict begin \
    /findfont { dup type /nametype eq { dup /Font resourcestatus { pop pop } { (%%NoFont: ) print dup =only (\\n) print flush } \
    ifelse } if systemdict /findfont get exec } bind def \
    /selectfont { 1 index type /nametype eq { exch findfont exch } if systemdict /selectfont get exec } bind def /setpagedevice { dup /NumCopies known { dup length dict copy dup /NumCopies undef } if \
    systemdict /setpagedevice get exec } bind def end";

/// Ghostscript's interpreter of PDF.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Interpreter {
    /// The one that this version of Ghostscript prefers.
    #[default]
    Usual,
    /// The one before it, where there are two.
    Older,
}

/// Ghostscript's program. Its installer for Windows leaves the search path alone; the newest one in the usual folder is taken.
fn program() -> PathBuf {
    if !cfg!(windows) {
        return "gs".into();
    }
    let folder = std::env::var_os("ProgramFiles").map(|folder| PathBuf::from(folder).join("gs"));
    let versions = folder.and_then(|folder| std::fs::read_dir(folder).ok()).into_iter().flatten();
    let programs = versions.filter_map(|version| Some(version.ok()?.path().join("bin/gswin64c.exe")));
    programs.filter(|program| program.is_file()).max().unwrap_or_else(|| "gswin64c".into())
}

/// A command that draws a document with these options, among them the device and where its output goes, a name in
/// `folder`. It runs there, and files of its own are there, too, which it leaves behind when it is stopped. Its complaints go to
/// the standard error.
pub fn command<O: AsRef<OsStr>>(
    path: &Path,
    interpreter: Interpreter,
    folder: &Path,
    options: impl IntoIterator<Item = O>,
) -> Command {
    let mut command = Command::new(program());
    command
        .current_dir(folder)
        .env("TMPDIR", folder)
        .args([
            "-q",
            "-dSAFER",
            "-dBATCH",
            "-dNOPAUSE",
            "-sstdout=%stderr",
            ONE_COPY,
            ALL_PLATES,
            AS_THEY_ARE,
        ])
        .arg(format!("-dBufferSpace={BANDS}"));
    if interpreter == Interpreter::Older {
        command.arg("-dNEWPDF=false");
    }
    // What the options run needs the device.
    command.args(options);
    // What warns of a box in EPS does not work when it may speak.
    let first = if complaint::is_pdf(path).unwrap_or(false) { SPEAKS } else { NO_COPIES };
    command.args(["-c", first, "-f"]);
    command.arg(std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf()));
    command
}

/// The interpreter that draws most of a PDF, found without drawing it.
pub fn interpreter(path: &Path) -> Interpreter {
    let said = |interpreter| {
        let folder = Scratch::new().ok()?;
        let mut command = command(path, interpreter, folder.path(), ["-sDEVICE=nullpage", "-r72"]);
        let process = Process::start(command.stdout(Stdio::null()), process::limit()).ok()?;
        process.end(|| false).ok()
    };
    // Whoever draws the document tells why that fails.
    let Some(usual) = said(Interpreter::Usual).filter(|usual| complaint::lacks_pattern(usual)) else {
        return Interpreter::Usual;
    };
    match said(Interpreter::Older) {
        Some(older) if complaint::is_better(&older, &usual) => Interpreter::Older,
        _ => Interpreter::Usual,
    }
}

/// How many pages a PDF says to have; `None` if it cannot be read so far.
pub fn page_count(path: &Path) -> Option<usize> {
    let path = std::path::absolute(path).ok()?;
    let named = |option: &str| {
        let mut named = std::ffi::OsString::from(option);
        named.push(&path);
        named
    };
    let mut command = Command::new(program());
    command.args(["-q", "-dSAFER", "-dBATCH", "-dNOPAUSE", "-dNODISPLAY"]);
    command.args([named("--permit-file-read="), named("-sDocument=")]);
    command.args(["-c", "Document (r) file runpdfbegin pdfpagecount == quit"]);
    let mut process = Process::start(command.stdout(Stdio::piped()), process::limit()).ok()?;
    let mut said = String::new();
    process.output()?.take(1 << 10).read_to_string(&mut said).ok()?;
    process.end(|| false).ok()?;
    said.trim().parse().ok()
}

/// The order of the bytes of pixels with tags, of which these are some. If all of them are dark, Ghostscript draws a bare one.
///
/// # Errors
/// Ghostscript cannot be started or fails, or its bare pixel has no light byte at an end.
pub fn order(pixels: &[u8]) -> Result<Order, ProcessError> {
    if let Some(order) = Order::seen(pixels) {
        return Ok(order);
    }
    let mut command = Command::new(program());
    command.args(["-q", "-dSAFER", "-dBATCH", "-dNOPAUSE", "-g1x1", "-sOutputFile=-"]);
    command.arg(format!("-sDEVICE={}", object_type::DEVICE)).args(["-c", "showpage"]);
    let mut process = Process::start(command.stdout(Stdio::piped()), process::limit())?;
    let mut page = Vec::new();
    process.output().map_or(Ok(0), |output| output.take(1 << 10).read_to_end(&mut page))?;
    process.end(|| false)?;
    let order = page.last_chunk::<{ object_type::BYTES }>().and_then(|bare| Order::seen(bare));
    order.ok_or_else(|| {
        ProcessError::Failed("this version of Ghostscript writes pixels in an unknown way".into())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_command_has_memory_for_bands_and_ends_with_the_document() {
        let folder = Scratch::new().unwrap();
        let [pdf, postscript] = ["%PDF-1.4", "%!PS"].map(|start| {
            let path = folder.path().join(&start[1..4]);
            std::fs::write(&path, start).unwrap();
            path
        });
        for (interpreter, older, path, first) in [
            (Interpreter::Usual, false, &pdf, SPEAKS),
            (Interpreter::Older, true, &pdf, SPEAKS),
            (Interpreter::Usual, false, &postscript, NO_COPIES),
        ] {
            let command = command(path, interpreter, folder.path(), ["-r600", "-c", "x"]);
            let args: Vec<&str> = command.get_args().filter_map(OsStr::to_str).collect();
            assert!(args.contains(&"-dBufferSpace=100000000") && args.contains(&"-dSAFER"), "{args:?}");
            assert_eq!(args.contains(&"-dNEWPDF=false"), older, "{args:?}");
            let file = path.to_str().unwrap();
            assert!(args.ends_with(&["-r600", "-c", "x", "-c", first, "-f", file]), "{args:?}");
        }
    }
}
