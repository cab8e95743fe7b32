//! How two photographs of a series compare: the shift between them, and the ratio of their exposures.
//!
//! Problem: a hand on the camera shifts it, and shutters are off by some per cent. Method: after the right shift the logarithms of both
//! differ by a constant, where neither is full. To both lights the same little is added, so that what is dark in both agrees and the
//! edges of bright things count. A search over whole pixels of a small copy is followed by Lucas and Kanade's least squares (1981)
//! with the constant as a third unknown. Cost: some million comparisons a pair. Limits: shifts only; a camera that was turned does
//! not match.

use super::probe::{CLIPPED, Noise, Probe};
use super::response::Response;
use crate::linalg::{Cholesky, spread};

/// How far shifts are searched, in picture widths.
const SEARCH: f64 = 0.06;
/// Pixels across the copy that is searched.
const COARSE: usize = 160;
/// Tones are used from so many standard deviations of their noise.
const CERTAIN: f32 = 12.0;
/// A difference of logarithms that noise and edges do not explain.
const STRANGE: f64 = 0.15;
/// What is added to light, in parts of the tone from which the ratio of exposures is taken.
const CLEAR: f64 = 6.0;
/// Weight of standing still, in squared differences per squared pixel: without edges a shift cannot be seen.
const STILL: f64 = 0.1;
/// What is added to light for a second opinion, in parts of what is added for the first.
const MORE: f32 = 4.0;
/// Steps of the method, so that one that does not settle ends.
const ROUNDS: usize = 12;
/// Parts of a picture along a side that are left out one by one.
const PARTS: usize = 6;
/// A difference of logarithms between neighbours in an even place.
const EVEN: f64 = 0.15;
/// Places that tell a white balance.
const BALANCED: usize = 150;

/// The light of each block of a small copy.
pub(crate) struct Tones {
    width: usize,
    height: usize,
    factor: usize,
    /// Not a number where it is full.
    light: Vec<f32>,
    /// The least that it is.
    least: Vec<f32>,
    /// Light that noise does not hide.
    floor: f32,
    /// The light of each channel, not a number where one is full, and what noise does not hide of it.
    channels: Vec<[f32; 3]>,
    floors: [f32; 3],
}

/// How a photograph compares with another.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Match {
    /// What is at x in the first is at x + shift in the second, in pixels of the photographs.
    pub(crate) shift: [f64; 2],
    /// Standard error of the shift.
    pub(crate) shift_error: [f64; 2],
    /// Logarithms of red and of blue over green in the second, against those in the first.
    pub(crate) balance: [f64; 2],
    /// Standard errors of the two.
    pub(crate) balance_error: [f64; 2],
    /// Logarithm of the light of the second over the first.
    pub(crate) ratio: f64,
    /// Standard error of the ratio.
    pub(crate) error: f64,
    /// How much the ratio differs between dark and bright tones.
    pub(crate) bend: f64,
    /// The part of the compared blocks that do not agree.
    pub(crate) strange: f64,
    /// Blocks that could be compared.
    pub(crate) compared: usize,
}

impl Tones {
    pub(crate) fn new(
        probe: &Probe,
        response: &Response,
        noise: Noise,
        white: [f32; 3],
        exposure: f64,
    ) -> Tones {
        let blocks = (probe.factor * probe.factor) as f32;
        let time = exposure as f32;
        let least: Vec<f32> = probe
            .mean
            .iter()
            .map(|mean| (0..3).map(|c| response.linear(c, mean[c])).sum::<f32>().max(0.0) / time)
            .collect();
        let full = |most: &[f32; 3]| (0..3).any(|c| most[c] >= CLIPPED * white[c]);
        let light =
            least.iter().zip(&probe.most).map(|(l, most)| if full(most) { f32::NAN } else { *l }).collect();
        // Where the noise of three channels is a twelfth of the value, for values with shot and read noise.
        let (gain, read) = (noise.gain, 3.0 * noise.read);
        let certain = CERTAIN * CERTAIN / blocks;
        let value = 0.5 * (certain * gain + (certain * gain * certain * gain + 4.0 * certain * read).sqrt());
        let value = value.max(0.004 * white[1].min(65_535.0));
        // Eight bits are rounded coarsely where a curve is steep: what is black has other levels in every exposure.
        let floors =
            std::array::from_fn(|c| response.linear(c, value / 3.0).max(response.least(c, CERTAIN)) / time);
        let channels = probe
            .mean
            .iter()
            .zip(&probe.most)
            .map(|(mean, most)| {
                std::array::from_fn(
                    |c| if full(most) { f32::NAN } else { response.linear(c, mean[c]) / time },
                )
            })
            .collect();
        Tones {
            width: probe.width,
            height: probe.height,
            factor: probe.factor,
            light,
            least,
            floor: floors.iter().sum(),
            channels,
            floors,
        }
    }

    fn halved(&self) -> Tones {
        let (width, height) = (self.width / 2, self.height / 2);
        let pooled = |values: &[f32]| -> Vec<f32> {
            (0..width * height)
                .map(|i| {
                    let at = 2 * (i / width) * self.width + 2 * (i % width);
                    (values[at] + values[at + 1] + values[at + self.width] + values[at + self.width + 1])
                        / 4.0
                })
                .collect()
        };
        let (light, least) = (pooled(&self.light), pooled(&self.least));
        let (factor, floor, floors) = (2 * self.factor, self.floor, self.floors);
        Tones { width, height, factor, light, least, floor, channels: Vec::new(), floors }
    }

    /// The logarithm of light with a little added, softened so that edges are wider than a step of the method.
    fn logs(&self, little: f32) -> Logs {
        let logs = |ln: Vec<f32>| Logs { width: self.width, height: self.height, ln };
        let sharp = logs(self.light.iter().map(|l| (l + little).ln()).collect());
        let soft = |i: usize| {
            let (x, y) = ((i % self.width) as i64, (i / self.width) as i64);
            let row = |y: i64| (sharp.at(x - 1, y) + 2.0 * sharp.at(x, y) + sharp.at(x + 1, y)) / 4.0;
            ((row(y - 1) + 2.0 * row(y) + row(y + 1)) / 4.0) as f32
        };
        logs((0..self.light.len()).map(soft).collect())
    }

    /// Compares this photograph with another one of the same size.
    pub(crate) fn compare(&self, other: &Tones) -> Match {
        let little = self.floor.max(other.floor);
        let (a, b) = (self.logs(little), other.logs(little));
        let mut copies = (self.halved(), other.halved());
        while copies.0.width > COARSE {
            copies = (copies.0.halved(), copies.1.halved());
        }
        let scale = copies.0.factor as f64 / self.factor as f64;
        let mut shift = search(&copies.0.logs(little), &copies.1.logs(little)).map(|d| d * scale);
        let mut ratio = 0.0;
        a.converge(&b, &mut shift, &mut ratio, 0);
        let error = a.shift_error(&b, shift, ratio);
        // Sensors cut noise off at zero, which moves the edges of what is dark; how far depends on what is added to it.
        let (mut other_shift, mut other_ratio) = (shift, ratio);
        self.logs(MORE * little).converge(&other.logs(MORE * little), &mut other_shift, &mut other_ratio, 3);
        let error: [f64; 2] = std::array::from_fn(|axis| error[axis].hypot(other_shift[axis] - shift[axis]));
        let [mut red, mut blue] = self.balance(other, &a, shift);
        // Colours are known no better than the place.
        for axis in 0..2 {
            let mut beside = shift;
            beside[axis] += error[axis];
            let [other_red, other_blue] = self.balance(other, &a, beside);
            red.1 = red.1.hypot(other_red.0 - red.0);
            blue.1 = blue.1.hypot(other_blue.0 - blue.0);
        }
        Match {
            shift_error: error.map(|error| self.factor as f64 * error),
            balance: [red.0, blue.0],
            balance_error: [red.1, blue.1],
            ..self.judge(other, (&a, &b), little, shift)
        }
    }

    /// The light of each channel between pixels; not a number outside, and beside what is full.
    fn between(&self, x: f64, y: f64) -> [f64; 3] {
        let at = |c: usize, x: i64, y: i64| {
            inside(x, y, self.width, self.height).map_or(f64::NAN, |i| f64::from(self.channels[i][c]))
        };
        std::array::from_fn(|c| around(x, y).map(|(x, y, part)| part * at(c, x, y)).sum())
    }

    /// How red and blue over green differ in even places that noise does not hide; 0 where there are too few.
    fn balance(&self, other: &Tones, logs: &Logs, shift: [f64; 2]) -> [(f64, f64); 2] {
        let mut found: [Vec<f64>; 3] = Default::default();
        for y in 1..self.height as i64 - 1 {
            for x in 1..self.width as i64 - 1 {
                let i = y as usize * self.width + x as usize;
                let here = logs.at(x, y);
                let even = [(1, 0), (-1, 0), (0, 1), (0, -1)]
                    .iter()
                    .all(|(k, l)| (logs.at(x + k, y + l) - here).abs() < EVEN);
                if !even {
                    continue;
                }
                // The very place: from pixel to pixel an even place may still change by more than a white balance does.
                let there = other.between(x as f64 + shift[0], y as f64 + shift[1]);
                // The longer exposure's neighbours choose: a place's own noise would choose what is too bright in it.
                let ln = |c: usize| {
                    let near = [i - 1, i + 1, i - self.width, i + self.width];
                    let level = near.iter().map(|&i| self.channels[i][c]).sum::<f32>() / 4.0;
                    let (a, b) = (f64::from(self.channels[i][c]), there[c]);
                    let clear = (CLEAR as f32) * self.floors[c].max(other.floors[c]);
                    (level > clear && a > 0.0 && b > 0.0).then(|| (b / a).ln())
                };
                found.iter_mut().enumerate().for_each(|(c, found)| found.extend(ln(c)));
            }
        }
        // Of each channel the median, which the logarithm of noise does not move; its standard error is 1.25 times the mean's.
        let [red, green, blue] = found.map(|found| {
            let (middle, width) = spread(&found);
            (found.len() >= BALANCED).then(|| (middle, 1.25 * width / (found.len() as f64).sqrt()))
        });
        let over = |colour: Option<(f64, f64)>| {
            colour.zip(green).map_or((0.0, 0.0), |(a, b)| (a.0 - b.0, a.1.hypot(b.1)))
        };
        [over(red), over(blue)]
    }

    /// What is left of the differences after the shift.
    fn judge(&self, other: &Tones, (a, b): (&Logs, &Logs), little: f32, shift: [f64; 2]) -> Match {
        // Light, difference, slope.
        let mut all: Vec<(f64, f64, f64)> = Vec::new();
        let (mut bounded, mut broken) = (0, 0);
        for y in 1..self.height as i64 - 1 {
            for x in 1..self.width as i64 - 1 {
                let (u, v) = (x as f64 + shift[0], y as f64 + shift[1]);
                let (here, there) = (a.at(x, y), b.between(u, v));
                let near = [(1, 0), (-1, 0), (0, 1), (0, -1)];
                let slope = |logs: &Logs, x: i64, y: i64| {
                    near.iter()
                        .map(|(i, j)| (logs.at(x + i, y + j) - logs.at(x, y)).abs())
                        .fold(0.0, f64::max)
                };
                if here.is_finite() && there.is_finite() {
                    all.push((here, there - here, slope(a, x, y)));
                    continue;
                }
                // One of them is full, which gives the other a least value.
                let (i, j) = (u.round(), v.round());
                let inside =
                    i >= 1.0 && j >= 1.0 && i < self.width as f64 - 1.0 && j < self.height as f64 - 1.0;
                if !inside || (here.is_nan() && there.is_nan()) {
                    continue;
                }
                let bound = |tones: &Tones, x: usize, y: usize| {
                    f64::from((tones.least[y * tones.width + x] + little).ln())
                };
                let (value, least, slope) = if there.is_nan() {
                    (here, bound(other, i as usize, j as usize), slope(a, x, y))
                } else {
                    (there, bound(self, x as usize, y as usize), slope(b, i as i64, j as i64))
                };
                bounded += 1;
                broken += usize::from(slope.is_finite() && value < least - 2.0 * (STRANGE + slope));
            }
        }
        let clear = f64::from(((CLEAR as f32 + 1.0) * little).ln());
        // Without the little: both are far above it.
        let plain = |l: f64| (l.exp() - f64::from(little)).max(1e-30).ln();
        let smooth: Vec<(f64, f64)> = all
            .iter()
            .filter(|d| d.2 < EVEN && d.0 > clear && d.0 + d.1 > clear)
            .map(|d| (d.0, plain(d.0 + d.1) - plain(d.0)))
            .collect();
        let differences: Vec<f64> = smooth.iter().map(|d| d.1).collect();
        let (middle, width) = spread(&differences);
        let mut near: Vec<(f64, f64)> =
            smooth.into_iter().filter(|d| (d.1 - middle).abs() < 3.0 * width.max(1e-6)).collect();
        let mean = |part: &[(f64, f64)]| part.iter().map(|d| d.1).sum::<f64>() / part.len().max(1) as f64;
        let ratio = if near.is_empty() { middle } else { mean(&near) };
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        let third = near.len() / 3;
        let bend = if third > 50 { mean(&near[near.len() - third..]) - mean(&near[..third]) } else { 0.0 };
        // What is dark in both says nothing.
        let told: Vec<&(f64, f64, f64)> =
            all.iter().filter(|d| d.0.max(d.0 + d.1) > f64::from((2.0 * little).ln())).collect();
        let doubt = STRANGE + 4.0 * width.min(0.1);
        let strange = told.iter().filter(|d| (d.1 - ratio).abs() > doubt + d.2).count() + broken;
        Match {
            shift: shift.map(|d| d * self.factor as f64),
            shift_error: [0.0; 2],
            balance: [0.0; 2],
            balance_error: [0.0; 2],
            ratio,
            error: width / (near.len().max(1) as f64).sqrt(),
            bend,
            strange: strange as f64 / (told.len() + bounded).max(1) as f64,
            compared: near.len(),
        }
    }
}

/// A pixel's number.
fn inside(x: i64, y: i64, width: usize, height: usize) -> Option<usize> {
    ((0..width as i64).contains(&x) && (0..height as i64).contains(&y))
        .then(|| y as usize * width + x as usize)
}

/// The pixels around a place, each with its part in what is read there. One that has none may be missing.
fn around(x: f64, y: f64) -> impl Iterator<Item = (i64, i64, f64)> {
    let (left, top) = (x.floor(), y.floor());
    let (u, v) = (x - left, y - top);
    [(0, 0, (1.0 - u) * (1.0 - v)), (1, 0, u * (1.0 - v)), (0, 1, (1.0 - u) * v), (1, 1, u * v)]
        .into_iter()
        .filter(|(.., part)| *part > 1e-6)
        .map(move |(i, j, part)| (left as i64 + i, top as i64 + j, part))
}

/// A small copy of logarithms.
struct Logs {
    width: usize,
    height: usize,
    ln: Vec<f32>,
}

impl Logs {
    fn at(&self, x: i64, y: i64) -> f64 {
        inside(x, y, self.width, self.height).map_or(f64::NAN, |i| f64::from(self.ln[i]))
    }

    fn between(&self, x: f64, y: f64) -> f64 {
        around(x, y).map(|(x, y, part)| part * self.at(x, y)).sum()
    }

    /// Steps until the shift stands.
    fn converge(&self, other: &Logs, shift: &mut [f64; 2], ratio: &mut f64, from: usize) {
        for round in from..ROUNDS {
            let step = self.step(other, *shift, *ratio, round);
            *shift = [shift[0] + step[0], shift[1] + step[1]];
            *ratio += step[2];
            if step[0].abs() + step[1].abs() < 1e-4 {
                break;
            }
        }
    }

    /// One step of Gauss and Newton: changes of shift and ratio that explain the differences best.
    fn step(&self, other: &Logs, shift: [f64; 2], ratio: f64, round: usize) -> [f64; 3] {
        let all = self
            .sums(other, shift, ratio, round)
            .iter()
            .fold(Sum::still(shift), |all, part| all.plus(part, 1.0));
        let [x, y, ratio] = all.solved().unwrap_or_default();
        [x.clamp(-2.0, 2.0), y.clamp(-2.0, 2.0), ratio]
    }

    /// The standard error of a shift by the jackknife: parts of the picture are left out one by one. It holds what edges of
    /// clipped places and noise do, of which least squares know nothing.
    fn shift_error(&self, other: &Logs, shift: [f64; 2], ratio: f64) -> [f64; 2] {
        let parts = self.sums(other, shift, ratio, usize::MAX);
        let all = parts.iter().fold(Sum::still(shift), |all, part| all.plus(part, 1.0));
        let without: Vec<[f64; 3]> = parts
            .iter()
            .filter(|part| part.normal[8] > 0.0)
            .filter_map(|part| all.plus(part, -1.0).solved())
            .collect();
        let n = without.len().max(1) as f64;
        std::array::from_fn(|axis| {
            let mean = without.iter().map(|d| d[axis]).sum::<f64>() / n;
            (without.iter().map(|d| (d[axis] - mean).powi(2)).sum::<f64>() * (n - 1.0) / n).sqrt()
        })
    }

    /// The normal equations of each part of the picture.
    fn sums(&self, other: &Logs, shift: [f64; 2], ratio: f64, round: usize) -> Vec<Sum> {
        let mut parts = vec![Sum::default(); PARTS * PARTS];
        let limit = if round < 3 { 1.5 } else { 0.5 };
        for y in 1..self.height as i64 - 1 {
            for x in 1..self.width as i64 - 1 {
                let found = other.between(x as f64 + shift[0], y as f64 + shift[1]);
                let difference = found - self.at(x, y) - ratio;
                let g = [
                    (self.at(x + 1, y) - self.at(x - 1, y)) / 2.0,
                    (self.at(x, y + 1) - self.at(x, y - 1)) / 2.0,
                    -1.0,
                ];
                if !(difference.is_finite() && g[0].is_finite() && g[1].is_finite())
                    || difference.abs() > limit + 2.0 * g[0].abs().max(g[1].abs())
                {
                    continue;
                }
                let (column, row) = (x as usize * PARTS / self.width, y as usize * PARTS / self.height);
                let part = &mut parts[row * PARTS + column];
                for i in 0..3 {
                    for j in 0..3 {
                        part.normal[3 * i + j] += g[i] * g[j];
                    }
                    part.right[i] -= g[i] * difference;
                }
            }
        }
        parts
    }
}

/// Normal equations of a shift and a ratio.
#[derive(Clone, Copy, Default)]
struct Sum {
    normal: [f64; 9],
    right: [f64; 3],
}

impl Sum {
    /// A camera stands still where nothing says otherwise.
    fn still(shift: [f64; 2]) -> Sum {
        let normal = [STILL, 0.0, 0.0, 0.0, STILL, 0.0, 0.0, 0.0, 0.0];
        Sum { normal, right: [-STILL * shift[0], -STILL * shift[1], 0.0] }
    }

    fn plus(mut self, other: &Sum, factor: f64) -> Sum {
        self.normal.iter_mut().zip(other.normal).for_each(|(a, b)| *a += factor * b);
        self.right.iter_mut().zip(other.right).for_each(|(a, b)| *a += factor * b);
        self
    }

    fn solved(&self) -> Option<[f64; 3]> {
        let x = Cholesky::new(&self.normal, 3)?.solve(&self.right);
        Some([x[0], x[1], x[2]])
    }
}

/// The shift in whole pixels with the smallest differences.
fn search(a: &Logs, b: &Logs) -> [f64; 2] {
    let reach = (SEARCH * a.width as f64).ceil() as i64;
    let mut tried: Vec<(usize, f64, [f64; 2])> = Vec::new();
    for dy in -reach..=reach {
        for dx in -reach..=reach {
            let (mut n, mut squares) = (0usize, 0.0f64);
            for y in 0..a.height as i64 {
                for x in 0..a.width as i64 {
                    let d = b.at(x + dx, y + dy) - a.at(x, y);
                    if d.is_finite() {
                        n += 1;
                        squares += d.clamp(-1.0, 1.0).powi(2);
                    }
                }
            }
            // Among equals the smallest shift.
            let far = 1e-6 * (dx * dx + dy * dy) as f64;
            tried.push((n, squares / n.max(1) as f64 + far, [dx as f64, dy as f64]));
        }
    }
    let most = tried.iter().map(|t| t.0).max().unwrap_or(0);
    let enough = tried.iter().filter(|t| 2 * t.0 > most && t.0 > 20);
    enough.min_by(|a, b| a.1.total_cmp(&b.1)).map_or([0.0; 2], |t| t.2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::photo::Photo;
    use readers::Samples;

    /// Soft discs on a ground, moved by a shift, at an exposure.
    fn scene(shift: [f64; 2], exposure: f64, other: f64) -> Tones {
        let (width, height) = (320, 240);
        let values = (0..width * height)
            .flat_map(|i| {
                let (x, y) = ((i % width) as f64 - shift[0], (i / width) as f64 - shift[1]);
                let disc =
                    |cx: f64, cy: f64, r: f64| 1.0 / (1.0 + (((x - cx).hypot(y - cy) - r) / 1.5).exp());
                let light = 0.05
                    + 0.3 * disc(90.0, 100.0, 40.0)
                    + 0.2 * disc(220.0, 140.0, 30.0 * other)
                    + 0.0004 * x;
                [(light * exposure * 60_000.0).clamp(0.0, 65_535.0) as u16; 3]
            })
            .collect();
        let photo = Photo { width, height, values: Samples::Sixteen(values) };
        let probe = Probe::new(&photo, &photo);
        Tones::new(&probe, &Response::Linear, Noise { gain: 1.0, read: 4.0 }, [65_535.0; 3], exposure)
    }

    #[test]
    fn a_shift_and_a_ratio_are_found_between_pixels() {
        let first = scene([0.0, 0.0], 1.0, 1.0);
        for shift in [[0.0, 0.0], [0.5, -0.3], [3.3, 2.6], [-12.4, 7.0]] {
            let found = first.compare(&scene(shift, 0.5 * 1.03, 1.0));
            assert!(
                (found.shift[0] - shift[0]).abs() < 0.05 && (found.shift[1] - shift[1]).abs() < 0.05,
                "{found:?}"
            );
            assert!(
                found.ratio.abs() < 0.002 && found.strange < 0.01 && found.compared > 10_000,
                "{found:?}"
            );
        }
    }

    #[test]
    fn another_scene_is_strange() {
        let found = scene([0.0, 0.0], 1.0, 1.0).compare(&scene([0.0, 0.0], 0.5, 2.0));
        assert!(found.strange > 0.05, "{found:?}");
    }
}
