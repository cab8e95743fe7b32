//! PDF and PostScript pages, through Ghostscript or Poppler as a process.
//!
//! Problem: pages have spot plates and transparent backgrounds, and their languages are large.
//! Method: Ghostscript separates the page at a low resolution first, which gives its size and its plates. If a plate names
//! an ink, Ghostscript separates the page again at its final number of dots, into one file for each plate. If none does, it
//! draws the page with the kind of each pixel ([`kinds`](super::kinds)). Nothing is anti-aliased. If Ghostscript is missing, Poppler renders PDF,
//! but without plates.
//! Cost: seconds a page. Limits: ten minutes; the process can read only the file (Ghostscript's safer mode).

use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use protocol::ink::Kind;

use super::artwork::Artwork;
use super::coverage::{self, Coverage, Scan};
use super::error::{LayersError, io, wrong};
use super::kinds;
use super::names::{self, stem};
use super::options::Options;
use super::picture;
use super::size::{self, Unstated};
use super::window::Window;
use crate::scratch::Scratch;
use observe::Observer;

/// Resolution of the draft that gives a page's size and plates.
const DRAFT: f64 = 36.0;

/// The longest time for a page.
const TIMEOUT: Duration = Duration::from_secs(600);

const PROCESS: [&str; 4] = ["Cyan", "Magenta", "Yellow", "Black"];

/// Reads a page.
pub(super) fn read(path: &Path, options: &Options, observer: &dyn Observer) -> Result<Artwork, LayersError> {
    let folder = Scratch::new().map_err(io(path, "make a folder for its plates"))?;
    observer.begin("reading the page", 2);
    let art = match page(path, options, &folder, observer) {
        Err(LayersError::Program { .. }) if is_pdf(path)? => poppler(path, options, &folder),
        art => art,
    };
    observer.end();
    art
}

fn is_pdf(path: &Path) -> Result<bool, LayersError> {
    let mut start = [0; 4];
    let mut file = File::open(path).map_err(io(path, "open it"))?;
    Ok(file.read_exact(&mut start).is_ok() && &start == b"%PDF")
}

fn page(
    path: &Path,
    options: &Options,
    folder: &Scratch,
    observer: &dyn Observer,
) -> Result<Artwork, LayersError> {
    let draft = folder.path().join("draft.tif");
    ghostscript(path, options.page, "tiffsep", (DRAFT, DRAFT), &draft)?;
    let missing = || wrong(path, format!("there is no page {}, or the file is damaged", options.page));
    let (width, height) = image::image_dimensions(&draft).map_err(|_| missing())?;
    observer.advance(1);
    let size = (f64::from(width), f64::from(height));
    let mut notes = Vec::new();
    let stated = Some((DRAFT, DRAFT));
    let dots = size::dots(path, size, stated, Unstated::PixelPerDot, &options.sized(), &mut notes)?;
    // The draft rounds the page's size to its own pixels, so the final size is that of the final rendering.
    let dpi = (DRAFT * dots.0 as f64 / size.0, DRAFT * dots.1 as f64 / size.1);
    let mut plates = Vec::new();
    for (name, file) in plates_beside(&draft, folder)? {
        // Plates of other pages exist as well, but are blank. A page paints every pixel it touches, so the draft misses no plate.
        if !PROCESS.contains(&name.as_str())
            && coverage::scan(&file)?.coverage.iter().any(|&c| c > 0)
            && let Some(named) = names::of_part(path, &name, "plate", &mut notes)?
        {
            plates.push((name, named));
        }
    }
    let name = stem(path);
    if plates.is_empty() {
        let mut art = drawn(path, options, dpi, folder)?;
        art.notes.append(&mut notes);
        return Ok(art);
    }
    let full = folder.path().join("page.tif");
    ghostscript(path, options.page, "tiffsep", dpi, &full)?;
    let mut art = of_plates(&name, &full, folder, &plates, options)?
        .ok_or_else(|| LayersError::Nothing { reason: "no plate of the page has a dot".into() })?;
    art.notes.append(&mut notes);
    Ok(art)
}

/// The art of a page without plates: what it draws, on transparent ground.
fn drawn(path: &Path, options: &Options, dpi: (f64, f64), folder: &Scratch) -> Result<Artwork, LayersError> {
    let page = folder.path().join("page.pam");
    let conversions = kinds::conversions().map_err(io(path, "keep the conversion of its colours"))?;
    let before = [
        "-dUseCropBox".into(),
        format!("-dFirstPage={}", options.page),
        format!("-dLastPage={}", options.page),
        format!("-sSourceObjectICC={}", conversions.path().display()),
    ];
    run_ghostscript(path, &before, kinds::DEVICE, dpi, &page, &[])?;
    let missing = || wrong(path, format!("there is no page {}, or the file is damaged", options.page));
    let mut file = BufReader::new(File::open(&page).map_err(|_| missing())?);
    let (width, height) = kinds::header(&mut file).ok().flatten().ok_or_else(missing)?;
    let size = (u32::try_from(width), u32::try_from(height));
    let (Ok(wide), Ok(high)) = size else { return Err(missing()) };
    size::check_pixels(path, wide, high)?;
    let mut pixels = vec![0; kinds::BYTES * width * height];
    file.read_exact(&mut pixels).map_err(io(path, "read its page"))?;
    Ok(picture::tagged_artwork(&stem(path), (wide, high), (width, height), pixels, options))
}

/// The art of a separated page: its process plates and those in `spots`.
fn of_plates(
    name: &str,
    page: &Path,
    folder: &Scratch,
    spots: &[(String, names::Named)],
    options: &Options,
) -> Result<Option<Artwork>, LayersError> {
    let mut art: Option<Artwork> = None;
    for (plate, file) in plates_beside(page, folder)? {
        let process = PROCESS.contains(&plate.as_str()).then(|| names::ink(&plate)).flatten();
        let spot = spots.iter().find(|(name, _)| *name == plate).map(|&(_, named)| named);
        let Some(named) = spot.or(process) else { continue };
        let scan = coverage::scan(&file)?;
        let dots = (scan.width as usize, scan.height as usize);
        art.get_or_insert_with(|| Artwork::blank(name, dots)).add(scan, &plate, named, true, options);
    }
    Ok(art)
}

/// For each page the plates that name an ink and are not blank. Empty for a document without pages.
///
/// # Errors
/// A document that Ghostscript cannot read, or no Ghostscript.
pub fn spots(path: &Path) -> Result<Vec<Vec<String>>, LayersError> {
    let folder = Scratch::new().map_err(io(path, "make a folder for its plates"))?;
    let draft = folder.path().join("draft%d.tif");
    run_ghostscript(path, &["-sCompression=lzw".into()], "tiffsep", (DRAFT, DRAFT), &draft, &[])?;
    let mut pages = Vec::new();
    loop {
        let page = folder.path().join(format!("draft{}.tif", pages.len() + 1));
        if !page.exists() {
            return Ok(pages);
        }
        let mut spots = Vec::new();
        for (name, file) in plates_beside(&page, &folder)? {
            // A colour that names a process ink is printed by its process colours anyway.
            let spot = names::ink(&name).is_some_and(|named| named.ink.kind() != Kind::Process);
            if spot && coverage::scan(&file)?.coverage.iter().any(|&c| c > 0) {
                spots.push(name);
            }
        }
        pages.push(spots);
    }
}

/// A page as plates: one for each spot colour that names an ink, and the process plates for the rest.
pub struct Separated {
    /// Pixels across and down.
    pub size: (usize, usize),
    dpi: f64,
    plates: Vec<(String, names::Named, Vec<u8>)>,
}

/// Separates a page into plates for these names and the process plates, at `dpi` pixels per inch. Spot colours that name no
/// ink are drawn by their process colours.
///
/// # Errors
/// As [`open`](super::open()).
pub fn separated(path: &Path, page: usize, names: &[String], dpi: f64) -> Result<Separated, LayersError> {
    let folder = Scratch::new().map_err(io(path, "make a folder for its plates"))?;
    let full = folder.path().join("page.tif");
    // Ghostscript makes plates only for the colours in this list, and draws all others by their process colours.
    let list: String = names.iter().map(|name| format!("({}) cvn ", escaped(name))).collect();
    let before = [
        format!("-dFirstPage={page}"),
        format!("-dLastPage={page}"),
        format!("-dMaxSeparations={}", PROCESS.len() + names.len()),
    ];
    let setup = ["-c".to_owned(), format!("<</SeparationColorNames[{list}]>>setpagedevice")];
    run_ghostscript(path, &before, "tiffsep", (dpi, dpi), &full, &setup)?;
    let (width, height) =
        image::image_dimensions(&full).map_err(|_| wrong(path, format!("there is no page {page}")))?;
    let size = (width as usize, height as usize);
    let mut plates = Vec::new();
    for (plate, file) in plates_beside(&full, &folder)? {
        let wanted = PROCESS.contains(&plate.as_str()) || names.contains(&plate);
        let Some(named) = names::ink(&plate).filter(|_| wanted) else { continue };
        let scan = coverage::scan(&file)?;
        if (scan.width, scan.height) != (width, height) {
            return Err(wrong(path, format!("plate {plate} of page {page} differs in size from the page")));
        }
        plates.push((plate, named, scan.coverage));
    }
    Ok(Separated { size, dpi, plates })
}

impl Separated {
    /// The smallest rectangle around everything drawn, in pixels; `None` for a blank page.
    pub fn bounds(&self) -> Option<Window> {
        let plates = self.plates.iter();
        plates
            .filter_map(|(.., coverage)| Window::around(coverage, self.size.0, 1, 0))
            .reduce(|all, window| all.join(&window))
    }

    /// The part of the page in a window as art, a layer for each plate.
    ///
    /// # Errors
    /// A window of no dots, or of more than 65535 on a side.
    pub fn art(self, name: &str, window: &Window, options: &Options) -> Result<Artwork, LayersError> {
        let path = Path::new(name);
        let empty = || wrong(path, "the window has no dots");
        let dots = size::page_dots((window.width, window.height), self.dpi).ok_or_else(empty)?;
        let mut art = Artwork::blank(name, dots);
        for (plate, named, coverage) in self.plates {
            let scan = Scan {
                path: path.to_path_buf(),
                // The plates were read from TIFF files, whose sides fit in u32.
                width: window.width as u32,
                height: window.height as u32,
                dpi: None,
                coverage: window.cut(coverage, self.size.0, 1),
                by: Coverage::Dark,
            };
            art.add(scan, &plate, named, true, options);
        }
        Ok(art)
    }
}

/// A name escaped for a PostScript string.
fn escaped(name: &str) -> String {
    name.bytes()
        .map(|byte| match byte {
            b'(' | b')' | b'\\' => format!("\\{}", char::from(byte)),
            b' '..=b'~' => char::from(byte).to_string(),
            _ => format!("\\{byte:03o}"),
        })
        .collect()
}

/// The names and files of the plates beside a separated page, such as `page(Gold Foil).tif`.
fn plates_beside(page: &Path, folder: &Scratch) -> Result<Vec<(String, PathBuf)>, LayersError> {
    let prefix = stem(page);
    let mut plates = Vec::new();
    for entry in std::fs::read_dir(folder.path()).map_err(io(page, "list its plates"))? {
        let file = entry.map_err(io(page, "list its plates"))?.path();
        let name = stem(&file);
        let plate = name.strip_prefix(&prefix).and_then(|rest| rest.strip_prefix('(')?.strip_suffix(')'));
        if let Some(plate) = plate {
            plates.push((plate.to_owned(), file.clone()));
        }
    }
    plates.sort();
    Ok(plates)
}

fn ghostscript(path: &Path, page: u32, device: &str, dpi: (f64, f64), to: &Path) -> Result<(), LayersError> {
    let only = ["-dUseCropBox".into(), format!("-dFirstPage={page}"), format!("-dLastPage={page}")];
    run_ghostscript(path, &only, device, dpi, to, &[])
}

/// Runs Ghostscript on a document; the arguments in `setup` stand right before its path.
fn run_ghostscript(
    path: &Path,
    options: &[String],
    device: &str,
    dpi: (f64, f64),
    to: &Path,
    setup: &[String],
) -> Result<(), LayersError> {
    let file = std::path::absolute(path).map_err(io(path, "find it"))?;
    let mut command = Command::new("gs");
    command
        .args(["-q", "-dSAFER", "-dBATCH", "-dNOPAUSE", "-sstdout=%stderr"])
        .args(["-dTextAlphaBits=1", "-dGraphicsAlphaBits=1"])
        .args(options)
        .arg(format!("-r{:.4}x{:.4}", dpi.0, dpi.1))
        .arg(format!("-sDEVICE={device}"))
        .arg(format!("-sOutputFile={}", to.display()))
        .args(setup)
        .arg("-f")
        .arg(file);
    let missing = LayersError::Program {
        path: path.to_path_buf(),
        program: "Ghostscript",
        install: "install it (Debian: apt install ghostscript), or export the page as PNG",
    };
    run(path, command, missing)
}

/// Renders a page of a PDF as a picture if there is no Ghostscript.
fn poppler(path: &Path, options: &Options, folder: &Scratch) -> Result<Artwork, LayersError> {
    let to = folder.path().join("page");
    let file = std::path::absolute(path).map_err(io(path, "find it"))?;
    let mut command = Command::new("pdftocairo");
    command
        .args(["-png", "-transp", "-singlefile", "-cropbox", "-antialias", "none", "-r", "600"])
        .args(["-f", &options.page.to_string(), "-l", &options.page.to_string()])
        .arg(file)
        .arg(&to);
    let missing = LayersError::Program {
        path: path.to_path_buf(),
        program: "Ghostscript",
        install: "install it (Debian: apt install ghostscript), or Poppler (poppler-utils), or export the page as PNG",
    };
    run(path, command, missing)?;
    let mut art = picture::artwork(&stem(path), picture::read(&to.with_extension("png"))?, &options.sized())?;
    art.notes.push(format!(
        "{}: read by Poppler, without spot plates; install Ghostscript to print them in their inks",
        path.display()
    ));
    Ok(art)
}

/// Runs a program to its end; `missing` is the error if the program is not installed.
fn run(path: &Path, mut command: Command, missing: LayersError) -> Result<(), LayersError> {
    let started = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped()).spawn();
    let mut child = match started {
        Ok(child) => child,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Err(missing),
        Err(source) => {
            return Err(LayersError::Io {
                path: path.to_path_buf(),
                attempt: "start a program to read it",
                source,
            });
        }
    };
    // A thread of its own reads, so that a verbose program does not block on a full pipe.
    let message = child.stderr.take().map(|pipe| {
        std::thread::spawn(move || {
            let mut text = Vec::new();
            let mut pipe = pipe;
            // A message that cannot be read is not shown.
            let _ = (&mut pipe).take(1 << 14).read_to_end(&mut text);
            let _ = std::io::copy(&mut pipe, &mut std::io::sink());
            String::from_utf8_lossy(&text).into_owned()
        })
    });
    let ended = wait(&mut child);
    let message = message.and_then(|thread| thread.join().ok()).unwrap_or_default();
    let reason: String =
        message.lines().next().unwrap_or("no reason given").chars().filter(|c| !c.is_control()).collect();
    match ended.map_err(io(path, "wait for the program that reads it"))? {
        Some(true) => Ok(()),
        Some(false) => Err(wrong(path, format!("cannot be read: {reason}"))),
        None => Err(wrong(path, format!("reading it took more than {} minutes", TIMEOUT.as_secs() / 60))),
    }
}

/// Whether it ended successfully; `None` if it took too long and was stopped.
fn wait(child: &mut Child) -> std::io::Result<Option<bool>> {
    let begun = Instant::now();
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(Some(status.success()));
        }
        if begun.elapsed() > TIMEOUT {
            child.kill()?;
            child.wait()?;
            return Ok(None);
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}
