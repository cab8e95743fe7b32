//! The files of art, read whole or by their first bytes, and the pictures in them.
//!
//! Method: a file is refused by its size before it is read. Cost: its bytes in memory. Limits: a gigabyte,
//! [`MOST_PIXELS`] pixels.

use std::fs::File;
use std::io::{BufReader, Read as _};
use std::path::Path;

use observe::Diagnosis;
use readers::{Picture, Request};

use crate::error::{io, several_pages, wrong};

/// The most pixels of a picture: a page at 1200 dpi.
const MOST_PIXELS: u64 = 1 << 28;

/// The most bytes of a file.
pub(crate) const MOST: (u64, &str) = (1 << 30, "a gigabyte");

/// How much of a file tells its format.
const START: u64 = 1 << 12;

/// What is asked of a picture in colours.
pub(crate) const PICTURE: Request<'static> = Request {
    page: None,
    planes: None,
    pixels: MOST_PIXELS,
    room: "a page at 1200 dpi",
    besides: ", SVG, PDF or PostScript",
};

/// The first bytes of a file.
pub(crate) fn start(path: &Path) -> Result<Vec<u8>, Diagnosis> {
    let mut start = Vec::new();
    let opened = File::open(path).map_err(io(path, "open it"))?;
    opened.take(START).read_to_end(&mut start).map_err(io(path, "read it"))?;
    Ok(start)
}

/// All bytes of a file that has at most so many, in words.
pub(crate) fn whole(path: &Path, (most, words): (u64, &str)) -> Result<Vec<u8>, Diagnosis> {
    let file = File::open(path).map_err(io(path, "open it"))?;
    let stated = file.metadata().map_err(io(path, "read its size"))?.len();
    let mut bytes = Vec::new();
    if stated <= most {
        // It may have grown since.
        file.take(most + 1).read_to_end(&mut bytes).map_err(io(path, "read it"))?;
    }
    if stated > most || bytes.len() as u64 > most {
        return Err(wrong(path, format!("the file is larger than {words}")));
    }
    Ok(bytes)
}

/// The picture in a file; of a TIFF with several pages the one of this number.
pub(crate) fn picture(path: &Path, page: Option<u32>) -> Result<Picture, Diagnosis> {
    picture_of(path, whole(path, MOST)?, &Request { page, ..PICTURE })
}

/// The picture in these bytes of a file.
pub(crate) fn picture_of(path: &Path, bytes: Vec<u8>, asked: &Request<'_>) -> Result<Picture, Diagnosis> {
    if asked.page.is_none() && readers::is_tiff(&bytes) {
        let pages: Vec<u32> = (1..).take(readers::pages(&bytes)).collect();
        if pages.len() > 1 {
            return Err(several_pages(path, &pages));
        }
    }
    readers::read(bytes, path, asked)
}

/// Pixels across and down of a picture, if it is one.
pub(crate) fn size(path: &Path) -> Option<(u32, u32)> {
    readers::size(BufReader::new(File::open(path).ok()?))
}
