//! The reflectance of a document or a printed sheet, averaged over each pixel of a picture.
//!
//! Problem: a page has 30 million dots of up to 57 stacks, and a document may have as many pixels of
//! curves. Neither fits in memory as reflectance.
//! Method: pictures are made line by line, and a pixel is the mean over exactly the area it covers, with
//! parts of dots and of pixels at its edges. A line of a sheet is a histogram of stacks for each pixel
//! times the stacks' rows. A line of a factored document averages weights first. A line of any other
//! document averages reflectance, at up to `samples` x `samples` places of a pixel.
//! Cost: one increment a dot, then one multiply-add for each column and stack in the pixel.
//! Limits: averaging is linear in reflectance, as section 4.2 of the 2009 paper assumes of halftones.

use rayon::prelude::*;

use appearance::brdf::{Space, Table};
use appearance::document::Materials;
use appearance::factor::Factored;
use appearance::materials::Cover;
use appearance::weights::ONE;
use sheet::{Area, DotMap};

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
        /// The reflectance (1/sr) of the dots' stacks: one row for each of [`DotMap::stacks`], in their
        /// order.
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

    /// A picture in which each pixel has a whole number of dots a side, or each dot a whole number of
    /// pixels, so that it shows no pattern that the dots do not have: the source without what is left of a
    /// pixel at the right and below, and the size in pixels, at most `longest`. Sources without dots stay
    /// as they are.
    pub fn in_whole_dots(&self, longest: usize) -> (Source<'a>, (usize, usize)) {
        let &Source::Print { dots, space, stacks, area } = self else { return (*self, self.fit(longest)) };
        let most = area.width.max(area.length).max(1);
        if most <= longest {
            let times = longest / most;
            return (*self, (area.width * times, area.length * times));
        }
        let side = most.div_ceil(longest);
        let [width, height] = [area.width, area.length].map(|dots| (dots / side).max(1));
        let whole =
            Area { width: area.width.min(width * side), length: area.length.min(height * side), ..area };
        (Source::Print { dots, space, stacks, area: whole }, (width, height))
    }

    /// The share of each basis or stack in every pixel of a `width` x `height` picture, row by row, as many
    /// values a pixel as there are bases or stacks. `None` for a document that is not factored.
    ///
    /// # Errors
    /// A size out of range, or tables that do not match each other.
    pub fn shares(&self, width: usize, height: usize) -> Result<Option<Vec<f32>>, PreviewError> {
        let lines = self.lines(width, height, 1)?;
        let Some(channels) = lines.table().map(Table::len) else { return Ok(None) };
        let mut all = vec![0.0; width * height * channels];
        all.par_chunks_exact_mut(width * channels).enumerate().for_each_init(
            Scratch::default,
            |scratch, (y, out)| {
                let mut pixels = out.chunks_exact_mut(channels);
                lines.each(y, scratch, |mean| {
                    if let (Some(out), Mean::Shares(shares)) = (pixels.next(), mean) {
                        out.copy_from_slice(shares);
                    }
                });
            },
        );
        Ok(Some(all))
    }

    /// Prepares reading it line by line as `width` x `height` pixels.
    ///
    /// `samples` limits the places averaged along each axis of a pixel of [`Source::Document`]; other
    /// sources are averaged exactly, by area.
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
        let across = (0..width).map(|x| Cover::new(x, width, self.size().0)).collect();
        Ok(Lines { source: *self, width, height, samples: samples.max(1), columns, rows, across })
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
    /// What each pixel of a line covers across.
    across: Vec<Cover>,
}

/// Memory for one line, reused for the next.
#[derive(Default)]
pub(super) struct Scratch {
    counts: Vec<u32>,
    sums: Vec<u64>,
    shares: Vec<f32>,
    mean: Vec<f32>,
}

/// The mean over one pixel.
pub(super) enum Mean<'a> {
    /// The share of each stack, or of each basis.
    Shares(&'a [f32]),
    /// The reflectance (1/sr), a row of the space.
    Row(&'a [f32]),
}

impl<'a> Lines<'a> {
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

    /// The reflectance of what pixels are mixed of, row by row: stacks or bases. Documents have none.
    pub fn table(&self) -> Option<&'a Table> {
        match self.source {
            Source::Document(_) => None,
            Source::Factored(factored) => Some(&factored.bases),
            Source::Print { stacks, .. } => Some(stacks),
        }
    }

    /// Writes the mean reflectance (1/sr) of line `y` to `out`, which has `width * columns` places.
    pub fn read(&self, y: usize, scratch: &mut Scratch, out: &mut [f32]) {
        let mut pixels = out.chunks_exact_mut(self.columns);
        self.each(y, scratch, |mean| {
            let Some(out) = pixels.next() else { return };
            match mean {
                Mean::Row(row) => out.copy_from_slice(row),
                Mean::Shares(shares) => self.mix(shares, out),
            }
        });
    }

    /// Calls `each` with the mean over every pixel of line `y`, from the left.
    pub fn each(&self, y: usize, scratch: &mut Scratch, each: impl FnMut(Mean)) {
        let line = Cover::new(y, self.height, self.source.size().1);
        match &self.source {
            Source::Document(materials) => self.each_document(*materials, &line, scratch, each),
            Source::Factored(factored) => self.each_factored(factored, &line, scratch, each),
            Source::Print { dots, area, .. } => self.each_print(dots, area, &line, scratch, each),
        }
    }

    /// The sum of the parts of a pixel.
    fn whole(&self) -> f64 {
        let (across, down) = self.source.size();
        across as f64 * down as f64
    }

    fn each_factored(
        &self,
        factored: &Factored,
        line: &Cover,
        scratch: &mut Scratch,
        mut each: impl FnMut(Mean),
    ) {
        let maps = &factored.maps;
        let scale = (1.0 / self.whole() / f64::from(ONE)) as f32;
        for cover in &self.across {
            scratch.sums.clear();
            scratch.sums.resize(maps.channels(), 0);
            for py in line.places.0..line.places.1 {
                for px in cover.places.0..cover.places.1 {
                    let part = u64::from(line.share(py)) * u64::from(cover.share(px));
                    let weights = maps.at(py * maps.width() + px);
                    scratch.sums.iter_mut().zip(weights).for_each(|(s, &w)| *s += part * u64::from(w));
                }
            }
            scratch.shares.clear();
            scratch.shares.extend(scratch.sums.iter().map(|&sum| sum as f32 * scale));
            each(Mean::Shares(&scratch.shares));
        }
    }

    fn each_print(
        &self,
        dots: &DotMap,
        area: &Area,
        line: &Cover,
        scratch: &mut Scratch,
        mut each: impl FnMut(Mean),
    ) {
        let scale = (1.0 / self.whole()) as f32;
        let stacks = dots.stacks().len();
        scratch.counts.clear();
        scratch.counts.resize(self.width * stacks, 0);
        for row in line.places.0..line.places.1 {
            let start = (area.top + row) * dots.width() + area.left;
            let dots = &dots.index()[start..start + area.width];
            // A page has fewer than 2^32 dots, so no sum of parts overflows.
            let down = line.share(row);
            for (cover, counts) in self.across.iter().zip(scratch.counts.chunks_exact_mut(stacks)) {
                let (from, to) = cover.places;
                counts[usize::from(dots[from])] += down * cover.ends.0;
                if to - from > 1 {
                    counts[usize::from(dots[to - 1])] += down * cover.ends.1;
                    for &dot in &dots[from + 1..to - 1] {
                        counts[usize::from(dot)] += down * cover.whole;
                    }
                }
            }
        }
        for counts in scratch.counts.chunks_exact(stacks) {
            scratch.shares.clear();
            scratch.shares.extend(counts.iter().map(|&n| n as f32 * scale));
            each(Mean::Shares(&scratch.shares));
        }
    }

    fn mix(&self, shares: &[f32], out: &mut [f32]) {
        out.fill(0.0);
        for (&share, row) in shares.iter().zip(self.rows.chunks_exact(self.columns)) {
            if share > 0.0 {
                out.iter_mut().zip(row).for_each(|(o, &r)| *o += share * r);
            }
        }
    }

    fn each_document(
        &self,
        materials: &dyn Materials,
        line: &Cover,
        scratch: &mut Scratch,
        mut each: impl FnMut(Mean),
    ) {
        scratch.mean.resize(self.columns, 0.0);
        let mean = &mut scratch.mean;
        for cover in &self.across {
            let shares =
                |cover: &Cover| cover.sampled(self.samples).map(|(_, share)| f64::from(share)).sum::<f64>();
            let whole = (shares(line) * shares(cover)) as f32;
            mean.fill(0.0);
            for (py, down) in line.sampled(self.samples) {
                for (px, across) in cover.sampled(self.samples) {
                    materials.add(py * materials.width() + px, down as f32 * across as f32 / whole, mean);
                }
            }
            each(Mean::Row(mean));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use appearance::weights::{WeightMaps, quantise};
    use inks::Stack;
    use proptest::prelude::*;
    use protocol::paper::Paper;
    use sheet::Sheet;

    proptest! {
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
                    // Every dot as width x height smaller ones, which belong wholly to one pixel.
                    let all = (y * 7..(y + 1) * 7)
                        .flat_map(|v| (x * 9..(x + 1) * 9).map(move |u| (u / width + 2) + (v / height + 1) * 12));
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
