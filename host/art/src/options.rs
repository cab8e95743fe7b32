//! Options of the readers of art.

use std::sync::Arc;

use files::shelf::{Disk, Shelf};
use inks::InkSet;
use protocol::ink::Ink;

use sheet::{Size, Turn};

/// How far a colour may be from that of an ink, in steps of red, green and blue.
pub const TOLERANCES: std::ops::RangeInclusive<u8> = 0..=60;

/// How to read art.
#[derive(Clone, Debug)]
pub struct Options {
    /// Size on paper; overrides the size in the file.
    pub size: Option<Size>,
    /// Resolution in pixels per inch; overrides the resolution in the file.
    pub dpi: Option<f64>,
    /// Whether the vendor's reserved colours stand for their inks.
    pub reserved: bool,
    /// Colours of the art that stand for inks besides: sRGB as drawn.
    pub colours: Vec<(Ink, [u8; 3])>,
    /// Largest difference of red, green and blue from a reserved colour; `None` for each ink's own tolerance.
    pub tolerance: Option<u8>,
    /// How many times as large as it says it is printed, if no size is set.
    pub scale: f64,
    /// How it is turned before it is printed.
    pub turn: Turn,
    /// Pages of a PDF, PostScript or TIFF file.
    pub pages: Pages,
    /// Layers that keep their tones, and are halftoned; all others are ink or paper.
    pub tones: InkSet,
    /// Dots across in 1/600 inch: 1, or 2 for a print at 1200 x 600 dpi.
    pub across: usize,
    /// The inks that reserved colours may stand for.
    pub inks: InkSet,
    /// Whether lines for a cutter are read as [`Artwork::cuts`](crate::Artwork::cuts).
    pub cut_lines: bool,
    /// Whether white keeps the dots that colours drawn over it would knock out.
    pub keep_white: bool,
    /// Other inks beneath which it keeps its dots.
    pub over_white: InkSet,
    /// Room on the page: art without a size of its own is fitted to it.
    pub room: Room,
    /// Where the files stand, and what a drawing links.
    pub shelf: Arc<dyn Shelf>,
}

impl Options {
    /// Whether colours stand for inks.
    pub(super) fn reserves(&self) -> bool {
        self.reserved || !self.colours.is_empty()
    }

    /// The page that was chosen by its number.
    pub(super) fn page(&self) -> Option<u32> {
        if let Pages::Number(number) = self.pages { Some(number) } else { None }
    }
}

/// Which pages of a document to read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Pages {
    /// The only one that holds art.
    Only,
    /// The one of this number, from 1.
    Number(u32),
    /// One for each ink, from the first page on.
    Inks(Vec<Ink>),
}

/// Room for art on a page.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Room {
    /// Dots across.
    pub width: usize,
    /// Dots down.
    pub length: usize,
    /// Whether art may be larger because the page crops it.
    pub cut: bool,
}

impl Default for Room {
    /// The largest page, without cropping.
    fn default() -> Room {
        let (width, length) = protocol::paper::LARGEST;
        Room { width: width.into(), length: length.into(), cut: false }
    }
}

impl Default for Options {
    fn default() -> Options {
        Options {
            size: None,
            dpi: None,
            reserved: false,
            colours: Vec::new(),
            tolerance: None,
            scale: 1.0,
            turn: Turn::None,
            pages: Pages::Only,
            tones: InkSet::EMPTY,
            across: 1,
            inks: InkSet::default().with(Ink::White),
            cut_lines: false,
            keep_white: false,
            over_white: InkSet::EMPTY,
            room: Room::default(),
            shelf: Arc::new(Disk),
        }
    }
}
