//! The stacks of a grid, where none are named.
//!
//! Problem: of some fifty stacks, the few whose combinations come nearest to the images.
//! Method: half of the sample is spread evenly over the image, the other half are the pixels farthest from those before in the metric,
//! so that a rare colour counts. Greedy, then exchanges. Each round adds the stack that lowers the sum of squared distances over a sample of the
//! images' pixels the most, with all cells of equal area; then each is exchanged for a better one while that helps. What would
//! need more cartridges than the printer holds, or does not hold in cells of this size, is left out.
//! Cost: candidates x (1 to 3 rounds) x stacks x sample solutions of [`Solver`]. Limits: not always the best set.

use maths::Maths;
use std::collections::BTreeSet;

use appearance::brdf::{Space, Table, reflectances};
use inks::{Library, Stack};
use observe::Observer;
use press::separate::MOST_CARTRIDGES;
use rayon::prelude::*;

use super::{DisplayError, Grid, Screen, Solver};

/// Pixels of the images that are looked at.
const SAMPLE: usize = 64;
/// Pixels among which the rare ones are looked for.
const SEARCHED: usize = 4096;
/// The most rounds of exchanges.
const EXCHANGES: usize = 2;

/// What is to be shown: rows of reflectance (1/sr) in one tabulation.
pub struct Target<'a> {
    /// The tabulation.
    pub space: &'a Space,
    /// The rows.
    pub rows: Vec<Vec<f32>>,
}

impl<'a> Target<'a> {
    /// Pixels evenly drawn from an image, and the ones that differ most from all drawn before.
    pub fn sample(image: &'a dyn appearance::materials::Materials) -> Target<'a> {
        let (space, pixels) = (image.space(), image.width() * image.height());
        let count = SEARCHED.min(pixels);
        let row = |i: usize| {
            let mut row = vec![0.0; space.columns()];
            // The golden ratio: even over rows and columns alike.
            let at = (i as f64 * 0.618_033_988_749_895).fract();
            let pixel = if pixels <= SAMPLE { i } else { (at * pixels as f64) as usize };
            image.reflectance(pixel.min(pixels - 1), &mut row);
            row
        };
        let mut searched: Vec<Vec<f32>> = (0..count).map(row).collect();
        if searched.len() <= SAMPLE {
            return Target { space, rows: searched };
        }
        let seen = |row: &[f32]| -> Vec<f64> {
            let each = row.iter().zip(space.radiance()).zip(space.weight());
            each.map(|((&f, c), w)| w * (f64::from(f).max(0.0) * c).cube_root()).collect()
        };
        let points: Vec<Vec<f64>> = searched.iter().map(|row| seen(row)).collect();
        let apart = |a: usize, b: usize| -> f64 {
            points[a].iter().zip(&points[b]).map(|(a, b)| (a - b).squared()).sum()
        };
        let mut drawn: Vec<usize> = (0..SAMPLE / 2).collect();
        let nearest = |k: usize| drawn.iter().map(|&d| apart(k, d)).fold(f64::INFINITY, f64::min);
        let mut away: Vec<f64> = (0..points.len()).into_par_iter().map(nearest).collect();
        while drawn.len() < SAMPLE {
            let far = (0..away.len()).max_by(|&a, &b| away[a].total_cmp(&away[b])).unwrap_or_default();
            // Everything else is in the sample already.
            if away[far] == 0.0 {
                break;
            }
            away.iter_mut().enumerate().for_each(|(k, away)| *away = away.min(apart(k, far)));
            drawn.push(far);
        }
        let rows = drawn.into_iter().map(|k| std::mem::take(&mut searched[k])).collect();
        Target { space, rows }
    }
}

/// `count` of the `candidates` that show the targets best under a screen.
///
/// # Errors
/// Fewer candidates than wanted that hold in cells of this size.
pub fn choose(
    candidates: &[Stack],
    count: usize,
    targets: &[Target],
    screen: &Screen,
    library: &Library,
    observer: &dyn Observer,
) -> Result<Vec<Stack>, DisplayError> {
    let holds = |stack: &&Stack| Grid::check_cells(screen, std::slice::from_ref(*stack), library).is_ok();
    let usable: Vec<Stack> = candidates.iter().filter(holds).cloned().collect();
    if usable.len() < count {
        // The reason is the finest of those left out, if there is one.
        Grid::check_cells(screen, candidates, library)?;
        return Err(DisplayError::Stacks(format!(
            "only {} can be printed with these inks; a grid needs {count}",
            usable.len()
        )));
    }
    let tables: Vec<Table> = targets.iter().map(|t| reflectances(&usable, library, t.space)).collect();
    let set_error = |set: &[usize]| -> Option<f64> {
        let inks: BTreeSet<_> = set.iter().flat_map(|&q| usable[q].layers()).collect();
        if inks.len() > MOST_CARTRIDGES {
            return None;
        }
        let sum = |(target, table): (&Target, &Table)| {
            let mut rows = Table::new(target.space.columns());
            set.iter().for_each(|&q| rows.push(table.row(q)));
            let solver = Solver::of_rows(target.space, &rows, &vec![1.0; set.len()], screen.leak());
            target.rows.iter().map(|row| solver.solve(row).1.squared()).sum::<f64>()
                / target.rows.len() as f64
        };
        Some(targets.iter().zip(&tables).map(sum).sum())
    };
    // The best stack to put beside the others, with the error it leaves.
    let best_beside = |others: &[usize]| -> Option<(usize, f64)> {
        let error = |new: usize| {
            let set: Vec<usize> = others.iter().copied().chain([new]).collect();
            if others.contains(&new) { None } else { set_error(&set).map(|error| (new, error)) }
        };
        let all: Vec<Option<(usize, f64)>> = (0..usable.len()).into_par_iter().map(error).collect();
        all.into_iter().flatten().min_by(|a, b| a.1.total_cmp(&b.1))
    };
    observer.begin("choosing stacks", (count * (1 + EXCHANGES)) as u64);
    let (mut chosen, mut error): (Vec<usize>, f64) = (Vec::new(), f64::INFINITY);
    for _ in 0..count {
        let Some((best, left)) = best_beside(&chosen) else {
            return Err(DisplayError::Stacks(format!(
                "no {count} stacks fit into {MOST_CARTRIDGES} cartridges"
            )));
        };
        chosen.push(best);
        error = left;
        observer.advance(1);
    }
    for _ in 0..EXCHANGES {
        let before = error;
        for place in 0..count {
            let others: Vec<usize> =
                chosen.iter().enumerate().filter(|(at, _)| *at != place).map(|(_, &q)| q).collect();
            if let Some((best, left)) = best_beside(&others).filter(|(_, left)| *left < error) {
                (chosen[place], error) = (best, left);
            }
            observer.advance(1);
        }
        if error >= before {
            break;
        }
    }
    observer.end();
    Ok(chosen.into_iter().map(|q| usable[q].clone()).collect())
}
