//! PDF and PostScript pages, through Ghostscript or Poppler as a process.
//!
//! Problem: pages hold spot plates and transparent ground, and their languages are large.
//! Method: Ghostscript first separates the page at a low resolution, which tells its size and its plates. If a plate
//! names an ink, the page is separated again at its final number of dots, a file for each plate; otherwise it is rendered
//! with its ground left transparent, both without anti-aliasing. Without Ghostscript, Poppler renders PDF, but knows no
//! plates.
//! Cost: that of the process, seconds a page. Limits: ten minutes; the process may read nothing but the file
//! (Ghostscript's safer mode).

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use protocol::ink::Kind;

use super::raster::{self, Unstated, wrong};
use super::{Artwork, LayersError, Options, Window, colour, names};
use crate::scratch::Scratch;
use observe::Observer;

/// Resolution of the first look.
const LOOK: f64 = 36.0;

/// How long a page may take.
const PATIENCE: Duration = Duration::from_secs(600);

const PROCESS: [&str; 4] = ["Cyan", "Magenta", "Yellow", "Black"];

/// Reads a page.
pub(super) fn read(path: &Path, options: &Options, observer: &dyn Observer) -> Result<Artwork, LayersError> {
    let folder = Scratch::new().map_err(raster::io(path, "make a folder for its plates"))?;
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
    let mut file = File::open(path).map_err(raster::io(path, "open it"))?;
    Ok(file.read_exact(&mut start).is_ok() && &start == b"%PDF")
}

fn page(
    path: &Path,
    options: &Options,
    folder: &Scratch,
    observer: &dyn Observer,
) -> Result<Artwork, LayersError> {
    let look = folder.path().join("look.tif");
    ghostscript(path, options.page, "tiffsep", (LOOK, LOOK), &look)?;
    let missing = || wrong(path, format!("there is no page {}, or the file is damaged", options.page));
    let (width, height) = image::image_dimensions(&look).map_err(|_| missing())?;
    observer.advance(1);
    let size = (f64::from(width), f64::from(height));
    let mut notes = Vec::new();
    let look_density = Some((LOOK, LOOK));
    let dots = raster::dots(path, size, look_density, Unstated::IsDots, &options.sized(), &mut notes)?;
    let density = (LOOK * dots.0 as f64 / size.0, LOOK * dots.1 as f64 / size.1);
    // The page's true size is less than a pixel of the look away; what is rendered decides.
    let mut plates = Vec::new();
    for (name, file) in files(&look, folder)? {
        // Plates of other pages are there, too, and blank. A page paints every pixel it touches, so none is missed.
        if !PROCESS.contains(&name.as_str())
            && raster::scan(&file)?.coverage.iter().any(|&c| c > 0)
            && let Some(named) = super::named_part(path, &name, "plate", &mut notes)?
        {
            plates.push((name, named));
        }
    }
    let name = super::stem(path);
    if plates.is_empty() {
        let picture = folder.path().join("page.png");
        ghostscript(path, options.page, "pngalpha", density, &picture)?;
        let picture = colour::read(&picture)?;
        let dots = (picture.width as usize, picture.height as usize);
        let mut art = colour::artwork_of(&name, picture, dots, options);
        art.notes.retain(|note| !note.contains("colour profile"));
        art.notes.append(&mut notes);
        return Ok(art);
    }
    let full = folder.path().join("page.tif");
    ghostscript(path, options.page, "tiffsep", density, &full)?;
    let mut art = of_plates(&name, &full, folder, &plates, options)?
        .ok_or_else(|| LayersError::Nothing { reason: "no plate of the page has a dot".into() })?;
    art.notes.append(&mut notes);
    Ok(art)
}

/// The art of a separated page: its process plates, and those of `spots`.
fn of_plates(
    name: &str,
    page: &Path,
    folder: &Scratch,
    spots: &[(String, names::Named)],
    options: &Options,
) -> Result<Option<Artwork>, LayersError> {
    let mut art: Option<Artwork> = None;
    for (plate, file) in files(page, folder)? {
        let process = PROCESS.contains(&plate.as_str()).then(|| names::ink(&plate)).flatten();
        let spot = spots.iter().find(|(name, _)| *name == plate).map(|&(_, named)| named);
        let Some(named) = spot.or(process) else { continue };
        let scan = raster::scan(&file)?;
        let dots = (scan.width as usize, scan.height as usize);
        art.get_or_insert_with(|| Artwork::blank(name, dots)).add(scan, &plate, named, true, options);
    }
    Ok(art)
}

/// The names of the plates of each page that name inks and have a dot. Without a page there is no list.
///
/// # Errors
/// As [`open`](super::open): a document that Ghostscript cannot read, or no Ghostscript.
pub fn spots(path: &Path) -> Result<Vec<Vec<String>>, LayersError> {
    let folder = Scratch::new().map_err(raster::io(path, "make a folder for its plates"))?;
    let look = folder.path().join("look%d.tif");
    run_ghostscript(path, &["-sCompression=lzw".into()], "tiffsep", (LOOK, LOOK), &look, &[])?;
    let mut pages = Vec::new();
    loop {
        let page = folder.path().join(format!("look{}.tif", pages.len() + 1));
        if !page.exists() {
            return Ok(pages);
        }
        let mut spots = Vec::new();
        for (name, file) in files(&page, &folder)? {
            // A colour that names a process ink is drawn by its process colours all the same.
            let spot = names::ink(&name).is_some_and(|named| named.ink.kind() != Kind::Process);
            if spot && raster::scan(&file)?.coverage.iter().any(|&c| c > 0) {
                spots.push(name);
            }
        }
        pages.push(spots);
    }
}

/// A page as plates: those of spot colours that name inks, and those of the process inks for all else.
pub struct Separated {
    /// Pixels across and down.
    pub size: (usize, usize),
    dpi: f64,
    plates: Vec<(String, names::Named, Vec<u8>)>,
}

/// Separates a page so that these names have plates of their own; whatever else it has is in the process plates, spot colours
/// that name no ink among them. Drawn at `dpi` pixels an inch.
///
/// # Errors
/// As [`open`](super::open).
pub fn separated(path: &Path, page: usize, names: &[String], dpi: f64) -> Result<Separated, LayersError> {
    let folder = Scratch::new().map_err(raster::io(path, "make a folder for its plates"))?;
    let full = folder.path().join("page.tif");
    // Only colours it is told of become plates of their own; it draws all others by their process colours.
    let list: String = names.iter().map(|name| format!("({}) cvn ", escaped(name))).collect();
    let before = [
        format!("-dFirstPage={page}"),
        format!("-dLastPage={page}"),
        format!("-dMaxSeparations={}", PROCESS.len() + names.len()),
    ];
    let told = ["-c".to_owned(), format!("<</SeparationColorNames[{list}]>>setpagedevice")];
    run_ghostscript(path, &before, "tiffsep", (dpi, dpi), &full, &told)?;
    let (width, height) =
        image::image_dimensions(&full).map_err(|_| wrong(path, format!("there is no page {page}")))?;
    let size = (width as usize, height as usize);
    let mut plates = Vec::new();
    for (plate, file) in files(&full, &folder)? {
        let wanted = PROCESS.contains(&plate.as_str()) || names.contains(&plate);
        let Some(named) = names::ink(&plate).filter(|_| wanted) else { continue };
        let scan = raster::scan(&file)?;
        if (scan.width, scan.height) != (width, height) {
            return Err(wrong(path, format!("plate {plate} of page {page} has another size than the page")));
        }
        plates.push((plate, named, scan.coverage));
    }
    Ok(Separated { size, dpi, plates })
}

impl Separated {
    /// The smallest rectangle around everything drawn, in pixels.
    pub fn bounds(&self) -> Option<Window> {
        let plates = self.plates.iter();
        plates
            .filter_map(|(.., coverage)| Window::around(coverage, self.size.0, 1, 0))
            .reduce(|all, window| all.join(&window))
    }

    /// The part of the page in a window as art, a layer for each plate.
    ///
    /// # Errors
    /// A window of no dots.
    pub fn art(self, name: &str, window: &Window, options: &Options) -> Result<Artwork, LayersError> {
        let path = Path::new(name);
        let empty = || wrong(path, "nothing of it is in the window");
        let dots = super::page_dots((window.width, window.height), self.dpi).ok_or_else(empty)?;
        let mut art = Artwork::blank(name, dots);
        for (plate, named, coverage) in self.plates {
            let scan = raster::Scan {
                path: path.to_path_buf(),
                // No page has more pixels than u32 holds: they were read from a TIFF.
                width: window.width as u32,
                height: window.height as u32,
                density: None,
                coverage: window.cut(coverage, self.size.0, 1),
                by: raster::Coverage::Dark,
            };
            art.add(scan, &plate, named, true, options);
        }
        Ok(art)
    }
}

/// A name as PostScript writes it between parentheses.
fn escaped(name: &str) -> String {
    name.bytes()
        .map(|byte| match byte {
            b'(' | b')' | b'\\' => format!("\\{}", char::from(byte)),
            b' '..=b'~' => char::from(byte).to_string(),
            _ => format!("\\{byte:03o}"),
        })
        .collect()
}

/// The plates beside a separated page: `page(Gold Foil).tif`.
fn files(page: &Path, folder: &Scratch) -> Result<Vec<(String, PathBuf)>, LayersError> {
    let stem = super::stem(page);
    let mut plates = Vec::new();
    for entry in std::fs::read_dir(folder.path()).map_err(raster::io(page, "list its plates"))? {
        let file = entry.map_err(raster::io(page, "list its plates"))?.path();
        let name = super::stem(&file);
        let plate = name.strip_prefix(&stem).and_then(|rest| rest.strip_prefix('(')?.strip_suffix(')'));
        if let Some(plate) = plate {
            plates.push((plate.to_owned(), file.clone()));
        }
    }
    plates.sort();
    Ok(plates)
}

fn ghostscript(
    path: &Path,
    page: u32,
    device: &str,
    density: (f64, f64),
    to: &Path,
) -> Result<(), LayersError> {
    let only = ["-dUseCropBox".into(), format!("-dFirstPage={page}"), format!("-dLastPage={page}")];
    run_ghostscript(path, &only, device, density, to, &[])
}

/// Ghostscript on a document; `told` stands right before it.
fn run_ghostscript(
    path: &Path,
    options: &[String],
    device: &str,
    density: (f64, f64),
    to: &Path,
    told: &[String],
) -> Result<(), LayersError> {
    let file = std::path::absolute(path).map_err(raster::io(path, "find it"))?;
    let mut command = Command::new("gs");
    command
        .args(["-q", "-dSAFER", "-dBATCH", "-dNOPAUSE", "-sstdout=%stderr"])
        .args(["-dTextAlphaBits=1", "-dGraphicsAlphaBits=1"])
        .args(options)
        .arg(format!("-r{:.4}x{:.4}", density.0, density.1))
        .arg(format!("-sDEVICE={device}"))
        .arg(format!("-sOutputFile={}", to.display()))
        .args(told)
        .arg("-f")
        .arg(file);
    let missing = LayersError::Program {
        path: path.to_path_buf(),
        program: "Ghostscript",
        install: "install it (Debian: apt install ghostscript), or export the page as PNG",
    };
    run(path, command, missing)
}

/// A PDF's page as a picture, where there is no Ghostscript.
fn poppler(path: &Path, options: &Options, folder: &Scratch) -> Result<Artwork, LayersError> {
    let to = folder.path().join("page");
    let file = std::path::absolute(path).map_err(raster::io(path, "find it"))?;
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
    let mut art =
        colour::artwork(&super::stem(path), colour::read(&to.with_extension("png"))?, &options.sized())?;
    art.notes.push(format!(
        "{}: read by Poppler, which knows no spot plates; install Ghostscript to have them as inks",
        path.display()
    ));
    Ok(art)
}

/// Runs a program to its end; `missing` is the error when there is no such program.
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
    // Read beside the wait: a program that says a lot must not block on a full pipe.
    let said = child.stderr.take().map(|pipe| {
        std::thread::spawn(move || {
            let mut text = Vec::new();
            let mut pipe = pipe;
            // What cannot be read is not shown.
            let _ = (&mut pipe).take(1 << 14).read_to_end(&mut text);
            let _ = std::io::copy(&mut pipe, &mut std::io::sink());
            String::from_utf8_lossy(&text).into_owned()
        })
    });
    let ended = wait(&mut child);
    let said = said.and_then(|thread| thread.join().ok()).unwrap_or_default();
    let told: String =
        said.lines().next().unwrap_or("it says nothing").chars().filter(|c| !c.is_control()).collect();
    match ended.map_err(raster::io(path, "wait for the program that reads it"))? {
        Some(true) => Ok(()),
        Some(false) => Err(wrong(path, format!("cannot be read: {told}"))),
        None => Err(wrong(path, format!("took more than {} minutes to read", PATIENCE.as_secs() / 60))),
    }
}

/// Whether it ended well; `None` when it had to be stopped.
fn wait(child: &mut Child) -> std::io::Result<Option<bool>> {
    let begun = Instant::now();
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(Some(status.success()));
        }
        if begun.elapsed() > PATIENCE {
            child.kill()?;
            child.wait()?;
            return Ok(None);
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}
