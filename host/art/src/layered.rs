//! OpenRaster and Krita files: layers named after inks, or one picture.
//!
//! Problem: painting programs keep layers that lie anywhere on the canvas, are shown or hidden, and shine through.
//! Method: an OpenRaster file is a zip archive of a PNG for each layer and a list of them, uppermost first. A layer or group that is
//! named after an ink is a layer of it, at its place on the canvas; what is drawn in one colour is ink, of several colours the dark
//! ([`Coverage`](super::coverage::Coverage)). Its opacity is how its owner looks at it, unless its tones are kept. Without such a
//! layer the merged picture is printed. Krita's own files have layers in a format of their own; of them the merged picture is read.
//! Cost: two bytes a pixel of the canvas and four a pixel of a layer. Limits: [`MOST_PIXELS`] on the canvas and in a layer, as many again four
//! times in all layers, [`MOST_LAYERS`], entries that are stored or deflated; blend modes and filters are not applied.
//! Source: the OpenRaster specification 0.0.5, freedesktop.org; `maindoc.xml` of files by Krita.

use std::fs::File;
use std::io::{BufReader, Cursor, Read as _, Seek};
use std::path::Path;

use observe::{Diagnosis, Observer};
use readers::resolution::{Dpi, RESOLUTIONS};
use resvg::usvg::roxmltree::{Document, Node};
use zip::ZipArchive;

use super::artwork::Artwork;
use super::coverage::{CoverageBuilder, Scan};
use super::error::{NamedPart, io, nothing, unknown_ink, wrong};
use super::names::{self, Named, stem};
use super::options::Options;
use super::picture;
use super::size::{self, Unstated};
use super::{cut_lines, decode};

/// The most pixels of a canvas, and of a layer: twice a page at 600 dpi.
const MOST_PIXELS: u64 = 1 << 26;

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

/// The most parts that a note lists.
const LISTED: usize = 12;

/// Whether these are the first bytes of such a file: the first entry says so, uncompressed.
pub(super) fn is_layered(start: &[u8]) -> bool {
    let says = |kind: &[u8]| start.windows(kind.len()).any(|part| part == kind);
    start.starts_with(b"PK\x03\x04")
        && start.get(30..).is_some_and(|rest| rest.starts_with(b"mimetype"))
        && (says(b"image/openraster") || says(b"application/x-krita") || says(b"application/x-kra"))
}

/// A picture of a layer.
struct Part {
    src: String,
    at: (i64, i64),
    opacity: f64,
}

/// A layer of ink.
struct InkLayer {
    label: String,
    named: Named,
    /// From the bottom up.
    parts: Vec<Part>,
    /// Whether all of it is hidden.
    hidden: bool,
}

/// What the list of layers says.
#[derive(Default)]
struct Listed {
    size: (u32, u32),
    dpi: Option<Dpi>,
    /// From the bottom up.
    layers: Vec<InkLayer>,
    /// Names of layers that are shown and belong to no ink.
    others: Vec<String>,
    notes: Vec<String>,
}

/// Reads a file.
pub(super) fn read(path: &Path, options: &Options, observer: &dyn Observer) -> Result<Artwork, Diagnosis> {
    let file = BufReader::new(File::open(path).map_err(io(path, "open it"))?);
    let damaged =
        |error: zip::result::ZipError| wrong(path, format!("it is no archive that can be read: {error}"));
    let mut archive = ZipArchive::new(file).map_err(damaged)?;
    if archive.len() > MOST_ENTRIES {
        return Err(wrong(path, format!("the archive has more than {MOST_ENTRIES} entries")));
    }
    if archive.has_overlapping_entries().map_err(damaged)? {
        return Err(wrong(path, "entries of the archive share their bytes; no honest archive does that"));
    }
    if archive.index_for_name(STACK).is_none() {
        return krita(path, &mut archive, options);
    }
    let text = String::from_utf8(entry(path, &mut archive, STACK, MOST_LIST)?)
        .map_err(|_| wrong(path, "its list of layers is not UTF-8"))?;
    let document = Document::parse(&text)
        .map_err(|error| wrong(path, format!("its list of layers cannot be read: {error}")))?;
    let mut listed = listed(path, document.root_element())?;
    let mut notes = std::mem::take(&mut listed.notes);
    if listed.layers.iter().all(|layer| layer.hidden) {
        if !listed.layers.is_empty() {
            notes.push(format!(
                "{}: printed as a picture, since all layers named after inks are hidden; show them to print them as layers",
                path.display()
            ));
        }
        return merged(path, &mut archive, listed.dpi, notes, options);
    }
    if !listed.others.is_empty() {
        notes.push(left_out(path, &listed.others));
    }
    let (width, height) = listed.size;
    check(path, "canvas", (width.into(), height.into()))?;
    let sides = (f64::from(width), f64::from(height));
    let dots = size::dots(path, sides, listed.dpi, Unstated::PixelPerDot, options, &mut notes)?;
    observer.begin("reading layers", listed.layers.len() as u64);
    let mut art = Artwork::blank(&stem(path), dots);
    let mut left = 4 * MOST_PIXELS;
    for layer in &listed.layers {
        if layer.hidden {
            notes.push(format!(
                "{}: layer `{}` is hidden: left out; show it to print it",
                path.display(),
                layer.label
            ));
            continue;
        }
        let toned = options.tones.contains(layer.named.ink);
        let faint = layer.parts.iter().map(|part| part.opacity).fold(1.0, f64::min);
        if faint < 1.0 && !toned {
            notes.push(format!(
                "{}: layer `{}` is shown at {:.0} % opacity, which ink does not have: printed in full",
                path.display(),
                layer.label,
                100.0 * faint
            ));
        }
        let scan = scan(path, &mut archive, layer, (&listed, toned), &mut left)?;
        art.add(scan, &layer.label, layer.named, false, options);
        observer.advance(1);
    }
    observer.end();
    art.opaque = Some(art.drawn.clone());
    art.notes.append(&mut notes);
    Ok(art)
}

/// Refuses what is larger than any page.
fn check(path: &Path, what: &str, (width, height): (u64, u64)) -> Result<(), Diagnosis> {
    if width == 0 || height == 0 || width.saturating_mul(height) > MOST_PIXELS {
        let problem = format!("its {what} is {width} x {height} pixels; expected 1 to {MOST_PIXELS} in all");
        return Err(wrong(path, problem));
    }
    Ok(())
}

/// The bytes of an entry. What the archive says about its size is not believed.
fn entry(
    path: &Path,
    archive: &mut ZipArchive<impl std::io::Read + Seek>,
    name: &str,
    most: u64,
) -> Result<Vec<u8>, Diagnosis> {
    let entry = archive.by_name(name);
    let entry = entry.map_err(|error| wrong(path, format!("its part `{name}` cannot be read: {error}")))?;
    let mut bytes = Vec::new();
    entry.take(most + 1).read_to_end(&mut bytes).map_err(io(path, "unpack it"))?;
    if bytes.len() as u64 > most {
        return Err(wrong(path, format!("its part `{name}` expands to more than {} MB", most >> 20)));
    }
    Ok(bytes)
}

/// What the list of layers says.
fn listed(path: &Path, image: Node<'_, '_>) -> Result<Listed, Diagnosis> {
    let number =
        |node: Node<'_, '_>, name: &str| node.attribute(name).and_then(|v| v.trim().parse::<f64>().ok());
    let side =
        |name| number(image, name).filter(|side| (1.0..1e6).contains(side)).map_or(0, |side| side as u32);
    let dpi = number(image, "xres").zip(number(image, "yres"));
    let dpi = dpi.filter(|(x, y)| RESOLUTIONS.contains(x) && RESOLUTIONS.contains(y));
    let mut listed = Listed { size: (side("w"), side("h")), dpi, ..Listed::default() };
    let (mut slips, mut count) = (Vec::new(), 0);
    // A part of the list, the layer of ink around it, whether that is hidden, its opacity, and how deep it lies.
    let mut waiting: Vec<(Node, Option<usize>, bool, f64, usize)> = vec![(image, None, false, 1.0, 0)];
    while let Some((node, mut within, hidden, opacity, deep)) = waiting.pop() {
        let name: String =
            node.attribute("name").unwrap_or_default().chars().filter(|c| !c.is_control()).collect();
        let hidden = hidden || node.attribute("visibility") == Some("hidden");
        let opacity = opacity * number(node, "opacity").map_or(1.0, |opacity| opacity.clamp(0.0, 1.0));
        let hidden = hidden || opacity == 0.0;
        if deep > MOST_DEEP || count > MOST_LAYERS {
            return Err(wrong(
                path,
                format!("it has more than {MOST_LAYERS} layers, or groups {MOST_DEEP} deep"),
            ));
        }
        if cut_lines::is_cut(&name) {
            listed.notes.push(cut_lines::note(&path.display(), "layer", &name));
            continue;
        }
        let named = names::ink(&name);
        if let Some(named) =
            named.filter(|named| within.is_none_or(|at: usize| listed.layers[at].named.ink != named.ink))
        {
            within = Some(listed.layers.len());
            listed.layers.push(InkLayer { label: name.clone(), named, parts: Vec::new(), hidden: true });
        }
        let children =
            node.children().filter(|child| child.has_tag_name("stack") || child.has_tag_name("layer"));
        // The uppermost comes first, so the last of them is taken from the stack first.
        waiting.extend(children.map(|child| (child, within, hidden, opacity, deep + 1)));
        if !node.has_tag_name("layer") {
            continue;
        }
        count += 1;
        let Some(src) = node.attribute("src") else { continue };
        match within {
            Some(at) if !hidden => {
                let layer = &mut listed.layers[at];
                layer.hidden = false;
                let place = |name| number(node, name).map_or(0, |v| v.clamp(-1e6, 1e6) as i64);
                layer.parts.push(Part { src: src.into(), at: (place("x"), place("y")), opacity });
            }
            Some(_) => {}
            None if hidden => {}
            None => {
                slips.extend(names::closest(&name).map(|meant| (name.clone(), meant)));
                listed.others.push(name);
            }
        }
    }
    if let (Some((name, meant)), false) = (slips.first(), listed.layers.is_empty()) {
        return Err(unknown_ink(path, NamedPart::Layer, name, Some(meant)));
    }
    let meant: Vec<String> =
        slips.iter().map(|(name, meant)| format!("`{name}` (did you mean `{meant}`?)")).collect();
    if !meant.is_empty() {
        let meant = meant.join(", ");
        listed
            .notes
            .push(format!("{}: printed as a picture, since no layer names an ink: {meant}", path.display()));
    }
    Ok(listed)
}

/// A note on layers that belong to no ink.
fn left_out(path: &Path, names: &[String]) -> String {
    let mut list: Vec<String> = names.iter().take(LISTED).map(|name| format!("layer `{name}`")).collect();
    if names.len() > LISTED {
        list.push(format!("further layers ({})", names.len() - LISTED));
    }
    format!("{}: left out, because it lies in no layer of an ink: {}", path.display(), list.join(", "))
}

/// The coverage of a layer on the canvas.
fn scan(
    path: &Path,
    archive: &mut ZipArchive<impl std::io::Read + Seek>,
    layer: &InkLayer,
    (listed, toned): (&Listed, bool),
    left: &mut u64,
) -> Result<Scan, Diagnosis> {
    let (width, height) = (listed.size.0 as usize, listed.size.1 as usize);
    let mut parts = Vec::new();
    for part in &layer.parts {
        let bytes = entry(path, archive, &part.src, MOST_ENTRY)?;
        let (wide, high) = image::ImageReader::new(Cursor::new(&bytes))
            .with_guessed_format()
            .ok()
            .and_then(|reader| reader.into_dimensions().ok())
            .ok_or_else(|| {
                wrong(path, format!("its layer `{}` is no picture that can be read", layer.label))
            })?;
        let pixels = u64::from(wide) * u64::from(high);
        check(path, &format!("layer `{}`", layer.label), (wide.into(), high.into()))?;
        *left = left
            .checked_sub(pixels)
            .ok_or_else(|| wrong(path, "its layers have too many pixels together"))?;
        let image = decode::decode(path, &bytes[..], None)?.image.into_rgba8();
        parts.push((part, image));
    }
    let mut builder = CoverageBuilder::of_drawing(width * height);
    let mut row = vec![0; 4 * width];
    for y in 0..height as i64 {
        row.fill(0);
        for (part, image) in &parts {
            let Ok(line) = u32::try_from(y - part.at.1) else { continue };
            let (wide, high) = image.dimensions();
            if line >= high {
                continue;
            }
            let from = (-part.at.0).clamp(0, wide.into());
            let to = (width as i64 - part.at.0).clamp(from, wide.into());
            let opacity = if toned { part.opacity } else { 1.0 };
            let start = 4 * line as usize * wide as usize;
            let pixels = image.as_raw()[start..start + 4 * wide as usize].as_chunks::<4>().0;
            let own = row.as_chunks_mut::<4>().0;
            for x in from..to {
                over(&mut own[(x + part.at.0) as usize], pixels[x as usize], opacity);
            }
        }
        builder.row(&row, 4);
    }
    let (coverage, by) = builder.finish();
    let (width, height) = listed.size;
    Ok(Scan { path: path.to_path_buf(), width, height, dpi: listed.dpi, coverage, by })
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

/// The merged picture as art.
fn merged(
    path: &Path,
    archive: &mut ZipArchive<impl std::io::Read + Seek>,
    dpi: Option<Dpi>,
    mut notes: Vec<String>,
    options: &Options,
) -> Result<Artwork, Diagnosis> {
    if archive.index_for_name(MERGED).is_none() {
        return Err(nothing(format!(
            "{} has no layer named after an ink, and no merged picture",
            path.display()
        ))
        .hint("name its layers after inks, or export it as PNG"));
    }
    let bytes = entry(path, archive, MERGED, MOST_ENTRY)?;
    let mut pixels = picture::of(path, &bytes[..], None)?;
    pixels.dpi = dpi.or(pixels.dpi);
    notes.append(&mut pixels.notes);
    pixels.notes = notes;
    picture::artwork(&stem(path), pixels, options)
}

/// A file of Krita: the merged picture, with a note on its layers.
fn krita(
    path: &Path,
    archive: &mut ZipArchive<impl std::io::Read + Seek>,
    options: &Options,
) -> Result<Artwork, Diagnosis> {
    let text = entry(path, archive, KRITA, MOST_LIST)?;
    let text = String::from_utf8_lossy(&text);
    // Krita writes a document type.
    let parsing = resvg::usvg::roxmltree::ParsingOptions { allow_dtd: true, ..Default::default() };
    let document = Document::parse_with_options(&text, parsing)
        .map_err(|error| wrong(path, format!("its list of layers cannot be read: {error}")))?;
    let image = document.descendants().find(|node| node.tag_name().name() == "IMAGE");
    let number = |name| image?.attribute(name)?.trim().parse::<f64>().ok();
    let dpi = number("x-res").zip(number("y-res"));
    let dpi = dpi.filter(|(x, y)| RESOLUTIONS.contains(x) && RESOLUTIONS.contains(y));
    let layers = document.descendants().filter(|node| node.tag_name().name() == "layer");
    let inks: Vec<String> = layers
        .filter_map(|layer| layer.attribute("name"))
        .filter(|name| names::ink(name).is_some())
        .take(LISTED)
        .map(|name| format!("`{}`", name.chars().filter(|c| !c.is_control()).collect::<String>()))
        .collect();
    let mut notes = Vec::new();
    if !inks.is_empty() {
        notes.push(format!(
            "{}: of Krita's own format only the merged picture is read, not its layers {}; save a copy as OpenRaster (.ora) to \
             print them in their inks",
            path.display(),
            inks.join(", ")
        ));
    }
    merged(path, archive, dpi, notes, options)
}
