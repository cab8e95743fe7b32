//! The files of art, read whole or by their first bytes, and the pictures in them.
//!
//! Method: a file is refused by its size before it is read. Cost: its bytes in memory. Limits: a gigabyte,
//! [`MOST_PIXELS`] pixels.

use std::io::BufReader;
use std::path::Path;

use files::FileError;
use files::shelf::{Disk, Shelf};
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
    finest: None,
    room: "a page at 1200 dpi",
    besides: ", OpenRaster, SVG, PDF or PostScript",
};

/// The first bytes of a file.
pub(crate) fn start(shelf: &dyn Shelf, path: &Path) -> Result<Vec<u8>, Diagnosis> {
    shelf.start(path, START).map_err(io(path, "open it"))
}

/// All bytes of a file that has at most so many, in words.
pub(crate) fn whole(
    shelf: &dyn Shelf,
    path: &Path,
    (most, words): (u64, &str),
) -> Result<Vec<u8>, Diagnosis> {
    shelf.read(path, most).map_err(|error| match error {
        FileError::Io { source, .. } => io(path, "read it")(source),
        _ => wrong(path, format!("the file is larger than {words}")),
    })
}

/// The picture in a file; of a TIFF with several pages the one of this number.
pub(crate) fn picture(shelf: &dyn Shelf, path: &Path, page: Option<u32>) -> Result<Picture, Diagnosis> {
    picture_of(path, whole(shelf, path, MOST)?, &Request { page, ..PICTURE })
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

/// Pixels across and down of a picture on disk, if it is one.
pub(crate) fn size(path: &Path) -> Option<(u32, u32)> {
    readers::size(BufReader::new(Disk.open(path).ok()?))
}
