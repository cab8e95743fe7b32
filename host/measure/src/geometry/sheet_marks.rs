//! The printed sheet as marks on it tell: where they are, and the frame they span.
//!
//! Problem: a job, a folder and a document must say alike where marks are. Method: the sheet's dots are a picture too, so its marks are
//! found as those of a photograph are, and their corners moved to the dots they lie on. Cost: as for a photograph.
//! Limits: marks of a dark ink on bare paper.

use std::path::Path;

use appearance::brdf::{Space, reflectances};
use inks::Library;
use press::layout::camera::{Name, SIDE};
use sheet::{Area, DOTS_PER_MM, DotMap};

use super::grey::Grey;
use super::marks::{self, Mark};
use crate::MeasureError;

/// Dots along a side of a pixel in which marks are looked for: a cell has 30 dots, so that it keeps ten,
/// which is enough for the detector.
const FACTOR: usize = 3;
/// The half angle at which stacks are seen there, in radians: beside the highlight.
const BESIDE: f64 = 0.7;
/// Angles at which curves are sampled for that.
const SAMPLES: usize = 64;
/// Bare paper around the printable area, in those pixels: a mark may stand at its very edge.
const AROUND: usize = 24;
/// The fewest marks that tell a sheet, so that another one passes once in 16 million
/// (decisions/marks-and-photographs.md).
pub(crate) const FEWEST: usize = 3;

/// A mark of the sheet.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PrintedMark {
    pub(crate) name: Name,
    /// Its corners in mm of the sheet's frame: top left, top right, bottom right, bottom left.
    pub(crate) corners: [[f64; 2]; 4],
}

/// The marks of a sheet.
#[derive(Clone, Debug)]
pub(crate) struct SheetMarks {
    pub(crate) marks: Vec<PrintedMark>,
    /// The frame's origin in dots: the middle of all marks.
    origin: [f64; 2],
    /// The dots between them.
    pub(crate) between: Area,
}

impl SheetMarks {
    /// Finds the marks of a sheet.
    pub(crate) fn find(dots: &DotMap, library: &Library) -> Result<SheetMarks, MeasureError> {
        let found = marks::find(&picture(dots, library));
        let mut marks: Vec<(Name, [f64; 2])> = Vec::new();
        for Mark { name, corners } in &found {
            // The middle is more exact than a corner.
            let middle: [f64; 2] = std::array::from_fn(|c| {
                (corners.iter().map(|p| p[c]).sum::<f64>() / 4.0 - AROUND as f64) * FACTOR as f64
            });
            let left_top = middle.map(|m| (m - SIDE as f64 / 2.0).round());
            if marks.iter().any(|(known, _)| known.corner == name.corner) {
                return Err(MeasureError::Scene(
                    "the sheet has two camera marks for one corner; compare a sheet with one print on it"
                        .into(),
                ));
            }
            marks.push((*name, left_top));
        }
        if marks.len() < FEWEST {
            return Err(MeasureError::Scene(format!(
                "the sheet has {} camera marks, and {FEWEST} are needed; print it with --camera-marks, and leave 13 mm of the printable \
                 area free above and below the print",
                marks.len()
            )));
        }
        let side = SIDE as f64;
        let least = |c: usize| marks.iter().map(|(_, p)| p[c]).fold(f64::MAX, f64::min);
        let most = |c: usize| marks.iter().map(|(_, p)| p[c] + side).fold(f64::MIN, f64::max);
        let origin = [0, 1].map(|c| 0.5 * (least(c) + most(c)));
        // Half a millimetre of the bare paper around the marks is left out.
        let (top, bottom) = (least(1) + side + 12.0, most(1) - side - 12.0);
        let (left, right) = (least(0), most(0));
        if bottom - top < 100.0 || right - left < 100.0 {
            return Err(MeasureError::Scene("there is nothing between the sheet's camera marks".into()));
        }
        let between = Area {
            left: left as usize,
            top: top as usize,
            width: (right - left) as usize,
            length: (bottom - top) as usize,
        };
        let mut sheet = SheetMarks { marks: Vec::new(), origin, between };
        sheet.marks = marks
            .iter()
            .map(|&(name, [x, y])| PrintedMark {
                name,
                corners: [[x, y], [x + side, y], [x + side, y + side], [x, y + side]].map(|p| sheet.place(p)),
            })
            .collect();
        Ok(sheet)
    }

    /// Dots from the sheet's top left corner as mm in the frame.
    pub(crate) fn place(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [(x - self.origin[0]) / DOTS_PER_MM, (self.origin[1] - y) / DOTS_PER_MM]
    }

    /// A place in mm of the frame as dots from the sheet's top left corner.
    pub(crate) fn dots(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [self.origin[0] + x * DOTS_PER_MM, self.origin[1] - y * DOTS_PER_MM]
    }

    /// The sheet's marks in a picture, each with itself as printed.
    pub(crate) fn seen(&self, path: &Path, picture: &Grey) -> Result<Vec<(Mark, PrintedMark)>, MeasureError> {
        let wrong = |problem: String| Err(MeasureError::photo(path, problem));
        let own = |found: &[Mark]| -> Vec<(Mark, PrintedMark)> {
            let known = |mark: &Mark| self.marks.iter().find(|known| known.name == mark.name);
            found.iter().filter_map(|mark| Some((*mark, *known(mark)?))).collect()
        };
        let found = marks::find(picture);
        let seen = own(&found);
        if seen.len() < FEWEST
            && found.len() < FEWEST
            && own(&marks::find(&picture.mirrored())).len() >= FEWEST
        {
            return wrong("the picture is mirrored; turn mirroring off and take it again".into());
        }
        if found.is_empty() {
            return wrong(
                "no camera marks were found; show all four corners of the print, in focus, and so large that a mark has at least 40 \
                 pixels along its side"
                    .into(),
            );
        }
        if seen.len() < FEWEST && found.len() > seen.len() {
            return wrong(format!(
                "its camera marks are those of another sheet ({} of {}); give the job that it was printed from",
                found.len() - seen.len(),
                found.len()
            ));
        }
        if seen.len() < FEWEST {
            return wrong(format!(
                "only {} of the sheet's {} camera marks are seen, and {FEWEST} are needed; show all corners, without shadows or fingers on \
                 them",
                seen.len(),
                self.marks.len()
            ));
        }
        if seen
            .iter()
            .enumerate()
            .any(|(i, (mark, _))| seen[..i].iter().any(|(other, _)| other.name == mark.name))
        {
            return wrong("two copies of the sheet are in the picture; show one of them".into());
        }
        Ok(seen)
    }

    /// The middle of an area in mm of the frame, and its size in mm.
    pub(crate) fn area(&self, area: Area) -> ([f64; 2], [f64; 2]) {
        let half = |start: usize, side: usize| start as f64 + side as f64 / 2.0;
        let middle = self.place([half(area.left, area.width), half(area.top, area.length)]);
        (middle, [area.width, area.length].map(|side| side as f64 / DOTS_PER_MM))
    }
}

/// The sheet in small, as a camera beside the highlight sees it.
fn picture(dots: &DotMap, library: &Library) -> Grey {
    let space = Space::half_angle(SAMPLES);
    let grey: Vec<f32> = reflectances(dots.stacks(), library, &space)
        .rows()
        .map(|row| space.curve(row).at(BESIDE).into_iter().fold(f64::MAX, f64::min) as f32)
        .collect();
    let (columns, rows) = (dots.width() / FACTOR, dots.length() / FACTOR);
    let (width, height) = (columns + 2 * AROUND, rows + 2 * AROUND);
    let bare = dots.stacks().iter().position(|stack| stack.layers().is_empty());
    let paper = bare.map_or_else(|| grey.iter().copied().fold(0.0, f32::max), |at| grey[at]);
    let mut values = vec![paper * (FACTOR * FACTOR) as f32; width * height];
    for (y, row) in values.chunks_exact_mut(width).skip(AROUND).take(rows).enumerate() {
        let row = &mut row[AROUND..AROUND + columns];
        row.fill(0.0);
        for line in 0..FACTOR {
            let start = (FACTOR * y + line) * dots.width();
            let dots = &dots.index()[start..start + FACTOR * columns];
            for (value, dots) in row.iter_mut().zip(dots.chunks_exact(FACTOR)) {
                *value += dots.iter().map(|&stack| grey[usize::from(stack)]).sum::<f32>();
            }
        }
    }
    Grey { width, height, values }
}
