//! Whole documents as they are printed: every metric and every intent, one row each.
//!
//! A row has the distances between pixels and what is printed for them, kept contrast, the difference as the eye sees it from
//! 0.5 m, the error of lit balls (twelve pixels under three light probes), the stacks, and what the plan warns of. Kept contrast: the
//! ratio of printed to wanted deviations from the mean of each window of 16 x 16 pixels, in the metric, and their correlation;
//! the same for the windows outside the gamut, which clamping prints at d > 0.02 on average.
//!
//! Tables of `docs/decisions/metric-that-knows-light.md` and `contrast-between-neighbours.md`: a quarter of an hour.

use std::borrow::Cow;
use std::cell::OnceCell;
use std::path::Path;

use appearance::brdf::{Space, Table, reflectances};
use appearance::document::{self, Document, Materials, Options, Surface};
use appearance::factor::{self, Factored};
use appearance::gamut::{self, GamutSettings, InkMix, Intent, LIGHT, Mapped, Printable};
use inks::{InkSet, Library, Severity};
use observe::Silent;
use protocol::ink::Ink;
use protocol::paper::Paper;
use protocol::rgl::Media;
use rayon::prelude::*;

use super::light::{errors_of_balls, probes, twelve};
use halftone::halftone;
use press::job::Handling;
use press::layout::{Layout, size};
use press::pipeline::document::StageError;
use press::pipeline::{Request, draft};
use press::preview::{EYE, Probe, Source, fidelity};
use sheet::Area;

/// Side of the windows in which contrast is kept or lost.
const WINDOW: usize = 16;
/// Mean distance of a clamped window from which it counts as outside the gamut.
const OUTSIDE: f64 = 0.02;
/// Side of documents that are made here.
const SIDE: usize = 256;
/// Their side on paper.
const MADE_MM: f64 = 40.0;
/// The clamped document comes first: it says which windows are outside the gamut.
const WAYS: [(&str, Intent, f64); 5] = [
    ("clamp", Intent::Clamp, LIGHT),
    ("clamp, paper's metric", Intent::Clamp, 0.0),
    ("blend", Intent::Blend, LIGHT),
    ("basis", Intent::Basis, LIGHT),
    ("contrast", Intent::Contrast, LIGHT),
];

/// The surface at a pixel.
type Formula = fn(usize, usize) -> Surface;

/// A document by a formula.
struct Made(Space, Formula);

impl Materials for Made {
    fn width(&self) -> usize {
        SIDE
    }
    fn height(&self) -> usize {
        SIDE
    }
    fn space(&self) -> &Space {
        &self.0
    }
    fn reflectance(&self, pixel: usize, out: &mut [f32]) {
        let row = self.0.row(&self.1(pixel % SIDE, pixel / SIDE).curve(self.0.angles()));
        out.iter_mut().zip(row).for_each(|(out, f)| *out = f as f32);
    }
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

/// Silver like a mirror.
fn mirror(_: usize, _: usize) -> Surface {
    Surface { diffuse: [0.0; 3], f0: [0.972, 0.960, 0.915], alpha: 0.02 }
}

/// Brushed silver.
fn brushed(_: usize, _: usize) -> Surface {
    Surface { alpha: 0.2, ..mirror(0, 0) }
}

/// A mapped document, pixel by pixel.
struct Printed<'a> {
    mix: &'a InkMix,
    /// What its stacks reflect.
    stacks: Table,
}

impl Printed<'_> {
    fn reflectance(&self, pixel: usize, shares: &mut Vec<f64>, out: &mut [f32]) {
        shares.resize(self.stacks.len(), 0.0);
        self.mix.shares(pixel, shares);
        out.fill(0.0);
        for (row, &share) in self.stacks.rows().zip(&*shares).filter(|(_, share)| **share > 0.0) {
            out.iter_mut().zip(row).for_each(|(out, f)| *out += (share * f) as f32);
        }
    }
}

/// Sums over a window: of squared wanted and printed deviations from its mean, their product, and its mean distance.
#[derive(Clone, Copy, Default)]
struct Window {
    wanted: f64,
    printed: f64,
    both: f64,
    distance: f64,
}

/// The distances of all pixels, and the windows.
#[derive(Default)]
struct Seen {
    distances: Vec<f32>,
    /// Squared distances in light.
    light: f64,
    windows: Vec<Window>,
}

impl Seen {
    fn new(pixels: &dyn Materials, printed: &Printed) -> Seen {
        let strips: Vec<Seen> = (0..pixels.height().div_ceil(WINDOW))
            .into_par_iter()
            .map(|strip| Seen::of_strip(pixels, printed, strip * WINDOW))
            .collect();
        strips.into_iter().fold(Seen::default(), |mut all, strip| {
            all.distances.extend(strip.distances);
            all.light += strip.light;
            all.windows.extend(strip.windows);
            all
        })
    }

    /// The lines from `first` on, as many as a window has.
    fn of_strip(pixels: &dyn Materials, printed: &Printed, first: usize) -> Seen {
        let space = pixels.space();
        let (width, m) = (pixels.width(), space.columns());
        let lines = WINDOW.min(pixels.height() - first);
        // In the space in which d is the Euclidean distance.
        let response = |row: &[f32], out: &mut Vec<f32>| {
            let columns = row.iter().zip(space.weight()).zip(space.radiance());
            out.extend(columns.map(|((&f, &w), &c)| w as f32 * (f.max(0.0) * c as f32).cbrt()));
        };
        let (mut wanted, mut print, mut shares) = (Vec::new(), Vec::new(), Vec::new());
        let (mut target, mut made) = (vec![0.0; m], vec![0.0; m]);
        let mut seen = Seen::default();
        for pixel in first * width..(first + lines) * width {
            pixels.reflectance(pixel, &mut target);
            printed.reflectance(pixel, &mut shares, &mut made);
            seen.light += space.light_distance(&target, &made).powi(2);
            response(&target, &mut wanted);
            response(&made, &mut print);
        }
        let apart =
            |(a, b): (&[f32], &[f32])| a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f32>().sqrt();
        seen.distances = wanted.chunks_exact(m).zip(print.chunks_exact(m)).map(apart).collect();
        for window in 0..if lines == WINDOW { width / WINDOW } else { 0 } {
            let places = || (0..WINDOW * WINDOW).map(|i| i / WINDOW * width + window * WINDOW + i % WINDOW);
            let n = (WINDOW * WINDOW) as f64;
            let mut sums = Window {
                distance: places().map(|p| f64::from(seen.distances[p])).sum::<f64>() / n,
                ..Window::default()
            };
            for j in 0..m {
                let mean = |of: &[f32]| places().map(|p| f64::from(of[p * m + j])).sum::<f64>() / n;
                let means = (mean(&wanted), mean(&print));
                for p in places() {
                    let t = f64::from(wanted[p * m + j]) - means.0;
                    let u = f64::from(print[p * m + j]) - means.1;
                    sums.wanted += t * t;
                    sums.printed += u * u;
                    sums.both += t * u;
                }
            }
            seen.windows.push(sums);
        }
        seen
    }

    /// Root mean square and 95th percentile of d, and the root mean square in light.
    fn distances(&self) -> [f64; 3] {
        let n = self.distances.len();
        let squares: f64 = self.distances.iter().map(|&d| f64::from(d).powi(2)).sum();
        let mut sorted = self.distances.clone();
        sorted.sort_unstable_by(f32::total_cmp);
        [(squares / n as f64).sqrt(), sorted[(n - 1) * 95 / 100].into(), (self.light / n as f64).sqrt()]
    }

    /// Ratio of printed to wanted contrast, and correlation.
    fn contrast(&self, counts: impl Fn(usize) -> bool) -> String {
        let (mut tt, mut uu, mut tu) = (0.0, 0.0, 0.0);
        for (_, window) in self.windows.iter().enumerate().filter(|(i, _)| counts(*i)) {
            tt += window.wanted;
            uu += window.printed;
            tu += window.both;
        }
        if tt > 1e-9 { format!("{:.3}, {:.3}", (uu / tt).sqrt(), tu / (tt * uu).sqrt()) } else { "-".into() }
    }
}

/// How a document is printed.
struct Print<'a> {
    library: &'a Library,
    inks: &'a InkSet,
    probes: &'a [Probe; 3],
}

impl Print<'_> {
    /// The columns from the eye on.
    fn words(&self, pixels: &dyn Materials, own: Option<(f64, f64)>, mapped: &Mapped) -> String {
        let (space, mix) = (pixels.space(), &mapped.mix);
        let layout = Layout::centred(Paper::A4);
        let size = size::dots((pixels.width(), pixels.height()), own, None, &layout).unwrap();
        let chosen = halftone::Settings::from_library(&mix.stacks, self.library);
        let dots = halftone(mix, size, None, &chosen, &Silent).unwrap();
        let stacks = reflectances(dots.stacks(), self.library, space);
        let print = Source::Print { dots: &dots, space, stacks: &stacks, area: Area::whole(&dots) };
        let eye = fidelity(&Source::Document(pixels), &print, print.size(), EYE, &Silent).unwrap();
        let printed = Printed { mix, stacks: reflectances(&mix.stacks, self.library, space) };
        let mut both = Table::new(space.columns());
        let (mut row, mut shares) = (vec![0.0; space.columns()], Vec::new());
        for pixel in twelve(pixels) {
            pixels.reflectance(pixel, &mut row);
            both.push(&row.iter().map(|&f| f64::from(f)).collect::<Vec<_>>());
            printed.reflectance(pixel, &mut shares, &mut row);
            both.push(&row.iter().map(|&f| f64::from(f)).collect::<Vec<_>>());
        }
        let [studio, venice, soft] = errors_of_balls(space, &both, self.probes);
        let handling = Handling { media: Media::Plain, curl_correction: true };
        let (library, allowed) = (self.library, *self.inks);
        let request = Request { name: "table", dots: &dots, layout: &layout, handling, allowed, library };
        let plan = draft(&request, &Silent).unwrap().plan;
        let share = |share: &press::job::plan::Share| format!("{} {:.1}", share.stack, 100.0 * share.share);
        let most: Vec<String> = plan.stacks.iter().take(6).map(share).collect();
        let mut warned: Vec<String> = (plan.checks.iter())
            .filter(|check| check.severity >= Severity::Warning)
            .map(|check| check.rule.clone())
            .collect();
        warned.dedup();
        format!(
            "{:.4}, {:.4} | {venice:.3}, {studio:.3}, {soft:.3} | {} of {} | {} | {}",
            eye.rmse,
            eye.light_rmse,
            most.join(", "),
            plan.stacks.len(),
            mapped.report.cartridges.iter().map(|ink| ink.short()).collect::<Vec<_>>().join(" "),
            warned.join(", ")
        )
    }
}

fn table(name: &str, pixels: &dyn Materials, own: Option<(f64, f64)>, probes: &[Probe; 3]) {
    let library = Library::builtin();
    let factored: OnceCell<Factored> = OnceCell::new();
    for (set, inks) in [("default", InkSet::default()), ("all", InkSet::of(Ink::ALL))] {
        let printable = Printable::combined(&library, &inks, pixels.space());
        let mut outside: Vec<bool> = Vec::new();
        for (way, intent, light) in WAYS {
            let settings = GamutSettings { intent, light, ..GamutSettings::default() };
            let bases = || {
                let found = factor::factor(pixels, &factor::FactorSettings::default(), &Silent);
                Ok::<_, StageError>(Cow::Borrowed(factored.get_or_init(|| found.unwrap().factored)))
            };
            let mapped = gamut::map(pixels, bases, &printable, &settings, &Silent).unwrap();
            let stacks = reflectances(&mapped.mix.stacks, &library, pixels.space());
            let seen = Seen::new(pixels, &Printed { mix: &mapped.mix, stacks });
            if outside.is_empty() {
                outside = seen.windows.iter().map(|window| window.distance > OUTSIDE).collect();
            }
            let [d, p95, l] = seen.distances();
            let print = Print { library: &library, inks: &inks, probes };
            println!(
                "| {name} | {set} | {way} | {d:.4} | {p95:.4} | {l:.4} | {} | {} | {} |",
                seen.contrast(|_| true),
                seen.contrast(|window| outside[window]),
                print.words(pixels, own, &mapped)
            );
        }
    }
}

/// Every metric and every intent.
pub fn prints(data: &Path) {
    let probes = probes(data);
    println!(
        "| document | inks | way | d | p95 | l | contrast | outside | eye, in light | balls: Venice, studio, soft | stacks | inks | warnings |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|---|");
    let svbrdf = |name: &str| data.join("svbrdf").join(name).display().to_string();
    let open = |name: &str, path: &str| {
        let document: Document = document::open(path, &Options::default(), &Silent).unwrap();
        table(name, document.materials(), document.size_mm, &probes);
    };
    let made: [(&str, Formula); 4] = [
        ("scratches", scratches),
        ("rungs", rungs),
        ("silver, alpha .02", mirror),
        ("silver, alpha .2", brushed),
    ];
    for (name, surface) in made {
        table(name, &Made(Space::half_angle(32), surface), Some((MADE_MM, MADE_MM)), &probes);
    }
    for name in ["helmet_metal", "helmet_leather", "rustymetal"] {
        open(name, &svbrdf(name));
    }
    open("sample:card", "sample:card");
}
