//! The pictures of a drawing: embedded, or linked beside it.
//!
//! Problem: the renderer leaves out a picture that it cannot load, and says so nowhere. A link may lead to a device, a pipe,
//! or any file of the computer; what is linked or embedded may expand to any size.
//! Method: links are followed as in other documents: to an ordinary file in the folder of the drawing or below. Each picture
//! is decoded here first. A drawing within the drawing meets the same bounds as the drawing itself. The first picture that
//! cannot be drawn is remembered with the reason. Cost: each picture is decoded once more. Limits: 256 MB of file, 2^26
//! pixels; drawings within a drawing may hold pictures, but not link them, as SVG demands.

use std::borrow::Cow;
use std::collections::HashMap;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::io::Read as _;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use files::FileError;
use files::shelf::Shelf;
use percent_encoding::percent_decode_str;
use readers::Flaw;
use resvg::usvg::{ImageHrefResolver, ImageKind};

use super::{MOST_BYTES, bounds, source};

/// The most pixels of a picture in a drawing: twice a page at 600 dpi.
const MOST_PIXELS: u64 = 1 << 26;

/// What is left out of a rendering.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Without {
    Nothing,
    Text,
    /// Pictures made of pixels.
    Pictures,
}

/// What the renderer met in a drawing.
#[derive(Default)]
pub(super) struct Met {
    pub pictures: bool,
    /// What is wrong with the first picture that cannot be drawn, and what to do.
    pub missing: Option<String>,
    /// Notes on drawings within the drawing.
    pub notes: Vec<String>,
}

/// What is wrong with pictures, by their bytes.
pub(super) type Known = Arc<Mutex<HashMap<u64, Option<&'static str>>>>;

/// Loads pictures, and takes down what it met.
pub(super) fn resolver(
    shelf: &Arc<dyn Shelf>,
    path: &Path,
    without: Without,
    met: &Arc<Mutex<Met>>,
    known: &Known,
) -> ImageHrefResolver<'static> {
    let known = known.clone();
    let taken = move |met: &Mutex<Met>, found: Result<ImageKind, &str>, name: &str, remedy: &str| {
        let mut met = met.lock().unwrap_or_else(PoisonError::into_inner);
        let found = found.and_then(|picture| match fault(&picture, &known) {
            Some(fault) => Err(fault),
            None => Ok(picture),
        });
        match found {
            Ok(drawing @ ImageKind::SVG(_)) => Some(drawing),
            Ok(picture) => {
                met.pictures = true;
                (without != Without::Pictures).then_some(picture)
            }
            Err(fault) => {
                met.missing.get_or_insert_with(|| format!("its picture {name} {fault}; {remedy}"));
                None
            }
        }
    };
    let (data, in_file) =
        (ImageHrefResolver::default_data_resolver(), ImageHrefResolver::default_data_resolver());
    let (of_data, of_link, taken_link) = (met.clone(), met.clone(), taken.clone());
    let (of, shelf) = (path.to_owned(), Arc::clone(shelf));
    let folder = path.parent().filter(|folder| *folder != Path::new("")).unwrap_or(Path::new(".")).to_owned();
    ImageHrefResolver {
        resolve_data: Box::new(move |mime, bytes, options| {
            let found = drawable(&of, &bytes, &of_data).and_then(|drawing| {
                let mime = if drawing.is_some() { SVG } else { mime };
                data(mime, drawing.unwrap_or(bytes), options).ok_or(UNREADABLE)
            });
            taken(&of_data, found, &format!("of the type `{mime}`"), "embed it as PNG")
        }),
        resolve_string: Box::new(move |href, options| {
            let found = file(&*shelf, &folder, href).and_then(|bytes| {
                let drawing = drawable(Path::new(href), &bytes, &of_link)?.unwrap_or_else(|| Arc::new(bytes));
                // The kind is told by the bytes.
                in_file("text/plain", drawing, options).ok_or(UNREADABLE)
            });
            let remedy = "put it where the drawing links it, or embed it as PNG";
            taken_link(&of_link, found, &format!("`{href}`"), remedy)
        }),
    }
}

const UNREADABLE: &str = "cannot be read";

/// The bytes of a linked file, or why there are none.
fn file(shelf: &dyn Shelf, folder: &Path, href: &str) -> Result<Vec<u8>, &'static str> {
    // Links are addresses, so a space is written `%20`.
    let local = href.strip_prefix("file://").unwrap_or(href);
    let plain = percent_decode_str(local).decode_utf8().unwrap_or(Cow::Borrowed(local));
    let found = |name: &str| shelf.resolved(&folder.join(name));
    let folder = shelf.resolved(folder).map_err(|_| UNREADABLE)?;
    let path = found(local).or_else(|_| found(&plain)).map_err(|_| UNREADABLE)?;
    if !path.starts_with(&folder) {
        return Err("lies outside of the folder of the drawing, so it is not read");
    }
    if !shelf.is_file(&path) {
        return Err("is no ordinary file");
    }
    shelf.read(&path, MOST_BYTES).map_err(|error| match error {
        FileError::Large { .. } => "is too large",
        _ => UNREADABLE,
    })
}

/// The type of a drawing.
const SVG: &str = "image/svg+xml";

/// Checks that what may be a drawing has the bounds of one: the renderer would expand and draw it whatever it is. The result is
/// the drawing with the styles that count, if these are not as written.
fn drawable(path: &Path, bytes: &[u8], met: &Mutex<Met>) -> Result<Option<Arc<Vec<u8>>>, &'static str> {
    const EXPANDS: &str = "expands to more than 256 MB";
    let mut text = Cow::Borrowed(bytes);
    if bytes.starts_with(b"\x1f\x8b") {
        let mut unpacked = Vec::new();
        let unpacking = flate2::read::GzDecoder::new(bytes).take(MOST_BYTES + 1).read_to_end(&mut unpacked);
        unpacking.map_err(|_| UNREADABLE)?;
        if unpacked.len() as u64 > MOST_BYTES {
            return Err(EXPANDS);
        }
        text = Cow::Owned(unpacked);
    }
    let Some(mut text) = source::markup(&text) else { return Ok(None) };
    let Ok((styled, unread)) = super::styled(path, &text) else { return Err(UNREADABLE) };
    met.lock().unwrap_or_else(PoisonError::into_inner).notes.extend(unread);
    let changed = styled.is_some();
    text = styled.unwrap_or(text);
    let Ok(document) = super::parsed(path, &text) else { return Err(UNREADABLE) };
    bounds::check(&document).map_err(|_| "is a drawing that is nested too deeply")?;
    drop(document);
    Ok(changed.then(|| Arc::new(text.into_bytes())))
}

/// Why a picture made of pixels cannot be drawn to its end; the renderer leaves it out in silence.
fn fault(picture: &ImageKind, known: &Known) -> Option<&'static str> {
    let (ImageKind::JPEG(bytes) | ImageKind::PNG(bytes) | ImageKind::GIF(bytes) | ImageKind::WEBP(bytes)) =
        picture
    else {
        return None;
    };
    let mut hasher = DefaultHasher::new();
    bytes.hash(&mut hasher);
    let mut known = known.lock().unwrap_or_else(PoisonError::into_inner);
    *known.entry(hasher.finish()).or_insert_with(|| {
        readers::flaw(bytes, MOST_PIXELS).map(|flaw| match flaw {
            Flaw::Damaged => "is damaged or was cut short, so save it again",
            Flaw::Large => "has too many pixels",
        })
    })
}
