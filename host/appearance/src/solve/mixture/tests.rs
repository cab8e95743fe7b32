//! Against finite differences, a second minimiser, exact mixtures, random rivals and the measured materials.

use std::path::PathBuf;

use inks::{Curve, InkSet, Library};
use proptest::prelude::*;
use protocol::ink::Ink;

use super::super::hull::LAYER_PRICE;
use super::*;
use crate::brdf::{Space, Table};
use crate::gamut::Printable;

fn library(space: &Space) -> Table {
    Printable::from_library(&Library::builtin(), &InkSet::of(Ink::ALL), space).curves
}

fn hull_of(space: &Space, curves: &Table) -> Hull {
    Hull::new(space, curves, &vec![0.0; curves.len()], 0.0).unwrap()
}

/// The objective of a mixture.
fn at(hull: &Hull, weights: &[f64], target: &Target) -> f64 {
    Mixer::new().objective(hull, target, weights)
}

fn mixture(curves: &Table, weights: &[f64]) -> Vec<f64> {
    let mut row = vec![0.0; curves.columns()];
    weights.iter().enumerate().for_each(|(k, &w)| add_scaled(&mut row, w, curves.row(k)));
    row
}

/// The measured materials, or `None` with a message if they are not available.
fn measured(space: &Space) -> Option<Vec<(String, Vec<f64>)>> {
    let folder = testing::needs::data()?.join("brdf/curves_avg");
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|f| f.unwrap().path()).collect();
    files.sort();
    let name = |p: &PathBuf| p.file_stem().unwrap().to_string_lossy().into_owned();
    Some(
        files
            .iter()
            .map(|p| (name(p), space.row(&Curve::from_csv(std::fs::File::open(p).unwrap(), p).unwrap())))
            .collect(),
    )
}

/// A second minimiser that shares nothing with ours: multiplicative updates `a_k <- a_k exp(-eta slope_k)`
/// with the platform's cube root and a step that halves when the distance rises.
fn mirror_descent(space: &Space, curves: &Table, target: &[f64], rounds: usize) -> f64 {
    let k = curves.len();
    let mut a = vec![1.0 / k as f64; k];
    let mut eta = 1.0;
    let mut best = space.distance(&mixture(curves, &a), target);
    for _ in 0..rounds {
        let mix = mixture(curves, &a);
        let pull: Vec<f64> = (0..space.columns())
            .map(|j| {
                let (c, w) = (space.radiance()[j], space.weight()[j]);
                let root = (mix[j] * c).cbrt();
                w * w * (root - (target[j] * c).cbrt()) / (root * root) * c
            })
            .collect();
        let slope: Vec<f64> = (0..k).map(|i| dot(curves.row(i), &pull)).collect();
        let scale = slope.iter().fold(0.0f64, |m, s| m.max(s.abs())).max(1e-300);
        let mut next: Vec<f64> =
            a.iter().zip(&slope).map(|(a, s)| a.max(1e-12) * (-eta * s / scale).exp()).collect();
        let sum: f64 = next.iter().sum();
        next.iter_mut().for_each(|v| *v /= sum);
        let d = space.distance(&mixture(curves, &next), target);
        if d < best {
            (a, best, eta) = (next, d, eta * 1.1);
        } else {
            eta *= 0.5;
        }
    }
    best
}

#[test]
fn distances_are_the_spaces() {
    let space = Space::half_angle(32);
    let curves = library(&space);
    let hull = hull_of(&space, &curves);
    for i in 0..curves.len() {
        let mut one = vec![0.0; curves.len()];
        one[i] = 1.0;
        let target = hull.target(curves.row((i + 20) % curves.len())).unwrap();
        let expected = space.distance(curves.row(i), curves.row((i + 20) % curves.len()));
        assert!((at(&hull, &one, &target) - expected).abs() < 1e-14);
    }
}

/// The prices the solver acts on are half the gradient: checked by central differences of the space's
/// distance.
#[test]
fn slopes_are_the_gradient_of_the_squared_distance() {
    let space = Space::half_angle(16);
    let curves = library(&space);
    let hull = hull_of(&space, &curves);
    let target_row = mixture(&curves, &vec![1.0 / 57.0; 57]);
    let target = hull.target(&target_row).unwrap();
    let a: Vec<f64> = (0..57).map(|i| f64::from((i * 37) % 57 + 1) / (57.0 * 29.0)).collect();
    let mut mixer = Mixer::new();
    mixer.prepare(&hull, &target);
    hull.mix(&a, &mut mixer.trial);
    mixer.linearise(&hull, &target, 0.0);
    for i in 0..57 {
        let slope = dot(hull.rows.row(i), &mixer.pull);
        let moved = |h: f64| {
            let mut b = a.clone();
            b[i] += h;
            space.distance(&mixture(&curves, &b), &target_row).powi(2)
        };
        let h = 1e-6;
        let difference = (moved(h) - moved(-h)) / (2.0 * h);
        assert!(
            (2.0 * slope - difference).abs() < 1e-6 * (1.0 + difference.abs()),
            "{i}: {slope} {difference}"
        );
    }
}

proptest! {
    #![proptest_config(testing::cases(60))]

    #[test]
    fn mixtures_of_the_stacks_are_recovered(
        chosen in prop::collection::vec((0usize..57, 0.05f64..1.0), 1..6),
    ) {
        let space = Space::half_angle(32);
        let curves = library(&space);
        let hull = hull_of(&space, &curves);
        let mut a = vec![0.0; 57];
        chosen.iter().for_each(|&(k, w)| a[k] += w);
        let sum: f64 = a.iter().sum();
        a.iter_mut().for_each(|w| *w /= sum);
        let target = hull.target(&mixture(&curves, &a)).unwrap();
        let best = Mixer::new().best(&hull, &target).unwrap();
        // What the last steps can still win is lost in rounding: of squared distance, some 1e-16.
        prop_assert!(best.fit.distance < 1e-7, "{:?}", best.fit);
        prop_assert!(best.fit.distance.powi(2) <= best.fit.gap + 1e-20, "{:?}", best.fit);
    }

    /// For any target the result is feasible, no vertex and no random mixture is nearer, and where E is
    /// convex the gap bounds them.
    #[test]
    fn no_mixture_is_nearer(
        diffuse in prop::array::uniform3(0.0f64..0.4),
        f0 in prop::array::uniform3(0.0f64..1.0),
        alpha in 0.02f64..0.6,
        others in prop::collection::vec(prop::collection::vec(0.0f64..1.0, 57), 20),
    ) {
        let space = Space::half_angle(32);
        let curves = library(&space);
        let hull = hull_of(&space, &curves);
        let row = space.row(&Curve::sampled(space.angles(), |t| {
            std::array::from_fn(|c| diffuse[c] + f0[c] * inks::ggx::lobe(t, alpha))
        }));
        let target = hull.target(&row).unwrap();
        let best = Mixer::new().best(&hull, &target).unwrap();
        prop_assert!(best.weights.iter().all(|&w| w >= 0.0));
        prop_assert!((best.weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        prop_assert!((at(&hull, &best.weights, &target) - best.fit.objective).abs() < 1e-12);
        for other in &others {
            // Sharpened, so that some are near the faces; and half way, where a minimum that is none would
            // show.
            let mut other: Vec<f64> = other.iter().map(|w| w.powi(8)).collect();
            let sum: f64 = other.iter().sum();
            other.iter_mut().for_each(|w| *w /= sum);
            let near: Vec<f64> = other.iter().zip(&best.weights).map(|(o, b)| 0.001 * o + 0.999 * b).collect();
            prop_assert!(at(&hull, &other, &target) >= best.fit.distance - 1e-9);
            prop_assert!(at(&hull, &near, &target) >= best.fit.distance - 1e-9);
        }
        for k in 0..57 {
            let mut one = vec![0.0; 57];
            one[k] = 1.0;
            prop_assert!(at(&hull, &one, &target) >= best.fit.distance - 1e-12);
        }
    }

    /// Any start ends in the same minimum, and the gap bounds the remaining distance.
    #[test]
    fn the_gap_bounds_what_is_left(start in prop::collection::vec(0.0f64..1.0, 57), stack in 0usize..57) {
        let space = Space::half_angle(32);
        let curves = library(&space);
        let others: Vec<usize> = (0..57).filter(|&k| k != stack).collect();
        let hull = hull_of(&space, &curves).subset(&others);
        let target = hull.target(curves.row(stack)).unwrap();
        let mut mixer = Mixer::new();
        let best = mixer.best(&hull, &target).unwrap();
        let mut a: Vec<f64> = start[..56].to_vec();
        let sum: f64 = a.iter().sum();
        a.iter_mut().for_each(|w| *w /= sum);
        let fit = mixer.refine(&hull, &target, &mut a, 1e-5).unwrap();
        prop_assert!(fit.gap <= 1e-5);
        let excess = fit.distance.powi(2) - best.fit.distance.powi(2);
        prop_assert!(!fit.convex || excess <= fit.gap + 1e-12, "{fit:?} {excess}");
        let exact = mixer.refine(&hull, &target, &mut a, 0.0).unwrap();
        prop_assert!((exact.distance - best.fit.distance).abs() < 1e-6, "{exact:?} {:?}", best.fit);
    }
}

#[test]
fn a_second_minimiser_finds_no_nearer_mixture_of_measured_materials() {
    let space = Space::half_angle(32);
    let Some(materials) = measured(&space) else { return };
    let curves = library(&space);
    let hull = hull_of(&space, &curves);
    let mut mixer = Mixer::new();
    for (name, row) in materials.iter().step_by(9) {
        let best = mixer.best(&hull, &hull.target(row).unwrap()).unwrap();
        let other = mirror_descent(&space, &curves, row, 4000);
        // First-order descent stops short of the minimum, never below it.
        assert!(best.fit.distance <= other + 1e-9 && other < best.fit.distance + 3e-3, "{name} {other}");
    }
}

/// The prototype found a mean of 0.0400 with its own rounding of the library, and all starts agreed.
#[test]
fn measured_materials_are_as_far_as_the_prototype_saw() {
    let space = Space::half_angle(32);
    let Some(materials) = measured(&space) else { return };
    let hull = hull_of(&space, &library(&space));
    let mut mixer = Mixer::new();
    let mut sum = 0.0;
    for (name, row) in &materials {
        let best = mixer.best(&hull, &hull.target(row).unwrap()).unwrap();
        assert_eq!(best.agreeing, best.starts, "{name}");
        assert!(best.fit.gap < 1e-7 && best.fit.steps < 40, "{name} {:?}", best.fit);
        sum += best.fit.distance;
    }
    let mean = sum / materials.len() as f64;
    assert!((mean - 0.0400).abs() < 3e-4, "{mean}");
}

/// How many of the 57 stacks the others can replace: the model's own redundancy figures.
#[test]
fn six_stacks_are_nearly_mixtures_of_the_others() {
    let space = Space::half_angle(32);
    let curves = library(&space);
    let all = hull_of(&space, &curves);
    let mut mixer = Mixer::new();
    let mut distances: Vec<f64> = (0..57)
        .map(|i| {
            let hull = all.subset(&(0..57).filter(|&k| k != i).collect::<Vec<_>>());
            mixer.best(&hull, &hull.target(curves.row(i)).unwrap()).unwrap().fit.distance
        })
        .collect();
    distances.sort_by(f64::total_cmp);
    let within = |d: f64| distances.iter().filter(|&&x| x < d).count();
    assert_eq!((within(0.002), within(0.01)), (6, 22));
    assert!((distances[28] - 0.015).abs() < 5e-4, "{}", distances[28]);
}

/// Nothing in the solver knows about half angles: random configurations with their own cosines and weights.
#[test]
fn any_tabulation_goes_through_the_same_code() {
    let cosine: Vec<f64> = (0..41).map(|n| 0.1 + 0.9 * f64::from((n * 17) % 41) / 41.0).collect();
    let measure: Vec<f64> = (0..41).map(|n| 0.002 + f64::from((n * 29) % 41) / 2000.0).collect();
    let space = Space::tabulated(&cosine, &measure).unwrap();
    let mut curves = Table::new(space.columns());
    for k in 0..23 {
        let value = |j: usize| (0.3 * ((k * 31 + j * 7) % 23) as f64 / 23.0).powi(2) + 0.002 * (j % 3) as f64;
        curves.push(&(0..space.columns()).map(value).collect::<Vec<_>>());
    }
    let hull = hull_of(&space, &curves);
    let mut mixer = Mixer::new();
    let mut weights = vec![0.0; 23];
    (weights[3], weights[11], weights[17]) = (0.5, 0.3, 0.2);
    let inside = mixer.best(&hull, &hull.target(&mixture(&curves, &weights)).unwrap()).unwrap();
    assert!(inside.fit.distance < 1e-11, "{:?}", inside.fit);
    let outside: Vec<f64> = (0..space.columns()).map(|j| 0.05 + 0.4 * ((j * 5) % 9) as f64 / 9.0).collect();
    let best = mixer.best(&hull, &hull.target(&outside).unwrap()).unwrap();
    let other = mirror_descent(&space, &curves, &outside, 6000);
    assert!(best.fit.distance <= other + 1e-9 && other < best.fit.distance + 2e-3, "{other} {:?}", best.fit);
}

/// Two stacks that look the same: the one with fewer layers wins, at no distance.
#[test]
fn ties_go_to_fewer_layers() {
    let space = Space::half_angle(32);
    let mut curves = library(&space);
    let copy = curves.row(8).to_vec();
    curves.push(&copy);
    let target = [curves.row(0), &copy].map(|r| r.to_vec());
    let target: Vec<f64> = target[0].iter().zip(&target[1]).map(|(a, b)| 0.4 * a + 0.6 * b).collect();
    for (dear, cheap) in [(8, 57), (57, 8)] {
        let mut price = vec![LAYER_PRICE; 58];
        price[0] = 0.0;
        price[dear] = 3.0 * LAYER_PRICE;
        let hull = Hull::new(&space, &curves, &price, 0.0).unwrap();
        let best = Mixer::new().best(&hull, &hull.target(&target).unwrap()).unwrap();
        assert!(best.weights[dear] < 1e-9 && best.weights[cheap] > 0.55, "{:?}", best.weights);
        assert!(best.fit.distance < 1e-3);
    }
}

#[test]
fn polishing_stays_on_the_support() {
    let space = Space::half_angle(32);
    let curves = library(&space);
    let hull = hull_of(&space, &curves);
    let target = hull.target(curves.row(31)).unwrap();
    let mut a = vec![0.0; 57];
    (a[1], a[8]) = (0.9, 0.1);
    let fit = Mixer::new().polish(&hull, &target, &mut a, 0.0).unwrap();
    assert!(a.iter().enumerate().all(|(k, &w)| w == 0.0 || k == 1 || k == 8));
    // One unknown is left: compare with a fine scan of it.
    let scan = (0..=100_000)
        .map(|i| {
            let mut b = vec![0.0; 57];
            (b[1], b[8]) = (f64::from(i) / 1e5, 1.0 - f64::from(i) / 1e5);
            at(&hull, &b, &target)
        })
        .fold(f64::INFINITY, f64::min);
    assert!(fit.distance <= scan + 1e-12 && fit.distance > scan - 1e-6, "{} {scan}", fit.distance);
}

#[test]
fn black_white_and_blinding_targets_are_mapped() {
    let space = Space::half_angle(32);
    let hull = hull_of(&space, &library(&space));
    for value in [0.0, 1e-300, 1.0, 1e6, 1e30] {
        let target = hull.target(&vec![value; space.columns()]).unwrap();
        let best = Mixer::new().best(&hull, &target).unwrap();
        assert!(best.fit.distance.is_finite() && (best.weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
    }
}

#[test]
fn bad_numbers_are_named() {
    let space = Space::half_angle(4);
    let row = |v: f64| {
        let mut table = Table::new(12);
        table.push(&[v; 12]);
        table
    };
    let error = Hull::new(&space, &row(f64::NAN), &[0.0], 0.0).unwrap_err();
    assert!(matches!(error, MixtureError::Value { column: 0, .. }));
    assert!(matches!(
        Hull::new(&space, &row(1.0), &[], 0.0),
        Err(MixtureError::Length { stacks: 1, found: 0 })
    ));
    assert!(matches!(Hull::new(&space, &Table::new(12), &[], 0.0), Err(MixtureError::NoStacks)));
    let hull = Hull::new(&space, &row(1.0), &[0.0], 0.0).unwrap();
    let mut target = vec![1.0; 12];
    target[7] = f64::INFINITY;
    assert!(matches!(hull.target(&target), Err(MixtureError::Value { column: 7, .. })));
    target[7] = f64::NAN;
    assert!(hull.target(&target).is_err());
    assert!(matches!(hull.target(&[1.0; 11]), Err(MixtureError::Columns { expected: 12, found: 11, .. })));
    let target = hull.target(&[1.0; 12]).unwrap();
    assert!(Mixer::new().refine(&hull, &target, &mut [1.0, 0.0], 0.0).is_err());
}

/// With a weight for light, the optimum is that of the distance in light and distance d together, found by
/// a search over all mixtures of two stacks with the space's own distances.
#[test]
fn light_is_weighed_beside_the_curve() {
    let space = Space::half_angle(32);
    let all = library(&space);
    let at = |stack: &str| {
        let found = Library::builtin().entries().iter().position(|e| e.stack == stack.parse().unwrap());
        found.unwrap()
    };
    let target = surface(&space, 0.02);
    for light in [0.0, 0.2, 0.5, 2.0] {
        let mut two = Table::new(space.columns());
        [at("C+M+Y+F"), at("P+SF")].iter().for_each(|&k| two.push(all.row(k)));
        let hull = Hull::new(&space, &two, &[0.0; 2], light).unwrap();
        let best = Mixer::new().best(&hull, &hull.target(&target).unwrap()).unwrap();
        let both = |s: f64| {
            if light > 0.0 {
                return written_out(&space, &two, &[1.0 - s, s], &target, light);
            }
            space.distance(&mixture(&two, &[1.0 - s, s]), &target)
        };
        let scan = (0..=2000).map(|i| both(f64::from(i) / 2000.0)).fold(f64::INFINITY, f64::min);
        assert!(
            best.fit.objective <= scan + 1e-9 && scan < best.fit.objective + 1e-5,
            "{light}: {:?} {scan}",
            best.fit
        );
        assert!((space.distance(&mixture(&two, &best.weights), &target) - best.fit.curve).abs() < 1e-9);
    }
}

/// The objective of a mixture written out: distance d, light and grain under one root, and hue in the dark
/// beside it, the difference in chromaticity of the mean reflectance beyond 45 degrees, weighted by solid
/// angle and cosine as d is, with the variance of places of a millimetre: of how far each stack takes the
/// chromaticity of the whole.
fn written_out(space: &Space, curves: &Table, weights: &[f64], target: &[f64], light: f64) -> f64 {
    let mean = |row: &[f64], channel: usize| {
        let (mut sum, mut all) = (0.0, 0.0);
        for (n, t) in space.angles().iter().enumerate().filter(|(_, t)| t.to_degrees() > 45.0) {
            let share = t.sqrt() * t.sin() * t.cos();
            sum += share * row[3 * n + channel];
            all += share;
        }
        sum / all + 0.0003
    };
    let chromaticity = |row: &[f64]| {
        let of: [f64; 3] = std::array::from_fn(|channel| mean(row, channel));
        let level = of.iter().sum::<f64>() / 3.0;
        of.map(|f| f / level)
    };
    let mix = mixture(curves, weights);
    let squared = |row: &[f64]| {
        space.distance(row, target).powi(2) + (light * space.light_distance(row, target)).powi(2)
    };
    let grain: f64 = weights.iter().zip(curves.rows()).map(|(w, row)| w * squared(row)).sum();
    let both = chromaticity(target).into_iter().zip(chromaticity(&mix));
    let level = |row: &[f64]| (0..3).map(|channel| mean(row, channel)).sum::<f64>() / 3.0;
    let whole = (chromaticity(&mix), level(&mix));
    let spread = weights.iter().zip(curves.rows()).map(|(w, row)| {
        let by = (0..3).map(|c| (chromaticity(row)[c] - whole.0[c]) * level(row) / whole.1);
        w * by.map(|r| r * r).sum::<f64>()
    });
    // Clusters of four dots with a share of a tenth, in places of 24 x 24 dots.
    let place = 4.0 / 576.0 / (1.0 + (14.4f64 / 1.5).powi(2));
    let apart = (both.map(|(a, b)| (a - b).powi(2)).sum::<f64>() + place * spread.sum::<f64>()).sqrt();
    let hue = if apart > 0.1 { apart - 0.05 } else { apart.powi(2) / 0.2 };
    (squared(&mix) + 0.0002 * grain).sqrt() + 0.1 * hue
}

/// Of a reddish and a bluish black, both too light: neither alone is as near to dark metal as the mixture
/// of its hue, and the slope of what is minimised is that of the formula.
#[test]
fn hue_in_the_dark_is_weighed_beside_the_rest() {
    let space = Space::half_angle(32);
    let mut two = Table::new(space.columns());
    for tint in [[3.0, 1.0, 1.0], [1.0, 1.2, 2.0]] {
        two.push(&tint.repeat(32).iter().map(|f| 0.001 * f).collect::<Vec<_>>());
    }
    for (f0, alpha) in [(0.05, 0.02), (0.1, 0.1), (0.14, 0.2)] {
        let curve = |t: f64| [0.75, 0.9, 1.0].map(|c| c * f0 * inks::ggx::lobe(t, alpha));
        let target = space.row(&Curve::sampled(space.angles(), curve));
        let hull = Hull::new(&space, &two, &[0.0; 2], 0.28).unwrap();
        let best = Mixer::new().best(&hull, &hull.target(&target).unwrap()).unwrap();
        let all = |s: f64| written_out(&space, &two, &[1.0 - s, s], &target, 0.28);
        let scan = (0..=2000).map(|i| all(f64::from(i) / 2000.0)).fold(f64::INFINITY, f64::min);
        assert!(
            best.fit.objective <= scan + 1e-9 && scan < best.fit.objective + 1e-6,
            "{f0}: {best:?} {scan}"
        );
        assert!(best.weights.iter().all(|&w| w > 0.02), "{f0}: {best:?}");
        // The certificate counts what hue costs, so it is no smaller than that.
        let without = Mixer::new()
            .best(&hull.clone().with_constants([0.0, 1.0, 1.0, 1.0, 0.0]), &hull.target(&target).unwrap())
            .unwrap();
        let without_hue = |s: f64| {
            let mix = mixture(&two, &[1.0 - s, s]);
            space.distance(&mix, &target).powi(2) + (0.28 * space.light_distance(&mix, &target)).powi(2)
        };
        let cost = without_hue(best.weights[1]) - without_hue(without.weights[1]);
        assert!((-1e-12..=best.fit.gap + 1e-12).contains(&cost), "{cost} {:?}", best.fit);
    }
}

/// Smooth silver.
fn surface(space: &Space, alpha: f64) -> Vec<f64> {
    space
        .row(&Curve::sampled(space.angles(), |t| [0.97, 0.96, 0.92].map(|f0| f0 * inks::ggx::lobe(t, alpha))))
}

/// A matt surface returns its own reflectance; of a narrow lobe, by adaptive refinement of the integral.
#[test]
fn the_albedo_is_the_integral_it_says() {
    let space = Space::half_angle(32);
    let [a, b, c] = space.albedo(&[0.1, 0.2, 0.3].repeat(32));
    // The rule of the metric's own quadrature is .1 % off for a constant.
    for (found, reflectance) in [(a, 0.1), (b, 0.2), (c, 0.3)] {
        assert!((found / reflectance - 1.0f64).abs() < 2e-3, "{found}, not {reflectance}");
    }
    for alpha in [0.06, 0.12, 0.3] {
        let lobe = |t: f64| 0.9 * inks::ggx::lobe(t, alpha);
        let row: Vec<f64> = space.angles().iter().flat_map(|&t| [lobe(t); 3]).collect();
        // (1/pi) times the integral over the hemisphere of f(theta_o / 2) cos theta_o.
        let n = 200_000;
        let step = std::f64::consts::FRAC_PI_2 / f64::from(n);
        let sum: f64 = (0..n)
            .map(|i| (f64::from(i) + 0.5) * step)
            .map(|t| 2.0 * lobe(0.5 * t) * t.cos() * t.sin() * step)
            .sum();
        let found = space.albedo(&row)[0];
        assert!((found / sum - 1.0).abs() < 0.01, "{alpha}: {found} {sum}");
    }
}

/// Smooth silver, matt black, dark metal of a hue, and random ones: a second minimiser of the objective as
/// it is written out, which moves weight between two stacks at a time by golden sections, finds nothing
/// lower from where ours ends, from its own starts or from those of ours.
#[test]
fn a_second_solver_finds_no_lower_objective() {
    let space = Space::half_angle(16);
    let curves =
        Printable::from_library(&Library::builtin(), &"process,MS,finish,primer".parse().unwrap(), &space)
            .curves;
    let hull = Hull::new(&space, &curves, &vec![0.0; curves.len()], 0.28).unwrap();
    let mut random = 0.37f64;
    let mut draw = |low: f64, high: f64| {
        random = (random * 997.0 + 0.618_034).fract();
        low * (high / low).powf(random)
    };
    let cases = if testing::is_full() { 200 } else { 12 };
    for case in 0..cases {
        let (diffuse, f0) = ([(); 3].map(|()| draw(0.0005, 0.6)), [(); 3].map(|()| draw(0.01, 0.6)));
        let alpha = draw(0.05, 0.6);
        let target = space.row(&Curve::sampled(space.angles(), |t| {
            std::array::from_fn(|c| diffuse[c] / std::f64::consts::PI + f0[c] * inks::ggx::lobe(t, alpha))
        }));
        let best = Mixer::new().best(&hull, &hull.target(&target).unwrap()).unwrap();
        let of = |a: &[f64]| written_out(&space, &curves, a, &target, 0.28);
        assert!((of(&best.weights) - best.fit.objective).abs() < 1e-9, "{case}: {best:?}");
        let mut a = best.weights.clone();
        let mut least = best.fit.objective;
        for _ in 0..2 {
            let k = curves.len();
            for (i, j) in (0..k * k).map(|pair| (pair / k, pair % k)).filter(|(i, j)| i != j) {
                let (from, moved) = (a.clone(), a[i]);
                if moved <= 0.0 {
                    continue;
                }
                for part in [1e-4, 1e-3, 0.01, 0.1, 0.3, 1.0] {
                    let mut other = from.clone();
                    other[i] -= part * moved;
                    other[j] += part * moved;
                    let found = of(&other);
                    if found < least {
                        (least, a) = (found, other);
                    }
                }
            }
        }
        assert!(best.fit.objective <= least + 1e-6, "{case}: {} {least}, {:?}", best.fit.objective, best.fit);
    }
}

/// A target for which light counts so many times is fitted as by a hull that gives light so much weight.
#[test]
fn light_that_counts_more_for_a_target_is_light_of_more_weight() {
    let space = Space::half_angle(16);
    let curves = library(&space);
    let hull = |light: f64| Hull::new(&space, &curves, &vec![0.0; curves.len()], light).unwrap();
    let row: Vec<f64> = mixture(&curves, &vec![1.0 / 57.0; 57]).iter().map(|f| 3.0 * f).collect();
    let mut target = hull(0.28).target(&row).unwrap();
    target.light = 2.5;
    let found = Mixer::new().best(&hull(0.28), &target).unwrap();
    let right = Mixer::new().best(&hull(0.7), &hull(0.7).target(&row).unwrap()).unwrap();
    assert!((found.fit.objective - right.fit.objective).abs() < 1e-9, "{:?} {:?}", found.fit, right.fit);
    assert!((found.fit.distance - right.fit.distance).abs() < 1e-9);
}
