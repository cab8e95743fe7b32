//! A drawing, or a layer of it, rendered to dots without soft edges.
//!
//! Problem: the renderer leaves out what it cannot load, and says so nowhere. It gives each layer of the drawing as much memory as
//! the drawing, or many times that.
//! Method: pictures ([`links`](super::links)) and fonts are loaded here, so a picture that is missing or damaged is an error, and a
//! drawing can also be rendered without its pictures or its text. A drawing that needs too much memory is an error
//! ([`bounds`](super::bounds)). Cost: four bytes a dot. Limits: layers cannot be made smaller: the renderer gives them up to five times
//! the height of whatever part is rendered, so that bands of rows took longer and hardly less.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use files::shelf::Shelf;
use observe::Diagnosis;
use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg;

use super::fonts::{DEFAULT, Fonts};
use super::links::{Known, Met, Without};
use super::{bounds, links, thin};
use crate::error::wrong;

/// Renders drawings from one file.
pub(super) struct Renderer {
    shelf: Arc<dyn Shelf>,
    path: PathBuf,
    /// Pixels in an inch.
    per_inch: f64,
    fonts: Fonts,
    known: Known,
}

/// A drawing as the renderer understands it.
pub(super) struct Drawn {
    pub tree: usvg::Tree,
    /// Whether pictures made of pixels are drawn.
    pub pictures: bool,
    /// Notes on drawings within it.
    pub notes: Vec<String>,
}

impl Renderer {
    /// `text` says whether the drawing needs fonts, `per_inch` how many pixels an inch has.
    pub fn new(
        shelf: &Arc<dyn Shelf>,
        path: &Path,
        text: bool,
        per_inch: f64,
    ) -> Result<Renderer, Diagnosis> {
        let fonts = if text { Fonts::load(path)? } else { Fonts::none() };
        let (shelf, path) = (Arc::clone(shelf), path.to_path_buf());
        Ok(Renderer { shelf, path, per_inch, fonts, known: Known::default() })
    }

    /// Whether text can be drawn.
    pub fn has_fonts(&self) -> bool {
        !self.fonts.is_empty()
    }

    /// The families that are not installed of the drawings that were read, each with what is drawn instead, in words.
    pub fn missing_fonts(&self) -> Option<String> {
        self.fonts.missing()
    }

    /// The characters of its text that no font has, in words.
    pub fn characters_without_glyph(&self) -> Option<String> {
        self.fonts.characters()
    }

    /// Reads a drawing.
    pub fn parsed(&self, text: &str, without: Without) -> Result<Drawn, Diagnosis> {
        let met = Arc::new(Mutex::new(Met::default()));
        let options = self.options(without, &met);
        let tree = usvg::Tree::from_str(text, &options).map_err(|error| self.unreadable(&error))?;
        drop(options);
        let met = std::mem::take(&mut *met.lock().unwrap_or_else(PoisonError::into_inner));
        match met.missing {
            Some(problem) => Err(wrong(&self.path, problem)),
            None => Ok(Drawn { tree, pictures: met.pictures, notes: met.notes }),
        }
    }

    /// A drawing of which nothing is printed: pictures may be missing. Its size may follow from all that is drawn in it.
    pub fn tree(&self, text: &str) -> Result<usvg::Tree, Diagnosis> {
        let options = self.options(Without::Nothing, &Arc::default());
        usvg::Tree::from_str(text, &options).map_err(|error| self.unreadable(&error))
    }

    fn unreadable(&self, error: &usvg::Error) -> Diagnosis {
        wrong(&self.path, format!("the drawing cannot be read: {error}"))
    }

    /// Renders a drawing; the result has straight alpha.
    pub fn rendered(
        &self,
        drawn: &Drawn,
        scale: Transform,
        (width, height): (u32, u32),
    ) -> Result<Vec<u8>, Diagnosis> {
        let options = self.options(Without::Nothing, &Arc::default());
        let thick = thin::thickened(&drawn.tree, scale, &options);
        let tree = thick.as_ref().unwrap_or(&drawn.tree);
        let need = bounds::need(tree, scale, (width, height));
        if need > bounds::MOST_BYTES {
            let problem = format!("drawing it needs {:.0} MB of memory", need / f64::from(1 << 20));
            return Err(wrong(&self.path, problem).hint(
                "make the tiles of its patterns smaller and nest fewer groups with clips, masks or opacity, or export it as PNG",
            ));
        }
        let mut pixmap =
            Pixmap::new(width, height).ok_or_else(|| wrong(&self.path, "the drawing is too large"))?;
        resvg::render(tree, scale, &mut pixmap.as_mut());
        Ok(straight(pixmap))
    }

    fn options(&self, without: Without, met: &Arc<Mutex<Met>>) -> usvg::Options<'static> {
        let fonts = if without == Without::Text { Arc::default() } else { self.fonts.database() };
        usvg::Options {
            resources_dir: self.path.parent().map(Path::to_path_buf),
            dpi: self.per_inch as f32,
            shape_rendering: usvg::ShapeRendering::CrispEdges,
            text_rendering: usvg::TextRendering::OptimizeSpeed,
            fontdb: fonts,
            font_family: DEFAULT.into(),
            font_resolver: self.fonts.resolver(),
            image_href_resolver: links::resolver(&self.shelf, &self.path, without, met, &self.known),
            ..usvg::Options::default()
        }
    }
}

/// Straight alpha from the renderer's premultiplied alpha.
fn straight(pixmap: Pixmap) -> Vec<u8> {
    let mut rgba = pixmap.take();
    for pixel in rgba.as_chunks_mut::<4>().0 {
        let alpha = u32::from(pixel[3]);
        if alpha != 0 && alpha != 255 {
            for v in &mut pixel[..3] {
                *v = ((u32::from(*v) * 255 + alpha / 2) / alpha).min(255) as u8;
            }
        }
    }
    rgba
}
