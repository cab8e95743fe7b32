//! SVG drawings: layers named after inks, or one picture.
//!
//! Problem: drawing programs have layers, which SVG stores as groups with a label or an identifier.
//! Method: the drawing is rendered at its final number of dots without anti-aliasing. A group is named by its label, such as
//! that of an Inkscape layer, or else by its identifier. Each topmost group that names an ink is rendered separately, and
//! what is drawn in it is ink, whatever its colour. Only a layer to be halftoned, or one that holds pictures, has tones: there
//! dark is ink. A drawing has no ground. Without such groups it is one picture; its edges are exact, so reserved colours are
//! unambiguous. Rendering has a thread of its own, because filters may take for ever, and the renderer may fail on hostile
//! drawings.
//! Cost: four bytes a dot while a layer is rendered. Limits: opacity, clips and filters of the groups around a layer do not
//! apply to it; animations do not run; a layer may take as long as a page ([`process::limit`]). A thread cannot be stopped:
//! one that takes too long ends with the program.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;

use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{self, fontdb, roxmltree};

use super::artwork::Artwork;
use super::coverage::Scan;
use super::error::{LayersError, io, wrong};
use super::names::{self, stem};
use super::options::Options;
use super::picture;
use super::size::{self, Unstated};
use super::svg_kinds;
use crate::process;
use observe::Observer;

/// Name of the thread that renders a drawing. A panic in it becomes an error of the reader.
pub const DRAWING: &str = "drawing";

/// The most bytes of a drawing.
const MOST_BYTES: u64 = 1 << 28;

/// Units in an inch of a drawing without units.
const UNITS: f64 = 96.0;

/// Whether a file begins like an SVG drawing.
pub(super) fn is_svg(start: &[u8]) -> bool {
    let text = String::from_utf8_lossy(start);
    let text = text.trim_start_matches('\u{feff}').trim_start();
    text.starts_with("<svg") || text.starts_with('<') && text.contains("<svg")
}

/// A group that is a layer of ink.
struct Group {
    label: String,
    id: String,
    named: names::Named,
}

/// Reads a drawing.
pub(super) fn read(path: &Path, options: &Options, observer: &dyn Observer) -> Result<Artwork, LayersError> {
    let reading = io(path, "read it");
    if std::fs::metadata(path).map_err(&reading)?.len() > MOST_BYTES {
        return Err(wrong(path, format!("the drawing is larger than {} MB", MOST_BYTES >> 20)));
    }
    let text = std::fs::read_to_string(path).map_err(&reading)?;
    let mut notes = Vec::new();
    let (text, groups) = groups(path, text, &mut notes)?;
    observer.begin("rendering layers", groups.len().max(1) as u64);
    let (steps, done) = mpsc::channel();
    let drawing = Drawing { path: path.to_path_buf(), text, groups, notes, options: options.clone() };
    let begun = thread::Builder::new().name(DRAWING.into()).spawn(move || {
        // Nobody listens any more if it took too long.
        let drawn = drawing.draw(&|| drop(steps.send(None)));
        let _ = steps.send(Some(drawn));
    });
    begun.map_err(io(path, "start a thread for it"))?;
    let limit = process::limit();
    let art = loop {
        match done.recv_timeout(limit) {
            Ok(None) => observer.advance(1),
            Ok(Some(art)) => break art,
            Err(RecvTimeoutError::Timeout) => break Err(wrong(path, process::too_long(limit))),
            Err(RecvTimeoutError::Disconnected) => {
                break Err(wrong(
                    path,
                    "the drawing cannot be rendered; simplify its filters, or export it as PNG",
                ));
            }
        }
    };
    observer.end();
    art
}

/// A drawing on its way to its own thread.
struct Drawing {
    path: PathBuf,
    text: String,
    groups: Vec<Group>,
    notes: Vec<String>,
    options: Options,
}

impl Drawing {
    /// Renders it, and calls `advance` after each layer.
    fn draw(self, advance: &dyn Fn()) -> Result<Artwork, LayersError> {
        let Drawing { path, text, groups, mut notes, options } = self;
        let path = path.as_path();
        let (tree, usual) = parsed(path, &text, &mut notes)?;
        let size = (f64::from(tree.size().width()), f64::from(tree.size().height()));
        let unstated = Unstated::Drawing { rounded_mm: 0.0 };
        let dots = size::dots(path, size, Some((UNITS, UNITS)), unstated, &options, &mut notes)?;
        let scale = Transform::from_scale((dots.0 as f64 / size.0) as f32, (dots.1 as f64 / size.1) as f32);
        let (width, height) = (dots.0 as u32, dots.1 as u32);
        let canvas = || Pixmap::new(width, height).ok_or_else(|| wrong(path, "the drawing is too large"));

        if groups.is_empty() {
            let mut pixmap = canvas()?;
            resvg::render(&tree, scale, &mut pixmap.as_mut());
            let rgba = straight(pixmap);
            let pixels = svg_kinds::tagged(&text, &usual, scale, (width, height), &rgba);
            let mut art = picture::tagged_artwork(&stem(path), (width, height), dots, pixels, &options);
            art.notes.splice(..0, notes);
            return Ok(art);
        }
        let mut art = Artwork::blank(&stem(path), dots);
        for group in groups {
            let Some(usvg::Node::Group(node)) = tree.node_by_id(&group.id) else {
                let name = &group.label;
                notes.push(format!("{}: layer `{name}` is hidden or empty: left out", path.display()));
                continue;
            };
            let mut pixmap = canvas()?;
            render_group(node, scale, &mut pixmap);
            let rgba = straight(pixmap);
            let toned = options.tones.contains(group.named.ink) || has_picture(node);
            let of = if toned { Scan::of_drawing } else { Scan::of_layer };
            art.add(of(path, (width, height), &rgba), &group.label, group.named, false, &options);
            advance();
        }
        art.opaque = Some(art.drawn.clone());
        art.notes.append(&mut notes);
        Ok(art)
    }
}

/// The drawing as the renderer understands it, and how it was read.
fn parsed(
    path: &Path,
    text: &str,
    notes: &mut Vec<String>,
) -> Result<(usvg::Tree, usvg::Options<'static>), LayersError> {
    let mut usual = usvg::Options {
        resources_dir: path.parent().map(Path::to_path_buf),
        shape_rendering: usvg::ShapeRendering::CrispEdges,
        text_rendering: usvg::TextRendering::OptimizeSpeed,
        ..usvg::Options::default()
    };
    if text.contains("<text") {
        load_fonts(path, Arc::make_mut(&mut usual.fontdb))?;
        notes.push(format!(
            "{}: text is drawn with this computer's fonts; convert it to paths to keep its design",
            path.display()
        ));
    }
    let tree = usvg::Tree::from_str(text, &usual)
        .map_err(|error| wrong(path, format!("the drawing cannot be read: {error}")))?;
    Ok((tree, usual))
}

/// Whether a group holds a picture made of pixels.
fn has_picture(group: &usvg::Group) -> bool {
    let mut waiting = vec![group];
    while let Some(group) = waiting.pop() {
        for node in group.children() {
            match node {
                usvg::Node::Group(inner) => waiting.push(inner),
                usvg::Node::Image(image) if !matches!(image.kind(), usvg::ImageKind::SVG(_)) => return true,
                _ => {}
            }
        }
    }
    false
}

/// Renders a group where it stands in the drawing.
fn render_group(group: &usvg::Group, scale: Transform, pixmap: &mut Pixmap) {
    // The renderer moves a group to the corner and ignores the transforms around it, so both are restored here.
    let around = group.transform().invert().map(|own| group.abs_transform().pre_concat(own));
    let corner = group.abs_layer_bounding_box();
    let place = scale.pre_concat(around.unwrap_or_default()).pre_translate(corner.x(), corner.y());
    let node = usvg::Node::Group(Box::new(group.clone()));
    resvg::render_node(&node, place, &mut pixmap.as_mut());
}

/// Loads this computer's fonts. The renderer draws text of a missing family in the default family and leaves it out if that
/// is missing too, so one is chosen here.
fn load_fonts(path: &Path, fonts: &mut fontdb::Database) -> Result<(), LayersError> {
    fonts.load_system_fonts();
    let default = fontdb::Query { families: &[fontdb::Family::Serif], ..fontdb::Query::default() };
    if fonts.query(&default).is_some() {
        return Ok(());
    }
    // A regular upright face replaces any other best; the least name makes the choice the same every time.
    let plain = |face: &fontdb::FaceInfo| {
        face.style == fontdb::Style::Normal && face.weight == fontdb::Weight::NORMAL && !face.monospaced
    };
    let named = |face: &fontdb::FaceInfo| Some((!plain(face), face.families.first()?.0.clone()));
    match fonts.faces().filter_map(named).min() {
        Some((_, family)) => {
            fonts.set_serif_family(family);
            Ok(())
        }
        None => Err(wrong(path, "it has text, but this computer has no fonts; convert the text to paths")),
    }
}

/// The topmost groups that name an ink, and the drawing with an identifier added to each of them.
fn groups(path: &Path, text: String, notes: &mut Vec<String>) -> Result<(String, Vec<Group>), LayersError> {
    let options = roxmltree::ParsingOptions { allow_dtd: true, ..Default::default() };
    let document = roxmltree::Document::parse_with_options(&text, options)
        .map_err(|error| wrong(path, format!("the drawing cannot be read: {error}")))?;
    let mut found = Vec::new();
    let mut missing = Vec::new();
    let mut others = Vec::new();
    // The parser bounds the depth; a stack of its own spares this walk the recursion.
    let mut waiting: Vec<roxmltree::Node> = document.root_element().children().collect();
    waiting.reverse();
    while let Some(node) = waiting.pop() {
        if node.tag_name().name() != "g" {
            continue;
        }
        let own = |name: &str| node.attributes().find(|a| a.name() == name).map(|a| a.value());
        let layer = own("groupmode") == Some("layer");
        let label = own("label").or(own("data-name")).or(node.attribute("id")).unwrap_or_default();
        match names::ink(label) {
            Some(named) => {
                let id = match node.attribute("id") {
                    Some(id) => id.to_owned(),
                    None => {
                        let id = format!("foilpress-layer-{}", found.len());
                        missing.push((node.range().start, id.clone()));
                        id
                    }
                };
                found.push(Group { label: label.to_owned(), id, named });
            }
            None => {
                if layer {
                    others.push(label.to_owned());
                }
                let children: Vec<_> = node.children().collect();
                waiting.extend(children.into_iter().rev());
            }
        }
    }
    if !found.is_empty() {
        for other in others {
            names::of_part(path, &other, "layer", notes)?;
        }
    }
    let mut text = text;
    for (start, id) in missing.into_iter().rev() {
        // Inserted after the tag's name, which ends at the first space, slash or bracket.
        if let Some(end) = text[start..].find(|c: char| c.is_whitespace() || c == '>' || c == '/') {
            text.insert_str(start + end, &format!(" id=\"{id}\""));
        }
    }
    Ok((text, found))
}

/// Straight alpha from the renderer's premultiplied alpha.
pub(super) fn straight(pixmap: Pixmap) -> Vec<u8> {
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
