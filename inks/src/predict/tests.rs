//! The fit against answers known by construction, derivatives in closed form, and a second solver.

use protocol::ink::Ink;

use super::*;
use crate::ggx;
use crate::library::Entry;
use crate::provenance::Provenance;
use crate::uncertainty::Uncertainty;

/// Normal deviates from a fixed sequence.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        let mut uniform = || {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 40) as f64 / f64::from(1u32 << 24)
        };
        (0..12).map(|_| uniform()).sum::<f64>() - 6.0
    }
}

/// A ribbon set that differs from the built-in one in every figure, by up to a factor of 1.5.
fn other_inks() -> Optics {
    let mut optics = figures::prepared(Library::builtin().optics());
    let slots = figures::slots(&mut optics, &Ink::ALL);
    let mut noise = Noise(7);
    for slot in slots {
        let was = slot.get(&mut optics).unwrap();
        let [least, most] = slot.range();
        let off = (0.5 * slot.spread(was) * noise.next()).clamp(-0.4, 0.4).exp();
        // A filter passes less than all light, and paper reflects less.
        let most = if matches!(slot, Slot::Paper(_) | Slot::Solid(..)) { 0.8 } else { most };
        slot.set(&mut optics, (was * off).clamp(least, most));
    }
    optics
}

/// The built-in library with these stacks measured: what `truth` reflects, with relative noise.
fn library(truth: &Optics, stacks: &[&str], noise: f64) -> Library {
    library_of(&|stack, t| truth.lobes(stack).unwrap().at(t), stacks, noise)
}

/// The same of any function of stack and half angle.
fn library_of(truth: &dyn Fn(&Stack, f64) -> [f64; 3], stacks: &[&str], noise: f64) -> Library {
    let mut library = Library::builtin();
    let mut random = Noise(1);
    for stack in stacks {
        let stack: Stack = stack.parse().unwrap();
        let theta: Vec<f64> = (0..60).map(|i| 1.38 * (f64::from(i) / 59.0).powi(2)).collect();
        let curve = Curve::sampled(&theta, |t| truth(&stack, t).map(|v| v * (noise * random.next()).exp()));
        let mut text = "theta_h_deg,r_sigma,g_sigma,b_sigma\n".to_owned();
        for (t, v) in theta.iter().zip(curve.rgb()) {
            text += &format!("{},{},{},{}\n", t.to_degrees(), noise * v[0], noise * v[1], noise * v[2]);
        }
        let uncertainty = Uncertainty::from_csv(&text, "test.csv".as_ref()).unwrap();
        let provenance =
            Provenance::Measured { by: "A".into(), when: "2026-11".into(), setup: "a can".into() };
        let place = library.entries.iter().position(|entry| entry.stack == stack).unwrap();
        let number = library.entries[place].number;
        library.entries[place] = Entry { number, stack, curve, uncertainty, lobes: None, provenance };
    }
    library
}

/// Twenty stacks in which each figure but those of gold and cyan flakes matters.
const MEASURED: [&str; 20] = [
    "substrate",
    "C",
    "M",
    "Y",
    "K",
    "MS",
    "SF",
    "F",
    "P",
    "C+M",
    "M+Y",
    "C+F",
    "K+F",
    "MS+F",
    "SF+F",
    "MS+C",
    "MS+Y",
    "SF+M",
    "P+SF",
    "P+MS",
];

#[test]
fn figures_known_by_construction_are_found_again_from_noisy_curves() {
    let mut truth = other_inks();
    let found = library(&truth, &MEASURED, 0.02).predict(|| {}).unwrap();
    let slots = figures::slots(&mut truth.clone(), &Ink::ALL);
    let (mut determined, mut within) = (0, 0);
    for figure in &found.figures {
        let slot = slots.iter().find(|slot| slot.name() == figure.name).unwrap();
        let exact = slot.get(&mut truth).unwrap();
        let off = (figure.value / exact).ln();
        within += usize::from(off.abs() <= 2.0 * figure.uncertainty);
        if figure.uncertainty < 0.05 {
            determined += 1;
            assert!(off.abs() < 0.1, "{}: {} not {exact}", figure.name, figure.value);
        }
    }
    println!("{determined} of {} figures within 5 %, {within} within two deviations", found.figures.len());
    assert!(determined >= 30 && within * 20 >= found.figures.len() * 17, "{determined} {within}");
    // What matters most, each against its own truth.
    for (name, most) in
        [("metallic-silver.alpha", 0.02), ("silver-foil.alpha", 0.02), ("cyan.solid.green", 0.03)]
    {
        let figure = found.figures.iter().find(|f| f.name == name).unwrap();
        let exact = slots.iter().find(|s| s.name() == name).unwrap().get(&mut truth).unwrap();
        assert!((figure.value / exact - 1.0).abs() < most, "{name}: {} not {exact}", figure.value);
    }
}

/// The errors of predictions and of the built-in figures, both relative, and the share of samples in the band.
fn judged(found: &Prediction, truth: &dyn Fn(&Stack, f64) -> [f64; 3]) -> Vec<(f64, f64, f64)> {
    let built_in = Library::builtin();
    let rms = |squares: &[f64]| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
    let one = |predicted: &Predicted| {
        let old = built_in.optics().lobes(&predicted.stack).unwrap();
        let (mut new_off, mut old_off, mut inside) = (Vec::new(), Vec::new(), 0.0);
        for (k, &t) in predicted.curve.theta().iter().enumerate().filter(|(_, t)| **t <= WIDEST) {
            let (p, e, o) = (predicted.curve.rgb()[k], truth(&predicted.stack, t), log(old.at(t)));
            for c in 0..3 {
                new_off.push((log(p)[c] - log(e)[c]).powi(2));
                old_off.push((o[c] - log(e)[c]).powi(2));
                inside += f64::from(u8::from((p[c] - e[c]).abs() <= 2.0 * predicted.sigma[k][c]));
            }
        }
        let found = (rms(&new_off), rms(&old_off), inside / new_off.len() as f64);
        let name = predicted.stack.to_string();
        println!(
            "{name:<8} {:>5.1} %, modelled {:>5.1} %, {:.2} inside",
            100.0 * found.0,
            100.0 * found.1,
            found.2
        );
        found
    };
    found.stacks.iter().map(one).collect()
}

#[test]
fn stacks_that_were_not_measured_are_predicted_within_their_bands() {
    let truth = other_inks();
    let found = library(&truth, &MEASURED, 0.02).predict(|| {}).unwrap();
    println!("leave-one-out error {:.1} %", 100.0 * found.error.unwrap());
    assert!(found.error.unwrap() < 0.12);
    let judged = judged(&found, &|stack, t| truth.lobes(stack).unwrap().at(t));
    assert!(
        judged.len() >= 15
            && judged.iter().all(|(new, old, inside)| *new < 0.02 && *old > 0.1 && *inside > 0.95)
    );
    // Gold and the flakes of cyan and magenta are in no measured stack.
    assert!(found.stacks.iter().all(|s| !s.stack.to_string().contains('G')));
    assert!(found.unknown.iter().any(|s| s.to_string() == "MG+C"));
    assert_eq!(found.stacks.len() + found.unknown.len() + MEASURED.len(), 57);
}

/// Inks that do what the model does not know: resin on resin takes less, lobes have a second, wider part. The error is larger,
/// leaving out finds most of it, and so the bands hold most of it, also those of three process inks on each other, of which no stack
/// was measured.
#[test]
fn what_the_model_cannot_express_widens_the_bands() {
    for (lighter, haze) in [(0.1, 0.15), (0.05, 0.0)] {
        unknown_to_the_model(lighter, haze);
    }
}

/// Each layer of resin on another makes the exponent of the filters less by `lighter`; a lobe twice as wide has a share `haze`.
fn unknown_to_the_model(lighter: f64, haze: f64) {
    let inks = other_inks();
    let truth = |stack: &Stack, t: f64| {
        let mut lobes = inks.lobes(stack).unwrap();
        let resin = stack.layers().iter().filter(|ink| ink.kind() == protocol::ink::Kind::Process).count();
        let over = f64::from(u8::try_from(resin.saturating_sub(1)).unwrap());
        lobes.kd = lobes.kd.map(|v| v.powf(1.0 - lighter * over));
        let haze = lobes
            .lobes
            .iter()
            .map(|l| crate::Lobe { f0: l.f0.map(|v| haze * v), alpha: (2.0 * l.alpha).min(1.0) });
        let haze: Vec<_> = haze.collect();
        lobes.lobes.extend(haze);
        lobes.at(t)
    };
    let found = library_of(&truth, &MEASURED, 0.02).predict(|| {}).unwrap();
    println!("leave-one-out error {:.1} %", 100.0 * found.error.unwrap());
    let judged = judged(&found, &truth);
    let mean = |of: fn(&(f64, f64, f64)) -> f64| judged.iter().map(of).sum::<f64>() / judged.len() as f64;
    println!("mean error {:.3}, modelled {:.3}, inside {:.3}", mean(|j| j.0), mean(|j| j.1), mean(|j| j.2));
    assert!(mean(|j| j.0) < 0.5 * mean(|j| j.1) && mean(|j| j.2) > 0.9, "{judged:?}");
    for name in ["C+M+Y", "C+M+Y+F"] {
        let place = found.stacks.iter().position(|s| s.stack == name.parse().unwrap()).unwrap();
        let Predicted { curve, sigma, .. } = &found.stacks[place];
        let squares =
            sigma.iter().zip(curve.rgb()).flat_map(|(s, v)| (0..3).map(|c| (s[c] / (v[c] + FLOOR)).powi(2)));
        let band = (squares.sum::<f64>() / (3 * sigma.len()) as f64).sqrt();
        let (off, _, inside) = judged[place];
        println!("{name}: off by {off:.3}, {inside:.2} inside a band of {band:.3}");
        // Wide enough, and not so wide that it says nothing.
        assert!(inside > 0.85 && band < 3.0 * off, "{name}: {off}, {inside} inside {band}");
    }
}

/// Ink on metal takes half as much again as the model knows, and of it one stack is measured: leaving that one out says how wrong the model
/// is for its kind, and the bands of the others of the kind hold the truth. Inks on paper, which the model knows, keep a narrow band.
#[test]
fn the_band_of_a_kind_is_that_of_the_one_that_was_left_out() {
    let inks = other_inks();
    let metal = |ink: &Ink| matches!(ink.kind(), Kind::Metallic | Kind::Foil);
    let truth = |stack: &Stack, t: f64| {
        let light = inks.lobes(stack).unwrap().at(t);
        if !stack.layers().iter().any(metal) {
            return light;
        }
        let bare: Vec<Ink> =
            stack.layers().iter().copied().filter(|ink| ink.kind() != Kind::Process).collect();
        let bare = inks.lobes(&Stack::new(bare)).unwrap().at(t);
        std::array::from_fn(|c| bare[c] * (light[c] / bare[c]).powf(1.5))
    };
    let measured = ["substrate", "C", "M", "Y", "K", "MS", "F", "MS+C", "C+M", "C+F", "MS+F"];
    let found = library_of(&truth, &measured, 0.02).predict(|| {}).unwrap();
    let judged = judged(&found, &truth);
    let of = |name: &str| found.stacks.iter().position(|s| s.stack == name.parse().unwrap()).unwrap();
    for name in ["MS+M", "MS+Y", "MS+K"] {
        let (off, _, inside) = judged[of(name)];
        assert!(off > 0.1 && inside > 0.9, "{name}: {off}, {inside}");
    }
    let band = |name: &str| {
        let Predicted { curve, sigma, .. } = &found.stacks[of(name)];
        curve.rgb().iter().zip(sigma).map(|(v, s)| s[1] / (v[1] + FLOOR)).sum::<f64>() / sigma.len() as f64
    };
    println!("bands: M+Y {:.3}, MS+M {:.3}", band("M+Y"), band("MS+M"));
    assert!(band("M+Y") < 0.5 * band("MS+M"));
}

/// Leaving out: a stack whose ink no other has cannot be, and a wrong curve is found out by the others.
#[test]
fn a_wrong_measurement_has_the_largest_leave_one_out_error() {
    let truth = other_inks();
    let mut library = library(&truth, &["substrate", "C", "M", "C+M", "C+F", "M+F", "C+M+F", "K"], 0.01);
    let wrong: Stack = "C+M".parse().unwrap();
    let entry = library.entries.iter_mut().find(|entry| entry.stack == wrong).unwrap();
    entry.curve =
        Curve::sampled(entry.curve.theta(), |t| truth.lobes(&wrong).unwrap().at(t).map(|v| 1.5 * v));
    let found = library.predict(|| {}).unwrap();
    let of =
        |stack: &str| found.measured.iter().find(|l| l.stack == stack.parse().unwrap()).unwrap().left_out;
    assert_eq!((of("K"), of("substrate")), (None, None));
    let worst =
        found.measured.iter().max_by(|a, b| a.left_out.unwrap_or(0.0).total_cmp(&b.left_out.unwrap_or(0.0)));
    assert_eq!(worst.unwrap().stack, wrong, "{:?}", found.measured);
    assert!(of("C+M").unwrap() > 0.3);
}

#[test]
fn without_a_measurement_there_is_nothing_to_predict_from() {
    assert!(matches!(Library::builtin().predict(|| {}), Err(PredictError::NothingMeasured)));
}

/// The derivatives of bare paper by its figures, on paper: f = e kd / pi + F0 L(alpha).
#[test]
fn derivatives_agree_with_the_closed_form() {
    let mut optics = other_inks();
    let paper = Stack::SUBSTRATE;
    let theta = [0.0, 0.1, 0.4, 0.9, 1.3];
    let entering = 1.0 - optics.model.interface.get();
    let (f0, alpha) = (optics.paper.f0.get(), optics.paper.alpha.get());
    let kd = lab_of(&optics);
    for (k, &t) in theta.iter().enumerate() {
        let f: [f64; 3] = kd.map(|v| entering * v / std::f64::consts::PI + f0 * ggx::lobe(t, alpha));
        for c in 0..3 {
            let slot = Slot::Paper(c);
            let x = slot.get(&mut optics).unwrap().ln();
            let found = slopes(&mut optics, slot, x, &paper, &theta)[k];
            let exact = entering * kd[c] / std::f64::consts::PI / (f[c] + FLOOR);
            assert!((found[c] - exact).abs() < 1e-6, "{found:?} {exact}");
            assert!((0..3).all(|other| other == c || found[other].abs() < 1e-6));
        }
        let found = slopes(&mut optics, Slot::PaperF0, f0.ln(), &paper, &theta)[k];
        for c in 0..3 {
            assert!((found[c] - f0 * ggx::lobe(t, alpha) / (f[c] + FLOOR)).abs() < 1e-6);
        }
        // d ln L / d ln alpha of D and G, each differentiated by hand.
        let (sin, cos) = t.sin_cos();
        let a2 = alpha * alpha;
        let d = cos * cos * (a2 - 1.0) + 1.0;
        let tan2 = (sin / cos).powi(2);
        let slope = 2.0 - 4.0 * cos * cos * a2 / d - a2 * tan2 / (1.0 + a2 * tan2);
        let found = slopes(&mut optics, Slot::PaperAlpha, alpha.ln(), &paper, &theta)[k];
        for c in 0..3 {
            let exact = slope * f0 * ggx::lobe(t, alpha) / (f[c] + FLOOR);
            assert!((found[c] - exact).abs() < 1e-6, "{} {exact}", found[c]);
        }
    }
}

fn lab_of(optics: &Optics) -> [f64; 3] {
    crate::lab::to_linear_rgb(optics.paper.lab.get())
}

/// A search along one number after the other needs no derivative. It ends where the fit does.
#[test]
fn a_second_solver_finds_the_same_figures() {
    let truth = other_inks();
    let library = library(&truth, &["substrate", "K", "K+F"], 0.02);
    let data = measured(&library);
    let all: Vec<&Data> = data.iter().collect();
    let from = library.optics();
    let fitted = fit(from, &all, None).unwrap();
    let start = figures::prepared(from);
    let prior: Vec<f64> = fitted.slots.iter().map(|s| s.get(&mut start.clone()).unwrap()).collect();
    let cost = |x: &[f64]| {
        let mut optics = start.clone();
        put(&mut optics, &fitted.slots, x);
        let priors = x.iter().zip(&prior).zip(&fitted.slots);
        let priors: f64 = priors.map(|((x, p), s)| ((x - p.ln()) / s.spread(*p)).powi(2)).sum();
        let fits = all.iter().map(|d| residuals(&optics, d).unwrap().iter().map(|r| r * r).sum::<f64>());
        0.5 * (priors + fits.sum::<f64>())
    };
    // Pattern search (Hooke and Jeeves): steps along each number, then along the sum of those that helped.
    let mut x: Vec<f64> = prior.iter().map(|p| p.ln()).collect();
    let bounds: Vec<[f64; 2]> = fitted.slots.iter().map(|s| s.range().map(f64::ln)).collect();
    let explore = |mut x: Vec<f64>, step: f64| {
        let mut best = cost(&x);
        for i in 0..x.len() {
            for way in [step, -step] {
                let was = x[i];
                x[i] = (was + way).clamp(bounds[i][0], bounds[i][1]);
                let found = cost(&x);
                if found < best {
                    best = found;
                    break;
                }
                x[i] = was;
            }
        }
        (x, best)
    };
    let (mut step, mut best) = (0.1, cost(&x));
    while step > 1e-4 {
        let (found, reached) = explore(x.clone(), step);
        if reached >= best {
            step *= 0.5;
            continue;
        }
        let further: Vec<f64> =
            (0..x.len()).map(|i| (2.0 * found[i] - x[i]).clamp(bounds[i][0], bounds[i][1])).collect();
        (x, best) = (found, reached);
        let (found, reached) = explore(further, step);
        if reached < best {
            (x, best) = (found, reached);
        }
    }
    let ours = cost(&fitted.x);
    println!("cost of the fit {ours}, of the pattern search {best}");
    assert!(ours <= best * (1.0 + 1e-6), "{ours} {best}");
    assert!(best <= ours * 1.01, "the second solver ends elsewhere: {ours} {best}");
}
