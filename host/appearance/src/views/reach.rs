//! How bright and dark a print can be in one view, whatever it is in the other.
//!
//! Problem: mixtures of stacks fill a convex polygon in the plane of (luminance straight on, luminance in
//! the reflection). Pictures that do not disturb each other need a rectangle in it: each of the four pairs
//! of dark and bright.
//! Method: the boundary below is convex and the one above concave, so a rectangle over an interval fits if
//! it fits at both ends. All intervals of a grid of [`STEPS`] lightnesses are tried, and the one is taken
//! in which the product of both contrasts is largest: neither picture gains a tenth where the other loses
//! more. Corners are mixtures of at most four stacks: two of the boundary below, two of the one above.
//! Cost: `STEPS^2 / 2` comparisons, a sort of the stacks. Limits: exact up to the step of the grid, 1 / 256
//! of the range in lightness; only neutral stacks are used, so that no picture is tinted by the other.

use crate::brdf::Space;
use crate::gamut::Printable;
use crate::srgb::luminance;
use maths::Maths;

use super::{REFLECTION, STRAIGHT, contrast};

/// Lightnesses of the grid.
const STEPS: usize = 256;

/// The largest difference of channels, in parts of the brightest, of a stack that counts as neutral; the
/// darkest ones always do.
const CHROMA: f64 = 0.3;

/// A stack is dark, and its hue does not matter, below this part of the brightest.
const DARK: f64 = 0.06;

/// A mixture: stacks by number, with their shares.
pub type Mixture = Vec<(usize, f64)>;

/// The limits, and mixtures that reach them.
#[derive(Clone, Debug, PartialEq)]
pub struct Reach {
    /// The luminance (1/sr) of dark and bright straight on.
    pub straight: [f64; 2],
    /// The same in the reflection.
    pub reflection: [f64; 2],
    /// The luminance of white straight on.
    pub white: f64,
    /// The contrast of both pictures.
    pub contrast: [f64; 2],
    /// The mixture of each corner: dark or bright straight on, then dark or bright in the reflection.
    pub corners: [[Mixture; 2]; 2],
}

impl Reach {
    /// What a choice is worth.
    fn worth([a, b]: [f64; 2]) -> f64 {
        a * b
    }

    /// The reflectance of a corner.
    pub(super) fn row(&self, printable: &Printable, straight: usize, reflection: usize) -> Vec<f64> {
        let mut row = vec![0.0; printable.curves.columns()];
        for &(stack, share) in &self.corners[straight][reflection] {
            row.iter_mut().zip(printable.curves.row(stack)).for_each(|(sum, f)| *sum += share * f);
        }
        row
    }
}

/// The luminance of a row in both views.
pub(super) fn seen(space: &Space, row: &[f64]) -> [f64; 2] {
    let curve = space.curve(row);
    [STRAIGHT, REFLECTION].map(|angle| luminance(curve.at(angle)))
}

/// Stacks that tint neither view; all if there are no two.
pub(super) fn neutral(printable: &Printable, space: &Space) -> Vec<usize> {
    let views: Vec<[[f64; 3]; 2]> = printable
        .curves
        .rows()
        .map(|row| {
            let curve = space.curve(row);
            [STRAIGHT, REFLECTION].map(|angle| curve.at(angle))
        })
        .collect();
    let most = |view: usize| views.iter().map(|v| luminance(v[view])).fold(0.0, f64::max);
    let white = [most(0), most(1)];
    let is_grey = |rgb: [f64; 3], white: f64| {
        let (low, high) = rgb.iter().fold((f64::MAX, 0.0f64), |(low, high), &v| (low.min(v), high.max(v)));
        high < DARK * white || high - low <= CHROMA * high
    };
    let grey: Vec<usize> =
        (0..views.len()).filter(|&k| (0..2).all(|view| is_grey(views[k][view], white[view]))).collect();
    if grey.len() < 2 { (0..views.len()).collect() } else { grey }
}

/// The limits of these stacks; `None` if there are no two of them.
#[must_use]
pub fn reach(printable: &Printable, space: &Space) -> Option<Reach> {
    let usable = neutral(printable, space);
    let points: Vec<(usize, [f64; 2])> =
        usable.into_iter().map(|k| (k, seen(space, printable.curves.row(k)))).collect();
    let (below, above) = (chain(&points, 1.0), chain(&points, -1.0));
    let (first, last) = (below.first()?.1[0], below.last()?.1[0]);
    if last <= first {
        return None;
    }
    let step = |i: usize| {
        let [low, high] = [first, last].map(|x: f64| x.max(0.0).cube_root());
        (low + (high - low) * i as f64 / (STEPS - 1) as f64).cubed().clamp(first, last)
    };
    let grid: Vec<[f64; 3]> =
        (0..STEPS).map(|i| [step(i), height(&below, step(i)), height(&above, step(i))]).collect();
    let mut best: Option<([f64; 2], usize, usize)> = None;
    for (i, dark) in grid.iter().enumerate() {
        for (j, bright) in grid.iter().enumerate().skip(i + 1) {
            let (low, high) = (dark[1].max(bright[1]), dark[2].min(bright[2]));
            if high <= low {
                continue;
            }
            let found = [contrast(dark[0], bright[0], last), contrast(low, high, high)];
            if best.is_none_or(|(known, ..)| Reach::worth(found) > Reach::worth(known)) {
                best = Some((found, i, j));
            }
        }
    }
    let (contrast, i, j) = best?;
    let straight = [grid[i][0], grid[j][0]];
    let reflection = [grid[i][1].max(grid[j][1]), grid[i][2].min(grid[j][2])];
    let corner = |x: f64, y: f64| {
        let (low, high) = (height(&below, x), height(&above, x));
        let share = if high > low { ((y - low) / (high - low)).clamp(0.0, 1.0) } else { 0.0 };
        let mut mixture = Mixture::new();
        for (chain, share) in [(&below, 1.0 - share), (&above, share)] {
            for (stack, part) in ends(chain, x) {
                match mixture.iter_mut().find(|(known, _)| *known == stack) {
                    Some((_, sum)) => *sum += share * part,
                    None if share * part > 0.0 => mixture.push((stack, share * part)),
                    None => {}
                }
            }
        }
        mixture
    };
    let corners = straight.map(|x| reflection.map(|y| corner(x, y)));
    Some(Reach { straight, reflection, white: last, contrast, corners })
}

/// The convex boundary below the points (`side` 1) or above them (-1), from left to right (Andrew's
/// monotone chain).
fn chain(points: &[(usize, [f64; 2])], side: f64) -> Vec<(usize, [f64; 2])> {
    let mut sorted = points.to_vec();
    sorted.sort_by(|(_, a), (_, b)| a[0].total_cmp(&b[0]).then((side * a[1]).total_cmp(&(side * b[1]))));
    sorted.dedup_by(|next, kept| next.1[0] == kept.1[0]);
    let mut chain: Vec<(usize, [f64; 2])> = Vec::new();
    for point in sorted {
        while let [.., (_, a), (_, b)] = chain[..] {
            let turn = (b[0] - a[0]) * (point.1[1] - a[1]) - (b[1] - a[1]) * (point.1[0] - a[0]);
            if side * turn > 0.0 {
                break;
            }
            chain.pop();
        }
        chain.push(point);
    }
    chain
}

/// The two points of a boundary around `x`, by number, with their parts.
fn ends(chain: &[(usize, [f64; 2])], x: f64) -> [(usize, f64); 2] {
    let right = chain.partition_point(|(_, p)| p[0] < x).clamp(1, (chain.len() - 1).max(1));
    let (a, b) = (chain[right - 1], chain[right.min(chain.len() - 1)]);
    let width = b.1[0] - a.1[0];
    let part = if width > 0.0 { ((x - a.1[0]) / width).clamp(0.0, 1.0) } else { 0.0 };
    [(a.0, 1.0 - part), (b.0, part)]
}

/// The height of a boundary at `x`.
fn height(chain: &[(usize, [f64; 2])], x: f64) -> f64 {
    let at = |stack: usize| chain.iter().find(|(known, _)| *known == stack).map_or(0.0, |(_, p)| p[1]);
    ends(chain, x).iter().map(|&(stack, part)| part * at(stack)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use inks::{InkSet, Library};

    fn printable(inks: &str) -> (Printable, Space) {
        let space = Space::half_angle(32);
        let set: InkSet = inks.parse().unwrap();
        (Printable::combined(&Library::builtin(), &set, &space), space)
    }

    /// Whether a point lies in a triangle.
    fn holds([a, b, c]: [[f64; 2]; 3], p: [f64; 2]) -> bool {
        let side = |a: [f64; 2], b: [f64; 2]| (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
        let sides = [side(a, b), side(b, c), side(c, a)];
        sides.iter().all(|s| *s >= 0.0) || sides.iter().all(|s| *s <= 0.0)
    }

    /// What is refused at the faintest contrast is refused at one a fifth lower or higher, whatever inks
    /// are at hand.
    #[test]
    fn inks_show_both_pictures_or_hardly_anything() {
        let mut shown = [0, 0];
        for inks in [
            "C",
            "K",
            "process",
            "process,white",
            "K,F",
            "C,F",
            "process,finish",
            "K,MS",
            "K,MS,F",
            "process,MS",
            "W,MS",
            "default",
            "all",
        ] {
            let (printable, space) = printable(inks);
            let contrast =
                reach(&printable, &space).map_or(0.0, |found| found.contrast[0].min(found.contrast[1]));
            println!("{inks}: {contrast:.3}");
            let [lower, higher] = [0.8, 1.2].map(|factor| contrast < factor * crate::views::FAINTEST);
            assert_eq!(lower, higher, "{inks}: {contrast}");
            shown[usize::from(lower)] += 1;
        }
        assert!(shown.iter().all(|&sets| sets >= 2), "{shown:?}");
    }

    #[test]
    fn no_other_choice_of_stacks_shows_both_pictures_better() {
        for inks in ["process,finish", "K,MS,SF,F,W", "all"] {
            let (printable, space) = printable(inks);
            let found = reach(&printable, &space).unwrap();
            // By brute force: a corner can be printed if any three stacks hold it.
            let mut points: Vec<[f64; 2]> =
                neutral(&printable, &space).iter().map(|&k| seen(&space, printable.curves.row(k))).collect();
            // Of very many stacks those count that are extreme in one of some directions.
            if points.len() > 24 {
                let all = points.clone();
                let extreme = (0..48).map(|k| {
                    let (sin, cos) = (std::f64::consts::TAU * f64::from(k) / 48.0).sin_cos();
                    let along = |p: &[f64; 2]| cos * p[0].cbrt() + sin * p[1].cbrt();
                    all.iter().copied().max_by(|a, b| along(a).total_cmp(&along(b))).unwrap()
                });
                points = extreme.collect();
                points.sort_by(|a, b| a.partial_cmp(b).unwrap());
                points.dedup();
            }
            let can = |p: [f64; 2]| {
                let n = points.len();
                (0..n).any(|i| {
                    (i + 1..n).any(|j| (j + 1..n).any(|k| holds([points[i], points[j], points[k]], p)))
                })
            };
            let range = |axis: usize| {
                let values = points.iter().map(|p| p[axis]);
                values.fold((f64::MAX, 0.0f64), |(low, high), v| (low.min(v), high.max(v)))
            };
            const N: i32 = 14;
            let at = |axis: usize, i: i32| {
                let (low, high) = range(axis);
                (low.cbrt() + (high.cbrt() - low.cbrt()) * f64::from(i) / f64::from(N)).powi(3)
            };
            let inside: Vec<Vec<bool>> =
                (0..=N).map(|i| (0..=N).map(|j| can([at(0, i), at(1, j)])).collect()).collect();
            let mut best = 0.0f64;
            for (i, k) in (0..=N as usize).flat_map(|i| (i + 1..=N as usize).map(move |k| (i, k))) {
                for (j, l) in (0..=N as usize).flat_map(|j| (j + 1..=N as usize).map(move |l| (j, l))) {
                    if [[i, j], [i, l], [k, j], [k, l]].iter().all(|&[x, y]| inside[x][y]) {
                        let y = [at(1, j as i32), at(1, l as i32)];
                        let a = contrast(at(0, i as i32), at(0, k as i32), range(0).1);
                        best = best.max(Reach::worth([a, contrast(y[0], y[1], y[1])]));
                    }
                }
            }
            let worth = Reach::worth(found.contrast);
            assert!(best > 0.0 && worth >= best - 1e-4, "{inks}: {found:?}, by force {best}");
            // And near it: a grid of fourteen steps loses at most one or two at each of four borders.
            assert!(worth <= best + 0.2, "{inks}: {found:?}, by force {best}");
        }
    }

    #[test]
    fn corners_are_mixtures_that_look_as_they_are_said_to() {
        for inks in ["default", "all", "process"] {
            let (printable, space) = printable(inks);
            let found = reach(&printable, &space).unwrap();
            for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                let total: f64 = found.corners[i][j].iter().map(|c| c.1).sum();
                assert!((total - 1.0).abs() < 1e-9 && found.corners[i][j].iter().all(|c| c.1 > 0.0));
                let [straight, reflection] = seen(&space, &found.row(&printable, i, j));
                // Between the samples curves of mixtures are not quite mixtures of curves.
                assert!(
                    (straight - found.straight[i]).abs() < 2e-3 * found.white,
                    "{inks} {i}{j}: {straight}"
                );
                assert!(
                    (reflection - found.reflection[j]).abs() < 1e-6 * found.reflection[1],
                    "{inks} {i}{j}"
                );
            }
        }
    }
}
