//! Error diffusion of the whole vector of stacks from cell to cell.
//!
//! Problem: each cell prints one stack or two, and the means of many cells must be the mixture.
//! Method: a cell prints what it asks for most ([`Chooser`]), what the cells before it still owe included; the rest goes to
//! four neighbours, in serpentine rows, by the weights of Floyd and Steinberg, which a hash of the place disturbs in two
//! pairs (Ulichney): exact weights lock flat tones into patterns. What is owed waits in a slot for each cell of the next row;
//! where blocks of other cells begin, slots are divided anew. What comes over borders is in [`super::border`].
//! What a whole column of the strip and a row still owe counts a little ([`LINES`]), or columns of a tint would swing by more than
//! independent cells do.
//! A strip is diffused by itself, after block rows of lead-in whose dots are thrown away. Above the page there are none, so
//! there the first row of cells is taken to go on upwards ([`Strip::lead_in`]), and rows go on beyond both ends of the page like the
//! cells there ([`BESIDE`]). What the last row owes is let go: rows that nobody prints would take it. So no border of the page
//! needs to know what cells owe on average.
//! Cost: about two dozen operations a stack and cell. Memory: 24 x stacks numbers for each block across.

use super::arrange::Errors;
use super::border::{Usual, begin};
use super::cell::Cell;
use super::choose::{Chooser, Metric, NOISE, disturbing, halves_lock, textured};
use super::field::{Field, LANES, Row};
use super::mask::BLOCK;
use super::plan::{Block, Plan};

/// Part of an absent stack's debt that each cell hands to the stacks present.
const FORGET: f32 = 1.0 / 512.0;

/// Where debts go: to the next cell, and to the cells below: behind, straight down and ahead.
type Shares = [f32; 4];

/// What part of all that a column and a row of cells have been asked for and have not printed counts in a decision: enough
/// to keep whole columns and rows even. Twice as much adds 1 to 2 % to the error seen.
const LINES: f32 = 1.0 / 256.0;

/// Blocks beyond either end of a row, which are diffused and not printed: without them nothing comes from one side to the first
/// cells, and a tint of 3 % has half of its ink in the first column of a strip's first rows and twice as much in the second.
const BESIDE: usize = 2;

/// Dots from where a row begins to the page.
const MARGIN: usize = BESIDE * BLOCK;

/// The weights of Floyd and Steinberg.
const SHARES: Shares = [7.0 / 16.0, 3.0 / 16.0, 5.0 / 16.0, 1.0 / 16.0];

pub(super) struct Strip<'a> {
    field: &'a Field<'a>,
    plan: &'a Plan,
    /// Minimum cluster of each stack of the field.
    minimum: &'a [u16],
    /// Debts that wait: [`BLOCK`] slots a block, as many in use as it has cells across.
    slots: Vec<f32>,
    /// For each slot what its column has been asked for and has not printed, since it last met an edge.
    columns: Vec<f32>,
    /// The same for this row.
    line: Vec<f32>,
    /// The side of cells each block's slots are for.
    format: Vec<u8>,
    carry: Vec<f32>,
    late: Vec<f32>,
    want: Vec<f32>,
    /// What a cell beside this unit would ask for.
    beside: Vec<f32>,
    debt: Vec<f32>,
    asks: Vec<f32>,
    chooser: Chooser<'a>,
    scratch: Vec<f32>,
    rows: Vec<Row>,
    back: bool,
    /// Nothing has been diffused yet.
    fresh: bool,
    /// Rows of dots by which this row of cells lies above the page; 0 on the page.
    above: usize,
    /// By how much decisions are disturbed here, in cells. In the midst of a tone it is found once for a row of a block.
    disturbance: f32,
    errors: Errors,
    /// Whether halves are arranged by their neighbours' errors in this block.
    textured: bool,
}

/// A place for dots: rows of the page from `top`, or nowhere.
pub(super) struct Target<'a> {
    pub(super) rows: Option<&'a mut [u8]>,
    pub(super) top: usize,
}

impl<'a> Strip<'a> {
    pub(super) fn new(
        field: &'a Field<'a>,
        plan: &'a Plan,
        metric: &'a Metric,
        minimum: &'a [u16],
    ) -> Strip<'a> {
        let lanes = || vec![0.0; field.lanes];
        let across = plan.across + 2 * BESIDE;
        Strip {
            field,
            plan,
            minimum,
            slots: vec![0.0; across * BLOCK * field.lanes],
            columns: vec![0.0; across * BLOCK * field.lanes],
            line: lanes(),
            format: vec![BLOCK as u8; across],
            carry: lanes(),
            late: lanes(),
            want: lanes(),
            beside: lanes(),
            debt: lanes(),
            asks: lanes(),
            chooser: Chooser::new(metric, minimum, BLOCK),
            scratch: Vec::new(),
            rows: (0..=BLOCK).map(|_| Row::default()).collect(),
            back: false,
            fresh: true,
            above: 0,
            disturbance: 0.0,
            errors: Errors::new(across * BLOCK),
            textured: false,
        }
    }

    /// So many rows of blocks above the page, all like its first row of cells, which are not printed.
    #[inline(always)]
    pub(super) fn lead_in(&mut self, rows: usize) {
        for row in (1..=rows).rev() {
            self.rows(0, row * BLOCK, &mut Target { rows: None, top: 0 });
        }
    }

    /// One row of blocks.
    #[inline(always)]
    pub(super) fn block_row(&mut self, row: usize, target: &mut Target) {
        self.rows(row, 0, target);
    }

    /// One row of blocks, or one that is so many dots above the page and like its first row of cells.
    #[inline(always)]
    fn rows(&mut self, row: usize, above: usize, target: &mut Target) {
        let across = self.format.len();
        for column in 0..across {
            self.reformat(column, self.block(row, column).size);
        }
        for y in 0..BLOCK {
            let begins = |column: usize| y.is_multiple_of(usize::from(self.format[column]));
            let beyond = above == 0 && row * BLOCK + y >= self.field.height;
            if beyond || !(0..across).any(begins) {
                continue;
            }
            self.above = above.saturating_sub(y);
            self.back = !self.back;
            let mut before = false;
            for step in 0..across {
                let column = if self.back { across - 1 - step } else { step };
                let here = y.is_multiple_of(usize::from(self.format[column]));
                if !before {
                    self.carry.fill(0.0);
                    self.late.fill(0.0);
                    self.line.fill(0.0);
                    self.errors.interrupt();
                } else if !here {
                    self.leave(if self.back { column * BLOCK + BLOCK - 1 } else { column * BLOCK });
                }
                if here {
                    self.cells(row, column, y, target);
                }
                before = here;
            }
            self.fresh = false;
        }
    }

    /// The cells of a block that begin at row `y` of it.
    #[inline(always)]
    fn cells(&mut self, row: usize, column: usize, y: usize, target: &mut Target) {
        let plan = self.plan;
        let block = self.block(row, column);
        // Where a row ends on either side, the law of borders holds.
        let calm = block.calm && column > 0 && column + 1 < self.format.len();
        let size = usize::from(block.size);
        let count = BLOCK / size;
        let y = if self.above > 0 { 0 } else { row * BLOCK + y };
        self.field.row(size, y / size, &mut self.rows[size]);
        self.textured = self.chooser.cuts(size) && textured(block.varies);
        for step in 0..count {
            let cell = if self.back { count - 1 - step } else { step };
            let x = column * BLOCK + cell * size;
            let page = x.checked_sub(MARGIN).filter(|x| x + size <= self.field.width);
            let like = match page {
                Some(x) => (calm || plan.is_whole(x, y)).then_some(x),
                None => plan.goes_on(x < MARGIN, y),
            };
            if let Some(like) = like {
                self.field.cell(size, like / size, &mut self.rows[size], &mut self.want);
                let mut area = size * size;
                if block.owns && page.is_some() {
                    let owner = (y * self.field.width + like) as u32;
                    area += self.add_owned(owner);
                    // Larger than its like, but one of them to all around it.
                    if plan.owns_rims_alone(owner) {
                        let part = (size * size) as f32 / area as f32;
                        self.want.iter_mut().for_each(|want| *want *= part);
                        area = size * size;
                    }
                }
                if step == 0 || !calm {
                    self.disturbance = disturbing(&self.want, self.chooser.cuts(size), block.varies);
                }
                let cell = self.decide((x, y), size, area, true, calm);
                if let (Some(x), Some(rows)) = (page, target.rows.as_deref_mut()) {
                    let start = (y - target.top) * self.field.width + x;
                    cell.print(&mut rows[start..], self.field.width, size, &self.field.stacks);
                }
                continue;
            }
            self.interrupt_lines(x);
            let heads: Vec<u32> = match x.checked_sub(MARGIN).filter(|&x| x < self.field.width) {
                Some(x) => plan.heads(x, y).collect(),
                None => Vec::new(),
            };
            if heads.is_empty() {
                self.leave(x);
            }
            for head in heads {
                self.want.fill(0.0);
                let mut area = self.add_fragment(head);
                area += self.add_owned(plan.fragments[head as usize].seed);
                self.disturbance = disturbing(&self.want, self.chooser.cuts(size), block.varies);
                let [q, _] = self.decide((x, y), size, area, false, false).halves;
                self.interrupt_lines(x);
                if let Some(rows) = target.rows.as_deref_mut() {
                    for (x, y) in plan.dots(head) {
                        rows[(y - target.top) * self.field.width + x] = self.field.stacks[usize::from(q)];
                    }
                }
            }
        }
    }

    /// A block of a row, or the one at the end of the page that those beyond are like.
    fn block(&self, row: usize, column: usize) -> &'a Block {
        &self.plan.blocks[row * self.plan.across + column.saturating_sub(BESIDE).min(self.plan.across - 1)]
    }

    /// Whether a unit that decides begins in the cell of this dot, which may be beyond the ends of the page.
    fn decides(&self, x: usize, y: usize) -> bool {
        if x >= self.format.len() * BLOCK || y >= self.field.height {
            return false;
        }
        match x.checked_sub(MARGIN) {
            Some(page) if page < self.field.width && self.plan.decides(page, y) => true,
            Some(page) => self.plan.goes_on(false, y).is_some_and(|last| page > last),
            None => self.plan.goes_on(true, y).is_some(),
        }
    }

    /// Nothing that lines owe crosses an edge.
    fn interrupt_lines(&mut self, x: usize) {
        let slot = self.slot(x) * self.field.lanes;
        self.columns[slot..slot + self.field.lanes].fill(0.0);
        self.line.fill(0.0);
    }

    fn add_fragment(&mut self, fragment: u32) -> usize {
        let mut area = 0;
        for (x, y) in self.plan.dots(fragment) {
            self.field.add_dot(x, y, &mut self.scratch, &mut self.want);
            area += 1;
        }
        area
    }

    fn add_owned(&mut self, owner: u32) -> usize {
        let plan = self.plan;
        plan.owned(owner).map(|fragment| self.add_fragment(fragment)).sum()
    }

    /// What would go to a cell that does not decide now waits in its slot.
    fn leave(&mut self, x: usize) {
        let slot = self.slot(x);
        let lanes = self.field.lanes;
        for ((slot, carry), late) in
            self.slots[slot * lanes..][..lanes].iter_mut().zip(&mut self.carry).zip(&mut self.late)
        {
            *slot += std::mem::take(carry) + std::mem::take(late);
        }
    }

    /// The slot of the cell in column `x`.
    fn slot(&self, x: usize) -> usize {
        let block = x / BLOCK;
        block * BLOCK + x % BLOCK / usize::from(self.format[block])
    }

    /// Adds to `self.want` what waits in a slot and comes from the cell before, into `self.debt`; absent stacks hand some of
    /// theirs to those present. Into `self.asks` the same, disturbed by `noise` from this number on, with a part of what the
    /// lines owe, to which `self.want` is added.
    #[inline(always)]
    fn owe(&mut self, slot: usize, disturbance: f32, noise: u8) {
        let noise = &NOISE[usize::from(noise)..][..self.field.lanes];
        let columns = self.columns[slot..slot + self.field.lanes].as_chunks_mut::<LANES>().0;
        let lines = columns.iter_mut().zip(self.line.as_chunks_mut::<LANES>().0);
        let slots = self.slots[slot..slot + self.field.lanes].as_chunks::<LANES>().0;
        let (want, carry) = (self.want.as_chunks::<LANES>().0, self.carry.as_chunks::<LANES>().0);
        let (debt, asks) = (self.debt.as_chunks_mut::<LANES>().0, self.asks.as_chunks_mut::<LANES>().0);
        let (mut absent, mut present) = ([0.0f32; LANES], [0.0f32; LANES]);
        let owed = slots.iter().zip(carry).zip(noise.as_chunks::<LANES>().0);
        let stacks = debt.iter_mut().zip(asks).zip(want).zip(owed).zip(lines);
        for ((((debt, asks), want), ((slot, carry), noise)), (column, line)) in stacks {
            for l in 0..LANES {
                let sum = want[l] + slot[l] + carry[l];
                let here = want[l] > 0.0;
                present[l] += if here { 1.0 } else { 0.0 };
                let handed = if here { 0.0 } else { sum * FORGET };
                absent[l] += handed;
                debt[l] = sum - handed;
                let more = disturbance * noise[l] + LINES * (column[l] + line[l]);
                asks[l] = debt[l] + if here { more } else { 0.0 };
                column[l] += want[l];
                line[l] += want[l];
            }
        }
        let absent: f32 = absent.iter().sum();
        if absent != 0.0 {
            let each = absent / present.iter().sum::<f32>();
            for (debt, &want) in self.debt.iter_mut().zip(&self.want) {
                *debt += if want > 0.0 { each } else { 0.0 };
            }
        }
    }

    /// The stack for fragments of so many dots, of which [`Chooser::choose`] found `best`. A stack that would not hold gives
    /// way to the one with most debt that does. Where none does, the stack with the smallest minimum is printed: foil
    /// in specks would come off and be missed, while ink in a speck is only a little rough.
    fn holding(&self, best: usize, area: usize) -> usize {
        let holds = |q: usize| usize::from(self.minimum[q]) <= area;
        if holds(best) {
            return best;
        }
        let present = (0..self.minimum.len()).filter(|&q| self.want[q] > 0.0);
        let rank = |&a: &usize, &b: &usize| {
            let small = |q: usize| if holds(q) { 0 } else { self.minimum[q] };
            small(b).cmp(&small(a)).then(self.debt[a].total_cmp(&self.debt[b])).then(b.cmp(&a))
        };
        present.max_by(rank).unwrap_or(best)
    }

    /// Decides the stack of a unit that asks for `self.want`, and hands on what it owes.
    #[inline(always)]
    fn decide(&mut self, (x, y): (usize, usize), size: usize, area: usize, whole: bool, calm: bool) -> Cell {
        let lanes = self.field.lanes;
        let slot = self.slot(x) * lanes;
        let (behind, ahead) =
            if self.back { (x + size, x.wrapping_sub(1)) } else { (x.wrapping_sub(1), x + size) };
        let hash = hash(x.wrapping_sub(MARGIN), y.wrapping_sub(self.above));
        let mut shares = disturbed(hash);
        let mut missing = if self.fresh { SHARES[1..].iter().sum() } else { 0.0 };
        let mut begins = self.fresh;
        if !calm {
            // The first row of the page is below one like itself.
            let above = if self.fresh { usize::MAX } else { y.saturating_sub(1) };
            let below = if self.above > 0 { y } else { y + size };
            let to = [(ahead, y), (behind, below), (x, below), (ahead, below)];
            let from = [(behind, y), (behind, above), (x, above), (ahead, above)];
            // What goes over the lower border of the page is let go, for it was brought in at the upper one.
            let leaves = self.above == 0 && below + size > self.field.height;
            for (share, (x, to_y)) in shares.iter_mut().zip(to) {
                let goes =
                    self.decides(x, to_y) || (leaves && to_y == below && x < self.format.len() * BLOCK);
                *share = if goes { *share } else { 0.0 };
            }
            let comes = SHARES.iter().zip(from).filter(|&(_, (x, y))| self.decides(x, y));
            missing = 1.0 - comes.map(|(share, _)| share).sum::<f32>();
            begins = shares[2] > 0.0 && !self.decides(x, above);
        }
        if !calm {
            let part = (size * size) as f32 / area as f32;
            self.beside.iter_mut().zip(&self.want).for_each(|(beside, want)| *beside = want * part);
        }
        // The first cell of a tone gets nothing, since the last one has nowhere to leave what it owes.
        if missing > 0.0 && missing < 1.0 {
            let slots = &mut self.slots[slot..slot + lanes];
            let usual =
                Usual::new(Some(self.chooser.metric), &self.beside, size * size, self.chooser.small(size));
            begin(slots, &self.beside, missing, &usual, begins.then_some(hash));
        }
        let disturbance = self.disturbance * area as f32;
        let lot = hash.wrapping_mul(0x9e37_79b1);
        self.owe(slot, disturbance, (lot >> 24) as u8);
        // What owns fragments is not cut, for they print like its first dot.
        let side = (whole && area == size * size).then_some(size);
        if side.is_none() {
            self.ask_whole(size, area);
        }
        let mut cell = self.chooser.choose(&self.want, &self.asks, area as f32, side, lot >> 16);
        if !whole {
            cell = Cell::whole(self.holding(cell.halves[0].into(), area) as u8);
        }
        let place = slot / lanes;
        if self.textured && side.is_some() && !(cell.is_split() && halves_lock(&self.want)) {
            let own = (&self.want[..], area as f32);
            cell = self.errors.arrange(self.chooser.metric, (place, self.back), own, cell);
        } else {
            self.errors.forget(place);
        }
        for half in cell.halves {
            self.debt[usize::from(half)] -= 0.5 * area as f32;
            self.columns[slot + usize::from(half)] -= 0.5 * area as f32;
            self.line[usize::from(half)] -= 0.5 * area as f32;
        }
        let stays: f32 = shares.iter().sum();
        if !calm && stays > 0.0 && shares.contains(&0.0) {
            let usual =
                Usual::new(Some(self.chooser.metric), &self.beside, size * size, self.chooser.small(size));
            for (q, (debt, &want)) in self.debt.iter_mut().zip(&self.beside).enumerate() {
                let usual = usual.of(q, want);
                *debt = usual + (*debt - usual) / stays;
            }
        }
        let [next, back, down, over] = shares;
        let (debt, slots) = (self.debt.as_chunks::<LANES>().0, &mut self.slots[slot..slot + lanes]);
        let (carry, late) = (self.carry.as_chunks_mut::<LANES>().0, self.late.as_chunks_mut::<LANES>().0);
        let stacks = debt.iter().zip(slots.as_chunks_mut::<LANES>().0).zip(carry.iter_mut().zip(late));
        for ((debt, slot), (carry, late)) in stacks {
            for l in 0..LANES {
                carry[l] = debt[l] * next;
                slot[l] = late[l] + debt[l] * down;
                late[l] = debt[l] * over;
            }
        }
        if back > 0.0 {
            let slot = self.slot(behind) * lanes;
            for (slot, &debt) in self.slots[slot..slot + lanes].iter_mut().zip(&self.debt) {
                *slot += debt * back;
            }
        }
        cell
    }

    /// The mean of what cells of the last row owe, in dots: all of it waits for the next row, but for what goes along the row.
    #[cfg(test)]
    pub(super) fn mean_debts(&self) -> Vec<f64> {
        let lanes = self.field.lanes;
        let cells: usize = self.format.iter().map(|&size| BLOCK / usize::from(size)).sum();
        let waiting =
            |q: usize| self.slots.iter().skip(q).step_by(lanes).map(|&debt| f64::from(debt)).sum::<f64>();
        let down = f64::from(SHARES[1] + SHARES[2] + SHARES[3]);
        (0..lanes).map(|q| waiting(q) / cells as f64 / down).collect()
    }

    /// Adds to `self.asks` what a unit of so many dots would be owed more among its like than among cells of this side, which may be cut.
    fn ask_whole(&mut self, size: usize, area: usize) {
        let metric = Some(self.chooser.metric).filter(|_| !self.chooser.cuts(size));
        let like = Usual::new(metric, &self.want, area, &[]);
        let cells = Usual::new(metric, &self.beside, size * size, self.chooser.small(size));
        let wants = self.want.iter().zip(&self.beside);
        for (q, (asks, (&want, &beside))) in self.asks.iter_mut().zip(wants).enumerate() {
            *asks += like.of(q, want) - cells.of(q, beside);
        }
    }

    /// Divides the slots of a block for cells of another side.
    fn reformat(&mut self, column: usize, size: u8) {
        let lanes = self.field.lanes;
        let (old, new) = (usize::from(self.format[column]), usize::from(size));
        if old == new {
            return;
        }
        self.format[column] = size;
        for slot in column * BLOCK..(column + 1) * BLOCK {
            self.errors.forget(slot);
        }
        let slots = &mut self.slots[column * BLOCK * lanes..][..BLOCK * lanes];
        let before = slots.to_vec();
        slots.fill(0.0);
        self.columns[column * BLOCK * lanes..][..BLOCK * lanes].fill(0.0);
        for x in 0..BLOCK {
            let from = &before[x / old * lanes..][..lanes];
            for (slot, debt) in slots[x / new * lanes..][..lanes].iter_mut().zip(from) {
                *slot += debt / old as f32;
            }
        }
    }
}

fn hash(x: usize, y: usize) -> u32 {
    let mut hash = (x as u32).wrapping_mul(0x9e37_79b1) ^ (y as u32).wrapping_mul(0x85eb_ca77);
    hash = (hash ^ hash >> 15).wrapping_mul(0x2c1b_3c6d);
    hash = (hash ^ hash >> 12).wrapping_mul(0x297a_2d39);
    hash ^ hash >> 15
}

/// The weights of Floyd and Steinberg, both pairs disturbed by a hash of the place.
fn disturbed(hash: u32) -> Shares {
    let noise = |bits: u32| (bits & 0xffff) as f32 / 32768.0 - 1.0;
    let (a, b) = (0.5 * noise(hash) / 16.0, 1.5 * noise(hash >> 16) / 16.0);
    let [next, back, down, over] = SHARES;
    [next + a, back - b, down + b, over - a]
}
