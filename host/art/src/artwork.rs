//! Art as read: layers of ink, and colours, at 600 dpi.
//!
//! Method: a layer starts as coverage, one byte a pixel, whatever its file was. Coverage is resampled to the dots. Layers
//! to be halftoned keep it, but what is flat in them has the edges of flat art; all others become one bit a dot at half coverage.
//! Cost: 1 ns a dot for each layer. Limits: soft edges become hard, and a note says how many pixels they had.

use protocol::ink::{Ink, Kind};
use rayon::prelude::*;

use crate::colour::Colour;
use crate::colour::packed::{colour, key};
use crate::dots::bitplane;
use crate::dots::edges::Edges;
use crate::dots::resample;
use crate::dots::trace;
use crate::dots::turn;
use crate::options::Options;
use crate::read::coverage::{Coverage, Scan};
use crate::read::names;
use sheet::{Plane, Turn};

/// Least coverage of a dot that is ink.
const THRESHOLD: u8 = 128;
/// Coverage up to this is plainly paper; coverage from 255 minus this on is plainly ink.
const PLAIN: u8 = 8;

/// Rows of a plate that are read at once.
const STRIP: usize = 64;

/// What a layer prints.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// Ink or no ink at each dot.
    Solid(Plane),
    /// Coverage from 0 to 255, one byte a dot.
    Tone(Vec<u8>),
}

/// One layer of art.
#[derive(Clone, Debug, PartialEq)]
pub struct Layer {
    /// Its ink.
    pub ink: Ink,
    /// Its source: the name of a file, a channel or a layer.
    pub name: String,
    /// Its place from the paper up, if its name begins with a number.
    pub place: Option<u32>,
    /// What it prints.
    pub shape: Shape,
}

impl Layer {
    /// Whether it prints nothing.
    pub(super) fn is_blank(&self) -> bool {
        match &self.shape {
            Shape::Solid(plane) => plane.dots() == 0,
            Shape::Tone(tones) => tones.iter().all(|&tone| tone == 0),
        }
    }

    /// The dots on which it draws something, also where it is a tint.
    pub(super) fn drawn(&self, width: usize) -> Plane {
        match &self.shape {
            Shape::Solid(plane) => plane.clone(),
            Shape::Tone(tones) => bitplane::from_bytes(width, tones, |c| c > PLAIN),
        }
    }
}

/// What knocks out white beneath it.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Above {
    /// Process inks.
    Colours,
    /// Another ink.
    Ink(Ink),
    /// A shape that is white as paper.
    Paper,
}

/// Art at 600 dpi, or at 1200 x 600.
#[derive(Clone, Debug, PartialEq)]
pub struct Artwork {
    /// Name of the art.
    pub name: String,
    /// Dots across.
    pub width: usize,
    /// Dots across in 1/600 inch, 1 or 2.
    pub across: usize,
    /// Rows.
    pub length: usize,
    /// The layers in the order in which they were given.
    pub layers: Vec<Layer>,
    /// Colours for the process inks: those of a plain picture, without its reserved colours.
    pub colour: Option<Colour>,
    /// Dots on which something is drawn: neither pure white nor transparent, or ink of a layer.
    pub drawn: Plane,
    /// Dots that are not transparent, if the art has transparency.
    pub opaque: Option<Plane>,
    /// The dots of white that make room for what is drawn over them, by what that is.
    pub knocked_out: Vec<(Above, u64)>,
    /// The dots of white that do not, though the art says so.
    pub white_kept: u64,
    /// What is for a cutter and not printed, if it was asked for.
    pub cuts: Option<Plane>,
    /// What the reader had to assume, in sentences.
    pub notes: Vec<String>,
}

impl Artwork {
    /// Art of `width` x `length` dots on which nothing is drawn.
    pub(super) fn blank(name: &str, (width, length): (usize, usize)) -> Artwork {
        Artwork {
            name: name.into(),
            width,
            across: 1,
            length,
            layers: Vec::new(),
            colour: None,
            drawn: bitplane::blank(width, length),
            opaque: None,
            knocked_out: Vec::new(),
            white_kept: 0,
            cuts: None,
            notes: Vec::new(),
        }
    }

    /// The same art, turned.
    #[must_use]
    pub fn turned(self, turn: Turn) -> Artwork {
        if turn == Turn::None {
            return self;
        }
        let size = (self.width, self.length);
        let (width, length) = turn.sides(size);
        let layer = |layer: Layer| {
            let shape = match layer.shape {
                Shape::Solid(dots) => Shape::Solid(turn::plane(&dots, turn)),
                Shape::Tone(tones) => Shape::Tone(turn::samples(tones, 1, size, turn)),
            };
            Layer { shape, ..layer }
        };
        Artwork {
            width,
            length,
            layers: self.layers.into_iter().map(layer).collect(),
            colour: self.colour.map(|colour| colour.turned(size, turn)),
            drawn: turn::plane(&self.drawn, turn),
            opaque: self.opaque.map(|opaque| turn::plane(&opaque, turn)),
            cuts: self.cuts.map(|cuts| turn::plane(&cuts, turn)),
            ..self
        }
    }

    /// Adds what is for a cutter, from its coverage, one byte a dot.
    pub(super) fn add_cut(&mut self, coverage: &[u8]) {
        let plane = bitplane::from_bytes(self.width, coverage, |c| c >= THRESHOLD);
        match &mut self.cuts {
            Some(cuts) => bitplane::add(cuts, &plane),
            None => self.cuts = Some(plane),
        }
    }

    /// The paths for a cutter; `None` if what is for it are no lines but has too many dots.
    #[must_use]
    pub fn cut_paths(&self) -> Option<Vec<trace::Path>> {
        self.cuts.as_ref().map_or(Some(Vec::new()), trace::paths)
    }

    /// Adds a layer. `plate` marks the coverage as that of a printing plate, which keeps its tones, and adds nothing if it is
    /// blank.
    pub(super) fn add(
        &mut self,
        scan: Scan,
        name: &str,
        named: names::Named,
        plate: bool,
        options: &Options,
    ) {
        if plate && scan.coverage.iter().all(|&c| c == 0) {
            return;
        }
        let (layer, mut notes) = layer(scan, name, named, plate, (self.width, self.length), options);
        bitplane::add(&mut self.drawn, &layer.drawn(self.width));
        self.layers.push(layer);
        self.notes.append(&mut notes);
    }
}

/// A layer from its coverage, and notes on it.
fn layer(
    scan: Scan,
    name: &str,
    named: names::Named,
    plate: bool,
    (width, length): (usize, usize),
    options: &Options,
) -> (Layer, Vec<String>) {
    let mut notes = Vec::new();
    match scan.by {
        Coverage::Dark => {}
        Coverage::Opaque => notes.push(format!("{name}: ink prints where the picture is not transparent")),
        Coverage::DarkAndOpaque => notes.push(format!(
            "{name}: several colours on a transparent background; ink prints where they are dark, and the light parts are \
             left out"
        )),
        Coverage::Drawn => notes.push(format!("{name}: drawn in several colours; all of it is ink")),
        Coverage::NotWhite => {
            notes.push(format!("{name}: drawn in one colour and white; the colour is ink, white is not"))
        }
    }
    let toned = plate
        && match named.ink.kind() {
            Kind::Process => has_tones(&scan.coverage),
            // A solid ink with tones in its edges would be ragged.
            _ => has_areas_of_tone(&scan.coverage, scan.width as usize),
        };
    if toned {
        notes.push(format!("{name}: the plate has tones, so it is halftoned"));
    }
    let tones = toned || options.tones.contains(named.ink);
    if !tones && (width, length) != (scan.width as usize, scan.height as usize) {
        notes.push(resample::note(name, scan.size_at(options.dpi), (width, length), options));
    }
    if !tones && let Some(note) = soft_edges(name, &scan.coverage, scan.width as usize) {
        notes.push(note);
    }
    let size = (scan.width, scan.height);
    let most = scan.coverage.par_iter().copied().max().unwrap_or(0);
    let faint = (1..THRESHOLD).contains(&most) && matches!(scan.by, Coverage::Opaque | Coverage::Drawn);
    let coverage = match tones {
        true => {
            let finer = size.0 as usize > width || size.1 as usize > length;
            match finer {
                true => resample::tones(scan.coverage, size, (width, length)),
                false => edged(&scan.coverage, size, (width, length)),
            }
        }
        false => resample::solid(scan.coverage, size, (width, length)),
    };
    let layer =
        Layer { ink: named.ink, name: name.into(), place: named.place, shape: shape(width, coverage, tones) };
    if let Shape::Solid(plane) = &layer.shape
        && plane.dots() == 0
    {
        notes.push(if faint {
            let opacity = 100.0 * f64::from(most) / 255.0;
            format!("{name}: nothing in it is opaque enough to be ink: its opacity is at most {opacity:.0} %; make it opaque")
        } else {
            format!("{name}: no pixel is dark enough to be ink; draw layers in black")
        });
    }
    (layer, notes)
}

/// The coverage of a plate at the dots, as of a grey picture: softened edges are hard, and tones are tones.
fn edged(coverage: &[u8], (width, length): (u32, u32), dots: (usize, usize)) -> Vec<u8> {
    let (width, length) = (width as usize, length as usize);
    let grey = |x: usize, y: usize| key([255 - coverage[y * width + x]; 3], false);
    let edges = Edges::new(grey, (width, length), dots);
    let mut out = vec![0; dots.0 * dots.1];
    out.par_chunks_mut(STRIP * dots.0).enumerate().for_each(|(number, out)| {
        let (top, rows) = (STRIP * number, out.len() / dots.0);
        let mut keys = vec![0; out.len()];
        edges.read(top..top + rows, &mut keys);
        out.iter_mut().zip(keys).for_each(|(out, key)| *out = 255 - colour(key)[0]);
    });
    out
}

/// Coverage as a layer's shape.
fn shape(width: usize, coverage: Vec<u8>, tones: bool) -> Shape {
    if tones {
        Shape::Tone(coverage)
    } else {
        Shape::Solid(bitplane::from_bytes(width, &coverage, |c| c >= THRESHOLD))
    }
}

/// A note on pixels that are neither plainly ink nor plainly paper, if there are any.
fn soft_edges(name: &str, coverage: &[u8], width: usize) -> Option<String> {
    let between = coverage.par_iter().filter(|&&c| is_between(c)).count();
    let inked = coverage.par_iter().filter(|c| (THRESHOLD..255 - PLAIN).contains(c)).count();
    let share = 100.0 * between as f64 / coverage.len().max(1) as f64;
    let advice = if has_areas_of_tone(coverage, width) {
        "; if they are tones rather than edges, have this layer keep its tones"
    } else {
        ""
    };
    (between > 0).then(|| {
        format!(
            "{name}: {between} pixels ({share:.2} %) are neither ink nor paper, such as anti-aliased edges; {inked} of \
             them are dark enough to be ink, and the others are left out{advice}"
        )
    })
}

/// Whether a pixel is neither plainly ink nor plainly paper.
fn is_between(coverage: u8) -> bool {
    coverage > PLAIN && coverage < 255 - PLAIN
}

/// Whether coverage has tones rather than soft edges: more than a twentieth of all pixels with ink are partly covered.
fn has_tones(coverage: &[u8]) -> bool {
    let inked = coverage.par_iter().filter(|&&c| c > PLAIN).count();
    let between = coverage.par_iter().filter(|&&c| is_between(c)).count();
    20 * between > inked
}

/// Whether coverage has areas of tone: a quarter of the partly covered pixels have only such pixels beside them. Softened edges
/// are too narrow for that.
fn has_areas_of_tone(coverage: &[u8], width: usize) -> bool {
    let beside = |at: Option<usize>| at.and_then(|at| coverage.get(at)).is_none_or(|&c| is_between(c));
    let count = |(y, row): (usize, &[u8])| {
        let between = || (0..row.len()).filter(|&x| is_between(row[x]));
        let inside = between().filter(|&x| {
            let at = y * width + x;
            let left = x.checked_sub(1).map(|_| at - 1);
            let right = (x + 1 < width).then_some(at + 1);
            [left, right, at.checked_sub(width), Some(at + width)].into_iter().all(beside)
        });
        (between().count(), inside.count())
    };
    let rows = coverage.par_chunks(width.max(1)).enumerate();
    let (between, inside) = rows.map(count).reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
    between > 0 && 4 * inside >= between
}
