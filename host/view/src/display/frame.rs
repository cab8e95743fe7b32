//! What the screen shows: a value for every cell, and the whole screen as a picture.

use appearance::materials::Materials;
use inks::Library;
use rayon::prelude::*;
use readers::Pixels;

use super::grid::MARGIN;
use super::{DisplayError, Grid, Solver};

/// A value for each cell of a grid, margin included, row by row: 0 closed, 255 open.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// The values.
    pub values: Vec<u8>,
    /// How far the nearest colours and highlights are from the image: distance d, pixel by pixel, on average and 95 % of pixels
    /// below. Nothing for the alignment frame.
    pub distance: Option<(f64, f64)>,
}

impl Frame {
    /// The frame by which screen and print are aligned: slits over the crosses, and all cells of the first stack open. In line,
    /// slits are dark from end to end and the grid is even; beside it paper shines through the slits.
    pub fn alignment(grid: &Grid) -> Frame {
        let (across, down) = grid.cells();
        let inside = |at: usize, cells: usize| (MARGIN..cells - MARGIN).contains(&at);
        let value = |cell: usize| {
            let (x, y) = (cell % across, cell / across);
            let open = if inside(x, across) && inside(y, down) {
                grid.on(x, y) == Some(0)
            } else {
                grid.is_cross(x, y)
            };
            if open { 255 } else { 0 }
        };
        Frame { values: (0..across * down).map(value).collect(), distance: None }
    }

    /// The frame that comes nearest to an image.
    ///
    /// # Errors
    /// An image of another shape.
    pub fn for_image(grid: &Grid, image: &dyn Materials, library: &Library) -> Result<Frame, DisplayError> {
        let found = (image.width(), image.height());
        if found != grid.pixels() {
            return Err(DisplayError::Shape { image: found, display: grid.pixels() });
        }
        let screen = grid.screen();
        let relative: Vec<f64> = grid.shares();
        let least = relative.iter().copied().fold(1.0, f64::min);
        let gains: Vec<f64> = relative.iter().map(|share| share / least).collect();
        let solver = Solver::new(image.space(), grid.stacks(), &gains, screen.leak(), library);
        let (tile, (across, down)) = (grid.tile(), grid.cells());
        let mut values = vec![0u8; across * down];
        let mut distance = vec![0.0; found.0 * found.1];
        values[MARGIN * across..(down - MARGIN) * across]
            .par_chunks_mut(tile * across)
            .zip(distance.par_chunks_mut(found.0))
            .enumerate()
            .for_each(|(y, (cells, distance))| {
                let mut row = vec![0.0; image.space().columns()];
                let mut last: Option<(Vec<f32>, Vec<f64>, f64)> = None;
                for (x, distance) in distance.iter_mut().enumerate() {
                    image.reflectance(y * found.0 + x, &mut row);
                    // Pixels often repeat their neighbour.
                    if last.as_ref().is_none_or(|(known, ..)| *known != row) {
                        let (open, d) = solver.solve(&row);
                        last = Some((row.clone(), open, d));
                    }
                    let Some((_, open, d)) = &last else { continue };
                    *distance = *d;
                    for (ty, tx) in (0..tile).flat_map(|ty| (0..tile).map(move |tx| (ty, tx))) {
                        let at = ty * across + MARGIN + x * tile + tx;
                        cells[at] = screen.value(open[grid.stack_in_tile(tx, ty)]);
                    }
                }
            });
        let mean = distance.iter().sum::<f64>() / distance.len() as f64;
        let at = (distance.len() - 1) * 19 / 20;
        let (_, p95, _) = distance.select_nth_unstable_by(at, f64::total_cmp);
        Ok(Frame { values, distance: Some((mean, *p95)) })
    }

    /// The whole screen.
    pub fn picture(&self, grid: &Grid) -> Pixels<u8> {
        let screen = grid.screen();
        let ((left, top), (across, down)) = (grid.origin(), grid.cells());
        let cell = |at: u32, first: u32| at.checked_sub(first).map(|at| (at / screen.cell) as usize);
        Pixels::from_fn(screen.pixels.0, screen.pixels.1, |x, y| match (cell(x, left), cell(y, top)) {
            (Some(x), Some(y)) if x < across && y < down => self.values[y * across + x],
            _ => 0,
        })
    }
}
