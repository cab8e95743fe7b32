//! Green noise: one table of thresholds by which every dot picks its stack by itself.
//!
//! Problem: a halftone that decides dot by dot keeps letters whole and needs nothing of its surroundings, but its dots must hang
//! together as far as the inks need it, without a pattern that an eye sees.
//! Method: [`Table`] repeats every [`SIDE`] dots both ways. A stack that has the lowest `share` of the thresholds lies in clusters of a size
//! that depends on the share, spaced as evenly as chance allows: `make` says how. The scale of the clusters follows from the minimum
//! cluster of the inks, so the machine decides and not the art. The table for [`USUAL`] dots is stored, others are made when they
//! are asked for.
//! Cost: nothing for the stored one, about a second for another. Memory: 128 KiB.
//! Limits: the minimum cluster is about the mean at a sixth of the area. At a twentieth, clusters are a third of it.
//! Source: R. Ulichney, The void-and-cluster method for dither array generation (1993); D. Lau, G. Arce, N. Gallagher, Green-noise
//! digital halftoning (1998), for clusters of a chosen size.

mod make;

use std::sync::OnceLock;

use appearance::weights::ONE;

/// Dots after which a table repeats, across and down, so that a place takes 8 bits.
pub const SIDE: usize = 256;

/// The minimum cluster whose table is stored: that of the process inks in the built-in library.
pub const USUAL: u16 = 4;

/// The ranks of the table for [`USUAL`], two bytes each, the low one first.
static STORED: &[u8; 2 * SIDE * SIDE] = include_bytes!("green_noise/4.bin");

/// Thresholds, row by row.
pub struct Table(Vec<u16>);

impl Table {
    /// The table for inks with this minimum cluster in dots.
    pub fn for_cluster(minimum: u16) -> &'static Table {
        /// By minimum cluster.
        static TABLES: [OnceLock<Table>; super::LARGEST as usize + 1] = [const { OnceLock::new() }; _];
        let minimum = minimum.clamp(1, super::LARGEST);
        TABLES[usize::from(minimum)].get_or_init(|| {
            Table::of_ranks(match minimum {
                USUAL => STORED.as_chunks::<2>().0.iter().map(|&rank| u16::from_le_bytes(rank)).collect(),
                other => Table::ranks(other),
            })
        })
    }

    /// The order in which the dots of the table for this minimum cluster are set, made anew; it is stored for [`USUAL`].
    pub fn ranks(minimum: u16) -> Vec<u16> {
        make::ranks(SIDE, scale(minimum))
    }

    fn of_ranks(ranks: Vec<u16>) -> Table {
        let per = u32::from(ONE);
        let dots = (SIDE * SIDE) as u32;
        Table(ranks.into_iter().map(|rank| (u32::from(rank) * per / dots) as u16).collect())
    }

    /// The thresholds of a row of dots, from 0 to less than [`ONE`]; they repeat after [`SIDE`] columns. A stack has the
    /// dots whose threshold is less than its share.
    #[inline]
    pub fn row(&self, y: usize) -> &[u16; SIDE] {
        let (rows, _) = self.0.as_chunks::<SIDE>();
        &rows[y % SIDE]
    }
}

/// How much larger than those of [`USUAL`] the clusters for another minimum are, in length.
fn scale(minimum: u16) -> f64 {
    (f64::from(minimum) / f64::from(USUAL)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mean dots of the parts that the dots with a rank in `set` make on a torus, and the share of dots that are parts alone.
    fn parts(ranks: &[u16], set: impl Fn(usize) -> bool) -> (f64, f64) {
        let side = ranks.len().isqrt();
        let mut left: Vec<bool> = ranks.iter().map(|&rank| set(usize::from(rank))).collect();
        let dots = left.iter().filter(|&&set| set).count();
        let (mut count, mut alone) = (0, 0);
        for first in 0..ranks.len() {
            if !std::mem::take(&mut left[first]) {
                continue;
            }
            let (mut open, mut size) = (vec![first], 0);
            while let Some(at) = open.pop() {
                size += 1;
                let (x, y) = (at % side, at / side);
                let beside = [(x + 1, y), (x + side - 1, y), (x, y + 1), (x, y + side - 1)];
                let beside = beside.map(|(x, y)| y % side * side + x % side);
                open.extend(beside.into_iter().filter(|&at| std::mem::take(&mut left[at])));
            }
            count += 1;
            alone += usize::from(size == 1);
        }
        (dots as f64 / f64::from(count), alone as f64 / dots as f64)
    }

    fn of_share(ranks: &[u16], share: f64) -> [(f64, f64); 2] {
        let least = (share * ranks.len() as f64).round() as usize;
        [parts(ranks, |rank| rank < least), parts(ranks, |rank| rank >= ranks.len() - least)]
    }

    #[test]
    fn the_stored_table_is_the_one_that_is_made() {
        let made: Vec<u8> = Table::ranks(USUAL).into_iter().flat_map(u16::to_le_bytes).collect();
        assert!(made == STORED, "the example green_noise makes the stored table");
    }

    /// At a tenth of the area and more, parts grow with the area, holes like dots, and few dots lie alone.
    #[test]
    fn parts_have_the_size_that_the_cluster_asks_for() {
        // A scale of 1 is the published kernel's; areas of parts go with the square of the scale.
        for (scale, sizes) in [(1.0, [1.4, 3.6, 7.3]), (1.5, [3.6, 8.4, 16.8])] {
            let ranks = make::ranks(128, scale);
            for (share, size) in [0.05, 0.15, 0.3].into_iter().zip(sizes) {
                for (mean, alone) in of_share(&ranks, share) {
                    // From a third on parts touch: then they are at least as large.
                    let ratio = mean / size;
                    let is_right = ratio > 0.88 && (share == 0.3 || ratio < 1.12);
                    assert!(is_right, "{scale}, {share}: {mean} dots a part");
                    assert!(share < 0.1 || alone <= 0.05, "{scale}, {share}: {alone} of the dots alone");
                }
            }
        }
    }

    /// What is coarser than the clusters is even: there is little power at low frequencies, and none of it in one direction.
    #[test]
    fn an_eye_from_afar_sees_an_even_tone() {
        let side = 128;
        let ranks = make::ranks(side, 1.0);
        for share in [0.1, 0.3, 0.5, 0.8] {
            let least = (share * ranks.len() as f64) as u16;
            let set: Vec<usize> = (0..ranks.len()).filter(|&at| ranks[at] < least).collect();
            // In units of what dots at random would have.
            let power = |u: i32, v: i32| {
                let (mut re, mut im) = (0.0, 0.0);
                for &at in &set {
                    let turn = (u * (at % side) as i32 + v * (at / side) as i32).rem_euclid(side as i32);
                    let (sin, cos) = (std::f64::consts::TAU * f64::from(turn) / side as f64).sin_cos();
                    (re, im) = (re + cos, im + sin);
                }
                (re * re + im * im) / (ranks.len() as f64 * share * (1.0 - share))
            };
            let mean = |from: i32, to: i32| {
                let all = (0..=to).flat_map(|u| (-to..=to).map(move |v| (u, v)));
                let ring: Vec<f64> = all
                    .filter(|&(u, v)| (from * from..=to * to).contains(&(u * u + v * v)) && (u > 0 || v > 0))
                    .map(|(u, v)| power(u, v))
                    .collect();
                ring.iter().sum::<f64>() / ring.len() as f64
            };
            // Up to a period of 16 dots, .7 mm; the clusters' own period is 5 to 7.
            let (coarse, fine) = (mean(1, 8), mean(18, 26));
            assert!(coarse < 0.1 && fine > 1.0, "{share}: {coarse} and {fine}");
        }
    }

    #[test]
    fn every_threshold_is_there_as_often_and_less_than_one() {
        let mut counts = vec![0; usize::from(ONE)];
        let table = Table::for_cluster(USUAL);
        (0..SIDE).for_each(|y| table.row(y + SIDE).iter().for_each(|&t| counts[usize::from(t)] += 1));
        assert!(counts.iter().all(|&count| count == SIDE * SIDE / usize::from(ONE)));
    }
}
