//! Camera marks in a picture: where their corners are, and what they say.
//!
//! Problem: marks must be found under uneven light, blurred, noisy and seen askew, and their corners to some hundredths of a
//! pixel. Method: dark regions against the mean of their surroundings, in windows of three sizes; the convex hull of a region is
//! reduced to four corners; each side is then measured by the area under profiles across it, which neither blur nor noise
//! shifts, and fitted by a line; lines meet in corners. The cells between them are read by their homography. Patterns and what they mean
//! are those of [`press::layout::camera`]. Cost: three passes over the picture, about 0.1 s a megapixel. Limits: marks whose
//! cells are at least four pixels wide; dark on light; the paper around them unshaded.

mod squares;

use press::layout::camera::{CELLS, Name};
use rayon::prelude::*;

use self::squares::{Sums, distance, quad, regions};
use super::grey::Grey;
use super::homography::Homography;

/// Windows of the mean, in parts of the picture's longer side.
const WINDOWS: [f64; 3] = [1.0 / 12.0, 1.0 / 28.0, 1.0 / 70.0];
/// Profiles across each side of a mark: about one a pixel, within these bounds.
const PROFILES: (usize, usize) = (40, 240);
/// Half the length of a profile in cells at most: it ends in the frame and in the bare paper.
const REACH: f64 = 0.65;
/// Half the length of a profile in pixels and in cells from which it is long enough: the shorter, the less noise and
/// shading it sees.
const ENOUGH: (f64, f64) = (5.0, 0.25);
/// Steps of a profile from its middle to its end.
const STEPS: i32 = 16;

/// A mark in a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mark {
    /// What it says.
    pub name: Name,
    /// Its corners in pixels: top left, top right, bottom right, bottom left of the mark as it is printed.
    pub corners: [[f64; 2]; 4],
}

impl Mark {
    /// From the mark's own plane, in which its corners are those of the square from 0 to 8, to the picture.
    pub(crate) fn plane(&self) -> Option<Homography> {
        let side = CELLS as f64;
        Homography::through([[0.0, 0.0], [side, 0.0], [side, side], [0.0, side]], self.corners)
    }
}

/// The marks in a picture, each once.
pub fn find(picture: &Grey) -> Vec<Mark> {
    if picture.width < 8 || picture.height < 8 {
        return Vec::new();
    }
    let sums = Sums::new(picture);
    let longest = picture.width.max(picture.height) as f64;
    let mut found: Vec<Mark> = Vec::new();
    for window in WINDOWS {
        let dark = sums.dark(picture, ((0.5 * window * longest) as usize).max(4));
        let marks: Vec<Mark> = regions(&dark, picture.width, picture.height)
            .par_iter()
            .filter_map(|hull| read(picture, refined(picture, quad(hull)?)?))
            .collect();
        for mark in marks {
            let near =
                |known: &Mark| distance(known.corners[0], mark.corners[0]) < 4.0 && known.name == mark.name;
            if !found.iter().any(near) {
                found.push(mark);
            }
        }
    }
    found.sort_by_key(|mark| mark.name.corner);
    found
}

/// Corners to a part of a pixel.
fn refined(picture: &Grey, mut corners: [[f64; 2]; 4]) -> Option<[[f64; 2]; 4]> {
    for round in 0..3 {
        let lines: Option<Vec<Line>> = (0..4).map(|i| side(picture, &corners, i, round == 0)).collect();
        let lines = lines?;
        let mut next = [[0.0; 2]; 4];
        for (i, next) in next.iter_mut().enumerate() {
            *next = lines[(i + 3) % 4].meet(&lines[i])?;
        }
        let moved = (0..4).map(|i| distance(corners[i], next[i])).fold(0.0, f64::max);
        if moved.is_nan() || moved >= 0.1 * distance(corners[0], corners[2]) {
            return None;
        }
        corners = next;
    }
    Some(corners)
}

/// A line through `at` along the unit vector `along`.
pub(crate) struct Line {
    pub(crate) at: [f64; 2],
    pub(crate) along: [f64; 2],
}

impl Line {
    /// Total least squares without the worst points, twice.
    pub(crate) fn fit(mut points: Vec<[f64; 2]>) -> Option<Line> {
        for round in 0..3 {
            if points.len() < PROFILES.0 / 3 {
                return None;
            }
            let n = points.len() as f64;
            let at = points.iter().fold([0.0; 2], |s, p| [s[0] + p[0], s[1] + p[1]]).map(|v| v / n);
            let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
            for p in &points {
                let (x, y) = (p[0] - at[0], p[1] - at[1]);
                xx += x * x;
                xy += x * y;
                yy += y * y;
            }
            let angle = 0.5 * (2.0 * xy).atan2(xx - yy);
            let line = Line { at, along: [angle.cos(), angle.sin()] };
            if round == 2 {
                return Some(line);
            }
            let off = |p: &[f64; 2]| ((p[0] - at[0]) * line.along[1] - (p[1] - at[1]) * line.along[0]).abs();
            let mut all: Vec<f64> = points.iter().map(off).collect();
            let limit = (3.0 * 1.4826 * crate::linalg::median(&mut all)).max(0.02);
            points.retain(|p| off(p) <= limit);
        }
        None
    }

    pub(crate) fn meet(&self, other: &Line) -> Option<[f64; 2]> {
        let cross = self.along[0] * other.along[1] - self.along[1] * other.along[0];
        if cross.abs() < 0.2 {
            return None;
        }
        let (dx, dy) = (other.at[0] - self.at[0], other.at[1] - self.at[1]);
        let t = (dx * other.along[1] - dy * other.along[0]) / cross;
        Some([self.at[0] + t * self.along[0], self.at[1] + t * self.along[1]])
    }
}

/// The side from corner `i` to the next.
fn side(picture: &Grey, corners: &[[f64; 2]; 4], i: usize, rough: bool) -> Option<Line> {
    let (a, b) = (corners[i], corners[(i + 1) % 4]);
    let length = distance(a, b);
    let along = [(b[0] - a[0]) / length, (b[1] - a[1]) / length];
    // Corners follow the clock, so out of the mark is to the left of the way.
    let out = [along[1], -along[0]];
    // A cell across this side: the neighbouring sides are as long as the mark is high.
    let high = 0.5 * (distance(b, corners[(i + 2) % 4]) + distance(a, corners[(i + 3) % 4]));
    let lean = {
        let (p, q) = (corners[(i + 2) % 4], corners[(i + 3) % 4]);
        let middle = [0.5 * (a[0] + b[0] - p[0] - q[0]), 0.5 * (a[1] + b[1] - p[1] - q[1])];
        ((middle[0] * out[0] + middle[1] * out[1]) / high).clamp(0.3, 1.0)
    };
    let cell = high * lean / CELLS as f64;
    let reach = if rough { REACH * cell } else { (REACH * cell).min((ENOUGH.1 * cell).max(ENOUGH.0)) };
    let profiles = (length as usize).clamp(PROFILES.0, PROFILES.1);
    let points = (0..profiles)
        .filter_map(|k| {
            let along = 0.08 + 0.84 * (k as f64 + 0.5) / profiles as f64;
            let at = [a[0] + along * (b[0] - a[0]), a[1] + along * (b[1] - a[1])];
            let shift = profile(picture, at, out, reach)?;
            Some([at[0] + shift * out[0], at[1] + shift * out[1]])
        })
        .collect();
    Line::fit(points)
}

/// By how far the step from dark to bright lies further out than `at`.
pub(crate) fn profile(picture: &Grey, at: [f64; 2], out: [f64; 2], reach: f64) -> Option<f64> {
    let mut values = [0.0; 2 * STEPS as usize + 1];
    for (value, step) in values.iter_mut().zip(-STEPS..=STEPS) {
        let s = reach * f64::from(step) / f64::from(STEPS);
        *value = picture.at([at[0] + s * out[0], at[1] + s * out[1]])?;
    }
    let ends = STEPS as usize / 3;
    let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
    let (inner, outer) = (mean(&values[..ends]), mean(&values[values.len() - ends..]));
    if outer - inner < 0.15 * outer.abs() {
        return None;
    }
    // The area above the dark level grows by as much as the dark part shrinks; trapezoids.
    let last = values.len() - 1;
    let bright: f64 = values
        .iter()
        .enumerate()
        .map(|(i, v)| {
            let weight = if i == 0 || i == last { 0.5 } else { 1.0 };
            weight * (v - inner) / (outer - inner)
        })
        .sum::<f64>()
        * reach
        / f64::from(STEPS);
    let shift = reach - bright;
    (shift.abs() < 0.7 * reach).then_some(shift)
}

/// Reads the cells of a square.
fn read(picture: &Grey, corners: [[f64; 2]; 4]) -> Option<Mark> {
    let side = CELLS as f64;
    let plane = Homography::through([[0.0, 0.0], [side, 0.0], [side, side], [0.0, side]], corners)?;
    let cell = |x: f64, y: f64| -> Option<f64> {
        let mut sum = 0.0;
        for dy in [-0.2, 0.0, 0.2] {
            for dx in [-0.2, 0.0, 0.2] {
                sum += picture.at(plane.at([x + 0.5 + dx, y + 0.5 + dy]))?;
            }
        }
        Some(sum / 9.0)
    };
    let ring = |first: i32, last: i32| -> Option<Vec<f64>> {
        let edge = |v: i32| v == first || v == last;
        let places = (first..=last).flat_map(|y| (first..=last).map(move |x| (x, y)));
        places.filter(|&(x, y)| edge(x) || edge(y)).map(|(x, y)| cell(f64::from(x), f64::from(y))).collect()
    };
    let (mut frame, mut paper) = (ring(0, CELLS as i32 - 1)?, ring(-1, CELLS as i32)?);
    let (dark, bright) =
        (crate::linalg::median(&mut frame.clone()), crate::linalg::median(&mut paper.clone()));
    let middle = 0.5 * (dark + bright);
    frame.retain(|&v| v >= middle);
    paper.retain(|&v| v <= middle);
    if bright - dark < 0.2 * bright || frame.len() > 2 || paper.len() > 3 {
        return None;
    }
    let mut bits = 0;
    let inner = CELLS - 2;
    for at in 0..inner * inner {
        let value = cell((at % inner + 1) as f64, (at / inner + 1) as f64)?;
        bits |= u64::from(value < middle) << at;
    }
    let (name, turn) = Name::read(bits)?;
    // Turned to the right by one, its top left corner is seen at the top right.
    let corners = std::array::from_fn(|i| corners[(i + turn) % 4]);
    Some(Mark { name, corners })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pseudo-random numbers from 0 to 1.
    fn random(state: &mut u64) -> f64 {
        *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*state >> 11) as f64 / (1u64 << 53) as f64
    }

    /// What a picture is made with: from cells of the sheet to the pixel, blur in pixels, noise, fall-off of light across it.
    struct Taken {
        /// The pixel of a place in cells; its inverse is not needed here, since the picture is made by searching the sheet.
        plane: Homography,
        back: Homography,
        blur: f64,
        noise: f64,
        fall: f64,
    }

    const NAMES: [Name; 4] = [
        Name { corner: 0, byte: 17 },
        Name { corner: 1, byte: 200 },
        Name { corner: 2, byte: 0 },
        Name { corner: 3, byte: 255 },
    ];
    /// Top left corners of the marks in cells.
    const PLACES: [[f64; 2]; 4] = [[0.0, 0.0], [40.0, 0.0], [0.0, 30.0], [40.0, 30.0]];

    fn dark(x: f64, y: f64) -> bool {
        NAMES.iter().zip(PLACES).any(|(name, [left, top])| {
            let (u, v) = (x - left, y - top);
            (0.0..8.0).contains(&u) && (0.0..8.0).contains(&v) && name.is_dark(u as usize, v as usize)
        }) || ((10.0..38.0).contains(&x)
            && (10.0..28.0).contains(&y)
            && ((x * 1.7).sin() + (y * 2.3).cos()) > 0.4)
    }

    impl Taken {
        /// A picture of 900 x 700 pixels whose corners show these places.
        fn new(corners: [[f64; 2]; 4], blur: f64, noise: f64, fall: f64) -> Taken {
            let frame = [[0.0, 0.0], [900.0, 0.0], [900.0, 700.0], [0.0, 700.0]];
            let back = Homography::through(frame, corners).unwrap();
            let plane = Homography::through(corners, frame).unwrap();
            Taken { plane, back, blur, noise, fall }
        }

        fn picture(&self) -> Grey {
            let (width, height) = (900, 700);
            let mut state = 11;
            let fine: Vec<f32> = (0..width * height)
                .map(|i| {
                    let (x, y) = ((i % width) as f64, (i / width) as f64);
                    let mut sum = 0.0;
                    for k in 0..25 {
                        let (dx, dy) = (f64::from(k % 5) / 5.0 + 0.1, f64::from(k / 5) / 5.0 + 0.1);
                        let [u, v] = self.back.at([x + dx, y + dy]);
                        sum += if dark(u, v) { 0.06 } else { 0.8 };
                    }
                    (sum / 25.0 * (1.0 - self.fall * x / width as f64)) as f32
                })
                .collect();
            let reach = (3.0 * self.blur).ceil() as i64;
            let kernel: Vec<f64> = (-reach..=reach)
                .map(|k| (-(k * k) as f64 / (2.0 * self.blur * self.blur).max(1e-9)).exp())
                .collect();
            let total: f64 = kernel.iter().sum();
            let blurred = |from: &[f32], stride: i64, at: i64, side: i64, start: i64| -> f32 {
                let value = |k: i64| f64::from(from[(start + (at + k).clamp(0, side - 1) * stride) as usize]);
                (kernel.iter().zip(-reach..=reach).map(|(w, k)| w * value(k)).sum::<f64>() / total) as f32
            };
            let (w, h) = (width as i64, height as i64);
            let rows: Vec<f32> = (0..w * h).map(|i| blurred(&fine, 1, i % w, w, i / w * w)).collect();
            let mut values: Vec<f32> = (0..w * h).map(|i| blurred(&rows, w, i / w, h, i % w)).collect();
            for value in &mut values {
                let normal: f64 = (0..4).map(|_| random(&mut state)).sum::<f64>() - 2.0;
                *value += (normal * 3f64.sqrt() * self.noise) as f32;
            }
            Grey { width, height, values }
        }
    }

    /// How far corners are from where they were drawn, in pixels: root mean square and worst.
    fn off(taken: &Taken) -> (f64, f64) {
        let found = find(&taken.picture());
        assert_eq!(found.iter().map(|mark| mark.name).collect::<Vec<_>>(), NAMES);
        let (mut sum, mut worst) = (0.0, 0.0f64);
        for (mark, [x, y]) in found.iter().zip(PLACES) {
            for (corner, [dx, dy]) in
                mark.corners.iter().zip([[0.0, 0.0], [8.0, 0.0], [8.0, 8.0], [0.0, 8.0]])
            {
                let error = distance(*corner, taken.plane.at([x + dx, y + dy]));
                sum += error * error;
                worst = worst.max(error);
            }
        }
        ((sum / 16.0).sqrt(), worst)
    }

    #[test]
    fn corners_are_found_to_hundredths_of_a_pixel_blurred_noisy_and_askew() {
        let straight = [[-6.0, -6.0], [54.0, -6.0], [54.0, 44.0], [-6.0, 44.0]];
        let turned = [[60.0, -10.0], [56.0, 46.0], [-10.0, 48.0], [-8.0, -6.0]];
        let tilted = [[-14.0, -8.0], [62.0, -16.0], [51.0, 44.0], [-5.0, 41.0]];
        for (corners, blur, noise, fall, most) in [
            (straight, 0.0, 0.0, 0.0, 0.03),
            (straight, 1.5, 0.0, 0.0, 0.03),
            (turned, 0.7, 0.01, 0.5, 0.05),
            (tilted, 0.7, 0.01, 0.6, 0.05),
            (tilted, 1.2, 0.03, 0.6, 0.1),
        ] {
            let (rms, worst) = off(&Taken::new(corners, blur, noise, fall));
            println!("blur {blur}, noise {noise}, fall-off {fall}: {rms:.4} pixels, at worst {worst:.4}");
            assert!(rms < most && worst < 4.0 * most, "{rms} {worst}");
        }
    }

    #[test]
    fn pictures_without_marks_have_none() {
        let mut state = 5;
        let noise = Grey {
            width: 400,
            height: 300,
            values: (0..120_000).map(|_| random(&mut state) as f32).collect(),
        };
        assert!(find(&noise).is_empty());
        for value in [0.0, 0.5, f32::NAN, f32::INFINITY] {
            assert!(find(&Grey { width: 200, height: 200, values: vec![value; 40_000] }).is_empty());
        }
        // A chequerboard has many squares and no marks.
        let board = |i: usize| if (i % 640 / 40 + i / 640 / 40).is_multiple_of(2) { 0.05 } else { 0.8 };
        assert!(
            find(&Grey { width: 640, height: 480, values: (0..640 * 480).map(board).collect() }).is_empty()
        );
        assert!(find(&Grey { width: 2, height: 1, values: vec![0.0; 2] }).is_empty());
    }
}
