//! A sheet as the fewest ordered one-bit passes, and what the printer thinks of them.
//!
//! Problem: a stack is several layers, a pass is one ink over the whole page, and a page should take few passes.
//! Method: the shortest list of inks in which every stack in use finds its layers in order ([`order`]), one plane for
//! each ([`pack`]), the machine's order rules as checks ([`rules`]). Overlap is wanted: a dot is in as many passes as
//! its stack has layers. [`compose`] is the way back.
//! Cost: one pass over the dots for all planes. Limits: [`MOST_PASSES`] passes, [`MOST_CARTRIDGES`] inks,
//! [`MOST_LAYERS`] layers.

pub mod files;
mod order;
mod pack;
pub mod rules;

use std::collections::HashMap;

use inks::Stack;
use protocol::ink::Ink;
use protocol::paper::Paper;

use crate::observe::Observer;
use crate::sheet::{Sheet, SheetError};

pub use rules::{Certainty, Check, Severity};

/// Places for cartridges in the machine.
pub const MOST_CARTRIDGES: usize = 7;

/// Most passes over one sheet. The longest job known on hardware had 7.
pub const MOST_PASSES: usize = 16;

/// Most layers in a stack.
pub const MOST_LAYERS: usize = 16;

/// One bit for each dot of the printable area, 8 dots to a byte, most significant bit left, 1 = ink.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Plane {
    /// Dots across.
    pub width: usize,
    /// Rows.
    pub length: usize,
    /// Bytes a row, `width / 8` rounded up; the spare bits at the right are 0.
    pub stride: usize,
    /// The rows from the top.
    pub bits: Vec<u8>,
}

impl Plane {
    /// How many dots have ink.
    pub fn dots(&self) -> u64 {
        self.bits.iter().map(|byte| u64::from(byte.count_ones())).sum()
    }
}

/// One pass of the carriage over the whole page with one ink.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pass {
    /// The ink.
    pub ink: Ink,
    /// Where it goes.
    pub plane: Plane,
}

/// One pass in the plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Planned {
    /// The ink.
    pub ink: Ink,
    /// Dots with ink.
    pub dots: u64,
}

/// What is printed in which order, and what must be in the machine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Plan {
    /// The passes, first printed (lowest) first.
    pub passes: Vec<Planned>,
    /// The cartridges to load, in the order of their first use; [`MOST_CARTRIDGES`] at most.
    pub cartridges: Vec<Ink>,
    /// Whether it is certain that fewer passes cannot do.
    pub fewest: bool,
}

/// A sheet ready for the printer's language.
#[derive(Clone, Debug, PartialEq)]
pub struct Separation {
    /// The paper.
    pub paper: Paper,
    /// The stacks in use, the substrate first.
    pub stacks: Vec<Stack>,
    /// The passes, first printed (lowest) first. None is blank; there are none for a bare sheet.
    pub passes: Vec<Pass>,
    /// The same in numbers.
    pub plan: Plan,
    /// What the order rules of the machine say, most severe first.
    pub checks: Vec<Check>,
}

/// Why a sheet cannot be separated, or passes make no sheet.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SeparateError {
    /// More inks than places.
    #[error(
        "the sheet needs {} cartridges ({}), the machine holds {MOST_CARTRIDGES}; \
         allow fewer inks when mapping the document",
        inks.len(), names(inks)
    )]
    Cartridges {
        /// The inks.
        inks: Vec<Ink>,
    },
    /// A stack is too high.
    #[error("stack `{stack}` has {} layers; at most {MOST_LAYERS} can be printed", stack.layers().len())]
    Layers {
        /// The stack.
        stack: Stack,
    },
    /// More passes than a sheet survives.
    #[error("the sheet needs {passes} passes ({}), at most {MOST_PASSES} are printed; use stacks with fewer layers", names(inks))]
    Passes {
        /// How many.
        passes: usize,
        /// The inks in order.
        inks: Vec<Ink>,
    },
    /// A plane is not of the page's size.
    #[error(
        "pass {pass} ({}) has {found_width} x {found_length} dots in {bytes} bytes; {} needs {width} x {length}",
        ink.name(), paper.name()
    )]
    Plane {
        /// Pass, counted from one.
        pass: usize,
        /// Its ink.
        ink: Ink,
        /// Dots across.
        found_width: usize,
        /// Rows.
        found_length: usize,
        /// Bytes of its bits.
        bytes: usize,
        /// The paper.
        paper: Paper,
        /// Dots across the page.
        width: usize,
        /// Rows of the page.
        length: usize,
    },
    /// The inks on a dot are none of the stacks.
    #[error("the passes put `{stack}` on dot ({x}, {y}), which is none of the sheet's {stacks} stacks")]
    Unknown {
        /// Column.
        x: usize,
        /// Row.
        y: usize,
        /// What is on the dot.
        stack: Stack,
        /// Number of stacks.
        stacks: usize,
    },
    /// The stacks do not make a sheet.
    #[error(transparent)]
    Sheet(#[from] SheetError),
}

fn names(inks: &[Ink]) -> String {
    inks.iter().map(|ink| ink.name()).collect::<Vec<_>>().join(", ")
}

/// Separates a sheet into passes. Only stacks that occur on a dot count.
///
/// Errors: more than [`MOST_CARTRIDGES`] inks, [`MOST_PASSES`] passes or [`MOST_LAYERS`] layers.
pub fn separate(sheet: &Sheet, observer: &dyn Observer) -> Result<Separation, SeparateError> {
    observer.begin("separate", 3);
    let census = sheet.census();
    let used: Vec<(usize, &Stack)> =
        sheet.stacks().iter().enumerate().filter(|(q, _)| census[*q] > 0 || *q == 0).collect();
    if let Some((_, stack)) = used.iter().find(|(_, stack)| stack.layers().len() > MOST_LAYERS) {
        return Err(SeparateError::Layers { stack: (*stack).clone() });
    }
    let all = Ink::ALL.into_iter();
    let inks: Vec<Ink> = all.filter(|ink| used.iter().any(|(_, s)| s.layers().contains(ink))).collect();
    if inks.len() > MOST_CARTRIDGES {
        return Err(SeparateError::Cartridges { inks });
    }
    let order::Order { inks, shortest } =
        order::order(&used.iter().map(|(_, stack)| stack.layers()).collect::<Vec<_>>());
    if inks.len() > MOST_PASSES {
        return Err(SeparateError::Passes { passes: inks.len(), inks });
    }
    observer.advance(1);

    let (mut passes_of, mut dots) = ([0u16; 256], vec![0; inks.len()]);
    for (q, stack) in &used {
        // The order serves every stack in use.
        for pass in order::embed(stack.layers(), &inks).unwrap_or_default() {
            passes_of[*q] |= 1 << pass;
            dots[pass] += census[*q];
        }
    }
    let planes = pack::pack(sheet.width(), sheet.index(), &passes_of, inks.len());
    observer.advance(1);

    let planned = inks.iter().zip(dots).map(|(&ink, dots)| Planned { ink, dots }).collect();
    let mut cartridges: Vec<Ink> = Vec::new();
    for &ink in &inks {
        if !cartridges.contains(&ink) {
            cartridges.push(ink);
        }
    }
    let plan = Plan { passes: planned, cartridges, fewest: shortest };
    let checks = rules::check(sheet, &census, &plan);
    observer.advance(1);
    observer.end();
    Ok(Separation {
        paper: sheet.paper(),
        stacks: used.into_iter().map(|(_, stack)| stack.clone()).collect(),
        passes: inks.into_iter().zip(planes).map(|(ink, plane)| Pass { ink, plane }).collect(),
        plan,
        checks,
    })
}

/// The sheet that passes print: each dot has the inks of the passes that have it, lowest first. `stacks` are the
/// stacks to expect, numbered as the sheet will number them.
///
/// Errors: planes of another size than the paper, more than [`MOST_PASSES`], a dot with inks that are no stack.
pub fn compose(paper: Paper, passes: &[Pass], stacks: &[Stack]) -> Result<Sheet, SeparateError> {
    let (width, length) = (usize::from(paper.width()), usize::from(paper.length()));
    if passes.len() > MOST_PASSES {
        let inks = passes.iter().map(|pass| pass.ink).collect();
        return Err(SeparateError::Passes { passes: passes.len(), inks });
    }
    let stride = width.div_ceil(8);
    for (i, pass) in passes.iter().enumerate() {
        let plane = &pass.plane;
        if (plane.width, plane.length, plane.stride, plane.bits.len()) != (width, length, stride, stride * length) {
            return Err(SeparateError::Plane {
                pass: i + 1,
                ink: pass.ink,
                found_width: plane.width,
                found_length: plane.length,
                bytes: plane.bits.len(),
                paper,
                width,
                length,
            });
        }
    }
    crate::sheet::check_stacks(stacks)?;
    let numbers: HashMap<&[Ink], u16> = stacks.iter().zip(0..).map(|(stack, q)| (stack.layers(), q)).collect();
    let layers = |mask: usize| -> Vec<Ink> {
        passes.iter().enumerate().filter(|(p, _)| mask >> p & 1 == 1).map(|(_, pass)| pass.ink).collect()
    };
    let stack_of: Vec<u16> = (0..1 << passes.len())
        .map(|mask| numbers.get(layers(mask).as_slice()).copied().unwrap_or(pack::NONE))
        .collect();
    let planes: Vec<&Plane> = passes.iter().map(|pass| &pass.plane).collect();
    match pack::unpack(&planes, width, length, &stack_of) {
        Ok(index) => Ok(Sheet::new(paper, stacks.to_vec(), index)?),
        Err((dot, mask)) => {
            let stack = Stack::new(layers(mask));
            Err(SeparateError::Unknown { x: dot % width, y: dot / width, stack, stacks: stacks.len() })
        }
    }
}
