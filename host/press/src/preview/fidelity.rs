//! The difference between print and document, seen by an eye at a distance.
//!
//! Problem: no halftone resembles its document dot by dot. The eye averages before it compares.
//! Method: the reflectance of both is averaged over the spot that the eye averages over, and the distance of the metric
//! (eqs. 2-3 of the 2009 paper's appendix) is computed at every spot. Nasanen's low-pass
//! `exp(-f / (0.525 ln L + 3.91))`, with f in cycles per degree and L = 11 cd/m^2, passes white noise like a window with an
//! effective area of `2 / (pi a^2)` square degrees, a = 5.17: a side of 1.35 mm at half a metre. The window here is
//! [1 2 1] (x) [1 2 1] over cells of 3/8 of that side (effective side 16/6 cells), which leaks less than a box.
//! Cost: one pass over dots and document pixels; memory for a few lines of cells.
//! Limits: one achromatic contrast model for all columns; detail finer than a cell is ignored.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

use maths::Maths;
use rayon::prelude::*;

use appearance::brdf::Space;
use appearance::wide::wide;
use observe::Observer;
use sheet::DOTS_PER_MM;

use super::error::PreviewError;
use super::source::{Lines, Scratch, Source};

/// Lines of cells in a parallel task. It is fixed, so that the order of sums does not depend on the number of threads.
const CHUNK: usize = 16;

/// Places averaged along each axis of a cell if a document is finer than the cells.
const SAMPLES: usize = 64;

/// Distances between two pictures over all spots that the eye resolves. 0.01 is barely visible, 0.05 is obvious.
#[derive(Clone, Debug, PartialEq)]
pub struct FidelityReport {
    /// Mean distance.
    pub mean: f64,
    /// Root of the mean squared distance.
    pub rmse: f64,
    /// The distance that 95 % of the spots do not exceed.
    pub p95: f64,
    /// Greatest distance.
    pub max: f64,
    /// Root of the mean squared distance in light.
    pub light_rmse: f64,
    /// Width of the map of distances.
    pub width: usize,
    /// Height of the map of distances.
    pub height: usize,
    /// The distance at every cell, row by row.
    pub map: Vec<f32>,
}

/// Where the eye is when a document and its print are compared, in metres: arm's length.
pub const EYE: f64 = 0.5;

/// Side in millimetres of the square window that the eye averages over at `metres`. See the module text.
pub fn spot_mm(metres: f64) -> f64 {
    let cycles = 0.525 * 11f64.logarithm() + 3.91;
    let degrees = (2.0 / std::f64::consts::PI).sqrt() / cycles;
    1000.0 * metres * degrees.to_radians()
}

/// Side in dots of the cells of that window; 1 or more.
fn cell_dots(metres: f64) -> usize {
    // 6/16, because the three taps 1/4, 1/2, 1/4 pass noise like a box of 16/6 cells.
    (spot_mm(metres) * DOTS_PER_MM * 6.0 / 16.0).round().max(1.0) as usize
}

/// Compares a print with its target as seen from `metres` (0.5 is arm's length). Both cover the same rectangle of
/// paper, `size` dots of 1/600 inch across and down.
///
/// # Errors
/// Different tabulations, or a table that does not match its source.
pub fn fidelity(
    target: &Source,
    print: &Source,
    size: (usize, usize),
    metres: f64,
    observer: &dyn Observer,
) -> Result<FidelityReport, PreviewError> {
    let space = target.space();
    if print.space() != space {
        return Err(PreviewError::Shape {
            what: "columns of the print's tabulation, which must be that of the target",
            expected: space.columns(),
            found: print.space().columns(),
        });
    }
    let cell = cell_dots(metres);
    let (width, height) = ((size.0 / cell).max(1), (size.1 / cell).max(1));
    let target = target.lines(width, height, SAMPLES)?;
    let print = print.lines(width, height, SAMPLES)?;
    observer.begin("comparing print and document", height as u64);
    let metric = Metric::new(space);
    let mut map = vec![0.0f32; width * height];
    let chunks = map.par_chunks_mut(width * CHUNK).enumerate().map(|(chunk, out)| {
        let first = chunk * CHUNK;
        let count = out.len() / width;
        let a = blurred(&target, first, count);
        let b = blurred(&print, first, count);
        let columns = space.columns();
        let mut light = 0.0;
        wide(
            #[inline(always)]
            || {
                for ((out, a), b) in out.iter_mut().zip(a.chunks_exact(columns)).zip(b.chunks_exact(columns))
                {
                    *out = metric.distance(a, b);
                }
            },
        );
        for (a, b) in a.chunks_exact(columns).zip(b.chunks_exact(columns)) {
            light += space.light_distance(a, b).squared();
        }
        observer.advance(count as u64);
        light
    });
    let light: Vec<f64> = chunks.collect();
    observer.end();
    let n = map.len() as f64;
    let light_rmse = (light.iter().sum::<f64>() / n).sqrt();
    let mean = map.iter().map(|&d| f64::from(d)).sum::<f64>() / n;
    let rmse = (map.iter().map(|&d| f64::from(d).squared()).sum::<f64>() / n).sqrt();
    let mut sorted = map.clone();
    sorted.sort_unstable_by(f32::total_cmp);
    let at = |share: f64| f64::from(sorted[((sorted.len() - 1) as f64 * share).round() as usize]);
    Ok(FidelityReport { mean, rmse, p95: at(0.95), max: at(1.0), light_rmse, width, height, map })
}

/// [`appearance::brdf::Space::distance`] for rows of f32, eight columns at a time. The order of sums is fixed.
struct Metric {
    /// For each column: the factor to reflected radiance, and the root of the quadrature weight.
    columns: Vec<(f32, f32)>,
}

const LANES: usize = 8;

impl Metric {
    fn new(space: &Space) -> Metric {
        let both = space.radiance().iter().zip(space.weight());
        Metric { columns: both.map(|(&c, &w)| (c as f32, w as f32)).collect() }
    }

    #[inline(always)]
    fn distance(&self, a: &[f32], b: &[f32]) -> f32 {
        let mut sums = [0.0f32; LANES];
        let rows = a.chunks(LANES).zip(b.chunks(LANES));
        for ((a, b), columns) in rows.zip(self.columns.chunks(LANES)) {
            for (((sum, &a), &b), &(c, w)) in sums.iter_mut().zip(a).zip(b).zip(columns) {
                let d = w * (cube_root(a * c) - cube_root(b * c));
                *sum += d * d;
            }
        }
        sums.iter().sum::<f32>().sqrt()
    }
}

/// The cube root of `x` to a few units in the last place. Values below 1e-30 count as 1e-30, whose root is 1e-10.
///
/// A third of the exponent, computed on the bits, is within 6 %; each of Halley's steps cubes that error. Unlike the
/// library's function, this is plain arithmetic that the compiler can vectorise. Without it, comparing a page took six times
/// as long.
#[inline(always)]
fn cube_root(x: f32) -> f32 {
    let x = x.max(1e-30);
    // Two thirds of the exponent's bias of 127, adjusted to balance the errors above and below.
    let mut y = f32::from_bits(x.to_bits() / 3 + 0x2a51_19f2);
    for _ in 0..2 {
        let cube = y * y * y;
        y *= (cube + 2.0 * x) / (2.0 * cube + x);
    }
    y
}

/// Lines `first..first + count` filtered by the window [1 2 1] / 4 along both axes. Edge cells repeat outwards.
fn blurred(lines: &Lines, first: usize, count: usize) -> Vec<f32> {
    let (columns, width, last) = (lines.columns(), lines.width(), lines.height() - 1);
    let mut scratch = Scratch::default();
    let mut read = |y: usize| {
        let mut raw = vec![0.0f32; width * columns];
        lines.read(y, &mut scratch, &mut raw);
        let mut out = vec![0.0f32; width * columns];
        for x in 0..width {
            let cell = |x: usize| &raw[x * columns..][..columns];
            let (a, b, c) = (cell(x.saturating_sub(1)), cell(x), cell((x + 1).min(width - 1)));
            let out = &mut out[x * columns..][..columns];
            for (j, out) in out.iter_mut().enumerate() {
                *out = 0.25 * a[j] + 0.5 * b[j] + 0.25 * c[j];
            }
        }
        out
    };
    let mut above = read(first.saturating_sub(1));
    let mut here = if first == 0 { above.clone() } else { read(first) };
    let mut result = Vec::with_capacity(count * width * columns);
    for y in first..first + count {
        let below = if y == last { here.clone() } else { read(y + 1) };
        let three = above.iter().zip(&here).zip(&below);
        result.extend(three.map(|((a, b), c)| 0.25 * a + 0.5 * b + 0.25 * c));
        above = std::mem::replace(&mut here, below);
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;
    use appearance::brdf::Table;
    use appearance::document::Materials;
    use inks::Stack;
    use observe::Silent;
    use proptest::prelude::*;
    use protocol::paper::Paper;
    use sheet::{Area, Sheet};

    /// A document with one row everywhere.
    struct Uniform(Space, Vec<f64>);

    impl Materials for Uniform {
        fn width(&self) -> usize {
            5
        }
        fn height(&self) -> usize {
            4
        }
        fn space(&self) -> &Space {
            &self.0
        }
        fn reflectance(&self, _pixel: usize, out: &mut [f32]) {
            out.iter_mut().zip(&self.1).for_each(|(o, &v)| *o = v as f32);
        }
    }

    fn stacks(space: &Space) -> Table {
        let mut rows = Table::new(space.columns());
        let row = |f: &dyn Fn(f64) -> f64| space.angles().iter().flat_map(|&t| [f(t); 3]).collect::<Vec<_>>();
        rows.push(&row(&|_| 0.27));
        rows.push(&row(&|t| 0.005 + 0.8 * inks::ggx::lobe(t, 0.06)));
        rows
    }

    fn sheet(size: u16, inked: impl FnMut(usize) -> bool) -> Sheet {
        let index = (0..usize::from(size).pow(2)).map(inked).map(u8::from).collect();
        Sheet::new(
            Paper::Custom { width: size, length: size },
            vec![Stack::SUBSTRATE, "SF".parse().unwrap()],
            index,
        )
        .unwrap()
    }

    fn report(space: &Space, rows: &Table, target: Vec<f64>, sheet: &Sheet, metres: f64) -> FidelityReport {
        let target = Uniform(space.clone(), target);
        let print =
            Source::Print { dots: sheet.dots(), space, stacks: rows, area: Area::whole(sheet.dots()) };
        fidelity(&Source::Document(&target), &print, print.size(), metres, &Silent).unwrap()
    }

    #[test]
    fn one_stack_is_as_far_from_another_as_the_metric_says() {
        let space = Space::half_angle(32);
        let rows = stacks(&space);
        let expected = space.distance(rows.row(0), rows.row(1));
        let report = report(&space, &rows, rows.row(1).to_vec(), &sheet(200, |_| false), 0.5);
        for value in [report.mean, report.rmse, report.p95, report.max] {
            assert!((value / expected - 1.0).abs() < 1e-5, "{value}, not {expected}");
        }
        let light = space.light_distance(rows.row(0), rows.row(1));
        assert!((report.light_rmse / light - 1.0).abs() < 1e-5, "{}, not {light}", report.light_rmse);
        assert_eq!((report.width, report.height), (200 / 12, 200 / 12));
    }

    proptest! {
        #[test]
        fn the_cube_root_is_one(exponent in -30.0f32..30.0) {
            let x = 10f32.powf(exponent);
            let relative = f64::from(cube_root(x)) / f64::from(x).cbrt() - 1.0;
            prop_assert!(relative.abs() < 4e-7, "{x}: {relative}");
        }

        #[test]
        fn the_distance_is_the_metrics(values in prop::collection::vec((0.0f32..30.0, 0.0f32..30.0), 15)) {
            let space = Space::half_angle(5);
            let (a, b): (Vec<f32>, Vec<f32>) = values.into_iter().unzip();
            let wide = |v: &[f32]| v.iter().map(|&v| f64::from(v)).collect::<Vec<_>>();
            let expected = space.distance(&wide(&a), &wide(&b));
            let found = f64::from(Metric::new(&space).distance(&a, &b));
            prop_assert!((found - expected).abs() < 1e-6 + 1e-5 * expected, "{found}, not {expected}");
        }
    }

    #[test]
    fn the_same_material_is_at_no_distance() {
        let space = Space::half_angle(8);
        let rows = stacks(&space);
        let report = report(&space, &rows, rows.row(0).to_vec(), &sheet(100, |_| false), 0.3);
        assert!(report.max < 1e-5, "{report:?}");
    }

    #[test]
    fn dots_blend_into_their_mixture_as_the_eye_steps_back() {
        let space = Space::half_angle(32);
        let rows = stacks(&space);
        let mixture: Vec<f64> = rows.row(0).iter().zip(rows.row(1)).map(|(a, b)| 0.5 * a + 0.5 * b).collect();
        // 8 x 8 dots of either stack, which of the two by a mixed-up bit.
        let rough = sheet(960, |i| {
            let (x, y) = ((i % 960 / 8) as u32, (i / 960 / 8) as u32);
            (x.wrapping_mul(2_654_435_761) ^ y.wrapping_mul(2_246_822_519)).wrapping_mul(3_266_489_917) >> 31
                == 1
        });
        let far: Vec<f64> = [0.3, 0.5, 1.0, 2.0]
            .iter()
            .map(|&m| report(&space, &rows, mixture.clone(), &rough, m).rmse)
            .collect();
        assert!(far.windows(2).all(|pair| pair[1] < 0.8 * pair[0]), "{far:?}");
        let fine = sheet(960, |i| (i % 960 + i / 960) % 2 == 0);
        assert!(report(&space, &rows, mixture, &fine, 0.5).max < 1e-3);
    }

    /// White noise of unit variance at every square degree passes the low-pass with the integral of its square
    /// (in polar coordinates, summed by the midpoint rule), and a box of side b with 1 / b^2.
    #[test]
    fn the_spot_passes_noise_like_the_eye() {
        let cycles = 0.525 * 11f64.ln() + 3.91;
        let step = 1e-3;
        let passed: f64 = (0..200_000)
            .map(|i| (f64::from(i) + 0.5) * step)
            .map(|f| (-2.0 * f / cycles).exp() * 2.0 * std::f64::consts::PI * f * step)
            .sum();
        let degrees = (spot_mm(0.5) / 500.0).to_degrees();
        assert!((passed * degrees * degrees - 1.0).abs() < 1e-4);
        // The window of taps 1/4, 1/2, 1/4 on cells of this size, rounded to dots.
        let taps: f64 = [0.25f64, 0.5, 0.25].iter().map(|t| t * t).sum();
        let side = cell_dots(0.5) as f64 / DOTS_PER_MM / taps;
        assert!((side / spot_mm(0.5) - 1.0).abs() < 0.05, "{side} mm");
    }

    /// A document of pixels that are no whole number of dots, under dots of two stacks.
    struct Checked(Space, Table, usize, usize);

    impl Materials for Checked {
        fn width(&self) -> usize {
            self.2
        }
        fn height(&self) -> usize {
            self.3
        }
        fn space(&self) -> &Space {
            &self.0
        }
        fn reflectance(&self, pixel: usize, out: &mut [f32]) {
            let (x, y) = (pixel % self.2, pixel / self.2);
            let share = 0.5 + 0.5 * ((x * 7 + y * 13) as f64 * 0.37).sin();
            let rows = self.1.row(0).iter().zip(self.1.row(1));
            out.iter_mut().zip(rows).for_each(|(o, (a, b))| *o = (share * a + (1.0 - share) * b) as f32);
        }
    }

    /// Every dot cut into pieces that belong wholly to one cell and to one pixel, each counted by itself.
    #[test]
    fn fidelity_is_a_count_over_all_dots() {
        let space = Space::half_angle(4);
        let rows = stacks(&space);
        let (dots, columns) = (90usize, space.columns());
        let sheet = sheet(90, |i| (i % 90 * 31 + i / 90 * 17) % 11 < 4);
        for pixels in [(7, 5), (31, 44), (200, 90)] {
            let document = Checked(space.clone(), rows.clone(), pixels.0, pixels.1);
            let area = Area::whole(sheet.dots());
            let print = Source::Print { dots: sheet.dots(), space: &space, stacks: &rows, area };
            let found = fidelity(&Source::Document(&document), &print, print.size(), 0.5, &Silent).unwrap();
            let cells = dots / cell_dots(0.5);
            // Overlaps of two rows of intervals that divide the same side: cell, place and length.
            let overlaps = |places: usize| {
                let mut all = Vec::new();
                for cell in 0..cells {
                    for place in 0..places {
                        let from = (cell as f64 / cells as f64).max(place as f64 / places as f64);
                        let to = ((cell + 1) as f64 / cells as f64).min((place + 1) as f64 / places as f64);
                        if to > from {
                            all.push((cell, place, (to - from) * cells as f64));
                        }
                    }
                }
                all
            };
            let mean = |(across, down): (usize, usize), row: &dyn Fn(usize, usize) -> Vec<f64>| {
                let mut sums = vec![vec![0.0; columns]; cells * cells];
                for (v, y, part) in overlaps(down) {
                    for (u, x, share) in overlaps(across) {
                        let sum = &mut sums[v * cells + u];
                        sum.iter_mut().zip(row(x, y)).for_each(|(s, f)| *s += part * share * f);
                    }
                }
                sums
            };
            let printed =
                mean((dots, dots), &|x, y| rows.row(usize::from(sheet.index()[y * dots + x])).to_vec());
            let wanted = mean(pixels, &|x, y| {
                let mut row = vec![0.0; columns];
                document.reflectance(y * pixels.0 + x, &mut row);
                row.iter().map(|&f| f64::from(f)).collect()
            });
            let blurred = |cell: &[Vec<f64>], u: usize, v: usize| {
                let mut sum = vec![0.0; columns];
                for (dv, a) in [(-1isize, 0.25), (0, 0.5), (1, 0.25)] {
                    for (du, b) in [(-1isize, 0.25), (0, 0.5), (1, 0.25)] {
                        let near = |i: usize, d: isize| i.saturating_add_signed(d).min(cells - 1);
                        let row = &cell[near(v, dv) * cells + near(u, du)];
                        sum.iter_mut().zip(row).for_each(|(s, f)| *s += a * b * f);
                    }
                }
                sum
            };
            let distances: Vec<f64> = (0..cells * cells)
                .map(|i| {
                    let (u, v) = (i % cells, i / cells);
                    space.distance(&blurred(&wanted, u, v), &blurred(&printed, u, v))
                })
                .collect();
            let n = distances.len() as f64;
            let expected = [
                distances.iter().sum::<f64>() / n,
                (distances.iter().map(|d| d * d).sum::<f64>() / n).sqrt(),
                distances.iter().copied().fold(0.0, f64::max),
            ];
            for (found, expected) in [found.mean, found.rmse, found.max].into_iter().zip(expected) {
                assert!((found / expected - 1.0).abs() < 1e-4, "{pixels:?}: {found}, not {expected}");
            }
        }
    }

    #[test]
    fn reports_do_not_depend_on_the_number_of_threads() {
        let space = Space::half_angle(4);
        let rows = stacks(&space);
        let noisy = sheet(700, |i| i % 7 == 3 || i % 11 == 1);
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| report(&space, &rows, rows.row(0).to_vec(), &noisy, 0.3))
        };
        assert_eq!(with(1), with(3));
    }

    #[test]
    fn prints_in_another_tabulation_are_refused() {
        let (space, other) = (Space::half_angle(4), Space::half_angle(5));
        let rows = stacks(&other);
        let sheet = sheet(20, |_| false);
        let target = Uniform(space.clone(), vec![0.1; 12]);
        let print = Source::Print {
            dots: sheet.dots(),
            space: &other,
            stacks: &rows,
            area: Area::whole(sheet.dots()),
        };
        let result = fidelity(&Source::Document(&target), &print, (20, 20), 0.5, &Silent);
        assert!(matches!(result, Err(PreviewError::Shape { expected: 12, found: 15, .. })));
    }
}
