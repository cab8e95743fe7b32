//! What the weight of the distance in light buys: materials fitted at several weights, lit as balls under light probes, and
//! how near that comes to the best that any metric could do.
//!
//! Whatever metric chooses mixtures, it chooses from the same ones. So the bound asks the solver for the mixtures whose balls are
//! right: the columns of its hull are the pixels of the balls themselves, beside those of distance d, with a weight that is
//! raised until d is what the metric pays.
//!
//! `weights`, `bounds` and `widths` are tables of `docs/decisions/metric-that-knows-light.md`.

use std::path::Path;

use appearance::brdf::{Space, Table};
use appearance::document::{self, Materials, Options, Surface};
use appearance::gamut::{self, GamutSettings, Intent, LIGHT, Printable};
use appearance::solve::{Hull, Mixer};
use inks::{InkSet, Library};
use observe::Silent;
use protocol::ink::Ink;

use press::preview::sphere::under_probe;
use press::preview::{Probe, Radiance, mix_in_words};

/// One material on one pixel.
pub struct One(pub Space, pub Vec<f32>);

impl Materials for One {
    fn width(&self) -> usize {
        1
    }
    fn height(&self) -> usize {
        1
    }
    fn space(&self) -> &Space {
        &self.0
    }
    fn reflectance(&self, _: usize, out: &mut [f32]) {
        out.copy_from_slice(&self.1);
    }
}

/// A row of a surface.
pub fn surface(space: &Space, diffuse: [f32; 3], f0: [f32; 3], alpha: f32) -> Vec<f64> {
    space.row(&Surface { diffuse, f0, alpha }.curve(space.angles()))
}

/// Root mean square difference of the cube roots of two balls, relative to that of the first from black.
fn off(target: &Radiance, printed: &Radiance) -> f64 {
    let (mut sum, mut all) = (0.0, 0.0);
    for (a, b) in target.pixels.iter().zip(&printed.pixels).filter(|(a, _)| a[3] == 1.0) {
        for c in 0..3 {
            let (a, b) = (f64::from(a[c].max(0.0)).cbrt(), f64::from(b[c].max(0.0)).cbrt());
            sum += (a - b).powi(2);
            all += a * a;
        }
    }
    (sum / all).sqrt()
}

/// Twelve pixels of a document, evenly spread down its length.
pub fn twelve(pixels: &dyn Materials) -> impl Iterator<Item = usize> {
    let (width, total) = (pixels.width(), pixels.width() * pixels.height());
    (0..12).map(move |i| (2 * i + 1) * total / 24 + i * 37 % width)
}

/// The reflectance of these pixels.
fn materials(path: &Path, space: &Space) -> Table {
    let document = document::open(&path.display().to_string(), &Options::default(), &Silent).unwrap();
    let pixels = document.materials();
    let mut rows = Table::new(space.columns());
    let mut row = vec![0f32; space.columns()];
    for pixel in twelve(pixels) {
        pixels.reflectance(pixel, &mut row);
        rows.push(&row.iter().map(|&f| f64::from(f)).collect::<Vec<_>>());
    }
    rows
}

/// Error of balls under each probe, root mean square over materials: each target is followed by its print.
pub fn errors_of_balls(space: &Space, both: &Table, probes: &[Probe; 3]) -> [f64; 3] {
    probes.each_ref().map(|probe| {
        let balls = under_probe(space, both, probe, 48, &Silent).unwrap();
        let sum: f64 = balls.chunks(2).map(|pair| off(&pair[0], &pair[1]).powi(2)).sum();
        (sum / (both.len() / 2) as f64).sqrt()
    })
}

/// The materials of the tables.
pub fn documents(data: &Path, space: &Space) -> Vec<(String, Table)> {
    let silver = [0.972, 0.960, 0.915];
    let mut documents: Vec<(String, Table)> = Vec::new();
    let mut one = |name: &str, row: Vec<f64>| {
        let mut table = Table::new(space.columns());
        table.push(&row);
        documents.push((name.into(), table));
    };
    for alpha in [0.02, 0.04, 0.06, 0.1, 0.2, 0.3] {
        one(&format!("silver {alpha}"), surface(space, [0.0; 3], silver, alpha));
    }
    one("gold .15", surface(space, [0.0; 3], [1.0, 0.782, 0.344], 0.15));
    one("red plastic .1", surface(space, [0.4, 0.03, 0.03], [0.04; 3], 0.1));
    one("blue plastic .3", surface(space, [0.03, 0.06, 0.3], [0.04; 3], 0.3));
    for name in ["rustymetal", "helmet_metal", "helmet_leather"] {
        documents.push((name.into(), materials(&data.join("svbrdf").join(name), space)));
    }
    documents
}

/// Two measured light probes and the built-in one.
pub fn probes(data: &Path) -> [Probe; 3] {
    let measured = |name: &str| Probe::read(&data.join("env").join(name)).unwrap().resized(64);
    [measured("studio.hdr"), measured("venice.hdr"), Probe::studio(64)]
}

/// What each weight buys.
pub fn weights(data: &Path) {
    let space = Space::half_angle(32);
    let documents = documents(data, &space);
    let probes = probes(data);
    let library = Library::builtin();
    for (inks, set) in [("default", InkSet::default()), ("all", InkSet::of(Ink::ALL))] {
        let printable = Printable::from_library(&library, &set, &space);
        for (name, targets) in &documents {
            for light in [0.0, 0.2, LIGHT, 0.3, 0.4] {
                let settings = GamutSettings {
                    intent: Intent::Clamp,
                    light,
                    most_cartridges: 13,
                    ..GamutSettings::default()
                };
                let mut both = Table::new(space.columns());
                let (mut d, mut l) = (0.0, 0.0);
                let mut words = String::new();
                for row in targets.rows() {
                    let pixel = One(space.clone(), row.iter().map(|&f| f as f32).collect());
                    let mapped = gamut::clamped(&pixel, &printable, &settings, &Silent).unwrap();
                    let material = &mapped.report.materials[0];
                    d += material.distance.powi(2);
                    l += material.light.powi(2);
                    if targets.len() == 1 {
                        words = mix_in_words(&material.weights);
                    }
                    both.push(row);
                    both.push(&material.printed);
                }
                let n = targets.len() as f64;
                let seen = errors_of_balls(&space, &both, &probes).map(|error| format!("{error:.3}"));
                let (d, l) = ((d / n).sqrt(), (l / n).sqrt());
                println!(
                    "{inks:8} {name:16} {light:.2}  d {d:.4}  light {l:.4}  {}  {words}",
                    seen.join("  ")
                );
            }
        }
    }
}

/// What a wider lobe alone costs: silver that reflects as much as the target's, its lobe as wide as printed foil or narrower.
pub fn widths(data: &Path) {
    let space = Space::half_angle(32);
    let silver = |alpha| surface(&space, [0.0; 3], [0.972, 0.960, 0.915], alpha);
    let probes = probes(data);
    for alpha in [0.025, 0.03, 0.035, 0.04, 0.045, 0.06] {
        let mut both = Table::new(space.columns());
        both.push(&silver(0.02));
        both.push(&silver(alpha));
        let [studio, venice, soft] = errors_of_balls(&space, &both, &probes);
        println!("alpha {alpha:.3}  studio {studio:.3}  Venice {venice:.3}  soft {soft:.3}");
    }
}

/// Root mean squares over materials: distance d, and the error of balls under each probe.
#[derive(Clone, Copy)]
struct Figures {
    d: f64,
    balls: [f64; 3],
}

impl Figures {
    /// Root mean square over the probes.
    fn mean(&self) -> f64 {
        (self.balls.iter().map(|e| e * e).sum::<f64>() / 3.0).sqrt()
    }
}

/// Targets and stacks, their curves beside their balls under every probe: the rows of one space, whose columns all mix.
struct Bench {
    space: Space,
    curves: usize,
    stacks: Table,
    targets: Table,
    /// For each target and probe, the sum of the cube roots squared, by which errors are relative.
    brightness: Vec<[f64; 3]>,
    /// Pixels of a ball.
    pixels: usize,
}

impl Bench {
    fn new(space: &Space, stacks: &Table, targets: &Table, probes: &[Probe; 3]) -> Bench {
        let mut rows = Table::new(space.columns());
        stacks.rows().chain(targets.rows()).for_each(|row| rows.push(row));
        let balls = probes.each_ref().map(|probe| under_probe(space, &rows, probe, 20, &Silent).unwrap());
        // Whole pixels only, so that every pixel counts alike.
        let lit = |ball: &Radiance| -> Vec<f64> {
            let inside = ball.pixels.iter().filter(|p| p[3] == 1.0);
            inside.flat_map(|p| [p[0], p[1], p[2]].map(|v| f64::from(v.max(0.0)))).collect()
        };
        let pixels = lit(&balls[0][0]).len() / 3;
        let mut all = Table::new(space.columns() + 9 * pixels);
        for (i, row) in rows.rows().enumerate() {
            let balls = balls.iter().flat_map(|balls| lit(&balls[i]));
            all.push(&row.iter().copied().chain(balls).collect::<Vec<_>>());
        }
        let part = |range: std::ops::Range<usize>| {
            let mut part = Table::new(all.columns());
            range.for_each(|i| part.push(all.row(i)));
            part
        };
        let targets = part(stacks.len()..all.len());
        let roots = |ball: &[f64]| ball.iter().map(|v| v.cbrt().powi(2)).sum::<f64>();
        let brightness = targets
            .rows()
            .map(|row| std::array::from_fn(|k| roots(&row[space.columns() + 3 * pixels * k..][..3 * pixels])))
            .collect();
        Bench {
            space: space.clone(),
            curves: space.columns(),
            stacks: part(0..stacks.len()),
            targets,
            brightness,
            pixels,
        }
    }

    /// The mixtures that are best by `d^2 + sum of price times squared error of balls`, from the mixtures given.
    fn best(&self, price: [f64; 3], weights: &mut [Vec<f64>]) -> Figures {
        let (mut d, mut balls) = (0.0, [0.0; 3]);
        for (i, weights) in weights.iter_mut().enumerate() {
            let one = |j: usize| (self.space.radiance()[3 * j], self.space.weight()[3 * j].powi(2));
            let of_curve = (0..self.curves / 3).map(one);
            let of_balls = (0..3).flat_map(|k| vec![(1.0, price[k] / self.brightness[i][k]); self.pixels]);
            let (cosine, measure): (Vec<f64>, Vec<f64>) = of_curve.chain(of_balls).unzip();
            let space = Space::tabulated(&cosine, &measure).unwrap();
            let hull = Hull::new(&space, &self.stacks, &vec![0.0; self.stacks.len()], 0.0).unwrap();
            let target = hull.target(self.targets.row(i)).unwrap();
            let mut mixer = Mixer::new();
            if weights.is_empty() {
                weights.resize(self.stacks.len(), 0.0);
                mixer.tangent(&hull, &target, weights).unwrap();
            }
            mixer.refine(&hull, &target, weights, 1e-9).unwrap();
            let seen = self.seen(i, weights);
            d += seen.d.powi(2);
            balls.iter_mut().zip(seen.balls).for_each(|(sum, e)| *sum += e * e);
        }
        let n = weights.len() as f64;
        Figures { d: (d / n).sqrt(), balls: balls.map(|sum| (sum / n).sqrt()) }
    }

    /// What a mixture looks like beside its target.
    fn seen(&self, i: usize, weights: &[f64]) -> Figures {
        let mut mix = vec![0.0; self.stacks.columns()];
        for (row, &w) in self.stacks.rows().zip(weights).filter(|(_, w)| **w > 0.0) {
            mix.iter_mut().zip(row).for_each(|(sum, v)| *sum += w * v);
        }
        let target = self.targets.row(i);
        let apart = |k: usize| {
            let range = self.curves + 3 * self.pixels * k..self.curves + 3 * self.pixels * (k + 1);
            let both = mix[range.clone()].iter().zip(&target[range]);
            both.map(|(a, b)| (a.cbrt() - b.cbrt()).powi(2)).sum::<f64>()
        };
        Figures {
            d: self.space.distance(&mix[..self.curves], &target[..self.curves]),
            balls: std::array::from_fn(|k| (apart(k) / self.brightness[i][k]).sqrt()),
        }
    }

    /// The mixtures of the metric with this weight of light.
    fn metric(&self, light: f64) -> (Figures, Vec<Vec<f64>>) {
        let part = |table: &Table| {
            let mut part = Table::new(self.curves);
            table.rows().for_each(|row| part.push(&row[..self.curves]));
            part
        };
        let stacks = part(&self.stacks);
        let hull = Hull::new(&self.space, &stacks, &vec![0.0; stacks.len()], light).unwrap();
        let mut mixer = Mixer::new();
        let weights: Vec<Vec<f64>> = part(&self.targets)
            .rows()
            .map(|row| mixer.best(&hull, &hull.target(row).unwrap()).unwrap().weights)
            .collect();
        let n = weights.len() as f64;
        let seen: Vec<Figures> =
            weights.iter().enumerate().map(|(i, weights)| self.seen(i, weights)).collect();
        let mean = |f: &dyn Fn(&Figures) -> f64| (seen.iter().map(|s| f(s).powi(2)).sum::<f64>() / n).sqrt();
        (Figures { d: mean(&|s| s.d), balls: std::array::from_fn(|k| mean(&|s| s.balls[k])) }, weights)
    }

    /// The least error of balls that mixtures have whose distance d is at most this: the price is raised up to there.
    fn least(&self, of: [f64; 3], d: f64, start: &[Vec<f64>]) -> Option<Figures> {
        let (mut low, mut high) = (-6.0f64, 3.0f64);
        let mut least = None;
        for _ in 0..9 {
            let middle = 0.5 * (low + high);
            let mut weights = start.to_vec();
            let found = self.best(of.map(|share| share * 10f64.powf(middle)), &mut weights);
            if found.d <= d {
                (low, least) = (middle, Some(found));
            } else {
                high = middle;
            }
        }
        least
    }
}

/// How near the metric comes to the best that any could do.
pub fn bounds(data: &Path) {
    let space = Space::half_angle(32);
    let (documents, probes) = (documents(data, &space), probes(data));
    let library = Library::builtin();
    let each = [1.0 / 3.0; 3];
    let words = |f: &Figures| format!("d {:.4} {:.3?} mean {:.4}", f.d, f.balls, f.mean());
    for (inks, set) in [("default", InkSet::default()), ("all", InkSet::of(Ink::ALL))] {
        let listed = Printable::from_library(&library, &set, &space);
        let allowed = Printable::combined(&library, &set, &space);
        for (name, targets) in &documents {
            for (stacks, printable) in [("listed", &listed), ("allowed", &allowed)] {
                let bench = Bench::new(&space, &printable.curves, targets, &probes);
                let (paper, _) = bench.metric(0.0);
                let (ours, start) = bench.metric(LIGHT);
                println!("{inks} {name}, {} {stacks} stacks", printable.stacks.len());
                println!("  paper {}", words(&paper));
                println!("  light {}", words(&ours));
                for (share, d) in [("as much", ours.d), ("8 % more", 1.08 * paper.d)] {
                    match bench.least(each, 1.0001 * d, &start) {
                        Some(found) => println!("  least at {share} d {}", words(&found)),
                        None => println!("  none at {share} d"),
                    }
                }
                for k in 0..3 {
                    let price = std::array::from_fn(|j| if j == k { 1e3 } else { 0.0 });
                    let found = bench.best(price, &mut start.clone());
                    println!("  least at any d under probe {k}: {:.4} at d {:.4}", found.balls[k], found.d);
                }
            }
        }
    }
}
