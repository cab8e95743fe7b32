//! Where each stack of a chart is in the photographs, as its camera marks tell.
//!
//! Problem: rectangles in pixels have to be read off by hand, and are none on a can. Method: the corners of the marks are followed from
//! their pixels to the sample's surface, which is unrolled; an affine map takes that to the sheet, whatever the tape
//! missed by a few millimetres. Patches are the solid rectangles of the sheet's dots. Cost: the search for marks, once for each
//! lamp. Limits: marks that face the camera within 60 degrees; stacks that are rectangles of at least 6 mm.

use std::path::Path;

use inks::Stack;
use sheet::{Area, DOTS_PER_MM, DotMap};

use crate::MeasureError;
use crate::camera::merge::Radiance;
use crate::geometry::grey::Grey;
use crate::geometry::scene::Scene;
use crate::geometry::sheet_marks::SheetMarks;
use crate::linalg::Cholesky;

/// The shortest side of a patch in mm.
const LEAST: f64 = 6.0;
/// What is left out at its edges, in mm.
const INSET: f64 = 0.8;
/// Marks that are farther than this from where the sample has them, in mm, are not on it.
const MOST_RESIDUAL: f64 = 1.5;
/// Highlights are cut off at this multiple of bright paper before marks are looked for.
const BRIGHT: f32 = 1.5;

/// A part of a photograph.
#[derive(Clone, Debug)]
pub enum Region {
    /// All of the sample.
    All,
    /// Left, top, right, bottom in pixels.
    Pixels([f64; 4]),
    /// A rectangle of the sheet.
    Sheet(OnSheet),
}

/// A rectangle of a sheet that lies on the sample.
#[derive(Clone, Debug)]
pub struct OnSheet {
    /// From places of the unrolled sample to places of the sheet, in mm: for each a constant and two slopes.
    to_sheet: [[f64; 3]; 2],
    /// Least and greatest place.
    from: [f64; 2],
    to: [f64; 2],
    /// What it covers in the picture: left, top, right, bottom.
    pub(crate) around: [f64; 4],
}

impl OnSheet {
    /// Whether a place of the unrolled sample is in it.
    pub(crate) fn holds(&self, [x, y]: [f64; 2]) -> bool {
        (0..2).all(|c| {
            let [a, b, d] = self.to_sheet[c];
            let at = a + b * x + d * y;
            (self.from[c]..=self.to[c]).contains(&at)
        })
    }
}

/// Solid rectangles of a sheet's dots with their stacks; of bare paper only those that ink encloses.
fn solid(sheet: &DotMap) -> Vec<(Stack, Area)> {
    let (width, length) = (sheet.width(), sheet.length());
    let least = (LEAST * DOTS_PER_MM) as usize;
    let at = |x: usize, y: usize| sheet.index()[y * width + x];
    let mut found = Vec::new();
    for y in 0..length {
        let mut x = 0;
        while x < width {
            let own = at(x, y);
            let wide = (x..width).take_while(|&x| at(x, y) == own).count();
            let starts = y == 0 || at(x, y - 1) != own;
            let stack = &sheet.stacks()[usize::from(own)];
            if wide >= least && starts {
                let row = |y: usize| sheet.index()[y * width + x..][..wide].iter().all(|dot| *dot == own);
                let long = (y..length).take_while(|&y| row(y)).count();
                let is_inked =
                    |x: usize, y: usize| !sheet.stacks()[usize::from(at(x, y))].layers().is_empty();
                let is_framed = || {
                    x > 0
                        && y > 0
                        && x + wide < width
                        && y + long < length
                        && (x..x + wide).all(|x| is_inked(x, y - 1) && is_inked(x, y + long))
                        && (y..y + long).all(|y| is_inked(x - 1, y) && is_inked(x + wide, y))
                };
                if long >= least && (!stack.layers().is_empty() || is_framed()) {
                    found.push((stack.clone(), Area { left: x, top: y, width: wide, length: long }));
                }
            }
            x += wide;
        }
    }
    found
}

/// A chart: its marks and its patches.
pub(crate) struct ChartOnSample {
    marks: SheetMarks,
    patches: Vec<(Stack, Area)>,
}

impl ChartOnSample {
    /// Finds marks and patches of a sheet.
    pub(crate) fn new(sheet: &DotMap) -> Result<ChartOnSample, MeasureError> {
        let marks = SheetMarks::find(sheet, &inks::Library::builtin())?;
        let between = marks.between;
        let inside =
            |area: &Area| area.top >= between.top && area.top + area.length <= between.top + between.length;
        let patches: Vec<(Stack, Area)> = solid(sheet).into_iter().filter(|(_, area)| inside(area)).collect();
        if patches.is_empty() {
            return Err(MeasureError::Scene(format!(
                "sample.chart: its sheet has no solid patches of {LEAST:.0} mm or more; print one with `foilpress chart stacks`"
            )));
        }
        if let Some((stack, _)) = patches
            .iter()
            .enumerate()
            .find(|(i, (stack, _))| patches[..*i].iter().any(|(s, _)| s == stack))
            .map(|p| p.1)
        {
            return Err(MeasureError::Scene(format!(
                "sample.chart: its sheet has two patches of {stack}; print it once"
            )));
        }
        Ok(ChartOnSample { marks, patches })
    }

    /// The stacks.
    pub(crate) fn stacks(&self) -> Vec<Stack> {
        self.patches.iter().map(|(stack, _)| stack.clone()).collect()
    }

    /// Where its patches are in a picture, in the order of the stacks.
    pub(crate) fn regions(
        &self,
        path: &Path,
        radiance: &Radiance,
        scene: &Scene,
    ) -> Result<Vec<Region>, MeasureError> {
        let seen = self.marks.seen(path, &grey(radiance))?;
        let mut pairs = Vec::new();
        for (mark, printed) in &seen {
            for (pixel, place) in mark.corners.iter().zip(printed.corners) {
                let Some(surface) = scene.unrolled(pixel[0], pixel[1]) else {
                    return Err(MeasureError::photo(
                        path,
                        "a camera mark lies beside the sample; sample.height_mm (and width_mm) are those of the whole print, marks included",
                    ));
                };
                pairs.push((surface, place));
            }
        }
        let back: Vec<([f64; 2], [f64; 2])> = pairs.iter().map(|(a, b)| (*b, *a)).collect();
        let maps = affine(&pairs).zip(affine(&back));
        let Some((to_sheet, to_surface)) = maps else {
            return Err(MeasureError::photo(path, "its camera marks lie in one line; show all of them"));
        };
        let off = |(surface, place): &([f64; 2], [f64; 2])| {
            let [x, y] = applied(&to_sheet, *surface);
            (x - place[0]).powi(2) + (y - place[1]).powi(2)
        };
        let residual = (pairs.iter().map(off).sum::<f64>() / pairs.len() as f64).sqrt();
        if residual > MOST_RESIDUAL {
            return Err(MeasureError::photo(
                path,
                format!(
                    "the chart's marks are {residual:.1} mm from where the sample has them; check sample.shape, radius_mm and the camera's \
                     place and field of view, and that the print lies smooth"
                ),
            ));
        }
        let region = |(_, area): &(Stack, Area)| {
            let (middle, size) = self.marks.area(*area);
            let from: [f64; 2] = std::array::from_fn(|c| middle[c] - 0.5 * size[c] + INSET);
            let to: [f64; 2] = std::array::from_fn(|c| middle[c] + 0.5 * size[c] - INSET);
            let mut around = [f64::MAX, f64::MAX, f64::MIN, f64::MIN];
            for k in 0..=16 {
                let t = f64::from(k) / 16.0;
                let (x, y) = (from[0] + t * (to[0] - from[0]), from[1] + t * (to[1] - from[1]));
                for place in [[x, from[1]], [x, to[1]], [from[0], y], [to[0], y]] {
                    let Some([x, y]) = scene.pixel_of(applied(&to_surface, place)) else { continue };
                    around = [around[0].min(x), around[1].min(y), around[2].max(x), around[3].max(y)];
                }
            }
            Region::Sheet(OnSheet { to_sheet, from, to, around })
        };
        Ok(self.patches.iter().map(region).collect())
    }
}

fn applied(map: &[[f64; 3]; 2], [x, y]: [f64; 2]) -> [f64; 2] {
    map.map(|[a, b, d]| a + b * x + d * y)
}

/// The affine map nearest to these pairs.
fn affine(pairs: &[([f64; 2], [f64; 2])]) -> Option<[[f64; 3]; 2]> {
    let mut map = [[0.0; 3]; 2];
    for (c, map) in map.iter_mut().enumerate() {
        let (mut normal, mut right) = (vec![0.0; 9], vec![0.0; 3]);
        for ([x, y], to) in pairs {
            let row = [1.0, *x, *y];
            for i in 0..3 {
                right[i] += row[i] * to[c];
                (0..3).for_each(|j| normal[3 * i + j] += row[i] * row[j]);
            }
        }
        let solved = Cholesky::new(&normal, 3)?.solve(&right);
        *map = [solved[0], solved[1], solved[2]];
    }
    Some(map)
}

/// The merged photographs as marks are found in them.
fn grey(radiance: &Radiance) -> Grey {
    let grey = Grey::darkest(&radiance.value, radiance.width, radiance.height);
    let cut = |v: &f32| if v.is_finite() { v.min(BRIGHT) } else { BRIGHT };
    Grey { values: grey.values.iter().map(cut).collect(), ..grey }
}

#[cfg(test)]
mod tests {
    use super::*;
    use observe::Silent;
    use press::chart;
    use press::layout::{Layout, arrange};
    use protocol::paper::Paper;

    #[test]
    fn patches_of_a_chart_are_its_stacks_and_not_its_letters() {
        for can in [None, Some("50".parse().unwrap()), Some("37x110".parse().unwrap())] {
            let stacks: Vec<Stack> = ["substrate", "K", "MS", "MS+C"].map(|s| s.parse().unwrap()).to_vec();
            let dots = chart::stacks(&stacks, Paper::A4, can).unwrap();
            let layout = Layout { camera_marks: true, ..Layout::centred(Paper::A4) };
            let sheet = arrange(&dots, &layout, &Silent).unwrap().sheet;
            let chart = ChartOnSample::new(sheet.dots()).unwrap();
            // Bare paper is the last, within its frame.
            let found: Vec<Stack> = chart.stacks();
            assert_eq!((&found[..3], &found[3..]), (&stacks[1..], &stacks[..1]));
            let wide = can.map_or(20.0, |can: chart::Can| 1.8 * can.radius);
            for (stack, area) in &chart.patches {
                let frame = if stack.layers().is_empty() { 20.0 / DOTS_PER_MM } else { 0.0 };
                assert!((area.width as f64 / DOTS_PER_MM + frame - wide).abs() < 0.1, "{area:?}");
            }
            // Marks above and below are part of the print.
            if let Some(height) = can.and_then(|can| can.height) {
                assert!(sheet.dots().length() as f64 / DOTS_PER_MM < 297.0);
                let marks = 2.0 * (press::layout::camera::SIDE + press::layout::camera::QUIET) as f64;
                assert!((dots.length() as f64 + marks) / DOTS_PER_MM <= height);
            }
        }
    }

    #[test]
    fn sheets_that_are_no_charts_of_stacks_are_refused() {
        let dots =
            chart::registration(&[protocol::ink::Ink::Black, protocol::ink::Ink::Cyan], Paper::A4).unwrap();
        let layout = Layout { camera_marks: true, ..Layout::centred(Paper::A4) };
        let sheet = arrange(&dots, &layout, &Silent).unwrap().sheet;
        let said = ChartOnSample::new(sheet.dots()).err().unwrap().to_string();
        assert!(said.contains("sample.chart") && said.contains("foilpress chart stacks"), "{said}");
    }
}
