//! A document averaged to the resolution of its print.
//!
//! Problem: a document may have many pixels for each cluster of dots, and every stage would pay for all of them, though the
//! print shows only their mean.
//! Method: reflectance adds, so the mean over the pixels of a cell, by area, is what the cell should reflect. A row is
//! computed when it is asked for and never kept: the averages of a page would take most of a gigabyte. Cells of a single
//! material cost one evaluation and keep its bits, so that they still count as equal.
//! Cost: one evaluation for each covered pixel; a few bytes for each row and column of cells.
//! Limits: detail finer than a cell is lost; documents are never enlarged.

use super::cover::Cover;
use super::factored::Factored;
use super::pixels::Materials;
use crate::brdf::Space;
use crate::weights::{ONE, WeightError, WeightMaps, quantise};

/// A document averaged over cells. See the module documentation.
pub struct Reduced<'a> {
    document: &'a dyn Materials,
    across: Vec<Cover>,
    down: Vec<Cover>,
}

/// The cells that show a document in a print of `cells` (across, down): its own pixels along a side that has no more of
/// them. `None` if that is so for both sides.
pub fn resolution(pixels: (usize, usize), cells: (usize, usize)) -> Option<(usize, usize)> {
    let reduced = (pixels.0.min(cells.0).max(1), pixels.1.min(cells.1).max(1));
    (reduced != pixels && pixels.0.max(pixels.1) < 1 << 16).then_some(reduced)
}

fn covers(pixels: usize, cells: usize) -> Vec<Cover> {
    (0..cells).map(|i| Cover::new(i, cells, pixels)).collect()
}

impl<'a> Reduced<'a> {
    /// Averages a document over `cells`, as [`resolution`] gives them.
    pub fn new(document: &'a dyn Materials, cells: (usize, usize)) -> Reduced<'a> {
        let (across, down) = (covers(document.width(), cells.0), covers(document.height(), cells.1));
        Reduced { document, across, down }
    }

    fn cell(&self, pixel: usize) -> (&Cover, &Cover) {
        (&self.across[pixel % self.across.len()], &self.down[pixel / self.across.len()])
    }

    /// The pixels of a cell with the share of each.
    fn pixels(&self, cell: usize) -> impl Iterator<Item = (usize, u32)> + use<'_> {
        let (across, down) = self.cell(cell);
        let width = self.document.width();
        down.shares()
            .flat_map(move |(y, part)| across.shares().map(move |(x, share)| (y * width + x, part * share)))
    }

    /// The first pixel of a cell, if the others have its key.
    fn single(&self, cell: usize, row: &mut [f32]) -> Option<usize> {
        let mut pixels = self.pixels(cell);
        let (first, _) = pixels.next()?;
        let key = self.document.key(first, row);
        pixels.all(|(pixel, _)| self.document.key(pixel, row) == key).then_some(first)
    }
}

impl Materials for Reduced<'_> {
    fn width(&self) -> usize {
        self.across.len()
    }

    fn height(&self) -> usize {
        self.down.len()
    }

    fn space(&self) -> &Space {
        self.document.space()
    }

    fn reflectance(&self, pixel: usize, out: &mut [f32]) {
        if let Some(single) = self.single(pixel, out) {
            return self.document.reflectance(single, out);
        }
        out.fill(0.0);
        self.add(pixel, 1.0, out);
    }

    fn add(&self, pixel: usize, part: f32, out: &mut [f32]) {
        let scale = part / (self.document.width() as f32 * self.document.height() as f32);
        for (pixel, share) in self.pixels(pixel) {
            self.document.add(pixel, share as f32 * scale, out);
        }
    }

    fn key(&self, pixel: usize, row: &mut [f32]) -> u64 {
        let mut keys = self.pixels(pixel).map(|(pixel, share)| (self.document.key(pixel, row), share));
        let Some((first, share)) = keys.next() else { return 0 };
        let mix = |hash: u64, value: u64| (hash.rotate_left(5) ^ value).wrapping_mul(0x517c_c1b7_2722_0a95);
        let (mut hash, mut same) = (mix(first, u64::from(share)), true);
        for (key, share) in keys {
            same &= key == first;
            hash = mix(mix(hash, key), u64::from(share));
        }
        if same { first } else { hash }
    }
}

impl Factored {
    /// The document averaged over `cells`, as [`resolution`] gives them: the mean of the weights is that of the reflectance.
    ///
    /// # Errors
    /// Never for weight maps that are valid.
    pub fn reduced(&self, cells: (usize, usize)) -> Result<Factored, WeightError> {
        let (across, down) = (covers(self.maps.width(), cells.0), covers(self.maps.height(), cells.1));
        let channels = self.maps.channels();
        let scale = 1.0 / (f64::from(ONE) * self.maps.width() as f64 * self.maps.height() as f64);
        let mut data = vec![0; cells.0 * cells.1 * channels];
        let mut sums = vec![0u64; channels];
        let mut weights = vec![0.0; channels];
        let places = down.iter().flat_map(|down| across.iter().map(move |across| (down, across)));
        for ((down, across), out) in places.zip(data.chunks_exact_mut(channels)) {
            sums.fill(0);
            for (y, part) in down.shares() {
                for (x, share) in across.shares() {
                    let part = u64::from(part) * u64::from(share);
                    let pixel = self.maps.at(y * self.maps.width() + x);
                    sums.iter_mut().zip(pixel).for_each(|(sum, &w)| *sum += part * u64::from(w));
                }
            }
            weights.iter_mut().zip(&sums).for_each(|(w, &sum)| *w = sum as f64 * scale);
            quantise(&weights, out);
        }
        let maps = WeightMaps::new(cells.0, cells.1, channels, data)?;
        Ok(Factored { space: self.space.clone(), bases: self.bases.clone(), maps })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::Table;
    use crate::materials::{Distinct, Surface, Surfaces};
    use proptest::prelude::*;

    /// Surfaces from few numbers, so that some repeat.
    fn surfaces(width: usize, height: usize, seed: u32, kinds: u32) -> Surfaces {
        Surfaces::build(width, height, Space::half_angle(5), move |i| {
            let n = (i as u32).wrapping_add(seed).wrapping_mul(2_654_435_761) >> 16;
            let value = (n % kinds) as f32 / kinds as f32;
            Surface {
                diffuse: [value, 0.5, 1.0 - value],
                f0: [0.04 + 0.5 * value; 3],
                alpha: 0.03 + value * value,
            }
        })
    }

    proptest! {
        /// Each pixel as cells x cells smaller ones, which belong wholly to one cell.
        #[test]
        fn a_cell_reflects_the_mean_of_its_pixels(
            (width, height) in (1usize..12, 1usize..12), (across, down) in (1usize..12, 1usize..12),
            seed in any::<u32>(), kinds in 1u32..9,
        ) {
            let document = surfaces(width, height, seed, kinds);
            let cells = (across.min(width), down.min(height));
            let reduced = Reduced::new(&document, cells);
            let columns = document.space().columns();
            let (mut row, mut found) = (vec![0.0; columns], vec![0.0; columns]);
            for cell in 0..cells.0 * cells.1 {
                let (x, y) = (cell % cells.0, cell / cells.0);
                let mut sum = vec![0.0f64; columns];
                for v in y * height..(y + 1) * height {
                    for u in x * width..(x + 1) * width {
                        document.reflectance(v / cells.1 * width + u / cells.0, &mut row);
                        sum.iter_mut().zip(&row).for_each(|(s, &f)| *s += f64::from(f));
                    }
                }
                reduced.reflectance(cell, &mut found);
                for (&found, sum) in found.iter().zip(sum) {
                    let expected = sum / (width * height) as f64;
                    prop_assert!((f64::from(found) / expected - 1.0).abs() < 1e-5, "{found} {expected}");
                }
            }
            // Pixels with one number reflect the same, bit for bit.
            let distinct = Distinct::find(&reduced);
            for (cell, &class) in distinct.class().iter().enumerate() {
                reduced.reflectance(cell, &mut row);
                reduced.reflectance(distinct.first()[class as usize] as usize, &mut found);
                prop_assert_eq!(&row, &found);
            }
        }

        #[test]
        fn a_factored_document_is_reduced_like_any_other(
            (width, height) in (1usize..12, 1usize..12), (across, down) in (1usize..12, 1usize..12), seed in any::<u32>(),
        ) {
            let space = Space::half_angle(4);
            let mut bases = Table::new(space.columns());
            (0..3).for_each(|k| bases.push(&(0..12).map(|j| 0.1 + f64::from((k * j) % 7)).collect::<Vec<_>>()));
            let mut data = vec![0; width * height * 3];
            for (i, out) in data.chunks_exact_mut(3).enumerate() {
                let part = |k: u32| f64::from((i as u32 + k).wrapping_mul(2_654_435_761 ^ seed) >> 20);
                quantise(&[part(1), part(2), part(3)], out);
            }
            let factored = Factored { space, bases, maps: WeightMaps::new(width, height, 3, data).unwrap() };
            let cells = (across.min(width), down.min(height));
            let (a, b) = (factored.reduced(cells).unwrap(), Reduced::new(&factored, cells));
            let (mut one, mut other) = ([0.0; 12], [0.0; 12]);
            for cell in 0..cells.0 * cells.1 {
                a.reflectance(cell, &mut one);
                b.reflectance(cell, &mut other);
                for (one, other) in one.iter().zip(&other) {
                    prop_assert!((one - other).abs() < 1e-3, "{one} {other}");
                }
            }
        }
    }

    #[test]
    fn only_sides_with_more_pixels_than_cells_are_reduced() {
        assert_eq!(resolution((100, 100), (100, 200)), None);
        assert_eq!(resolution((100, 50), (40, 60)), Some((40, 50)));
        assert_eq!(resolution((3, 5), (1, 0)), Some((1, 1)));
    }

    /// A flat field is one material, whatever the cells cover.
    #[test]
    fn a_field_of_one_material_stays_one() {
        let document = surfaces(50, 40, 0, 1);
        let distinct = Distinct::find(&Reduced::new(&document, (17, 13)));
        assert_eq!(distinct.first(), [0]);
    }
}
