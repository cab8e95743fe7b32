//! What the eye makes of a halftone: the error it sees, patterns and bands.
//!
//! Problem: tones and clusters ([`super::metrics`]) do not say whether an area looks even.
//! Method: dots and mixture are taken to coordinates in which the distance of two materials is that of what they
//! reflect ([`Tangent`]); their difference, filtered by the eye's contrast sensitivity at a distance, is the error seen.
//! Patterns are peaks of the autocorrelation of a stack's dots; bands are the spread of the means of rows and columns.
//! Cost: an FFT for each coordinate: 0.3 s for 512 x 512 dots and five stacks. Memory: 16 bytes a dot, four times for
//! the autocorrelation.
//! Limits: the error is periodic at the patch's border; a flat patch of 1024 x 1024 dots is needed to tell an
//! autocorrelation of 0.05 from chance.
//! Source: R. Nasanen (1984) for the contrast sensitivity, exp(-f / (0.525 ln L + 3.91)), f in cycles per degree.

use maths::Maths;
use std::f64::consts::PI;

use appearance::brdf::{Space, Table};
use appearance::gamut::InkMix;
use spectra::{Complex, transform};

/// Dots of a metre: 600 an inch, and 25.4 mm.
const DOTS: f64 = 600.0 / 0.0254;

/// Luminance of the paper in cd/m2, a dim room.
const LUMINANCE: f64 = 11.0;

/// Stacks as points: the distance of two mixtures of them is what the metric of eq. 2 makes of their reflectance,
/// to first order about one mixture.
pub struct Tangent {
    /// Coordinates of each stack.
    points: Vec<Vec<f64>>,
}

impl Tangent {
    /// The rows of `table` are the stacks' reflectances in 1/sr, `shares` the mixture about which they are seen.
    pub fn new(space: &Space, table: &Table, shares: &[f64]) -> Tangent {
        let mut mean = vec![0.0; space.columns()];
        for (row, share) in table.rows().zip(shares) {
            for (mean, f) in mean.iter_mut().zip(row) {
                *mean += share * f;
            }
        }
        let scaled = |row: &[f64]| -> Vec<f64> {
            let columns = row.iter().zip(&mean).zip(space.radiance().iter().zip(space.weight()));
            columns
                .map(|((f, mean), (c, weight))| {
                    let cubed = (mean * c).max(1e-6);
                    weight * c * f / (3.0 * cubed.cube_root().squared())
                })
                .collect()
        };
        Tangent::reduce(&table.rows().map(scaled).collect::<Vec<_>>(), shares)
    }

    /// About the mean mixture of a page; the rows of `table` are the reflectances of its stacks.
    pub fn of_mix(mix: &InkMix, space: &Space, table: &Table) -> Tangent {
        let mut shares = vec![0.0; mix.stacks.len()];
        for (row, sum) in mix.matrix.iter().zip(mix.maps.totals()) {
            for (share, &part) in shares.iter_mut().zip(row) {
                *share += sum as f64 * f64::from(part);
            }
        }
        let total: f64 = shares.iter().sum();
        shares.iter_mut().for_each(|share| *share /= total);
        Tangent::new(space, table, &shares)
    }

    /// Every two stacks are equally far apart.
    #[cfg(test)]
    fn plain(stacks: usize) -> Tangent {
        Tangent {
            points: (0..stacks).map(|q| (0..stacks).map(|i| f64::from(u8::from(i == q))).collect()).collect(),
        }
    }

    /// The same distances in fewer coordinates, those first in which the mixture's dots differ most: each coordinate points to
    /// the stack whose direction from the mixture takes up most of what is left of the variance, each stack counted by its
    /// share. A stack in rare use is far from the others, but its dots are few.
    fn reduce(rows: &[Vec<f64>], shares: &[f64]) -> Tangent {
        let mut mean = vec![0.0; rows.first().map_or(0, Vec::len)];
        for (row, share) in rows.iter().zip(shares) {
            mean.iter_mut().zip(row).for_each(|(mean, v)| *mean += share * v);
        }
        let mut rest: Vec<Vec<f64>> =
            rows.iter().map(|row| row.iter().zip(&mean).map(|(v, mean)| v - mean).collect()).collect();
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let length = |rest: &[Vec<f64>], q: usize| dot(&rest[q], &rest[q]);
        let longest = |rest: &[Vec<f64>]| (0..rows.len()).map(|q| length(rest, q)).fold(0.0, f64::max);
        let scale = longest(&rest);
        let mut points: Vec<Vec<f64>> = vec![Vec::new(); rows.len()];
        for _ in 0..rows.len() {
            let least = 1e-9 * scale;
            // What the direction to a stack takes up, and its length, which decides where no stack in use is left.
            let taken = |q: usize| {
                let own = length(&rest, q);
                let sum = |(row, share): (&Vec<f64>, &f64)| share * dot(row, &rest[q]).squared();
                let all: f64 = rest.iter().zip(shares).map(sum).sum();
                if own > least { (all / own, own) } else { (0.0, 0.0) }
            };
            let far = (0..rows.len()).map(|q| (taken(q), q));
            let Some(((_, own), pivot)) = far.max_by(|(a, _), (b, _)| {
                let (a_taken, b_taken) = (a.0.max(least), b.0.max(least));
                a_taken.total_cmp(&b_taken).then(a.1.total_cmp(&b.1))
            }) else {
                break;
            };
            if own <= least {
                break;
            }
            let direction: Vec<f64> = rest[pivot].iter().map(|v| v / own.sqrt()).collect();
            for (point, row) in points.iter_mut().zip(&mut rest) {
                let along = dot(row, &direction);
                point.push(along);
                row.iter_mut().zip(&direction).for_each(|(v, d)| *v -= along * d);
            }
        }
        Tangent { points }
    }

    /// The four coordinates in which the mixture's dots differ most, to 1/65536, so that the last bit of a
    /// power or a root changes no dot.
    pub fn leading(&self) -> Vec<[f32; 4]> {
        let round = |value: &f64| ((value * 65536.0).round() / 65536.0) as f32;
        let first = |point: &Vec<f64>| std::array::from_fn(|c| point.get(c).map_or(0.0, round));
        self.points.iter().map(first).collect()
    }

    /// Coordinates of each stack.
    pub fn points(&self) -> &[Vec<f64>] {
        &self.points
    }
}

/// Contrast sensitivity at `f` cycles per degree, 1 at 0.
pub fn sensitivity(f: f64) -> f64 {
    (-f / (0.525 * LUMINANCE.logarithm() + 3.91)).exponential()
}

/// How many metres a degree of the eye's view spans, so many metres away.
pub fn degree(metres: f64) -> f64 {
    2.0 * (PI / 360.0).tangent() * metres
}

/// The eye's filter on windows of one size, from some distances.
pub struct Eye {
    width: usize,
    height: usize,
    distances: usize,
    /// The squared sensitivity from each distance, for the frequencies of a quarter: the others are these with other signs.
    seen: Vec<f64>,
}

impl Eye {
    /// For windows of `width` x `height` dots, seen from so many metres.
    pub fn new(width: usize, height: usize, metres: &[f64]) -> Eye {
        let mut seen = Vec::with_capacity((width / 2 + 1) * (height / 2 + 1) * metres.len());
        for y in 0..=height / 2 {
            for x in 0..=width / 2 {
                let f = (x as f64 / width as f64).hypotenuse(y as f64 / height as f64);
                seen.extend(metres.iter().map(|&metres| sensitivity(f * DOTS * degree(metres)).squared()));
            }
        }
        Eye { width, height, distances: metres.len(), seen }
    }

    /// Width and height of the windows.
    pub fn window(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// The squared sensitivities at a coefficient.
    fn squared(&self, at: usize) -> &[f64] {
        let (x, y) = (at % self.width, at / self.width);
        let (x, y) = (x.min(self.width - x), y.min(self.height - y));
        &self.seen[(y * (self.width / 2 + 1) + x) * self.distances..][..self.distances]
    }
}

/// Root mean square of an error as it is seen from the distances of the eye, in units of the metric. Each plane is one
/// coordinate of the error in a window of the eye's size.
pub fn errors_seen(planes: &[Vec<f64>], eye: &Eye) -> Vec<f64> {
    let mut sums = vec![0.0; eye.distances];
    let (width, dots) = (eye.width, eye.width * eye.height);
    // Two real planes make one complex image, whose power is the sum of theirs where frequencies weigh the same both ways.
    for pair in planes.chunks(2) {
        let second = |at: usize| pair.get(1).map_or(0.0, |plane| plane[at]);
        let mut image: Vec<Complex<f32>> = pair[0]
            .iter()
            .enumerate()
            .map(|(at, &first)| Complex::new(first as f32, second(at) as f32))
            .collect();
        transform(&mut image, width);
        for (at, value) in image.iter().enumerate() {
            for (sum, seen) in sums.iter_mut().zip(eye.squared(at)) {
                *sum += seen * f64::from(value.norm_sqr());
            }
        }
    }
    sums.iter().map(|sum| (sum / (dots as f64 * dots as f64)).sqrt()).collect()
}

/// The error of a halftone in each coordinate. `index` is the stack of each dot, `asked` the share of each stack at each.
pub fn error_planes(index: &[u8], asked: &[f32], tangent: &Tangent) -> Vec<Vec<f64>> {
    let stacks = tangent.points.len();
    let error = |c: usize| {
        let dots = index.iter().zip(asked.chunks_exact(stacks));
        dots.map(|(&dot, shares)| {
            let mean: f64 = shares.iter().zip(&tangent.points).map(|(&a, p)| f64::from(a) * p[c]).sum();
            tangent.points[usize::from(dot)][c] - mean
        })
        .collect()
    };
    (0..tangent.points.first().map_or(0, Vec::len)).map(error).collect()
}

/// Largest magnitude of the autocorrelation of a stack's dots at lags of more than `near` and at most `far` dots, and the
/// lag. 0 for a stack that is everywhere or nowhere.
pub fn peak(width: usize, index: &[u8], stack: u8, near: f64, far: usize) -> (f64, (i32, i32)) {
    let height = index.len() / width;
    let mean = index.iter().filter(|&&dot| dot == stack).count() as f64 / index.len() as f64;
    let variance = mean * (1.0 - mean);
    if variance <= 0.0 {
        return (0.0, (0, 0));
    }
    // Padded to twice the sides, so that nothing meets its own other end.
    let (wide, high) = (2 * width, 2 * height);
    let mut image = vec![Complex::default(); wide * high];
    for (at, &dot) in index.iter().enumerate() {
        image[at / width * wide + at % width].re = (f64::from(u8::from(dot == stack)) - mean) as f32;
    }
    transform(&mut image, wide);
    for value in &mut image {
        *value = Complex::new(value.norm_sqr(), 0.0);
    }
    // The power is symmetric, so the transform back is the transform.
    transform(&mut image, wide);
    let mut most = (0.0, (0, 0));
    let far = far as i32;
    for y in 0..=far {
        for x in -far..=far {
            let lag = f64::from(x).hypotenuse(f64::from(y));
            if lag <= near || lag > f64::from(far) {
                continue;
            }
            let overlap = (width as f64 - f64::from(x.abs())) * (height as f64 - f64::from(y));
            let at = y as usize * wide + x.rem_euclid(wide as i32) as usize;
            let value = (f64::from(image[at].re) / (wide * high) as f64 / overlap / variance).abs();
            if value > most.0 {
                most = (value, (x, y));
            }
        }
    }
    most
}

/// Standard deviations of a stack's share over rows and over columns, each in units of what independent clusters of
/// `side` x `side` dots would have.
pub fn swing(width: usize, index: &[u8], stack: u8, side: usize) -> (f64, f64) {
    let height = index.len() / width;
    let (mut rows, mut columns) = (vec![0.0; height], vec![0.0; width]);
    for (at, _) in index.iter().enumerate().filter(|&(_, &dot)| dot == stack) {
        rows[at / width] += 1.0 / width as f64;
        columns[at % width] += 1.0 / height as f64;
    }
    let spread = |shares: &[f64], across: usize| {
        let mean = shares.iter().sum::<f64>() / shares.len() as f64;
        let variance = shares.iter().map(|share| (share - mean).squared()).sum::<f64>() / shares.len() as f64;
        let independent = mean * (1.0 - mean) * side as f64 / across as f64;
        if independent > 0.0 { (variance / independent).sqrt() } else { 0.0 }
    };
    (spread(&rows, width), spread(&columns, height))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A grating of one frequency: its amplitude over the root of two, times the sensitivity.
    #[test]
    fn a_grating_is_seen_by_its_frequency() {
        let (width, height) = (256, 64);
        let index: Vec<u8> = (0..width * height).map(|at| u8::from(at % 32 < 16)).collect();
        let asked = vec![0.5f32; 2 * width * height];
        let seen = |metres: f64| {
            let planes = error_planes(&index, &asked, &Tangent::plain(2));
            errors_seen(&planes, &Eye::new(width, height, &[metres]))[0]
        };
        // Two coordinates; a square wave of +-1/2 in 32 samples has a first harmonic of 1 / (16 sin(pi/32)).
        let degree = 2.0 * (PI / 360.0).tan() * 4.0 * DOTS;
        let first = 1.0 / (16.0 * (PI / 32.0).sin()) * sensitivity(degree / 32.0);
        assert!((seen(4.0) / first - 1.0).abs() < 1e-3, "{} {first}", seen(4.0));
        assert!((seen(1e-9) - 0.5f64.sqrt()).abs() < 1e-3, "{}", seen(1e-9));
    }

    #[test]
    fn a_lattice_repeats_and_scattered_dots_do_not() {
        let width = 256;
        let lattice: Vec<u8> =
            (0..width * width).map(|at| u8::from(at % 16 < 4 && at / width % 16 < 4)).collect();
        let (most, (x, y)) = peak(width, &lattice, 1, 20.0, 60);
        assert!(most > 0.99 && x % 16 == 0 && y % 16 == 0, "{most} at {x}, {y}");
        let hash =
            |at: usize| (at as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_mul(at as u64 | 1) >> 60;
        let scattered: Vec<u8> = (0..width * width).map(|at| u8::from(hash(at) < 4)).collect();
        assert!(peak(width, &scattered, 1, 3.0, 60).0 < 0.05);
        let (rows, columns) = swing(width, &scattered, 1, 1);
        assert!((0.8..1.25).contains(&rows) && (0.8..1.25).contains(&columns), "{rows} {columns}");
        assert!(swing(width, &lattice, 1, 4).0 > 3.0);
    }

    /// Six stacks in use, and three far away whose shares are 1 %: four coordinates keep the distances between those in use.
    #[test]
    fn rare_stacks_take_no_coordinate_from_the_others() {
        let axis = |c: usize, length: f64| -> Vec<f64> {
            (0..7).map(|i| if i == c { length } else { 0.0 }).collect()
        };
        let mut rows: Vec<Vec<f64>> = (0..4).map(|c| axis(c, 1.0)).collect();
        rows.extend((4..7).map(|c| axis(c, 3.0)));
        let shares = [0.24, 0.25, 0.23, 0.25, 0.01, 0.01, 0.01];
        let tangent = Tangent::reduce(&rows, &shares);
        let leading = tangent.leading();
        for a in 0..4 {
            for b in 0..a {
                let kept: f32 = (0..4).map(|c| (leading[a][c] - leading[b][c]).powi(2)).sum();
                // Three of the four directions between those in use, and the largest of the rare ones.
                assert!(kept > 0.9 * 2.0, "{a} {b}: {kept}");
                let all = (0..tangent.points[a].len())
                    .map(|c| (tangent.points[a][c] - tangent.points[b][c]).powi(2));
                assert!((all.sum::<f64>() - 2.0).abs() < 1e-9);
            }
        }
    }

    /// Distances between stacks are the metric's, to first order.
    #[test]
    fn coordinates_keep_distances() {
        let space = Space::half_angle(16);
        let mut table = Table::new(space.columns());
        for level in [0.2, 0.205, 0.21] {
            table.push(&vec![level; space.columns()]);
        }
        let tangent = Tangent::new(&space, &table, &[0.0, 1.0, 0.0]);
        let apart = |a: usize, b: usize| {
            tangent.points[a].iter().zip(&tangent.points[b]).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
        };
        for (a, b) in [(0, 1), (1, 2), (0, 2)] {
            let exact = space.distance(table.row(a), table.row(b));
            assert!((apart(a, b) / exact - 1.0).abs() < 0.02, "{} {exact}", apart(a, b));
        }
    }
}
