//! Error and kept contrast of the intents: `FOILPRESS_DATA=… cargo bench --bench contrast`.
//!
//! Prints a row for each document, choice of inks and intent: distance d (rms and 95th percentile), the ratio of printed to
//! wanted differences within windows of 16 x 16 pixels, their correlation, the same for the windows that clamping prints at
//! d > 0.02 on average, and seconds. Without the textures it uses made documents and samples alone.

use std::borrow::Cow;
use std::path::PathBuf;
use std::time::Instant;

use appearance::brdf::Space;
use appearance::document::{self, Materials, Surface};
use appearance::factor::{self, factor};
use appearance::gamut::{GamutError, Intent, Mapped, Printable, Settings, map};
use inks::{InkSet, Library};
use observe::Silent;

const SIDE: usize = 256;
const WINDOW: usize = 16;
/// Mean distance of a clamped window from which it counts as outside the gamut.
const OUTSIDE: f64 = 0.02;
const INTENTS: [(&str, Intent); 4] = [
    ("clamp", Intent::Clamp),
    ("blend", Intent::Blend),
    ("basis", Intent::Basis),
    ("contrast", Intent::Contrast),
];

fn main() {
    println!("| document | inks | intent | d rms | p95 | ratio | corr. | outside: ratio | corr. | s |");
    println!("|---|---|---|---|---|---|---|---|---|---|");
    for (name, pixels) in documents() {
        for inks in ["default", "all"] {
            compare(&name, &pixels, inks);
        }
    }
}

/// A document as rows of reflectance.
struct Rows {
    space: Space,
    width: usize,
    values: Vec<f32>,
}

impl Rows {
    /// The middle of a document.
    fn middle(whole: &dyn Materials) -> Rows {
        let (width, height) = (SIDE.min(whole.width()), SIDE.min(whole.height()));
        let (left, top) = ((whole.width() - width) / 2, (whole.height() - height) / 2);
        let columns = whole.space().columns();
        let mut values = vec![0.0; width * height * columns];
        for (p, row) in values.chunks_exact_mut(columns).enumerate() {
            whole.reflectance((p / width + top) * whole.width() + p % width + left, row);
        }
        Rows { space: whole.space().clone(), width, values }
    }

    fn made(surface: impl Fn(usize, usize) -> Surface) -> Rows {
        let space = Space::half_angle(32);
        let row = |p: usize| space.row(&surface(p % SIDE, p / SIDE).curve(space.angles()));
        let values = (0..SIDE * SIDE).flat_map(row).map(|f| f as f32).collect();
        Rows { space, width: SIDE, values }
    }
}

impl Materials for Rows {
    fn width(&self) -> usize {
        self.width
    }

    fn height(&self) -> usize {
        self.values.len() / self.space.columns() / self.width
    }

    fn space(&self) -> &Space {
        &self.space
    }

    fn reflectance(&self, pixel: usize, out: &mut [f32]) {
        out.copy_from_slice(&self.values[pixel * self.space.columns()..][..self.space.columns()]);
    }
}

fn documents() -> Vec<(String, Rows)> {
    let mut all = Vec::new();
    let mut open = |spec: &str, name: &str| {
        let document = document::open(spec, &document::Options::default(), &Silent).unwrap();
        all.push((name.to_owned(), Rows::middle(document.materials())));
    };
    if let Some(data) = std::env::var_os("FOILPRESS_DATA") {
        for name in ["rustymetal", "helmet_metal", "helmet_leather"] {
            open(&PathBuf::from(&data).join("svbrdf").join(name).to_string_lossy(), name);
        }
    }
    for name in ["sample:card", "sample:ladder"] {
        open(name, name);
    }
    all.push(("scratches".into(), Rows::made(scratches)));
    all.push(("rungs".into(), Rows::made(rungs)));
    all
}

/// A number from 0 to 1.
fn noise(x: usize, y: usize) -> f32 {
    let bits = (x.wrapping_mul(7919) ^ y.wrapping_mul(104_729)).wrapping_mul(2_654_435_761);
    ((bits >> 8) & 0xffff) as f32 / 65536.0
}

/// Scratched metal, brighter than any ink.
fn scratches(x: usize, y: usize) -> Surface {
    let f = 0.65 + 0.18 * noise(x / 2 + y / 5, 7) + 0.12 * noise(x, y / 9);
    Surface { diffuse: [0.0; 3], f0: [f, 0.97 * f, 0.92 * f], alpha: 0.1 + 0.05 * noise(x / 3, y / 40) }
}

/// A ladder of gloss in rungs of twelve pixels.
fn rungs(x: usize, _: usize) -> Surface {
    Surface { diffuse: [0.1; 3], f0: [0.9 * [1.0, 0.8, 0.5, 0.1][x / 12 % 4]; 3], alpha: 0.15 }
}

fn compare(name: &str, pixels: &Rows, inks: &str) {
    let space = &pixels.space;
    let m = space.columns();
    let wanted: Vec<f32> = pixels.values.chunks_exact(m).flat_map(|row| seen(space, row)).collect();
    let printable = Printable::from_library(&Library::builtin(), &inks.parse::<InkSet>().unwrap(), space);
    let factored = factor(pixels, &factor::Settings::default(), &Silent).unwrap().factored;
    let mut outside = Vec::new();
    for (called, intent) in INTENTS {
        let settings = Settings { intent, ..Settings::default() };
        let start = Instant::now();
        let bases = || Ok::<_, GamutError>(Cow::Borrowed(&factored));
        let mapped = map(pixels, bases, &printable, &settings, &Silent).unwrap();
        let seconds = start.elapsed().as_secs_f64();
        let print = printed(&mapped, &printable, space);
        let mut d: Vec<f64> = wanted.chunks_exact(m).zip(print.chunks_exact(m)).map(distance).collect();
        let windows = Windows { width: pixels.width, columns: m };
        if outside.is_empty() {
            outside = windows.all(wanted.len()).map(|w| windows.mean(&d, w) > OUTSIDE).collect();
        }
        let (ratio, correlation) = windows.contrast(&wanted, &print, |_| true);
        let out = match outside.contains(&true) {
            true => windows.contrast(&wanted, &print, |w| outside[w]),
            false => (f64::NAN, f64::NAN),
        };
        let rms = (d.iter().map(|d| d * d).sum::<f64>() / d.len() as f64).sqrt();
        d.sort_by(f64::total_cmp);
        let p95 = d[(d.len() - 1) * 95 / 100];
        println!(
            "| {name} | {inks} | {called} | {rms:.4} | {p95:.4} | {ratio:.3} | {correlation:.3} | {:.3} | {:.3} | \
             {seconds:.1} |",
            out.0, out.1
        );
    }
}

/// A row of reflectance in the space in which d is the Euclidean distance.
fn seen(space: &Space, row: &[f32]) -> Vec<f32> {
    let columns = row.iter().zip(space.weight()).zip(space.radiance());
    columns.map(|((&f, &w), &c)| (w * (f64::from(f) * c).cbrt()) as f32).collect()
}

fn distance((a, b): (&[f32], &[f32])) -> f64 {
    a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>().sqrt()
}

/// What a mix prints, pixel by pixel, as seen.
fn printed(mapped: &Mapped, printable: &Printable, space: &Space) -> Vec<f32> {
    let mix = &mapped.mix;
    let curve = |stack| printable.stacks.iter().position(|s| s == stack).map(|k| printable.curves.row(k));
    let curves: Vec<&[f64]> = mix.stacks.iter().map(|stack| curve(stack).unwrap()).collect();
    let mut shares = vec![0.0; curves.len()];
    let mut print = Vec::new();
    for pixel in 0..mix.maps.width() * mix.maps.height() {
        mix.shares(pixel, &mut shares);
        let mut row = vec![0.0; space.columns()];
        for (curve, share) in curves.iter().zip(&shares).filter(|(_, share)| **share > 0.0) {
            row.iter_mut().zip(*curve).for_each(|(row, f)| *row += (share * f) as f32);
        }
        print.extend(seen(space, &row));
    }
    print
}

/// Windows side by side.
struct Windows {
    width: usize,
    columns: usize,
}

impl Windows {
    fn all(&self, values: usize) -> std::ops::Range<usize> {
        0..(self.width / WINDOW) * (values / self.columns / self.width / WINDOW)
    }

    fn pixels(&self, window: usize) -> impl Iterator<Item = usize> {
        let (across, width) = (self.width / WINDOW, self.width);
        let first = window / across * WINDOW * width + window % across * WINDOW;
        (0..WINDOW * WINDOW).map(move |i| first + i / WINDOW * width + i % WINDOW)
    }

    fn mean(&self, values: &[f64], window: usize) -> f64 {
        self.pixels(window).map(|p| values[p]).sum::<f64>() / (WINDOW * WINDOW) as f64
    }

    /// The ratio of printed to wanted deviations from the mean of the window, and their correlation.
    fn contrast(&self, wanted: &[f32], print: &[f32], counts: impl Fn(usize) -> bool) -> (f64, f64) {
        let (mut tt, mut uu, mut ut) = (0.0, 0.0, 0.0);
        for window in self.all(wanted.len()).filter(|&w| counts(w)) {
            for j in 0..self.columns {
                let at = |of: &[f32], p: usize| f64::from(of[p * self.columns + j]);
                let mean = |of: &[f32]| {
                    self.pixels(window).map(|p| at(of, p)).sum::<f64>() / (WINDOW * WINDOW) as f64
                };
                let (t0, u0) = (mean(wanted), mean(print));
                for p in self.pixels(window) {
                    let (t, u) = (at(wanted, p) - t0, at(print, p) - u0);
                    tt += t * t;
                    uu += u * u;
                    ut += t * u;
                }
            }
        }
        ((uu / tt).sqrt(), ut / (tt * uu).sqrt())
    }
}
