//! A drawing, or a layer of it, rendered to dots without soft edges.
//!
//! Problem: the renderer leaves out what it cannot load, and says so nowhere.
//! Method: linked pictures and fonts are loaded here, so a picture that is missing or damaged is an error, and a drawing can
//! also be rendered without its pictures or its text. Cost: four bytes a dot, and each picture is decoded once more. Limits: drawings within a linked drawing may hold
//! pictures, but not link them, as SVG demands.

use std::borrow::Cow;
use std::collections::HashMap;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use image::{ImageError, ImageFormat};
use observe::Diagnosis;
use percent_encoding::percent_decode_str;
use pictures::{Bounds, Opened};
use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{self, ImageHrefResolver, ImageKind};

use super::super::decode::whole_jpeg;
use super::super::error::wrong;
use super::fonts::{DEFAULT, Fonts};
use super::thin;

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
struct Met {
    pictures: bool,
    /// What is wrong with the first picture that cannot be drawn, and what to do.
    missing: Option<String>,
}

/// Whether pictures are whole, by their bytes.
type Known = Arc<Mutex<HashMap<u64, bool>>>;

/// Renders drawings from one file.
pub(super) struct Renderer {
    path: PathBuf,
    fonts: Fonts,
    known: Known,
}

/// A drawing as the renderer understands it.
pub(super) struct Drawn {
    pub tree: usvg::Tree,
    /// Whether pictures made of pixels are drawn.
    pub pictures: bool,
}

impl Renderer {
    /// `text` says whether the drawing needs fonts.
    pub fn new(path: &Path, text: bool) -> Result<Renderer, Diagnosis> {
        let fonts = if text { Fonts::load(path)? } else { Fonts::none() };
        Ok(Renderer { path: path.to_path_buf(), fonts, known: Known::default() })
    }

    /// Whether text can be drawn.
    pub fn has_fonts(&self) -> bool {
        !self.fonts.is_empty()
    }

    /// The families that are not installed of the drawings that were read, each with what is drawn instead, in words.
    pub fn missing_fonts(&self) -> Option<String> {
        self.fonts.missing()
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
            None => Ok(Drawn { tree, pictures: met.pictures }),
        }
    }

    /// The size of a drawing, which may follow from all that is drawn in it.
    pub fn size(&self, text: &str) -> Result<usvg::Size, Diagnosis> {
        // Pictures that are missing matter only where they are printed.
        let tree = usvg::Tree::from_str(text, &self.options(Without::Nothing, &Arc::default()));
        tree.map(|tree| tree.size()).map_err(|error| self.unreadable(&error))
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
        let mut pixmap =
            Pixmap::new(width, height).ok_or_else(|| wrong(&self.path, "the drawing is too large"))?;
        let options = self.options(Without::Nothing, &Arc::default());
        let thick = thin::thickened(&drawn.tree, scale, &options);
        resvg::render(thick.as_ref().unwrap_or(&drawn.tree), scale, &mut pixmap.as_mut());
        Ok(straight(pixmap))
    }

    fn options(&self, without: Without, met: &Arc<Mutex<Met>>) -> usvg::Options<'static> {
        let fonts = if without == Without::Text { Arc::default() } else { self.fonts.database() };
        usvg::Options {
            resources_dir: self.path.parent().map(Path::to_path_buf),
            shape_rendering: usvg::ShapeRendering::CrispEdges,
            text_rendering: usvg::TextRendering::OptimizeSpeed,
            fontdb: fonts,
            font_family: DEFAULT.into(),
            font_resolver: self.fonts.resolver(),
            image_href_resolver: pictures(without, met, &self.known),
            ..usvg::Options::default()
        }
    }
}

/// Loads pictures, and takes down what it met.
fn pictures(without: Without, met: &Arc<Mutex<Met>>, known: &Known) -> ImageHrefResolver<'static> {
    let known = known.clone();
    let taken = move |met: &Mutex<Met>, kind: Option<ImageKind>, name: &str, remedy: &str| {
        let mut met = met.lock().unwrap_or_else(PoisonError::into_inner);
        match kind {
            Some(drawing @ ImageKind::SVG(_)) => Some(drawing),
            Some(picture) if !is_whole(&picture, &known) => {
                let problem =
                    || format!("its picture {name} is damaged or was cut short; save it again and {remedy}");
                met.missing.get_or_insert_with(problem);
                None
            }
            Some(picture) => {
                met.pictures = true;
                (without != Without::Pictures).then_some(picture)
            }
            None => {
                met.missing.get_or_insert_with(|| format!("its picture {name} cannot be read; {remedy}"));
                None
            }
        }
    };
    let (data, string) =
        (ImageHrefResolver::default_data_resolver(), ImageHrefResolver::default_string_resolver());
    let (of_data, of_string) = (met.clone(), met.clone());
    let of_link = taken.clone();
    ImageHrefResolver {
        resolve_data: Box::new(move |mime, bytes, options| {
            let kind = data(mime, bytes, options);
            taken(&of_data, kind, &format!("of the type `{mime}`"), "embed it as PNG")
        }),
        resolve_string: Box::new(move |href, options| {
            // Links are addresses, so a space is written `%20`.
            let local = href.strip_prefix("file://").unwrap_or(href);
            let plain = percent_decode_str(local).decode_utf8().unwrap_or(Cow::Borrowed(local));
            let kind = string(href, options).or_else(|| string(&plain, options));
            let remedy = "put it where the drawing links it, or embed it as PNG";
            of_link(&of_string, kind, &format!("`{href}`"), remedy)
        }),
    }
}

/// Whether a picture made of pixels can be decoded to its end; the renderer leaves it out in silence if not.
fn is_whole(picture: &ImageKind, known: &Known) -> bool {
    let (bytes, format) = match picture {
        ImageKind::JPEG(bytes) => (bytes, ImageFormat::Jpeg),
        ImageKind::PNG(bytes) => (bytes, ImageFormat::Png),
        ImageKind::GIF(bytes) => (bytes, ImageFormat::Gif),
        ImageKind::WEBP(bytes) => (bytes, ImageFormat::WebP),
        ImageKind::SVG(_) => return true,
    };
    let mut hasher = DefaultHasher::new();
    bytes.hash(&mut hasher);
    let mut known = known.lock().unwrap_or_else(PoisonError::into_inner);
    *known.entry(hasher.finish()).or_insert_with(|| {
        let ends = format != ImageFormat::Jpeg || whole_jpeg(Path::new(""), bytes).is_ok();
        // What is too large to look at is not damaged.
        ends && matches!(
            pictures::open(bytes, format, Bounds { side: None, bytes: 512 << 20 }).and_then(Opened::decode),
            Ok(_) | Err(ImageError::Limits(_) | ImageError::Unsupported(_))
        )
    })
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
