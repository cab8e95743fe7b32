//! Which dots make a cell: squares on a lattice, cut by the edges of the art.
//!
//! Problem: a cell must be as large as the inks that may fall on it ask for, and end where a solid begins.
//! Method: blocks of [`BLOCK`] x [`BLOCK`] dots, each cut into equal cells for the most demanding stack that has
//! weight in it. Stacks that ask for less may have halves of them: 2 x 4 dots hold 8. Where the document is flat and no
//! stack asks for more, those have squares of 3 x 3 instead. A cell that solids or the page's border cut falls into connected fragments. A fragment joins the
//! whole cell it shares most border with and prints that cell's stack; where there is none, fragments join each other
//! until they are as large as a cell.
//! Cost: one look at each pixel of the document, and at each dot of the blocks that hold solids. Memory: a bit a dot
//! and 12 bytes a fragment.
//! Guarantee: within a region of tones, every dot lies in a square or half square of its stack's minimum or more that holds
//! no other tone. A cell that owns fragments is not halved, unless they are no more than what the page's border cuts off of its
//! neighbours: then it and its halves go on to the border.

use std::collections::HashMap;

use rayon::prelude::*;

use super::super::TONE;
use super::cell::fits_half;
use super::evenness::{Evenness, varying};
use super::field::Field;
use super::mask::{BLOCK, FULL, Mask, bits, span};

/// Sides a cell can have: the divisors of a block, so that cells fill it.
const SIZES: [usize; 8] = [1, 2, 3, 4, 6, 8, 12, 24];

/// Side of the cells of a stack: the smallest whose square holds the minimum cluster.
pub(crate) fn size_of(minimum: u16) -> usize {
    SIZES.into_iter().find(|size| size * size >= usize::from(minimum)).unwrap_or(BLOCK)
}

/// Side of the cells of a stack where halves of cells may be printed: that with which it takes the fewest dots.
pub(super) fn halved_size_of(minimum: u16) -> usize {
    let dots = |size: usize| match size * size {
        area if fits_half(minimum, size) => area / 2,
        area if area >= usize::from(minimum) => area,
        _ => usize::MAX,
    };
    SIZES.into_iter().min_by_key(|&size| dots(size)).unwrap_or(BLOCK)
}

pub(super) struct Block {
    /// Side of its cells.
    pub(super) size: u8,
    /// Whether one of its cells owns fragments.
    pub(super) owns: bool,
    /// Whether this block and the eight around it consist of whole cells.
    pub(super) calm: bool,
    /// By how much a weight of the document differs over the block; 0 if it is [flat](super::evenness).
    pub(super) varies: u16,
    /// Dots that are tones.
    pub(super) tone: Mask,
}

/// Connected tones that are less than a cell.
pub(super) struct Fragment {
    /// Its first dot, as its number on the page.
    pub(super) seed: u32,
    /// The dot whose stack it prints: its own seed if it decides for itself.
    pub(super) owner: u32,
    area: u16,
    /// Whether it is all that the page's border leaves of a cell, and the whole cell beside it owns it.
    rim: bool,
}

/// The cells of a page.
pub(crate) struct Plan {
    width: usize,
    height: usize,
    /// Blocks across.
    pub(crate) across: usize,
    pub(super) blocks: Vec<Block>,
    /// In the order of blocks.
    pub(super) fragments: Vec<Fragment>,
    /// First fragment of each block, and their number.
    first: Vec<u32>,
    /// Owner and fragment, ascending.
    owned: Vec<(u32, u32)>,
}

impl Plan {
    /// Plans the cells and prints the solids. `minimum` is the smallest cluster of each stack of the field.
    pub(super) fn new(field: &Field, minimum: &[u16], index: &mut [u8]) -> Plan {
        let (width, height) = (field.width, field.height);
        let across = width.div_ceil(BLOCK);
        let sizes: Vec<[usize; 2]> =
            minimum.iter().map(|&minimum| [size_of(minimum), halved_size_of(minimum)]).collect();
        let rows = index.par_chunks_mut(BLOCK * width).enumerate();
        let surveyed: Vec<(Block, [u8; 2], Evenness)> = rows
            .flat_map_iter(|(row, dots)| {
                let mut present = vec![false; sizes.len()];
                let blocks: Vec<(Block, [u8; 2], Evenness)> = (0..across)
                    .map(|column| {
                        present.fill(false);
                        let (left, top) = (column * BLOCK, row * BLOCK);
                        let solid =
                            field.solids.any(left..(left + BLOCK).min(width), top..(top + BLOCK).min(height));
                        let tone =
                            if solid { cut(field, column, row, dots) } else { inside(field, column, row) };
                        let some = Some(&tone).filter(|tone| solid && **tone != [0; BLOCK]);
                        let evenness = field.survey((column, row), some, &mut present);
                        let needed = sizes.iter().zip(&present).filter(|&(_, &present)| present);
                        let sizes = [0, 1].map(|halved| {
                            needed.clone().map(|(sizes, _)| sizes[halved]).max().unwrap_or(1) as u8
                        });
                        (Block { size: 0, owns: false, calm: false, varies: 0, tone }, sizes, evenness)
                    })
                    .collect();
                blocks
            })
            .collect();
        let varies = varying(&surveyed.iter().map(|&(.., evenness)| evenness).collect::<Vec<_>>(), across);
        let blocks = surveyed.into_iter().zip(varies).map(|((block, sizes, _), varies)| Block {
            size: sizes[usize::from(varies > 0)],
            varies,
            ..block
        });
        let blocks = blocks.collect();
        let mut plan = Plan {
            width,
            height,
            across,
            blocks,
            fragments: Vec::new(),
            first: Vec::new(),
            owned: Vec::new(),
        };
        plan.find_fragments();
        plan.find_owners();
        plan.find_calm();
        plan
    }

    /// Side of the cell of a dot, which is given by its number on the page.
    fn size_at(&self, dot: u32) -> u8 {
        let (x, y) = (dot as usize % self.width, dot as usize / self.width);
        self.blocks[y / BLOCK * self.across + x / BLOCK].size
    }

    /// Blocks down.
    pub(crate) fn down(&self) -> usize {
        self.blocks.len() / self.across
    }

    /// Side of the cells of a block.
    pub(crate) fn size(&self, column: usize, row: usize) -> usize {
        self.blocks[row * self.across + column].size.into()
    }

    /// Block of a dot, and the dot's place in it.
    fn block(&self, x: usize, y: usize) -> (&Block, usize, usize) {
        (&self.blocks[y / BLOCK * self.across + x / BLOCK], x % BLOCK, y % BLOCK)
    }

    pub(crate) fn is_tone(&self, x: usize, y: usize) -> bool {
        let (block, x, y) = self.block(x, y);
        block.tone[y] >> x & 1 == 1
    }

    /// The corner of a dot's cell if the cell is whole.
    fn whole(&self, x: usize, y: usize) -> Option<u32> {
        let (block, in_x, in_y) = self.block(x, y);
        let size = usize::from(block.size);
        let (left, top) = (in_x - in_x % size, in_y - in_y % size);
        let row = span(left, size);
        let whole = block.tone[top..top + size].iter().all(|bits| bits & row == row);
        whole.then(|| ((y - in_y + top) * self.width + x - in_x + left) as u32)
    }

    /// Whether the cell of this dot is whole.
    pub(crate) fn is_whole(&self, x: usize, y: usize) -> bool {
        self.whole(x, y).is_some()
    }

    /// Whether a unit that decides begins in the cell of this dot: a whole cell or fragments by themselves.
    pub(super) fn decides(&self, x: usize, y: usize) -> bool {
        if x >= self.width || y >= self.height {
            return false;
        }
        self.whole(x, y).is_some() || self.heads(x, y).next().is_some()
    }

    /// The first column of the cell at the left or right end of a row of cells that goes on beyond the page: it is whole, and the border
    /// of the page cuts nothing but tone beside it.
    pub(super) fn goes_on(&self, left: bool, y: usize) -> Option<usize> {
        if left {
            return (self.whole(0, y).is_some()).then_some(0);
        }
        let (block, _, in_y) = self.block(self.width - 1, y);
        let size = usize::from(block.size);
        let last = (self.width / size).checked_sub(1)? * size;
        if usize::from(self.block(last, y).0.size) != size {
            return None;
        }
        self.whole(last, y)?;
        let rest = self.width - last - size;
        let cut = rest > 0 && {
            let top = in_y - in_y % size;
            let row = span((last + size) % BLOCK, rest);
            block.tone[top..top + size].iter().any(|bits| bits & row != row)
        };
        (!cut).then_some(last)
    }

    /// Fragments in the cell of this dot that decide for themselves.
    pub(super) fn heads(&self, x: usize, y: usize) -> impl Iterator<Item = u32> {
        let at = y / BLOCK * self.across + x / BLOCK;
        let size = usize::from(self.blocks[at].size);
        let cell = move |x: usize, y: usize| (x % BLOCK / size, y % BLOCK / size);
        let here = self.first[at] as usize..self.first[at + 1] as usize;
        here.filter(move |&i| {
            let Fragment { seed, owner, .. } = self.fragments[i];
            seed == owner && cell(seed as usize % self.width, seed as usize / self.width) == cell(x, y)
        })
        .map(|i| i as u32)
    }

    /// Fragments owned by a dot.
    pub(crate) fn owned(&self, owner: u32) -> impl Iterator<Item = u32> {
        let from = self.owned.partition_point(|&(other, _)| other < owner);
        self.owned[from..]
            .iter()
            .take_while(move |&&(other, _)| other == owner)
            .map(|&(_, fragment)| fragment)
    }

    /// Whether a dot owns nothing but rims: the cell then prints up to the border.
    pub(super) fn owns_rims_alone(&self, owner: u32) -> bool {
        self.owned(owner).all(|fragment| self.fragments[fragment as usize].rim)
    }

    /// The dots of a fragment.
    pub(super) fn dots(&self, fragment: u32) -> impl Iterator<Item = (usize, usize)> {
        let seed = self.fragments[fragment as usize].seed as usize;
        let (x, y) = (seed % self.width, seed / self.width);
        let (block, in_x, in_y) = self.block(x, y);
        let mask = component(block, in_x, in_y);
        let (left, top) = (x - in_x, y - in_y);
        (0..BLOCK).flat_map(move |row| bits(mask[row]).map(move |column| (left + column, top + row)))
    }

    /// Prints each dot of a fragment like the nearest dot of the cell that owns it, which is cut only if it owns rims alone.
    pub(super) fn print_fragments(&self, index: &mut [u8]) {
        for &(owner, fragment) in &self.owned {
            let (left, top) = (owner as usize % self.width, owner as usize / self.width);
            let end = if self.is_whole(left, top) { usize::from(self.size_at(owner)) - 1 } else { 0 };
            for (x, y) in self.dots(fragment) {
                let nearest = y.clamp(top, top + end) * self.width + x.clamp(left, left + end);
                index[y * self.width + x] = index[nearest];
            }
        }
    }

    fn find_fragments(&mut self) {
        for (at, block) in self.blocks.iter().enumerate() {
            self.first.push(self.fragments.len() as u32);
            if block.tone == [FULL; BLOCK] || block.tone == [0; BLOCK] {
                continue;
            }
            let (left, top, size) =
                (at % self.across * BLOCK, at / self.across * BLOCK, usize::from(block.size));
            for cell_y in (0..BLOCK).step_by(size) {
                for cell_x in (0..BLOCK).step_by(size) {
                    let row = span(cell_x, size);
                    let mut left_over: Mask = [0; BLOCK];
                    let rows = cell_y..cell_y + size;
                    for (rest, tone) in left_over[rows.clone()].iter_mut().zip(&block.tone[rows]) {
                        *rest = tone & row;
                    }
                    let area: u32 = left_over.iter().map(|bits| bits.count_ones()).sum();
                    if area as usize == size * size {
                        continue;
                    }
                    while let Some(y) = left_over.iter().position(|&bits| bits != 0) {
                        let x = left_over[y].trailing_zeros() as usize;
                        let found = component(block, x, y);
                        let mut area = 0;
                        for (rest, found) in left_over.iter_mut().zip(found) {
                            *rest &= !found;
                            area += found.count_ones() as u16;
                        }
                        let seed = ((top + y) * self.width + left + x) as u32;
                        self.fragments.push(Fragment { seed, owner: seed, area, rim: false });
                    }
                }
            }
        }
        self.first.push(self.fragments.len() as u32);
    }

    /// Dots that a fragment touches outside its cell.
    fn neighbours(&self, fragment: u32) -> Vec<(usize, usize)> {
        let dots: Vec<(usize, usize)> = self.dots(fragment).collect();
        let mut found = Vec::new();
        for &(x, y) in &dots {
            let near = [(x.wrapping_sub(1), y), (x + 1, y), (x, y.wrapping_sub(1)), (x, y + 1)];
            for (x, y) in near {
                if x < self.width && y < self.height && self.is_tone(x, y) && !dots.contains(&(x, y)) {
                    found.push((x, y));
                }
            }
        }
        found
    }

    fn find_owners(&mut self) {
        let mut orphans = Vec::new();
        for fragment in 0..self.fragments.len() as u32 {
            let mut votes: Vec<(u32, u32)> = Vec::new();
            let size = self.size_at(self.fragments[fragment as usize].seed);
            for (x, y) in self.neighbours(fragment) {
                // A larger cell may print a stack for which this fragment is too thin.
                if let Some(corner) = self.whole(x, y).filter(|&corner| self.size_at(corner) <= size) {
                    match votes.iter_mut().find(|(known, _)| *known == corner) {
                        Some((_, count)) => *count += 1,
                        None => votes.push((corner, 1)),
                    }
                }
            }
            // The most border; among equals the first on the page.
            match votes.iter().max_by_key(|&&(corner, count)| (count, std::cmp::Reverse(corner))) {
                Some(&(corner, _)) => self.fragments[fragment as usize].owner = corner,
                None => orphans.push(fragment),
            }
        }
        self.join(&orphans);
        for i in 0..self.fragments.len() {
            self.fragments[i].rim = self.is_rim(&self.fragments[i]);
        }
        for (i, fragment) in self.fragments.iter().enumerate() {
            if fragment.owner != fragment.seed {
                self.owned.push((fragment.owner, i as u32));
                let (x, y) = (fragment.owner as usize % self.width, fragment.owner as usize / self.width);
                self.blocks[y / BLOCK * self.across + x / BLOCK].owns = true;
            }
        }
        self.owned.sort_unstable();
    }

    /// Whether a fragment is all that the page's border leaves of a cell, and the cell before it owns it.
    fn is_rim(&self, fragment: &Fragment) -> bool {
        let size = usize::from(self.size_at(fragment.seed));
        let (x, y) = (fragment.seed as usize % self.width, fragment.seed as usize / self.width);
        let (left, top) = (x - x % size, y - y % size);
        let (wide, high) = (size.min(self.width - left), size.min(self.height - top));
        let before = |at: usize, dots: usize| if dots < size { at.checked_sub(size) } else { Some(at) };
        let (Some(x), Some(y)) = (before(left, wide), before(top, high)) else { return false };
        let owner = (y * self.width + x) as u32;
        usize::from(fragment.area) == wide * high
            && fragment.owner == owner
            && usize::from(self.size_at(owner)) == size
            && owner != fragment.seed
    }

    /// Fragments without a whole cell beside them: joined until they are as large as one.
    fn join(&mut self, orphans: &[u32]) {
        let by_seed: HashMap<u32, u32> =
            self.fragments.iter().enumerate().map(|(i, fragment)| (fragment.seed, i as u32)).collect();
        let mut area: HashMap<u32, u32> = orphans
            .iter()
            .map(|&i| (self.fragments[i as usize].seed, self.fragments[i as usize].area.into()))
            .collect();
        let mut members: HashMap<u32, Vec<u32>> =
            orphans.iter().map(|&i| (self.fragments[i as usize].seed, vec![i])).collect();
        for &orphan in orphans {
            let Fragment { seed, owner, .. } = self.fragments[orphan as usize];
            let (block, ..) = self.block(seed as usize % self.width, seed as usize / self.width);
            let needed = u32::from(block.size) * u32::from(block.size);
            if area.get(&owner).is_none_or(|&area| area >= needed) {
                continue;
            }
            let mut best: Option<(u32, u32)> = None;
            for (x, y) in self.neighbours(orphan) {
                let (block, in_x, in_y) = self.block(x, y);
                let mask = component(block, in_x, in_y);
                let Some(first) = (0..BLOCK).find(|&row| mask[row] != 0) else { continue };
                let column = mask[first].trailing_zeros() as usize;
                let seed = (y - in_y + first) * self.width + x - in_x + column;
                let Some(&other) = by_seed.get(&(seed as u32)) else { continue };
                let target = self.fragments[other as usize].owner;
                // What a whole cell owns counts as large enough; among groups the smallest first, to even them out.
                let size = area.get(&target).copied().unwrap_or(u32::MAX);
                if target != owner
                    && (size < u32::MAX || self.size_at(target) <= self.size_at(owner))
                    && best.is_none_or(|(known, _)| size < known)
                {
                    best = Some((size, target));
                }
            }
            if let Some((_, target)) = best {
                let moved = members.remove(&owner).unwrap_or_default();
                for &member in &moved {
                    self.fragments[member as usize].owner = target;
                }
                let own = area.remove(&owner).unwrap_or(0);
                if let Some(sum) = area.get_mut(&target) {
                    *sum += own;
                    members.entry(target).or_default().extend(moved);
                }
            }
        }
    }

    fn find_calm(&mut self) {
        let (down, across) = (self.down(), self.across);
        for row in 1..down.saturating_sub(1) {
            for column in 0..across {
                // Beyond either end rows go on as they end.
                let near = column.saturating_sub(1)..(column + 2).min(across);
                let around = |y: usize| &self.blocks[y * across..][near.clone()];
                let calm =
                    (row - 1..row + 2).all(|y| around(y).iter().all(|block| block.tone == [FULL; BLOCK]));
                self.blocks[row * across + column].calm = calm;
            }
        }
    }
}

/// The tones 4-connected to a dot within its cell.
fn component(block: &Block, x: usize, y: usize) -> Mask {
    let size = usize::from(block.size);
    let (left, top) = (x - x % size, y - y % size);
    let row = span(left, size);
    let mut mask = [0; BLOCK];
    mask[y] = 1 << x;
    loop {
        let mut changed = false;
        for y in top..top + size {
            let above = if y > top { mask[y - 1] } else { 0 };
            let below = if y + 1 < top + size { mask[y + 1] } else { 0 };
            let own = mask[y];
            let grown = (own | own << 1 | own >> 1 | above | below) & row & block.tone[y];
            changed |= grown != own;
            mask[y] = grown;
        }
        if !changed {
            return mask;
        }
    }
}

/// The dots of a block that are on the page.
fn inside(field: &Field, column: usize, row: usize) -> Mask {
    let (wide, high) = ((field.width - column * BLOCK).min(BLOCK), (field.height - row * BLOCK).min(BLOCK));
    std::array::from_fn(|y| if y < high { span(0, wide) } else { 0 })
}

/// Prints the solid dots of a block into its rows of the page, and returns the others.
fn cut(field: &Field, column: usize, row: usize, dots: &mut [u8]) -> Mask {
    let mut mask = inside(field, column, row);
    for (y, tones) in mask.iter_mut().enumerate() {
        for x in bits(*tones) {
            let stack = field.solids.at(column * BLOCK + x, row * BLOCK + y);
            if stack != TONE {
                *tones &= !(1 << x);
                dots[y * field.width + column * BLOCK + x] = stack;
            }
        }
    }
    mask
}
