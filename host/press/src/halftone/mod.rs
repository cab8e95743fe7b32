//! One stack for every dot, in clusters no smaller than the inks can hold (section 4.2 of the 2009 paper).
//!
//! Problem: a continuous mix of stacks becomes a [`Sheet`] whose local means are the mix, with no cluster
//! smaller than a stack's minimum.
//! Method: error diffusion along the band walk ([`protocol::walk`]) of the rectangle the document is printed
//! on, by the rule in `rule` on the mix sampled by `mix`. The walk is cut into strips of 16 bands, each
//! diffused by itself, so that both cores work and the result does not depend on how many there are; a strip
//! forgets a few dots of debt at its end.
//! Cost: under 10 ns a dot on one core for 8 stacks, 20 ns for 57. Memory: the sheet, one byte a dot, and a few
//! kilobytes a thread. Limits: minima of 1 to [`LARGEST`] dots.
//! Guarantees: every dot of the rectangle has a stack that has weight in the document; all others are substrate; no
//! run along the rectangle's walk, hence no 4-connected cluster, is smaller than its stack's minimum (unless the
//! whole rectangle is); the same input gives the same sheet on any machine with any number of threads.

mod cells;
pub mod eye;
pub mod metrics;
mod mix;
mod rule;
mod search;

use inks::Stack;
use protocol::ink::Ink;
use protocol::paper::{LARGEST as LARGEST_PAGE, Paper};
use protocol::walk::{Band, MOST, Tile, Walk};
use rayon::prelude::*;

use crate::sheet::{Sheet, SheetError};
use appearance::gamut::InkMix;
use appearance::weights::ONE;
use observe::Observer;

/// The largest minimum cluster.
pub const LARGEST: u16 = 64;

/// Bands in a strip; the last strip has up to twice as many.
const STRIP: usize = 16;

/// Where on which paper a document is printed, in dots of 1/600 inch of the printable area.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Placement {
    /// The paper.
    pub paper: Paper,
    /// First column.
    pub x: u16,
    /// First row.
    pub y: u16,
    /// Dots across.
    pub width: u16,
    /// Rows.
    pub height: u16,
}

/// How dots are chosen.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Method {
    /// Runs along a space-filling walk: the rule of the paper.
    #[default]
    Walk,
    /// Compact cells with error diffusion; solids exact.
    Cells,
    /// Cells, then exchanged where that lessens the error the eye sees.
    Best,
}

/// What the halftone may be told.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Settings {
    /// How dots are chosen.
    pub method: Method,
    /// Smallest cluster of each stack of the mix in dots, 1 to [`LARGEST`]. The paper uses 8 to 16.
    pub minimum: Vec<u16>,
    /// Where each stack lies among all in what it reflects ([`eye::Tangent::leading`]); only [`Method::Best`] needs it.
    pub points: Vec<[f32; 4]>,
}

impl Settings {
    /// One minimum for all stacks.
    pub fn uniform(stacks: usize, minimum: u16) -> Settings {
        Settings { minimum: vec![minimum; stacks], ..Settings::default() }
    }

    /// A stack's minimum is the largest of its layers'; `bare` is that of the substrate.
    pub fn of(stacks: &[Stack], bare: u16, ink: impl Fn(Ink) -> u16) -> Settings {
        let minimum = |stack: &Stack| stack.layers().iter().map(|&layer| ink(layer)).max().unwrap_or(bare);
        Settings { minimum: stacks.iter().map(minimum).collect(), ..Settings::default() }
    }
}

/// Why a mix cannot be halftoned.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum HalftoneError {
    /// The rectangle is empty or leaves the printable area.
    #[error(
        "a document of {width} x {height} dots at ({x}, {y}) does not fit the {page_width} x {page_length} dots of {paper}; \
         print it smaller or on larger paper"
    )]
    Placement {
        /// First column.
        x: u16,
        /// First row.
        y: u16,
        /// Dots across.
        width: u16,
        /// Rows.
        height: u16,
        /// The paper's name.
        paper: &'static str,
        /// Printable dots across.
        page_width: u16,
        /// Printable rows.
        page_length: u16,
    },
    /// The paper is larger than any the machine takes.
    #[error("a page of {width} x {length} dots is larger than any sheet, {} x {} at most", LARGEST_PAGE.0, LARGEST_PAGE.1)]
    Page {
        /// Printable dots across.
        width: u16,
        /// Printable rows.
        length: u16,
    },
    /// The matrix has another number of rows than the maps have channels.
    #[error("the mix has {rows} rows of shares for {channels} weight maps; it needs one for each")]
    Rows {
        /// Rows found.
        rows: usize,
        /// Channels of the maps.
        channels: usize,
    },
    /// A row of shares has the wrong length.
    #[error("row {row} of the mix has {found} shares for {stacks} stacks")]
    Shares {
        /// Row of the matrix.
        row: usize,
        /// Shares found.
        found: usize,
        /// Number of stacks.
        stacks: usize,
    },
    /// A row of shares does not sum to one.
    #[error("the shares in row {row} of the mix sum to {:.5}, not 1", f64::from(*sum) / f64::from(ONE))]
    Sum {
        /// Row of the matrix.
        row: usize,
        /// The sum in units of 1/ONE.
        sum: u32,
    },
    /// The settings are for another number of stacks.
    #[error("{found} minimum clusters are set for {stacks} stacks")]
    Minima {
        /// Minima given.
        found: usize,
        /// Number of stacks.
        stacks: usize,
    },
    /// The search needs to know what each stack reflects.
    #[error("the search needs a point for each of {stacks} stacks, not {found}")]
    Points {
        /// Points given.
        found: usize,
        /// Number of stacks.
        stacks: usize,
    },
    /// A minimum cluster is out of range.
    #[error("minimum cluster of `{stack}` is {minimum} dots; it must be 1 to {LARGEST}")]
    Minimum {
        /// The stack.
        stack: Stack,
        /// What was set.
        minimum: u16,
    },
    /// A sheet to be judged is not of this mix and paper.
    #[error("the sheet ({sheet}) is not a halftone of this mix on {place}: its paper or its stacks differ")]
    OtherSheet {
        /// The sheet's paper.
        sheet: &'static str,
        /// The placement's paper.
        place: &'static str,
    },
    /// The stacks do not make a sheet.
    #[error(transparent)]
    Sheet(#[from] SheetError),
}

fn check(mix: &InkMix, place: &Placement, settings: &Settings) -> Result<(), HalftoneError> {
    let (page_width, page_length) = (place.paper.width(), place.paper.length());
    if page_width > LARGEST_PAGE.0 || page_length > LARGEST_PAGE.1 {
        return Err(HalftoneError::Page { width: page_width, length: page_length });
    }
    let fits = |from: u16, length: u16, most: u16| length > 0 && from <= most && length <= most - from;
    if !(fits(place.x, place.width, page_width) && fits(place.y, place.height, page_length)) {
        let &Placement { x, y, width, height, paper } = place;
        let paper = paper.name();
        return Err(HalftoneError::Placement { x, y, width, height, paper, page_width, page_length });
    }
    let (rows, channels, stacks) = (mix.matrix.len(), mix.maps.channels(), mix.stacks.len());
    if rows != channels {
        return Err(HalftoneError::Rows { rows, channels });
    }
    for (row, shares) in mix.matrix.iter().enumerate() {
        if shares.len() != stacks {
            return Err(HalftoneError::Shares { row, found: shares.len(), stacks });
        }
        let sum = shares.iter().map(|&share| u32::from(share)).sum();
        if sum != u32::from(ONE) {
            return Err(HalftoneError::Sum { row, sum });
        }
    }
    if settings.minimum.len() != stacks {
        return Err(HalftoneError::Minima { found: settings.minimum.len(), stacks });
    }
    if settings.method == Method::Best && settings.points.len() != stacks {
        return Err(HalftoneError::Points { found: settings.points.len(), stacks });
    }
    for (stack, &minimum) in mix.stacks.iter().zip(&settings.minimum) {
        if !(1..=LARGEST).contains(&minimum) {
            return Err(HalftoneError::Minimum { stack: stack.clone(), minimum });
        }
    }
    Ok(crate::sheet::check_stacks(&mix.stacks)?)
}

/// Halftones a mix onto a page. Dots outside the placement are bare substrate.
///
/// Errors: a placement that does not fit the paper, a mix or settings that contradict themselves.
pub fn halftone(
    mix: &InkMix,
    place: &Placement,
    settings: &Settings,
    observer: &dyn Observer,
) -> Result<Sheet, HalftoneError> {
    check(mix, place, settings)?;
    if settings.method != Method::Walk {
        let (size, points) = ((place.width.into(), place.height.into()), settings.points.as_slice());
        let points = (settings.method == Method::Best).then_some(points);
        return placed(mix, place, cells::cells(mix, size, &settings.minimum, points, observer));
    }
    let walk = Walk::new(place.width, place.height);
    let lattice = mix::Lattice::new(mix, &walk);
    let minimum: Vec<u16> = lattice.stacks.iter().map(|&q| settings.minimum[usize::from(q)]).collect();

    let (width, length) = (usize::from(place.paper.width()), usize::from(place.paper.length()));
    let mut index = vec![0u8; width * length];
    let mut rest = &mut index[usize::from(place.y) * width..];
    let bands: Vec<Band> = walk.bands().collect();
    let count = (bands.len() / STRIP).max(1);
    let mut strips = Vec::with_capacity(count);
    for i in 0..count {
        let bands = &bands[i * STRIP..if i + 1 == count { bands.len() } else { (i + 1) * STRIP }];
        let height: usize = bands.iter().map(|band| usize::from(band.height)).sum();
        let (rows, below) = rest.split_at_mut(height * width);
        rest = below;
        strips.push((bands, rows));
    }

    observer.begin("halftone", u64::from(walk.len()));
    strips.into_par_iter().for_each(|(bands, rows)| {
        let tiles = || bands.iter().flat_map(|band| band.tiles());
        let dots = bands.iter().map(|band| band.len()).sum();
        let mut rule = rule::Rule::new(&minimum, dots, rule::ABSENT);
        let mut source = lattice.along(tiles());
        let mut paint = Paint {
            lattice: &lattice,
            observer,
            rows,
            stride: width,
            left: usize::from(place.x),
            top: bands.first().map_or(0, |band| usize::from(band.y)),
            tiles: tiles(),
            tile: None,
            line: [0; MOST + SLACK],
            filled: 0,
        };
        rule::walk(&mut rule, &mut source, &mut paint);
    });
    observer.end();
    Ok(Sheet::new(place.paper, mix.stacks.clone(), index)?)
}

/// Dots of the rectangle on its page.
fn placed(mix: &InkMix, place: &Placement, dots: Vec<u8>) -> Result<Sheet, HalftoneError> {
    let (width, wide) = (usize::from(place.paper.width()), usize::from(place.width));
    if dots.len() == width * usize::from(place.paper.length()) {
        return Ok(Sheet::new(place.paper, mix.stacks.clone(), dots)?);
    }
    let mut index = vec![0; width * usize::from(place.paper.length())];
    let rows = index[usize::from(place.y) * width..].chunks_exact_mut(width);
    for (row, dots) in rows.zip(dots.chunks_exact(wide)) {
        row[usize::from(place.x)..][..wide].copy_from_slice(dots);
    }
    Ok(Sheet::new(place.paper, mix.stacks.clone(), index)?)
}

/// Places beyond a tile's end that a short run may be written over.
const SLACK: usize = 16;

/// Runs along the walk to rows of the page, tile by tile.
struct Paint<'a, T> {
    lattice: &'a mix::Lattice<'a>,
    observer: &'a dyn Observer,
    rows: &'a mut [u8],
    stride: usize,
    left: usize,
    top: usize,
    tiles: T,
    tile: Option<Tile>,
    /// The dots of the tile in the order of its curve.
    line: [u8; MOST + SLACK],
    filled: usize,
}

impl<T: Iterator<Item = Tile>> rule::Sink for Paint<'_, T> {
    #[inline(always)]
    fn run(&mut self, k: usize, dots: u32) {
        let stack = self.lattice.stacks[k];
        let mut dots = dots as usize;
        while dots > 0 {
            if self.tile.is_none() {
                self.tile = self.tiles.next();
            }
            let Some(tile) = self.tile else { return };
            let area = usize::from(tile.area());
            let step = dots.min(area - self.filled);
            // Most runs are short: one store of fixed length, whose excess the next run overwrites.
            self.line[self.filled..self.filled + SLACK].fill(stack);
            if step > SLACK {
                self.line[self.filled + SLACK..self.filled + step].fill(stack);
            }
            self.filled += step;
            dots -= step;
            if self.filled == area {
                self.lay(&tile);
                (self.tile, self.filled) = (None, 0);
            }
        }
    }
}

impl<T> Paint<'_, T> {
    fn lay(&mut self, tile: &Tile) {
        let shape = self.lattice.shape(tile);
        let (width, x) = (usize::from(tile.w), self.left + usize::from(tile.x));
        for (row, order) in shape.order.chunks_exact(width).enumerate() {
            let start = (usize::from(tile.y) - self.top + row) * self.stride + x;
            for (dot, &position) in self.rows[start..start + width].iter_mut().zip(order) {
                *dot = self.line[usize::from(position) % MOST];
            }
        }
        self.observer.advance(u64::from(tile.area()));
    }
}

#[cfg(test)]
mod tests;
