//! A display of materials: a printed grid of stacks under a screen that exposes some of its cells and conceals others.
//!
//! Problem: show any picture of materials on one sheet, and another one a moment later. The 2009 paper prints a checkered
//! grid of materials and lays an LCD panel over it (figure 12). This module makes the grid ([`Grid`]), what the screen shows
//! ([`Frame`]), and the picture an eye sees ([`seen()`]).
//!
//! The forward model. A pixel of the display is a tile of m x m printed cells; stack q of K has the share `a_q` of the tile,
//! and no stack less than `a`. The screen passes the share `T(v)` of the light through a pixel of value v,
//! `T(v) = closed + (open - closed) (v / 255)^2.2`. Light passes it twice. A place x of the print has the stack `q(x)`, and it
//! is seen under light from direction l and from direction e with the radiance
//!
//! `L(x) = T(x + D(l) - s) T(x + D(e) - s) f_q(x)(theta_h) E cos(theta_l)`.
//!
//! s is how far the screen lies beside its place. D is the parallax of what lies between print and screen: `d tan(theta')` along
//! the direction, for a depth d of glass (`sin(theta') = sin(theta) / 1.5`). What an eye sees of a pixel is the mean over its
//! tile, `sum_q W_q f_q`, with `W_q` the mean of `T T` over the cells of q. With screen and print in line and no depth,
//! `W_q = a_q T_q^2`.
//!
//! So a pixel can be any `sum_q w_q f_q` with `closed^2 a_q <= w_q <= open^2 a_q`. The brightness that every stack reaches
//! alone is `b = a open^2`; frames show `b` times the document, and a sum of weights may be larger than that of a mixture of
//! inks. [`Solver`] finds the weights.
//!
//! Cost: a frame takes 0.1 to 0.3 ms a pixel to solve; seeing it takes 4 to 16 products a cell. Limits: distant light and
//! eye; no light scattered sideways in paper or glass; no reflection off the screen's own face. A screen with polarisers passes
//! more of the light that a metal has returned than of what paper has scattered; here both pass alike. Edges of cells lie on
//! dots, so they are up to half a dot (0.02 mm) beside the screen's.
//! Source: section 6 and figure 12 of the 2009 paper; the model is ours.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod choose;
mod frame;
mod grid;
pub mod page;
mod picture;
mod seen;
mod solve;

use inks::Stack;
use maths::Maths;
use sheet::SheetError;

use crate::error::ViewError;

pub use choose::{Target, choose};
pub use frame::Frame;
pub use grid::{Grid, MARGIN};
pub use picture::{Matte, is_picture};
pub use seen::{Placed, Sight, picture_of, seen};
pub use solve::Solver;

/// The most stacks in a grid: tiles of 3 x 3 cells.
pub const MOST_STACKS: usize = 9;

/// The longest side of a screen in pixels.
pub const LONGEST: u32 = 16_384;

/// How bright a pixel of the screen with value v is, `(v / 255)^GAMMA`: what screens are set to.
pub const GAMMA: f64 = 2.2;

/// A screen to lay over the print.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Screen {
    /// Pixels across and down, 1 to [`LONGEST`].
    pub pixels: (u32, u32),
    /// From one pixel to the next in millimetres, above 0.
    pub pitch_mm: f64,
    /// Screen pixels along each side of a printed cell, at least 1.
    pub cell: u32,
    /// The share of light that passes an open pixel once, above `closed` and at most 1.
    pub open: f64,
    /// The same for a closed one, 0 or more.
    pub closed: f64,
}

impl Screen {
    /// The side of a cell in millimetres.
    pub fn cell_mm(&self) -> f64 {
        self.pitch_mm * f64::from(self.cell)
    }

    /// The share of light that passes a pixel of this value once.
    pub fn passes(&self, value: u8) -> f64 {
        self.closed + (self.open - self.closed) * (f64::from(value) / 255.0).power(GAMMA)
    }

    /// The value that lets `twice` of `open^2` pass on the way in and out, 0..=1.
    pub fn value(&self, twice: f64) -> u8 {
        let once = self.open * twice.max(0.0).sqrt();
        let part = ((once - self.closed) / (self.open - self.closed)).clamp(0.0, 1.0);
        (255.0 * part.power(1.0 / GAMMA)).round() as u8
    }

    /// What a closed cell still shows, as a share of what an open one shows.
    pub fn leak(&self) -> f64 {
        (self.closed / self.open).squared()
    }

    fn check(&self) -> Result<(), DisplayError> {
        let (width, height) = self.pixels;
        if !(1..=LONGEST).contains(&width) || !(1..=LONGEST).contains(&height) {
            return Err(DisplayError::Screen(format!(
                "{width} x {height} pixels; each side must be from 1 to {LONGEST}"
            )));
        }
        if !(self.pitch_mm > 0.0 && self.pitch_mm <= 100.0 && self.cell >= 1 && self.cell <= LONGEST) {
            return Err(DisplayError::Screen(format!(
                "a pitch of {} mm and cells of {} pixels; the pitch must be above 0 and at most 100 mm, and a cell at least 1 \
                 pixel",
                self.pitch_mm, self.cell
            )));
        }
        if !(self.closed >= 0.0 && self.open > self.closed && self.open <= 1.0) {
            return Err(DisplayError::Screen(format!(
                "it passes {} of the light when open and {} when closed; expected 0 <= closed < open <= 1",
                self.open, self.closed
            )));
        }
        Ok(())
    }
}

/// Why there is no display.
#[derive(Debug, thiserror::Error)]
pub enum DisplayError {
    /// A screen that cannot be.
    #[error("screen: {0}")]
    Screen(String),
    /// Too few or too many stacks, or one twice.
    #[error("stacks: {0}")]
    Stacks(String),
    /// Cells finer than what a stack holds in.
    #[error(
        "cells of {cell_mm:.3} mm are {side} x {side} dots, and {stack} needs {needs} dots to hold; make each cell \
         {enough} x {enough} pixels of the screen (--cell {enough})"
    )]
    Fine {
        /// Side of a cell.
        cell_mm: f64,
        /// The same in whole dots.
        side: usize,
        /// The stack.
        stack: Stack,
        /// Its minimum cluster.
        needs: u16,
        /// Screen pixels a cell that are enough.
        enough: u32,
    },
    /// The screen is too small.
    #[error(
        "an image of {} x {} pixels needs {} x {} pixels of the screen with its alignment marks, and the screen has {} x {}; at \
         most {} fit: make the image smaller (--pixels)", image.0, image.1, needs.0, needs.1, screen.0, screen.1, fits(*most)
    )]
    Mask {
        /// Pixels of the image.
        image: (usize, usize),
        /// Screen pixels it takes.
        needs: (u64, u64),
        /// Those there are.
        screen: (u32, u32),
        /// The largest image that fits.
        most: (usize, usize),
    },
    /// The sheet is too small.
    #[error(
        "an image of {} x {} pixels becomes a grid of {:.1} x {:.1} mm, which does not fit on the sheet ({:.1} x {:.1} mm); at most \
         {} fit: make the image smaller (--pixels)",
        image.0, image.1, grid_mm.0, grid_mm.1, sheet_mm.0, sheet_mm.1, fits(*most)
    )]
    Sheet {
        /// Pixels of the image.
        image: (usize, usize),
        /// The grid.
        grid_mm: (f64, f64),
        /// What can be printed.
        sheet_mm: (f64, f64),
        /// The largest image that fits.
        most: (usize, usize),
    },
    /// An image without pixels, or whose shape is not that of the display.
    #[error("the image has {} x {} pixels, and the display {} x {}", image.0, image.1, display.0, display.1)]
    Shape {
        /// The image.
        image: (usize, usize),
        /// The display.
        display: (usize, usize),
    },
    /// A picture that cannot be read.
    #[error("{0}")]
    Picture(String),
    /// The grid is no dot map. Never seen; if it is, it is a bug worth a report.
    #[error(transparent)]
    Dots(#[from] SheetError),
    /// Drawing what is seen, or the page.
    #[error(transparent)]
    View(#[from] ViewError),
}

fn fits((width, height): (usize, usize)) -> String {
    if width == 0 || height == 0 { "none at all".into() } else { format!("{width} x {height} pixels") }
}

#[cfg(test)]
mod tests;
