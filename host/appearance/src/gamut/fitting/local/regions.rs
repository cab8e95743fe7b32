//! Means over regions of a document: overlapping windows, and in each the materials of one kind.
//!
//! Problem: what neighbours have in common must vary smoothly, so that no edge appears where there was none, but must not
//! leak from one material into another beside it, which would draw a halo.
//! Method: a bilateral grid. Nodes lie [`CELL`] pixels apart, and a pixel belongs to the four around it with bilinear
//! weights. Kinds are materials of the document at least [`APART`] from each other, found farthest first in a sample; a
//! pixel belongs to those near it, most to the nearest. Both memberships are partitions of unity, so a region is a node and
//! a kind, and a pixel has a weight in up to a dozen of them.
//! Cost: for each pixel, the distance to every kind and an addition per column and region; three vectors for every
//! `CELL^2` pixels and kind. Limits: materials of kinds beyond [`MOST_KINDS`] join the nearest.
//! Source: Chen, Paris & Durand 2007 for the grid; Gonzalez 1985 for the kinds.

use crate::brdf::Table;
use maths::Maths;

/// Distance between nodes in pixels. A window is two cells wide: 32 pixels
/// (decisions/contrast-between-neighbours.md).
pub(super) const CELL: usize = 16;
/// Materials that differ by more than this (in d) are of different kinds
/// (decisions/contrast-between-neighbours.md).
const APART: f64 = 0.2;
/// How gradually a material passes from one kind to another (standard deviation, in d), so that kinds
/// [`APART`] from each other hardly share one (decisions/contrast-between-neighbours.md).
const BLUR: f64 = 0.07;
/// The most kinds in a document.
const MOST_KINDS: usize = 8;
/// Memberships below this share of the largest are left out.
const LEAST: f64 = 0.02;

/// A vector of `columns` numbers for each region.
pub(super) struct Regions {
    /// Nodes across the document.
    across: usize,
    columns: usize,
    /// One material of each kind, as rows of the space in which d is the Euclidean distance.
    kinds: Table,
    values: Vec<f32>,
}

/// The regions that a pixel belongs to, and its weight in each; the weights sum to 1.
#[derive(Default)]
pub(super) struct Membership {
    regions: Vec<(usize, f32)>,
    kinds: Vec<f64>,
}

/// Weighted sums over a row of cells, for the nodes above and below it.
pub(super) struct Sums {
    first: usize,
    values: Vec<f32>,
}

impl Regions {
    /// Regions of a document of this size, all vectors zero. `sample` has materials in the space in which d is Euclidean.
    pub fn new(width: usize, height: usize, sample: &Table) -> Regions {
        let kinds = kinds(sample);
        let (across, down) = (width.div_ceil(CELL) + 1, height.div_ceil(CELL) + 1);
        let columns = sample.columns();
        Regions { across, columns, values: vec![0.0; across * down * kinds.len() * columns], kinds }
    }

    /// Finds the regions of a pixel at `x`, `y` that looks like `seen`.
    pub fn locate(&self, x: usize, y: usize, seen: &[f64], place: &mut Membership) {
        place.kinds.clear();
        place.kinds.extend(self.kinds.rows().map(|kind| squared(kind, seen)));
        let nearest = place.kinds.iter().copied().fold(f64::INFINITY, f64::min);
        for kind in &mut place.kinds {
            let w = ((nearest - *kind) / (2.0 * BLUR * BLUR)).exponential();
            *kind = if w < LEAST { 0.0 } else { w };
        }
        let sum: f64 = place.kinds.iter().sum();
        let inside = |p: usize| ((p % CELL) as f64 + 0.5) / CELL as f64;
        let (u, v) = (inside(x), inside(y));
        let node = y / CELL * self.across + x / CELL;
        let corners = [
            (node, (1.0 - u) * (1.0 - v)),
            (node + 1, u * (1.0 - v)),
            (node + self.across, (1.0 - u) * v),
            (node + self.across + 1, u * v),
        ];
        place.regions.clear();
        for (kind, &w) in place.kinds.iter().enumerate().filter(|(_, w)| **w > 0.0) {
            for (node, corner) in corners {
                place.regions.push((node * self.kinds.len() + kind, (corner * w / sum) as f32));
            }
        }
    }

    /// The mean of the vectors around a pixel.
    pub fn read(&self, place: &Membership, out: &mut [f64]) {
        out.fill(0.0);
        for &(region, w) in &place.regions {
            let values = &self.values[region * self.columns..][..self.columns];
            out.iter_mut().zip(values).for_each(|(out, &v)| *out += f64::from(w * v));
        }
    }

    /// Sums of zero for row `row` of cells.
    pub fn sums(&self, row: usize) -> Sums {
        let regions = self.across * self.kinds.len();
        Sums { first: row * regions, values: vec![0.0; 2 * regions * (self.columns + 1)] }
    }

    /// Makes the vectors the means of what was summed, one [`Sums`] for each row of cells.
    pub fn take_means(&mut self, rows: &[Sums]) {
        let (n, width) = (self.columns, self.across * self.kinds.len());
        for (region, out) in self.values.chunks_exact_mut(n).enumerate() {
            let row = region / width;
            let at = |row: usize| {
                let sums = rows.get(row)?;
                Some(&sums.values[(region - sums.first) * (n + 1)..][..n + 1])
            };
            let (above, below) = (row.checked_sub(1).and_then(at), at(row));
            let sum = |j: usize| above.map_or(0.0, |a| a[j]) + below.map_or(0.0, |b| b[j]);
            let total = sum(n);
            for (j, out) in out.iter_mut().enumerate() {
                *out = if total > 0.0 { sum(j) / total } else { 0.0 };
            }
        }
    }
}

impl Sums {
    /// Adds the vector of a pixel.
    pub fn add(&mut self, place: &Membership, weight: f32, vector: &[f64]) {
        let n = vector.len();
        for &(region, w) in &place.regions {
            let out = &mut self.values[(region - self.first) * (n + 1)..][..n + 1];
            let w = w * weight;
            out[n] += w;
            out.iter_mut().zip(vector).for_each(|(out, &v)| *out += w * v as f32);
        }
    }
}

/// Rows of the sample such that every other is within [`APART`] of one of them, or [`MOST_KINDS`] of them.
fn kinds(sample: &Table) -> Table {
    let mut kinds = Table::new(sample.columns());
    let mut distance = vec![f64::INFINITY; sample.len()];
    let mut next = 0;
    while kinds.len() < MOST_KINDS {
        kinds.push(sample.row(next));
        for (d, row) in distance.iter_mut().zip(sample.rows()) {
            *d = d.min(squared(row, sample.row(next)));
        }
        // The first of equals.
        next = (0..sample.len()).fold(0, |far, i| if distance[i] > distance[far] { i } else { far });
        if distance[next] <= APART * APART {
            break;
        }
    }
    kinds
}

fn squared(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(testing::cases(24))]

        /// A vector that is the same everywhere is its own mean in every region, and so around every pixel.
        #[test]
        fn memberships_are_partitions_of_unity(
            width in 1usize..50,
            height in 1usize..50,
            looks in prop::collection::vec(0.0f64..1.0, 64),
        ) {
            let (mut regions, places) = field(width, height, &looks);
            let mut rows: Vec<Sums> = (0..height.div_ceil(CELL)).map(|row| regions.sums(row)).collect();
            for (pixel, place) in places.iter().enumerate() {
                let sum: f32 = place.regions.iter().map(|(_, w)| w).sum();
                prop_assert!((sum - 1.0).abs() < 1e-5, "{sum}");
                rows[pixel / width / CELL].add(place, 1.0, &[0.25, -3.0]);
            }
            regions.take_means(&rows);
            let mut out = [0.0; 2];
            for place in &places {
                regions.read(place, &mut out);
                prop_assert!((out[0] - 0.25).abs() < 1e-5 && (out[1] + 3.0).abs() < 1e-4, "{out:?}");
            }
        }

        /// Means over rows of cells are the plain weighted means over all pixels.
        #[test]
        fn means_are_the_plain_ones(
            width in 1usize..40,
            height in 1usize..40,
            looks in prop::collection::vec(0.0f64..1.0, 64),
        ) {
            let (mut regions, places) = field(width, height, &looks);
            let value = |pixel: usize| [(pixel * 37 % 101) as f64 / 101.0, (pixel * 53 % 89) as f64 / 89.0];
            let mut rows: Vec<Sums> = (0..height.div_ceil(CELL)).map(|row| regions.sums(row)).collect();
            let mut plain = vec![[0.0f64; 3]; regions.values.len() / 2];
            for (pixel, place) in places.iter().enumerate() {
                let weight = 0.5 + (pixel % 3) as f32;
                rows[pixel / width / CELL].add(place, weight, &value(pixel));
                for &(region, w) in &place.regions {
                    let w = f64::from(w * weight);
                    plain[region][2] += w;
                    (0..2).for_each(|j| plain[region][j] += w * value(pixel)[j]);
                }
            }
            regions.take_means(&rows);
            for (mean, plain) in regions.values.chunks_exact(2).zip(&plain) {
                for j in 0..2 {
                    let expected = if plain[2] > 0.0 { plain[j] / plain[2] } else { 0.0 };
                    prop_assert!((f64::from(mean[j]) - expected).abs() < 1e-4, "{mean:?} {plain:?}");
                }
            }
        }
    }

    /// Regions of a document whose pixels look like `looks` in turn, and the place of each pixel.
    fn field(width: usize, height: usize, looks: &[f64]) -> (Regions, Vec<Membership>) {
        let mut sample = Table::new(2);
        looks.iter().for_each(|&look| sample.push(&[look, 0.5 * look]));
        let regions = Regions::new(width, height, &sample);
        let places = (0..width * height).map(|pixel| {
            let mut place = Membership::default();
            regions.locate(pixel % width, pixel / width, sample.row(pixel % sample.len()), &mut place);
            place
        });
        let places = places.collect();
        (regions, places)
    }

    /// Kinds are apart from each other, and every material is near one.
    #[test]
    fn kinds_cover_the_sample_and_lie_apart() {
        let mut sample = Table::new(2);
        (0..60u32).for_each(|i| sample.push(&[f64::from(i) / 60.0, 0.0]));
        let kinds = kinds(&sample);
        assert!(kinds.len() > 3 && kinds.len() <= MOST_KINDS);
        for (i, kind) in kinds.rows().enumerate() {
            assert!(kinds.rows().take(i).all(|other| squared(kind, other) > APART * APART));
        }
        for row in sample.rows() {
            assert!(kinds.rows().any(|kind| squared(kind, row) <= APART * APART + 1e-12));
        }
    }

    /// Two materials far apart share no region.
    #[test]
    fn materials_far_apart_share_no_region() {
        let (regions, _) = field(4, 4, &[0.0, 0.9]);
        let (mut one, mut other) = (Membership::default(), Membership::default());
        regions.locate(1, 1, &[0.0, 0.0], &mut one);
        regions.locate(2, 1, &[0.9, 0.45], &mut other);
        assert!(one.regions.iter().all(|(a, _)| other.regions.iter().all(|(b, _)| a != b)));
    }
}
