//! The reflectance of a document or a printed sheet, averaged over each pixel of a picture.
//!
//! Problem: a page has 30 million dots of up to 57 stacks, and a document may have as many pixels of curves. Neither fits in
//! memory as reflectance.
//! Method: pictures are made line by line. A line of a sheet is a histogram of stacks for each pixel (every dot is counted
//! once, in exactly one pixel) times the stacks' rows. A line of a factored document averages weights first. A line of any
//! other document averages reflectance at up to `samples` x `samples` places of a pixel.
//! Cost: one increment a dot, then one multiply-add for each column and stack in the pixel.
//! Limits: averaging is linear in reflectance, as section 4.2 of the 2009 paper assumes of halftones.

use crate::sheet::{Area, DotMap};
use appearance::brdf::{Space, Table};
use appearance::document::Materials;
use appearance::factor::Factored;
use appearance::weights::ONE;

use super::error::{PreviewError, check_size};

/// The content of a flat picture.
#[derive(Clone, Copy)]
pub enum Source<'a> {
    /// The target, pixel by pixel.
    Document(&'a dyn Materials),
    /// The target, factored.
    Factored(&'a Factored),
    /// An area of printed dots.
    Print {
        /// The dots.
        dots: &'a DotMap,
        /// The tabulation of `stacks`.
        space: &'a Space,
        /// The reflectance (1/sr) of the dots' stacks: one row for each of [`DotMap::stacks`], in their order.
        stacks: &'a Table,
        /// The part of the dots to show.
        area: Area,
    },
}

impl<'a> Source<'a> {
    /// The tabulation of its reflectance.
    pub fn space(&self) -> &'a Space {
        match self {
            Source::Document(materials) => materials.space(),
            Source::Factored(factored) => &factored.space,
            Source::Print { space, .. } => space,
        }
    }

    /// Its own size in pixels or dots, across and down.
    pub fn size(&self) -> (usize, usize) {
        match self {
            Source::Document(materials) => (materials.width(), materials.height()),
            Source::Factored(factored) => (factored.maps.width(), factored.maps.height()),
            Source::Print { area, .. } => (area.width, area.length),
        }
    }

    /// The size in pixels of a picture in the source's proportions, with `longest` pixels on its longer side.
    pub fn fit(&self, longest: usize) -> (usize, usize) {
        let (w, h) = self.size();
        let side = |part: usize, whole: usize| (part * longest + whole / 2) / whole.max(1);
        (side(w, w.max(h)).max(1), side(h, w.max(h)).max(1))
    }

    /// Prepares reading it line by line as `width` x `height` pixels.
    ///
    /// `samples` limits the places averaged along each axis of a pixel of [`Source::Document`]; other sources are averaged
    /// exactly. A picture finer than the source repeats the source's pixels.
    pub(super) fn lines(
        &self,
        width: usize,
        height: usize,
        samples: usize,
    ) -> Result<Lines<'a>, PreviewError> {
        check_size(width, height)?;
        if let (Source::Document(_), (across, down)) = (self, self.size())
            && (across == 0 || down == 0)
        {
            return Err(PreviewError::Size { width: across, height: down });
        }
        let columns = self.space().columns();
        let table = match self {
            Source::Document(_) => None,
            Source::Factored(factored) => {
                same("bases of the factored document", factored.maps.channels(), factored.bases.len())?;
                Some(&factored.bases)
            }
            Source::Print { dots, stacks, area, .. } => {
                let (width, length) = (dots.width(), dots.length());
                if !area.fits(width, length) {
                    return Err(PreviewError::Area { area: *area, width, length });
                }
                same("rows of the stacks' reflectance", dots.stacks().len(), stacks.len())?;
                Some(*stacks)
            }
        };
        if let Some(table) = table {
            same("columns of the reflectance", columns, table.columns())?;
        }
        let rows = table.map_or_else(Vec::new, |t| t.rows().flatten().map(|&v| v as f32).collect());
        Ok(Lines { source: *self, width, height, samples: samples.max(1), columns, rows })
    }
}

fn same(what: &'static str, expected: usize, found: usize) -> Result<(), PreviewError> {
    if expected == found { Ok(()) } else { Err(PreviewError::Shape { what, expected, found }) }
}

/// A source to read line by line at one size.
pub(super) struct Lines<'a> {
    source: Source<'a>,
    width: usize,
    height: usize,
    samples: usize,
    columns: usize,
    rows: Vec<f32>,
}

/// Memory for one line, reused for the next.
#[derive(Default)]
pub(super) struct Scratch {
    counts: Vec<u32>,
    sums: Vec<u64>,
    row: Vec<f32>,
}

/// The range of dots (of `size`) in pixel `i` (of `pixels`): every dot is in exactly one pixel, and a pixel smaller than a dot
/// has the dot in which it starts.
fn span(i: usize, pixels: usize, size: usize) -> (usize, usize) {
    let start = i * size / pixels;
    (start, ((i + 1) * size / pixels).max(start + 1))
}

impl Lines<'_> {
    /// Columns of the reflectance of a pixel.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Pixels across.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Pixels down.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Writes the mean reflectance (1/sr) of line `y` to `out`, which has `width * columns` places.
    pub fn read(&self, y: usize, scratch: &mut Scratch, out: &mut [f32]) {
        match &self.source {
            Source::Document(materials) => self.read_document(*materials, y, scratch, out),
            Source::Factored(factored) => {
                let maps = &factored.maps;
                let (y0, y1) = span(y, self.height, maps.height());
                for (x, out) in out.chunks_exact_mut(self.columns).enumerate() {
                    let (x0, x1) = span(x, self.width, maps.width());
                    scratch.sums.clear();
                    scratch.sums.resize(maps.channels(), 0);
                    for py in y0..y1 {
                        for px in x0..x1 {
                            let weights = maps.at(py * maps.width() + px);
                            scratch.sums.iter_mut().zip(weights).for_each(|(s, &w)| *s += u64::from(w));
                        }
                    }
                    let scale = 1.0 / (f32::from(ONE) * ((y1 - y0) * (x1 - x0)) as f32);
                    self.mix(scratch.sums.iter().map(|&s| s as f32 * scale), out);
                }
            }
            Source::Print { dots, area, .. } => {
                let stacks = dots.stacks().len();
                scratch.counts.clear();
                scratch.counts.resize(self.width * stacks, 0);
                let (y0, y1) = span(y, self.height, area.length);
                for row in y0..y1 {
                    let start = (area.top + row) * dots.width() + area.left;
                    let line = &dots.index()[start..start + area.width];
                    for (x, counts) in scratch.counts.chunks_exact_mut(stacks).enumerate() {
                        let (x0, x1) = span(x, self.width, area.width);
                        for &dot in &line[x0..x1] {
                            counts[usize::from(dot)] += 1;
                        }
                    }
                }
                let pixels = out.chunks_exact_mut(self.columns).zip(scratch.counts.chunks_exact(stacks));
                for (x, (out, counts)) in pixels.enumerate() {
                    let (x0, x1) = span(x, self.width, area.width);
                    let scale = 1.0 / ((y1 - y0) * (x1 - x0)) as f32;
                    self.mix(counts.iter().map(|&n| n as f32 * scale), out);
                }
            }
        }
    }

    fn mix(&self, shares: impl Iterator<Item = f32>, out: &mut [f32]) {
        out.fill(0.0);
        for (share, row) in shares.zip(self.rows.chunks_exact(self.columns)) {
            if share > 0.0 {
                out.iter_mut().zip(row).for_each(|(o, &r)| *o += share * r);
            }
        }
    }

    fn read_document(&self, materials: &dyn Materials, y: usize, scratch: &mut Scratch, out: &mut [f32]) {
        let (w, h) = (materials.width(), materials.height());
        let (y0, y1) = span(y, self.height, h);
        let down = (y1 - y0).min(self.samples);
        scratch.row.resize(self.columns, 0.0);
        let row = &mut scratch.row;
        for (x, out) in out.chunks_exact_mut(self.columns).enumerate() {
            let (x0, x1) = span(x, self.width, w);
            let across = (x1 - x0).min(self.samples);
            out.fill(0.0);
            let scale = 1.0 / (down * across) as f32;
            for j in 0..down {
                // The centres of equal parts, so that the places are spread evenly.
                let py = y0 + (2 * j + 1) * (y1 - y0) / (2 * down);
                for i in 0..across {
                    let px = x0 + (2 * i + 1) * (x1 - x0) / (2 * across);
                    materials.reflectance(py * w + px, row);
                    out.iter_mut().zip(row.iter()).for_each(|(o, &r)| *o += scale * r);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sheet::Sheet;
    use appearance::weights::{WeightMaps, quantise};
    use inks::Stack;
    use proptest::prelude::*;
    use protocol::paper::Paper;

    proptest! {
        #[test]
        fn every_dot_is_in_exactly_one_pixel(size in 1usize..300, pixels in 1usize..300) {
            let mut times = vec![0; size];
            for i in 0..pixels.min(size) {
                let (start, end) = span(i, pixels.min(size), size);
                times[start..end].iter_mut().for_each(|t| *t += 1);
            }
            prop_assert!(times.iter().all(|&t| t == 1));
            for i in 0..pixels {
                let (start, end) = span(i, pixels, size);
                prop_assert!(start < end && end <= size);
            }
        }

        #[test]
        fn a_line_of_a_sheet_is_the_mean_of_its_dots(
            dots in prop::collection::vec(0u8..3, 12 * 9), width in 1usize..15, height in 1usize..12,
        ) {
            let space = Space::half_angle(2);
            let stacks: Vec<Stack> = ["substrate", "C", "MS"].iter().map(|s| s.parse().unwrap()).collect();
            let mut rows = Table::new(6);
            (0..3).for_each(|k| rows.push(&[0.0, 1.0, 2.0, 3.0, 4.0, 5.0].map(|v| v * f64::from(k + 1))));
            let paper = Paper::Custom { width: 12, length: 9 };
            let sheet = Sheet::new(paper, stacks, dots.clone()).unwrap();
            let area = Area { left: 2, top: 1, width: 9, length: 7 };
            let print = Source::Print { dots: sheet.dots(), space: &space, stacks: &rows, area };
            let lines = print.lines(width, height, 1).unwrap();
            let mut out = vec![0.0; width * 6];
            let mut scratch = Scratch::default();
            for y in 0..height {
                lines.read(y, &mut scratch, &mut out);
                for x in 0..width {
                    let (x0, x1) = (x * 9 / width, ((x + 1) * 9 / width).max(x * 9 / width + 1));
                    let (y0, y1) = (y * 7 / height, ((y + 1) * 7 / height).max(y * 7 / height + 1));
                    let all = (y0..y1).flat_map(|y| (x0..x1).map(move |x| (x + 2) + (y + 1) * 12));
                    let mean = all.clone().map(|i| f64::from(dots[i]) + 1.0).sum::<f64>() / all.count() as f64;
                    for (j, &found) in out[x * 6..][..6].iter().enumerate() {
                        prop_assert!((f64::from(found) - mean * j as f64).abs() < 1e-4);
                    }
                }
            }
        }
    }

    /// A factored document as any other document.
    struct Expanded<'a>(&'a Factored);

    impl Materials for Expanded<'_> {
        fn width(&self) -> usize {
            self.0.maps.width()
        }
        fn height(&self) -> usize {
            self.0.maps.height()
        }
        fn space(&self) -> &Space {
            &self.0.space
        }
        fn reflectance(&self, pixel: usize, out: &mut [f32]) {
            for (j, out) in out.iter_mut().enumerate() {
                let terms = self.0.maps.at(pixel).iter().zip(self.0.bases.rows());
                *out = terms.map(|(&w, b)| f32::from(w) / f32::from(ONE) * b[j] as f32).sum();
            }
        }
    }

    #[test]
    fn a_factored_document_reads_like_the_same_document_expanded() {
        let space = Space::half_angle(3);
        let mut bases = Table::new(9);
        (0..3).for_each(|k| bases.push(&[f64::from(k) + 0.5; 9]));
        let (w, h) = (10, 7);
        let mut data = vec![0; w * h * 3];
        for (i, weights) in data.chunks_exact_mut(3).enumerate() {
            quantise(&[i as f64, (i * 7 % 11) as f64, 3.0], weights);
        }
        let factored = Factored { space, bases, maps: WeightMaps::new(w, h, 3, data).unwrap() };
        let expanded = Expanded(&factored);
        for (width, height) in [(10, 7), (4, 3), (23, 9), (1, 1)] {
            let read = |source: Source| {
                let lines = source.lines(width, height, 64).unwrap();
                let mut out = vec![0.0; width * 9];
                let mut all = Vec::new();
                for y in 0..height {
                    lines.read(y, &mut Scratch::default(), &mut out);
                    all.extend_from_slice(&out);
                }
                all
            };
            let pairs = read(Source::Factored(&factored)).into_iter().zip(read(Source::Document(&expanded)));
            for (a, b) in pairs {
                assert!((a - b).abs() < 1e-5, "{width} x {height}: {a} {b}");
            }
        }
    }

    #[test]
    fn what_does_not_fit_is_named() {
        let space = Space::half_angle(2);
        let sheet =
            Sheet::new(Paper::Custom { width: 4, length: 4 }, vec![Stack::SUBSTRATE], vec![0; 16]).unwrap();
        let mut one = Table::new(6);
        one.push(&[0.1; 6]);
        let print = |stacks, area| Source::Print { dots: sheet.dots(), space: &space, stacks, area };
        let outside = Area { left: 2, top: 0, width: 3, length: 4 };
        let error = print(&one, outside).lines(4, 4, 1).err().unwrap().to_string();
        assert!(error.contains("(2, 0)") && error.contains("4 x 4"), "{error}");
        let none = Table::new(6);
        let error = print(&none, Area::whole(sheet.dots())).lines(4, 4, 1).err().unwrap().to_string();
        assert!(error.contains("expected 1, found 0"), "{error}");
        let narrow = Table::new(3);
        assert!(print(&narrow, Area::whole(sheet.dots())).lines(4, 4, 1).is_err());
        let error = print(&one, Area::whole(sheet.dots())).lines(0, 1 << 20, 1).err().unwrap().to_string();
        assert!(error.contains("0 x 1048576"), "{error}");
    }
}
