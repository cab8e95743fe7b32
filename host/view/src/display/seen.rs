//! What an eye sees of a frame: the mean of the forward model over each pixel, exactly.
//!
//! Method: the print's cells and the screen's are both rectangles, so along each axis a cell of the print falls into pieces on
//! which the light's way in and the eye's way out each cross one cell of the screen. A weight is a sum over pairs of pieces.
//! Cost: one product for each pair of pieces; one pair a cell in line, at most about sixteen otherwise.

use maths::Maths;
use press::preview::Radiance;
use rayon::prelude::*;
use sheet::DOTS_PER_MM;

use super::grid::MARGIN;
use super::{Frame, Grid};
use appearance::brdf::{Space, reflectances};
use inks::Library;

/// Refractive index of what lies between print and screen.
const GLASS: f64 = 1.5;

/// How the screen lies over the print.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Placed {
    /// How far the screen lies right of and below its place, in millimetres.
    pub shift_mm: [f64; 2],
    /// Glass between print and the screen's pixels, in millimetres, 0 or more.
    pub depth_mm: f64,
}

/// Unit directions from the print to a distant light and a distant eye: x right, y up, z out of the print, all z above 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sight {
    /// To the light.
    pub light: [f64; 3],
    /// To the eye.
    pub eye: [f64; 3],
}

impl Sight {
    /// The half angle in radians.
    pub fn half_angle(&self) -> f64 {
        let sum: [f64; 3] = std::array::from_fn(|c| self.light[c] + self.eye[c]);
        let length = sum.iter().map(|v| v * v).sum::<f64>().sqrt();
        (sum[2] / length.max(1e-12)).clamp(0.0, 1.0).arccosine()
    }
}

impl Placed {
    /// Where the way through a place of the print crosses the screen, less that place: right and down, in millimetres on the
    /// screen.
    pub(super) fn crossing(&self, direction: [f64; 3]) -> [f64; 2] {
        let [x, y, _] = direction;
        let sine = (x * x + y * y).sqrt() / GLASS;
        // tan(theta') along the direction; straight up there is none.
        let per = self.depth_mm / (GLASS * (1.0 - sine * sine).sqrt());
        [x * per - self.shift_mm[0], -y * per - self.shift_mm[1]]
    }
}

/// A piece of a cell: its length in millimetres, and the cells of the screen above it on the way in and on the way out; `None`
/// beyond the grid, where the screen is closed.
type Piece = (f64, Option<usize>, Option<usize>);

/// The pieces of each cell along an axis.
fn pieces(grid: &Grid, cells: usize, [way_in, way_out]: [f64; 2]) -> Vec<Vec<Piece>> {
    let side = grid.screen().cell_mm();
    let edge = |cell: usize| grid.edge(cell) as f64 / DOTS_PER_MM;
    let above =
        |at: f64| (at >= 0.0 && at < side * cells as f64).then(|| ((at / side) as usize).min(cells - 1));
    (0..cells)
        .map(|cell| {
            let (from, to) = (edge(cell), edge(cell + 1));
            let mut cuts = vec![from, to];
            for way in [way_in, way_out] {
                let first = ((from + way) / side).ceil() as i64;
                let last = ((to + way) / side).floor() as i64;
                cuts.extend((first..=last).map(|i| (i as f64 * side - way).clamp(from, to)));
            }
            cuts.sort_by(f64::total_cmp);
            let parts = cuts.windows(2).filter(|cut| cut[1] - cut[0] > 1e-12);
            parts
                .map(|cut| {
                    let middle = 0.5 * (cut[0] + cut[1]);
                    (cut[1] - cut[0], above(middle + way_in), above(middle + way_out))
                })
                .collect()
        })
        .collect()
}

/// The weight of each stack in each pixel, row by row: what `sum_q W_q f_q` returns of the light.
pub fn seen(grid: &Grid, frame: &Frame, placed: &Placed, sight: &Sight) -> Vec<f64> {
    let (across, down) = grid.cells();
    let (light, eye) = (placed.crossing(sight.light), placed.crossing(sight.eye));
    let columns = pieces(grid, across, [light[0], eye[0]]);
    let rows = pieces(grid, down, [light[1], eye[1]]);
    let passes: Vec<f64> = (0..=255u8).map(|value| grid.screen().passes(value)).collect();
    let through = |x: Option<usize>, y: Option<usize>| match (x, y) {
        (Some(x), Some(y)) => passes[usize::from(frame.values[y * across + x])],
        _ => passes[0],
    };
    let ((width, height), tile, count) = (grid.pixels(), grid.tile(), grid.stacks().len());
    let edge = |cell: usize| grid.edge(cell) as f64 / DOTS_PER_MM;
    let mut weights = vec![0.0; width * height * count];
    weights.par_chunks_mut(width * count).enumerate().for_each(|(y, line)| {
        let top = MARGIN + y * tile;
        for (x, out) in line.chunks_exact_mut(count).enumerate() {
            let left = MARGIN + x * tile;
            for (ty, tx) in (0..tile).flat_map(|ty| (0..tile).map(move |tx| (ty, tx))) {
                let sum = &mut out[grid.stack_in_tile(tx, ty)];
                for &(long, in_y, out_y) in &rows[top + ty] {
                    for &(wide, in_x, out_x) in &columns[left + tx] {
                        *sum += long * wide * through(in_x, in_y) * through(out_x, out_y);
                    }
                }
            }
            let area = (edge(left + tile) - edge(left)) * (edge(top + tile) - edge(top));
            out.iter_mut().for_each(|w| *w /= area);
        }
    });
    weights
}

/// The display as an eye sees it, laid flat, `zoom` x `zoom` pixels for each of its own. `gain` makes up for the light that it
/// loses: 1 shows it beside a print, `1 / brightness` as an eye that has adapted to it.
pub fn picture_of(
    grid: &Grid,
    frame: &Frame,
    placed: &Placed,
    sight: &Sight,
    library: &Library,
    (zoom, gain): (usize, f64),
) -> Radiance {
    let space = Space::half_angle(appearance::document::SAMPLES);
    let looks = reflectances(grid.stacks(), library, &space);
    let angle = sight.half_angle();
    let curves: Vec<[f64; 3]> = looks.rows().map(|row| space.curve(row).at(angle)).collect();
    let weights = seen(grid, frame, placed, sight);
    let light = gain * sight.light[2].max(0.0);
    let colour = |weights: &[f64]| {
        let sum = |c: usize| weights.iter().zip(&curves).map(|(w, f)| w * f[c]).sum::<f64>() * light;
        [sum(0) as f32, sum(1) as f32, sum(2) as f32, 1.0]
    };
    let pixels: Vec<[f32; 4]> = weights.chunks_exact(curves.len()).map(colour).collect();
    let (width, height) = grid.pixels();
    let at = |i: usize| pixels[i / (width * zoom) / zoom * width + i % (width * zoom) / zoom];
    Radiance {
        width: width * zoom,
        height: height * zoom,
        pixels: (0..width * height * zoom * zoom).map(at).collect(),
    }
}
