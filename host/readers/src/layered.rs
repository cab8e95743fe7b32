//! OpenRaster and Krita files: a list of layers, and the picture of each.
//!
//! Problem: painting programs keep layers that lie anywhere on the canvas, are shown or hidden, and shine through.
//! Method: an OpenRaster file is a zip archive of a PNG for each layer and a list of them, uppermost first.
//! The list becomes [`Node`]s from the bottom up, each with what the groups around it make of it; any of them
//! are drawn on the canvas. Krita's own files have layers in a format of their own; of them only the names
//! are read. Both hold a merged picture. Cost: four bytes a pixel of the layers that are drawn at once.
//! Limits: the caller's for the canvas and for each layer, four times as many pixels in all, [`MOST_LAYERS`],
//! entries that are stored or deflated; blend modes and filters are not applied. Source: the OpenRaster
//! specification 0.0.5, freedesktop.org; `maindoc.xml` of files by Krita.

use std::io::{Cursor, Read as _};
use std::path::{Path, PathBuf};

use observe::Diagnosis;
use roxmltree::{Document, ParsingOptions};
use zip::ZipArchive;

use crate::picture::Picture;
use crate::read::{read, size};
use crate::request::Request;
use crate::resolution::{Dpi, RESOLUTIONS};

/// The most layers, and the most entries of an archive.
const MOST_LAYERS: usize = 256;
const MOST_ENTRIES: usize = 4096;

/// The most bytes of the list of layers, and of any other entry.
const MOST_LIST: u64 = 1 << 22;
const MOST_ENTRY: u64 = 1 << 28;

/// How deep groups may lie in each other.
const MOST_DEEP: usize = 64;

/// The list of layers in OpenRaster, that of Krita, and the merged picture in both.
const STACK: &str = "stack.xml";
const KRITA: &str = "maindoc.xml";
const MERGED: &str = "mergedimage.png";

/// Whether these are the first bytes of such a file: the first entry says so, uncompressed.
pub fn is_layered(start: &[u8]) -> bool {
    let says = |kind: &[u8]| start.windows(kind.len()).any(|part| part == kind);
    start.starts_with(b"PK\x03\x04")
        && start.get(30..).is_some_and(|rest| rest.starts_with(b"mimetype"))
        && (says(b"image/openraster") || says(b"application/x-krita") || says(b"application/x-kra"))
}

/// A layer or a group of them.
#[derive(Clone, Debug, Default)]
pub struct Node {
    /// Its name, without control characters.
    pub name: String,
    /// The group around it, by its place in the list.
    pub within: Option<usize>,
    /// Whether it or a group around it is hidden.
    pub hidden: bool,
    /// How much shines through it and the groups around it: 1 is opaque.
    pub opacity: f64,
    /// Whether it is a layer, which has pixels.
    pub is_layer: bool,
    /// The entry of its picture.
    entry: Option<String>,
    /// Its place on the canvas.
    at: (i64, i64),
}

/// A file of layers.
pub struct Layered {
    archive: ZipArchive<Cursor<Vec<u8>>>,
    name: PathBuf,
    /// Whether it is one of Krita's, of which only the names of layers are known.
    pub is_krita: bool,
    /// Pixels of the canvas; nothing if it is not stated.
    pub size: (u32, u32),
    /// Pixels per inch, if the file states them.
    pub resolution: Option<Dpi>,
    /// Its groups and layers from the bottom up, each behind the group around it.
    pub nodes: Vec<Node>,
    /// How many pixels its layers may still have.
    left: u64,
}

impl Layered {
    /// Reads the list of layers. `name` is that of the file, for messages.
    ///
    /// # Errors
    /// A damaged archive or list, or more than any program writes.
    pub fn open(bytes: Vec<u8>, name: &Path, request: &Request<'_>) -> Result<Layered, Diagnosis> {
        let wrong = |problem: String| Diagnosis::of_file(name, problem);
        let damaged =
            |error: zip::result::ZipError| wrong(format!("it is no archive that can be read: {error}"));
        let mut archive = ZipArchive::new(Cursor::new(bytes)).map_err(damaged)?;
        if archive.len() > MOST_ENTRIES {
            return Err(wrong(format!("the archive has more than {MOST_ENTRIES} entries")));
        }
        if archive.has_overlapping_entries().map_err(damaged)? {
            return Err(wrong(
                "entries of the archive share their bytes; no honest archive does that".into(),
            ));
        }
        let is_krita = archive.index_for_name(STACK).is_none();
        let left = 4 * request.pixels;
        let nodes = Vec::new();
        let (size, resolution) = ((0, 0), None);
        let mut file = Layered { archive, name: name.into(), is_krita, size, resolution, nodes, left };
        let text = file.entry(if is_krita { KRITA } else { STACK }, MOST_LIST)?;
        let text = match String::from_utf8(text) {
            Ok(text) => text,
            Err(error) if is_krita => String::from_utf8_lossy(error.as_bytes()).into_owned(),
            Err(_) => return Err(wrong("its list of layers is not UTF-8".into())),
        };
        // Krita writes a document type.
        let parsing = ParsingOptions { allow_dtd: is_krita, ..ParsingOptions::default() };
        let document = Document::parse_with_options(&text, parsing)
            .map_err(|error| wrong(format!("its list of layers cannot be read: {error}")))?;
        if is_krita {
            file.list_of_krita(&document)
        } else {
            file.list(&document)?
        }
        Ok(file)
    }

    /// What OpenRaster says.
    fn list(&mut self, document: &Document<'_>) -> Result<(), Diagnosis> {
        let image = document.root_element();
        let number = |node: roxmltree::Node<'_, '_>, name: &str| {
            node.attribute(name).and_then(|v| v.trim().parse::<f64>().ok())
        };
        let side =
            |name| number(image, name).filter(|side| (1.0..1e6).contains(side)).map_or(0, |side| side as u32);
        self.size = (side("w"), side("h"));
        self.resolution = plausible(number(image, "xres").zip(number(image, "yres")));
        let mut count = 0;
        // A part of the list, the group around it, and how deep it lies.
        let mut waiting = vec![(image, None::<usize>, 0)];
        while let Some((node, within, deep)) = waiting.pop() {
            if deep > MOST_DEEP || count > MOST_LAYERS {
                let problem = format!("it has more than {MOST_LAYERS} layers, or groups {MOST_DEEP} deep");
                return Err(Diagnosis::of_file(&self.name, problem));
            }
            let around = within.map(|at| &self.nodes[at]);
            let opacity = around.map_or(1.0, |node| node.opacity)
                * number(node, "opacity").map_or(1.0, |opacity| opacity.clamp(0.0, 1.0));
            let hidden = around.is_some_and(|node| node.hidden)
                || node.attribute("visibility") == Some("hidden")
                || opacity == 0.0;
            let children =
                node.children().filter(|child| child.has_tag_name("stack") || child.has_tag_name("layer"));
            // The uppermost comes first, so the last of them is taken from the stack first.
            waiting.extend(children.map(|child| (child, Some(self.nodes.len()), deep + 1)));
            let place = |name| number(node, name).map_or(0, |v| v.clamp(-1e6, 1e6) as i64);
            let is_layer = node.has_tag_name("layer");
            count += usize::from(is_layer);
            self.nodes.push(Node {
                name: plain(node.attribute("name").unwrap_or_default()),
                within,
                hidden,
                opacity,
                is_layer: is_layer && node.has_attribute("src"),
                entry: node.attribute("src").map(String::from),
                at: (place("x"), place("y")),
            });
        }
        Ok(())
    }

    /// What Krita says.
    fn list_of_krita(&mut self, document: &Document<'_>) {
        let image = document.descendants().find(|node| node.tag_name().name() == "IMAGE");
        let number = |name| image?.attribute(name)?.trim().parse::<f64>().ok();
        self.resolution = plausible(number("x-res").zip(number("y-res")));
        let layers = document.descendants().filter(|node| node.tag_name().name() == "layer");
        self.nodes = layers
            .filter_map(|layer| layer.attribute("name"))
            .map(|name| Node { name: plain(name), opacity: 1.0, ..Node::default() })
            .collect();
    }

    /// The bytes of an entry. What the archive says about its size is not believed.
    fn entry(&mut self, name: &str, most: u64) -> Result<Vec<u8>, Diagnosis> {
        let wrong = |problem: String| Diagnosis::of_file(&self.name, problem);
        let entry = self.archive.by_name(name);
        let entry = entry.map_err(|error| wrong(format!("its part `{name}` cannot be read: {error}")))?;
        let mut bytes = Vec::new();
        let unpacked = entry.take(most + 1).read_to_end(&mut bytes);
        unpacked.map_err(|error| wrong("cannot unpack it".into()).because(error))?;
        if bytes.len() as u64 > most {
            return Err(wrong(format!("its part `{name}` expands to more than {} MB", most >> 20)));
        }
        Ok(bytes)
    }

    /// Refuses a canvas, or a layer, of another size than allowed.
    ///
    /// # Errors
    /// No pixel, or more than the caller allows.
    pub fn check(
        &self,
        what: &str,
        (width, height): (u32, u32),
        request: &Request<'_>,
    ) -> Result<(), Diagnosis> {
        let pixels = u64::from(width) * u64::from(height);
        if pixels == 0 || pixels > request.pixels {
            let problem =
                format!("its {what} is {width} x {height} pixels; expected 1 to {} in all", request.pixels);
            return Err(Diagnosis::of_file(&self.name, problem));
        }
        Ok(())
    }

    /// Draws layers on the canvas, each with an opacity, from the bottom up: `row` has red, green, blue and
    /// opacity of each row. Messages call them `what`.
    ///
    /// # Errors
    /// A layer that is damaged or too large.
    pub fn draw(
        &mut self,
        parts: &[(usize, f64)],
        what: &str,
        request: &Request<'_>,
        mut each: impl FnMut(&[u8]),
    ) -> Result<(), Diagnosis> {
        let (width, height) = (self.size.0 as usize, self.size.1);
        let mut pictures = Vec::new();
        for &(node, opacity) in parts {
            let Node { entry, at, .. } = self.nodes[node].clone();
            let bytes = self.entry(&entry.unwrap_or_default(), MOST_ENTRY)?;
            let wrong = |problem: String| Diagnosis::of_file(&self.name, problem);
            let own = size(Cursor::new(&bytes))
                .ok_or_else(|| wrong(format!("its {what} is no picture that can be read")))?;
            self.check(what, own, request)?;
            let left = self.left.checked_sub(u64::from(own.0) * u64::from(own.1));
            self.left = left.ok_or_else(|| wrong("its layers have too many pixels together".into()))?;
            let picture = read(bytes, &self.name, &Request { page: None, planes: None, ..*request })?;
            let wide = picture.size.0 as usize;
            let rgba = picture.colours.map_or_else(Vec::new, |colours| colours.into_rgba());
            pictures.push((rgba, wide, at, opacity));
        }
        let mut row = vec![0; 4 * width];
        for y in 0..i64::from(height) {
            row.fill(0);
            let own = row.as_chunks_mut::<4>().0;
            for (rgba, wide, at, opacity) in &pictures {
                let Ok(line) = usize::try_from(y - at.1) else { continue };
                let Some(line) = rgba.get(4 * wide * line..4 * wide * (line + 1)) else { continue };
                let pixels = line.as_chunks::<4>().0;
                let from = (-at.0).clamp(0, *wide as i64);
                let to = (width as i64 - at.0).clamp(from, *wide as i64);
                for x in from..to {
                    over(&mut own[(x + at.0) as usize], pixels[x as usize], *opacity);
                }
            }
            each(&row);
        }
        Ok(())
    }

    /// The merged picture, if there is one.
    ///
    /// # Errors
    /// A picture that is damaged or too large.
    pub fn merged(&mut self, request: &Request<'_>) -> Result<Option<Picture>, Diagnosis> {
        if self.archive.index_for_name(MERGED).is_none() {
            return Ok(None);
        }
        let bytes = self.entry(MERGED, MOST_ENTRY)?;
        let mut picture = read(bytes, &self.name, &Request { page: None, planes: None, ..*request })?;
        picture.resolution = self.resolution.or(picture.resolution);
        Ok(Some(picture))
    }
}

fn plausible(dpi: Option<Dpi>) -> Option<Dpi> {
    dpi.filter(|(x, y)| RESOLUTIONS.contains(x) && RESOLUTIONS.contains(y))
}

fn plain(name: &str) -> String {
    name.chars().filter(|c| !c.is_control()).collect()
}

/// Lays a pixel over another; both have straight alpha.
fn over(under: &mut [u8; 4], top: [u8; 4], opacity: f64) {
    let (a, b) = (f64::from(top[3]) / 255.0 * opacity, f64::from(under[3]) / 255.0);
    let all = a + b * (1.0 - a);
    if all == 0.0 {
        return;
    }
    for c in 0..3 {
        let mixed = f64::from(top[c]) * a + f64::from(under[c]) * b * (1.0 - a);
        under[c] = (mixed / all).round() as u8;
    }
    under[3] = (255.0 * all).round() as u8;
}
