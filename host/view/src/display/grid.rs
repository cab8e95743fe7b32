//! The printed grid: which stack lies in which cell, and where the cells' edges are in dots.
//!
//! Problem: the screen's pitch is not a whole number of dots.
//! Method: cell i reaches from dot `round(i p)` to dot `round((i + 1) p)`, so edges never drift. Stacks repeat in tiles, row
//! by row in the order they are given; where K stacks fill rows of K cells, each row starts one further, so two stacks make a
//! checkerboard. Around the grid lies a margin of [`MARGIN`] cells of bare paper with a cross at each corner, one cell wide,
//! in the stack that is farthest from paper.
//! Cost: one pass over the dots. Limits: stacks that do not fill a tile evenly; the first ones have more cells.

use appearance::brdf::{Space, reflectances};
use inks::{Library, Stack};
use maths::Maths;
use sheet::{DOTS_PER_MM, DotMap};

use super::{DisplayError, MOST_STACKS, Screen};

/// Cells of margin on each side of the grid.
pub const MARGIN: usize = 10;
/// Cells from the middle of a cross to the end of its arm. One cell lies between cross and grid.
const ARM: usize = 4;

/// A grid of stacks for a screen. See the module text.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    screen: Screen,
    stacks: Vec<Stack>,
    /// The stack of the crosses, by its place in `stacks`.
    dark: usize,
    tile: usize,
    pixels: (usize, usize),
}

/// Cells along the side of a tile of so many stacks.
fn tile(stacks: usize) -> usize {
    (1..=stacks).find(|side| side * side >= stacks).unwrap_or(1)
}

impl Grid {
    /// A grid that shows images of `pixels` (across, down) with these stacks under a screen, printed on at most `room` dots.
    ///
    /// # Errors
    /// A screen or stacks that cannot be, cells finer than the stacks' minimum clusters, or too little room on screen or sheet.
    pub fn new(
        screen: Screen,
        stacks: Vec<Stack>,
        pixels: (usize, usize),
        library: &Library,
        room: (usize, usize),
    ) -> Result<Grid, DisplayError> {
        screen.check()?;
        if !(2..=MOST_STACKS).contains(&stacks.len()) {
            return Err(DisplayError::Stacks(format!(
                "{} in the grid; give 2 to {MOST_STACKS} that differ",
                stacks.len()
            )));
        }
        if let Some((_, twice)) = stacks.iter().enumerate().find(|(i, stack)| stacks[..*i].contains(stack)) {
            return Err(DisplayError::Stacks(format!("{twice} is given twice")));
        }
        if pixels.0 == 0 || pixels.1 == 0 {
            return Err(DisplayError::Shape { image: pixels, display: (1, 1) });
        }
        Grid::check_cells(&screen, &stacks, library)?;
        let tile = tile(stacks.len());
        let space = Space::half_angle(32);
        let looks = reflectances(&stacks, library, &space);
        let paper = reflectances(&[Stack::SUBSTRATE], library, &space);
        let far = |q: usize| space.distance(looks.row(q), paper.row(0));
        let dark = (0..stacks.len()).max_by(|&a, &b| far(a).total_cmp(&far(b))).unwrap_or(0);
        let grid = Grid { screen, stacks, dark, tile, pixels };
        grid.check_room(room)?;
        Ok(grid)
    }

    /// Whether stacks hold in cells of this size.
    pub(super) fn check_cells(
        screen: &Screen,
        stacks: &[Stack],
        library: &Library,
    ) -> Result<(), DisplayError> {
        let side = |cell: u32| (screen.pitch_mm * f64::from(cell) * DOTS_PER_MM).floor() as usize;
        let Some(stack) = stacks.iter().max_by_key(|stack| library.minimum_cluster(stack)) else {
            return Ok(());
        };
        let needs = library.minimum_cluster(stack);
        let holds = |cell: u32| side(cell).pow(2) >= usize::from(needs);
        if holds(screen.cell) {
            return Ok(());
        }
        let wanted = f64::from(needs).sqrt().ceil() / (screen.pitch_mm * DOTS_PER_MM);
        let enough = (wanted.ceil().min(1e9) as u32).max(1);
        Err(DisplayError::Fine {
            cell_mm: screen.cell_mm(),
            side: side(screen.cell),
            stack: stack.clone(),
            needs,
            enough,
        })
    }

    fn check_room(&self, room: (usize, usize)) -> Result<(), DisplayError> {
        let (tile, cell) = (self.tile as u64, u64::from(self.screen.cell));
        // An image may be as large as memory; its product with a cell is not.
        let cells = |pixels: usize| (pixels as u64).saturating_mul(tile).saturating_add(2 * MARGIN as u64);
        let needs = |pixels: usize| cells(pixels).saturating_mul(cell);
        let most = |available: u64| (available / cell).saturating_sub(2 * MARGIN as u64) / tile;
        let (image, (width, height)) = (self.pixels, self.screen.pixels);
        let needed = (needs(image.0), needs(image.1));
        if needed.0 > width.into() || needed.1 > height.into() {
            let most = (most(width.into()) as usize, most(height.into()) as usize);
            return Err(DisplayError::Mask {
                image,
                needs: needed,
                screen: self.screen.pixels,
                most: in_shape(image, most),
            });
        }
        let (across, down) = self.size_dots();
        if across > room.0 || down > room.1 {
            let fit = |dots: usize| {
                let cells = (dots as f64 / DOTS_PER_MM / self.screen.cell_mm()).floor() as u64;
                cells.saturating_sub(2 * MARGIN as u64) / tile
            };
            return Err(DisplayError::Sheet {
                image,
                grid_mm: (across as f64 / DOTS_PER_MM, down as f64 / DOTS_PER_MM),
                sheet_mm: (room.0 as f64 / DOTS_PER_MM, room.1 as f64 / DOTS_PER_MM),
                most: in_shape(image, (fit(room.0) as usize, fit(room.1) as usize)),
            });
        }
        Ok(())
    }

    /// The screen.
    pub fn screen(&self) -> &Screen {
        &self.screen
    }

    /// The stacks.
    pub fn stacks(&self) -> &[Stack] {
        &self.stacks
    }

    /// Pixels of an image, across and down.
    pub fn pixels(&self) -> (usize, usize) {
        self.pixels
    }

    /// Cells along a side of a tile.
    pub fn tile(&self) -> usize {
        self.tile
    }

    /// Cells across and down, the margin included.
    pub fn cells(&self) -> (usize, usize) {
        (self.pixels.0 * self.tile + 2 * MARGIN, self.pixels.1 * self.tile + 2 * MARGIN)
    }

    /// Dots across and down.
    pub fn size_dots(&self) -> (usize, usize) {
        let (across, down) = self.cells();
        (self.edge(across), self.edge(down))
    }

    /// The first dot of a cell, along either side.
    pub fn edge(&self, cell: usize) -> usize {
        (cell as f64 * self.screen.cell_mm() * DOTS_PER_MM).round() as usize
    }

    /// The first pixel of the screen, across and down, that the first cell takes when the grid lies in the middle.
    pub fn origin(&self) -> (u32, u32) {
        let (across, down) = self.cells();
        let first = |screen: u32, cells: usize| (screen - cells as u32 * self.screen.cell) / 2;
        (first(self.screen.pixels.0, across), first(self.screen.pixels.1, down))
    }

    /// The stack at a cell of a tile, by its place in [`Grid::stacks`].
    pub fn stack_in_tile(&self, x: usize, y: usize) -> usize {
        let turn = if self.tile.is_multiple_of(self.stacks.len()) { y } else { 0 };
        (y * self.tile + x + turn) % self.stacks.len()
    }

    /// What lies on a cell, margin included: the number of a stack, or `None` for bare paper.
    pub fn on(&self, x: usize, y: usize) -> Option<usize> {
        let (across, down) = self.cells();
        let inside = |at: usize, cells: usize| (MARGIN..cells - MARGIN).contains(&at);
        if inside(x, across) && inside(y, down) {
            return Some(self.stack_in_tile((x - MARGIN) % self.tile, (y - MARGIN) % self.tile));
        }
        self.is_cross(x, y).then_some(self.dark)
    }

    /// Whether a cell of the margin belongs to a cross.
    pub(super) fn is_cross(&self, x: usize, y: usize) -> bool {
        let (across, down) = self.cells();
        // From the nearer end, so that all corners are alike.
        let arm = |at: usize, cells: usize| at.min(cells - 1 - at);
        let (x, y) = (arm(x, across), arm(y, down));
        (x == ARM && y <= 2 * ARM) || (y == ARM && x <= 2 * ARM)
    }

    /// The share of the grid that each stack has.
    pub fn shares(&self) -> Vec<f64> {
        let mut shares = vec![0.0; self.stacks.len()];
        for (y, x) in (0..self.tile).flat_map(|y| (0..self.tile).map(move |x| (y, x))) {
            shares[self.stack_in_tile(x, y)] += 1.0 / (self.tile * self.tile) as f64;
        }
        shares
    }

    /// How bright the display is beside a print: the brightness that every stack reaches alone.
    pub fn brightness(&self) -> f64 {
        self.shares().into_iter().fold(1.0, f64::min) * self.screen.open.squared()
    }

    /// The dots to print.
    ///
    /// # Errors
    /// Never for a grid that was checked.
    pub fn dots(&self) -> Result<DotMap, DisplayError> {
        let mut stacks = vec![Stack::SUBSTRATE];
        stacks.extend(self.stacks.iter().filter(|stack| !stack.layers().is_empty()).cloned());
        let number = |q: usize| stacks.iter().position(|known| *known == self.stacks[q]).unwrap_or(0) as u8;
        let numbers: Vec<u8> = (0..self.stacks.len()).map(number).collect();
        let ((across, down), (width, length)) = (self.cells(), self.size_dots());
        let mut index = Vec::with_capacity(width * length);
        let mut row = Vec::with_capacity(width);
        for y in 0..down {
            row.clear();
            for x in 0..across {
                let dots = self.edge(x + 1) - self.edge(x);
                row.extend(std::iter::repeat_n(self.on(x, y).map_or(0, |q| numbers[q]), dots));
            }
            for _ in self.edge(y)..self.edge(y + 1) {
                index.extend_from_slice(&row);
            }
        }
        Ok(DotMap::new(width, length, stacks, index)?)
    }
}

/// The largest image of the same proportions within `most`.
fn in_shape((width, height): (usize, usize), most: (usize, usize)) -> (usize, usize) {
    let scale = (most.0 as f64 / width as f64).min(most.1 as f64 / height as f64);
    ((width as f64 * scale + 1e-9).floor() as usize, (height as f64 * scale + 1e-9).floor() as usize)
}
