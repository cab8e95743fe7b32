//! A piece is a rectangle of dots that has not found its place on a page yet.
//!
//! Layers, halftoned documents and charts make pieces; the layout repeats, mirrors, marks and places them, and what
//! comes out is a [`Sheet`].

use inks::Stack;

use super::{Sheet, SheetError, check_stacks};

/// One stack for every dot of a rectangle at 600 dpi. Stack 0 is always the bare substrate.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Piece {
    width: usize,
    length: usize,
    stacks: Vec<Stack>,
    index: Vec<u8>,
}

impl Piece {
    /// A piece from its dots, row by row from the top.
    pub fn new(width: usize, length: usize, stacks: Vec<Stack>, index: Vec<u8>) -> Result<Piece, SheetError> {
        if Some(index.len()) != width.checked_mul(length) || index.is_empty() {
            return Err(SheetError::Size { width, length, found: index.len() });
        }
        check_stacks(&stacks)?;
        if let Some(dot) = index.iter().position(|&s| usize::from(s) >= stacks.len()) {
            let stack = index[dot];
            return Err(SheetError::Index { x: dot % width, y: dot / width, stack, stacks: stacks.len() });
        }
        Ok(Piece { width, length, stacks, index })
    }

    /// Dots across.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn length(&self) -> usize {
        self.length
    }

    /// The stacks; number 0 is the bare substrate.
    pub fn stacks(&self) -> &[Stack] {
        &self.stacks
    }

    /// The stack number of every dot, row by row.
    pub fn index(&self) -> &[u8] {
        &self.index
    }
}

impl From<Sheet> for Piece {
    /// All of a sheet, without its paper.
    fn from(sheet: Sheet) -> Piece {
        let (width, length) = (sheet.width(), sheet.length());
        Piece { width, length, stacks: sheet.stacks, index: sheet.index }
    }
}
