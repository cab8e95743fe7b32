//! The objective against an independent solver, and what is printed of made textures.

use inks::{InkSet, Library};
use observe::Silent;
use protocol::ink::Ink;

use super::*;
use crate::brdf::Space;
use crate::gamut::fitting::clamp;
use crate::gamut::{GamutSettings, Intent, Mapped, Printable};
use crate::materials::Surface;
use crate::weights::ONE;

/// Materials given as rows.
struct Rows {
    space: Space,
    width: usize,
    rows: Vec<Vec<f64>>,
}

impl Rows {
    fn new(width: usize, height: usize, surface: impl Fn(usize, usize) -> Surface) -> Rows {
        let space = Space::half_angle(32);
        let row = |p: usize| space.row(&surface(p % width, p / width).curve(space.angles()));
        Rows { width, rows: (0..width * height).map(row).collect(), space }
    }
}

impl Materials for Rows {
    fn width(&self) -> usize {
        self.width
    }
    fn height(&self) -> usize {
        self.rows.len() / self.width
    }
    fn space(&self) -> &Space {
        &self.space
    }
    fn reflectance(&self, pixel: usize, out: &mut [f32]) {
        out.iter_mut().zip(&self.rows[pixel]).for_each(|(out, &f)| *out = f as f32);
    }
}

/// Stacks that reflect what these surfaces do.
fn printer(stacks: &[(&str, Surface)]) -> Printable {
    let space = Space::half_angle(32);
    let mut curves = Table::new(space.columns());
    stacks.iter().for_each(|(_, surface)| curves.push(&space.row(&surface.curve(space.angles()))));
    Printable::new(stacks.iter().map(|(name, _)| name.parse().unwrap()).collect(), curves)
}

/// Paper that glosses a little, and three coats.
fn coats() -> Printable {
    let coat = |diffuse, f0, alpha| Surface { diffuse, f0, alpha };
    printer(&[
        ("substrate", coat([0.5; 3], [0.03; 3], 0.4)),
        ("F", coat([0.1; 3], [0.5; 3], 0.2)),
        ("K", coat([0.02; 3], [0.05; 3], 0.3)),
        ("Y", coat([0.5, 0.4, 0.05], [0.05; 3], 0.3)),
    ])
}

fn noise(x: usize, y: usize) -> f32 {
    let bits = (x * 7919) ^ (y * 104_729);
    ((bits.wrapping_mul(2_654_435_761) >> 8) & 0xffff) as f32 / 65536.0
}

/// Metal glossier than [`coats`] can print, with grain in colour and gloss.
fn grain(x: usize, y: usize) -> Surface {
    let f = 0.6 + 0.3 * noise(x, y);
    Surface { diffuse: [0.1; 3], f0: [f, 0.95 * f, 0.9 * f], alpha: 0.2 }
}

fn mapped(pixels: &Rows, printable: &Printable, intent: Intent) -> Mapped {
    let settings = GamutSettings { intent, light: 0.0, most_cartridges: 13, ..GamutSettings::default() };
    let bases = || -> Result<_, GamutError> { unreachable!("neither intent uses bases") };
    crate::gamut::map(pixels, bases, printable, &settings, &Silent).unwrap()
}

/// The printed reflectance of each pixel, from the mix alone.
fn printed(mapped: &Mapped, printable: &Printable) -> Vec<Vec<f64>> {
    let mix = &mapped.mix;
    let mut shares = vec![0.0; mix.stacks.len()];
    let print = |pixel: usize| {
        mix.shares(pixel, &mut shares);
        let mut row = vec![0.0; printable.curves.columns()];
        for (stack, share) in mix.stacks.iter().zip(&shares).filter(|(_, share)| **share > 0.0) {
            let k = printable.stacks.iter().position(|s| s == stack).unwrap();
            row.iter_mut().zip(printable.curves.row(k)).for_each(|(row, f)| *row += share * f);
        }
        row
    };
    (0..mix.maps.width() * mix.maps.height()).map(print).collect()
}

/// The ratio of printed to wanted differences between all pixels, and their correlation.
fn contrast(space: &Space, wanted: &[Vec<f64>], printed: &[Vec<f64>]) -> (f64, f64) {
    let deviations = |rows: &[Vec<f64>]| {
        let mut seen: Vec<Vec<f64>> = rows.iter().map(|row| space.seen(row)).collect();
        for j in 0..seen[0].len() {
            let mean = seen.iter().map(|row| row[j]).sum::<f64>() / seen.len() as f64;
            seen.iter_mut().for_each(|row| row[j] -= mean);
        }
        seen.concat()
    };
    let (t, u) = (deviations(wanted), deviations(printed));
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    ((dot(&u, &u) / dot(&t, &t)).sqrt(), dot(&t, &u) / (dot(&t, &t) * dot(&u, &u)).sqrt())
}

/// Clamping keeps nothing of a grain that lies wholly outside the gamut; this intent keeps most, at twice the distance
/// at most.
#[test]
fn grain_outside_the_gamut_is_kept() {
    let pixels = Rows::new(24, 24, |x, y| {
        let f = 0.6 + 0.2 * noise(x, y);
        Surface { diffuse: [0.1; 3], f0: [f; 3], alpha: 0.2 }
    });
    let paper = Surface { diffuse: [0.1; 3], f0: [0.0; 3], alpha: 0.2 };
    let printable = printer(&[("substrate", paper), ("F", Surface { f0: [0.5; 3], ..paper })]);
    let run = |intent| {
        let mapped = mapped(&pixels, &printable, intent);
        let print = printed(&mapped, &printable);
        // The reported distance is that of the print.
        let space = &pixels.space;
        let d2 = pixels.rows.iter().zip(&print).map(|(t, u)| space.distance(t, u).powi(2));
        let rms = (d2.sum::<f64>() / print.len() as f64).sqrt();
        assert!((rms - mapped.report.pixels.unwrap().rms).abs() < 1e-5);
        (contrast(space, &pixels.rows, &print), rms)
    };
    let ((clamped, _), error) = run(Intent::Clamp);
    let ((kept, correlation), more) = run(Intent::Contrast);
    assert!(clamped < 0.01 && kept > 0.6 && correlation > 0.9, "{clamped} {kept} {correlation}");
    assert!(more < 2.0 * error, "{error} {more}");
}

/// Pixels in the gamut are printed as clamping prints them, whatever lies beside them; a document in the gamut is the same
/// altogether.
#[test]
fn what_is_in_the_gamut_stays() {
    let printable = coats();
    let inside = |x: usize| Surface { diffuse: [0.3; 3], f0: [0.1 + 0.02 * noise(x, 3); 3], alpha: 0.21 };
    let rows = |pixels: &Rows, intent| printed(&mapped(pixels, &printable, intent), &printable);
    let mixed = Rows::new(20, 20, |x, y| if x < 10 { inside(x) } else { grain(x, y) });
    let (clamped, kept) = (rows(&mixed, Intent::Clamp), rows(&mixed, Intent::Contrast));
    let mut changed = 0;
    for (pixel, (clamped, kept)) in clamped.iter().zip(&kept).enumerate() {
        let d = mixed.space.distance(clamped, &mixed.rows[pixel]);
        assert!(d > 0.005 || clamped == kept, "{pixel}");
        assert!((d < 0.005) == (pixel % 20 < 10), "{pixel}: {d}");
        changed += usize::from(clamped != kept);
    }
    assert!(changed > 150, "{changed}");
    let whole = Rows::new(20, 20, |x, _| inside(x));
    assert_eq!(
        mapped(&whole, &printable, Intent::Clamp).mix,
        mapped(&whole, &printable, Intent::Contrast).mix
    );
}

/// Flat materials side by side, all outside the gamut: none gets a halo from the other.
#[test]
fn flat_materials_have_no_halos() {
    let space = Space::half_angle(32);
    let printable = Printable::from_library(&Library::builtin(), &InkSet::of(Ink::ALL), &space);
    let gold = Surface { diffuse: [0.0; 3], f0: [1.0, 0.77, 0.34], alpha: 0.03 };
    let green = Surface { diffuse: [0.0, 0.5, 0.05], f0: [0.04; 3], alpha: 0.6 };
    let pixels = Rows::new(32, 16, |x, _| if x < 16 { gold } else { green });
    let clamped = printed(&mapped(&pixels, &printable, Intent::Clamp), &printable);
    let kept = printed(&mapped(&pixels, &printable, Intent::Contrast), &printable);
    for (pixel, (clamped, kept)) in clamped.iter().zip(&kept).enumerate() {
        assert!(space.distance(clamped, &pixels.rows[pixel]) > 0.02, "{pixel} is in the gamut");
        let d = space.distance(clamped, kept);
        assert!(d < 0.003, "{pixel}: {d}");
    }
}

#[test]
fn the_result_is_the_same_with_any_number_of_threads() {
    let pixels = Rows::new(37, 50, grain);
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| mapped(&pixels, &coats(), Intent::Contrast))
    };
    assert_eq!(run(1), run(3));
}

/// A problem of 3 x 3 pixels in one kind, with the membership of each pixel at the four nodes around computed here.
struct Small {
    pixels: Rows,
    candidates: Candidates,
    free: Vec<f32>,
}

const NODES: usize = 4;

impl Small {
    fn new() -> Small {
        let pixels = Rows::new(3, 3, |x, y| {
            let f = 0.55 + 0.15 * noise(x, y);
            Surface { diffuse: [0.1; 3], f0: [f, 0.95 * f, 0.9 * f], alpha: 0.2 }
        });
        let mut candidates = Candidates::new(&pixels.space, &coats(), 0.0).unwrap();
        candidates.priced = candidates.free.clone();
        Small { pixels, candidates, free: (0..9).map(|i| 0.2 + 0.1 * i as f32).collect() }
    }

    fn membership(&self, pixel: usize) -> [f64; NODES] {
        let (u, v) = ((pixel % 3) as f64 + 0.5, (pixel / 3) as f64 + 0.5);
        let (u, v) = (u / CELL as f64, v / CELL as f64);
        [(1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v]
    }

    /// The objective without the vectors c, which are means of r; and its gradient in the weights.
    fn objective(&self, weights: &[f64]) -> (f64, Vec<f64>) {
        let (space, curves) = (&self.pixels.space, &self.candidates.curves);
        let (m, k) = (space.columns(), self.candidates.len());
        let mut radiance = vec![0.0; 9 * m];
        let mut r = vec![0.0; 9 * m];
        for (i, r) in r.iter_mut().enumerate() {
            let (pixel, j) = (i / m, i % m);
            let f: f64 = (0..k).map(|q| weights[pixel * k + q] * curves.row(q)[j]).sum();
            let wanted = f64::from(self.pixels.rows[pixel][j] as f32) * space.radiance()[j];
            radiance[i] = f * space.radiance()[j];
            *r = space.weight()[j] * (radiance[i].cbrt() - wanted.cbrt());
        }
        let mut c = vec![0.0; NODES * m];
        for node in 0..NODES {
            let total: f64 = (0..9).map(|pixel| self.membership(pixel)[node]).sum();
            for j in 0..m {
                let sum: f64 = (0..9).map(|pixel| self.membership(pixel)[node] * r[pixel * m + j]).sum();
                c[node * m + j] = sum / total;
            }
        }
        let (mut value, mut gradient) = (0.0, vec![0.0; 9 * k]);
        for (i, &r) in r.iter().enumerate() {
            let (pixel, j) = (i / m, i % m);
            let f = f64::from(self.free[pixel]);
            let mut slope = 2.0 * r / f;
            value += r * r / f;
            for (node, b) in self.membership(pixel).into_iter().enumerate() {
                let d = r - c[node * m + j];
                value += CONTRAST * b * d * d;
                slope += 2.0 * CONTRAST * b * d;
            }
            slope *= space.weight()[j] / (3.0 * radiance[i].cbrt().powi(2)) * space.radiance()[j];
            (0..k).for_each(|q| gradient[pixel * k + q] += slope * curves.row(q)[j]);
        }
        (value, gradient)
    }

    /// Projected gradient over all weights at once, with backtracking.
    fn descend(&self, mut weights: Vec<f64>, steps: usize) -> f64 {
        let k = self.candidates.len();
        let mut length = 1e-2;
        let (mut value, mut gradient) = self.objective(&weights);
        for _ in 0..steps {
            length *= 2.0;
            loop {
                let mut trial: Vec<f64> =
                    weights.iter().zip(&gradient).map(|(w, g)| w - length * g).collect();
                trial.chunks_exact_mut(k).for_each(project);
                let (next, slope) = self.objective(&trial);
                let promised: f64 =
                    weights.iter().zip(&trial).zip(&gradient).map(|((w, t), g)| (w - t) * g).sum();
                if next <= value - 1e-4 * promised {
                    (weights, value, gradient) = (trial, next, slope);
                    break;
                }
                length *= 0.5;
                if length < 1e-14 {
                    return value;
                }
            }
        }
        value
    }
}

/// The nearest point of the simplex.
fn project(point: &mut [f64]) {
    let mut sorted = point.to_vec();
    sorted.sort_by(|a, b| b.total_cmp(a));
    let (mut sum, mut level) = (0.0, 0.0);
    for (i, &v) in sorted.iter().enumerate() {
        sum += v;
        if v - (sum - 1.0) / (i + 1) as f64 > 0.0 {
            level = (sum - 1.0) / (i + 1) as f64;
        }
    }
    point.iter_mut().for_each(|v| *v = (*v - level).max(0.0));
}

/// The gradient above is that of the objective, the sweeps lower the objective each time, and they end where an independent
/// solver ends.
#[test]
fn sweeps_reach_the_minimum_of_the_objective() {
    let small = Small::new();
    let k = small.candidates.len();
    let weights =
        |shares: &[u16]| shares.iter().map(|&s| f64::from(s) / f64::from(ONE)).collect::<Vec<f64>>();

    let even = vec![1.0 / k as f64; 9 * k];
    let (value, gradient) = small.objective(&even);
    for i in [0, 7, 17, 35] {
        let mut moved = even.clone();
        moved[i] += 1e-6;
        let slope = (small.objective(&moved).0 - value) / 1e-6;
        assert!((slope - gradient[i]).abs() < 1e-3 * (1.0 + slope.abs()), "{i}: {slope} {}", gradient[i]);
    }

    let mut clamped = clamp::map(&small.candidates, &small.pixels, &Silent).unwrap();
    let mut regions = Regions::new(3, 3, &looks(&small.candidates, &small.pixels).unwrap());
    let start = small.objective(&weights(&clamped.shares)).0;
    let mut last = start;
    for sweep in 0..200 {
        let pass = if sweep == 0 { Pass::Measure } else { Pass::Solve };
        let sums =
            run(&small.candidates, &small.pixels, &mut clamped, &small.free, &regions, pass, 1).unwrap();
        regions.take_means(&sums);
        let value = small.objective(&weights(&clamped.shares)).0;
        // The first c are not the means that the objective assumes. Weights are rounded to 1/32768.
        assert!(sweep < 2 || value <= last + 1e-6, "sweep {sweep}: {last} {value}");
        last = value;
    }
    let independent = small.descend(even, 20_000);
    assert!(start > 1.1 * last, "{start} {last}");
    assert!((last - independent).abs() < 1e-4 * last, "{last} {independent}");
}
