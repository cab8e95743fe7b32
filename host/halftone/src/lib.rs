//! One stack for every dot, in clusters large enough for the inks to hold.
//!
//! Problem: a continuous mix of stacks becomes a [`DotMap`] whose local means are the mix, without parts that would not hold
//! on the paper.
//! Method: what the art gives wholly to one stack is printed as that stack (`solids`); the tones between are halftoned by one
//! of these:
//! - [`Method::Cells`], the default: compact cells and halves of them with error diffusion (`clustered`).
//! - [`Method::Best`]: the same, then exchanged where the eye sees less of it (`dbs`, `contrast_sensitivity`).
//! - [`Method::Walk`]: section 4.2 of the 2009 paper: error diffusion along the band walk of the document's rectangle
//!   (`hilbert`).
//! - [`Method::Blue`]: the diffusion of the cells on single dots, for process inks alone.
//! - [`Method::Fine`]: each dot by itself from a table of small clusters (`fine`, [`green_noise`]), for process inks alone.
//!
//! Cost and memory: see each module; the map itself has one byte a dot. Limits: minimum clusters of 1 to [`LARGEST`] dots.
//! Guarantees: every dot has a stack with weight in the document, or the one it is fixed to. No cluster of tones is smaller
//! than its stack's minimum cluster, but for [`Method::Blue`], [`Method::Fine`] and where a whole region of tones is. The same input gives the same
//! map on any machine with any number of threads.
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests compare with the standard mathematics"))]
#![deny(unsafe_code)]
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_precision_loss,
    clippy::cast_sign_loss,
    reason = "pixel arithmetic: sides and values are bounded by checks at the input (pages fit in u16, pictures in 2^28 pixels, \
              stacks in u8), and checked casts in loops over dots would cost time and hide the arithmetic"
)]

mod axis;
mod clustered;
pub mod contrast_sensitivity;
mod dbs;
mod fine;
pub mod green_noise;
mod hilbert;
pub mod metrics;
mod solids;
pub mod thin;

use inks::{Library, Stack};
use protocol::ink::{Ink, Kind};

use appearance::brdf::{Space, Table, reflectances};
use appearance::gamut::InkMix;
use appearance::weights::ONE;
use observe::Observer;
use sheet::{DotMap, SheetError};

use solids::Solids;

/// The largest minimum cluster.
pub const LARGEST: u16 = 64;

/// Dots across and rows of the largest map: half as much again as the longest page, so that art for A3 can be cropped.
pub const LARGEST_MAP: (u16, u16) = (11_640, 11_640);

/// How the stack of each dot is chosen.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Method {
    /// Runs along a space-filling walk: the rule of the paper.
    Walk,
    /// Compact cells with error diffusion.
    #[default]
    Cells,
    /// Cells, then exchanged where that lessens the error the eye sees.
    Best,
    /// Single dots scattered as evenly as error diffusion can; for process inks alone.
    Blue,
    /// Small clusters that each dot picks by itself from a table; for process inks alone.
    Fine,
}

/// A dot of the map of fixed dots that is halftoned.
pub const TONE: u8 = u8::MAX;

/// Half angles at which reflectance is compared, as many as documents have.
const SAMPLES: usize = 32;

/// Settings of the halftone.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Settings {
    /// How the stack of each dot is chosen.
    pub method: Method,
    /// Minimum cluster of each stack of the mix in dots, 1 to [`LARGEST`]. The paper uses 8 to 16.
    pub minimum: Vec<u16>,
    /// What each stack reflects, a row of `Space::half_angle(32)` each. [`Method::Best`] needs it; [`Method::Cells`] looks more
    /// even with it.
    pub reflectance: Option<Table>,
}

impl Settings {
    /// The same minimum cluster for all stacks.
    pub fn uniform(stacks: usize, minimum: u16) -> Settings {
        Settings { minimum: vec![minimum; stacks], ..Settings::default() }
    }

    /// The default method, with the minimum clusters and the reflectance of these stacks in an ink library.
    pub fn from_library(stacks: &[Stack], library: &Library) -> Settings {
        Settings {
            method: Method::default(),
            minimum: stacks.iter().map(|stack| library.minimum_cluster(stack)).collect(),
            reflectance: Some(reflectances(stacks, library, &Space::half_angle(SAMPLES))),
        }
    }

    /// For each stack the largest minimum cluster of its layers; `bare` is that of the substrate.
    pub fn of(stacks: &[Stack], bare: u16, ink: impl Fn(Ink) -> u16) -> Settings {
        let minimum = |stack: &Stack| stack.layers().iter().map(|&layer| ink(layer)).max().unwrap_or(bare);
        Settings { minimum: stacks.iter().map(minimum).collect(), ..Settings::default() }
    }
}

/// Why a mix cannot be halftoned.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum HalftoneError {
    /// The rectangle has no dots, or too many.
    #[error(
        "a document of {width} x {length} dots cannot be halftoned; expected 1 x 1 to {} x {} dots",
        LARGEST_MAP.0, LARGEST_MAP.1
    )]
    Size {
        /// Dots across.
        width: u16,
        /// Rows.
        length: u16,
    },
    /// The number of rows of the matrix differs from the number of channels.
    #[error("the mix has {rows} rows of shares for {channels} weight maps; expected one row for each")]
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
    /// The settings have a different number of stacks.
    #[error("{found} minimum clusters are set for {stacks} stacks")]
    Minima {
        /// Minimum clusters in the settings.
        found: usize,
        /// Number of stacks.
        stacks: usize,
    },
    /// A minimum cluster is out of range.
    #[error("minimum cluster of `{stack}` is {minimum} dots; it must be 1 to {LARGEST}")]
    Minimum {
        /// The stack.
        stack: Stack,
        /// The minimum cluster in the settings.
        minimum: u16,
    },
    /// The search needs to know what each stack reflects.
    #[error("the search needs the reflectance of {stacks} stacks in {} columns", 3 * SAMPLES)]
    Reflectance {
        /// Number of stacks.
        stacks: usize,
    },
    /// Single dots of this stack would not hold.
    #[error(
        "`{stack}` cannot be halftoned in single dots or small clusters; only stacks of process inks can, so choose another halftone"
    )]
    NotProcess {
        /// The stack.
        stack: Stack,
    },
    /// The map of fixed dots has another size.
    #[error("{found} fixed dots are given for {width} x {length} dots")]
    FixedSize {
        /// Dots in the map.
        found: usize,
        /// Dots across.
        width: u16,
        /// Rows.
        length: u16,
    },
    /// A dot is fixed to a stack that the mix does not have.
    #[error("dot {x}, {y} is fixed to stack {stack} of a mix of {stacks} stacks")]
    FixedStack {
        /// Column.
        x: usize,
        /// Row.
        y: usize,
        /// The stack.
        stack: u8,
        /// Number of stacks.
        stacks: usize,
    },
    /// The dot map is not a halftone of this mix.
    #[error("the dot map is not a halftone of this mix: its stacks differ")]
    OtherStacks,
    /// The stacks are invalid.
    #[error(transparent)]
    Sheet(#[from] SheetError),
}

fn check(mix: &InkMix, (width, length): (u16, u16), settings: &Settings) -> Result<(), HalftoneError> {
    if !(1..=LARGEST_MAP.0).contains(&width) || !(1..=LARGEST_MAP.1).contains(&length) {
        return Err(HalftoneError::Size { width, length });
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
    if matches!(settings.method, Method::Blue | Method::Fine) {
        check_single_dots((0..stacks).filter(|&q| has_weight(mix, q)).map(|q| &mix.stacks[q]))?;
    }
    if settings.minimum.len() != stacks {
        return Err(HalftoneError::Minima { found: settings.minimum.len(), stacks });
    }
    let known = |table: &Table| table.len() == stacks && table.columns() == 3 * SAMPLES;
    let needed = settings.method == Method::Best;
    if settings.reflectance.as_ref().map_or(needed, |table| !known(table)) {
        return Err(HalftoneError::Reflectance { stacks });
    }
    for (stack, &minimum) in mix.stacks.iter().zip(&settings.minimum) {
        if !(1..=LARGEST).contains(&minimum) {
            return Err(HalftoneError::Minimum { stack: stack.clone(), minimum });
        }
    }
    Ok(sheet::check_stacks(&mix.stacks)?)
}

/// Whether a stack has weight anywhere.
fn has_weight(mix: &InkMix, q: usize) -> bool {
    let maps = &mix.maps;
    (0..maps.channels()).any(|channel| {
        mix.matrix[channel][q] > 0
            && maps.data().iter().skip(channel).step_by(maps.channels()).any(|&weight| weight > 0)
    })
}

fn is_process(stack: &Stack) -> bool {
    stack.layers().iter().all(|ink| ink.kind() == Kind::Process)
}

/// Checks that single dots of all these stacks hold.
pub fn check_single_dots<'a>(stacks: impl IntoIterator<Item = &'a Stack>) -> Result<(), HalftoneError> {
    match stacks.into_iter().find(|stack| !is_process(stack)) {
        None => Ok(()),
        Some(stack) => Err(HalftoneError::NotProcess { stack: stack.clone() }),
    }
}

fn check_fixed(fixed: &[u8], (width, length): (u16, u16), stacks: usize) -> Result<(), HalftoneError> {
    let wide = usize::from(width);
    if fixed.len() != wide * usize::from(length) {
        return Err(HalftoneError::FixedSize { found: fixed.len(), width, length });
    }
    match fixed.iter().position(|&stack| stack != TONE && usize::from(stack) >= stacks) {
        Some(at) => Err(HalftoneError::FixedStack { x: at % wide, y: at / wide, stack: fixed[at], stacks }),
        None => Ok(()),
    }
}

/// Halftones a mix onto a rectangle of `size` dots: width, then rows.
///
/// `fixed` gives for each dot the number of the stack of the mix that is printed there, or [`TONE`] for a dot to halftone.
/// Dots that the mix gives wholly to one stack are fixed by themselves.
///
/// # Errors
/// A rectangle without dots or larger than any sheet, a mix or settings that contradict themselves.
pub fn halftone(
    mix: &InkMix,
    size: (u16, u16),
    fixed: Option<&[u8]>,
    settings: &Settings,
    observer: &dyn Observer,
) -> Result<DotMap, HalftoneError> {
    check(mix, size, settings)?;
    if let Some(fixed) = fixed {
        check_fixed(fixed, size, mix.stacks.len())?;
    }
    let (width, length) = (usize::from(size.0), usize::from(size.1));
    let solids = Solids::new(mix, width, length, fixed);
    let points = || {
        let table = settings.reflectance.as_ref()?;
        Some(contrast_sensitivity::Tangent::of_mix(mix, &Space::half_angle(SAMPLES), table).leading())
    };
    let cells = |minimum: &[u16], points: Option<&[_]>, searched| {
        clustered::cells(mix, (width, length), minimum, &solids, points, searched, observer)
    };
    let index = match settings.method {
        Method::Walk => hilbert::walked(mix, size, &settings.minimum, &solids, observer),
        Method::Cells => cells(&settings.minimum, points().as_deref(), false),
        Method::Best => cells(&settings.minimum, points().as_deref(), true),
        Method::Blue => cells(&vec![1; mix.stacks.len()], None, false),
        Method::Fine => fine::fine(mix, (width, length), settings, &solids, observer),
    };
    Ok(DotMap::new(width, length, mix.stacks.clone(), index)?)
}

#[cfg(test)]
mod tests;
