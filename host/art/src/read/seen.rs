//! How large art is, before it is read to be printed.
//!
//! Problem: how art is turned and scaled depends on its size, and decides how it is drawn. Method: drafts
//! tell of the pages of a document, the header of a picture of that; everything else is read once, as large
//! as it says. Cost: a tenth of a second; where art is read, that.

use std::path::PathBuf;

use observe::{Diagnosis, Silent};
use sheet::Turn;

use crate::options::{Options, Room};
use crate::read::file;
use crate::read::names::{self, stem};
use crate::read::open::open;
use crate::read::pdf;
use crate::read::size;
use crate::read::svg;

/// What can be known of art before it is read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// Width and length in millimetres, as it is looked at.
    pub size_mm: (f64, f64),
    /// Whether it is a page, whose edges are mostly bare; a picture is drawn up to them.
    pub is_page: bool,
    /// Whether the art says how large it is; else only its shape is known.
    pub is_stated: bool,
}

/// How large art is, which [`open`] reads by these options.
///
/// # Errors
/// As [`open`].
pub fn seen(paths: &[PathBuf], options: &Options) -> Result<Seen, Diagnosis> {
    let shelf = &*options.shelf;
    let mut is_page = false;
    if let [path] = paths
        && !shelf.is_folder(path)
    {
        let start = file::start(shelf, path)?;
        if pdf::is_document(&start) {
            return Ok(Seen { size_mm: pdf::size_mm(path, options)?, is_page: true, is_stated: true });
        }
        is_page = svg::is_svg(shelf, path, &start);
        let bytes = file::whole(shelf, path, file::MOST)?;
        if !is_page && let Some((pixels, stated)) = readers::stated(&bytes, path) {
            let asked = options.dpi.map(|dpi| (dpi, dpi)).or(stated);
            // Layers and reserved colours are drawn dot for dot.
            let is_layer = options.reserves() || names::ink(&stem(path)).is_some();
            let assumed = is_layer.then_some((size::DPI, size::DPI));
            let (x, y) = asked.or(assumed).unwrap_or((size::DPI, size::DPI));
            let size_mm = (25.4 * f64::from(pixels.0) / x, 25.4 * f64::from(pixels.1) / y);
            return Ok(Seen { size_mm, is_page: false, is_stated: asked.or(assumed).is_some() });
        }
    }
    let room = Room { cut: true, ..options.room };
    let art = open(paths, &Options { scale: 1.0, turn: Turn::None, room, ..options.clone() }, &Silent)?;
    let across = options.across.max(1) as f64;
    let size_mm = (size::MM * art.width as f64 / across, size::MM * art.length as f64);
    Ok(Seen { size_mm, is_page, is_stated: true })
}
