//! OpenRaster and Krita files: layers named after inks, or one picture.
//!
//! Problem: painting programs keep layers in groups, shown or hidden, and name any of them.
//! Method: a layer or group that is named after an ink is a layer of it, with all that lies in it; what is
//! drawn in one colour is ink, of several colours the dark ([`Coverage`](crate::read::coverage::Coverage)).
//! Its opacity is how its owner looks at it, unless its tones are kept. Without such a layer the merged
//! picture is printed; of Krita's own files always. Cost: two bytes a pixel of the canvas and four a pixel of
//! a layer. Limits: those of [`readers::Layered`].

use std::path::Path;

use observe::{Diagnosis, Observer};
use readers::{Layered, Request};

use crate::artwork::Artwork;
use crate::error::{NamedPart, nothing, unknown_ink};
use crate::options::Options;
use crate::read::coverage::{CoverageBuilder, Scan};
use crate::read::cut_lines;
use crate::read::file;
use crate::read::names::{self, Named, stem};
use crate::read::picture;
use crate::read::size::{self, Unstated};

/// What is asked of the canvas and of its layers: twice a page at 600 dpi.
const CANVAS: Request<'static> = Request { pixels: 1 << 26, ..file::PICTURE };

/// The most parts that a note lists.
const LISTED: usize = 12;

/// A layer of ink.
struct InkLayer {
    label: String,
    named: Named,
    /// The layers of the file in it, from the bottom up, and their opacity.
    parts: Vec<(usize, f64)>,
    /// Whether all of it is hidden.
    hidden: bool,
}

/// What the names in a file say.
#[derive(Default)]
struct Found {
    /// From the bottom up.
    layers: Vec<InkLayer>,
    /// Names of layers that are shown and belong to no ink.
    others: Vec<String>,
    notes: Vec<String>,
}

/// Art of the bytes of a file.
pub(crate) fn read(
    path: &Path,
    bytes: Vec<u8>,
    options: &Options,
    observer: &dyn Observer,
) -> Result<Artwork, Diagnosis> {
    let mut file = Layered::open(bytes, path, &CANVAS)?;
    if file.is_krita {
        let notes = of_krita(path, &file).into_iter().collect();
        return merged(path, &mut file, notes, options);
    }
    let Found { layers, others, mut notes } = found(path, &file)?;
    if layers.iter().all(|layer| layer.hidden) {
        if !layers.is_empty() {
            notes.push(format!(
                "{}: printed as a picture, since all layers named after inks are hidden; show them to print them as layers",
                path.display()
            ));
        }
        return merged(path, &mut file, notes, options);
    }
    if !others.is_empty() {
        notes.push(left_out(path, &others));
    }
    let (width, height) = file.size;
    file.check("canvas", file.size, &CANVAS)?;
    let sides = (f64::from(width), f64::from(height));
    let dots = size::dots(path, sides, file.resolution, Unstated::PixelPerDot, options, &mut notes)?;
    observer.begin("reading layers", layers.len() as u64);
    let mut art = Artwork::blank(&stem(path), dots);
    for layer in &layers {
        if layer.hidden {
            notes.push(format!(
                "{}: layer `{}` is hidden: left out; show it to print it",
                path.display(),
                layer.label
            ));
            continue;
        }
        let toned = options.tones.contains(layer.named.ink);
        let faint = layer.parts.iter().map(|(_, opacity)| *opacity).fold(1.0, f64::min);
        if faint < 1.0 && !toned {
            notes.push(format!(
                "{}: layer `{}` is shown at {:.0} % opacity, which ink does not have: printed in full",
                path.display(),
                layer.label,
                100.0 * faint
            ));
        }
        let parts = layer.parts.iter().map(|&(part, opacity)| (part, if toned { opacity } else { 1.0 }));
        let mut builder = CoverageBuilder::of_drawing(width as usize * height as usize);
        let (parts, what) = (parts.collect::<Vec<_>>(), format!("layer `{}`", layer.label));
        file.draw(&parts, &what, &CANVAS, |row| builder.row(row, 4))?;
        let (coverage, by) = builder.finish();
        let scan = Scan { path: path.to_path_buf(), width, height, dpi: file.resolution, coverage, by };
        art.add(scan, &layer.label, layer.named, false, options);
        observer.advance(1);
    }
    observer.end();
    art.opaque = Some(art.drawn.clone());
    art.notes.append(&mut notes);
    Ok(art)
}

/// Which layers and groups are named after inks, and what lies in them.
fn found(path: &Path, file: &Layered) -> Result<Found, Diagnosis> {
    let (mut found, mut slips) = (Found::default(), Vec::new());
    // The layer of ink around each of them; nothing for what lies in none; none at all for what is not
    // printed.
    let mut within: Vec<Option<Option<usize>>> = Vec::with_capacity(file.nodes.len());
    for (at, node) in file.nodes.iter().enumerate() {
        let Some(mut own) = node.within.map_or(Some(None), |group| within[group]) else {
            within.push(None);
            continue;
        };
        if cut_lines::is_cut(&node.name) {
            found.notes.push(cut_lines::note(&path.display(), "layer", &node.name));
            within.push(None);
            continue;
        }
        let is_new = |named: &Named| own.is_none_or(|own: usize| found.layers[own].named.ink != named.ink);
        if let Some(named) = names::ink(&node.name).filter(is_new) {
            own = Some(found.layers.len());
            let label = node.name.clone();
            found.layers.push(InkLayer { label, named, parts: Vec::new(), hidden: true });
        }
        within.push(Some(own));
        if !node.is_layer || node.hidden {
            continue;
        }
        match own {
            Some(own) => {
                found.layers[own].hidden = false;
                found.layers[own].parts.push((at, node.opacity));
            }
            None => {
                slips.extend(names::closest(&node.name).map(|meant| (node.name.clone(), meant)));
                found.others.push(node.name.clone());
            }
        }
    }
    if let (Some((name, meant)), false) = (slips.first(), found.layers.is_empty()) {
        return Err(unknown_ink(path, NamedPart::Layer, name, Some(meant)));
    }
    let meant: Vec<String> =
        slips.iter().map(|(name, meant)| format!("`{name}` (did you mean `{meant}`?)")).collect();
    if !meant.is_empty() {
        let meant = meant.join(", ");
        found
            .notes
            .push(format!("{}: printed as a picture, since no layer names an ink: {meant}", path.display()));
    }
    Ok(found)
}

/// A note on layers that belong to no ink.
fn left_out(path: &Path, names: &[String]) -> String {
    let mut list: Vec<String> = names.iter().take(LISTED).map(|name| format!("layer `{name}`")).collect();
    if names.len() > LISTED {
        list.push(format!("further layers ({})", names.len() - LISTED));
    }
    format!("{}: left out, because it lies in no layer of an ink: {}", path.display(), list.join(", "))
}

/// The merged picture as art.
fn merged(
    path: &Path,
    file: &mut Layered,
    mut notes: Vec<String>,
    options: &Options,
) -> Result<Artwork, Diagnosis> {
    let Some(mut picture) = file.merged(&file::PICTURE)? else {
        return Err(nothing(format!(
            "{} has no layer named after an ink, and no merged picture",
            path.display()
        ))
        .hint("name its layers after inks, or export it as PNG"));
    };
    notes.append(&mut picture.notes);
    picture.notes = notes;
    picture::artwork(picture, options)
}

/// A note on the layers of a file of Krita that are named after inks, if there are any.
fn of_krita(path: &Path, file: &Layered) -> Option<String> {
    let named = file.nodes.iter().map(|node| &node.name).filter(|name| names::ink(name).is_some());
    let inks: Vec<String> = named.take(LISTED).map(|name| format!("`{name}`")).collect();
    (!inks.is_empty()).then(|| {
        format!(
            "{}: of Krita's own format only the merged picture is read, not its layers {}; save a copy as OpenRaster (.ora) to \
             print them in their inks",
            path.display(),
            inks.join(", ")
        )
    })
}
