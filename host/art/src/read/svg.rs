//! SVG drawings: layers named after inks, or one picture.
//!
//! Problem: drawing programs have layers, which SVG stores as groups with a label or an identifier.
//! Method: the drawing is rendered at its final number of dots without anti-aliasing. [`find`] tells which
//! parts of it are layers. Each layer is rendered as the whole drawing without all others, so the clips,
//! masks and transforms around it hold, and what is drawn in it is ink, whatever its colour. Only a layer
//! to be halftoned has tones: there dark is ink, and so it is in pictures made of pixels. A drawing has no
//! ground. Without layers it is one picture; its edges are exact, so reserved colours are unambiguous.
//! Nothing drawn is thinner than a dot ([`thin`]). What a drawing asks of the computer has [`bounds`]; what
//! the renderer does not know is drawn by other means or named ([`styles`], [`strokes`], [`write`],
//! [`unseen`]). Rendering has a thread of its own, because filters may take for ever, and the renderer may
//! fail on hostile drawings.
//! Cost: four bytes a dot while a layer is rendered, eight where it holds pictures. Limits: animations do
//! not run; a layer may take as long as a page ([`process::limit`]). A thread cannot be stopped: one that
//! takes too long ends with the program. A browser's machine has no threads: there a drawing is rendered in
//! place, without a limit of time.

mod bounds;
mod find;
mod fonts;
mod links;
mod nodes;
mod object_types;
mod render;
mod sheets;
mod source;
mod strokes;
mod styles;
mod thin;
mod units;
mod unseen;
mod values;
mod write;

use std::path::{Path, PathBuf};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;

use resvg::tiny_skia::Transform;
use resvg::usvg::roxmltree;

use crate::artwork::Artwork;
use crate::error::{io, nothing, wrong};
use crate::options::Options;
use crate::read::coverage::{Coverage, Scan};
use crate::read::file;
use crate::read::names::stem;
use crate::read::picture;
use crate::read::process;
use crate::read::size::{self, Unstated};
use find::{Cuts, Layer};
use links::Without;
use observe::{Diagnosis, Observer};
use render::Renderer;
use write::Way;

pub(crate) use source::is_svg;

/// Name of the thread that renders a drawing. A panic in it becomes an error of the reader.
pub const DRAWING: &str = "drawing";

/// The most bytes of a drawing, as memory must hold it, several times over as a tree.
const MOST_BYTES: u64 = 1 << 28;

/// Reads a drawing.
pub(crate) fn read(path: &Path, options: &Options, observer: &dyn Observer) -> Result<Artwork, Diagnosis> {
    let bytes = file::whole(&*options.shelf, path, (MOST_BYTES, "256 MB, which is more than a drawing has"))?;
    let (steps, done) = mpsc::channel();
    let drawing = Drawing { path: path.to_path_buf(), options: options.clone() };
    if cfg!(target_family = "wasm") {
        // It has no threads, and whoever started the work there can end it.
        let art = drawing.draw(bytes, &|step| step.tell(observer));
        observer.end();
        return art;
    }
    let begun = thread::Builder::new().name(DRAWING.into()).stack_size(bounds::STACK).spawn(move || {
        // Nobody listens any more if it took too long.
        let drawn = drawing.draw(bytes, &|step| drop(steps.send(step)));
        let _ = steps.send(Step::Done(Box::new(drawn)));
    });
    begun.map_err(io(path, "start a thread for it"))?;
    let limit = process::limit();
    let art = loop {
        match done.recv_timeout(limit) {
            Ok(Step::Done(art)) => break *art,
            Ok(step) => step.tell(observer),
            Err(RecvTimeoutError::Timeout) => break Err(wrong(path, process::too_long(limit))),
            Err(RecvTimeoutError::Disconnected) => {
                break Err(wrong(path, "the drawing cannot be rendered")
                    .hint("simplify its filters, or export it as PNG"));
            }
        }
    };
    observer.end();
    art
}

/// How far the thread of a drawing is.
enum Step {
    /// It has so many layers.
    Layers(u64),
    /// One of them is rendered.
    Layer,
    Done(Box<Result<Artwork, Diagnosis>>),
}

impl Step {
    fn tell(&self, observer: &dyn Observer) {
        match self {
            Step::Layers(count) => observer.begin("rendering layers", *count),
            Step::Layer => observer.advance(1),
            Step::Done(_) => {}
        }
    }
}

/// The text of a drawing with the styles that count, if they are not as written, and a note on those that
/// do not.
fn styled(path: &Path, text: &str) -> Result<(Option<String>, Option<String>), Diagnosis> {
    styles::resolved(path, &parsed(path, text)?, MOST_BYTES)
}

/// The layers of a drawing, what of it is for a cutter, and notes on it. What would take the renderer too
/// long, or its stack, is an error.
fn looked_at(
    path: &Path,
    document: &roxmltree::Document<'_>,
) -> Result<(Vec<Layer>, Cuts, Vec<String>), Diagnosis> {
    bounds::check(document)
        .map_err(|beyond| wrong(path, beyond).hint("simplify the drawing, or export it as PNG"))?;
    let mut notes = Vec::new();
    let (layers, cuts) = find::layers(path, document, &mut notes)?;
    notes.extend(unseen::note(path, document));
    Ok((layers, cuts, notes))
}

/// The elements of a drawing.
fn parsed<'a>(path: &Path, text: &'a str) -> Result<roxmltree::Document<'a>, Diagnosis> {
    let options = roxmltree::ParsingOptions { allow_dtd: true, ..Default::default() };
    roxmltree::Document::parse_with_options(text, options).map_err(|error| {
        let diagnosis = wrong(path, format!("the drawing cannot be read: {error}"));
        match &error {
            roxmltree::Error::UnknownNamespace(prefix, _) => diagnosis.hint(format!(
                "open the drawing in Inkscape and save it again, or declare the prefix in its first element{}",
                match prefix.as_str() {
                    "inkscape" => ": xmlns:inkscape=\"http://www.inkscape.org/namespaces/inkscape\"",
                    "sodipodi" => ": xmlns:sodipodi=\"http://sodipodi.sourceforge.net/DTD/sodipodi-0.dtd\"",
                    "xlink" => ": xmlns:xlink=\"http://www.w3.org/1999/xlink\"",
                    _ => "",
                }
            )),
            _ => diagnosis,
        }
    })
}

/// A drawing on its way to its own thread.
struct Drawing {
    path: PathBuf,
    options: Options,
}

impl Drawing {
    /// Renders it from the bytes of its file, and tells each step.
    fn draw(self, bytes: Vec<u8>, tell: &dyn Fn(Step)) -> Result<Artwork, Diagnosis> {
        let Drawing { path, options } = self;
        let path = path.as_path();
        let mut text = source::decoded(path, bytes)?;
        let (styled, unread) = styled(path, &text)?;
        text = styled.unwrap_or(text);
        let document = parsed(path, &text)?;
        let (layers, cuts, mut notes) = looked_at(path, &document)?;
        notes.extend(unread);
        tell(Step::Layers(layers.len().max(1) as u64));
        let root = document.root_element();
        let has = |name| root.descendants().any(|node| nodes::name(node) == Some(name));
        let text = has("text");
        if text {
            notes.push(format!(
                "{}: text is drawn with this computer's fonts; convert it to paths to keep its design",
                path.display()
            ));
        }
        let measure = units::measure(root);
        let renderer = Renderer::new(&options.shelf, path, text || links_drawing(root), measure.per_inch)?;
        let widths = strokes::widths(root, |text| renderer.tree(text))?;
        // Some programs ask for soft edges, which are neither ink nor paper.
        let own = root.attribute("style").unwrap_or_default();
        let crisp =
            format!("shape-rendering:crispEdges!important;text-rendering:optimizeSpeed!important;{own}");
        let way = |node: nodes::Node<'_, '_>| match widths.get(&node.id()) {
            _ if node == root => Way::With(vec![("style", crisp.clone())]),
            _ if cuts.contains(&node.id()) => Way::Hide,
            Some(width) => Way::With(width.clone()),
            None => Way::Keep,
        };
        let whole = write::written(root, way);
        let size = renderer.tree(&whole)?.size();
        if let Some(lost) = renderer.characters_without_glyph() {
            notes.push(format!(
                "{}: no font of this computer has the characters {lost}, so they are missing; convert the text to paths",
                path.display()
            ));
        }
        if let Some(missing) = renderer.missing_fonts() {
            notes.push(format!(
                "{}: this computer has no font {missing}; install it, or convert the text to paths",
                path.display()
            ));
        }
        let (across, down) = (f64::from(size.width()), f64::from(size.height()));
        let (stated, unstated) = match measure.assumed {
            None => (Some((measure.per_inch, measure.per_inch)), Unstated::Drawing { rounded_mm: 0.0 }),
            Some(units) => (None, Unstated::Units(units)),
        };
        let dots = size::dots(path, (across, down), stated, unstated, &options, &mut notes)?;
        let scale = Transform::from_scale((dots.0 as f64 / across) as f32, (dots.1 as f64 / down) as f32);
        let size = (dots.0 as u32, dots.1 as u32);

        let mut cut = None;
        if options.cut_lines && !cuts.is_empty() {
            let layer = [Layer::of_cuts(&cuts, &document)];
            let mut only = find::only(&layer, 0, false);
            let shape = |node: nodes::Node<'_, '_>| {
                only(node).and(widths.get(&node.id()).cloned().map_or(Way::Keep, Way::With))
            };
            let drawn = renderer.parsed(&write::written(root, shape), Without::Pictures)?;
            let rgba = renderer.rendered(&drawn, scale, size)?;
            cut = Some(rgba.as_chunks::<4>().0.iter().map(|pixel| pixel[3]).collect::<Vec<u8>>());
        }
        if layers.is_empty() {
            let drawn = renderer.parsed(&whole, Without::Nothing)?;
            notes.extend_from_slice(&drawn.notes);
            let rgba = renderer.rendered(&drawn, scale, size)?;
            if let Some(vanished) = unseen::vanished(path, &drawn.tree, scale) {
                if is_blank(&rgba) {
                    return Err(nothing(vanished));
                }
                notes.push(vanished);
            }
            let again = |without, has: bool| match has {
                true => renderer.rendered(&renderer.parsed(&whole, without)?, scale, size).map(Some),
                false => Ok(None),
            };
            let no_text = again(Without::Text, renderer.has_fonts())?;
            let no_pictures = again(Without::Pictures, drawn.pictures)?;
            let pixels = object_types::tagged(&rgba, no_text.as_deref(), no_pictures.as_deref());
            let mut art = picture::tagged_artwork(&stem(path), size, dots, pixels, &options);
            art.notes.splice(..0, notes);
            cut.iter().for_each(|cut| art.add_cut(cut));
            return Ok(art);
        }
        let mut art = Artwork::blank(&stem(path), dots);
        cut.iter().for_each(|cut| art.add_cut(cut));
        for (at, layer) in layers.iter().enumerate() {
            let toned = options.tones.contains(layer.named.ink);
            let mut only = find::only(&layers, at, toned);
            let text = write::written(root, |node| only(node).and(way(node)));
            let drawn = renderer.parsed(&text, Without::Nothing)?;
            for note in drawn.notes.iter().cloned().chain(unseen::vanished(path, &drawn.tree, scale)) {
                if !notes.contains(&note) {
                    notes.push(note);
                }
            }
            let rgba = renderer.rendered(&drawn, scale, size)?;
            tell(Step::Layer);
            if is_blank(&rgba) {
                let name = &layer.label;
                let why = match layer.hidden {
                    true => "is hidden: left out; show it in the drawing program to print it",
                    false => "is empty, or nothing in it is visible: left out",
                };
                notes.push(format!("{}: layer `{name}` {why}", path.display()));
                continue;
            }
            if let (Some(opacity), false) = (layer.opacity, toned) {
                notes.push(format!(
                    "{}: layer `{}` is shown at {:.0} % opacity, which ink does not have: printed in full",
                    path.display(),
                    layer.label,
                    100.0 * opacity
                ));
            }
            let scan = if toned {
                Scan::of_drawing(path, size, &rgba)
            } else if drawn.pictures {
                let shapes = renderer.parsed(&text, Without::Pictures)?;
                let shapes = renderer.rendered(&shapes, scale, size)?;
                with_pictures(path, size, rgba, &shapes, (&layer.label, &mut notes))
            } else {
                Scan::of_layer(path, size, &rgba)
            };
            art.add(scan, &layer.label, layer.named, false, &options);
        }
        if art.layers.is_empty() {
            return Err(nothing(format!("no layer of {} is visible", path.display()))
                .hint("show its layers in the drawing program, or draw something in them"));
        }
        art.opaque = Some(art.drawn.clone());
        art.notes.append(&mut notes);
        Ok(art)
    }
}

/// Whether nothing is drawn.
fn is_blank(rgba: &[u8]) -> bool {
    rgba.as_chunks::<4>().0.iter().all(|pixel| pixel[3] == 0)
}

/// Whether a drawing may hold another, whose text needs fonts.
fn links_drawing(root: nodes::Node<'_, '_>) -> bool {
    let drawing = |node: nodes::Node<'_, '_>| {
        let mut links = node.attributes().filter(|a| a.name() == "href").map(|a| a.value());
        links.any(|link| {
            let raster = ["png", "jpg", "jpeg", "gif", "webp"];
            let known = |kind: &&str| {
                link.starts_with(&format!("data:image/{kind}")) || link.ends_with(&format!(".{kind}"))
            };
            !raster.iter().any(known)
        })
    };
    root.descendants().any(|node| nodes::name(node) == Some("image") && drawing(node))
}

/// The coverage of a layer that holds pictures: `rgba` with them, `shapes` without. Shapes are ink whatever
/// their colour; pictures are ink where they are dark, for scans have white paper.
fn with_pictures(
    path: &Path,
    size: (u32, u32),
    mut rgba: Vec<u8>,
    shapes: &[u8],
    (name, notes): (&str, &mut Vec<String>),
) -> Scan {
    let shapes = shapes.as_chunks::<4>().0;
    for (pixel, shape) in rgba.as_chunks_mut::<4>().0.iter_mut().zip(shapes) {
        if pixel == shape {
            *pixel = [0; 4];
        }
    }
    let mut scan = Scan::of_drawing(path, size, &rgba);
    if shapes.iter().all(|shape| shape[3] == 0) {
        return scan;
    }
    for (coverage, shape) in scan.coverage.iter_mut().zip(shapes) {
        *coverage = (*coverage).max(shape[3]);
    }
    if scan.by == Coverage::DarkAndOpaque {
        // The note on this rule would be wrong for the shapes.
        scan.by = Coverage::Dark;
        notes.push(format!("{name}: its pictures are ink where they are dark; all else drawn in it is ink"));
    }
    scan
}
