//! A sample of the distinct materials of a document, with the share of its area that each represents.
//!
//! Problem: a document has millions of pixels; thousands are enough to learn bases.
//! Method: one pixel from a random place in every cell of a grid over the document, so that small areas are not missed by
//! chance; cells in random order. Indistinguishable pixels count as one material with their total weight: those whose
//! responses are equal after rounding, which keeps them within [`MERGED`] of each other.
//! Cost: at most [`DRAWS`] rows are read and [`VALUES`] values kept. Limits: a material that covers less than a cell of the
//! document (a hundred-thousandth of a large one) may be missed.

use maths::Maths;
use std::collections::HashMap;
use std::collections::hash_map::Entry;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use crate::brdf::Space;
use crate::materials::Materials;

use super::cbrt::cbrt;
use super::columns::Columns;
use super::error::{BRIGHTEST, FactorError};

/// The most pixels that are read.
const DRAWS: usize = 1 << 16;
/// The most materials that are kept.
const MATERIALS: usize = 20_000;
/// The most values that are kept. Long rows leave room for fewer materials, but never fewer than [`FEWEST`].
const VALUES: usize = 1 << 22;
/// Room for at least this many materials, however long the rows, for fewer would miss a document's corners.
const FEWEST: usize = 1024;
/// The largest distance between merged materials, in the metric (0.01: barely visible).
const MERGED: f64 = 0.005;

/// Materials as rows of [`Columns`].
#[derive(Clone, Debug)]
pub(super) struct Sample {
    /// The columns of the rows.
    pub columns: Columns,
    /// The materials, `columns.padded` values each.
    pub x: Vec<f32>,
    /// Their responses, see [`Columns::respond`].
    pub t: Vec<f32>,
    /// The share of the document that each represents; the shares sum to 1.
    pub weight: Vec<f64>,
}

impl Sample {
    /// Draws a sample. The result depends only on the document and the seed.
    pub fn draw(document: &dyn Materials, seed: u64) -> Result<Sample, FactorError> {
        let space = document.space();
        let pixels = chosen_pixels(document.width(), document.height(), seed);
        let limit = (VALUES / space.columns()).clamp(FEWEST, MATERIALS);
        let mut merge = Merge::new(space);
        let length = space.columns();
        for batch in pixels.chunks(4096) {
            let rows: Vec<Result<(Vec<f32>, u64), FactorError>> = batch
                .par_iter()
                .map(|&pixel| {
                    let mut row = vec![0.0; length];
                    read(document, pixel, &mut row)?;
                    let key = merge.key(&row);
                    Ok((row, key))
                })
                .collect();
            for row in rows {
                let (row, key) = row?;
                merge.add(&row, key);
            }
            if merge.count.len() >= limit {
                merge.keep(limit);
                break;
            }
        }
        Ok(merge.finish(space))
    }

    /// Number of materials.
    pub fn len(&self) -> usize {
        self.weight.len()
    }

    /// Material `i`.
    pub fn row(&self, i: usize) -> &[f32] {
        &self.x[i * self.columns.padded..][..self.columns.padded]
    }

    /// The response of material `i`.
    pub fn target(&self, i: usize) -> &[f32] {
        &self.t[i * self.columns.padded..][..self.columns.padded]
    }

    /// The mean material, as a row.
    pub fn mean(&self) -> Vec<f32> {
        let mut mean = vec![0.0f64; self.columns.padded];
        for (i, w) in self.weight.iter().enumerate() {
            mean.iter_mut().zip(self.row(i)).for_each(|(m, &x)| *m += w * f64::from(x));
        }
        mean.into_iter().map(|m| m as f32).collect()
    }

    /// The first `n` materials, which are a fair choice because their order is random; their weights sum to 1 again.
    pub fn thinned(&self, n: usize) -> Sample {
        let n = n.clamp(1, self.len());
        let weight = self.weight[..n].to_vec();
        let sum: f64 = weight.iter().sum();
        Sample {
            columns: self.columns.clone(),
            x: self.x[..n * self.columns.padded].to_vec(),
            t: self.t[..n * self.columns.padded].to_vec(),
            weight: weight.iter().map(|w| w / sum).collect(),
        }
    }
}

/// Reads the reflectance of a pixel and checks it.
pub(super) fn read(document: &dyn Materials, pixel: usize, row: &mut [f32]) -> Result<(), FactorError> {
    document.reflectance(pixel, row);
    // One comparison per value, false for NaN, so that the loop can be vectorised.
    if row.iter().all(|&v| v.abs() <= BRIGHTEST) {
        return Ok(());
    }
    let column = row.iter().position(|v| v.is_nan() || v.abs() > BRIGHTEST).unwrap_or(0);
    let (x, y) = (pixel % document.width(), pixel / document.width());
    Err(FactorError::Reflectance { x, y, column, value: row[column] })
}

/// One pixel of each cell of a grid of at most [`DRAWS`] cells, cells in random order.
fn chosen_pixels(width: usize, height: usize, seed: u64) -> Vec<usize> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let cell = (width as f64 * height as f64 / DRAWS as f64).sqrt().max(1.0);
    let count = |n: usize| ((n as f64 / cell).floor() as usize).clamp(1, n.min(DRAWS));
    let (across, down) = (count(width), count(height));
    // Limits the product too, for documents one pixel wide or high.
    let (across, down) = (across.min(DRAWS / down.min(DRAWS)), down);
    let mut pixels = Vec::with_capacity(across * down);
    for j in 0..down {
        for i in 0..across {
            let mut place = |i: usize, cells: usize, n: usize| {
                let (from, to) = (i * n / cells, (i + 1) * n / cells);
                random.random_range(from as u64..to as u64) as usize
            };
            let (x, y) = (place(i, across, width), place(j, down, height));
            pixels.push(y * width + x);
        }
    }
    for i in (1..pixels.len()).rev() {
        pixels.swap(i, random.random_range(0..=i as u64) as usize);
    }
    pixels
}

/// Merges materials with equal rounded responses.
struct Merge {
    length: usize,
    /// Factor from the cube root of reflectance to response, in rounding steps.
    steps: Vec<f32>,
    places: HashMap<u64, usize>,
    rows: Vec<f32>,
    count: Vec<u32>,
}

impl Merge {
    fn new(space: &Space) -> Merge {
        let step = MERGED / (space.columns() as f64).sqrt();
        let response = space.weight().iter().zip(space.radiance()).map(|(w, c)| w * c.cube_root());
        Merge {
            length: space.columns(),
            steps: response.map(|r| (r / step) as f32).collect(),
            places: HashMap::new(),
            rows: Vec::new(),
            count: Vec::new(),
        }
    }

    fn rounded(&self, row: &[f32]) -> impl Iterator<Item = u32> {
        // The floor is far below a step, so smaller values round to 0. The response is at most 1e2, so values fit.
        row.iter().zip(&self.steps).map(|(&f, &steps)| (steps * cbrt(f.max(1e-20)) + 0.5) as u32)
    }

    fn key(&self, row: &[f32]) -> u64 {
        self.rounded(row).fold(0xcbf2_9ce4_8422_2325, |hash: u64, v| {
            (hash ^ u64::from(v)).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29)
        })
    }

    fn add(&mut self, row: &[f32], key: u64) {
        let place = match self.places.entry(key) {
            Entry::Occupied(found) => Some(*found.get()),
            Entry::Vacant(free) => {
                free.insert(self.count.len());
                None
            }
        };
        // Materials with the same key but different roundings stay separate.
        if let Some(i) = place
            && self.rounded(&self.rows[i * self.length..][..self.length]).eq(self.rounded(row))
        {
            self.count[i] += 1;
        } else {
            self.rows.extend_from_slice(row);
            self.count.push(1);
        }
    }

    fn keep(&mut self, n: usize) {
        self.count.truncate(n);
        self.rows.truncate(n * self.length);
    }

    fn finish(self, space: &Space) -> Sample {
        let total: f64 = self.count.iter().map(|&c| f64::from(c)).sum();
        let weight: Vec<f64> = self.count.iter().map(|&c| f64::from(c) / total).collect();
        let mut mean = vec![0.0; self.length];
        for (row, w) in self.rows.chunks_exact(self.length).zip(&weight) {
            for (mean, &f) in mean.iter_mut().zip(row) {
                *mean += w * f64::from(f.max(0.0));
            }
        }
        let columns = Columns::new(space, &mean);
        let mut x = vec![0.0; weight.len() * columns.padded];
        let mut t = x.clone();
        for (i, row) in self.rows.chunks_exact(self.length).enumerate() {
            let place = i * columns.padded..(i + 1) * columns.padded;
            columns.scale(row, &mut x[place.clone()]);
            columns.respond(&x[place.clone()], &mut t[place]);
        }
        Sample { columns, x, t, weight }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::HashSet;

    proptest! {
        #[test]
        fn pixels_are_chosen_once_and_all_of_them_when_few(
            width in 1usize..3000, height in 1usize..3000, seed in 0u64..9
        ) {
            let pixels = chosen_pixels(width, height, seed);
            prop_assert!(pixels.len() <= DRAWS && pixels.iter().all(|&p| p < width * height));
            let distinct: HashSet<_> = pixels.iter().collect();
            prop_assert_eq!(distinct.len(), pixels.len());
            if width * height <= DRAWS {
                prop_assert_eq!(pixels.len(), width * height);
            }
        }
    }

    #[test]
    fn a_line_of_pixels_is_sampled_from_end_to_end() {
        for (width, height) in [(1, 10_000_000), (10_000_000, 1)] {
            let mut pixels = chosen_pixels(width, height, 1);
            pixels.sort_unstable();
            let widest = pixels.windows(2).map(|w| w[1] - w[0]).max().unwrap();
            assert!(pixels.len() <= DRAWS && widest < 2 * 10_000_000 / pixels.len() + 2);
            assert!(pixels[0] < 1000 && pixels[pixels.len() - 1] > 9_999_000);
        }
    }

    /// Two materials side by side: their weights are their areas.
    #[test]
    fn weights_are_areas() {
        struct Two(Space);
        impl Materials for Two {
            fn width(&self) -> usize {
                100
            }
            fn height(&self) -> usize {
                40
            }
            fn space(&self) -> &Space {
                &self.0
            }
            fn reflectance(&self, pixel: usize, out: &mut [f32]) {
                // Differences of 1e-5 are merged.
                let same = 1.0 + 1e-5 * (pixel % 7) as f32;
                out.fill(if pixel % 100 < 23 { 0.4 * same } else { 0.1 * same });
            }
        }
        let sample = Sample::draw(&Two(Space::half_angle(8)), 1).unwrap();
        let mut shares: Vec<(f32, f64)> =
            (0..sample.len()).map(|i| (sample.row(i)[0], sample.weight[i])).collect();
        shares.sort_by(|a, b| a.0.total_cmp(&b.0));
        let light: f64 = shares.iter().filter(|s| s.0 > 1.0).map(|s| s.1).sum();
        assert!(sample.len() <= 4, "a rounding border may split a material: {shares:?}");
        assert!((light - 0.23).abs() < 1e-12, "{shares:?}");
    }
}
