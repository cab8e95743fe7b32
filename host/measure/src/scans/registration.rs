//! Where a printer starts, how far it feeds and how askew the sheet goes through, from scans of the registration chart.
//!
//! Problem: a ruler reads to a quarter of a millimetre, and cannot say how far the print is turned. Method: the corners of the camera
//! marks in millimetres of the scan, against the left and the top edge of the sheet, which are fitted by lines; the marks'
//! dots say where they should be. Offset, feed and skew follow by least squares. Cost: that of finding marks. Limits: lengths are
//! as exact as the scanner's own; the sheet's edges must stand out from something dark behind them.

use std::path::{Path, PathBuf};

use inks::Library;
use observe::Observer;
use press::layout::Profile;
use protocol::paper::LEFT;
use serde::Serialize;
use sheet::{DOTS_PER_MM, Sheet};

use super::resolution;
use super::scan::Scan;
use crate::MeasureError;
use crate::geometry::grey::Grey;
use crate::geometry::marks::{Line, profile};
use crate::geometry::sheet_marks::SheetMarks;
use crate::linalg::{Cholesky, median};

/// Profiles across an edge of the sheet.
const PROFILES: usize = 160;
/// What is darker than this part of the paper is not the sheet: a scanner's light would fall off by half as
/// much at most (decisions/dots-from-scans.md).
const DARK: f64 = 0.7;
/// Over how many mm it has to be so dark, so that dust and a printed line are no edge.
const BEYOND: f64 = 1.0;
/// Half the length of a profile across the edge, in mm.
const REACH: f64 = 0.4;
/// From a mark outward to where the search for the edge starts, in mm, so that the mark's own side is not
/// taken for it.
const START: f64 = 0.6;
/// A resolution that differs more from the one that the marks show is not that of the scan: one that a
/// program changed would be off by more.
const SCALE: f64 = 0.03;
/// Across, a print is as long as its dots say, within this part.
const ACROSS: f64 = 0.006;

/// What one scan says.
#[derive(Clone, Debug, Serialize)]
pub struct Placed {
    /// The file.
    pub scan: String,
    /// How far to the right and down of its place the print is, in mm: across in the middle of the sheet's length, down at its
    /// first row in the middle of its width.
    pub offset_mm: [f64; 2],
    /// The measured length of 1 mm along the feed.
    pub feed: f64,
    /// The measured length of 1 mm across.
    pub across: f64,
    /// By how much the print is turned on the sheet, clockwise, in degrees.
    pub skew_deg: f64,
    /// How far the marks' corners are from where these figures say, in mm.
    pub residual_mm: f64,
}

/// What all scans say together.
#[derive(Clone, Debug, Serialize)]
pub struct Registration {
    /// Each scan.
    pub scans: Vec<Placed>,
    /// The profile they give.
    pub profile: Profile,
    /// How far scans are apart: the largest difference of offsets in mm; none for a single scan.
    pub apart_mm: Option<f64>,
}

/// Reads scans of the registration chart that was printed as `sheet`. `dpi` overrides what the files state.
///
/// # Errors
/// Scans that cannot be read, show another sheet, part of it or none, or are mirrored; an unknown resolution; edges of the
/// sheet that are not seen.
pub fn measure(
    scans: &[PathBuf],
    sheet: &Sheet,
    library: &Library,
    dpi: Option<f64>,
    observer: &dyn Observer,
) -> Result<Registration, MeasureError> {
    let marks = SheetMarks::find(sheet.dots(), library)?;
    observer.begin("scans", scans.len() as u64);
    let mut placed = Vec::new();
    for path in scans {
        placed.push(one(path, sheet, &marks, dpi)?);
        observer.advance(1);
    }
    observer.end();
    let mean = |of: &dyn Fn(&Placed) -> f64| placed.iter().map(of).sum::<f64>() / placed.len().max(1) as f64;
    let round = |value: f64, steps: f64| (value * steps).round() / steps;
    let profile = Profile {
        offset_mm: [0, 1].map(|c| round(mean(&|p| p.offset_mm[c]), 1e3)),
        feed: round(mean(&|p| p.feed), 1e5),
        skew_deg: round(mean(&|p| p.skew_deg), 1e3),
    };
    let apart_mm = (placed.len() > 1).then(|| {
        let apart =
            |a: &Placed, b: &Placed| (a.offset_mm[0] - b.offset_mm[0]).hypot(a.offset_mm[1] - b.offset_mm[1]);
        placed.iter().flat_map(|a| placed.iter().map(move |b| apart(a, b))).fold(0.0, f64::max)
    });
    Ok(Registration { scans: placed, profile, apart_mm })
}

fn one(path: &Path, sheet: &Sheet, marks: &SheetMarks, dpi: Option<f64>) -> Result<Placed, MeasureError> {
    let wrong = |problem: String| MeasureError::photo(path, problem);
    let scan = Scan::read(path, marks, None)?;
    let shown = scan.scales();
    let stated = match dpi {
        Some(dpi) => [dpi; 2],
        None => resolution::dpi(path)?.ok_or_else(|| {
            wrong("the file does not state its resolution; give the scanner's with --dpi".into())
        })?,
    };
    let shown_dpi = shown.map(|v| v * 25.4);
    // A sheet that lies on its side has the file's other number across.
    let upright = upright(&scan);
    let per_mm = stated.map(|v| v / 25.4);
    let along = if upright { shown_dpi } else { [shown_dpi[1], shown_dpi[0]] };
    if (0..2).any(|c| (stated[c] / along[c] - 1.0).abs() > SCALE) {
        return Err(wrong(format!(
            "{:.0} x {:.0} dpi, but its camera marks are as large as at {:.0} dpi; give the scanner's resolution with --dpi, and scan the \
             sheet flat, not with a camera",
            stated[0],
            stated[1],
            0.5 * (along[0] + along[1])
        )));
    }
    // Pixels that are squares of a mm, so that angles are angles.
    let mm = |[x, y]: [f64; 2]| [x / per_mm[0], y / per_mm[1]];
    let edges = edges(path, &scan, per_mm)?;
    let (left, top) = (edges[0].in_mm(per_mm), edges[1].in_mm(per_mm));
    // Where dots are on the sheet as it should be, from its left and top edge.
    let nominal = |[x, y]: [f64; 2]| {
        [(x + f64::from(LEFT)) / DOTS_PER_MM, (y + f64::from(sheet.paper().top())) / DOTS_PER_MM]
    };
    let middle = nominal([sheet.width() as f64 / 2.0, sheet.length() as f64 / 2.0]);
    let first = nominal([0.0, 0.0])[1];
    let (mut across, mut down) = (Vec::new(), Vec::new());
    for (mark, dots) in &scan.marks {
        for (pixel, dot) in mark.corners.iter().zip(dots) {
            let (seen, [x, y]) = (mm(*pixel), nominal(*dot));
            across.push(([1.0, x - middle[0], y - middle[1]], left.distance(seen) - middle[0]));
            down.push(([1.0, y - first, x - middle[0]], top.distance(seen) - first));
        }
    }
    let flat = || wrong("its camera marks lie in one line; take it again".into());
    let (across, off_x) = fitted(&across).ok_or_else(flat)?;
    let (down, off_y) = fitted(&down).ok_or_else(flat)?;
    let placed = Placed {
        scan: path.file_name().unwrap_or_default().to_string_lossy().into_owned(),
        offset_mm: [across[0], down[0]],
        feed: down[1],
        across: across[1],
        skew_deg: (0.5 * (down[2] - across[2])).atan().to_degrees(),
        residual_mm: off_x.hypot(off_y),
    };
    if (placed.across - 1.0).abs() > ACROSS {
        return Err(wrong(format!(
            "the print is {:.2} % {} than its dots say across the sheet; check the scanner's resolution (--dpi)",
            100.0 * (placed.across - 1.0).abs(),
            if placed.across > 1.0 { "wider" } else { "narrower" }
        )));
    }
    Ok(placed)
}

/// Whether rows of the print are nearer to rows of the scan than to its columns.
fn upright(scan: &Scan) -> bool {
    scan.marks.first().is_none_or(|(mark, _)| {
        let [a, b] = [mark.corners[0], mark.corners[1]];
        (b[0] - a[0]).abs() >= (b[1] - a[1]).abs()
    })
}

/// Least squares of three unknowns, and the root mean square of what remains.
fn fitted(rows: &[([f64; 3], f64)]) -> Option<([f64; 3], f64)> {
    let (mut normal, mut right) = (vec![0.0; 9], vec![0.0; 3]);
    for (row, value) in rows {
        for i in 0..3 {
            right[i] += row[i] * value;
            (0..3).for_each(|j| normal[3 * i + j] += row[i] * row[j]);
        }
    }
    let solved = Cholesky::new(&normal, 3)?.solve(&right);
    let off = |(row, value): &([f64; 3], f64)| {
        (value - row.iter().zip(&solved).map(|(a, b)| a * b).sum::<f64>()).powi(2)
    };
    let rest = (rows.iter().map(off).sum::<f64>() / rows.len() as f64).sqrt();
    Some(([solved[0], solved[1], solved[2]], rest))
}

/// An edge of the sheet as a line, and which way the sheet is.
struct Edge {
    line: Line,
    inward: [f64; 2],
}

impl Edge {
    /// The same in mm.
    fn in_mm(&self, per_mm: [f64; 2]) -> Edge {
        let scaled = |v: [f64; 2]| [v[0] / per_mm[0], v[1] / per_mm[1]];
        let along = scaled(self.line.along);
        let length = along[0].hypot(along[1]);
        Edge {
            line: Line { at: scaled(self.line.at), along: along.map(|v| v / length) },
            inward: scaled(self.inward),
        }
    }

    /// How far inward a place is.
    fn distance(&self, [x, y]: [f64; 2]) -> f64 {
        let ([ax, ay], [dx, dy]) = (self.line.at, self.line.along);
        let side = |[x, y]: [f64; 2]| dx * y - dy * x;
        side([x - ax, y - ay]) * side(self.inward).signum()
    }
}

/// The left and the top edge of the sheet in pixels.
fn edges(path: &Path, scan: &Scan, per_mm: [f64; 2]) -> Result<[Edge; 2], MeasureError> {
    let pixel = 0.5 * (per_mm[0] + per_mm[1]);
    // Corners of the block of marks, in dots.
    let all = || scan.marks.iter().flat_map(|(_, corners)| corners);
    let end = |c: usize| {
        let least = all().map(|p| p[c]).fold(f64::MAX, f64::min);
        (least, all().map(|p| p[c]).fold(f64::MIN, f64::max))
    };
    let [(left, right), (top, bottom)] = [end(0), end(1)];
    let find = |name: &str, from: [f64; 2], to: [f64; 2], inside: [f64; 2]| -> Result<Edge, MeasureError> {
        let [a, b, c] = [from, to, inside].map(|p| scan.pixel(p));
        let toward = [c[0] - a[0], c[1] - a[1]];
        // At right angles to the side, outward.
        let along = unit([b[0] - a[0], b[1] - a[1]]);
        let mut out = [along[1], -along[0]];
        if out[0] * toward[0] + out[1] * toward[1] > 0.0 {
            out = out.map(|v| -v);
        }
        let inward = out.map(|v| -v);
        let points: Vec<[f64; 2]> = (0..PROFILES)
            .filter_map(|i| {
                let t = (i as f64 + 0.5) / PROFILES as f64;
                let start = [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])];
                crossing(&scan.grey, start, out, pixel)
            })
            .filter_map(|at| {
                // The step from dark to bright, inward.
                let shift = profile(&scan.grey, at, inward, REACH * pixel)?;
                Some([at[0] + shift * inward[0], at[1] + shift * inward[1]])
            })
            .collect();
        let seen = points.len();
        let line = (seen >= PROFILES / 2).then(|| Line::fit(points)).flatten();
        line.map(|line| Edge { line, inward }).ok_or_else(|| {
            MeasureError::photo(
                path,
                format!(
                    "the {name} edge of the sheet is not seen; lay something black behind the sheet, and scan it with all its edges inside the \
                     picture"
                ),
            )
        })
    };
    Ok([
        find("left", [left, top], [left, bottom], [right, top])?,
        find("top", [left, top], [right, top], [left, bottom])?,
    ])
}

fn unit(v: [f64; 2]) -> [f64; 2] {
    let length = v[0].hypot(v[1]);
    v.map(|c| c / length)
}

/// Where the light first falls, and stays low, on the way outward; `None` if it does not before the picture ends.
fn crossing(grey: &Grey, start: [f64; 2], out: [f64; 2], pixel: f64) -> Option<[f64; 2]> {
    let at = |s: f64| grey.at([start[0] + s * out[0], start[1] + s * out[1]]);
    let (from, step) = (START * pixel, 0.5);
    let mut paper: Vec<f64> = (0..8).filter_map(|k| at(from + f64::from(k) * 0.1 * pixel)).collect();
    if paper.len() < 8 {
        return None;
    }
    let limit = DARK * median(&mut paper);
    let needed = (BEYOND * pixel / step) as usize;
    let (mut s, mut dark) = (from, 0);
    // Ends at the border of the picture.
    while let Some(value) = at(s) {
        dark = if value < limit { dark + 1 } else { 0 };
        if dark >= needed {
            let first = s - (dark - 1) as f64 * step;
            return Some([start[0] + first * out[0], start[1] + first * out[1]]);
        }
        s += step;
    }
    None
}
