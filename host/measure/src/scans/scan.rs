//! A scan of a chart, or a photograph of it, laid over the dots that were printed.
//!
//! Problem: tones of a chart are means over places that are known in dots, and the scan lies askew, at another scale, and is unevenly lit.
//! Method: the corners of the camera marks give the homography from dots to pixels. A tone is the mean over the pixels of a
//! window with soft edges, so that neither blur nor a period of dots that does not fit matters. Each of two solid stacks
//! has a surface of its own, a cubic fitted to all of its solid places; a tone is where the light stands
//! between the two, as Murray and Davies have it, in that mixture of channels that tells the stacks apart best.
//! Cost: a pass over the pixels of each window. Limits: a flat sheet; lenses that bend lines by less than half a millimetre.

use std::path::Path;

use sheet::{Area, DOTS_PER_MM};

use crate::MeasureError;
use crate::compare::picture::Picture;
use crate::geometry::grey::Grey;
use crate::geometry::homography::Homography;
use crate::geometry::marks::Mark;
use crate::geometry::sheet_marks::SheetMarks;
use crate::geometry::sides;
use crate::linalg::{Cholesky, median, spread};

/// The fewest pixels a millimetre: 150 dpi.
const FEWEST_PIXELS: f64 = 5.5;
/// Marks that lie farther than this from where a flat sheet has them, in mm, are not on one.
const MOST_RESIDUAL: f64 = 0.3;
/// Fringes beside the marks, as a share of the step from ink to paper, from which a scan was sharpened: an even blur makes none, noise less than a fifth.
const FRINGE: f64 = 0.03;
/// What is left out at the ends of a solid strip, in dots: blur and spreading ink reach that far.
const INSET: usize = 16;
/// Places of a solid strip, along it.
const PLACES: usize = 24;
/// Terms of a surface: as many as `Surface::terms_at` lists.
const TERMS: usize = 9;
/// A share of full or empty pixels in a solid from which it is clipped: fewer would be dust.
const CLIPPED: f64 = 0.02;
/// Stacks whose light differs less than this, relative to the brighter one, cannot be told apart.
const CONTRAST: f64 = 0.06;

/// A scan and where the sheet is in it.
pub(crate) struct Scan {
    picture: Picture,
    /// From dots of the sheet to pixels.
    to_pixels: Homography,
    /// And back.
    to_dots: Homography,
    /// The picture as marks are found in it.
    pub(crate) grey: Grey,
    /// The marks, with their corners in dots of the sheet.
    pub(crate) marks: Vec<(Mark, [[f64; 2]; 4])>,
}

impl Scan {
    /// Reads a scan of the sheet with these marks. `linear` says whether values are proportional to light [default: those of 16 bits and
    /// OpenEXR are].
    pub(crate) fn read(path: &Path, sheet: &SheetMarks, linear: Option<bool>) -> Result<Scan, MeasureError> {
        let picture = Picture::read(path, linear)?;
        let grey = picture.grey();
        let marks: Vec<(Mark, [[f64; 2]; 4])> = sheet
            .seen(path, &grey)?
            .into_iter()
            .map(|(mark, printed)| (mark, printed.corners.map(|place| sheet.dots(place))))
            .collect();
        let dots: Vec<[f64; 2]> = marks.iter().flat_map(|(_, corners)| *corners).collect();
        let pixels: Vec<[f64; 2]> = marks.iter().flat_map(|(mark, _)| mark.corners).collect();
        let fitted = Homography::fit(&dots, &pixels).zip(Homography::fit(&pixels, &dots));
        let Some((to_pixels, to_dots)) = fitted else {
            return Err(MeasureError::photo(path, "its camera marks lie in one line; take it again"));
        };
        let off = |(p, q): (&[f64; 2], &[f64; 2])| {
            let [x, y] = to_dots.at(*p);
            (x - q[0]).powi(2) + (y - q[1]).powi(2)
        };
        let residual =
            (pixels.iter().zip(&dots).map(off).sum::<f64>() / dots.len() as f64).sqrt() / DOTS_PER_MM;
        if residual > MOST_RESIDUAL {
            let problem = format!(
                "the marks are {residual:.1} mm from where a flat sheet has them; lay the sheet flat, and use a scanner or a lens that \
                 does not bend lines"
            );
            return Err(MeasureError::photo(path, problem));
        }
        let scan = Scan { picture, to_pixels, to_dots, grey, marks };
        let pixels = scan.pixels_per_mm();
        if pixels < FEWEST_PIXELS {
            let problem = format!(
                "{:.0} dpi on the sheet; scan it at 300 dpi or more, or bring the camera nearer (at least {:.0})",
                pixels * 25.4,
                FEWEST_PIXELS * 25.4
            );
            return Err(MeasureError::photo(path, problem));
        }
        Ok(scan)
    }

    /// Pixels a millimetre of the sheet, from the marks' sides: across and down the mark as printed.
    pub(crate) fn scales(&self) -> [f64; 2] {
        let mut sums = [0.0; 2];
        for (mark, printed) in &self.marks {
            let side =
                |of: &[[f64; 2]; 4], a: usize, b: usize| (of[a][0] - of[b][0]).hypot(of[a][1] - of[b][1]);
            for (c, pairs) in [[(0, 1), (3, 2)], [(0, 3), (1, 2)]].into_iter().enumerate() {
                sums[c] +=
                    pairs.map(|(a, b)| side(&mark.corners, a, b) / side(printed, a, b)).iter().sum::<f64>()
                        / 2.0;
            }
        }
        sums.map(|sum| sum / self.marks.len() as f64 * DOTS_PER_MM)
    }

    /// Refuses a scan whose program sharpened it: that makes the paper brighter beside ink, and ink darker beside paper, so tones of small
    /// clusters are no mean of ink and paper.
    pub(crate) fn not_sharpened(&self, path: &Path) -> Result<(), MeasureError> {
        let fringe = |(_, profile): (usize, Vec<f64>)| {
            let most = profile.iter().copied().fold(0.0, f64::max);
            let least = profile.iter().copied().fold(1.0, f64::min);
            (most - 1.0).max(-least)
        };
        let sides = self.marks.iter().flat_map(|(mark, _)| sides::profiles(&self.grey, mark));
        let fringe = median(&mut sides.map(fringe).collect::<Vec<_>>());
        if fringe > FRINGE {
            let problem = format!(
                "it was sharpened: beside the camera marks' sides are fringes of {:.0} % of the step from ink to paper; turn sharpening off in the \
                 scanner's program, and scan again",
                100.0 * fringe
            );
            return Err(MeasureError::photo(path, problem));
        }
        Ok(())
    }

    /// The same scan with its tones taken the other way, proportional to light or through the curve of sRGB; `None` where that is no question.
    pub(crate) fn other_tones(mut self) -> Option<Scan> {
        self.picture = self.picture.other_tones()?;
        Some(self)
    }

    /// The pixel of a place in dots of the sheet.
    pub(crate) fn pixel(&self, dots: [f64; 2]) -> [f64; 2] {
        self.to_pixels.at(dots)
    }

    fn pixels_per_mm(&self) -> f64 {
        let [across, down] = self.scales();
        across.min(down)
    }

    /// The mean light in a window and the shares of full and of empty values; `None` if part of it is outside of the picture.
    fn mean(&self, window: &TonePatch) -> Option<([f64; 3], [f64; 2])> {
        let Area { left, top, width, length } = window.area;
        let (right, bottom) = ((left + width) as f64, (top + length) as f64);
        let (left, top) = (left as f64, top as f64);
        let corners =
            [[left, top], [right, top], [right, bottom], [left, bottom]].map(|p| self.to_pixels.at(p));
        let range = |c: usize, most: usize| -> Option<std::ops::Range<usize>> {
            let least = corners.iter().map(|p| p[c]).fold(f64::MAX, f64::min);
            let last = corners.iter().map(|p| p[c]).fold(f64::MIN, f64::max);
            (least >= 0.0 && last <= most as f64).then(|| least as usize..(last.ceil() as usize).min(most))
        };
        let (columns, rows) = (range(0, self.picture.width)?, range(1, self.picture.height)?);
        let (mut sum, mut weights, mut full, mut empty) = ([0.0; 3], 0.0, 0.0, 0.0);
        for y in rows {
            for x in columns.clone() {
                let weight = window.weight(self.to_dots.at([x as f64 + 0.5, y as f64 + 0.5]));
                if weight > 0.0 {
                    let (rgb, limits) = self.picture.pixel(x, y);
                    (0..3).for_each(|c| sum[c] += weight * rgb[c]);
                    full += weight * f64::from(u8::from(limits[1]));
                    empty += weight * f64::from(u8::from(limits[0]));
                    weights += weight;
                }
            }
        }
        (weights > 0.0).then(|| (sum.map(|v| v / weights), [empty / weights, full / weights]))
    }
}

/// A rectangle of dots whose edges are soft.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TonePatch {
    /// All of it, in dots of the sheet.
    pub(crate) area: Area,
    /// Over how many dots its weight rises from 0 to 1.
    pub(crate) soft: f64,
}

impl TonePatch {
    /// The weight of a place in dots of the sheet: 0 outside, 1 in the middle.
    pub(crate) fn weight(&self, [x, y]: [f64; 2]) -> f64 {
        let rise = |at: f64, start: usize, side: usize| {
            let inside = (at - start as f64).min((start + side) as f64 - at);
            if inside <= 0.0 {
                return 0.0;
            }
            let s = (inside / self.soft.max(1e-9)).min(1.0);
            // Its slope is 0 at both ends.
            s * s * (3.0 - 2.0 * s)
        };
        rise(x, self.area.left, self.area.width) * rise(y, self.area.top, self.area.length)
    }

    fn middle(&self) -> [f64; 2] {
        [
            self.area.left as f64 + self.area.width as f64 / 2.0,
            self.area.top as f64 + self.area.length as f64 / 2.0,
        ]
    }
}

/// What a solid stack looks like all over the sheet: a cubic across, a square down, for each channel.
struct Surface {
    /// Middle and half side of the places it was fitted to.
    frame: [[f64; 2]; 2],
    terms: [[f64; TERMS]; 3],
}

impl Surface {
    fn terms_at(frame: &[[f64; 2]; 2], place: [f64; 2]) -> [f64; TERMS] {
        let [x, y] = [0, 1].map(|c| (place[c] - frame[0][c]) / frame[1][c]);
        [1.0, x, y, x * x, x * y, y * y, x * x * x, x * x * y, x * y * y]
    }

    /// Least squares; places that are far off, such as dust, are left out.
    fn fit(places: &[([f64; 2], [f64; 3])]) -> Option<Surface> {
        let ends = |c: usize| {
            let all = places.iter().map(|(place, _)| place[c]);
            (all.clone().fold(f64::MAX, f64::min), all.fold(f64::MIN, f64::max))
        };
        let frame = {
            let [(left, right), (top, bottom)] = [ends(0), ends(1)];
            [
                [0.5 * (left + right), 0.5 * (top + bottom)],
                [0.5 * (right - left).max(1.0), 0.5 * (bottom - top).max(1.0)],
            ]
        };
        let mut surface = Surface { frame, terms: [[0.0; TERMS]; 3] };
        for channel in 0..3 {
            let mut kept: Vec<([f64; TERMS], f64)> =
                places.iter().map(|(place, rgb)| (Surface::terms_at(&frame, *place), rgb[channel])).collect();
            for round in 0..3 {
                let (mut normal, mut right) = (vec![0.0; TERMS * TERMS], vec![0.0; TERMS]);
                for (terms, value) in &kept {
                    for i in 0..TERMS {
                        right[i] += terms[i] * value;
                        (0..TERMS).for_each(|j| normal[TERMS * i + j] += terms[i] * terms[j]);
                    }
                }
                let solved = Cholesky::new(&normal, TERMS)?.solve(&right);
                let off = |(terms, value): &([f64; TERMS], f64)| {
                    value - terms.iter().zip(&solved).map(|(a, b)| a * b).sum::<f64>()
                };
                surface.terms[channel] = std::array::from_fn(|i| solved[i]);
                if round < 2 {
                    let all: Vec<f64> = kept.iter().map(off).collect();
                    let (_, sigma) = spread(&all);
                    let limit = (4.0 * sigma).max(1e-6);
                    kept.retain(|place| off(place).abs() <= limit);
                }
            }
        }
        Some(surface)
    }

    fn at(&self, place: [f64; 2]) -> [f64; 3] {
        let terms = Surface::terms_at(&self.frame, place);
        self.terms.map(|own| own.iter().zip(terms).map(|(a, b)| a * b).sum())
    }
}

/// Two stacks that tones stand between.
pub(crate) struct Between {
    surfaces: [Surface; 2],
}

impl Between {
    /// Fits both stacks to their solid strips, in dots of the sheet. `names` are for messages.
    pub(crate) fn fit(
        scan: &Scan,
        path: &Path,
        solids: &[Vec<Area>; 2],
        names: [&str; 2],
    ) -> Result<Between, MeasureError> {
        let mut surfaces = Vec::with_capacity(2);
        for (strips, name) in solids.iter().zip(names) {
            let mut places = Vec::new();
            let mut limits = [0.0f64; 2];
            for strip in strips {
                let step = (strip.width - 2 * INSET) / PLACES;
                for i in 0..PLACES {
                    let area = Area {
                        left: strip.left + INSET + i * step,
                        top: strip.top + INSET,
                        width: step,
                        length: strip.length - 2 * INSET,
                    };
                    let window = TonePatch { area, soft: 2.0 };
                    let Some((rgb, at)) = scan.mean(&window) else {
                        return Err(cropped(path));
                    };
                    (0..2).for_each(|k| limits[k] += at[k] / (strips.len() * PLACES) as f64);
                    places.push((window.middle(), rgb));
                }
            }
            let clipped = |what: &str, do_so: &str| {
                let problem = format!("{name} is clipped ({what}); {do_so}, and turn automatic tones off");
                Err(MeasureError::photo(path, problem))
            };
            if limits[1] > CLIPPED {
                return clipped("its light is beyond the brightest value", "scan it darker");
            }
            if limits[0] > 0.5 {
                return clipped("its light is below the darkest value", "scan it brighter");
            }
            surfaces.extend(Surface::fit(&places));
        }
        let Ok(surfaces) = <[Surface; 2]>::try_from(surfaces) else {
            return Err(MeasureError::photo(
                path,
                "the solid strips of the chart are not seen; scan all of it",
            ));
        };
        let between = Between { surfaces };
        let middle = between.surfaces[0].frame[0];
        let [a, b] = [0, 1].map(|k| between.surfaces[k].at(middle));
        let contrast = (0..3).map(|c| (a[c] - b[c]).abs() / a[c].max(b[c]).max(1e-12)).fold(0.0, f64::max);
        if contrast < CONTRAST {
            let problem = format!(
                "{} and {} look alike (contrast {:.0} %); photograph the chart under a lamp that shows their difference, or use a ramp to \
                 another stack",
                names[0],
                names[1],
                100.0 * contrast
            );
            return Err(MeasureError::photo(path, problem));
        }
        Ok(between)
    }

    /// How much of a window the first of the two stacks covers, as light tells.
    pub(crate) fn share(&self, scan: &Scan, path: &Path, window: &TonePatch) -> Result<f64, MeasureError> {
        let Some((seen, _)) = scan.mean(window) else { return Err(cropped(path)) };
        let [a, b] = [0, 1].map(|k| self.surfaces[k].at(window.middle()));
        let (mut top, mut bottom) = (0.0, 0.0);
        for c in 0..3 {
            // Noise grows with light, so channels count by their relative difference.
            let weight = 1.0 / (a[c] + b[c]).max(1e-9).powi(2);
            top += weight * (seen[c] - b[c]) * (a[c] - b[c]);
            bottom += weight * (a[c] - b[c]).powi(2);
        }
        Ok(top / bottom)
    }
}

fn cropped(path: &Path) -> MeasureError {
    MeasureError::photo(path, "part of the chart is outside of the picture; scan all of it, marks included")
}
