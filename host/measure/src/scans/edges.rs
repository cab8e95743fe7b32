//! How much of a window dots cover when their edges lie further out, or further in, than printed.
//!
//! Problem: ink spreads beyond its dots, and what that does to a tone depends on how long their edges are. Method: the distance of
//! every place to the nearest edge, negative within the dots; ink that reaches `g` beyond its dots covers the
//! places whose distance is at most `g` (a dilation by a disc, an erosion where `g` is negative). A histogram of
//! distances answers for all `g` at once. Cost: 25 places a dot near edges, one elsewhere. Limits: two dots in either direction (85 um).

use sheet::DotMap;

use super::scan::TonePatch;

/// Dots in either direction, 85 um: more than thrice the largest dot gain of decisions/dots-from-scans.md,
/// which the search must bracket.
pub(crate) const FAR: f64 = 2.0;
/// Places along a side of a dot.
const FINE: usize = 5;
/// Steps of the distance, and how many stand for the side of a place.
const STEPS: usize = 50;
const BLUR: usize = STEPS / FINE;
const BINS: usize = 2 * FAR as usize * STEPS;
/// Neighbours on each side that are looked at.
const NEAR: i64 = FAR as i64;

/// The distances in a window.
pub(crate) struct Edges {
    /// The share whose distance is below -FAR + i / STEPS.
    below: Vec<f64>,
    /// The share of the dots themselves.
    pub(crate) printed: f64,
}

/// Neighbours of a place within its dot, nearest first: steps to them and their distance in dots.
type Neighbours = Vec<(i64, i64, f64)>;

fn neighbours(u: f64, v: f64) -> Neighbours {
    let gap = |step: i64, at: f64| match step {
        0 => 0.0,
        step if step > 0 => step as f64 - at,
        step => at - (step + 1) as f64,
    };
    let mut all: Neighbours = (-NEAR..=NEAR)
        .flat_map(|dy| (-NEAR..=NEAR).map(move |dx| (dx, dy, gap(dx, u).hypot(gap(dy, v)))))
        .collect();
    all.sort_by(|a, b| a.2.total_cmp(&b.2));
    all
}

impl Edges {
    /// Measures a window of the sheet. `inked` says of each number of a stack whether it is ink.
    pub(crate) fn measure(sheet: &DotMap, inked: &[bool], window: &TonePatch) -> Edges {
        let (width, length) = (sheet.width() as i64, sheet.length() as i64);
        // Beyond the sheet everything goes on as at its edge.
        let ink = |x: i64, y: i64| {
            let (x, y) = (x.clamp(0, width - 1), y.clamp(0, length - 1));
            inked[usize::from(sheet.index()[(y * width + x) as usize])]
        };
        let places: Vec<(f64, f64, Neighbours)> = (0..FINE * FINE)
            .map(|i| {
                let at = |k: usize| (k as f64 + 0.5) / FINE as f64;
                let (u, v) = (at(i % FINE), at(i / FINE));
                (u, v, neighbours(u, v))
            })
            .collect();
        // By distance -FAR + i / STEPS; and what is deep within the dots.
        let mut counted = vec![0.0; BINS + 1];
        let (mut always, mut printed, mut all) = (0.0, 0.0, 0.0);
        let area = window.area;
        for y in area.top as i64..(area.top + area.length) as i64 {
            for x in area.left as i64..(area.left + area.width) as i64 {
                let own = ink(x, y);
                let mixed = (-NEAR..=NEAR).any(|dy| (-NEAR..=NEAR).any(|dx| ink(x + dx, y + dy) != own));
                if !mixed {
                    let weight = window.weight([x as f64 + 0.5, y as f64 + 0.5]);
                    always += if own { weight } else { 0.0 };
                    printed += if own { weight } else { 0.0 };
                    all += weight;
                    continue;
                }
                for (u, v, neighbours) in &places {
                    let weight = window.weight([x as f64 + u, y as f64 + v]) / (FINE * FINE) as f64;
                    let nearest = neighbours.iter().find(|(dx, dy, _)| ink(x + dx, y + dy) != own);
                    match nearest {
                        Some((_, _, distance)) => {
                            let distance = if own { -distance } else { *distance };
                            let at = ((distance + FAR) * STEPS as f64).round();
                            counted[at.clamp(0.0, BINS as f64) as usize] += weight;
                        }
                        None => always += if own { weight } else { 0.0 },
                    }
                    printed += if own { weight } else { 0.0 };
                    all += weight;
                }
            }
        }
        // A place stands for all distances within its own side, so straight edges move evenly.
        let mut spread = vec![0.0; BINS];
        for (i, &weight) in counted.iter().enumerate() {
            for k in 0..BLUR {
                spread[(i + k).saturating_sub(BLUR / 2).min(BINS - 1)] += weight / BLUR as f64;
            }
        }
        let all: f64 = if all > 0.0 { all } else { 1.0 };
        let mut below = vec![always / all];
        let mut sum = always;
        for weight in spread {
            sum += weight;
            below.push(sum / all);
        }
        Edges { below, printed: printed / all }
    }

    /// The share that is covered by ink that reaches this many dots beyond its own.
    pub(crate) fn covered(&self, reach: f64) -> f64 {
        let at = ((reach + FAR) * STEPS as f64).clamp(0.0, BINS as f64 - 1e-9);
        let (i, t) = (at as usize, at.fract());
        self.below[i] * (1.0 - t) + self.below[i + 1] * t
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use inks::Stack;
    use protocol::ink::Ink;
    use sheet::Area;

    /// Squares of `side` dots every `pitch`.
    fn squares(side: usize, pitch: usize) -> DotMap {
        let size = 12 * pitch;
        let inside = |i: usize| i % pitch >= 1 && i % pitch < 1 + side;
        let index = (0..size * size).map(|i| u8::from(inside(i % size) && inside(i / size))).collect();
        DotMap::new(size, size, vec![Stack::SUBSTRATE, Stack::new([Ink::Black])], index).unwrap()
    }

    /// Squares with round corners have an area that everybody knows.
    #[test]
    fn squares_grow_and_shrink_as_geometry_says() {
        for (side, pitch) in [(1usize, 8usize), (3, 10), (4, 12)] {
            let dots = squares(side, pitch);
            let size = 10 * pitch;
            let window =
                TonePatch { area: Area { left: pitch, top: pitch, width: size, length: size }, soft: 1e-9 };
            let edges = Edges::measure(&dots, &[false, true], &window);
            let (a, all) = (side as f64, (pitch * pitch) as f64);
            assert!((edges.printed - a * a / all).abs() < 1e-9);
            for reach in [-0.4, -0.2, 0.0, 0.1, 0.37, 0.8, 1.3, 1.9] {
                let want = if reach > 0.0 {
                    a * a + 4.0 * a * reach + std::f64::consts::PI * reach * reach
                } else {
                    (a + 2.0 * reach).powi(2)
                } / all;
                let found = edges.covered(reach);
                assert!((found - want).abs() < 0.01 * want + 1e-4, "{side}: {reach}: {found} {want}");
            }
        }
    }
}
