//! Dark regions of a picture that may be squares seen askew, each as four corners.
//!
//! Problem: light is uneven, so that nothing says how dark is dark. Method: a pixel is dark against the mean of its surroundings, from a table of
//! sums; the convex hull of a connected region is reduced to the quadrilateral that is nearly as large. Cost: one pass over the picture for the
//! sums and one for each window. Limits: regions that touch the picture's edge are left out.

use rayon::prelude::*;

use crate::geometry::grey::Grey;

/// Darker than this part of the mean is dark.
const DARK: f32 = 0.75;
/// The smallest side of a mark in pixels: eight cells with its frame, so that each has three and a half to be
/// read from.
const SMALLEST: f64 = 28.0;

/// Sums over rectangles in four additions (Crow 1984).
pub(super) struct Sums {
    stride: usize,
    sums: Vec<f64>,
}

impl Sums {
    pub(super) fn new(picture: &Grey) -> Sums {
        let stride = picture.width + 1;
        let mut sums = vec![0.0; stride * (picture.height + 1)];
        for (y, row) in picture.values.chunks_exact(picture.width).enumerate() {
            let mut line = 0.0;
            for (x, &value) in row.iter().enumerate() {
                line += f64::from(value);
                sums[(y + 1) * stride + x + 1] = sums[y * stride + x + 1] + line;
            }
        }
        Sums { stride, sums }
    }

    /// Which pixels are darker than their surroundings within `reach` pixels.
    pub(super) fn dark(&self, picture: &Grey, reach: usize) -> Vec<bool> {
        let (width, height) = (picture.width, picture.height);
        let mut dark = vec![false; width * height];
        dark.par_chunks_exact_mut(width).enumerate().for_each(|(y, row)| {
            let (top, bottom) = (y.saturating_sub(reach), (y + reach + 1).min(height));
            for (x, dark) in row.iter_mut().enumerate() {
                let (left, right) = (x.saturating_sub(reach), (x + reach + 1).min(width));
                let sum = self.sums[bottom * self.stride + right] + self.sums[top * self.stride + left]
                    - self.sums[bottom * self.stride + left]
                    - self.sums[top * self.stride + right];
                let mean = sum / ((right - left) * (bottom - top)) as f64;
                *dark = picture.values[y * width + x] < DARK * mean as f32;
            }
        });
        dark
    }
}

/// The convex hull of each dark region that may be a mark, in order round it.
pub(super) fn regions(dark: &[bool], width: usize, height: usize) -> Vec<Vec<[f64; 2]>> {
    let mut seen = vec![false; dark.len()];
    let mut open = Vec::new();
    let mut hulls = Vec::new();
    let mut spans: Vec<(usize, usize)> = Vec::new();
    for start in 0..dark.len() {
        if !dark[start] || seen[start] {
            continue;
        }
        let first = start / width;
        spans.clear();
        seen[start] = true;
        open.push(start);
        let mut count = 0;
        while let Some(i) = open.pop() {
            let (x, y) = (i % width, i / width);
            count += 1;
            // The first pixel met is of the topmost row.
            let row = y - first;
            if row >= spans.len() {
                spans.resize(row + 1, (usize::MAX, 0));
            }
            spans[row] = (spans[row].0.min(x), spans[row].1.max(x));
            let near = [
                (x > 0).then(|| i - 1),
                (x + 1 < width).then_some(i + 1),
                i.checked_sub(width),
                Some(i + width).filter(|_| y + 1 < height),
            ];
            for next in near.into_iter().flatten() {
                if dark[next] && !seen[next] {
                    seen[next] = true;
                    open.push(next);
                }
            }
        }
        let (left, right) = spans.iter().fold((usize::MAX, 0), |(l, r), s| (l.min(s.0), r.max(s.1)));
        let touches = left == 0 || first == 0 || right + 1 >= width || first + spans.len() >= height;
        let (across, down) = ((right - left + 1) as f64, spans.len() as f64);
        // A frame alone is 7/16 of its square; a square that stands on its corner fills half of its rectangle.
        let sparse = f64::from(count) < 0.15 * across * down;
        if touches
            || sparse
            || across.min(down) < 0.6 * SMALLEST
            || across.max(down) > 0.5 * width.max(height) as f64
        {
            continue;
        }
        let points = spans.iter().enumerate().flat_map(|(row, &(l, r))| {
            let (top, bottom) = ((first + row) as f64, (first + row + 1) as f64);
            [[l as f64, top], [l as f64, bottom], [r as f64 + 1.0, top], [r as f64 + 1.0, bottom]]
        });
        hulls.push(hull(points.collect()));
    }
    hulls
}

fn turn(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Andrew's monotone chain.
fn hull(mut points: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    points.dedup();
    let mut chain: Vec<[f64; 2]> = Vec::new();
    for pass in 0..2 {
        let base = chain.len();
        let mut add = |p: &[f64; 2]| {
            while chain.len() >= base + 2 && turn(chain[chain.len() - 2], chain[chain.len() - 1], *p) <= 0.0 {
                chain.pop();
            }
            chain.push(*p);
        };
        if pass == 0 {
            points.iter().for_each(&mut add)
        } else {
            points.iter().rev().for_each(&mut add)
        }
        chain.pop();
    }
    chain
}

fn area(points: &[[f64; 2]]) -> f64 {
    let next = points.iter().cycle().skip(1);
    0.5 * points.iter().zip(next).map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum::<f64>()
}

/// The four corners of a hull that is nearly a quadrilateral: two far from each other, and on either side of their line the
/// one farthest from it.
pub(super) fn quad(hull: &[[f64; 2]]) -> Option<[[f64; 2]; 4]> {
    let far = |from: [f64; 2]| {
        hull.iter().copied().max_by(|a, b| distance(*a, from).total_cmp(&distance(*b, from)))
    };
    let middle =
        hull.iter().fold([0.0; 2], |sum, p| [sum[0] + p[0], sum[1] + p[1]]).map(|v| v / hull.len() as f64);
    let a = far(middle)?;
    let c = far(a)?;
    let b = hull.iter().copied().max_by(|p, q| turn(a, *p, c).total_cmp(&turn(a, *q, c)))?;
    let d = hull.iter().copied().min_by(|p, q| turn(a, *p, c).total_cmp(&turn(a, *q, c)))?;
    let corners = [a, b, c, d];
    let found = area(&corners).abs();
    let sides: Vec<f64> = (0..4).map(|i| distance(corners[i], corners[(i + 1) % 4])).collect();
    let (least, most) = sides.iter().fold((f64::MAX, 0.0f64), |(l, m), &s| (l.min(s), m.max(s)));
    let square =
        found > 0.85 * area(hull).abs() && least > 0.4 * most && most >= SMALLEST && least >= 0.5 * SMALLEST;
    // In the order of the clock, as rows grow downward.
    square.then(|| if area(&corners) > 0.0 { corners } else { [a, d, c, b] })
}

pub(super) fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}
