//! Where a fit starts: at the solution for the most similar of the materials fitted before.
//!
//! Problem: a fit from a good start takes two or three steps instead of five, and the pixel before is not
//! always a good one: textures are noisy, and materials alternate. Hue in the dark makes the objective
//! hollow in places, too, and a walk from one solution to the next would not notice that it has left the
//! deepest.
//! Method: the last [`HELD`] solutions are kept in a ring with a summary of their targets: weighted cube
//! roots of the radiance at [`NUMBERS`] columns. The nearest summary decides. Each also has the summary of
//! the target from which its hollow comes, for which solutions were sought with care; where that is far,
//! they are to be sought again.
//! Cost: half a microsecond for each target, a tenth of a fit; 8 bytes for each stack and solution. Limits:
//! two targets that differ only between the columns of the summary look equal, which costs steps and
//! nothing else.

use crate::solve::{Hull, Target};
use crate::wide::wide;

/// Solutions that are kept, as measured: on rusty metal with all inks a fit takes 3.9 steps with one, 3.0
/// with 64, 2.7 with 256, 2.6 with 512.
const HELD: usize = 256;
/// Squared distance of targets up to which the solution of one is in the hollow of the other's: barely
/// visible. Source: hollows change places where both are equally deep, and beside them by less than targets
/// do.
const NEAR: f32 = 1e-4;
/// Numbers in a summary: two of [`LANES`], so that a comparison is a few operations beside a fit's thousands.
const NUMBERS: usize = 16;
/// Sums use this many lanes on every processor, so that they are equal on all.
const LANES: usize = 8;

/// Solutions to start from.
#[derive(Default)]
pub(crate) struct WarmStarts {
    summaries: Vec<[f32; NUMBERS]>,
    /// The target from which the hollow of each comes.
    origins: Vec<[f32; NUMBERS]>,
    /// The last target that was asked for, and the origin of what was found for it or, without, itself.
    asked: ([f32; NUMBERS], [f32; NUMBERS]),
    /// The weights of each, one after the other.
    weights: Vec<f64>,
    /// The next to be replaced.
    oldest: usize,
}

impl WarmStarts {
    /// Copies the solution for the most similar target to `start`, and says whether it is so similar that
    /// its hollow is this target's. `None` if there is none yet.
    pub fn start(&mut self, hull: &Hull, target: &Target, start: &mut [f64]) -> Option<bool> {
        let summary = target.summary(hull);
        self.asked = (summary, summary);
        let found = wide(
            #[inline(always)]
            || nearest(&summary, &self.summaries),
        );
        let i = found?;
        start.copy_from_slice(&self.weights[i * start.len()..][..start.len()]);
        let origin = self.origins[i];
        let near = squared_distance(&origin, &summary) * target.columns() as f32 <= NEAR * NUMBERS as f32;
        if near {
            self.asked.1 = origin;
        }
        Some(near)
    }

    /// Keeps the solution for the last target that was asked for, in place of the oldest if there is no room.
    pub fn keep(&mut self, solution: &[f64]) {
        let (summary, origin) = self.asked;
        if self.summaries.len() < HELD {
            self.summaries.push(summary);
            self.origins.push(origin);
            self.weights.extend_from_slice(solution);
        } else {
            self.summaries[self.oldest] = summary;
            self.origins[self.oldest] = origin;
            self.weights[self.oldest * solution.len()..][..solution.len()].copy_from_slice(solution);
            self.oldest = (self.oldest + 1) % HELD;
        }
    }
}

/// The first of the nearest.
#[inline(always)]
fn nearest(summary: &[f32; NUMBERS], others: &[[f32; NUMBERS]]) -> Option<usize> {
    let mut best = None;
    let mut least = f32::INFINITY;
    for (i, other) in others.iter().enumerate() {
        let distance = squared_distance(summary, other);
        if distance < least {
            (best, least) = (Some(i), distance);
        }
    }
    best
}

/// In a fixed order, so that the same start is chosen on any machine.
#[inline(always)]
fn squared_distance(a: &[f32; NUMBERS], b: &[f32; NUMBERS]) -> f32 {
    let mut sums = [0.0f32; LANES];
    for (a, b) in a.as_chunks::<LANES>().0.iter().zip(b.as_chunks::<LANES>().0) {
        for lane in 0..LANES {
            let difference = a[lane] - b[lane];
            sums[lane] += difference * difference;
        }
    }
    let [a, b, c, d, e, f, g, h] = sums;
    ((a + e) + (b + f)) + ((c + g) + (d + h))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::{Space, Table};

    /// The weights that come back are those of the target that was kept with the least distance, as all
    /// columns have it.
    #[test]
    fn the_most_similar_of_the_kept_targets_is_the_start() {
        let space = Space::half_angle(32);
        let row = |level: f64| -> Vec<f64> { (0..space.columns()).map(|_| level).collect() };
        let mut curves = Table::new(space.columns());
        curves.push(&row(0.01));
        curves.push(&row(0.3));
        let hull = Hull::new(&space, &curves, &[0.0; 2], 0.2).unwrap();
        let mut recent = WarmStarts::default();
        let mut start = [0.0; 2];
        let target = |level: f64| hull.target(&row(level)).unwrap();
        assert_eq!(recent.start(&hull, &target(0.1), &mut start), None);
        let levels = |i: usize| 0.02 + 0.25 * ((i * 97) % 300) as f64 / 300.0;
        for i in 0..300 {
            recent.start(&hull, &target(levels(i)), &mut start);
            recent.keep(&[levels(i), 1.0 - levels(i)]);
        }
        for i in 0..50 {
            let wanted = 0.02 + 0.005 * i as f64;
            assert!(recent.start(&hull, &target(wanted), &mut start).is_some());
            let kept = (300 - HELD..300).map(levels);
            let nearest = kept.min_by(|a, b| {
                let off = |level: f64| (level.cbrt() - wanted.cbrt()).abs();
                off(*a).total_cmp(&off(*b))
            });
            assert!((start[0] - nearest.unwrap()).abs() < 1e-3, "{wanted}: {start:?}");
        }
    }
}
